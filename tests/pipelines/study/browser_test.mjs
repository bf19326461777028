// The page of a study in a browser: pages are made of small videos, opened from disk in headless Chromium, gone through
// by mouse, keyboard and finger, and what is saved is told by the program again.
//
//     node tests/pipelines/study/browser_test.mjs HSI4D [MODULES]     the program; a node_modules with playwright-core
//
// Exit status 77 (skipped) without playwright-core or Chromium. CHROMIUM names another Chromium than that in PATH.
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { join, resolve } from 'node:path';
import { tmpdir } from 'node:os';
import { pathToFileURL } from 'node:url';
import { chromiumOf, check, end } from '../../support/browser.mjs';

const [program, modules = '.'] = process.argv.slice(2).map((path) => resolve(path));
const { chromium, executablePath } = chromiumOf(modules);

const kPairs = 6, kShown = 5;
const methods = ['ourmethod', 'baseline'];
const nameOf = (i) => `scene${String(i).padStart(2, '0')}`;

function hsi4d(folder, ...words) {
  return execFileSync(program, words, { cwd: folder, encoding: 'utf8', stdio: ['ignore', 'pipe', 'inherit'] });
}

// Folders of runs of two methods, whose videos are a fifth and two fifths of a second long; the last pair has no text.
function makeRuns(folder) {
  for (const [m, method] of methods.entries()) {
    for (let i = 0; i < kPairs; ++i) {  // no two are alike: in a page of one file videos are known by their bytes
      const picture = `testsrc2=size=96x96:rate=10:duration=${(m + 1) / 5},hue=s=${m + 1}:h=${20 * i}`;
      mkdirSync(join(folder, method, nameOf(i)), { recursive: true });
      const video = join(folder, method, nameOf(i), 'preview.mp4');
      execFileSync('ffmpeg', ['-v', 'error', '-f', 'lavfi', '-i', picture, '-pix_fmt', 'yuv420p', video]);
    }
  }
  const texts = Object.fromEntries(Array.from({ length: kPairs - 1 }, (_, i) => [nameOf(i), `A person waters plant ${i} </script> "now"`]));
  writeFileSync(join(folder, 'texts.json'), JSON.stringify(texts));
}

function makeStudy(folder, out, ...more) {
  // Names and seed alone say who is shown what: the same every time this test is run.
  hsi4d(folder, 'study', ...methods, '--out', out, '--quiet', '--texts', 'texts.json', '--seed', '1', '--pairs', String(kShown), ...more);
  return pathToFileURL(join(folder, out, 'index.html')).href;
}

// What the videos do, in order: side, event, and whether both had been loaded then.
function watchVideos() {
  window.told = [];
  const loaded = new Set();
  for (const name of ['loadstart', 'loadeddata', 'playing', 'ended']) {
    document.addEventListener(name, ({ target }) => {
      if (name === 'loadstart') loaded.delete(target.id);
      if (name === 'loadeddata') loaded.add(target.id);
      window.told.push({ side: target.id, name, both: loaded.size === 2 });
    }, true);
  }
}

// @param receiver  the only address elsewhere that may be asked
async function open(context, url, receiver = '') {
  const page = await context.newPage();
  await page.addInitScript(watchVideos);
  page.setDefaultTimeout(60_000);
  const faults = [];
  const folder = url.slice(0, url.lastIndexOf('/') + 1);
  page.on('console', (message) => { if (['error', 'warning'].includes(message.type())) faults.push(message.text()); });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('request', (request) => {
    if (!/^(data|blob):/.test(request.url()) && !request.url().startsWith(folder) && request.url() !== receiver) faults.push(`asks for ${request.url()}`);
  });
  await page.goto(url);
  return { page, faults };
}

// What is in front of the person: number of the pair, text, names of the videos, questions.
// A video in the page is known by its bytes.
const trialOf = (page) => page.evaluate(async () => ({
  place: document.getElementById('place').textContent,
  text: document.getElementById('task').hidden ? '' : document.getElementById('text').textContent,
  videos: await Promise.all(['left', 'right'].map(async (id) => {
    const { src } = document.getElementById(id);
    if (!src.startsWith('blob:')) return src.replace(/^.*\/|\.mp4$/g, '');
    const bytes = new Uint8Array(await (await fetch(src)).arrayBuffer());
    const text = btoa(bytes.reduce((letters, byte) => letters + String.fromCharCode(byte), ''));
    const { embedded } = JSON.parse(document.getElementById('study-data').textContent);
    return Object.keys(embedded).find((name) => embedded[name] === text);
  })),
  questions: [...document.querySelectorAll('fieldset')].map((field) => field.id.replace('question-', '')),
}));

// Waits until both videos can be chosen.
const loaded = (page) => page.waitForFunction(() => ![...document.querySelectorAll('fieldset')].some((field) => field.disabled));

// Goes through all pairs. `choose(trial, question)` says 0 (left) or 1; `act(question, side)` does it.
async function goThrough(page, choose, act, next) {
  const chosen = [];
  await page.locator('#begin').click();
  for (let i = 0; i < kShown; ++i) {
    await loaded(page);
    const trial = await trialOf(page);
    check(`pair ${i + 1} is told as such`, trial.place === `Pair ${i + 1} of ${kShown}`, trial.place);
    for (const question of trial.questions) {
      const side = choose(trial, question);
      await act(question, side);
      chosen.push({ question, video: trial.videos[side] });
    }
    await next();
  }
  return chosen;
}

async function save(page, file) {
  const [download] = await Promise.all([page.waitForEvent('download'), page.locator('#save').click()]);
  await download.saveAs(file);
  const text = readFileSync(file, 'utf8');
  check('the text to copy is the file', await page.locator('#answers').inputValue() === text);
  return { name: download.suggestedFilename(), answers: JSON.parse(text) };
}

// Of videos of different lengths the shorter one waits: both have ended whenever one begins again.
function checkOrder(told) {
  const seen = { left: 0, right: 0 };
  let rounds = 0;
  for (const { side, name } of told) {
    if (name === 'ended') ++seen[side];
    if (name === 'ended' && seen.left === seen.right) ++rounds;
    if (Math.abs(seen.left - seen.right) > 1) return `${side} ended ${seen[side]} times`;
  }
  return rounds >= 2 ? '' : `${rounds} rounds`;
}

async function checkPlays(page) {
  await page.waitForFunction(() => window.told.filter(({ name }) => name === 'ended').length >= 6);
  const told = await page.evaluate(() => window.told);
  check('the videos play together and again', checkOrder(told) === '', checkOrder(told));
  await page.waitForFunction(() => Object.values(JSON.parse(Object.values(localStorage)[0]).pairs).some(({ plays }) => plays >= 2));
  check('which is counted', true);
  await page.keyboard.press(' ');
  const paused = () => page.$$eval('video', (videos) => videos.every((video) => video.paused));
  check('space pauses them', await paused());
  await page.keyboard.press('0');
  await page.waitForFunction(() => [...document.querySelectorAll('video')].some((video) => !video.paused));
  check('0 plays from the start', !(await paused()));
}

async function checkWidths(page) {
  for (const [width, height] of [[1280, 720], [820, 1180], [390, 844], [320, 568]]) {
    await page.setViewportSize({ width, height });
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    check(`nothing hangs over the edge of ${width} pixels`, wide <= width, `${wide}`);
    const bottom = await page.$$eval('video', (videos) => Math.max(...videos.map((video) => video.getBoundingClientRect().bottom)));
    check('and both videos are in view', bottom <= height, `${bottom} of ${height}`);
  }
}

// What the page refuses and keeps.
async function testCare(browser, url) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 720 } });
  const { page, faults } = await open(context, `${url}?person=care`);
  await page.locator('#begin').click();
  await loaded(page);
  await checkPlays(page);
  const first = await trialOf(page);
  check('this person begins with a pair of two questions', first.questions.length === 2);
  await page.locator('#next').click();
  check('an unanswered pair cannot be left', (await trialOf(page)).place === first.place);
  check('which is told', /Please answer/.test(await page.locator('#missing').textContent()));
  await page.locator(`#question-${first.questions[0]} label`).first().click();
  await page.locator('#next').click();
  check('nor one that is answered in half', (await trialOf(page)).place === first.place);
  await page.reload();
  const again = await trialOf(page);
  check('a reload shows the same pair', JSON.stringify(again) === JSON.stringify(first), `${JSON.stringify(again)}, before ${JSON.stringify(first)}`);
  await loaded(page);
  check('with what was chosen', await page.locator(`#question-${first.questions[0]} input`).first().isChecked());
  await checkWidths(page);
  check('no fault in that', faults.length === 0, faults.join('; '));
  await context.close();
}

// A second person at the same computer, and a second window.
async function testOthers(browser, url) {
  const context = await browser.newContext({ viewport: { width: 1000, height: 700 } });
  const first = (await open(context, url)).page;
  await first.locator('#begin').click();
  await loaded(first);
  await first.keyboard.press('1');
  await first.keyboard.press('1');
  await first.keyboard.press('Enter');
  const person = () => first.evaluate(() => JSON.parse(Object.values(localStorage)[0]).person);
  const before = await person();
  const second = (await open(context, url)).page;
  check('what somebody has begun is asked about', await second.locator('#return').isVisible());
  check('with how much it is', await second.locator('#returned').textContent() === `1 of ${kShown} pairs`, await second.locator('#returned').textContent());
  await second.locator('#go-on').click();
  check('and gone on with', (await trialOf(second)).place === `Pair 2 of ${kShown}` && await person() === before);
  await first.bringToFront();
  await first.locator('#elsewhere').waitFor({ state: 'visible' });
  check('the first window then says so', !(await first.locator('#trial').isVisible()));
  await first.locator('#here').click();
  await first.locator('#trial').waitFor({ state: 'visible' });
  check('and can be gone on in', (await trialOf(first)).place === `Pair 2 of ${kShown}`);
  const third = (await open(context, url)).page;
  third.once('dialog', (dialog) => dialog.accept());
  await third.locator('#not-me').click();
  check('another person begins anew', await third.locator('#welcome').isVisible() && await person() !== before);
  await context.close();
}

// Answers that are not all there can be saved, and a video that cannot be played is not chosen.
async function testHalf(browser, url, folder) {
  const context = await browser.newContext({ viewport: { width: 1000, height: 700 }, acceptDownloads: true });
  const { page } = await open(context, `${url}?person=half`);
  await page.locator('#begin').click();
  await loaded(page);
  check('nothing is saved of nothing', await page.locator('#stop').isDisabled());
  const trial = await trialOf(page);
  for (const _ of trial.questions) await page.keyboard.press('2');
  await page.locator('#stop').click();
  check('it is told how much there is', /^1 of 5 pairs are answered/.test(await page.locator('#done').textContent()), await page.locator('#done').textContent());
  const file = join(folder, 'half.json'), { answers } = await save(page, file);
  check('half of it is a file', answers.answers.length === 1 && answers.finished === '');
  check('that is read', /answers 1 of the 5 pairs/.test(hsi4d(folder, 'study', '--answers', file, '--key', 'page-key.json')));
  await page.locator('#review').click();
  check('and gone on with later', (await trialOf(page)).place === `Pair 2 of ${kShown}`);
  await context.close();
}

async function testBroken(browser, url) {
  const context = await browser.newContext({ viewport: { width: 1000, height: 700 } });
  const page = await context.newPage();
  let broken = true;
  await page.route('**/*.mp4', (route) => (broken ? route.abort() : route.continue()));
  await page.goto(`${url}?person=broken`);
  await page.locator('#begin').click();
  await page.locator('#broken').waitFor({ state: 'visible' });
  for (const key of ['1', '2', 'Enter', '0']) await page.keyboard.press(key);
  check('of videos that cannot be played none is chosen', await page.$$eval('fieldset', (fields) => fields.every((field) => field.disabled)) &&
    await page.locator('#place').textContent() === `Pair 1 of ${kShown}` && await page.locator(':checked').count() === 0);
  broken = false;
  await page.locator('#play').click();
  await loaded(page);
  check('until they can', await page.locator('#broken').isHidden());
  await context.close();
}

// A browser that keeps nothing says so at every step.
async function testUnkept(browser, url) {
  const context = await browser.newContext({ viewport: { width: 1000, height: 700 } });
  const page = await context.newPage();
  await page.addInitScript(() => { Storage.prototype.setItem = () => { throw new Error('full'); }; });
  await page.goto(url);
  await page.locator('#begin').click();
  await loaded(page);
  check('that nothing is kept is told beside the videos', await page.locator('#unkept').isVisible());
  await page.keyboard.press('1');
  const asked = page.waitForEvent('dialog');
  await page.close({ runBeforeUnload: true });
  const dialog = await asked;
  check('and asked before the page is left', dialog.type() === 'beforeunload', dialog.type());
  await dialog.accept();
  await context.close();
}

// By mouse: A always.
async function testMouse(browser, url, file, isA) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 720 }, acceptDownloads: true });
  const { page, faults } = await open(context, `${url}?person=Jane%20Doe%2F1`);
  const act = (question, side) => page.locator(`#question-${question} label`).nth(side).click();
  const chosen = await goThrough(page, (trial) => (isA(trial.videos[0]) ? 0 : 1), act, () => page.locator('#next').click());
  await page.locator('#review').click();
  check('there is a way back', (await trialOf(page)).place === `Pair ${kShown} of ${kShown}`);
  await page.locator('#next').click();
  const saved = await save(page, file);
  check('the file is named by study and person', /^answers-[0-9a-f]{16}-Jane_Doe_1\.json$/.test(saved.name), saved.name);
  check('the person is the one of the address', saved.answers.person === 'Jane Doe/1', saved.answers.person);
  check('no fault, and nothing is asked for elsewhere', faults.length === 0, faults.join('; '));
  await context.close();
  return { chosen, ...saved };
}

// By keys alone: the left one is better, the right one agrees.
async function testKeys(browser, url, file) {
  const context = await browser.newContext({ viewport: { width: 1000, height: 700 }, acceptDownloads: true });
  const { page, faults } = await open(context, `${url}?person=keys`);
  const chosen = await goThrough(page, (trial, question) => (question === 'quality' ? 0 : 1),
    (question, side) => page.keyboard.press(String(side + 1)), () => page.keyboard.press('Enter'));
  const saved = await save(page, file);
  check('a person with a name is not followed by another', await page.locator('#another').isHidden());
  check('by keys without a fault', faults.length === 0, faults.join('; '));
  await context.close();
  return { chosen, ...saved };
}

// On a phone, all in one file, the second video always.
async function testPhone(browser, url, file) {
  const context = await browser.newContext({ viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true, acceptDownloads: true });
  const { page, faults } = await open(context, `${url}?person=${'phone'.repeat(60)}`);
  check('a phone is not told of keys', await page.locator('.keyboard-only').isHidden());
  const act = (question, side) => page.locator(`#question-${question} label`).nth(side).tap();
  const chosen = await goThrough(page, () => 1, act, () => page.locator('#next').tap());
  const saved = await save(page, file);
  check('a long name is a short file', saved.name.length < 120 && saved.answers.person.length === 300, saved.name);
  check('on a phone without a fault', faults.length === 0, faults.join('; '));
  await context.close();
  return { chosen, ...saved };
}

// A server that takes answers; the first time it is busy.
async function receiverOf() {
  const bodies = [];
  let times = 0;
  const server = createServer((request, response) => {
    let body = '';
    request.on('data', (part) => { body += part; });
    request.on('end', () => {
      const isBusy = ++times === 1;
      if (!isBusy) bodies.push({ method: request.method, body });
      response.writeHead(isBusy ? 503 : 204, { 'Access-Control-Allow-Origin': '*' }).end();
    });
  });
  await new Promise((done) => { server.listen(0, '127.0.0.1', done); });
  return { bodies, server, url: `http://127.0.0.1:${server.address().port}/answers?study=1` };
}

// Answers that are sent, by a person whom Prolific sends: the code is shown once they have arrived.
async function testSend(browser, folder) {
  const receiver = await receiverOf();
  const url = makeStudy(folder, 'sent', '--collect', receiver.url, '--completion', 'C0DE42');
  const context = await browser.newContext({ viewport: { width: 1000, height: 700 }, acceptDownloads: true });
  const { page, faults } = await open(context, `${url}?PROLIFIC_PID=p123&STUDY_ID=s`, receiver.url);
  check('where answers go is told before', await page.locator('#stays').isHidden() && await page.locator('#receiver').textContent() === new URL(receiver.url).host);
  await goThrough(page, () => 0, (question) => page.locator(`#question-${question} label`).first().click(), () => page.locator('#next').click());
  check('nothing is sent unasked', receiver.bodies.length === 0 && await page.locator('#completion').isHidden());
  const arrived = (words) => page.waitForFunction((text) => document.getElementById('sent').textContent.startsWith(text), words);
  await page.locator('#send').click();
  await arrived('Your answers have not arrived (status 503)');
  check('without an arrival there is no code', await page.locator('#completion').isHidden());
  const { answers } = await save(page, join(folder, 'sent.json'));
  check('nor for a file', await page.locator('#completion').isHidden());
  await page.locator('#send').click();
  await arrived('Your answers have arrived');
  check('with it there is', await page.locator('#completion').isVisible() && await page.locator('#code').textContent() === 'C0DE42');
  check('what arrives is the file', receiver.bodies.length === 1 && receiver.bodies[0].method === 'POST' && receiver.bodies[0].body === readFileSync(join(folder, 'sent.json'), 'utf8'));
  check('of the person whom Prolific sent', answers.person === 'p123', answers.person);
  check('that is read', /1 person/.test(hsi4d(folder, 'study', '--answers', 'sent.json', '--key', 'sent-key.json')));
  await page.reload();
  check('a reload still has the code', await page.locator('#completion').isVisible());
  await page.locator('#review').click();
  await loaded(page);
  await page.keyboard.press('2');
  await page.locator('#next').click();
  check('what is changed is to be sent again', await page.locator('#completion').isHidden() && await page.locator('#send').isEnabled());
  const unexpected = faults.filter((fault) => !fault.includes('503'));
  check('sent without a fault', unexpected.length === 0, unexpected.join('; '));
  receiver.server.close();
  receiver.server.closeAllConnections();
  await page.locator('#send').click();
  await arrived('Your answers have not arrived');
  check('a server that is gone is told', await page.locator('#completion').isHidden());
  await context.close();
}

// An address to go on to, for who has saved the file.
async function testOnward(browser, folder) {
  const url = makeStudy(folder, 'onward', '--completion', 'https://app.prolific.com/submissions/complete?cc=C0DE42');
  const context = await browser.newContext({ viewport: { width: 1000, height: 700 }, acceptDownloads: true });
  const { page } = await open(context, `${url}?person=onward`);
  await page.locator('#begin').click();
  await loaded(page);
  await page.keyboard.press('1');
  await page.keyboard.press('1');
  await page.locator('#stop').click();
  await save(page, join(folder, 'some.json'));
  check('who stops early is not sent on', await page.locator('#onward').isHidden());
  await page.locator('#review').click();
  for (let i = 0; i < kShown; ++i) {
    if (await page.locator('#end').isVisible()) break;
    await loaded(page);
    await page.keyboard.press('1');
    await page.keyboard.press('1');
    await page.locator('#next').click();
  }
  check('nor who has not saved', await page.locator('#onward').isHidden());
  await save(page, join(folder, 'all.json'));
  check('who has answered all is', await page.locator('#onward-link').getAttribute('href') === 'https://app.prolific.com/submissions/complete?cc=C0DE42' && await page.locator('#onward').isVisible());
  await context.close();
}

function chosenIn(answers) {
  return answers.answers.flatMap(({ chosen }) => Object.entries(chosen).map(([question, video]) => ({ question, video })));
}

// What the program says of the files, against what was done.
function checkResults(folder, isA, persons) {
  for (const { chosen, answers } of persons)
    check('the file has what was chosen', JSON.stringify(chosen) === JSON.stringify(chosenIn(answers)),
      `${JSON.stringify(chosen)} and ${JSON.stringify(chosenIn(answers))}`);
  const files = persons.map((_, i) => `answers${i}.json`);
  hsi4d(folder, 'study', '--answers', ...files, '--key', 'page-key.json', '--json', 'out.json', '--csv', 'out.csv');
  const results = JSON.parse(readFileSync(join(folder, 'out.json'), 'utf8'));
  for (const id of ['quality', 'text']) {
    const done = persons.flatMap(({ chosen }) => chosen).filter(({ question }) => question === id);
    const wanted = done.filter(({ video }) => isA(video)).length;
    const found = results.questions.find((question) => question.id === id);
    check(`"${id}" is counted`, found.answers === done.length && found.prefer_a === wanted, `${found.prefer_a} of ${found.answers}, done ${wanted} of ${done.length}`);
    check('between its bounds', found.wilson[0] < found.share_a && found.share_a < found.wilson[1] && found.bootstrap[0] <= found.share_a);
  }
  const lines = readFileSync(join(folder, 'out.csv'), 'utf8').trim().split('\n');
  check('a line an answer', lines.length === 1 + persons.flatMap(({ chosen }) => chosen).length);
}

// What a video file says of itself, without its length and rate of bits.
function tagsOf(file) {
  const told = JSON.parse(execFileSync('ffprobe', ['-v', 'error', '-show_entries', 'format_tags:stream_tags:stream=codec_name,profile,pix_fmt,time_base', '-of', 'json', file], { encoding: 'utf8' }));
  return JSON.stringify(told);
}

// Videos tell by their form, time and names of what they are nothing: only their pictures and lengths differ.
function checkAlike(folder, key) {
  const files = key.pairs.flatMap(({ a, b }) => [a, b]).map((name) => join(folder, 'page', 'videos', `${name}.mp4`));
  check('videos are alike in form', new Set(files.map(tagsOf)).size === 1, [...new Set(files.map(tagsOf))].join());
  check('and of one time', new Set(files.map((file) => statSync(file).mtimeMs)).size === 1);
  const page = readFileSync(join(folder, 'page', 'index.html'), 'utf8');
  const data = JSON.parse(page.match(/id="study-data">(.*?)<\/script>/s)[1]);
  const sorted = (list) => JSON.stringify(list) === JSON.stringify([...list].sort());
  check('the page has pairs and videos in the order of their names', sorted(data.pairs.map(({ id }) => id)) && data.pairs.every(({ videos }) => sorted(videos)));
}

// Neither method nor name of a run is in what people get.
function checkBlind(folder, out) {
  const names = readdirSync(join(folder, out), { recursive: true });
  const html = readFileSync(join(folder, out, 'index.html'), 'utf8');
  for (const word of [...methods, 'scene0', 'preview']) {
    check(`nothing is called ${word}`, !html.includes(word) && !names.some((name) => name.includes(word)));
  }
}

const folder = mkdtempSync(join(tmpdir(), 'hsi4d_study_'));
const browser = await chromium.launch({ executablePath, args: ['--no-sandbox'] });
try {
  makeRuns(folder);
  const url = makeStudy(folder, 'page'), single = makeStudy(folder, 'single', '--embed');
  const key = JSON.parse(readFileSync(join(folder, 'page-key.json'), 'utf8'));
  check('both pages are of one study', JSON.parse(readFileSync(join(folder, 'single-key.json'), 'utf8')).study === key.study);
  check('a page with its videos is one file', readdirSync(join(folder, 'single')).join() === 'index.html');
  checkBlind(folder, 'page');
  checkBlind(folder, 'single');
  checkAlike(folder, key);
  const videosOfA = new Set(key.pairs.map((pair) => pair.a));
  const isA = (video) => videosOfA.has(video);
  await testCare(browser, url);
  await testOthers(browser, url);
  await testHalf(browser, url, folder);
  await testBroken(browser, url);
  await testUnkept(browser, url);
  await testSend(browser, folder);
  await testOnward(browser, folder);
  const jane = await testMouse(browser, url, join(folder, 'answers0.json'), isA);
  const keys = await testKeys(browser, url, join(folder, 'answers1.json'));
  const phone = await testPhone(browser, single, join(folder, 'answers2.json'));
  check('on the phone the second video was chosen', phone.answers.answers.every((answer) => Object.values(answer.chosen).every((video) => video === answer.right)));
  checkResults(folder, isA, [jane, keys, phone]);
  const orders = [jane, keys, phone].map(({ answers }) => answers.answers.map((answer) => answer.pair).join());
  check('persons have orders of their own', new Set(orders).size > 1);
  const left = [jane, keys, phone].flatMap(({ answers }) => answers.answers).filter((answer) => isA(answer.left)).length;
  check('A is left now and then', left > 1 && left < 3 * kShown - 1, `${left} of ${3 * kShown} times`);
} finally {
  await browser.close();
  rmSync(folder, { recursive: true });
}
end();
