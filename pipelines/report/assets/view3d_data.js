// What the 3D view shows, out of the page: base64, gzip, safetensors (see pipelines/report/view3d.h for the arrays).
const arrayTypes = { F32: Float32Array, I32: Int32Array, U32: Uint32Array, I16: Int16Array, U16: Uint16Array,
  I8: Int8Array, U8: Uint8Array };

const readView3d = async text => {
  const packed = Uint8Array.from(atob(text.trim()), letter => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  const length = Number(new DataView(buffer).getBigUint64(0, true));
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
  const data = { texts: header.__metadata__, shapes: {} };
  for (const [name, entry] of Object.entries(header)) {
    if (name === "__metadata__") continue;
    const { dtype, shape, data_offsets: [begin, end] } = entry, Type = arrayTypes[dtype];
    data[name] = new Type(buffer, 8 + length + begin, (end - begin) / Type.BYTES_PER_ELEMENT);
    data.shapes[name] = shape;
  }
  return data;
};

// ---- Rotations and rigid transforms: row-major 3x4, [R | t] ----

const rotationOf = (w, x, y, z) => {
  const n = 1 / Math.hypot(w, x, y, z);
  w *= n; x *= n; y *= n; z *= n;
  return [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
};
const turned = (r, v) => [r[0] * v[0] + r[1] * v[1] + r[2] * v[2], r[3] * v[0] + r[4] * v[1] + r[5] * v[2],
  r[6] * v[0] + r[7] * v[1] + r[8] * v[2]];
const transposed = r => [r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]];
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => times(a, 1 / (Math.hypot(...a) || 1));

// Row i of [.., 7] numbers, a quaternion wxyz and a translation.
const poseOf = (poses, i) => {
  const p = poses.subarray(7 * i, 7 * i + 7);
  return { rotation: rotationOf(p[0], p[1], p[2], p[3]), translation: [p[4], p[5], p[6]] };
};
const centerOf = camera => times(turned(transposed(camera.rotation), camera.translation), -1);

// Column-major 4x4 of WebGL.
const matrixOf = ({ rotation: r, translation: t }) =>
  new Float32Array([r[0], r[3], r[6], 0, r[1], r[4], r[7], 0, r[2], r[5], r[8], 0, t[0], t[1], t[2], 1]);
const identity = { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [0, 0, 0] };

// The skeleton of `name` (body, truth, others/1) in frame t: rows [3,4] of posed_from_rest by joint, and the joints'
// places.
const poseSkeleton = (data, name, t) => {
  const rest = data[name + "/joints"] ?? data["skeleton/joints"];
  const parents = data["skeleton/parents"], joints = parents.length;
  const quaternions = data[name + "/rotations"], move = [...data[name + "/translations"].subarray(3 * t, 3 * t + 3)];
  const rotations = [], places = [], transforms = new Float32Array(12 * joints);
  for (let j = 0; j < joints; ++j) {
    const at = 4 * (joints * t + j), r = rest.subarray(3 * j, 3 * j + 3), q = parents[j];
    rotations.push(rotationOf(...quaternions.subarray(at, at + 4)));
    places.push(q < 0 ? [...r] : plus(places[q], turned(rotations[q], minus(r, rest.subarray(3 * q, 3 * q + 3)))));
    const shift = plus(minus(places[j], turned(rotations[j], r)), move);
    for (let row = 0; row < 3; ++row) {
      transforms.set(rotations[j].slice(3 * row, 3 * row + 3), 12 * j + 4 * row);
      transforms[12 * j + 4 * row + 3] = shift[row];
    }
  }
  return { transforms, places: places.map(place => plus(place, move)) };
};

// The numbers of the Gaussians as the shader reads them, twelve each: mean, colour of 24 bits; covariance (xx xy xz
// yy yz zz); part, opacity. Means and covariances are those of the part's own frame.
const splatNumbers = data => {
  const counts = data["splats/counts"], boxes = data["splats/boxes"], positions = data["splats/positions"];
  const scales = data["splats/log_scales"], [low, high] = data["splats/log_scale_range"];
  const rotations = data["splats/rotations"], colors = data["splats/colors"];
  const numbers = new Float32Array(3 * colors.length), parts = new Uint8Array(colors.length / 4);
  let i = 0;
  counts.forEach((count, part) => {
    const box = boxes.subarray(6 * part, 6 * part + 6);
    for (const end = i + count; i < end; ++i) {
      const out = 12 * i, r = rotationOf(...rotations.subarray(4 * i, 4 * i + 4));
      const variance = [0, 1, 2].map(a => Math.exp(2 * (low + scales[3 * i + a] / 255 * (high - low))));
      const covariance = (a, b) => [0, 1, 2].reduce((sum, k) => sum + r[3 * a + k] * variance[k] * r[3 * b + k], 0);
      for (let a = 0; a < 3; ++a) numbers[out + a] = box[a] + positions[3 * i + a] / 65535 * (box[3 + a] - box[a]);
      numbers[out + 3] = colors[4 * i] * 65536 + colors[4 * i + 1] * 256 + colors[4 * i + 2];
      numbers.set([covariance(0, 0), covariance(0, 1), covariance(0, 2), covariance(1, 1), covariance(1, 2),
        covariance(2, 2), part, colors[4 * i + 3] / 255], out + 4);
      parts[i] = part;
    }
  });
  return { numbers, parts };
};

// The mesh at rest: positions, and normals of the faces around each vertex.
const restMesh = data => {
  const box = data["mesh/box"], packed = data["mesh/positions"], faces = data["mesh/faces"];
  const positions = Float32Array.from(packed, (u, i) => box[i % 3] + u / 65535 * (box[3 + i % 3] - box[i % 3]));
  const normals = new Float32Array(positions.length);
  for (let f = 0; f < faces.length; f += 3) {
    const corners = [0, 1, 2].map(k => positions.subarray(3 * faces[f + k], 3 * faces[f + k] + 3));
    const normal = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]));
    for (let k = 0; k < 3; ++k)
      for (let a = 0; a < 3; ++a) normals[3 * faces[f + k] + a] += normal[a];
  }
  return { positions, normals, faces, joints: data["mesh/joints"], weights: data["mesh/weights"] };
};
