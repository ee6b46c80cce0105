// What is drawn by WebGL2: shaders of triangles, points and lines, programs and buffers.

// What lies between the eye and the bulk of the surface is left out, so that a room shows its inside from any side,
// whichever way its triangles are wound; a cut along the up axis does the same under user control.
const VISIBLE = `
uniform vec3 eye, up, low, high;
uniform float cut, open;
bool hidden(vec3 p) {
  bvec3 before = bvec3(uvec3(lessThan(p, low)) & uvec3(lessThan(eye, low)));
  bvec3 behind = bvec3(uvec3(greaterThan(p, high)) & uvec3(greaterThan(eye, high)));
  return dot(p, up) > cut || (open > 0.5 && (any(before) || any(behind)));
}`;

const TRIANGLE_SHADERS = [`
uniform mat4 clipFromWorld;
uniform vec3 origin, extent;
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 colour;
out vec3 world, tint;
void main() {
  world = origin + extent * position;
  tint = colour;
  gl_Position = clipFromWorld * vec4(world, 1.0);
}`, `${VISIBLE}
in vec3 world, tint;
out vec4 pixel;
void main() {
  if (hidden(world)) discard;
  // The normal of the flat triangle, turned to the eye: a lamp on the viewer's head and some light from above.
  vec3 toEye = normalize(eye - world);
  vec3 normal = normalize(cross(dFdx(world), dFdy(world)));
  if (dot(normal, toEye) < 0.0) normal = -normal;
  pixel = vec4(tint * (0.6 + 0.32 * dot(normal, toEye) + 0.08 * dot(normal, up)), 1.0);
}`];

const POINT_SHADERS = [`
uniform mat4 clipFromWorld;
uniform float diameter, largest;${VISIBLE}
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 colour;
out vec3 tint;
void main() {
  tint = colour;
  gl_Position = hidden(position) ? vec4(2.0, 2.0, 2.0, 1.0) : clipFromWorld * vec4(position, 1.0);
  gl_PointSize = clamp(diameter / gl_Position.w, 2.0, largest);
}`, `
in vec3 tint;
out vec4 pixel;
void main() {
  vec2 p = 2.0 * gl_PointCoord - 1.0;
  if (dot(p, p) > 1.0) discard;
  pixel = vec4(tint * (1.0 - 0.15 * dot(p, p)), 1.0);
}`];

// A line is a thin rectangle that faces the screen, since WebGL draws lines of one pixel only.
const LINE_SHADERS = [`
uniform mat4 clipFromWorld;
uniform vec2 pixels;
uniform float width, near;
layout(location = 0) in vec3 from;
layout(location = 1) in vec3 to;
layout(location = 2) in vec4 colour;
out vec4 tint;
void main() {
  tint = colour;
  vec4 a = clipFromWorld * vec4(from, 1.0), b = clipFromWorld * vec4(to, 1.0);
  if (a.w < near && b.w < near) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
  if (a.w < near) a = mix(a, b, (near - a.w) / (b.w - a.w));
  if (b.w < near) b = mix(b, a, (near - b.w) / (a.w - b.w));
  vec2 along = (b.xy / b.w - a.xy / a.w) * pixels;
  along = length(along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
  vec4 at = gl_VertexID < 2 ? a : b;
  float side = (gl_VertexID & 1) == 0 ? 1.0 : -1.0;
  at.xy += side * width * vec2(-along.y, along.x) / pixels * at.w;
  gl_Position = at;
}`, `
in vec4 tint;
out vec4 pixel;
void main() { pixel = tint; }`];

function program(gl, [vertex, fragment]) {
  const linked = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, `#version 300 es\nprecision highp float;\n${source}`);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(`shader: ${gl.getShaderInfoLog(shader)}`);
    gl.attachShader(linked, shader);
  }
  gl.linkProgram(linked);
  if (!gl.getProgramParameter(linked, gl.LINK_STATUS)) throw new Error(`shader: ${gl.getProgramInfoLog(linked)}`);
  const places = {};
  const set = (name, kind, ...value) => gl[`uniform${kind}`]((places[name] ??= gl.getUniformLocation(linked, name)), ...value);
  return { use: () => gl.useProgram(linked), set };
}

/** A vertex array of buffers: each attribute has data, components, and how many instances share a value. */
function vertexArray(gl, attributes) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  const types = new Map([[Float32Array, gl.FLOAT], [Uint16Array, gl.UNSIGNED_SHORT], [Uint8Array, gl.UNSIGNED_BYTE]]);
  const buffers = attributes.map(({ data, size, divisor = 0 }, index) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, size, types.get(data.constructor), true, 0, 0);
    gl.vertexAttribDivisor(index, divisor);
    return buffer;
  });
  return {
    bind: () => gl.bindVertexArray(array),
    update: (index, data) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[index]);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    },
  };
}
