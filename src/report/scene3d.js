// The 3D view: plain WebGL2, no library. Positions are relative to the plan's origin; a frame is drawn only when something changed.

const NO_CAMERA = "Choose a camera here or click one to see where it stands.";
const FIELD_OF_VIEW = (40 * Math.PI) / 180;
// Cameras up to which their numbers are shown at first.
const FEW = 120;

function drawScene(plan) {
  const root = document.getElementById("scene");
  const stage = root.querySelector(".stage"), canvas = root.querySelector("canvas"), form = root.querySelector("form");
  const [tip, outline, box, overlay] = [".tip", ".frame", ".legend", ".overlay"].map((name) => stage.querySelector(name));
  // The buffer is kept so that the picture is there when the page is printed.
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, preserveDrawingBuffer: true });
  const unavailable = (text) => {
    stage.textContent = "";
    html("p", "unavailable", text, stage);
    form.hidden = true;
  };
  if (!gl) return unavailable("The 3D view needs WebGL 2, which this browser does not offer. All else on this page works without it.");
  canvas.addEventListener("webglcontextlost", () => unavailable("The browser dropped the 3D view; reload the page to get it back."));

  const { origin, region, cameras, up, bulk, tour, words: [planned, kept] } = plan;
  const points = {
    count: plan.points.count,
    positions: unpack(plan.points.positions, Float32Array),
    colours: unpack(plan.points.colours, Uint8Array),
    gap: unpack(plan.points.gap, Float32Array),
    views: unpack(plan.points.views, Uint16Array),
    score: unpack(plan.points.score, Float32Array),
    error: unpack(plan.points.error, Float32Array),
  };
  const mesh = plan.triangles && {
    ...plan.triangles,
    positions: unpack(plan.triangles.positions, Uint16Array),
    colours: unpack(plan.triangles.colours, Uint8Array),
    nearest: unpack(plan.triangles.nearest, Uint16Array),
  };

  /* ---- sizes and the first view ---- */

  const room = region.kind === "box";
  const bulkSize = length(sub(bulk[1], bulk[0]));
  const radius = room ? 0.5 * Math.max(bulkSize, length(sub(region.max, region.min))) : region.r_max;
  const [east, north] = horizontal(up);
  const regionOutline = regionLines(region, up), floorGrid = floorLines(region, up);
  const corners = [...Array(8).keys()].map((i) => [0, 1, 2].map((k) => bulk[(i >> k) & 1][k]));
  const extremes = [...corners, ...regionOutline.flat(), ...cameras.map((c) => c.position)];
  /** A view from above and aside, as near as it can be with everything in the picture. */
  function home() {
    const [low, high] = [Math.min, Math.max].map((f) => [0, 1, 2].map((k) => extremes.reduce((v, p) => f(v, p[k]), extremes[0][k])));
    orbit = { target: scale(add(low, high), 0.5), distance: 1, yaw: room ? 1.0 : 0.6, pitch: room ? 0.8 : 0.3 };
    const { axes: [right, down, forward] } = currentView();
    const half = Math.tan(FIELD_OF_VIEW / 2), aspect = canvas.clientWidth / canvas.clientHeight || 1;
    // Perspective draws what is near larger, so the middle of the picture is found in a few iterations.
    for (let round = 0; round < 6; round++) {
      const seen = extremes.map((p) => sub(p, orbit.target)).map((at) => [dot(at, right), dot(at, down), dot(at, forward)]);
      orbit.distance = 1.06 * seen.reduce((d, [x, y, z]) => Math.max(d, Math.max(Math.abs(x) / aspect, Math.abs(y)) / half - z), 0.01 * radius);
      for (const [k, axis] of [right, down].entries()) {
        const places = seen.map((at) => at[k] / (orbit.distance + at[2]));
        const middle = 0.5 * (places.reduce((a, b) => Math.min(a, b)) + places.reduce((a, b) => Math.max(a, b)));
        orbit.target = add(orbit.target, scale(axis, middle * orbit.distance));
      }
    }
  }
  let orbit = null, chosen = null, hovered = null, through = null;
  // Heights the cut runs through.
  const heights = [...corners, ...(room ? regionOutline.flat() : [])].map((p) => dot(p, up));
  const lowest = Math.min(...heights), highest = Math.max(...heights) + 0.01 * radius;
  const margin = scale(sub(bulk[1], bulk[0]), 0.015);
  const cameraDepth = () => radius * Math.min(0.12, 0.62 / Math.sqrt(cameras.length + 1)) * 2 ** Number(form.size.value);

  /* ---- GPU state ---- */

  const trianglesProgram = program(gl, TRIANGLE_SHADERS), pointsProgram = program(gl, POINT_SHADERS), linesProgram = program(gl, LINE_SHADERS);
  const pointArray = vertexArray(gl, [{ data: points.positions, size: 3 }, { data: points.colours, size: 3 }]);
  const meshArray = mesh && vertexArray(gl, [{ data: mesh.positions, size: 3 }, { data: new Uint8Array(9 * mesh.count), size: 3 }]);
  const lineArray = vertexArray(gl, [
    { data: new Float32Array(0), size: 3, divisor: 1 }, { data: new Float32Array(0), size: 3, divisor: 1 }, { data: new Uint8Array(0), size: 4, divisor: 1 },
  ]);
  let lineCount = 0;

  if (points.error.length === 0) {
    form.colour.value = "gap";
    form.querySelector("[name=colour][value=error]").closest("label").hidden = true;
  }
  function recolour() {
    const choice = form.colour.value;
    const { colours, keys, ramp } = pointColours(points, choice);
    pointArray.update(1, colours);
    if (mesh) {
      const out = new Uint8Array(9 * mesh.count).fill(170);
      for (let i = 0; i < 3 * mesh.count; i++) {
        const [source, from] = choice === "own" ? [mesh.colours, 3 * Math.floor(i / 3)] : [colours, 3 * mesh.nearest[i]];
        if (from < source.length) out.set(source.subarray(from, from + 3), 3 * i);
      }
      meshArray.update(1, out);
    }
    drawLegend(keys, ramp);
    redraw();
  }

  function drawLegend(swatches, ramp) {
    box.textContent = "";
    if (ramp) {
      html("div", "", ramp.title, box);
      html("div", "ramp", "", box).style.background = `linear-gradient(90deg, ${VIRIDIS.map((c) => `rgb(${c})`).join()})`;
      const ends = html("div", "ends", "", box);
      html("span", "", ramp.low, ends);
      html("span", "", ramp.high, ends);
    }
    if (form.cameras.checked) {
      if (cameras.some((c) => !c.kept)) swatches.push([planned, styleColour("--camera")]);
      if (cameras.some((c) => c.kept)) swatches.push([kept, styleColour("--kept")]);
    }
    if (form.tour.checked && tour.length > 1) swatches.push(["tour", styleColour("--tour")]);
    const keys = html("div", "keys", "", box);
    for (const [text, colour] of swatches) {
      const key = html("span", "", "", keys);
      html("i", "", "", key).style.background = `rgb(${colour})`;
      key.append(text);
    }
    box.hidden = !ramp && swatches.length === 0;
  }

  function rebuildLines() {
    const lines = [], colours = [];
    const push = (segments, colour, alpha) => {
      for (const segment of segments) {
        lines.push(segment);
        colours.push(...colour, alpha);
      }
    };
    if (form.region.checked) {
      push(floorGrid, styleColour("--region"), 70);
      push(regionOutline, styleColour("--region"), 150);
    }
    if (form.tour.checked) push(tour.slice(1).map((to, i) => [tour[i], to]), styleColour("--tour"), 230);
    if (form.cameras.checked) {
      const [own, other, marked] = ["--camera", "--kept", "--chosen"].map(styleColour);
      cameras.forEach((camera, i) => {
        const marks = i === chosen || i === hovered;
        push(frustum(camera, cameraDepth() * (marks ? 1.35 : 1)), marks ? marked : camera.kept ? other : own, 255);
      });
    }
    lineCount = lines.length;
    lineArray.update(0, new Float32Array(lines.flatMap(([a]) => a)));
    lineArray.update(1, new Float32Array(lines.flatMap(([, b]) => b)));
    lineArray.update(2, new Uint8Array(colours));
    redraw();
  }

  /* ---- drawing ---- */

  /** Eye, axes and clip-from-world of what is on the screen. */
  function currentView() {
    const [width, height] = [canvas.clientWidth || 1, canvas.clientHeight || 1];
    if (through !== null) {
      const camera = cameras[through], near = 2e-3 * radius;
      const fit = Math.min((width - 48) / camera.size[0], (height - 48) / camera.size[1]);
      const part = [(fit * camera.size[0]) / width, (fit * camera.size[1]) / height];
      const f = [0, 1].map((k) => (part[k] * 2 * camera.focal[k]) / camera.size[k]);
      const c = [0, 1].map((k) => part[k] * ((2 * camera.principal[k]) / camera.size[k] - 1));
      const clip = multiply(projection(...f, ...c, near, 200 * radius), viewMatrix(camera.position, camera.axes));
      return { eye: camera.position, axes: camera.axes, clip, near, focal: f[1], part };
    }
    const { target, distance, yaw, pitch } = orbit;
    const flat = add(scale(east, Math.cos(yaw)), scale(north, Math.sin(yaw)));
    const back = add(scale(flat, Math.cos(pitch)), scale(up, Math.sin(pitch)));
    const eye = add(target, scale(back, distance));
    const forward = scale(back, -1), right = normalize(cross(forward, up)), down = cross(forward, right);
    const focal = 1 / Math.tan(FIELD_OF_VIEW / 2), near = 0.02 * distance;
    const clip = multiply(projection((focal * height) / width, focal, 0, 0, near, distance + 40 * radius), viewMatrix(eye, [right, down, forward]));
    return { eye, axes: [right, down, forward], clip, near, focal };
  }

  function draw() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [Math.max(1, Math.round(canvas.clientWidth * ratio)), Math.max(1, Math.round(canvas.clientHeight * ratio))];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const view = currentView();
    gl.viewport(0, 0, width, height);
    gl.clearColor(...scale(styleColour("--stage"), 1 / 255), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);

    const surface = mesh && form.surface.value === "triangles" ? trianglesProgram : pointsProgram;
    surface.use();
    surface.set("clipFromWorld", "Matrix4fv", false, view.clip);
    surface.set("eye", "3fv", view.eye);
    surface.set("up", "3fv", up);
    surface.set("low", "3fv", add(bulk[0], margin));
    surface.set("high", "3fv", sub(bulk[1], margin));
    const cut = Number(form.cut.value);
    surface.set("cut", "1f", through !== null || cut >= 1 ? 1e30 : lowest + cut * (highest - lowest));
    surface.set("open", "1f", form.open.checked && through === null ? 1 : 0);
    if (surface === trianglesProgram) {
      surface.set("origin", "3fv", mesh.low);
      surface.set("extent", "3fv", scale(mesh.step, 65535));
      meshArray.bind();
      gl.drawArrays(gl.TRIANGLES, 0, 3 * mesh.count);
    } else {
      // About as wide as the points' spacing.
      const diameter = (1.7 * bulkSize) / Math.sqrt(points.count + 1);
      surface.set("diameter", "1f", 0.5 * diameter * view.focal * height);
      pointArray.bind();
      gl.drawArrays(gl.POINTS, 0, points.count);
    }

    // Through a camera one sees what its photo would show: the surface alone.
    if (through === null) drawLines(view, width, height, ratio);
    drawOverlay(view, width, height, ratio);

    outline.hidden = !view.part;
    if (view.part) {
      const [w, h] = view.part.map((p) => 100 * p);
      outline.style.cssText = `left:${50 - w / 2}%;top:${50 - h / 2}%;width:${w}%;height:${h}%`;
    }
  }

  function drawLines(view, width, height, ratio) {
    linesProgram.use();
    linesProgram.set("clipFromWorld", "Matrix4fv", false, view.clip);
    linesProgram.set("pixels", "2f", width, height);
    linesProgram.set("width", "1f", 1.3 * ratio);
    linesProgram.set("near", "1f", view.near);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    lineArray.bind();
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, lineCount);
    gl.disable(gl.BLEND);
  }

  /** The cameras' numbers, and an arrow that shows where up is. */
  function drawOverlay(view, width, height, ratio) {
    [overlay.width, overlay.height] = [width, height];
    const pen = overlay.getContext("2d");
    pen.scale(ratio, ratio);
    if (through !== null) return;
    const css = (name) => `rgb(${styleColour(name)})`;
    if (form.cameras.checked && form.numbers.checked) {
      pen.font = "600 11px system-ui, sans-serif";
      pen.textAlign = "center";
      pen.lineWidth = 3;
      pen.strokeStyle = css("--stage");
      cameras.forEach((camera, i) => {
        const at = camera.kept ? null : onCanvas(view.clip, camera.position);
        if (!at) return;
        pen.fillStyle = css(i === chosen || i === hovered ? "--chosen" : "--ink");
        pen.strokeText(shortName(camera.name), at[0], at[1] - 6);
        pen.fillText(shortName(camera.name), at[0], at[1] - 6);
      });
    }
    drawUp(pen, css("--region"), [dot(up, view.axes[0]), dot(up, view.axes[1])], [width / ratio - 34, height / ratio - 30]);
  }

  let pending = false;
  function redraw() {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => { pending = false; draw(); });
  }

  /* ---- cameras under the pointer ---- */

  /** Where a point is on the canvas, in CSS pixels; none behind the eye. */
  function onCanvas(clip, p) {
    const [x, y, , w] = [0, 1, 2, 3].map((r) => clip[r] * p[0] + clip[4 + r] * p[1] + clip[8 + r] * p[2] + clip[12 + r]);
    return w > 0 ? [(0.5 + (0.5 * x) / w) * canvas.clientWidth, (0.5 - (0.5 * y) / w) * canvas.clientHeight] : null;
  }

  /** Index of the camera drawn nearest to a place on the canvas, within a finger's breadth. */
  function pick(x, y, within) {
    if (!form.cameras.checked || through !== null) return null;
    const { clip } = currentView();
    let best = null, nearest = within;
    cameras.forEach((camera, i) => {
      const p = add(camera.position, scale(camera.axes[2], 0.5 * cameraDepth()));
      const at = onCanvas(clip, p);
      if (!at) return;
      const away = Math.hypot(at[0] - x, at[1] - y);
      if (away < nearest) [best, nearest] = [i, away];
    });
    return best;
  }

  const place = (camera) => `(${add(camera.position, origin).map((v) => v.toFixed(3)).join(", ")})`;

  function hover(index, x, y) {
    tip.hidden = index === null;
    if (index !== null) {
      tip.textContent = "";
      html("b", "", cameras[index].name, tip);
      html("span", "", `${cameras[index].kept ? `${kept}, ` : ""}at ${place(cameras[index])}`, tip);
      tip.style.left = `${Math.min(x + 14, canvas.clientWidth - tip.offsetWidth - 8)}px`;
      tip.style.top = `${Math.min(y + 14, canvas.clientHeight - tip.offsetHeight - 8)}px`;
    }
    if (index === hovered) return;
    hovered = index;
    rebuildLines();
  }

  function choose(index) {
    chosen = index;
    if (through !== null) through = index;
    form.camera.value = index === null ? "" : index;
    form.look.disabled = index === null;
    form.look.textContent = through === null ? "Look through" : "Leave the camera";
    const camera = cameras[index];
    root.querySelector(".detail").textContent = camera
      ? `At ${place(camera)}, looking along (${camera.axes[2].map((v) => v.toFixed(2)).join(", ")}), ${camera.size.join(" × ")} pixels`
      : NO_CAMERA;
    rebuildLines();
  }

  function look(index) {
    through = index;
    choose(index ?? chosen);
  }

  /* ---- input ---- */

  const pointers = new Map();
  let travelled = 0;

  function turn(dx, dy) {
    orbit.yaw -= dx;
    orbit.pitch = Math.min(Math.max(orbit.pitch + dy, -1.55), 1.55);
  }
  function pan(dx, dy) {
    const [right, down] = currentView().axes;
    const step = (2 * orbit.distance * Math.tan(FIELD_OF_VIEW / 2)) / canvas.clientHeight;
    orbit.target = add(orbit.target, add(scale(right, -dx * step), scale(down, -dy * step)));
  }
  function zoom(factor) {
    orbit.distance = Math.min(Math.max(orbit.distance * factor, 0.01 * radius), 30 * radius);
  }
  /** Any movement leaves a camera that one looks through. */
  function move(action) {
    if (through !== null) look(null);
    action();
    redraw();
  }

  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (pointers.size === 1) travelled = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const at = [event.offsetX, event.offsetY], before = pointers.get(event.pointerId);
    if (!before) return hover(pick(...at, 14), ...at);
    const [dx, dy] = [at[0] - before[0], at[1] - before[1]];
    travelled += Math.abs(dx) + Math.abs(dy);
    if (travelled < 4) return;
    hover(null);
    if (pointers.size === 2) {
      // Two fingers: each moves the scene by half, and their distance zooms.
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      move(() => { pan(dx / 2, dy / 2); zoom(apart(before) / apart(at)); });
    } else if (event.shiftKey || event.buttons & 6) {
      move(() => pan(dx, dy));
    } else {
      move(() => turn(dx * 0.007, dy * 0.007));
    }
    pointers.set(event.pointerId, at);
  });
  canvas.addEventListener("pointerup", (event) => {
    pointers.delete(event.pointerId);
    if (travelled < 4 && event.button === 0) choose(pick(event.offsetX, event.offsetY, event.pointerType === "touch" ? 28 : 14));
  });
  canvas.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("pointerleave", () => hover(null));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    // A browser counts in pixels or in lines; a notch is about a hundred of the one or three of the other.
    const turned = event.deltaY * (event.deltaMode === 1 ? 33 : 1);
    move(() => zoom(Math.exp(Math.min(Math.max(turned, -120), 120) * 0.0012)));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const keys = {
      ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1), ArrowDown: () => turn(0, 0.1),
      "+": () => zoom(0.9), "=": () => zoom(0.9), "-": () => zoom(1 / 0.9), Escape: () => {},
    };
    if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    move(keys[event.key]);
  });

  cameras.forEach((camera, i) => form.camera.add(new Option(camera.kept ? `${camera.name} (${kept})` : camera.name, i)));
  form.camera.addEventListener("change", () => {
    if (form.camera.value === "") through = null;
    choose(form.camera.value === "" ? null : Number(form.camera.value));
  });
  form.look.addEventListener("click", () => look(through === null ? chosen : null));
  form.elements.namedItem("reset").addEventListener("click", () => move(home));
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", (event) => {
    if (["colour", "cameras", "tour"].includes(event.target.name)) recolour();
    if (["cameras", "region", "size", "tour"].includes(event.target.name)) rebuildLines();
    showCut();
    redraw();
  });
  function showCut() {
    const cut = Number(form.cut.value);
    form.cutText.value = cut >= 1 ? "off" : round(lowest + cut * (highest - lowest) + dot(origin, up));
  }

  form.open.checked = room;
  form.numbers.checked = cameras.length <= FEW;
  form.tour.closest("label").hidden = tour.length < 2;
  document.getElementById("surface-choice").hidden = !mesh;
  home();
  choose(null);
  showCut();
  recolour();
  const restyle = () => { recolour(); rebuildLines(); };
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", restyle);
  new ResizeObserver(redraw).observe(canvas);

  // The first frame at once, and how much of it is not background, for automated checks of the page.
  draw();
  const pixels = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  const back = styleColour("--stage");
  let drawn = 0;
  for (let i = 0; i < pixels.length; i += 4) if (back.some((v, k) => Math.abs(v - pixels[i + k]) > 2)) drawn++;
  canvas.dataset.drawn = drawn;
}
