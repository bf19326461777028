// `hsi4d watch` in a browser: a folder of runs, whose files this test lets grow, shrink and fail, in headless Chromium.
//
//     node tests/pipelines/watch/browser_test.mjs HSI4D [MODULES]     the program; a node_modules with playwright-core
//
// Exit status 77 (skipped) without playwright-core or Chromium. CHROMIUM names another Chromium than that in PATH.
import { execFileSync, spawn } from 'node:child_process';
import { appendFileSync, cpSync, mkdirSync, mkdtempSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { tmpdir } from 'node:os';
import { chromiumOf, check, end } from '../../support/browser.mjs';

const [program, modules = '.'] = process.argv.slice(2).map((path) => resolve(path));
const { chromium, executablePath } = chromiumOf(modules);
const base = mkdtempSync(join(tmpdir(), 'hsi4d_watch_'));
const runs = join(base, 'runs');
const live = join(runs, 'live');

// A run of a second or two.
function makeRun(folder) {
  const settings = { 'synthetic.frames': 4, 'synthetic.size_px': 64, 'synthetic.scene_gaussians': 2000,
    'synthetic.avatar_gaussians': 500, 'stages.camera.iterations': 3, 'stages.interaction.iterations': 4,
    'stages.refinement.iterations': 2, 'log.preview': false };
  const set = Object.entries(settings).flatMap(([key, value]) => ['--set', `${key}=${value}`]);
  execFileSync(program, ['demo', '--quick', '--quiet', '--out', folder, ...set], { stdio: ['ignore', 'ignore', 'inherit'] });
}

// The program, and the address that it prints.
async function watch(folder) {
  const child = spawn(program, ['watch', folder], { stdio: ['ignore', 'pipe', 'inherit'] });
  let told = '';
  for await (const part of child.stdout) {
    told += part;
    if (told.includes('\n')) break;
  }
  return { child, url: told.split(' ')[0] };
}

const line = (frame, stage, iteration, loss) => `${JSON.stringify({ frame, stage, iteration, loss, losses: { photometric: loss }, seconds: 0.1 })}\n`;
const status = (state, message) => writeFileSync(join(live, 'status.json'), JSON.stringify({ state, message, started: '2026-01-01T00:00:00Z' }));
const metrics = join(live, 'metrics.jsonl');
const facts = (page) => page.locator('#facts').innerText();
const holds = (page, condition, ...rest) => page.waitForFunction(condition, ...rest).then(() => true, () => false);
const text = (page, id, wanted) => holds(page, ([at, part]) => document.getElementById(at).textContent.includes(part), [id, wanted]);

// How many colours other than nothing a canvas has.
const colours = (page, selector) => page.$eval(selector, (canvas) => {
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  return new Set(Array.from({ length: data.length / 4 }, (_, i) => data.slice(4 * i, 4 * i + 4).join())).size;
});

makeRun(join(base, 'made'));
cpSync(join(base, 'made', 'run'), join(runs, 'done'), { recursive: true });
const { child, url } = await watch(runs);
const ended = new Promise((resolve) => { child.on('exit', resolve); });
const browser = await chromium.launch({ executablePath, args: ['--no-sandbox'] });
try {
  const page = await (await browser.newContext({ viewport: { width: 1200, height: 900 } })).newPage();
  page.setDefaultTimeout(60_000);
  const faults = [];
  page.on('console', (message) => { if (['error', 'warning'].includes(message.type())) faults.push(message.text()); });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('request', (request) => { if (!request.url().startsWith(url) && !request.url().startsWith('data:')) faults.push(`asks for ${request.url()}`); });

  await page.goto(url);
  await text(page, 'table', 'done');
  const heads = await page.locator('#table thead th').allInnerTexts();
  check('the table has runs and metrics', heads.includes('frames') && heads.length > 8, heads.join(' | '));
  check('a click opens a run', (await page.locator('#table tbody tr').first().click(), await text(page, 'facts', '3 of 3')));
  check('its result is told', await page.locator('#results dd').count() > 5);
  check('a plot by frame, and two a stage, are there', await page.locator('#plots canvas').count() === 7, String(await page.locator('#plots canvas').count()));
  for (const plot of await page.locator('#plots .card').evaluateAll((cards) => cards.map(({ id }) => id)))
    check(`${plot} is drawn`, await colours(page, `#${plot} canvas`) > 3);
  await holds(page, () => document.getElementById('difference').width === 64);
  for (const id of ['target', 'render', 'difference']) check(`the ${id} is drawn`, await colours(page, `#${id}`) > 20);
  check('the newest frame is shown', await page.locator('#frame-name').innerText() === 'frame 3');
  await page.locator('#frame').focus();
  await page.keyboard.press('ArrowLeft');
  check('the slider goes to another frame, and its curves', await page.locator('#frame-name').innerText() === 'frame 2' && (await page.locator('#plot-loss-0').innerText()).includes('frame 2'));
  check('it then stays there', !(await page.locator('#follow').isChecked()));
  const before = await page.locator('#plot-loss-1 canvas').screenshot();
  await page.locator('#log').uncheck();
  check('the scale changes', !(await page.locator('#plot-loss-1 canvas').screenshot()).equals(before));

  // A run that begins while the page is open, with a line that is half written.
  await page.locator('#back a').click();
  mkdirSync(join(live, 'frames'), { recursive: true });
  writeFileSync(join(live, 'config.resolved.json'), JSON.stringify({ stages: { camera: { iterations: 9 } } }));
  status('running');
  check('a run that begins appears in the table', await text(page, 'table', 'live'));
  await page.locator('#table a', { hasText: 'live' }).click();
  check('it has no frame and no iteration yet', await text(page, 'facts', 'frames0iterations0') && await page.locator('#no-frames').isVisible());
  writeFileSync(metrics, line(1, 'camera', 0, 0.5) + line(1, 'camera', 1, 0.25) + line(1, 'camera', 2, 0.1).slice(0, 30));
  check('its iterations are counted without half a line', await text(page, 'facts', 'iterations2'));
  appendFileSync(metrics, `${line(1, 'camera', 2, 0.1).slice(30)}no line\n`);
  check('and with it when it is whole', await text(page, 'facts', 'iterations3'));
  check('a line that cannot be read is told', await text(page, 'skipped', '1 lines'));
  check('the curve tells where it is', (await page.locator('#plot-loss-0').innerText()).includes('3 of at most 9 iterations, loss 0.1'));
  for (const kind of ['target', 'render']) cpSync(join(runs, 'done', 'frames', `0001_${kind}.png`), join(live, 'frames', `0001_${kind}.png`));
  check('a finished frame is shown', await text(page, 'frame-name', 'frame 1') && await page.locator('#frames-view').isVisible());
  writeFileSync(`${metrics}.new`, line(1, 'camera', 0, 0.5));
  renameSync(`${metrics}.new`, metrics);
  check('after a resumption it begins anew', await text(page, 'facts', 'iterations1'), await facts(page));
  status('failed', 'stage camera: the loss is not finite');
  check('a failure tells its message', await text(page, 'message', 'not finite') && await text(page, 'state', 'failed'));
  check('nothing is wrong on the page', faults.length === 0, faults.join('; '));

  child.kill('SIGINT');
  check('SIGINT ends it well', await ended === 0);
  check('the page tells that nobody answers', await text(page, 'lost', 'does not answer'));
} finally {
  await browser.close();
  if (child.exitCode === null) child.kill('SIGKILL');
  rmSync(base, { recursive: true, force: true });
}
end();
