// The page of a study in a browser: pages are made of small videos, opened from disk in headless Chromium, gone through
// by mouse, keyboard and finger, and what is saved is told by the program again.
//
//     node tests/pipelines/study_browser_test.mjs HSI4D [MODULES]     the program; a node_modules with playwright-core
//
// Exit status 77 (skipped) without playwright-core or Chromium. CHROMIUM names another Chromium than that in PATH.
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { tmpdir } from 'node:os';
import { pathToFileURL } from 'node:url';
import { chromiumOf, check, end } from '../support/browser.mjs';

const [program, modules = '.'] = process.argv.slice(2).map((path) => resolve(path));
const { chromium, executablePath } = chromiumOf(modules);

const kPairs = 6, kShown = 5;
const methods = ['ourmethod', 'baseline'];
const nameOf = (i) => `scene${String(i).padStart(2, '0')}`;

function hsi4d(...words) {
  return execFileSync(program, words, { encoding: 'utf8', stdio: ['ignore', 'pipe', 'inherit'] });
}

// Folders of runs of two methods, whose videos are a fifth of a second long; the last pair has no text.
function makeRuns(folder) {
  for (const [m, method] of methods.entries()) {
    const video = join(folder, `${m}.mp4`), picture = `testsrc2=size=96x96:rate=10:duration=0.2,hue=s=${m + 1}`;
    execFileSync('ffmpeg', ['-v', 'error', '-f', 'lavfi', '-i', picture, '-pix_fmt', 'yuv420p', video]);
    for (let i = 0; i < kPairs; ++i) {
      mkdirSync(join(folder, method, nameOf(i)), { recursive: true });
      copyFileSync(video, join(folder, method, nameOf(i), 'preview.mp4'));
    }
  }
  const texts = Object.fromEntries(Array.from({ length: kPairs - 1 }, (_, i) => [nameOf(i), `A person waters plant ${i} </script> "now"`]));
  writeFileSync(join(folder, 'texts.json'), JSON.stringify(texts));
}

function makeStudy(folder, out, ...more) {
  hsi4d('study', join(folder, methods[0]), join(folder, methods[1]), '--out', join(folder, out), '--quiet',
    '--texts', join(folder, 'texts.json'), '--pairs', String(kShown), ...more);
  return pathToFileURL(join(folder, out, 'index.html')).href;
}

async function open(context, url) {
  const page = await context.newPage();
  page.setDefaultTimeout(60_000);
  const faults = [];
  const folder = url.slice(0, url.lastIndexOf('/') + 1);
  page.on('console', (message) => { if (['error', 'warning'].includes(message.type())) faults.push(message.text()); });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('request', (request) => {
    if (!/^(data|blob):/.test(request.url()) && !request.url().startsWith(folder)) faults.push(`asks for ${request.url()}`);
  });
  await page.goto(url);
  return { page, faults };
}

// What is in front of the person: number of the pair, text, names of the videos, questions.
const trialOf = (page) => page.evaluate(() => ({
  place: document.getElementById('place').textContent,
  text: document.getElementById('task').hidden ? '' : document.getElementById('text').textContent,
  videos: ['left', 'right'].map((id) => document.getElementById(id).src.replace(/^.*\/|\.mp4$/g, '')),
  questions: [...document.querySelectorAll('fieldset')].map((field) => field.id.replace('question-', '')),
}));

// Goes through all pairs. `choose(trial, question)` says 0 (left) or 1; `act(question, side)` does it.
async function goThrough(page, choose, act, next) {
  const chosen = [];
  await page.locator('#begin').click();
  for (let i = 0; i < kShown; ++i) {
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

async function checkPlays(page) {
  await page.waitForFunction(() => ['left', 'right'].every((id) => document.getElementById(id).currentTime > 0));
  const apart = await page.evaluate(() => Math.abs(document.getElementById('left').currentTime - document.getElementById('right').currentTime));
  check('the videos play together', apart < 0.15, `${apart} s apart`);
  const plays = (page) => page.evaluate(() => {
    const kept = JSON.parse(Object.values(localStorage)[0]);
    return Math.max(...Object.values(kept.pairs).map((pair) => pair.plays));
  });
  await page.waitForFunction(() => document.getElementById('play').textContent === 'Pause');
  await page.waitForTimeout(2600);  // what is kept is written every second
  check('and again and again', await plays(page) >= 2, `${await plays(page)} times`);
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
  const { page, faults } = await open(context, url);
  await page.locator('#begin').click();
  await checkPlays(page);
  const first = await trialOf(page);
  await page.locator('#next').click();
  check('an unanswered pair cannot be left', (await trialOf(page)).place === first.place);
  check('which is told', /Please answer/.test(await page.locator('#missing').textContent()));
  await page.locator(`#question-${first.questions[0]} label`).first().click();
  await page.locator('#next').click();
  check('nor one that is answered in half', first.questions.length === 1 || (await trialOf(page)).place === first.place);
  await page.reload();
  check('a reload shows the same pair', JSON.stringify(await trialOf(page)) === JSON.stringify(first));
  check('with what was chosen', await page.locator(`#question-${first.questions[0]} input`).first().isChecked());
  await checkWidths(page);
  check('no fault in that', faults.length === 0, faults.join('; '));
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
  const { page, faults } = await open(context, url);
  const chosen = await goThrough(page, (trial, question) => (question === 'quality' ? 0 : 1),
    (question, side) => page.keyboard.press(String(side + 1)), () => page.keyboard.press('Enter'));
  const saved = await save(page, file);
  check('a person without a name gets a number', /^[0-9a-f]{16}$/.test(saved.answers.person), saved.answers.person);
  page.once('dialog', (dialog) => dialog.accept());
  await page.locator('#another').click();
  await page.locator('#begin').click();
  const kept = await page.evaluate(() => JSON.parse(Object.values(localStorage)[0]));
  check('another person begins anew', kept.person !== saved.answers.person && (await trialOf(page)).place === `Pair 1 of ${kShown}`);
  check('by keys without a fault', faults.length === 0, faults.join('; '));
  await context.close();
  return { chosen, ...saved };
}

// On a phone, all in one file, the second video always.
async function testPhone(browser, url, file) {
  const context = await browser.newContext({ viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true, acceptDownloads: true });
  const { page, faults } = await open(context, url);
  check('a phone is not told of keys', await page.locator('.keyboard-only').isHidden());
  const act = (question, side) => page.locator(`#question-${question} label`).nth(side).tap();
  const next = async () => {
    await page.waitForFunction(() => ['left', 'right'].every((id) => document.getElementById(id).currentTime > 0));
    await page.locator('#next').tap();
  };
  const chosen = await goThrough(page, () => 1, act, next);
  const saved = await save(page, file);
  check('on a phone without a fault', faults.length === 0, faults.join('; '));
  await context.close();
  return { chosen, ...saved };
}

function chosenIn(answers) {
  return answers.answers.flatMap(({ chosen }) => Object.entries(chosen).map(([question, video]) => ({ question, video })));
}

// What the program says of the files, against what was done.
function checkResults(folder, isA, persons) {
  for (const { chosen, answers } of persons)
    check('the file has what was chosen', JSON.stringify(chosen) === JSON.stringify(chosenIn(answers)));
  const files = persons.map((_, i) => join(folder, `answers${i}.json`));
  hsi4d('study', '--answers', ...files, '--key', join(folder, 'page-key.json'), '--json', join(folder, 'out.json'), '--csv', join(folder, 'out.csv'));
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
  const videosOfA = new Set(key.pairs.map((pair) => pair.a));
  const isA = (video) => videosOfA.has(video);
  await testCare(browser, url);
  const jane = await testMouse(browser, url, join(folder, 'answers0.json'), isA);
  const keys = await testKeys(browser, url, join(folder, 'answers1.json'));
  const phone = await testPhone(browser, single, join(folder, 'answers2.json'));
  phone.chosen = chosenIn(phone.answers);  // videos in the page have no names there
  check('on the phone the second video was chosen', phone.answers.answers.every((answer) => Object.values(answer.chosen).every((video) => video === answer.right)));
  checkResults(folder, isA, [jane, keys, phone]);
  const orders = [jane, keys, phone].map(({ answers }) => answers.answers.map((answer) => answer.pair).join());
  check('each person has an order of its own', new Set(orders).size === 3);
  const left = [jane, keys, phone].flatMap(({ answers }) => answers.answers).filter((answer) => isA(answer.left)).length;
  check('A is left now and then', left > 1 && left < 3 * kShown - 1, `${left} of ${3 * kShown} times`);
} finally {
  await browser.close();
  rmSync(folder, { recursive: true });
}
end();
