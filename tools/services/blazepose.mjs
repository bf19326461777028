// Finds a person in pictures by BlazePose in headless Chromium: what tools/frontend runs.
//
//     node tools/services/blazepose.mjs --packages NODE_MODULES --frames DIR --model M --out DIR
//         [--person X0,Y0,X1,Y1] [--hands] [--smooth N] [--numbered]
//
// The box, pixels of the first picture, says which person is followed. --numbered: masks are called by the numbers of
// the pictures, 0000.png, ..., not as these.
// The packages are served to the page by a server of this process on the loopback interface. Chromium draws by its
// processor. Exits with 2 and a message where the pictures are unusable or show nobody, with 1 where the browser fails.
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { createReadStream, existsSync, mkdirSync, readdirSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { basename, join } from 'node:path';
import { parseArgs } from 'node:util';
import { HandFinder } from './hands.mjs';
import { byBytes, jumpsOf, kDoubtful, scoresOf, smoothed } from './track.mjs';

const text = { type: 'string' }, flag = { type: 'boolean' };
const { packages: modules, frames, model, out, person, hands, smooth, numbered } = parseArgs({
  options: { packages: text, frames: text, model: text, out: text, person: text, hands: flag, smooth: text, numbered: flag },
}).values;
const kComplexity = { lite: 0, full: 1, heavy: 2 };

function fail(message, status = 1) {
  console.error(`frontend: ${message}`);
  process.exit(status);
}

const refuse = (message) => fail(message, 2);

const kPackages = ['pose', 'hands']; // of MediaPipe, each with a page
const kTypes = { html: 'text/html', js: 'text/javascript', wasm: 'application/wasm', png: 'image/png' };

// What a page may ask for: itself, its package, the frames.
function fileOf(path) {
  const [, room, name] = decodeURIComponent(path).split('/');
  if (kPackages.includes(room)) return join(modules, '@mediapipe', room, basename(name));
  return room === 'frames' ? join(frames, basename(name)) : undefined;
}

async function served() {
  const server = createServer((request, response) => {
    const path = request.url.split('?')[0];
    if (kPackages.includes(path.slice(1))) {
      response.writeHead(200, { 'Content-Type': 'text/html' }).end(`<script src="${path}${path}.js"></script>`);
      return;
    }
    const file = fileOf(path);
    if (file === undefined || !existsSync(file)) {
      response.writeHead(404).end();
      return;
    }
    response.writeHead(200, { 'Content-Type': kTypes[file.split('.').pop()] ?? 'application/octet-stream' });
    createReadStream(file).pipe(response);
  });
  server.listen(0, '127.0.0.1');
  await once(server, 'listening');
  return { server, url: `http://127.0.0.1:${server.address().port}/` };
}

// In the page.
async function begin(complexity) {
  const pose = new Pose({ locateFile: (file) => `/pose/${file}` });
  pose.setOptions({ modelComplexity: complexity, smoothLandmarks: false, enableSegmentation: true, smoothSegmentation: false });
  pose.onResults((results) => { window.found = results; });
  await pose.initialize();
  window.pose = pose;
}

// In the page: shows BlazePose the first picture with nothing but what is in the box. It looks for a person only where
// it has lost one, else it goes on where that one was. Returns whether there is one, and the picture's size.
async function lookIntoBox({ name, box: [left, top, right, bottom] }) {
  const picture = new Image();
  picture.src = `/frames/${encodeURIComponent(name)}`;
  await picture.decode();
  const canvas = document.createElement('canvas'), context = canvas.getContext('2d');
  [canvas.width, canvas.height] = [picture.width, picture.height];
  context.fillStyle = 'grey';
  context.fillRect(0, 0, picture.width, picture.height);
  const place = [left, top, right - left, bottom - top];
  context.drawImage(picture, ...place, ...place);
  window.found = undefined;
  await window.pose.send({ image: canvas });
  return { isFound: !!window.found?.poseLandmarks, width: picture.width, height: picture.height };
}

// In the page: the points of a picture, and its mask as letters of base64, a byte a pixel.
async function look(name) {
  const picture = new Image();
  picture.src = `/frames/${encodeURIComponent(name)}`;
  await picture.decode();
  window.found = undefined;
  await window.pose.send({ image: picture });
  if (window.found === undefined) throw new Error(`no answer for ${name}`);
  const { poseLandmarks, poseWorldLandmarks, segmentationMask } = window.found;
  const canvas = new OffscreenCanvas(picture.width, picture.height), context = canvas.getContext('2d');
  if (segmentationMask) context.drawImage(segmentationMask, 0, 0, picture.width, picture.height);
  const { data } = context.getImageData(0, 0, picture.width, picture.height);
  let letters = '';
  for (let i = 3; i < data.length; i += 4) letters += String.fromCharCode(data[i]);
  return { width: picture.width, height: picture.height, points: poseLandmarks, places: poseWorldLandmarks, mask: btoa(letters) };
}

// Writes grey pictures by ffmpeg.
class MaskWriter {
  constructor(names) {
    this.folder = join(out, 'masks', 'human');
    mkdirSync(this.folder, { recursive: true });
    this.names = names; // of the masks
  }
  async write(index, width, height, bytes) {
    const file = join(this.folder, this.names[index]);
    const words = ['-v', 'error', '-f', 'rawvideo', '-pix_fmt', 'gray', '-s', `${width}x${height}`, '-i', '-', '-frames:v', '1', file];
    const ffmpeg = spawn('ffmpeg', words, { stdio: ['pipe', 'inherit', 'inherit'] });
    ffmpeg.stdin.end(bytes);
    const [status] = await once(ffmpeg, 'close');
    if (status !== 0) fail(`${file}: cannot be written`);
  }
}

async function beginWith(page, name, title) {
  const box = person.split(',').map(Number), [left, top, right, bottom] = box;
  const seen = await page.evaluate(lookIntoBox, { name, box }).catch((error) => fail(`${title}: ${error.message}`));
  if (!(left < right && top < bottom && right <= seen.width && bottom <= seen.height))
    refuse(`--person ${person}: is no box in ${title}; allowed: X0 < X1 up to ${seen.width}, Y0 < Y1 up to ${seen.height}`);
  if (!seen.isFound) refuse(`--person ${person}: nobody is found in that box of ${title}`);
}

const rounded = (number) => Math.round(number * 1000) / 1000;
const allRounded = (frames) => frames.map((rows) => rows.map((row) => row.map(rounded)));

function ranges(numbers) {
  const parts = [];
  for (const number of numbers) {
    const last = parts.at(-1);
    if (last !== undefined && last[1] === number - 1) last[1] = number;
    else parts.push([number, number]);
  }
  return parts.map(([a, b]) => (a === b ? `${a}` : `${a}-${b}`)).join(', ');
}

// What the frames are worth is told, and returned as numbers.
function told(points) {
  const all = scoresOf(points), jumps = jumpsOf(points);
  const framesOf = (isOne) => points.flatMap((found, t) => (found.length > 0 && isOne(all[t], t) ? [t] : []));
  const tell = (numbers, before, after = '') => {
    if (numbers.length > 0) console.error(`frontend: ${before} in frames ${ranges(numbers)}${after}`);
  };
  tell(points.flatMap((found, t) => (found.length === 0 ? [t] : [])), 'nobody is found', '; their masks are black');
  tell(framesOf(({ isSeen }) => !isSeen), 'less than half of the person is seen');
  tell(framesOf(({ isSteady }, t) => !isSteady && !jumps.includes(t)), 'the points leap');
  tell(jumps, 'the person is suddenly elsewhere', ': somebody else, or a cut?');
  const scores = all.map(({ score }) => rounded(score)), low = scores.filter((score) => score < kDoubtful).length;
  console.error(`frontend: the score is ${Math.min(...scores)} to ${Math.max(...scores)}, below ${kDoubtful} in ${low} of ${scores.length} frames`);
  return scores;
}

const names = readdirSync(frames).filter((name) => name.endsWith('.png') && !name.startsWith('.')).sort(byBytes);
if (names.length < 2) refuse(`${numbered ? 'the video' : frames} has ${names.length} ${numbered ? '' : '.png '}frames; allowed: two or more`);
const titles = numbered ? names.map((_, index) => `${index}`.padStart(4, '0') + '.png') : names; // of masks, and in messages
const { chromium } = createRequire(import.meta.url)(join(modules, 'playwright-core'));
const { server, url } = await served();
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM,
  args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'],
});
const opened = async (name, title) => {
  const page = await browser.newPage();
  page.on('pageerror', (error) => fail(`${title}: ${error.message}`));
  await page.goto(url + name);
  return page;
};
try {
  const page = await opened('pose', 'BlazePose');
  await page.evaluate(begin, kComplexity[model]).catch((error) => fail(`BlazePose does not begin: ${error.message}`));
  const finder = hands ? new HandFinder(await opened('hands', 'MediaPipe Hands')) : undefined;
  await finder?.begin().catch((error) => fail(`MediaPipe Hands does not begin: ${error.message}`));
  if (person) await beginWith(page, names[0], titles[0]);
  const masks = new MaskWriter(titles), points = [], places = [], handed = [0, 0];
  let size, began = Date.now();
  for (const [index, name] of names.entries()) {
    const found = await page.evaluate(look, name).catch((error) => fail(`${titles[index]}: ${error.message}`));
    size ??= [found.width, found.height];
    if (found.width !== size[0] || found.height !== size[1])
      refuse(`${titles[index]}: is ${found.width}x${found.height} pixels, the first frame ${size.join('x')}`);
    await masks.write(index, found.width, found.height, Buffer.from(found.mask, 'base64'));
    const seen = (found.points ?? []).map(({ x, y, visibility }) => [x * size[0], y * size[1], Math.min(Math.max(visibility, 0), 1)]);
    const spots = (found.places ?? []).map(({ x, y, z }) => [x, y, z]);
    const both = finder && found.points ? await finder.find(name, seen, spots).catch((error) => fail(`${titles[index]}: ${error.message}`)) : [];
    for (const [side, hand] of both.entries()) {
      seen.push(...hand.points);
      spots.push(...hand.places);
      if (hand.points[0][2] > 0) handed[side] += 1;
    }
    points.push(seen);
    places.push(spots);
    process.stderr.write(`\rframe ${index + 1} of ${names.length}, ${((Date.now() - began) / 1000 / (index + 1)).toFixed(1)} s each `);
  }
  process.stderr.write('\n');
  if (points.every((found) => found.length === 0)) refuse('nobody is found in any frame');
  const scores = told(points);
  if (finder) console.error(`frontend: the left hand is found in ${handed[0]} frames, the right one in ${handed[1]}, of ${names.length}`);
  const track = smooth ? smoothed(points, places, Number(smooth)) : { points, places };
  const file = {
    format: 'hsi4d keypoints', version: 1, joints: finder ? 'blazepose33_hands' : 'blazepose33', size,
    frames: allRounded(track.points), landmarks: allRounded(track.places), scores,
  };
  writeFileSync(join(out, 'keypoints.json'), `${JSON.stringify(file)}\n`);
} finally {
  await browser.close();
  server.close();
}
