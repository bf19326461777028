// node compare_splats.mjs KIND OURS.ply THEIRS.ply NAME: prints the largest differences of two PLY files of Gaussians,
// fails where one is beyond what KIND (ply, compressed.ply, splat, spz, transform) explains. Used by check_formats.
import { readFileSync } from 'node:fs';

const [kind, ourPath, theirPath, name] = process.argv.slice(2);

// Columns by name, of a little-endian PLY whose properties are floats.
function readPly(path) {
  const file = readFileSync(path);
  const end = file.indexOf('end_header\n') + 'end_header\n'.length;
  const header = file.subarray(0, end).toString();
  const rows = Number(/element vertex (\d+)/.exec(header)[1]);
  const names = [...header.matchAll(/property float (\S+)/g)].map((match) => match[1]);
  const columns = Object.fromEntries(names.map((column) => [column, new Float32Array(rows)]));
  let at = end;
  for (let row = 0; row < rows; ++row) {
    for (const column of names) {
      columns[column][row] = file.readFloatLE(at);
      at += 4;
    }
  }
  if (at !== file.length) throw new Error(`${path}: ${file.length - at} bytes are left over`);
  return { rows, columns, rest: names.filter((column) => column.startsWith('f_rest_')) };
}

const ours = readPly(ourPath);
const theirs = readPly(theirPath);
const faults = [];
if (ours.rows !== theirs.rows) faults.push(`${ours.rows} rows against ${theirs.rows}`);
if (ours.rest.length !== theirs.rest.length) faults.push(`${ours.rest.length} f_rest_ against ${theirs.rest.length}`);

const sigmoid = (x) => 1 / (1 + Math.exp(-x));
const same = (x) => x;
function largest(columns, map = same) {
  let most = 0;
  for (const column of columns) {
    for (let row = 0; row < ours.rows; ++row) {
      const difference = Math.abs(map(ours.columns[column][row]) - map(theirs.columns[column][row]));
      if (Number.isNaN(difference)) return NaN;
      most = Math.max(most, difference);
    }
  }
  return most;
}

// Angle between rotations, radians.
function largestAngle() {
  const columns = ['rot_0', 'rot_1', 'rot_2', 'rot_3'];
  const unit = (of, row) => {
    const q = columns.map((column) => of.columns[column][row]);
    const length = Math.hypot(...q);
    return q.map((x) => x / length);
  };
  let most = 0;
  for (let row = 0; row < ours.rows; ++row) {
    const p = unit(ours, row);
    const q = unit(theirs, row);
    const sign = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] < 0 ? -1 : 1;
    const chord = Math.hypot(...p.map((x, i) => x - sign * q[i]));
    most = Math.max(most, 4 * Math.asin(Math.min(1, chord / 2)));
  }
  return most;
}

const reach = Math.max(1, ...['x', 'y', 'z'].map((axis) => ours.columns[axis].reduce((most, x) => Math.max(most, Math.abs(x)), 0)));
const quantised = kind !== 'ply' && kind !== 'transform';
const checks = [
  ['means', largest(['x', 'y', 'z']), 1e-6 * reach],
  ['log-scales', largest(['scale_0', 'scale_1', 'scale_2']), 1e-5],
  // The end levels of 8 bits are read as 0.25/255 and 254.75/255 here, as 0 and 1, or 1/255 and 254/255 there.
  ['opacities', largest(['opacity'], sigmoid), quantised ? 0.76 / 255 : 1e-6],
  ['f_dc', largest(['f_dc_0', 'f_dc_1', 'f_dc_2']), 1e-5],
  ['f_rest', largest(ours.rest), 1e-5],
  // (b − 128)/128 here, 2b/255 − 1 there.
  ['angle', largestAngle(), kind === 'splat' ? 0.02 : 2e-3],
];
const text = checks.map(([what, value]) => `${what} ${value.toExponential(1)}`).join(', ');
for (const [what, value, bound] of checks) {
  if (!(value <= bound)) faults.push(`${what} differ by ${value}; allowed: ${bound}`);
}
console.log(`${name}: ${ours.rows} Gaussians: ${text}`);
for (const fault of faults) console.log(`  WRONG: ${fault}`);
process.exit(faults.length > 0 ? 1 : 0);
