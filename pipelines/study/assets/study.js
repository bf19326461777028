// What a person does with the page: a welcome, the pairs one after the other, and the answers, sent or as a file.
//
// Which pairs, their order and their sides follow from study and person alone, so that a reload shows the same. What is
// kept in the browser are the person, what was chosen, and for each pair the seconds it was looked at and how often its
// videos were played. Nothing can be chosen before both videos are there.
(() => {
"use strict";

const get = id => document.getElementById(id);
const study = JSON.parse(get("study-data").textContent);
const kSides = ["left", "right"];
const videos = kSides.map(get);

// ---- Chance ----

// Numbers in [0, 1) that follow from a text: FNV-1a for the start, then a counter that is mixed.
function randomNumbers(text) {
  let state = 0x811c9dc5;
  for (const byte of new TextEncoder().encode(text)) state = Math.imul(state ^ byte, 0x01000193);
  return () => {
    state = (state + 0x9e3779b9) | 0;
    let mixed = Math.imul(state ^ (state >>> 16), 0x21f0aaad);
    mixed = Math.imul(mixed ^ (mixed >>> 15), 0x735a2d97);
    return ((mixed ^ (mixed >>> 15)) >>> 0) / 2 ** 32;
  };
}

function shuffled(items, random) {
  const result = [...items];
  for (let i = result.length - 1; i > 0; --i) {
    const j = Math.floor(random() * (i + 1));
    [result[i], result[j]] = [result[j], result[i]];
  }
  return result;
}

// The pairs of a person in order, each with the video on either side.
function trialsOf(person) {
  const random = randomNumbers(study.study + "\n" + person);
  return shuffled(study.pairs, random).slice(0, study.shown).map(pair => {
    const [left, right] = shuffled(pair.videos, random);
    return { pair, left, right };
  });
}

function newPerson() {
  return [...crypto.getRandomValues(new Uint8Array(8))].map(byte => byte.toString(16).padStart(2, "0")).join("");
}

// ---- What is kept ----

// Of a page opened as index.html?person=NAME, or by Prolific.
const asked = new URLSearchParams(location.search);
const givenPerson = asked.get("person") ?? asked.get("PROLIFIC_PID") ?? "";
const place = "hsi4d study " + study.study + (givenPerson ? " of " + givenPerson : "");

const fresh = () => ({ person: givenPerson || newPerson(), begun: "", finished: "", saved: true, handedIn: false, at: -1, pairs: {} });

let isKept = true;  // whether the browser keeps what is answered
let kept = null;    // what it keeps as far as this window knows, JSON
const ownWindow = newPerson();  // in what it keeps: two windows never write the same

// A browser may refuse the storage as a whole, or to write into it. Returns what `act` does.
function storing(act) {
  try {
    return act();
  } catch {
    isKept = false;
    get("unkept").hidden = false;
    return null;
  }
}

function restored() {
  return storing(() => {
    kept = localStorage.getItem(place) ?? "null";
    localStorage.setItem(place, kept);  // whether it can be written
    return JSON.parse(kept);
  });
}

let state = restored() ?? fresh();
let trials = trialsOf(state.person);

// Goes on with what another window has written since.
function takeOver() {
  state = restored() ?? state;
  trials = trialsOf(state.person);
}

// Keeps the state, unless another window has written its own: one of them goes on. Returns whether this one does.
function keep() {
  const isOurs = storing(() => {
    if ((localStorage.getItem(place) ?? "null") !== kept) return false;
    const next = JSON.stringify({ ...state, window: ownWindow });
    localStorage.setItem(place, next);
    kept = next;
    sessionStorage.setItem(place, state.person);  // of this window: a reload is the same person
    return true;
  });
  if (isOurs === false) showSection("elsewhere");
  return isOurs !== false;
}

// Whether the answers that were found may be somebody else's: those of a tab that has been closed.
function areOfUnknown() {
  return state.at >= 0 && givenPerson === "" && storing(() => sessionStorage.getItem(place)) !== state.person;
}

const recordOf = trial => (state.pairs[trial.pair.id] ??= { chosen: {}, seconds: 0, plays: 0 });
const openQuestion = trial => trial.pair.questions.find(id => !(id in recordOf(trial).chosen));
const answered = () => trials.filter(trial => openQuestion(trial) === undefined);

// ---- The videos of a pair ----

const urls = new Map();  // of videos that are in the page

function urlOf(name) {
  const embedded = study.embedded[name];
  if (embedded === undefined) return "videos/" + name + ".mp4";
  if (!urls.has(name)) {
    const bytes = Uint8Array.from(atob(embedded), letter => letter.charCodeAt(0));
    urls.set(name, URL.createObjectURL(new Blob([bytes], { type: "video/mp4" })));
  }
  return urls.get(name);
}

const loaded = new Set();  // the videos of the pair that can be played
let playing = false;

const areLoaded = () => loaded.size === videos.length;

function showPlaying(value) {
  playing = value;
  get("play").textContent = get("broken").hidden ? playing ? "Pause" : "Play" : "Try again";
}

function play() {
  showPlaying(true);
  for (const video of videos) {
    // Refused where a browser plays nothing unasked: the button then does.
    if (!video.ended) video.play().catch(error => { if (error.name === "NotAllowedError" && playing) pause(); });
  }
}

function pause() {
  showPlaying(false);
  for (const video of videos) video.pause();
}

function playFromStart() {
  for (const video of videos) video.currentTime = 0;
  play();
}

// Choosing is possible when both videos are there.
function showLoaded() {
  for (const field of get("questions").querySelectorAll("fieldset")) field.disabled = !areLoaded();
  get("loading").hidden = areLoaded() || !get("broken").hidden;
  get("again").disabled = !areLoaded();
}

function showVideos(trial) {
  loaded.clear();
  get("broken").hidden = true;
  pause();
  showLoaded();
  kSides.forEach((side, i) => {
    videos[i].src = urlOf(trial[side]);
    videos[i].load();
  });
  // To be asked to play is what makes some browsers load a video; the first one then waits for the other.
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) play();
}

function playOrPause() {
  if (!get("broken").hidden) showVideos(trials[state.at]);
  else if (playing) pause();
  else play();
}

for (const video of videos) {
  video.addEventListener("loadeddata", () => {
    loaded.add(video);
    showLoaded();
    if (areLoaded()) playing && playFromStart();
    else video.pause();
  });
  // The shorter one waits for the longer one, then both begin again.
  video.addEventListener("ended", () => {
    if (!playing || !videos.every(other => other.ended)) return;
    ++recordOf(trials[state.at]).plays;
    playFromStart();
  });
  video.addEventListener("loadedmetadata", () => {
    video.style.setProperty("--shape", video.videoWidth + " / " + video.videoHeight);
  });
  video.addEventListener("error", () => {
    loaded.delete(video);
    get("broken").hidden = false;
    pause();
    showLoaded();
  });
}

// ---- The pages ----

function count(number, one) {
  return number + " " + one + (number === 1 ? "" : "s");
}

function showSection(name) {
  for (const id of ["welcome", "return", "elsewhere", "trial", "end"]) get(id).hidden = id !== name;
  if (name !== "trial") pause();
  scrollTo(0, 0);
  get(name).querySelector("h1").focus({ preventScroll: true });
}

function element(name, properties, children = []) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function fieldOf(trial, id) {
  const choice = (side, i) => element("label", {}, [
    element("input", { type: "radio", name: id, value: side, checked: recordOf(trial).chosen[id] === side }),
    "Video " + (i + 1)]);
  return element("fieldset", { id: "question-" + id }, [
    element("legend", { textContent: study.questions[id] }),
    element("div", { className: "choices" }, kSides.map(choice))]);
}

function markOpen(trial) {
  get("stop").disabled = answered().length === 0;
  const open = openQuestion(trial);
  for (const id of trial.pair.questions) get("question-" + id).classList.toggle("open", id === open);
  if (open === undefined) get("missing").textContent = "";
}

function showTrial() {
  const trial = trials[state.at];
  get("place").textContent = "Pair " + (state.at + 1) + " of " + trials.length;
  get("progress").max = trials.length;
  get("progress").value = answered().length;
  get("task").hidden = trial.pair.text === "";
  get("text").textContent = trial.pair.text;
  get("questions").replaceChildren(...trial.pair.questions.map(id => fieldOf(trial, id)));
  get("missing").textContent = "";
  get("back").disabled = state.at === 0;
  get("next").textContent = state.at + 1 < trials.length ? "Next" : "Finish";
  markOpen(trial);
  showSection("trial");
  showVideos(trial);
}

function showEnd() {
  const left = trials.length - answered().length;
  get("done").textContent = left === 0 ? "All pairs are answered." : answered().length + " of " + count(trials.length, "pair") + " are answered.";
  get("what-now").textContent = study.collect ? "Please send your answers." : "Please save your answers and send the file to whoever asked you.";
  get("answers").value = answersText();
  get("another").hidden = givenPerson !== "";
  get("saved").textContent = get("sent").textContent = "";
  get("send").disabled = false;
  showCompletion();
  showSection("end");
}

// The code is for who has answered all, and has sent or saved it.
function showCompletion() {
  const isDue = study.completion !== "" && state.handedIn && answered().length === trials.length;
  const isAddress = study.completion.includes("://");
  get("completion").hidden = !isDue || isAddress;
  get("onward").hidden = !isDue || !isAddress;
}

function showReturn() {
  get("returned").textContent = answered().length + " of " + count(trials.length, "pair");
  showSection("return");
}

function show() {
  if (state.at < 0) showSection("welcome");
  else if (state.at < trials.length) showTrial();
  else showEnd();
}

// ---- What the person does ----

function choose(id, side) {
  if (!areLoaded()) return;
  const trial = trials[state.at];
  state.saved = state.handedIn = false;
  recordOf(trial).chosen[id] = side;
  get("question-" + id).querySelector("[value=" + side + "]").checked = true;
  markOpen(trial);
  keep();
}

function goTo(at) {
  state.at = at;
  if (keep()) show();
}

function next() {
  const trial = trials[state.at], open = openQuestion(trial);
  if (open !== undefined && !areLoaded()) return;
  if (open !== undefined) {
    get("missing").textContent = trial.pair.questions.length > 1 ? "Please answer both questions." : "Please answer the question.";
    get("question-" + open).querySelector("input").focus();
    return;
  }
  if (state.at + 1 === trials.length) state.finished = new Date().toISOString();
  goTo(state.at + 1);
}

// To the first pair that is not answered, or the last one.
function review() {
  const open = trials.findIndex(trial => openQuestion(trial) !== undefined);
  goTo(open < 0 ? trials.length - 1 : open);
}

// 1 and 2 answer the first open question, else the one that the focus is in, else the last.
function chooseByKey(side) {
  const { pair } = trials[state.at];
  const focused = document.activeElement.type === "radio" ? document.activeElement.name : undefined;
  choose(openQuestion(trials[state.at]) ?? focused ?? pair.questions.at(-1), side);
}

function onKey(event) {
  if (get("trial").hidden || event.ctrlKey || event.altKey || event.metaKey) return;
  const onButton = document.activeElement.tagName === "BUTTON";
  if (event.repeat && "012Enter".includes(event.key)) return event.preventDefault();
  if (event.key === "1") chooseByKey("left");
  else if (event.key === "2") chooseByKey("right");
  else if (event.key === "0") areLoaded() && playFromStart();
  else if (event.key === "Enter" && !onButton) next();
  else if (event.key === " " && !onButton && document.activeElement.type !== "radio") playOrPause();
  else return;
  event.preventDefault();
}

// ---- The answers ----

function answersText() {
  const answers = answered().map(trial => {
    const { chosen, seconds, plays } = recordOf(trial);
    const names = Object.fromEntries(trial.pair.questions.map(id => [id, trial[chosen[id]]]));
    return { pair: trial.pair.id, left: trial.left, right: trial.right, chosen: names, seconds: Math.round(seconds), plays };
  });
  const { person, begun } = state;
  const finished = answers.length === trials.length ? state.finished : "";
  return JSON.stringify({ format: "hsi4d study answers", version: 1, study: study.study, person, begun, finished, answers }, null, 2) + "\n";
}

function save() {
  const url = URL.createObjectURL(new Blob([answersText()], { type: "application/json" }));
  const name = "answers-" + study.study + "-" + state.person.replace(/[^A-Za-z0-9_-]/g, "_").slice(0, 60) + ".json";
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
  get("saved").textContent = "Saved as " + name;
  state.saved = true;
  if (!study.collect) state.handedIn = true;
  keep();
  showCompletion();
}

// Sent as text, which a browser lets a page send anywhere without asking the server first; the server's answer must
// allow to be read (Access-Control-Allow-Origin).
async function send() {
  const waiting = ["send", "review", "another"].map(get);  // what arrives is what is shown
  for (const button of waiting) button.disabled = true;
  get("sent").textContent = "Sending…";
  try {
    const reply = await fetch(study.collect, { method: "POST", body: answersText(), signal: AbortSignal.timeout(30_000) });
    if (!reply.ok) throw new Error("status " + reply.status);
    get("sent").textContent = "Your answers have arrived.";
    state.saved = state.handedIn = true;
    keep();
    showCompletion();
  } catch (error) {
    get("sent").textContent = "Your answers have not arrived (" + error.message + "). Please try again, or save them and send the file to whoever asked you.";
    get("send").disabled = false;
  }
  get("review").disabled = get("another").disabled = false;
}

function beginAnew() {
  if (answered().length > 0 && !confirm("Have these answers been " + (study.collect ? "sent" : "saved") + "? They are removed from this browser.")) return;
  state = fresh();
  trials = trialsOf(state.person);
  if (keep()) show();
}

// ---- The start ----

setInterval(() => {
  if (get("trial").hidden || document.visibilityState !== "visible" || !areLoaded()) return;
  ++recordOf(trials[state.at]).seconds;
  keep();
}, 1000);

const most = Math.max(...study.pairs.map(pair => pair.questions.length));
get("shown").textContent = count(trials.length, "pair");
if (study.collect) {
  get("stays").hidden = true;
  get("goes").hidden = get("sending").hidden = false;
  get("receiver").textContent = new URL(study.collect).host;
  get("stop").textContent = "Stop here and send";
  get("save").classList.remove("main");
}
get("code").textContent = study.completion;
get("onward-link").href = study.completion;
get("asked").textContent = most === 1 ? "one question" : "two questions";
get("begin").addEventListener("click", () => {
  state.begun = new Date().toISOString();
  goTo(0);
});
get("questions").addEventListener("change", event => choose(event.target.name, event.target.value));
get("questions").addEventListener("submit", event => event.preventDefault());
get("play").addEventListener("click", playOrPause);
get("again").addEventListener("click", playFromStart);
get("back").addEventListener("click", () => goTo(state.at - 1));
get("next").addEventListener("click", next);
get("save").addEventListener("click", save);
get("send").addEventListener("click", send);
get("stop").addEventListener("click", () => {
  if (answered().length === trials.length) state.finished = new Date().toISOString();
  goTo(trials.length);
});
get("review").addEventListener("click", review);
get("another").addEventListener("click", beginAnew);
get("not-me").addEventListener("click", () => {
  takeOver();
  beginAnew();
});
get("go-on").addEventListener("click", () => {
  takeOver();
  goTo(state.at);
});
get("here").addEventListener("click", () => location.reload());
document.addEventListener("keydown", onKey);
addEventListener("beforeunload", event => {
  const isSafe = study.collect ? state.handedIn || answered().length === 0 : state.saved;
  if (!isSafe && (!isKept || !get("end").hidden)) event.preventDefault();
});
if (areOfUnknown()) showReturn();
else show();
})();
