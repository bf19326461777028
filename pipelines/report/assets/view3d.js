// The 3D view: what is shown in a frame, and the eye that turns around it.
const colors3d = { body: [0.76, 0.8, 0.88, 1], truth: [0.2, 0.9, 0.5, 0.5], camera: [1, 0.85, 0.3, 1],
  path: [1, 0.85, 0.3, 0.7], skeleton: [0.35, 0.75, 1, 1], grid: [0.5, 0.55, 0.6, 0.35] };

// Where one looks from: around `target`, z up; or through the reconstructed camera.
const makeEye = (camera, target) => {
  const from = minus(centerOf(camera), target), distance = Math.hypot(...from);
  const first = { target, yaw: Math.atan2(from[1], from[0]) + 0.55,  // beside the camera, above it and behind
    pitch: Math.min(1.2, Math.asin(from[2] / distance) + 0.2), distance: 1.3 * distance };
  const eye = { ...first, follows: false };
  eye.reset = () => Object.assign(eye, first, { follows: false });
  eye.turn = (yaw, pitch) => {
    eye.follows = false;
    eye.yaw += yaw;
    eye.pitch = Math.min(1.5, Math.max(-1.5, eye.pitch + pitch));
  };
  eye.zoom = by => {
    eye.follows = false;
    eye.distance = Math.min(200, Math.max(0.1, eye.distance * by));
  };
  eye.rotation = () => {
    const ahead = [-Math.cos(eye.pitch) * Math.cos(eye.yaw), -Math.cos(eye.pitch) * Math.sin(eye.yaw),
      -Math.sin(eye.pitch)];
    const right = unit(cross(ahead, [0, 0, 1]));
    return [...right, ...cross(ahead, right), ...ahead];
  };
  eye.pan = (right, down) => {  // metres
    const r = eye.rotation();
    eye.follows = false;
    eye.target = plus(eye.target, plus(times(r.slice(0, 3), right), times(r.slice(3, 6), down)));
  };
  eye.pose = () => {
    const rotation = eye.rotation();
    return { rotation, translation: plus(times(turned(rotation, eye.target), -1), [0, 0, eye.distance]) };
  };
  return eye;
};

// OpenCV's camera axes to WebGL's clip space.
const projectionOf = (fx, fy, cx, cy, width, height) => {
  const near = 0.05, far = 500;
  return new Float32Array([2 * fx / width, 0, 0, 0, 0, -2 * fy / height, 0, 0,
    2 * cx / width - 1, 1 - 2 * cy / height, (far + near) / (far - near), 1, 0, 0, -2 * far * near / (far - near), 0]);
};

const startView3d = async () => {
  const canvas = get("view3d-canvas");
  if (!canvas) return;
  const tell = text => {
    get("view3d-message").textContent = text;
    get("view3d-message").hidden = !text;
  };
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
  if (!gl) return tell("This browser shows no WebGL 2, which the 3D view needs. The rest of the report does not.");
  if (typeof DecompressionStream === "undefined")
    return tell("This browser is too old for the 3D view: it cannot unpack gzip.");
  canvas.addEventListener("webglcontextlost",
    () => tell("The graphics driver has dropped the 3D view; load the page anew."));

  const data = await readView3d(get("view3d-data").textContent);
  const drawSplats = makeSplats(gl, data), drawMesh = makeMesh(gl, data), drawLines = makeLines(gl);
  const frames = data["body/translations"].length / 3, objects = data.shapes["objects/poses"][1];
  const [width, height, fx, fy, cx, cy] = data["cameras/intrinsics"];
  const cameraOf = t => poseOf(data["cameras/poses"], t);
  const parents = data["skeleton/parents"], middle = poseSkeleton(data, "body", frames >> 1).places;
  const eye = makeEye(cameraOf(frames >> 1), middle[0]);
  const floor = Math.min(...[0, frames >> 1, frames - 1]
    .flatMap(t => poseSkeleton(data, "body", t).places.map(place => place[2])));
  const pairs = list => list.slice(1).flatMap((point, i) => [list[i], point]);
  const path = pairs(Array.from({ length: frames }, (_, t) => centerOf(cameraOf(t))));
  const others = [];  // people beside the first one
  while (data[`others/${others.length + 1}/translations`]) others.push(`others/${others.length + 1}`);
  const hasTruth = !!data["truth/translations"];
  const shows = name => get("show-" + name)?.checked;
  if (!drawMesh) get("show-skeleton").checked = true;
  for (const [name, isThere] of [["truth", hasTruth && drawMesh], ["body", drawMesh], ["objects", objects > 0]])
    get("show-" + name).parentElement.hidden = !isThere;

  const grid = Array.from({ length: 11 }, (_, i) => i - 5).flatMap(k => [[k, -5], [k, 5], [-5, k], [5, k]])
    .map(([x, y]) => [middle[0][0] + x, middle[0][1] + y, floor]);

  const frustum = (camera, depth) => {
    const back = transposed(camera.rotation), at = centerOf(camera);
    const corners = [[0, 0], [width, 0], [width, height], [0, height]].map(([u, v]) =>
      plus(at, turned(back, [(u - cx) / fx * depth, (v - cy) / fy * depth, depth])));
    return [...pairs([...corners, corners[0]]), ...corners.flatMap(corner => [at, corner])];
  };
  const bones = places => places.flatMap((place, j) => parents[j] < 0 ? [] : [places[parents[j]], place]);

  const eyeCamera = t => {
    const w = canvas.width, h = canvas.height;
    if (!eye.follows) {
      const f = 1.2 * Math.min(h, w);
      return { view: eye.pose(), fx: f, fy: f, width: w, height: h, projection: projectionOf(f, f, w / 2, h / 2, w, h) };
    }
    const s = Math.min(w / width, h / height), u = w / 2 + (cx - width / 2) * s, v = h / 2 + (cy - height / 2) * s;
    return { view: cameraOf(t), fx: fx * s, fy: fy * s, width: w, height: h,
      projection: projectionOf(fx * s, fy * s, u, v, w, h) };
  };

  // The true body is a veil over the other wherever it is: by depth the two would fight for each pixel. One layer of it,
  // so its depths come first; then those of the body join them, for what is drawn behind.
  const drawBodies = (camera, transforms, t) => {
    if (shows("body")) drawMesh(camera, transforms, colors3d.body);
    if (!shows("truth") || !hasTruth) return;
    const truth = poseSkeleton(data, "truth", t).transforms;
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.colorMask(false, false, false, false);
    drawMesh(camera, truth, colors3d.truth);
    gl.colorMask(true, true, true, true);
    gl.depthFunc(gl.LEQUAL);
    drawMesh(camera, truth, colors3d.truth);
    gl.depthFunc(gl.LESS);
    if (!shows("body")) return;
    gl.colorMask(false, false, false, false);
    drawMesh(camera, transforms, colors3d.body);
    gl.colorMask(true, true, true, true);
  };

  const draw = t => {
    const camera = eyeCamera(t), body = poseSkeleton(data, "body", t);
    const worlds = [identity];
    for (let o = 0; o < objects; ++o) worlds.push(poseOf(data["objects/poses"], objects * t + o));
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.12, 0.14, 0.17, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (drawMesh) drawBodies(camera, body.transforms, t);
    if (!shows("scene")) drawLines(camera, grid, colors3d.grid);
    if (shows("camera") && !eye.follows) {
      drawLines(camera, path, colors3d.path);
      drawLines(camera, frustum(cameraOf(t), 0.4), colors3d.camera);
    }
    const cut = shows("cut") && !eye.follows ? Math.max(0.05, eye.distance - 0.9) : 0.05;
    drawSplats(camera, worlds, worlds.map((_, part) => shows(part === 0 ? "scene" : "objects")), cut);
    gl.disable(gl.DEPTH_TEST);
    if (shows("skeleton")) drawLines(camera, bones(body.places), colors3d.skeleton);
    for (const other of others) drawLines(camera, bones(poseSkeleton(data, other, t).places), colors3d.body);
    canvas.dataset.frame = t;
    canvas.dataset.drawn = 1 + +(canvas.dataset.drawn ?? 0);
  };

  let waits = false;
  const ask = () => {
    if (waits) return;
    waits = true;
    requestAnimationFrame(() => {
      waits = false;
      draw(Math.min(frames - 1, Math.max(0, timeline.frame)));
    });
  };
  const resize = () => {
    const box = canvas.getBoundingClientRect(), ratio = Math.min(2, window.devicePixelRatio || 1);
    canvas.width = Math.max(1, Math.round(box.width * ratio));
    canvas.height = Math.max(1, Math.round(box.height * ratio));
    ask();
  };

  // ---- Hands ----
  const fingers = new Map();  // by pointer: where it was last
  const apart = () => {
    const [a, b] = [...fingers.values()];
    return { gap: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
  };
  const metresPerPixel = () => eye.distance / (1.2 * Math.min(canvas.clientHeight, canvas.clientWidth));
  canvas.addEventListener("pointerdown", event => {
    canvas.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY, pans: event.button !== 0 || event.shiftKey });
    event.preventDefault();
  });
  canvas.addEventListener("pointermove", event => {
    const finger = fingers.get(event.pointerId);
    if (!finger) return;
    const dx = event.clientX - finger.x, dy = event.clientY - finger.y;
    const before = fingers.size === 2 ? apart() : null;
    finger.x = event.clientX;
    finger.y = event.clientY;
    if (before) {
      const now = apart();
      eye.zoom(before.gap / Math.max(1, now.gap));
      eye.pan((before.x - now.x) * metresPerPixel(), (before.y - now.y) * metresPerPixel());
    } else if (finger.pans) {
      eye.pan(-dx * metresPerPixel(), -dy * metresPerPixel());
    } else {
      eye.turn(-0.008 * dx, 0.008 * dy);
    }
    ask();
  });
  for (const end of ["pointerup", "pointercancel"])
    canvas.addEventListener(end, event => fingers.delete(event.pointerId));
  canvas.addEventListener("contextmenu", event => event.preventDefault());
  canvas.addEventListener("wheel", event => {
    if (document.activeElement !== canvas) return;  // the page scrolls until the view was touched
    event.preventDefault();
    eye.zoom(Math.exp(0.0012 * Math.max(-300, Math.min(300, event.deltaY))));
    ask();
  }, { passive: false });
  canvas.addEventListener("keydown", event => {
    const deeds = { ArrowLeft: () => eye.turn(-0.1, 0), ArrowRight: () => eye.turn(0.1, 0),
      ArrowUp: () => eye.turn(0, 0.1), ArrowDown: () => eye.turn(0, -0.1), "+": () => eye.zoom(0.9),
      "=": () => eye.zoom(0.9), "-": () => eye.zoom(1.1) };
    if (!deeds[event.key]) return;
    event.preventDefault();
    deeds[event.key]();
    ask();
  });
  get("view3d-reset").addEventListener("click", () => { eye.reset(); ask(); });
  get("view3d-follow").addEventListener("click", () => { eye.follows = true; ask(); });
  for (const box of document.querySelectorAll("#view3d input[type=checkbox]")) box.addEventListener("change", ask);

  tell("");
  new ResizeObserver(resize).observe(canvas);
  timeline.onChange(ask);
  resize();
};
