// The 3D view: plain WebGL2, no library. Positions are relative to the plan's origin; a frame is drawn only when something changed.

const NO_CAMERA = "Choose a camera here or click one to see where it stands.";
// Cameras up to which their numbers are shown at first.
const FEW = 120;

// Colours of cameras by their role.
const ROLES = { own: "--camera", other: "--kept", suggested: "--suggested" };

function drawScene(plan, root = document.querySelector(".scene")) {
  const stage = root.querySelector(".stage"), canvas = root.querySelector("canvas"), form = root.querySelector("form");
  const [tip, outline, box, overlay] = [".tip", ".frame", ".legend", ".overlay"].map((name) => stage.querySelector(name));
  const gl = openWebGl(stage, canvas, form);
  if (!gl) return;

  const { origin, region, layouts, up, bulk, tour, words } = plan;
  let cameras = layouts[0].cameras;
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
  const cloud = plan.cloud && {
    ...plan.cloud,
    positions: unpack(plan.cloud.positions, Uint16Array),
    colours: unpack(plan.cloud.colours, Uint8Array),
    nearest: unpack(plan.cloud.nearest, Uint16Array),
  };

  const places = cloud ? Float32Array.from(cloud.positions, (v, i) => cloud.low[i % 3] + v * cloud.step[i % 3]) : points.positions;

  /* ---- sizes and the first view ---- */

  const room = region?.kind === "box", everywhere = layouts.flatMap((layout) => layout.cameras.map((c) => c.position));
  const bulkSize = length(sub(bulk[1], bulk[0]));
  const middle = scale(add(...bulk), 0.5), farthest = everywhere.reduce((far, p) => Math.max(far, length(sub(p, middle))), 0.5 * bulkSize);
  const radius = room ? 0.5 * Math.max(bulkSize, length(sub(region.max, region.min))) : region?.r_max ?? farthest;
  const [regionOutline, floorGrid] = region ? [regionLines(region, up), floorLines(region, up)] : [[], []];
  const corners = [...Array(8).keys()].map((i) => [0, 1, 2].map((k) => bulk[(i >> k) & 1][k]));
  const extremes = [...corners, ...regionOutline.flat(), ...everywhere];
  const orbit = orbitAround(canvas, up, radius);
  /** A view from above and aside. */
  const home = () => orbit.fit(extremes, room ? { yaw: 1.0, pitch: 0.8 } : { yaw: 0.6, pitch: 0.3 });
  let chosen = null, hovered = null, through = null;
  const marks = markSurface(form, { positions: places, origin, up, bulk, cameras });
  // Heights the cut runs through.
  const heights = [...corners, ...(room ? regionOutline.flat() : [])].map((p) => dot(p, up));
  const lowest = Math.min(...heights), highest = Math.max(...heights) + 0.01 * radius;
  const margin = scale(sub(bulk[1], bulk[0]), 0.015);
  const cameraDepth = () => radius * Math.min(0.12, 0.62 / Math.sqrt(cameras.length + 1)) * 2 ** Number(form.size.value);

  /* ---- GPU state ---- */

  const trianglesProgram = program(gl, TRIANGLE_SHADERS), pointsProgram = program(gl, POINT_SHADERS), linesProgram = program(gl, LINE_SHADERS);
  const pointArray = vertexArray(gl, [{ data: places, size: 3 }, { data: cloud?.colours ?? points.colours, size: 3 }]);
  const meshArray = mesh && vertexArray(gl, [{ data: mesh.positions, size: 3 }, { data: new Uint8Array(9 * mesh.count), size: 3 }]);
  const lineArray = vertexArray(gl, [
    { data: new Float32Array(0), size: 3, divisor: 1 }, { data: new Float32Array(0), size: 3, divisor: 1 }, { data: new Uint8Array(0), size: 4, divisor: 1 },
  ]);
  let lineCount = 0;

  const known = points.gap.some(Number.isFinite);
  root.querySelector(".colour-choice").hidden = !known;
  if (!known) form.colour.value = "own";
  else if (points.error.length === 0) {
    form.colour.value = "gap";
    form.querySelector("[name=colour][value=error]").closest("label").hidden = true;
  }
  function recolour() {
    const choice = form.colour.value;
    const { colours, keys, ramp } = pointColours(points, choice);
    pointArray.update(1, cloud ? (choice === "own" ? cloud.colours : atNearest(colours, cloud.nearest)) : colours);
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

  /** The colours of the points that are nearest to others. */
  function atNearest(colours, nearest) {
    const out = new Uint8Array(3 * nearest.length);
    nearest.forEach((point, i) => out.set(colours.subarray(3 * point, 3 * point + 3), 3 * i));
    return out;
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
      for (const [role, colour] of Object.entries(ROLES)) if (cameras.some((c) => c.role === role)) swatches.push([words[role], styleColour(colour)]);
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
      for (const wall of plan.walls) push(wallLines(wall, bulk, up), styleColour("--region"), 110);
      push(plan.zones, styleColour("--bad"), 170);
    }
    push(marks.lines(), styleColour("--chosen"), 230);
    if (form.tour.checked) push(tour.slice(1).map((to, i) => [tour[i], to]), styleColour("--tour"), 230);
    if (form.cameras.checked) {
      const marked = styleColour("--chosen");
      const colour = Object.fromEntries(Object.entries(ROLES).map(([role, name]) => [role, styleColour(name)]));
      cameras.forEach((camera, i) => {
        const marks = i === chosen || i === hovered;
        push(frustum(camera, cameraDepth() * (marks ? 1.35 : 1)), marks ? marked : colour[camera.role], 255);
      });
    }
    lineCount = lines.length;
    lineArray.update(0, new Float32Array(lines.flatMap(([a]) => a)));
    lineArray.update(1, new Float32Array(lines.flatMap(([, b]) => b)));
    lineArray.update(2, new Uint8Array(colours));
    redraw();
  }

  /* ---- drawing ---- */

  const redraw = beforeNextFrame(draw);

  const currentView = () => (through === null ? orbit.view() : cameraView(canvas, cameras[through], 2e-3 * radius, 200 * radius));

  function draw() {
    const [width, height, ratio] = fitCanvas(canvas);
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
      // About as wide as the points' spacing on a surface; those of a reconstruction lie in clumps.
      const diameter = cloud?.diameter ?? ((known ? 1.7 : 0.5) * bulkSize) / Math.sqrt(points.count + 1);
      surface.set("diameter", "1f", 0.5 * diameter * view.focal[1] * height);
      surface.set("largest", "1f", cloud ? 7 * ratio : 48);
      pointArray.bind();
      gl.drawArrays(gl.POINTS, 0, cloud?.count ?? points.count);
    }

    // Through a camera one sees what its photo would show: the surface alone.
    if (through === null) drawLines(view, width, height, ratio);
    drawOverlay(view, width, height, ratio);
    drawFrame(outline, view, through === null ? null : photoOf(through), form.photo);
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
        const at = camera.role === "other" ? null : onCanvas(view.clip, camera.position);
        if (!at) return;
        pen.fillStyle = css(i === chosen || i === hovered ? "--chosen" : "--ink");
        const name = camera.label ?? shortName(camera.name);
        pen.strokeText(name, at[0], at[1] - 6);
        pen.fillText(name, at[0], at[1] - 6);
      });
    }
    drawAxes(pen, ["--series-2", "--series-3", "--series-1"].map(css), view.axes, [width / ratio - 96, height / ratio - 42]);
    drawUp(pen, css("--region"), [dot(up, view.axes[0]), dot(up, view.axes[1])], [width / ratio - 34, height / ratio - 30]);
  }

  /* ---- cameras under the pointer ---- */

  /** The photo of a camera, which the page shows elsewhere as well. */
  const photoOf = (index) => document.querySelector(`[data-camera="${index}"] img`)?.src;

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

  const called = (camera) => (camera.role === "own" ? "" : `${words[camera.role]}, `);
  const remark = (camera) => (camera.remark ? `; ${camera.remark}` : "");
  const place = (camera) => `(${add(camera.position, origin).map((v) => v.toFixed(3)).join(", ")})`;

  function hover(index, x, y) {
    tip.hidden = index === null;
    if (index !== null) {
      tip.textContent = "";
      html("b", "", cameras[index].name, tip);
      html("span", "", `${called(cameras[index])}at ${place(cameras[index])}${remark(cameras[index])}`, tip);
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
      ? `At ${place(camera)}, looking along (${camera.axes[2].map((v) => v.toFixed(2)).join(", ")}), ${camera.size.join(" × ")} pixels${remark(camera)}`
      : NO_CAMERA;
    rebuildLines();
  }

  function look(index) {
    through = index;
    choose(index ?? chosen);
  }

  /* ---- input ---- */

  /** Any movement leaves a camera that one looks through. */
  function move(action) {
    if (through !== null) look(null);
    action();
    redraw();
  }

  listen(canvas, orbit, {
    move,
    hover: (at) => (at ? hover(pick(...at, 14), ...at) : hover(null)),
    pick: (at, within) => {
      if (!form.mark.value) return choose(pick(...at, within));
      const cut = Number(form.cut.value), top = cut >= 1 ? Infinity : lowest + cut * (highest - lowest);
      marks.click((p) => (dot(p, up) > top ? null : onCanvas(currentView().clip, p)), currentView().eye, at);
      rebuildLines();
    },
  });

  function showLayout(index) {
    cameras = layouts[index].cameras;
    form.camera.replaceChildren(new Option("none", ""));
    cameras.forEach((camera, i) => form.camera.add(new Option(camera.role === "own" ? camera.name : `${camera.name} (${words[camera.role]})`, i)));
    [through, hovered] = [null, null];
    choose(null);
  }
  layouts.forEach((layout, i) => form.layout.add(new Option(layout.name, i)));
  form.layout.closest("fieldset").hidden = layouts.length < 2;
  form.layout.addEventListener("change", () => showLayout(Number(form.layout.value)));
  form.camera.addEventListener("change", () => {
    if (form.camera.value === "") through = null;
    choose(form.camera.value === "" ? null : Number(form.camera.value));
  });
  form.look.addEventListener("click", () => look(through === null ? chosen : null));
  form.elements.namedItem("reset").addEventListener("click", () => move(home));
  for (const figure of document.querySelectorAll("[data-camera]")) {
    figure.addEventListener("click", () => {
      look(Number(figure.dataset.camera));
      root.scrollIntoView({ block: "nearest" });
    });
  }
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", (event) => {
    if (["colour", "cameras", "tour"].includes(event.target.name)) recolour();
    if (event.target.name === "mark") marks.begin();
    if (["cameras", "mark", "region", "size", "tour"].includes(event.target.name)) rebuildLines();
    showCut();
    redraw();
  });
  function showCut() {
    const cut = Number(form.cut.value);
    form.cutText.value = cut >= 1 ? "off" : round(lowest + cut * (highest - lowest) + dot(origin, up));
  }

  form.open.checked = room;
  form.numbers.checked = cameras.filter((c) => c.role !== "other").length <= FEW;
  form.tour.closest("label").hidden = tour.length < 2;
  root.querySelector(".surface-choice").hidden = !mesh || points.count === 0;
  form.region.closest("label").hidden = !region;
  root.querySelector(".mark").hidden = !region;
  marks.begin();
  home();
  showLayout(0);
  showCut();
  recolour();
  const restyle = () => { recolour(); rebuildLines(); };
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", restyle);
  new ResizeObserver(redraw).observe(canvas);

  // The first frame at once, and how much of it is not background, for automated checks of the page.
  draw();
  canvas.dataset.drawn = countDrawn(gl, styleColour("--stage"));
}
