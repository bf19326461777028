// Drawing of the 3D view with WebGL 2: the Gaussians back to front over meshes and lines.
const splatVertexShader = parts => `#version 300 es
precision highp float;
uniform highp sampler2D splats;
uniform mat4 view, projection, world[${parts}];
uniform vec2 focal, size;
layout(location = 0) in vec2 corner;
layout(location = 1) in uint index;
out vec2 place;
out vec4 color;
vec4 numbers(int k) {
  int at = 3 * int(index) + k, width = textureSize(splats, 0).x;
  return texelFetch(splats, ivec2(at % width, at / width), 0);
}
void main() {
  vec4 a = numbers(0), b = numbers(1), c = numbers(2);
  mat4 placed = view * world[int(c.z)];
  vec3 mean = (placed * vec4(a.xyz, 1.0)).xyz;
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
  place = vec2(9.0);
  color = vec4(0.0);
  if (mean.z < 0.05) return;
  mat3 turn = mat3(placed);
  mat3 own = mat3(b.x, b.y, b.z, b.y, b.w, c.x, b.z, c.x, c.y);
  mat3 seen = turn * own * transpose(turn);
  vec2 limit = 0.65 * size / focal;
  vec2 slope = clamp(mean.xy / mean.z, -limit, limit);
  mat3 j = mat3(focal.x / mean.z, 0.0, 0.0, 0.0, focal.y / mean.z, 0.0,
                -focal.x * slope.x / mean.z, -focal.y * slope.y / mean.z, 0.0);
  mat3 image = j * seen * transpose(j);
  float xx = image[0][0] + 0.3, yy = image[1][1] + 0.3, xy = image[0][1];
  float middle = 0.5 * (xx + yy), apart = length(vec2(0.5 * (xx - yy), xy));
  float large = middle + apart, small = max(middle - apart, 0.1);
  vec2 axis = apart < 1e-6 ? vec2(1.0, 0.0) : normalize(abs(xy) > 1e-6 ? vec2(xy, large - xx)
                                                         : (xx >= yy ? vec2(1.0, 0.0) : vec2(0.0, 1.0)));
  vec2 pixels = min(sqrt(2.0 * large), 1024.0) * corner.x * axis +
                min(sqrt(2.0 * small), 1024.0) * corner.y * vec2(-axis.y, axis.x);
  vec4 center = projection * vec4(mean, 1.0);
  gl_Position = center + vec4(2.0 * pixels / size * vec2(1.0, -1.0) * center.w, 0.0, 0.0);
  place = corner;
  int packed = int(a.w);
  color = vec4(vec3(packed >> 16, (packed >> 8) & 255, packed & 255) / 255.0, c.w);
}`;
const splatFragmentShader = `#version 300 es
precision highp float;
in vec2 place;
in vec4 color;
out vec4 result;
void main() {
  float alpha = color.a * exp(-dot(place, place));
  if (alpha < 1.0 / 255.0) discard;
  result = vec4(color.rgb * alpha, alpha);
}`;
const meshVertexShader = joints => `#version 300 es
precision highp float;
uniform mat4 view, projection;
uniform vec4 rows[${3 * joints}];
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in uvec4 joints;
layout(location = 3) in vec4 weights;
out vec3 place, facing;
void main() {
  vec4 r0 = vec4(0.0), r1 = vec4(0.0), r2 = vec4(0.0);
  for (int k = 0; k < 4; ++k) {
    int j = 3 * int(joints[k]);
    r0 += weights[k] * rows[j]; r1 += weights[k] * rows[j + 1]; r2 += weights[k] * rows[j + 2];
  }
  vec4 rest = vec4(position, 1.0);
  vec4 seen = view * vec4(dot(r0, rest), dot(r1, rest), dot(r2, rest), 1.0);
  place = seen.xyz;
  facing = mat3(view) * vec3(dot(r0.xyz, normal), dot(r1.xyz, normal), dot(r2.xyz, normal));
  gl_Position = projection * seen;
}`;
const meshFragmentShader = `#version 300 es
precision highp float;
uniform vec4 color;
in vec3 place, facing;
out vec4 result;
void main() {
  vec3 n = normalize(facing), eye = -normalize(place);
  float head = max(dot(n, eye), 0.0), above = 0.5 - 0.5 * n.y;
  vec3 lit = color.rgb * (0.25 + 0.5 * head + 0.35 * above) + 0.12 * pow(head, 24.0);
  result = vec4(lit, 1.0) * color.a;
}`;
const lineVertexShader = `#version 300 es
precision highp float;
uniform mat4 view, projection;
layout(location = 0) in vec3 position;
void main() { gl_Position = projection * view * vec4(position, 1.0); }`;
const lineFragmentShader = `#version 300 es
precision highp float;
uniform vec4 color;
out vec4 result;
void main() { result = vec4(color.rgb, 1.0) * color.a; }`;

const makeProgram = (gl, vertex, fragment) => {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return { program, at: name => gl.getUniformLocation(program, name) };
};

const makeBuffer = (gl, target, numbers, usage) => {
  const buffer = gl.createBuffer();
  gl.bindBuffer(target, buffer);
  gl.bufferData(target, numbers, usage);
  return buffer;
};

// The Gaussians: their numbers in a texture, drawn as quads in the order of `sorted`.
const makeSplats = (gl, data) => {
  const { numbers, parts } = splatNumbers(data), count = parts.length, width = 3 * 512;
  const shader = makeProgram(gl, splatVertexShader(data["splats/counts"].length), splatFragmentShader);
  const rows = Math.max(1, Math.ceil(3 * count / width)), texels = new Float32Array(4 * width * rows);
  texels.set(numbers);
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, rows, 0, gl.RGBA, gl.FLOAT, texels);
  for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
  const vertices = gl.createVertexArray();
  gl.bindVertexArray(vertices);
  makeBuffer(gl, gl.ARRAY_BUFFER, new Float32Array([-2, -2, 2, -2, -2, 2, 2, 2]), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  const sorted = new Uint32Array(count), order = makeBuffer(gl, gl.ARRAY_BUFFER, sorted, gl.DYNAMIC_DRAW);
  gl.enableVertexAttribArray(1);
  gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, 0, 0);
  gl.vertexAttribDivisor(1, 1);
  gl.bindVertexArray(null);

  // Far ones first, by counting depths of 16 bits; returns how many are drawn. Of the scene none nearer than `cut`.
  const depths = new Float32Array(count), keys = new Uint16Array(count), starts = new Uint32Array(65537);
  const sort = (view, worlds, isShown, cut) => {
    // Depth is a linear function of a part's own coordinates.
    const axis = view.rotation.slice(6, 9);
    const rows3 = worlds.map(({ rotation: r, translation: t }) => [...turned(transposed(r), axis),
      dot(axis, t) + view.translation[2]]);
    let near = Infinity, far = -Infinity, drawn = 0;
    for (let i = 0; i < count; ++i) {
      const row = rows3[parts[i]], at = 12 * i;
      const depth = row[0] * numbers[at] + row[1] * numbers[at + 1] + row[2] * numbers[at + 2] + row[3];
      depths[i] = isShown[parts[i]] && depth > (parts[i] === 0 ? cut : 0.05) ? depth : -1;
      if (depths[i] < 0) continue;
      near = Math.min(near, depth);
      far = Math.max(far, depth);
      ++drawn;
    }
    const scale = 65535 / Math.max(far - near, 1e-6);
    starts.fill(0);
    for (let i = 0; i < count; ++i) {
      if (depths[i] < 0) continue;
      keys[i] = 65535 - (depths[i] - near) * scale;
      ++starts[keys[i] + 1];
    }
    for (let k = 0; k < 65536; ++k) starts[k + 1] += starts[k];
    for (let i = 0; i < count; ++i) if (depths[i] >= 0) sorted[starts[keys[i]]++] = i;
    return drawn;
  };

  return (camera, worlds, isShown, cut) => {
    const drawn = sort(camera.view, worlds, isShown, cut);
    gl.useProgram(shader.program);
    gl.bindVertexArray(vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, order);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, sorted, 0, drawn);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    const matrices = new Float32Array(16 * worlds.length);
    worlds.forEach((world, part) => matrices.set(matrixOf(world), 16 * part));
    gl.uniformMatrix4fv(shader.at("world"), false, matrices);
    gl.uniformMatrix4fv(shader.at("view"), false, matrixOf(camera.view));
    gl.uniformMatrix4fv(shader.at("projection"), false, camera.projection);
    gl.uniform2f(shader.at("focal"), camera.fx, camera.fy);
    gl.uniform2f(shader.at("size"), camera.width, camera.height);
    gl.depthMask(false);
    if (drawn > 0) gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, drawn);
    gl.depthMask(true);
  };
};

// The body's mesh, skinned by the rows of its joints' transforms. Null where there is none, or too many joints.
const makeMesh = (gl, data) => {
  const joints = data["skeleton/parents"].length;
  if (!data["mesh/faces"] || 3 * joints + 16 > gl.getParameter(gl.MAX_VERTEX_UNIFORM_VECTORS)) return null;
  const mesh = restMesh(data), shader = makeProgram(gl, meshVertexShader(joints), meshFragmentShader);
  const vertices = gl.createVertexArray();
  gl.bindVertexArray(vertices);
  makeBuffer(gl, gl.ELEMENT_ARRAY_BUFFER, mesh.faces, gl.STATIC_DRAW);
  [mesh.positions, mesh.normals, mesh.joints, mesh.weights].forEach((numbers, place) => {
    makeBuffer(gl, gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    if (place < 2) gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    if (place === 2) gl.vertexAttribIPointer(place, 4, gl.UNSIGNED_BYTE, 0, 0);
    if (place === 3) gl.vertexAttribPointer(place, 4, gl.UNSIGNED_BYTE, true, 0, 0);
  });
  gl.bindVertexArray(null);
  const type = mesh.faces instanceof Uint32Array ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT;
  return (camera, transforms, color) => {
    gl.useProgram(shader.program);
    gl.bindVertexArray(vertices);
    gl.uniform4fv(shader.at("rows"), transforms);
    gl.uniformMatrix4fv(shader.at("view"), false, matrixOf(camera.view));
    gl.uniformMatrix4fv(shader.at("projection"), false, camera.projection);
    gl.uniform4fv(shader.at("color"), color);
    gl.enable(gl.CULL_FACE);
    gl.drawElements(gl.TRIANGLES, mesh.faces.length, type, 0);
    gl.disable(gl.CULL_FACE);
  };
};

// Lines between pairs of points.
const makeLines = gl => {
  const shader = makeProgram(gl, lineVertexShader, lineFragmentShader);
  const vertices = gl.createVertexArray();
  gl.bindVertexArray(vertices);
  const buffer = makeBuffer(gl, gl.ARRAY_BUFFER, new Float32Array(3), gl.DYNAMIC_DRAW);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
  gl.bindVertexArray(null);
  return (camera, points, color) => {
    if (points.length < 2) return;
    gl.useProgram(shader.program);
    gl.bindVertexArray(vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, Float32Array.from(points.flat()), gl.DYNAMIC_DRAW);
    gl.uniformMatrix4fv(shader.at("view"), false, matrixOf(camera.view));
    gl.uniformMatrix4fv(shader.at("projection"), false, camera.projection);
    gl.uniform4fv(shader.at("color"), color);
    gl.drawArrays(gl.LINES, 0, points.length);
  };
};
