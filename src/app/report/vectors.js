// Vectors as arrays of three, matrices as column-major arrays of sixteen, and the lines and colours the 3D view draws.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.hypot(a[0], a[1], a[2]);
const normalize = (a) => scale(a, 1 / (length(a) || 1));

/** Two unit vectors that make a right-handed frame with `up`: up = x × y. */
function horizontal(up) {
  const axis = Math.abs(up[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0];
  const x = normalize(sub(axis, scale(up, dot(axis, up))));
  return [x, cross(up, x)];
}

function multiply(a, b) {
  const out = new Array(16).fill(0);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[c * 4 + r] += a[k * 4 + r] * b[c * 4 + k];
  return out;
}

/** Camera-from-world for axes right, down, forward (the convention of the plan). */
function viewMatrix(eye, [right, down, forward]) {
  return [
    right[0], down[0], forward[0], 0, right[1], down[1], forward[1], 0, right[2], down[2], forward[2], 0,
    -dot(right, eye), -dot(down, eye), -dot(forward, eye), 1,
  ];
}

/** Clip-from-camera for x = fx X/Z + cx (right), y = fy Y/Z + cy (down), all in units of the half picture. */
function projection(fx, fy, cx, cy, near, far) {
  const a = (far + near) / (far - near), b = (-2 * far * near) / (far - near);
  return [fx, 0, 0, 0, 0, -fy, 0, 0, cx, -cy, a, 1, 0, 0, b, 0];
}

/* ---- embedded arrays ---- */

function unpack(text, Type) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return new Type(bytes.buffer);
}

/* ---- colours ---- */

const VIRIDIS = [
  [68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37],
];

const NO_VALUE = [150, 152, 156];
const UNSEEN = [226, 61, 148];

/** Colour of t in [0, 1]. */
function viridis(t) {
  const at = Math.min(Math.max(t, 0), 1) * (VIRIDIS.length - 1);
  const i = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return VIRIDIS[i].map((v, k) => v + (VIRIDIS[i + 1][k] - v) * (at - i));
}

/** Value below which the fraction `q` of the finite values lies. */
function quantile(values, q) {
  const sorted = Float64Array.from(values).filter(Number.isFinite).sort();
  return sorted.length ? sorted[Math.round(q * (sorted.length - 1))] : NaN;
}

/** Colours of the points for a choice of the form, and what explains them: keys of a name and a colour, and the ends of the ramp. */
function pointColours(points, choice) {
  const colours = new Uint8Array(3 * points.count);
  if (choice === "own") return { colours: points.colours, keys: [], ramp: null };
  const values = points[choice];
  const signed = choice === "error", score = choice === "score" || signed;
  // The gap of an unseen point is pi by definition; it has a colour of its own and must not stretch the ramp.
  const ranked = score ? values : values.filter((_, i) => points.views[i] > 0);
  const low = score ? quantile(ranked, signed ? 0.02 : 0) : 0, high = quantile(ranked, score && !signed ? 1 : 0.98);
  for (let i = 0; i < points.count; i++) {
    const value = values[i];
    const none = !Number.isFinite(value) || (!score && !Number.isFinite(points.gap[i]));
    const unseen = !none && !score && points.views[i] === 0;
    colours.set(none ? NO_VALUE : unseen ? UNSEEN : viridis((value - low) / (high - low || 1)), 3 * i);
  }
  const unit = { gap: "°", error: " dB" }[choice] ?? "";
  const keys = [];
  if (!score && points.gap.some((g, i) => Number.isFinite(g) && points.views[i] === 0)) keys.push(["unseen", UNSEEN]);
  if (points.gap.some((g) => !Number.isFinite(g))) keys.push(["out of reach", NO_VALUE]);
  const title = { gap: "Mean angle to the nearest view", views: "Views that see a point", score: "View dependency score", error: "Expected error against the median" }[choice];
  const ramp = Number.isFinite(high) ? { title, low: `${round(low)}${unit}`, high: `${round(high)}${unit}${score ? "" : " or more"}` } : null;
  return { colours, keys, ramp };
}

const round = (value) => (Number.isFinite(value) ? String(Number(value.toPrecision(3))) : "–");

/** A style sheet's colour as red, green, blue from 0 to 255. */
function styleColour(name) {
  const hex = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
}

/* ---- lines: arrays of [from, to] ---- */

/** The pyramid of a camera's image at `depth` before it, and a roof over the image's upper edge. */
function frustum(camera, depth) {
  const [right, down, forward] = camera.axes;
  const corner = (x, y) => add(camera.position, scale(add(forward, add(
    scale(right, (x * camera.size[0] - camera.principal[0]) / camera.focal[0]),
    scale(down, (y * camera.size[1] - camera.principal[1]) / camera.focal[1]),
  )), depth));
  const corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
  const roof = corner(0.5, -0.25);
  return corners
    .flatMap((c, i) => [[camera.position, c], [c, corners[(i + 1) % 4]]])
    .concat([[corners[0], roof], [roof, corners[1]]]);
}

function circle(centre, x, y, radius) {
  const at = (i) => add(centre, add(scale(x, radius * Math.cos((i * Math.PI) / 48)), scale(y, radius * Math.sin((i * Math.PI) / 48))));
  return Array.from({ length: 96 }, (_, i) => [at(i), at(i + 1)]);
}

/** The region's outline, ending at the floor where there is one. */
function regionLines(region, up) {
  const [east, north] = horizontal(up);
  let lines = [], floor = [];
  if (region.kind === "shell") {
    for (const r of [region.r_min, region.r_max]) {
      lines.push(...circle(region.centre, east, north, r), ...circle(region.centre, east, up, r), ...circle(region.centre, north, up, r));
      const height = region.floor === null ? Infinity : region.floor - dot(region.centre, up);
      if (Math.abs(height) < r) floor.push(...circle(add(region.centre, scale(up, height)), east, north, Math.sqrt(r * r - height * height)));
    }
  } else {
    const corner = (i) => [0, 1, 2].map((k) => (i & (1 << k) ? region.max[k] : region.min[k]));
    for (let i = 0; i < 8; i++) for (let k = 0; k < 3; k++) if (!(i & (1 << k))) lines.push([corner(i), corner(i | (1 << k))]);
  }
  if (region.floor === null) return lines;
  const above = (p) => dot(p, up) - region.floor;
  const cuts = [];
  lines = lines.filter(([a, b]) => above(a) >= 0 || above(b) >= 0).map(([a, b]) => {
    if (above(a) >= 0 && above(b) >= 0) return [a, b];
    const cut = add(a, scale(sub(b, a), above(a) / (above(a) - above(b))));
    cuts.push(cut);
    return above(a) >= 0 ? [a, cut] : [cut, b];
  });
  if (region.kind === "box" && cuts.length > 2) {
    // The floor's own outline: the cuts in order around their middle.
    const middle = scale(cuts.reduce(add), 1 / cuts.length);
    const angle = (p) => Math.atan2(dot(sub(p, middle), north), dot(sub(p, middle), east));
    cuts.sort((a, b) => angle(a) - angle(b));
    floor = cuts.map((c, i) => [c, cuts[(i + 1) % cuts.length]]);
  }
  return lines.concat(floor);
}

/** A grid on the floor, as wide as the region. */
function floorLines(region, up) {
  if (region.floor === null) return [];
  const [east, north] = horizontal(up), shell = region.kind === "shell";
  const middle = shell ? region.centre : scale(add(region.min, region.max), 0.5);
  const half = shell ? region.r_max : 0.5 * length(sub(region.max, region.min));
  const at = (x, y) => add(add(middle, scale(up, region.floor - dot(middle, up))), add(scale(east, x * half), scale(north, y * half)));
  const steps = [...Array(11).keys()].map((i) => i / 5 - 1);
  return steps.flatMap((t) => [[at(t, -1), at(t, 1)], [at(-1, t), at(1, t)]]);
}

/** A grid on a wall, as wide and high as the bulk of the surface before it. */
function wallLines(wall, bulk, up) {
  const aside = Math.abs(dot(wall.normal, up)) > 0.9 ? horizontal(up)[0] : normalize(cross(up, wall.normal));
  const other = cross(wall.normal, aside);
  const corners = [...Array(8).keys()].map((i) => sub([0, 1, 2].map((k) => bulk[(i >> k) & 1][k]), wall.point));
  const [xs, ys] = [aside, other].map((axis) => corners.map((p) => dot(p, axis)));
  const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const at = (s, t) => add(wall.point, add(scale(aside, x0 + s * (x1 - x0)), scale(other, y0 + t * (y1 - y0))));
  const steps = [...Array(9).keys()].map((i) => i / 8);
  return steps.flatMap((t) => [[at(t, 0), at(t, 1)], [at(0, t), at(1, t)]]);
}

/** What a camera is called in the picture: its number, or its name where that is short. */
function shortName(name) {
  const stem = name.replace(/^.*\//, "").replace(/\.[A-Za-z]+$/, "");
  return /^\d+$/.test(stem) ? String(Number(stem)) : stem.length <= 8 ? stem : "";
}

/** Short lines from `at` along the world's axes as a view has them, with their letters. */
function drawAxes(pen, colours, [right, down], at) {
  pen.font = "600 11px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.lineWidth = 2;
  ["X", "Y", "Z"].forEach((letter, k) => {
    pen.strokeStyle = pen.fillStyle = colours[k];
    pen.beginPath();
    pen.moveTo(...at);
    pen.lineTo(at[0] + 22 * right[k], at[1] + 22 * down[k]);
    pen.stroke();
    pen.fillText(letter, at[0] + 31 * right[k], at[1] + 31 * down[k] + 4);
  });
}

/** An arrow from `at` along the up direction, whose part across the view is `along` (right, down). */
function drawUp(pen, colour, [x, y], at) {
  const size = 24, tip = [at[0] + size * x, at[1] + size * y], across = Math.hypot(x, y);
  pen.strokeStyle = pen.fillStyle = colour;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(...at);
  pen.lineTo(...tip);
  pen.stroke();
  if (across > 0.2) {
    const [u, v] = [x / across, y / across];
    pen.beginPath();
    pen.moveTo(tip[0] + 6 * u, tip[1] + 6 * v);
    pen.lineTo(tip[0] - 4 * v, tip[1] + 4 * u);
    pen.lineTo(tip[0] + 4 * v, tip[1] - 4 * u);
    pen.fill();
  }
  pen.font = "12px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.fillText("up", at[0], at[1] + 16);
}
