// Where one looks from: an orbit around a target, or a camera; and the input that moves it.

const FIELD_OF_VIEW = (40 * Math.PI) / 180;

/** The canvas' WebGL 2, or none and a line in its place where the browser does not offer it. */
function openWebGl(stage, canvas, form, antialias = true) {
  // The buffer is kept so that the picture is there when the page is printed.
  const gl = canvas.getContext("webgl2", { antialias, alpha: false, preserveDrawingBuffer: true });
  const unavailable = (text) => {
    stage.textContent = "";
    html("p", "unavailable", text, stage);
    form.hidden = true;
  };
  if (!gl) unavailable("The 3D view needs WebGL 2, which this browser does not offer. All else on this page works without it.");
  canvas.addEventListener("webglcontextlost", () => unavailable("The browser dropped the 3D view; reload the page to get it back."));
  return gl;
}

/** Makes the canvas as large as it is shown; returns its size in pixels, and how many of them are a CSS pixel. */
function fitCanvas(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((size) => Math.max(1, Math.round(size * ratio)));
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  return [width, height, ratio];
}

/** A view around a target, in a scene of some radius; a view has eye, axes, clip-from-world, near plane, and focal lengths in half pictures. */
function orbitAround(canvas, up, radius) {
  const [east, north] = horizontal(up);
  const usual = 1 / Math.tan(FIELD_OF_VIEW / 2);
  let target, distance, yaw, pitch, focal;
  const view = () => {
    const [width, height] = [canvas.clientWidth || 1, canvas.clientHeight || 1];
    const flat = add(scale(east, Math.cos(yaw)), scale(north, Math.sin(yaw)));
    const back = add(scale(flat, Math.cos(pitch)), scale(up, Math.sin(pitch)));
    const eye = add(target, scale(back, distance));
    const forward = scale(back, -1), right = normalize(cross(forward, up)), down = cross(forward, right);
    const near = 0.02 * distance;
    const across = (focal * height) / width;
    const clip = multiply(projection(across, focal, 0, 0, near, distance + 40 * radius), viewMatrix(eye, [right, down, forward]));
    return { eye, axes: [right, down, forward], clip, near, focal: [across, focal] };
  };
  return {
    view,
    /** As near as it can be with all points in the picture. */
    fit(points, from) {
      const [low, high] = [Math.min, Math.max].map((f) => [0, 1, 2].map((k) => points.reduce((v, p) => f(v, p[k]), points[0][k])));
      [target, distance, yaw, pitch, focal] = [scale(add(low, high), 0.5), 1, from.yaw, from.pitch, usual];
      const { axes: [right, down, forward] } = view();
      const aspect = canvas.clientWidth / canvas.clientHeight || 1;
      // Perspective draws what is near larger, so the middle of the picture is found in a few iterations.
      for (let round = 0; round < 6; round++) {
        const seen = points.map((p) => sub(p, target)).map((at) => [dot(at, right), dot(at, down), dot(at, forward)]);
        distance = 1.06 * seen.reduce((d, [x, y, z]) => Math.max(d, Math.max(Math.abs(x) / aspect, Math.abs(y)) * focal - z), 0.01 * radius);
        for (const [k, axis] of [right, down].entries()) {
          const places = seen.map((at) => at[k] / (distance + at[2]));
          const middle = 0.5 * (places.reduce((a, b) => Math.min(a, b)) + places.reduce((a, b) => Math.max(a, b)));
          target = add(target, scale(axis, middle * distance));
        }
      }
    },
    /** From where another view is, upright, around what lies so far before it. */
    follow(other, depth) {
      const back = scale(other.axes[2], -1);
      [target, distance, focal] = [add(other.eye, scale(back, -depth)), depth, other.focal[1]];
      [yaw, pitch] = [Math.atan2(dot(back, north), dot(back, east)), Math.asin(Math.min(Math.max(dot(back, up), -1), 1))];
    },
    turn(dx, dy) {
      yaw -= dx;
      pitch = Math.min(Math.max(pitch + dy, -1.55), 1.55);
    },
    pan(dx, dy) {
      const [right, down] = view().axes;
      const step = (2 * distance) / focal / canvas.clientHeight;
      target = add(target, add(scale(right, -dx * step), scale(down, -dy * step)));
    },
    zoom(factor) {
      distance = Math.min(Math.max(distance * factor, 0.01 * radius), 30 * radius);
    },
  };
}

/** What a camera sees, its picture as large as the canvas allows; `part` is the picture's share of the canvas. */
function cameraView(canvas, camera, near, far) {
  const [width, height] = [canvas.clientWidth || 1, canvas.clientHeight || 1];
  const fit = Math.min((width - 48) / camera.size[0], (height - 48) / camera.size[1]);
  const part = [(fit * camera.size[0]) / width, (fit * camera.size[1]) / height];
  const f = [0, 1].map((k) => (part[k] * 2 * camera.focal[k]) / camera.size[k]);
  const c = [0, 1].map((k) => part[k] * ((2 * camera.principal[k]) / camera.size[k] - 1));
  const clip = multiply(projection(...f, ...c, near, far), viewMatrix(camera.position, camera.axes));
  return { eye: camera.position, axes: camera.axes, clip, near, focal: f, offset: c, part };
}

/** Outlines the picture of a camera's view, and lays its photo over it as densely as the slider says. */
function drawFrame(outline, view, photo, slider) {
  outline.hidden = !view.part;
  slider.closest("label").hidden = !view.part || !photo;
  if (!view.part) return;
  const [w, h] = view.part.map((p) => 100 * p);
  outline.style.cssText = `left:${50 - w / 2}%;top:${50 - h / 2}%;width:${w}%;height:${h}%`;
  const shown = outline.querySelector("img");
  if (!photo) return shown?.remove();
  const picture = shown ?? html("img", "", "", outline);
  if (picture.src !== photo) [picture.src, picture.alt] = [photo, ""];
  picture.style.opacity = slider.value;
}

/** Mouse, touch and keys on a canvas: `move` gets an action that changes `orbit`, `hover` and `pick` places on the canvas. */
function listen(canvas, orbit, { move, hover, pick }) {
  const pointers = new Map();
  let travelled = 0;
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (pointers.size === 1) travelled = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const at = [event.offsetX, event.offsetY], before = pointers.get(event.pointerId);
    if (!before) return hover(at);
    const [dx, dy] = [at[0] - before[0], at[1] - before[1]];
    travelled += Math.abs(dx) + Math.abs(dy);
    if (travelled < 4) return;
    hover(null);
    if (pointers.size === 2) {
      // Two fingers: each moves the scene by half, and their distance zooms.
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      move(() => { orbit.pan(dx / 2, dy / 2); orbit.zoom(apart(before) / apart(at)); });
    } else if (event.shiftKey || event.buttons & 6) {
      move(() => orbit.pan(dx, dy));
    } else {
      move(() => orbit.turn(dx * 0.007, dy * 0.007));
    }
    pointers.set(event.pointerId, at);
  });
  canvas.addEventListener("pointerup", (event) => {
    pointers.delete(event.pointerId);
    if (travelled < 4 && event.button === 0) pick([event.offsetX, event.offsetY], event.pointerType === "touch" ? 28 : 14);
  });
  canvas.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("pointerleave", () => hover(null));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    // A browser counts in pixels or in lines; a notch is about a hundred of the one or three of the other.
    const turned = event.deltaY * (event.deltaMode === 1 ? 33 : 1);
    move(() => orbit.zoom(Math.exp(Math.min(Math.max(turned, -120), 120) * 0.0012)));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const keys = {
      ArrowLeft: () => orbit.turn(-0.1, 0), ArrowRight: () => orbit.turn(0.1, 0),
      ArrowUp: () => orbit.turn(0, -0.1), ArrowDown: () => orbit.turn(0, 0.1),
      "+": () => orbit.zoom(0.9), "=": () => orbit.zoom(0.9), "-": () => orbit.zoom(1 / 0.9), Escape: () => {},
    };
    if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    move(keys[event.key]);
  });
}

/** A function that has `draw` called once before the next frame, however often it is called itself. */
function beforeNextFrame(draw) {
  let pending = false;
  return () => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => { pending = false; draw(); });
  };
}

/** Pixels of the canvas that differ from a colour, for automated checks of a page. */
function countDrawn(gl, back) {
  const { width, height } = gl.canvas;
  const pixels = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let drawn = 0;
  for (let i = 0; i < pixels.length; i += 4) if (back.some((v, k) => Math.abs(v - pixels[i + k]) > 2)) drawn++;
  return drawn;
}
