// The frame that is looked at: every scrubber of the page shows it and can change it.
const get = id => document.getElementById(id);

const report = JSON.parse(get("frames-data").textContent);  // {rate, gain, frames3d, images: [{frame, errors, files}]}
const imagesOf = new Map(report.images.map(entry => [entry.frame, entry]));

const timeline = (() => {
  const numbers = new Set(imagesOf.keys());
  for (let t = 0; t < report.frames3d; ++t) numbers.add(t);
  const frames = [...numbers].sort((a, b) => a - b);
  const scrubbers = [...document.querySelectorAll(".scrubber")];
  const listeners = [];
  let index = +scrubbers[0].querySelector("input").value;
  let timer = null;

  const go = to => {
    index = (to + frames.length) % frames.length;
    for (const scrubber of scrubbers) {
      scrubber.querySelector("input").value = index;
      scrubber.querySelector(".frame-name").textContent = "frame " + frames[index];
    }
    for (const listener of listeners) listener(frames[index]);
  };
  const stop = () => {
    clearInterval(timer);
    timer = null;
    for (const scrubber of scrubbers) scrubber.querySelector(".play").textContent = "play";
  };
  const play = () => {
    timer = setInterval(() => go(index + 1), 1000 / Math.min(30, report.rate));
    for (const scrubber of scrubbers) scrubber.querySelector(".play").textContent = "stop";
  };
  for (const scrubber of scrubbers) {
    scrubber.querySelector("input").addEventListener("input", event => { stop(); go(+event.target.value); });
    scrubber.querySelector(".previous").addEventListener("click", () => { stop(); go(index - 1); });
    scrubber.querySelector(".next").addEventListener("click", () => { stop(); go(index + 1); });
    scrubber.querySelector(".play").addEventListener("click", () => timer ? stop() : play());
  }
  return {
    get frame() { return frames[index]; },
    get next() { return frames[(index + 1) % frames.length]; },
    onChange(listener) { listeners.push(listener); },
    goNear(frame) {
      const away = frames.map(each => Math.abs(each - frame));
      stop();
      go(away.indexOf(Math.min(...away)));
    },
    start() { go(index); },
  };
})();
