// Trained splats in 3D: every Gaussian is projected to an ellipse (EWA splatting), drawn from the farthest to the nearest.

// Splats in a row of the texture, three texels each: place and opacity; covariance xx xy xz yy; covariance yz zz and the colour.
const IN_A_ROW = 1024;

const SPLAT_SHADERS = [`
uniform highp sampler2D splats;
uniform mat4 cameraFromWorld;
uniform vec2 pixels, focal, offset;
uniform float near, size, antialiased;
layout(location = 0) in float number;
out vec2 at;
out vec4 tint;
void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  ivec2 place = ivec2(3 * (int(number) % ${IN_A_ROW}), int(number) / ${IN_A_ROW});
  vec4 a = texelFetch(splats, place, 0), b = texelFetch(splats, place + ivec2(1, 0), 0), c = texelFetch(splats, place + ivec2(2, 0), 0);
  vec3 p = (cameraFromWorld * vec4(a.xyz, 1.0)).xyz;
  if (p.z < near) return;
  // The Jacobian follows the ray a little beyond the picture's edges only: farther out it would stretch splats without end.
  vec2 widest = 0.65 * pixels / focal + abs(offset) * 0.5 * pixels / focal;
  vec2 ray = clamp(p.xy / p.z, -widest, widest);
  mat3 world = size * size * mat3(b.x, b.y, b.z, b.y, b.w, c.x, b.z, c.x, c.y);
  vec3 u = vec3(focal.x, 0.0, -focal.x * ray.x) / p.z * mat3(cameraFromWorld);
  vec3 v = vec3(0.0, focal.y, -focal.y * ray.y) / p.z * mat3(cameraFromWorld);
  float xx = dot(u, world * u), xy = dot(u, world * v), yy = dot(v, world * v);
  float plain = max(xx * yy - xy * xy, 0.0);
  // The low-pass filter of training, in square pixels.
  float blur = mix(0.3, 0.1, antialiased);
  xx += blur;
  yy += blur;
  float opacity = a.w * mix(1.0, sqrt(plain / (xx * yy - xy * xy)), antialiased);
  if (opacity < 1.0 / 255.0) return;
  float middle = 0.5 * (xx + yy), apart = length(vec2(0.5 * (xx - yy), xy)), angle = 0.5 * atan(2.0 * xy, xx - yy);
  vec2 along = vec2(cos(angle), sin(angle));
  at = (2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0) * sqrt(2.0 * log(255.0 * opacity));
  vec2 away = at.x * sqrt(middle + apart) * along + at.y * sqrt(max(middle - apart, 0.1)) * vec2(-along.y, along.x);
  int colour = int(c.z);
  tint = vec4(vec3(colour & 255, (colour >> 8) & 255, colour >> 16) / 255.0, opacity);
  gl_Position = vec4(vec2(1.0, -1.0) * ((focal * p.xy / p.z + away) / (0.5 * pixels) + offset), 0.0, 1.0);
}`, `
in vec2 at;
in vec4 tint;
out vec4 pixel;
void main() {
  float alpha = min(tint.a * exp(-0.5 * dot(at, at)), 0.99);
  if (alpha < 1.0 / 255.0) discard;
  pixel = vec4(alpha * tint.rgb, alpha);
}`];

/** A whole number with thin spaces between thousands. */
const grouped = (count) => String(count).replace(/\B(?=(\d{3})+$)/g, "\u202f");

/** The packed splats: their places, and the texels that the shader reads. */
function unpackSplats({ count, reach, range, low, step, places, scales, rotations, colours }) {
  const [place, scaled, turned, colour] = [
    unpack(places, Uint16Array), unpack(scales, Uint8Array), unpack(rotations, Int8Array), unpack(colours, Uint8Array),
  ];
  const positions = new Float32Array(3 * count), rows = Math.max(1, Math.ceil(count / IN_A_ROW));
  const texels = new Float32Array(12 * IN_A_ROW * rows);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) {
      const t = (2 * place[3 * i + k]) / 65535 - 1;
      positions[3 * i + k] = Math.sign(t) * reach * Math.expm1(Math.abs(t) * range);
    }
    const [w, x, y, z] = [0, 1, 2, 3].map((k) => turned[4 * i + k] / (Math.hypot(...turned.subarray(4 * i, 4 * i + 4)) || 1));
    const axes = [
      [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
      [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
      [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    ].map((axis, k) => scale(axis, Math.exp(low + step * scaled[3 * i + k])));
    const variance = (a, b) => axes[0][a] * axes[0][b] + axes[1][a] * axes[1][b] + axes[2][a] * axes[2][b];
    const [r, g, b, opacity] = colour.subarray(4 * i, 4 * i + 4);
    texels.set([
      ...positions.subarray(3 * i, 3 * i + 3), opacity / 255,
      variance(0, 0), variance(0, 1), variance(0, 2), variance(1, 1),
      variance(1, 2), variance(2, 2), r + 256 * g + 65536 * b, 0,
    ], 12 * i);
  }
  return { positions, texels, rows };
}

/** Sorts places by depth along a direction, the farthest first, by counting. */
function depthOrder(positions, extent) {
  const count = positions.length / 3, buckets = 1 << 16;
  const depths = new Float32Array(count), starts = new Uint32Array(buckets + 1), order = new Float32Array(count);
  return ([x, y, z]) => {
    let low = Infinity, high = -Infinity;
    for (let i = 0; i < count; i++) {
      const depth = x * positions[3 * i] + y * positions[3 * i + 1] + z * positions[3 * i + 2];
      depths[i] = depth;
      if (depth < low) low = depth;
      if (depth > high) high = depth;
    }
    // Evenly near the middle and ever wider far out, as positions are: one splat far off must not lump the others together.
    const spread = (depth) => Math.asinh(depth / extent);
    low = spread(low);
    high = spread(high);
    const factor = high > low ? (buckets - 1) / (high - low) : 0;
    const bucket = (i) => Math.floor((high - spread(depths[i])) * factor);
    starts.fill(0);
    for (let i = 0; i < count; i++) starts[bucket(i) + 1]++;
    for (let b = 0; b < buckets; b++) starts[b + 1] += starts[b];
    for (let i = 0; i < count; i++) order[starts[bucket(i)]++] = i;
    return order;
  };
}

function drawSplats({ model }) {
  if (!model) return;
  const { splats, views, up, extent, background, antialiased } = model;
  const root = document.querySelector(".scene");
  const stage = root.querySelector(".stage"), canvas = root.querySelector("canvas"), form = root.querySelector("form");
  const outline = stage.querySelector(".frame"), gl = openWebGl(stage, canvas, form, false);
  if (!gl) return;

  const { positions, texels, rows } = unpackSplats(splats);
  const shaders = program(gl, SPLAT_SHADERS), sorted = depthOrder(positions, extent);
  const numbers = vertexArray(gl, [{ data: new Float32Array(splats.count), size: 1, divisor: 1 }]);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 3 * IN_A_ROW, rows, 0, gl.RGBA, gl.FLOAT, texels);
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);

  const orbit = orbitAround(canvas, up, extent);
  const near = 0.01 * extent, first = Math.max(views.findIndex((view) => view.trained), 0);
  // Previous and next go through the test views, or through the training cameras where there are none.
  const tests = views.flatMap((view, i) => (view.trained ? [] : [i])), steps = tests.length > 0 ? tests : views.map((_, i) => i);
  let through = null, facing = null;
  const currentView = () => (through === null ? orbit.view() : cameraView(canvas, views[through], near, 100 * extent));

  function draw() {
    const [width, height] = fitCanvas(canvas), view = currentView();
    const forward = view.axes[2];
    if (!facing || dot(facing, forward) < 0.9999) {
      numbers.update(0, sorted(forward));
      facing = forward;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(...background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    shaders.use();
    shaders.set("cameraFromWorld", "Matrix4fv", false, viewMatrix(view.eye, view.axes));
    shaders.set("pixels", "2f", width, height);
    shaders.set("focal", "2f", 0.5 * width * view.focal[0], 0.5 * height * view.focal[1]);
    shaders.set("offset", "2fv", view.offset ?? [0, 0]);
    shaders.set("near", "1f", near);
    shaders.set("size", "1f", Number(form.size.value));
    shaders.set("antialiased", "1f", antialiased ? 1 : 0);
    numbers.bind();
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, splats.count);
    drawFrame(outline, view, through === null ? null : photos.get(views[through].name), form.photo);
  }
  const redraw = beforeNextFrame(draw);

  /* ---- cameras ---- */

  // Test views that the page shows: the photo is the second of their pictures.
  const shown = new Map([...document.querySelectorAll("[data-view]")].map((article) => [article.dataset.view, article]));
  const photos = new Map([...shown].map(([name, article]) => [name, article.querySelectorAll("img")[1].src]));
  const kind = (view) => (view.trained ? "training" : view.psnr === null ? "test" : `test, ${view.psnr.toFixed(2)} dB`);

  function look(index) {
    through = index;
    form.camera.value = index === null ? "" : index;
    const view = views[index];
    root.querySelector(".detail").textContent = !view
      ? "Choose a camera to compare its photo with."
      : `${view.trained ? "Training camera" : "Test view"}, ${view.size.join(" × ")} pixels${
        photos.has(view.name) ? "; the slider below lays its photo over it" : ""}`;
    redraw();
  }
  function step(by) {
    const at = steps.indexOf(through);
    look(steps[at < 0 ? (by > 0 ? 0 : steps.length - 1) : (at + by + steps.length) % steps.length]);
  }
  /** Any movement leaves the camera, from where it is. */
  function move(action) {
    if (through !== null) {
      const view = currentView();
      orbit.follow(view, Math.max(-dot(view.eye, view.axes[2]), 0.3 * extent));
      look(null);
    }
    action();
    redraw();
  }

  listen(canvas, orbit, { move, hover: () => {}, pick: () => {} });
  form.camera.add(new Option("none", ""));
  // A model by itself has no cameras to look through.
  for (const part of [form.camera, root.querySelector(".detail"), root.querySelector(".steps")]) part.hidden = views.length === 0;
  views.forEach((view, i) => form.camera.add(new Option(`${view.name} (${kind(view)})`, i)));
  form.camera.addEventListener("change", () => (form.camera.value === "" ? move(() => {}) : look(Number(form.camera.value))));
  form.previous.addEventListener("click", () => step(-1));
  form.next.addEventListener("click", () => step(1));
  form.elements.namedItem("reset").addEventListener("click", () => look(first));
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", () => { showSize(); redraw(); });
  const showSize = () => { form.sizeText.value = `${Math.round(100 * form.size.value)} %`; };
  views.forEach((view, i) => {
    if (view.trained || !shown.has(view.name)) return;
    const button = html("button", "", "show in 3D", shown.get(view.name).querySelector("h3"));
    button.type = "button";
    button.addEventListener("click", () => {
      look(i);
      root.scrollIntoView({ block: "nearest" });
    });
  });
  root.querySelector(".shown").textContent = splats.count < splats.of
    ? `${grouped(splats.count)} of ${grouped(splats.of)} splats are shown: those of most opacity and size.`
    : `All ${grouped(splats.of)} splats are shown.`;

  showSize();
  orbit.fit([[-extent, -extent, -extent], [extent, extent, extent]], { yaw: 0.6, pitch: 0.3 });
  look(views.length > 0 ? first : null);
  new ResizeObserver(redraw).observe(canvas);
  draw();
  canvas.dataset.drawn = countDrawn(gl, scale(background, 255));
}
