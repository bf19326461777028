// Two images of a frame with a divider between them that is dragged, and a third beside them.
const startImages = () => {
  if (!get("compare")) return;
  const compare = get("compare"), edge = get("edge"), canvas = get("compare-canvas"), other = get("other-canvas");
  const loaded = new Map();  // by URL: the image, and the promise of it
  let share = 50;            // percent of the width that the left image has
  let wanted = 0;            // counts requests, so that only the last is painted
  let shown = {};            // what is painted: {left, right, other}

  const load = url => {
    if (!loaded.has(url)) {
      const image = new Image();
      image.src = url;
      loaded.set(url, image.decode().then(() => image, () => null));
    }
    return loaded.get(url);
  };

  // |target - render|, made larger by doubling it: light added to itself.
  const difference = (a, b) => {
    const result = document.createElement("canvas");
    result.width = a.naturalWidth;
    result.height = a.naturalHeight;
    const context = result.getContext("2d");
    context.drawImage(a, 0, 0, result.width, result.height);
    context.globalCompositeOperation = "difference";
    context.drawImage(b, 0, 0, result.width, result.height);
    context.globalCompositeOperation = "lighter";
    for (let gain = 1; gain < report.gain; gain *= 2) context.drawImage(result, 0, 0);
    return result;
  };

  const picture = async (frame, kind) => {
    const files = imagesOf.get(frame)?.files ?? {};
    if (kind !== "difference") return files[kind] ? load(files[kind]) : null;
    if (!files.target || !files.render) return null;
    const [a, b] = await Promise.all([load(files.target), load(files.render)]);
    return a && b ? difference(a, b) : null;
  };

  const widthOf = image => image.naturalWidth ?? image.width;
  const heightOf = image => image.naturalHeight ?? image.height;

  // Pixels are shown whole: small images are enlarged by 2, 3, ...; images wider than their place are shrunk.
  const fit = (target, image) => {
    const size = widthOf(image), room = target.closest("figure").clientWidth;
    const times = size <= room ? Math.max(1, Math.floor(Math.min(room, 640) / size)) : 0;
    const box = target.closest(".frame-box");
    box.style.width = times ? size * times + "px" : "";
    target.classList.toggle("whole", times > 1);
  };

  // The largest of the images says how large both canvases are: what is less detailed is drawn to its size.
  const prepare = target => {
    const images = [shown.left, shown.right, shown.beside].filter(image => image);
    const largest = images.reduce((a, b) => widthOf(b) > widthOf(a) ? b : a);
    if (target.width !== widthOf(largest)) target.width = widthOf(largest);
    if (target.height !== heightOf(largest)) target.height = heightOf(largest);
    fit(target, largest);
    const context = target.getContext("2d");
    context.imageSmoothingQuality = "high";
    return context;
  };

  const showPlace = (box, absent, isThere) => {
    box.hidden = !isThere;
    absent.hidden = isThere;
  };

  const paint = () => {
    const { left, right, beside } = shown;
    showPlace(compare, get("compare-absent"), !!(left && right));
    if (left && right) {
      const context = prepare(canvas), { width, height } = canvas;
      context.drawImage(left, 0, 0, width, height);
      context.save();
      context.beginPath();
      context.rect(width * share / 100, 0, width, height);
      context.clip();
      context.drawImage(right, 0, 0, width, height);
      context.restore();
    }
    showPlace(get("other"), get("other-absent"), !!beside);
    if (beside) prepare(other).drawImage(beside, 0, 0, other.width, other.height);
  };

  const show = async frame => {
    const ticket = ++wanted;
    get("frame-errors").textContent = imagesOf.get(frame)?.errors ?? "";
    const kinds = ["left", "right", "beside"].map(id => get(id).value);
    const [left, right, beside] = await Promise.all(kinds.map(kind => picture(frame, kind)));
    if (ticket !== wanted) return;
    shown = { left, right, beside };
    paint();
    compare.dataset.frame = frame;
    for (const kind of kinds) picture(timeline.next, kind);
  };

  const moveEdge = to => {
    share = Math.min(100, Math.max(0, to));
    edge.style.left = share + "%";
    edge.setAttribute("aria-valuenow", Math.round(share));
    paint();
  };
  const follow = event => {
    const box = compare.getBoundingClientRect();
    moveEdge(100 * (event.clientX - box.left) / box.width);
  };
  compare.addEventListener("pointerdown", event => {
    compare.setPointerCapture(event.pointerId);
    edge.focus({ preventScroll: true });
    follow(event);
    event.preventDefault();
  });
  compare.addEventListener("pointermove", event => {
    if (compare.hasPointerCapture(event.pointerId)) follow(event);
  });
  edge.addEventListener("keydown", event => {
    const step = event.shiftKey ? 10 : 2;
    const places = { ArrowLeft: share - step, ArrowDown: share - step, ArrowRight: share + step, ArrowUp: share + step,
      Home: 0, End: 100 };
    if (!(event.key in places)) return;
    event.preventDefault();
    moveEdge(places[event.key]);
  });
  const label = () => {
    for (const side of ["left", "right"]) get("tag-" + side).textContent = get(side).selectedOptions[0].textContent;
  };
  for (const id of ["left", "right", "beside"])
    get(id).addEventListener("change", () => { label(); show(timeline.frame); });
  window.addEventListener("resize", paint);
  label();
  moveEdge(share);
  timeline.onChange(show);
};
