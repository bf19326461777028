#include "pipelines/report_style.h"

namespace hsi4d {

std::string_view report_style() {
  return R"css(
:root { color-scheme: light dark; --page: #f6f7f9; --card: #ffffff; --text: #1c2430; --soft: #5d6878; --line: #dde2e9;
  --accent: #2f6fb3; --best: #e3f1e6; --best-text: #1f6b38; --start: #8a94a3; --copy: #d98a2b; --result: #2f7fd0;
  --good: #2c8a4b; --bad: #c23b3b; --wait: #b27a1a; }
@media (prefers-color-scheme: dark) { :root { --page: #12161c; --card: #1b212a; --text: #e4e9f0; --soft: #9aa7b8;
  --line: #313a47; --accent: #6fb1f2; --best: #1d3a28; --best-text: #8fdba8; --start: #98a3b3; --copy: #e5a04b;
  --result: #5aa9f5; --good: #4bb872; --bad: #e86a6a; --wait: #e0ab4d; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--text);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", "Helvetica Neue", "DejaVu Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 28px 20px 60px; }
header { display: flex; flex-wrap: wrap; align-items: baseline; gap: 4px 14px; margin-bottom: 4px; }
h1 { font-size: 26px; margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 18px; margin: 34px 0 10px; }
h3 { font-size: 14px; margin: 0 0 6px; font-weight: 600; }
.badge { padding: 1px 11px; border-radius: 12px; color: #fff; font-size: 13px; font-weight: 600; background: var(--soft); }
.badge.done { background: var(--good); } .badge.failed { background: var(--bad); }
.badge.interrupted, .badge.running { background: var(--wait); }
.message { border-left: 4px solid var(--bad); padding: 6px 12px; background: var(--card); white-space: pre-wrap;
  overflow-wrap: anywhere; }
dl.facts { display: flex; flex-wrap: wrap; gap: 2px 26px; margin: 6px 0 0; font-size: 13.5px; }
dl.facts div { display: flex; gap: 7px; } dl.facts dt { color: var(--soft); }
dl.facts dd { margin: 0; overflow-wrap: anywhere; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(165px, 1fr)); gap: 12px; margin-top: 20px; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 14px 16px; }
.figure .value { font-size: 25px; font-weight: 650; line-height: 1.25; font-variant-numeric: tabular-nums; }
.figure .value small { font-size: 14px; font-weight: 500; color: var(--soft); }
.figure .label, .figure .before { font-size: 13px; color: var(--soft); }
.better { color: var(--good); font-weight: 600; white-space: nowrap; }
.worse { color: var(--bad); font-weight: 600; white-space: nowrap; }
.figure.harmed { border-color: var(--bad); }
.wide { overflow-x: auto; padding: 0; }
table { border-collapse: collapse; width: 100%; font-size: 13.5px; font-variant-numeric: tabular-nums; }
th, td { padding: 7px 12px; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { font-weight: 600; vertical-align: bottom; } thead th { font-size: 12.5px; white-space: normal; min-width: 74px; }
th:first-child, td:first-child { text-align: left; }
tbody tr:last-child th, tbody tr:last-child td { border-bottom: 0; }
th.baseline, td.baseline { color: var(--soft); }
th .unit { font-weight: 400; color: var(--soft); }
table.errors td, table.errors th { padding-top: 4px; padding-bottom: 4px; }
td.best { background: var(--best); color: var(--best-text); font-weight: 650; }
td.none { opacity: 0.5; }
.plots { display: grid; grid-template-columns: repeat(auto-fill, minmax(330px, 1fr)); gap: 14px; }
#losses .plots { grid-template-columns: repeat(auto-fit, minmax(400px, 1fr)); }
svg.plot { width: 100%; height: auto; display: block; }
svg.plot text { font-size: 12px; fill: var(--soft); }
svg.plot .grid { stroke: var(--line); } svg.plot .axis { stroke: var(--soft); }
svg.plot polyline { fill: none; stroke-width: 1.8; stroke-linejoin: round; }
svg.bar { width: 100%; height: 26px; border-radius: 6px; display: block; margin-bottom: 10px; }
.legend { display: flex; flex-wrap: wrap; gap: 2px 18px; font-size: 13px; color: var(--soft); margin: 0 0 10px; }
.key { display: inline-block; width: 20px; height: 0; border-top: 3px solid; vertical-align: middle; margin-right: 6px; }
.key.dashed { border-top-style: dashed; }
.box { display: inline-block; width: 11px; height: 11px; border-radius: 3px; margin-right: 8px; }
.ramp { display: inline-block; width: 90px; height: 8px; border-radius: 4px; vertical-align: middle; margin: 0 7px; }
.caption { font-size: 12.5px; color: var(--soft); margin: 6px 0 0; }
.controls { display: flex; flex-wrap: wrap; align-items: center; gap: 10px; margin-bottom: 12px; }
.controls input[type=range] { flex: 1 1 200px; accent-color: var(--accent); }
button, select { font: inherit; font-size: 14px; padding: 3px 12px; border-radius: 7px; border: 1px solid var(--line);
  background: var(--page); color: var(--text); cursor: pointer; }
.frame-name { min-width: 90px; font-weight: 600; font-variant-numeric: tabular-nums; }
.images { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 512px), 1fr)); gap: 16px; }
figure { margin: 0; } figcaption { font-size: 13px; color: var(--soft); margin-top: 4px; text-align: center; }
figcaption.controls { margin: 8px auto 0; max-width: 512px; flex-wrap: nowrap; }
figcaption.controls input[type=range] { flex: 1 1 60px; min-width: 60px; }
figcaption label { white-space: nowrap; }
.images img { width: 100%; display: block; margin: 0 auto; border-radius: 6px; background: #8883; }
.images img.whole { image-rendering: pixelated; }
.absent { aspect-ratio: 1; display: grid; place-items: center; border: 1px dashed var(--line); border-radius: 6px;
  color: var(--soft); }
.frame-errors { font-size: 13px; color: var(--soft); margin: 0 0 12px; min-height: 1.5em; }
.compare { position: relative; margin: 0 auto; }
.compare .over { position: absolute; inset: 0; }
.compare .edge { position: absolute; top: 0; bottom: 0; width: 2px; margin-left: -1px; background: #fff;
  box-shadow: 0 0 4px #000a; pointer-events: none; }
ul.notes { margin: 0; padding-left: 22px; } ul.notes li { overflow-wrap: anywhere; }
details summary { cursor: pointer; color: var(--soft); } pre { overflow-x: auto; font-size: 12.5px; margin: 10px 0 0; }
.nothing { color: var(--soft); margin: 0; }
[hidden] { display: none !important; }
)css";
}

std::string_view report_script() {
  return R"js(
(() => {
  const get = id => document.getElementById(id);
  const slider = get("slider"), play = get("play");
  let timer = null;
  const showImage = (id, url) => {
    get(id).hidden = !url;
    get(id + "-absent").hidden = !!url;
    if (url) get(id).src = url;
  };
  // Pixels are shown whole: small images are enlarged by 2, 3, ...; images wider than their place are shrunk.
  const fit = () => {
    for (const image of document.querySelectorAll(".images img")) {
      const size = image.naturalWidth, box = image.closest("figure");
      const times = size && size <= box.clientWidth ? Math.max(1, Math.floor(Math.min(box.clientWidth, 600) / size)) : 0;
      const width = times ? size * times + "px" : "";
      image.classList.toggle("whole", times > 0);
      (image.id === "under" || image.id === "over" ? get("compare") : image).style.width = width;
    }
  };
  const showEdge = () => {
    const share = get("split").value;
    get("over").style.clipPath = "inset(0 0 0 " + share + "%)";
    get("edge").style.left = share + "%";
  };
  const show = () => {
    const frame = frames[slider.value];
    get("frame-name").textContent = "frame " + frame.frame;
    get("frame-errors").textContent = frame.errors;
    for (const kind of kinds) showImage("image-" + kind, frame.images[kind]);
    const left = frame.images[get("left").value], right = frame.images[get("right").value];
    get("compare").hidden = !left || !right;
    get("compare-absent").hidden = !!(left && right);
    if (left && right) { get("under").src = left; get("over").src = right; }
  };
  const step = by => { slider.value = (+slider.value + by + frames.length) % frames.length; show(); };
  const stop = () => { clearInterval(timer); timer = null; play.textContent = "play"; };
  slider.addEventListener("input", show);
  get("previous").addEventListener("click", () => step(-1));
  get("next").addEventListener("click", () => step(1));
  play.addEventListener("click", () => {
    if (timer) return stop();
    timer = setInterval(() => step(1), 250);
    play.textContent = "stop";
  });
  for (const id of ["left", "right"]) get(id).addEventListener("change", show);
  get("split").addEventListener("input", showEdge);
  get("compare").addEventListener("pointermove", event => {
    if (event.pointerType !== "mouse" && !event.buttons) return;
    const box = get("compare").getBoundingClientRect();
    get("split").value = 100 * (event.clientX - box.left) / box.width;
    showEdge();
  });
  for (const image of document.querySelectorAll(".images img")) image.addEventListener("load", fit);
  window.addEventListener("resize", fit);
  showEdge();
  show();
})();
)js";
}

}  // namespace hsi4d
