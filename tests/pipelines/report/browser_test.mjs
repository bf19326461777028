// The report in a browser: a small run is made, its report.html is opened from disk in headless Chromium and used.
//
//     node tests/pipelines/report/browser_test.mjs HSI4D [MODULES]     the program; a node_modules with playwright-core
//
// Exit status 77 (skipped) without playwright-core or Chromium. CHROMIUM names another Chromium than that in PATH.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { tmpdir } from 'node:os';
import { pathToFileURL } from 'node:url';
import { chromiumOf, check, end } from '../../support/browser.mjs';

const [program, modules = '.'] = process.argv.slice(2).map((path) => resolve(path));
const { chromium, executablePath } = chromiumOf(modules);

// A run of a second or two: what it finds does not matter here.
function makeReport(folder) {
  const settings = { 'synthetic.frames': 4, 'synthetic.size_px': 96, 'synthetic.scene_gaussians': 3000,
    'synthetic.avatar_gaussians': 800, 'stages.camera.iterations': 2, 'stages.interaction.iterations': 2,
    'stages.refinement.iterations': 2 };
  const set = Object.entries(settings).flatMap(([key, value]) => ['--set', `${key}=${value}`]);
  execFileSync(program, ['demo', '--quick', '--quiet', '--out', folder, ...set], { stdio: ['ignore', 'ignore', 'inherit'] });
  return pathToFileURL(join(folder, 'run', 'report.html')).href;
}

// A page with the report, and what went wrong on it.
async function open(url, { args, viewport, hasTouch = false }) {
  const browser = await chromium.launch({ executablePath, args: ['--no-sandbox', ...args] });
  const page = await (await browser.newContext({ viewport, hasTouch })).newPage();
  page.setDefaultTimeout(120_000);  // of a machine that is busy and draws without a graphics card
  const faults = [];
  page.on('console', (message) => {
    // Hints about speed, of drivers and of what this test reads back, are no fault of the page.
    if (message.type() === 'error' || (message.type() === 'warning' && !/GPU stall|swiftshader|WebGL|willReadFrequently/i.test(message.text())))
      faults.push(message.text());
  });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('request', (request) => {
    if (!/^(data|blob):/.test(request.url()) && request.url() !== url) faults.push(`asks for ${request.url()}`);
  });
  await page.goto(url);
  return { browser, page, faults };
}

const software = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];
const canvas3d = '#view3d-canvas';
const drawn = (page) => page.$eval(canvas3d, (canvas) => Number(canvas.dataset.drawn ?? 0));

// Does `deed` and waits until the 3D view has been drawn anew.
async function drawAfter(page, deed) {
  const before = await drawn(page);
  await deed();
  await page.waitForFunction((count) => Number(document.querySelector('#view3d-canvas').dataset.drawn ?? 0) > count, before);
}

// What the 3D view then looks like.
async function pictureAfter(page, deed) {
  await drawAfter(page, deed);
  return page.locator(canvas3d).screenshot();
}

const edgeAt = (page) => page.$eval('#edge', (edge) => Number(edge.getAttribute('aria-valuenow')));

// Mean difference, of 255, of the divided image from an image of the page's data in frame `frame`.
const differenceFrom = (page, kind, frame) => page.evaluate(async ([kind, frame]) => {
  const data = JSON.parse(document.getElementById('frames-data').textContent);
  const image = new Image();
  image.src = data.images.find((entry) => entry.frame === frame).files[kind];
  await image.decode();
  const canvas = document.getElementById('compare-canvas'), other = document.createElement('canvas');
  [other.width, other.height] = [canvas.width, canvas.height];
  other.getContext('2d').drawImage(image, 0, 0, canvas.width, canvas.height);
  const [a, b] = [canvas, other].map((c) => c.getContext('2d').getImageData(0, 0, c.width, c.height).data);
  return a.reduce((sum, value, i) => sum + Math.abs(value - b[i]), 0) / a.length;
}, [kind, frame]);

async function testDivider(page) {
  await page.locator('#compare').scrollIntoViewIfNeeded();
  const box = await page.locator('#compare').boundingBox();
  const at = (share) => [box.x + share * box.width, box.y + box.height / 2];
  const before = await page.locator('#compare').screenshot();
  check('the divider begins in the middle', await edgeAt(page) === 50);
  await page.mouse.move(...at(0.5));
  await page.mouse.down();
  await page.mouse.move(...at(0.4));
  await page.mouse.move(...at(0.2));
  await page.mouse.up();
  check('the mouse drags the divider', await edgeAt(page) === 20, `it is at ${await edgeAt(page)}`);
  check('and the picture changes', !before.equals(await page.locator('#compare').screenshot()));
  await page.mouse.move(...at(0.9));
  check('it stays where it was let go', await edgeAt(page) === 20);
  await page.keyboard.press('ArrowRight');
  check('a key moves it', await edgeAt(page) === 22);
  await page.touchscreen.tap(...at(0.75));
  check('a finger moves it', Math.abs(await edgeAt(page) - 75) <= 1, `it is at ${await edgeAt(page)}`);
  const frame = Number(await page.$eval('#compare', (compare) => compare.dataset.frame));
  for (const [key, kind] of [['Home', 'render'], ['End', 'target']]) {
    await page.locator('#edge').press(key);
    const off = await differenceFrom(page, kind, frame);
    check(`at ${key} all is the image "${kind}"`, off === 0, `they differ by ${off}`);
  }
  await page.selectOption('#left', 'difference');
  await page.waitForFunction(() => document.getElementById('tag-left').textContent.startsWith('difference'));
  await page.waitForTimeout(200);
  const worst = await page.evaluate(async (frame) => {
    const data = JSON.parse(document.getElementById('frames-data').textContent);
    const { files } = data.images.find((entry) => entry.frame === frame);
    const pixelsOf = async (url) => {
      const image = new Image();
      image.src = url;
      await image.decode();
      const canvas = document.createElement('canvas');
      [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
      canvas.getContext('2d').drawImage(image, 0, 0);
      return canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    };
    const [a, b] = [await pixelsOf(files.target), await pixelsOf(files.render)];
    const canvas = document.getElementById('compare-canvas');
    const shown = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let worst = 0;
    for (let i = 0; i < a.length; ++i)
      if (i % 4 !== 3) worst = Math.max(worst, Math.abs(shown[i] - Math.min(255, data.gain * Math.abs(a[i] - b[i]))));
    return worst;
  }, frame);
  check('the difference is four times that of the two images', worst <= 4, `off by ${worst}`);
  await page.selectOption('#left', 'target');
  await page.locator('#edge').press('Home');
}

async function testTime(page) {
  const scrub = (number, to) => page.locator('.scrubber input').nth(number).fill(String(to));
  const before = await page.locator('#compare').screenshot();
  const first = await pictureAfter(page, () => scrub(0, 1));
  const second = await pictureAfter(page, () => scrub(1, 3));
  await page.waitForFunction(() => document.getElementById('compare').dataset.frame === '3');
  const names = await page.locator('.frame-name').allTextContents();
  check('every scrubber shows the frame', names.length === 2 && names.every((name) => name === 'frame 3'), names.join());
  check('the 3D view is at that frame', await page.$eval(canvas3d, (canvas) => canvas.dataset.frame) === '3');
  check('the images change with time', !before.equals(await page.locator('#compare').screenshot()));
  check('the 3D view changes with time', !first.equals(second));
  check('the frame has its errors', /MPJPE/.test(await page.locator('#frame-errors').textContent()));
  await page.locator('.play').first().click();
  await page.waitForFunction(() => document.querySelector('.frame-name').textContent === 'frame 1');  // over the end
  await page.locator('.play').last().click();
  const stopped = await page.locator('.frame-name').first().textContent();
  await page.waitForTimeout(400);
  check('what plays can be stopped', await page.locator('.frame-name').first().textContent() === stopped);
  const plot = page.locator('svg.plot.timed').first();
  const { from, to, left, right } = await plot.evaluate((svg) => ({ ...svg.dataset }));
  const [start, end, begins, ends] = [from, to, left, right].map(Number);
  const place = begins + (1 - start) / (end - start) * (ends - begins);  // of frame 1
  const { width, height } = await plot.boundingBox();
  const scale = width / await plot.evaluate((svg) => svg.viewBox.baseVal.width);
  await plot.click({ position: { x: place * scale, y: height / 2 } });
  check('a click into a plot goes to its frame', await page.locator('.frame-name').first().textContent() === 'frame 1');
  const marked = Number(await plot.locator('.now').getAttribute('x1'));
  check('which is marked there', Math.abs(marked - place) < 0.1, `${marked} and ${place}`);
  await scrub(0, 2);
  await page.waitForFunction(() => document.getElementById('compare').dataset.frame === '2');
}

// Mean difference, of 255, of a picture of the 3D view from the reconstruction in `frame`.
const differenceFromRender = (page, picture, frame) => page.evaluate(async ([picture, frame]) => {
  const data = JSON.parse(document.getElementById('frames-data').textContent);
  const pixelsOf = async (url, crop) => {
    const image = new Image();
    image.src = url;
    await image.decode();
    const side = crop ? Math.min(image.naturalWidth, image.naturalHeight) : image.naturalWidth;
    const canvas = document.createElement('canvas');
    canvas.width = canvas.height = 96;
    const context = canvas.getContext('2d');
    context.imageSmoothingQuality = 'high';
    context.drawImage(image, (image.naturalWidth - side) / 2, (image.naturalHeight - side) / 2, side, side, 0, 0, 96, 96);
    return context.getImageData(0, 0, 96, 96).data;
  };
  const a = await pixelsOf(`data:image/png;base64,${picture}`, true);
  const b = await pixelsOf(data.images.find((entry) => entry.frame === frame).files.render, false);
  return a.reduce((sum, value, i) => sum + Math.abs(value - b[i]), 0) / (a.length * 3 / 4);
}, [picture.toString('base64'), frame]);

async function testSpace(page) {
  const first = await pictureAfter(page, () => page.click('#view3d-reset'));
  await page.locator(canvas3d).scrollIntoViewIfNeeded();
  const box = await page.locator(canvas3d).boundingBox();
  const middle = [box.x + box.width / 2, box.y + box.height / 2];
  const turned = await pictureAfter(page, async () => {
    await page.mouse.move(...middle);
    await page.mouse.down();
    await page.mouse.move(middle[0] + 120, middle[1] - 30, { steps: 3 });
    await page.mouse.up();
    await page.waitForTimeout(300);
  });
  check('the mouse turns the 3D view', !first.equals(turned));
  const near = await pictureAfter(page, () => page.mouse.wheel(0, -300));
  check('the wheel comes nearer', !turned.equals(near));
  check('a key turns it', !near.equals(await pictureAfter(page, () => page.keyboard.press('ArrowLeft'))));
  check('reset is where it began', first.equals(await pictureAfter(page, () => page.click('#view3d-reset'))));
  for (const part of ['scene', 'objects', 'body', 'truth', 'camera', 'skeleton', 'cut']) {
    const changed = await pictureAfter(page, () => page.click(`#show-${part}`));
    check(`"${part}" can be switched`, !first.equals(changed));
    await drawAfter(page, () => page.click(`#show-${part}`));
  }
  // Through the camera it shows what the renderer of the program did, but for the body, which is a mesh.
  const same = await differenceFromRender(page, await pictureAfter(page, () => page.click('#view3d-follow')), 2);
  const other = await differenceFromRender(page, first, 2);
  check('through the camera one sees the reconstruction', same < 16 && same < other / 2,
    `it differs by ${same.toFixed(1)} of 255, from elsewhere by ${other.toFixed(1)}`);
}

async function testWhole(url) {
  const { browser, page, faults } = await open(url, { args: software, viewport: { width: 700, height: 500 }, hasTouch: true });
  await page.waitForFunction(() => Number(document.querySelector('#view3d-canvas').dataset.drawn ?? 0) > 0);
  await page.waitForFunction(() => document.getElementById('compare').dataset.frame);
  check('the 3D view has no message', await page.locator('#view3d-message').isHidden());
  await testDivider(page);
  await testTime(page);
  await testSpace(page);
  for (const width of [1400, 420]) {
    await page.setViewportSize({ width, height: 900 });
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    check(`nothing hangs over the edge of ${width} pixels`, wide <= width, `${wide}`);
  }
  check('the page has no fault and asks for nothing', faults.length === 0, faults.join('; '));
  await browser.close();
}

async function testWithoutWebGl(url) {
  const { browser, page, faults } = await open(url, { args: ['--disable-3d-apis'], viewport: { width: 1000, height: 800 } });
  await page.waitForFunction(() => document.getElementById('compare').dataset.frame);
  const message = await page.locator('#view3d-message').textContent();
  check('without WebGL the page says so', /WebGL 2/.test(message), message);
  await page.locator('#edge').press('End');
  check('and the divider works', await edgeAt(page) === 100);
  check('without a fault', faults.length === 0, faults.join('; '));
  await browser.close();
}

// Reports of runs that lack something.
async function testPartial(run) {
  const write = () => execFileSync(program, ['report', run], { stdio: 'ignore' });
  const url = pathToFileURL(join(run, 'report.html')).href;
  rmSync(join(run, 'frames'), { recursive: true });
  write();
  const space = await open(url, { args: software, viewport: { width: 500, height: 400 } });
  await space.page.waitForFunction(() => Number(document.querySelector('#view3d-canvas').dataset.drawn ?? 0) > 0);
  await space.page.locator('.scrubber input').fill('0');
  await space.page.waitForFunction(() => document.querySelector('#view3d-canvas').dataset.frame === '0');
  check('the 3D view goes without images', space.faults.length === 0, space.faults.join('; '));
  await space.browser.close();
  rmSync(join(run, 'view3d.safetensors'));
  write();
  const bare = await open(url, { args: software, viewport: { width: 500, height: 400 } });
  check('a report without both has no fault', bare.faults.length === 0, bare.faults.join('; '));
  check('and tells what is missing', /view3d.safetensors is missing/.test(await bare.page.locator('#notes').textContent()));
  await bare.browser.close();
}

const folder = mkdtempSync(join(tmpdir(), 'hsi4d_report_'));
try {
  const url = makeReport(join(folder, 'demo'));
  await testWhole(url);
  await testWithoutWebGl(url);
  await testPartial(join(folder, 'demo', 'run'));
} finally {
  rmSync(folder, { recursive: true });
}
end();
