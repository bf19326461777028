// A person's points over the frames of a video: where they leap, how good they are, and smoothed in time. What
// tools/services/blazepose.mjs does once all frames are looked at.
import { meanOf } from './hands.mjs';

const kLimbs = [11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28]; // shoulders to wrists, hips to ankles
const kTrunk = [11, 12, 23, 24];
const kBody = 33; // points of BlazePose; those of hands follow
const kSeen = 0.5; // visibility from which a point counts as seen
const kJump = 0.5; // of the person's height in the picture: by more the trunk, or half of the limbs, moves from another person
const kWidthOfCurves = 5; // frames from which they are smoothed by a parabola, else by a straight line

export const kDoubtful = 0.5; // score below which a frame is told

// The order in which hsi4d takes names: by their bytes.
export const byBytes = (a, b) => Buffer.compare(Buffer.from(a), Buffer.from(b));

// Middle of shoulders and hips, and the height of what is found; pixels.
function whereabouts(points) {
  const trunk = kTrunk.map((i) => points[i]), ys = points.slice(0, kBody).map(([, y]) => y);
  return { x: meanOf(trunk.map(([x]) => x)), y: meanOf(trunk.map(([, y]) => y)), height: Math.max(...ys) - Math.min(...ys) };
}

// Frames in which somebody is found elsewhere than in the last one before in which somebody was.
export function jumpsOf(frames) {
  const found = [];
  let last;
  for (const [t, points] of frames.entries()) {
    if (points.length === 0) continue;
    const now = whereabouts(points);
    if (last !== undefined && Math.hypot(now.x - last.x, now.y - last.y) > kJump * last.height) found.push(t);
    last = now;
  }
  return found;
}

const middleOf = (numbers) => numbers.sort((a, b) => a - b)[Math.floor(numbers.length / 2)];

// 1 where the limbs are between where they are in the frames before and after; 0 where half of them leap.
function steadinessOf(frames, t) {
  const beside = [frames[t - 1], frames[t + 1]].filter((points) => points?.length > 0);
  if (beside.length === 0) return 1;
  const away = kLimbs.map((i) => {
    const [x, y] = [0, 1].map((axis) => meanOf(beside.map((points) => points[i][axis])));
    return Math.hypot(frames[t][i][0] - x, frames[t][i][1] - y);
  });
  return Math.max(0, 1 - middleOf(away) / (kJump * whereabouts(frames[t]).height));
}

// How well the person is found in each frame, 0 to 1: the least of how visible the limbs are, of the share of the body's
// points that are seen, and of how steady the limbs are. 0 where nobody is.
export function scoresOf(frames) {
  return frames.map((points, t) => {
    if (points.length === 0) return { score: 0, isSeen: false, isSteady: true };
    const visible = meanOf(kLimbs.map((i) => points[i][2]));
    const share = meanOf(points.slice(0, kBody).map(([, , visibility]) => (visibility >= kSeen ? 1 : 0)));
    const steady = steadinessOf(frames, t);
    return { score: Math.min(visible, share, steady), isSeen: Math.min(visible, share) >= kDoubtful, isSteady: steady >= kDoubtful };
  });
}

// The value at 0 of the polynomial nearest to samples [x, value, weight]: least squares. undefined: too few have weight.
export function valueAtZero(samples, degree) {
  const size = degree + 1;
  const rows = Array.from({ length: size }, (_, i) => [
    ...Array.from({ length: size }, (_, j) => samples.reduce((sum, [x, , w]) => sum + w * x ** (i + j), 0)),
    samples.reduce((sum, [x, value, w]) => sum + w * value * x ** i, 0),
  ]);
  for (let k = 0; k < size; k += 1) { // Gaussian elimination
    let best = k;
    for (let i = k + 1; i < size; i += 1) if (Math.abs(rows[i][k]) > Math.abs(rows[best][k])) best = i;
    if (!(Math.abs(rows[best][k]) > 1e-9)) return undefined;
    [rows[k], rows[best]] = [rows[best], rows[k]];
    for (let i = k + 1; i < size; i += 1) {
      const factor = rows[i][k] / rows[k][k];
      for (let j = k; j <= size; j += 1) rows[i][j] -= factor * rows[k][j];
    }
  }
  for (let k = size - 1; k >= 0; k -= 1) {
    for (let j = k + 1; j < size; j += 1) rows[k][size] -= rows[k][j] * rows[j][size];
    rows[k][size] /= rows[k][k];
  }
  return rows[0][size];
}

// For each frame the frames about it, at most `width`, of the same person without a gap.
function windowsOf(frames, jumps, width) {
  const isBorder = (t) => t <= 0 || frames[t].length === 0 || frames[t - 1].length === 0 || jumps.includes(t);
  const reach = (width - 1) / 2;
  return frames.map((points, t) => {
    if (points.length === 0) return [];
    let first = t, last = t;
    while (t - first < reach && !isBorder(first)) first -= 1;
    while (last - t < reach && last + 1 < frames.length && !isBorder(last + 1)) last += 1;
    return Array.from({ length: last - first + 1 }, (_, i) => first + i);
  });
}

// Rows [frame][point][number] along time, each number the curve's that is nearest to those of `width` frames about it,
// weighed by how visible the point is (Savitzky and Golay's filter, with weights).
// @param columns  how many numbers. @param most  degree of the curve
function smoothedRows(rows, frames, windows, columns, most) {
  return rows.map((row, t) => row.map((numbers, i) => {
    if (frames[t][i][2] === 0) return numbers; // it is not found
    const seen = windows[t].filter((s) => frames[s][i][2] > 0);
    const degree = Math.min(most, seen.length - 1);
    return numbers.map((number, axis) =>
      (axis >= columns ? number : valueAtZero(seen.map((s) => [s - t, rows[s][i][axis], frames[s][i][2]]), degree) ?? number));
  }));
}

// Points [x, y, visibility] and places [x, y, z] smoothed over `width` frames, an odd number.
export function smoothed(points, places, width) {
  const windows = windowsOf(points, jumpsOf(points), width);
  const degree = width >= kWidthOfCurves ? 2 : 1;
  return { points: smoothedRows(points, points, windows, 2, degree), places: smoothedRows(places, points, windows, 3, degree) };
}
