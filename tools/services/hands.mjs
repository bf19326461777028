// Hands of a person whose points are found: MediaPipe Hands on a square of the picture about each. What tools/frontend
// --hands adds to tools/services/blazepose.mjs.

const kPoints = 21; // of a hand: wrist, then four of thumb, index, middle, ring and pinky finger, from the palm outwards
const kSides = [{ wrist: 15, fingers: [17, 19, 21] }, { wrist: 16, fingers: [18, 20, 22] }]; // left, right: in BlazePose's points
const kSquare = 0.45; // side of the square, metres at the person's distance: a hand of 0.19 m, and what its place may be off
const kReaches = 4; // and at least so many times the way from the wrist to the farthest of the hand's points
const kLooked = 512; // side of the square as it is looked at, pixels: the hand is then about as large as the network takes it
const kFar = 0.25; // of the square's side: a hand whose wrist is farther from BlazePose's is another one

export const meanOf = (numbers) => numbers.reduce((sum, number) => sum + number, 0) / numbers.length;

// Pixels to a metre of the person: points spread in the picture as places across the view do.
function pixelsPerMetre(points, places) {
  const spread = (rows) => {
    const x = meanOf(rows.map((row) => row[0])), y = meanOf(rows.map((row) => row[1]));
    return Math.sqrt(meanOf(rows.map((row) => (row[0] - x) ** 2 + (row[1] - y) ** 2)));
  };
  return spread(points) / spread(places);
}

// The square about a hand: its middle and side, pixels.
export function squareOf({ wrist, fingers }, points, places) {
  const [x, y] = points[wrist];
  const reach = Math.max(...fingers.map((i) => Math.hypot(points[i][0] - x, points[i][1] - y)));
  const middle = (axis) => meanOf(fingers.map((i) => points[i][axis])); // of the fingers' roots: the middle of the hand
  const side = Math.max(kSquare * pixelsPerMetre(points, places), kReaches * reach);
  return { x: middle(0), y: middle(1), side };
}

// In the page.
async function begin() {
  const hands = new Hands({ locateFile: (file) => `/hands/${file}` });
  // Two: the other hand may be in the square. By the processor: Chromium's WebGL, which it does too, is slower.
  hands.setOptions({ maxNumHands: 2, modelComplexity: 1, useCpuInference: true });
  hands.onResults((results) => { window.found = results; });
  await hands.initialize();
  window.hands = hands;
}

// In the page: the hands in squares of a picture, points as shares of the square.
async function look([name, squares, size]) {
  const picture = new Image();
  picture.src = `/frames/${encodeURIComponent(name)}`;
  await picture.decode();
  const canvas = document.createElement('canvas'), context = canvas.getContext('2d');
  canvas.width = canvas.height = size;
  context.imageSmoothingQuality = 'high';
  const handsIn = async () => {
    window.found = undefined;
    await window.hands.send({ image: canvas });
    if (window.found === undefined) throw new Error(`no answer for a hand in ${name}`);
    const { multiHandLandmarks: points, multiHandWorldLandmarks: places, multiHandedness: sides } = window.found;
    return (points ?? []).map((hand, i) => ({ points: hand, places: places[i], score: sides[i].score }));
  };
  const all = [];
  for (const { x, y, side } of squares) {
    context.clearRect(0, 0, size, size);
    await handsIn(); // what was found in another square is forgotten: hands are followed, and here is none
    const scale = size / side;
    context.drawImage(picture, (side / 2 - x) * scale, (side / 2 - y) * scale, picture.width * scale, picture.height * scale);
    all.push(await handsIn());
  }
  return all;
}

// A hand's points and places from what is found in its square: that nearest to BlazePose's wrist, none far from it.
export function handIn(square, found, [x, y, visibility], wristPlace) {
  const pixel = (point) => [square.x + (point.x - 0.5) * square.side, square.y + (point.y - 0.5) * square.side];
  const away = (hand) => Math.hypot(pixel(hand.points[0])[0] - x, pixel(hand.points[0])[1] - y);
  const [hand] = found.filter((one) => away(one) <= kFar * square.side).sort((a, b) => away(a) - away(b));
  if (hand === undefined) return { points: Array(kPoints).fill([x, y, 0]), places: Array(kPoints).fill(wristPlace) };
  const confidence = Math.min(hand.score, 1) * visibility; // the score is how sure it is of left or right: it has no other
  return {
    points: hand.points.map((point) => [...pixel(point), confidence]),
    places: hand.places.map((place) => ['x', 'y', 'z'].map((axis, i) => wristPlace[i] + place[axis] - hand.places[0][axis])),
  };
}

// Finds hands, in a page of its own.
export class HandFinder {
  constructor(page) { this.page = page; }
  begin() { return this.page.evaluate(begin); }
  // Points [x, y, confidence] and places [x, y, z] of the left hand, then of the right one.
  async find(name, points, places) {
    const squares = kSides.map((side) => squareOf(side, points, places));
    const found = await this.page.evaluate(look, [name, squares, kLooked]);
    return kSides.map(({ wrist }, i) => handIn(squares[i], found[i], points[wrist], places[wrist]));
  }
}
