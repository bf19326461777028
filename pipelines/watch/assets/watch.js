// The page of `hsi4d watch`: asks the server for what is new, and draws it.
"use strict";
const get = id => document.getElementById(id);
const kBusy = 1000, kIdle = 5000, kTable = 3000;  // milliseconds between questions: of a run that goes on, that ended
const kEarlier = 12;      // frames before the shown one whose curves stand behind its own
const kSilent = 60;       // seconds after which a run that says "running" may have been killed
const kDecades = 6;       // that a logarithmic plot has at most, down from its largest value
const kColours = ["#3f8fdc", "#e08a2e", "#34a05f", "#d9534f", "#9a6fd0", "#a07f5c", "#d36fb0", "#7f8a99"];  // for light and dark

const view = { id: null, run: null, place: { file: "", from: 0 }, curves: new Map(), iterations: 0, seconds: 0, skipped: 0, shown: "" };

// ---- Small helpers ----

function element(name, text = "", className = "") {
  const made = document.createElement(name);
  made.textContent = text;
  if (className) made.className = className;
  return made;
}

function show(id, text) {
  get(id).textContent = text;
  get(id).hidden = text === "";
}

function duration(seconds) {
  if (seconds < 100) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  const minutes = Math.floor(seconds / 60);
  return minutes < 100 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

const short = value => value === 0 ? "0" : Math.abs(value) >= 1e-3 && Math.abs(value) < 1e4 ? String(+value.toPrecision(3)) : value.toExponential(1);

function showPairs(list, pairs) {
  list.replaceChildren(...pairs.map(([name, text]) => {
    const pair = element("div");
    pair.append(element("dt", name), element("dd", text));
    return pair;
  }));
}

async function ask(path, parameters = {}) {
  const reply = await fetch(`${path}?${new URLSearchParams(parameters)}`, { cache: "no-store" });
  if (reply.ok) return reply.json();
  const error = new Error((await reply.text()).trim());
  error.isAnswer = true;
  throw error;
}

function setState(state) {
  show("state", state);
  get("state").className = `badge ${state}`;
}

// ---- The table of runs ----

function frameCount(run) {
  return run.total === undefined ? (run.frames ? String(run.frames) : "") : `${run.frames} of ${run.total}`;
}

function rowOf(run, metrics, best) {
  const row = element("tr"), name = element("td"), link = element("a", run.name), state = element("td");
  link.href = `#run=${encodeURIComponent(run.id)}`;
  name.append(link);
  state.append(element("span", run.state, `badge ${run.state}`));
  if (run.message) state.title = run.message;
  row.append(name, state, element("td", frameCount(run)));
  for (const { name, decimals } of metrics) {
    const value = run.values[name];
    const text = value === undefined ? "–" : value.toFixed(decimals);
    row.append(element("td", text, value === undefined ? "none" : text === best[name] ? "best" : ""));
  }
  row.addEventListener("click", () => { location.hash = link.hash; });
  return row;
}

// As shown; "" where all are the same.
function bestOf({ name, decimals, better }, runs) {
  const values = runs.map(run => run.values[name]).filter(value => value !== undefined);
  const texts = new Set(values.map(value => value.toFixed(decimals)));
  return better === 0 || texts.size < 2 ? "" : (better < 0 ? Math.min(...values) : Math.max(...values)).toFixed(decimals);
}

function showTable({ title, metrics, runs }) {
  show("title", title);
  show("message", "");
  setState("");
  const counts = {};
  for (const { state } of runs) counts[state] = (counts[state] ?? 0) + 1;
  show("counts", Object.entries(counts).map(([state, count]) => `${count} ${state}`).join(", "));
  get("no-runs").hidden = runs.length > 0;
  get("table").parentElement.hidden = runs.length === 0;
  const head = element("tr");
  for (const label of ["run", "state", "frames", ...metrics.map(metric => metric.label)]) head.append(element("th", label));
  const best = Object.fromEntries(metrics.map(metric => [metric.name, bestOf(metric, runs)]));
  get("table").tHead.replaceChildren(head);
  get("table").tBodies[0].replaceChildren(...runs.map(run => rowOf(run, metrics, best)));
}

// ---- Curves ----

const keyOf = (stage, frame) => JSON.stringify([stage, frame]);

function addRow([frame, stage, iteration, loss, seconds, terms]) {
  const key = keyOf(stage, frame);
  if (!view.curves.has(key)) view.curves.set(key, { stage, frame, loss: [], terms: new Map() });
  const curve = view.curves.get(key);
  if (loss !== null) curve.loss.push([iteration, loss]);
  for (const [name, value] of Object.entries(terms)) {
    if (value === null) continue;
    if (!curve.terms.has(name)) curve.terms.set(name, []);
    curve.terms.get(name).push([iteration, value]);
  }
  ++view.iterations;
  view.seconds += seconds ?? 0;
}

function forgetRows() {
  Object.assign(view, { curves: new Map(), iterations: 0, seconds: 0, skipped: 0 });
}

// Every line that is new. What a question answers that was asked for another run is dropped.
async function readRows() {
  for (let more = true; more;) {
    const { id, place } = view;
    const part = await ask("/metrics", { run: id, ...place });
    if (view.id !== id) return;
    if (part.restarted) forgetRows();
    part.rows.forEach(addRow);
    view.skipped += part.skipped;
    view.place = { file: part.file, from: part.next };
    more = part.next < part.size && part.next > (part.restarted ? 0 : place.from);
  }
}

// Round numbers between two, about `count` of them; of a logarithmic axis powers of ten, and 2 and 5 times these where few.
function ticks(from, to, count, log) {
  if (log) {
    const steps = Math.log10(to / from) > 2.5 ? [1] : [1, 2, 5], all = [];
    for (let power = Math.floor(Math.log10(from)); power <= Math.ceil(Math.log10(to)); ++power)
      for (const step of steps) all.push(step * 10 ** power);
    const inside = all.filter(value => value >= from && value <= to);
    if (inside.length < 2) return ticks(from, to, count, false).filter(value => value > 0);
    return inside.filter((_, i) => i % Math.ceil(inside.length / (count + 1)) === 0);
  }
  const raw = (to - from) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find(factor => factor * power >= raw) * power, all = [];
  for (let value = Math.ceil(from / step) * step; value <= to; value += step) all.push(value);
  return all;
}

function rangeOf(values, log) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  if (log) return low === high ? [low / 2, high * 2] : [Math.max(low, high / 10 ** kDecades) / 1.05, high * 1.05];
  const margin = (high - low) * 0.04 || Math.abs(low) / 2 || 1;
  return [low - margin, high + margin];
}

// Lines over whole numbers. Series: {points: [[x, y]...], colour, faint, dots}. A logarithmic plot leaves out what is not above 0.
function plot(canvas, series, log) {
  const scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  Object.assign(canvas, { width: width * scale, height: height * scale });
  const style = getComputedStyle(document.documentElement), colour = name => style.getPropertyValue(name).trim();
  const drawn = series.map(one => ({ ...one, points: log ? one.points.filter(([, y]) => y > 0) : one.points })).filter(({ points }) => points.length > 0);
  const pen = canvas.getContext("2d");
  pen.scale(scale, scale);
  pen.font = "12px system-ui, sans-serif";
  pen.fillStyle = colour("--soft");
  if (drawn.length === 0) return pen.fillText(log ? "nothing above 0" : "nothing yet", 60, height / 2);
  const xs = drawn.flatMap(({ points }) => [points[0][0], points.at(-1)[0]]);
  const left = 58, right = width - 10, top = 8, bottom = height - 22;
  const low = Math.min(...xs), high = Math.max(...xs, low + 1);
  const [from, to] = rangeOf((function* () { for (const { points } of drawn) for (const [, y] of points) yield y; })(), log);
  const f = log ? Math.log10 : value => value;
  const xOf = x => left + (x - low) / (high - low) * (right - left);
  const yOf = y => bottom - (f(y) - f(from)) / (f(to) - f(from)) * (bottom - top);
  pen.lineWidth = 1;
  pen.strokeStyle = colour("--line");
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (const y of ticks(from, to, 4, log)) {
    pen.beginPath();
    pen.moveTo(left, yOf(y));
    pen.lineTo(right, yOf(y));
    pen.stroke();
    pen.fillText(short(y), left - 6, yOf(y));
  }
  pen.textAlign = "center";
  for (const x of ticks(low, high, 6, false).filter(Number.isInteger)) pen.fillText(String(x), Math.min(xOf(x), right - 8), height - 9);
  pen.beginPath();
  pen.rect(left - 4, top - 4, right - left + 8, bottom - top + 8);
  pen.clip();
  for (const { points, colour: own, faint, dots } of drawn) {
    pen.strokeStyle = pen.fillStyle = own;
    pen.globalAlpha = faint ? 0.22 : 1;
    pen.lineWidth = faint ? 1 : 1.8;
    const stride = Math.max(1, Math.floor(points.length / width));
    pen.beginPath();
    points.forEach(([x, y], i) => { if (i % stride === 0 || i === points.length - 1) pen.lineTo(xOf(x), yOf(y)); });
    pen.stroke();
    for (const [x, y] of dots || points.length === 1 ? points : []) {
      pen.beginPath();
      pen.arc(xOf(x), yOf(y), dots && points.length > width / 8 ? 1.2 : 2.6, 0, 7);
      pen.fill();
    }
  }
}

// The card of a plot, made when it is first drawn.
function card(id, title, small, series, keys) {
  let made = get(id);
  if (!made) {
    made = element("div", "", "card");
    made.id = id;
    made.append(element("h3"), element("canvas"), element("div", "", "legend"));
    made.querySelector("canvas").setAttribute("role", "img");
    get("plots").append(made);
  }
  made.querySelector("h3").replaceChildren(`${title} `, element("small", small));
  made.querySelector("canvas").setAttribute("aria-label", `${title} ${small}`);
  made.querySelector(".legend").replaceChildren(...keys.map(({ colour, text }) => {
    const key = element("span", ""), line = element("span", "", "key");
    line.style.borderColor = colour;
    key.append(line, text);
    return key;
  }));
  plot(made.querySelector("canvas"), series, get("log").checked);
}

// Stages in the order of the config, then others.
function stagesSeen() {
  const order = view.run.stages.map(({ name }) => name), seen = new Set([...view.curves.values()].map(({ stage }) => stage));
  return [...order.filter(name => seen.has(name)), ...[...seen].filter(name => !order.includes(name))];
}

function drawByFrame(stages) {
  const series = stages.map((stage, i) => ({ stage, colour: kColours[i % kColours.length], dots: true,
    points: [...view.curves.values()].filter(curve => curve.stage === stage && curve.frame !== null && curve.loss.length > 0)
      .map(({ frame, loss }) => [frame, loss.at(-1)[1]]).sort((a, b) => a[0] - b[0]) })).filter(({ points }) => points.length > 0);
  if (series.length === 0) return;
  card("plot-frames", "Last loss", "by frame", series, series.map(({ stage, colour, points }) => ({ colour, text: `${stage} ${short(points.at(-1)[1])}` })));
}

function drawStage(stage, index, shownFrame) {
  const own = [...view.curves.values()].filter(curve => curve.stage === stage);
  const frames = own.map(({ frame }) => frame);
  const frame = frames.includes(shownFrame) ? shownFrame : frames.at(-1);  // of the sequence: null
  const curve = view.curves.get(keyOf(stage, frame)), colour = kColours[index % kColours.length];
  const earlier = own.filter(other => frame !== null && other.frame < frame).slice(-kEarlier);
  const limit = view.run.stages.find(({ name }) => name === stage)?.iterations;
  const where = frame === null ? "all frames" : `frame ${frame}`;
  const last = curve.loss.at(-1);
  const done = last === undefined ? "" : `${last[0] + 1}${limit === undefined ? "" : ` of at most ${limit}`} iterations, loss ${short(last[1])}`;
  card(`plot-loss-${index}`, stage, where,
    [...earlier.map(other => ({ points: other.loss, colour, faint: true })), { points: curve.loss, colour }],
    [{ colour, text: done }, ...(earlier.length ? [{ colour, text: `faint: ${earlier.length} frames before` }] : [])]);
  const terms = [...curve.terms].map(([name, points], i) => ({ name, points, colour: kColours[i % kColours.length] }));
  card(`plot-terms-${index}`, `${stage}: terms`, `${where}, without weights`, terms,
    terms.map(({ name, points, colour: own }) => ({ colour: own, text: `${name} ${short(points.at(-1)[1])}` })));
}

function drawCurves() {
  get("no-curves").hidden = view.curves.size > 0;
  const stages = stagesSeen();
  const frames = [...view.curves.values()].map(({ frame }) => frame).filter(frame => frame !== null);
  const shown = get("follow").checked ? Math.max(...frames) : shownFrame()?.[0];
  drawByFrame(stages);
  stages.forEach((stage, i) => drawStage(stage, i, shown));
}

// ---- Frames ----

const shownFrame = () => view.run.frames[Number(get("frame").value)];

function load(frame, stamp, kind) {
  return new Promise((done, fail) => {
    const image = new Image();
    image.onload = () => done(image);
    image.onerror = () => fail(new Error(`the ${kind} of frame ${frame} cannot be read`));
    image.src = `/image?${new URLSearchParams({ run: view.id, frame, kind, stamp })}`;
  });
}

// The image's pixels, drawn on a canvas of its size.
function pixelsOf(id, image) {
  const canvas = get(id), pen = canvas.getContext("2d", { willReadFrequently: true });
  Object.assign(canvas, { width: image.naturalWidth, height: image.naturalHeight });
  pen.drawImage(image, 0, 0);
  return pen.getImageData(0, 0, canvas.width, canvas.height);
}

function drawDifference(target, render) {
  const canvas = get("difference");
  Object.assign(canvas, { width: render.width, height: render.height });
  const pen = canvas.getContext("2d"), out = pen.createImageData(render.width, render.height);
  const isSame = target.width === render.width && target.height === render.height;
  for (let i = 0; isSame && i < out.data.length; ++i)
    out.data[i] = i % 4 === 3 ? 255 : Math.min(255, 4 * Math.abs(target.data[i] - render.data[i]));
  pen.putImageData(out, 0, 0);
}

async function drawFrame() {
  const { frames } = view.run;
  get("no-frames").hidden = frames.length > 0;
  get("frames-view").hidden = frames.length === 0;
  if (frames.length === 0) return;
  get("frame").max = frames.length - 1;
  if (get("follow").checked) get("frame").value = frames.length - 1;
  const [frame, stamp] = shownFrame(), wanted = JSON.stringify([view.id, frame, stamp]);
  get("frame-name").textContent = `frame ${frame}`;
  if (view.shown === wanted) return;
  view.shown = wanted;
  try {
    const [target, render] = await Promise.all(["target", "render"].map(kind => load(frame, stamp, kind)));
    if (view.shown === wanted) drawDifference(pixelsOf("target", target), pixelsOf("render", render));
  } catch (error) {
    if (view.shown !== wanted) return;
    view.shown = "";  // asked for again
    get("frame-name").textContent = error.message;
  }
}

// ---- A run ----

function showFacts() {
  const { run } = view, finished = run.frames.filter(([frame]) => frame > 0).length;
  const facts = [["frames", run.total === undefined ? String(finished) : `${finished} of ${run.total}`],
    ["iterations", String(view.iterations)], ["time in iterations", duration(view.seconds)]];
  if (run.started) facts.push(["started", run.started.replace("T", " ").replace("Z", " UTC")]);
  if (run.age !== undefined) facts.push(["last written", `${duration(run.age)} ago`]);
  showPairs(get("facts"), facts);
}

function messageOf({ state, message, age }) {
  if (message) return message;
  return state === "running" && age > kSilent ? `The run says that it is running, but has written nothing for ${duration(age)}: it may have been killed.` : "";
}

function showRun() {
  const { run } = view;
  get("run").hidden = false;
  show("title", run.name);
  setState(run.state);
  show("message", messageOf(run));
  showFacts();
  get("results").hidden = run.results.length === 0;
  showPairs(get("results").querySelector("dl"), run.results.map(([label, value, decimals]) => [label, value.toFixed(decimals)]));
  show("skipped", view.skipped === 0 ? "" : `${view.skipped} lines of metrics.jsonl cannot be read and are left out.`);
  drawFrame();
  drawCurves();
}

function openRun(id) {
  forgetRows();
  Object.assign(view, { id, run: null, place: { file: "", from: 0 }, shown: "" });
  get("plots").replaceChildren();
  get("follow").checked = true;
}

// ---- What is shown, and when it is asked for again ----

const chosenRun = () => location.hash.startsWith("#run=") ? decodeURIComponent(location.hash.slice(5)) : null;

// A single run that is itself what is watched needs no table.
async function look() {
  let id = chosenRun();
  const list = id === null ? await ask("/runs") : null;
  const isAlone = list !== null && list.runs.length === 1 && list.runs[0].id === "";
  if (isAlone) id = "";
  get("runs").hidden = id !== null;
  get("run").hidden = id === null || view.run?.id !== id;  // until it is known
  get("back").hidden = id === null || isAlone;
  if (id === null) {
    view.id = null;
    showTable(list);
    return kTable;
  }
  if (view.id !== id) openRun(id);
  const run = await ask("/run", { run: id });
  if (view.id !== id) return 0;
  view.run = run;
  await readRows();
  if (view.id !== id) return 0;
  showRun();
  return run.state === "running" || run.state === "started" ? kBusy : kIdle;
}

let timer = 0, turn = 0;
async function poll() {
  const own = ++turn;  // a newer one takes over
  clearTimeout(timer);
  let wait = kTable;
  try {
    wait = await look();
    if (own === turn) show("lost", "");
  } catch (error) {
    if (own === turn) show("lost", error.isAnswer ? error.message : `The server does not answer: ${error.message}. Is \`hsi4d watch\` still running?`);
  }
  if (own === turn) timer = setTimeout(poll, wait);
}

get("frame").addEventListener("input", () => {
  get("follow").checked = Number(get("frame").value) === view.run.frames.length - 1;
  drawFrame();
  drawCurves();
});
for (const id of ["follow", "log"]) get(id).addEventListener("change", () => { if (view.run) showRun(); });
for (const name of ["resize", "hashchange"]) window.addEventListener(name, name === "resize" ? () => { if (view.run) drawCurves(); } : poll);
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (view.run) drawCurves(); });
poll();
