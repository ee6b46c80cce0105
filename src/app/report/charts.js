// Plots as inline SVG: they print, scale, and take their colours from the style sheet in either colour scheme.

const HEIGHT = 240;
const MARGIN = { left: 58, right: 14, top: 10, bottom: 42 };

/* ---- scales and ticks ---- */

/** Round numbers that cover [low, high] in about `count` steps. */
function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const out = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) out.push(i * step);
  return out;
}

/** Decades within [low, high], with 2 and 5 between them where there are few. */
function logTicks(low, high) {
  const decades = Math.log10(high / low);
  const every = Math.max(1, Math.ceil(decades / 6));
  const out = [];
  for (let e = Math.floor(Math.log10(low)); e <= Math.log10(high); e++) {
    if (e % every !== 0) continue;
    for (const m of decades < 2.5 ? [1, 2, 5] : [1]) {
      const value = m * 10 ** e;
      if (value >= low * 0.999 && value <= high * 1.001) out.push(value);
    }
  }
  return out;
}

function format(value) {
  if (value === null || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  return size >= 1e5 || size < 0.01 ? value.toExponential(1).replace(".0", "").replace("e+", "e") : String(Number(value.toPrecision(4)));
}

/* ---- drawing ---- */

function element(name, attributes, parent) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (parent) parent.append(node);
  return node;
}

function label(parent, text, attributes) {
  element("text", attributes, parent).textContent = text;
}

function html(name, className, text, parent) {
  const node = document.createElement(name);
  node.className = className;
  node.textContent = text;
  parent.append(node);
  return node;
}

/** Width to draw at: that of the figure, so that text is as large as it should be. */
function innerWidth(figure) {
  const style = getComputedStyle(figure);
  return Math.max(240, figure.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight));
}

/** An SVG with axes. `x` and `y` map values to the picture; returns it with the place to draw in. */
function frame(figure, width, x, y, xTicks, yTicks, names, description) {
  const svg = element("svg", { viewBox: `0 0 ${width} ${HEIGHT}`, role: "img", "aria-label": description });
  const right = width - MARGIN.right, bottom = HEIGHT - MARGIN.bottom;
  for (const tick of yTicks) {
    element("line", { class: "grid", x1: MARGIN.left, x2: right, y1: y(tick), y2: y(tick) }, svg);
    label(svg, format(tick), { x: MARGIN.left - 8, y: y(tick) + 4, "text-anchor": "end" });
  }
  for (const tick of xTicks) {
    element("line", { class: "axis", x1: x(tick), x2: x(tick), y1: bottom, y2: bottom + 4 }, svg);
    label(svg, format(tick), { x: x(tick), y: bottom + 18, "text-anchor": "middle" });
  }
  element("line", { class: "axis", x1: MARGIN.left, x2: right, y1: bottom, y2: bottom }, svg);
  label(svg, names.x, { x: (MARGIN.left + right) / 2, y: HEIGHT - 6, "text-anchor": "middle" });
  const middle = (MARGIN.top + bottom) / 2;
  label(svg, names.y, { x: 12, y: middle, "text-anchor": "middle", transform: `rotate(-90 12 ${middle})` });
  figure.append(svg);
  return svg;
}

/** A line of values by iteration. */
function line(name, y, colour, style = "") {
  return { name, y, colour, style };
}

/** Points at iterations of their own, among lines. */
function dots(name, x, y, colour) {
  return { name, x, y, colour, style: "" };
}

/** Index of the value that is nearest to `to`. */
function nearest(values, to) {
  let best = 0;
  values.forEach((v, i) => { if (Math.abs(v - to) < Math.abs(values[best] - to)) best = i; });
  return best;
}

function empty(figure) {
  html("p", "empty", "No data: nothing was recorded.", figure);
}

/** The path of a series; `y` gives null where it has a gap. */
function drawLine(svg, series, iterations, x, y) {
  let path = "", pen = "M";
  series.y.forEach((v, i) => {
    const height = y(v);
    if (height === null) {
      pen = "M";
      return;
    }
    path += `${pen}${x(iterations[i]).toFixed(1)} ${height.toFixed(1)}`;
    pen = "L";
  });
  // A lone point has no length: let its round cap show.
  if (!path.includes("L") && path) path += "h0.01";
  element("path", { d: path, class: `series ${series.style}`, style: `stroke:var(--series-${series.colour})` }, svg);
}

function drawPoints(svg, series, iterations, x, y) {
  series.y.forEach((v, i) => {
    const height = y(v);
    if (height === null) return;
    const mark = element("circle", { class: "mark", cx: x(series.x[i]), cy: height, r: 4.5, style: `fill:var(--series-${series.colour})` }, svg);
    element("title", {}, mark).textContent = `${series.name} ${format(v)} at ${series.x[i]}`;
  });
}

/** Lines and points over iterations. Values that are null, or not positive on a log scale, leave a gap. */
function lineChart(id, iterations, series, { y: yName, over = "iteration", log = false, top = Infinity }) {
  const figure = document.getElementById(id);
  const usable = (v) => v !== null && Number.isFinite(v) && (!log || v > 0);
  const values = series.flatMap((s) => s.y.filter(usable));
  if (values.length === 0) return empty(figure);

  let low = values.reduce((a, b) => Math.min(a, b)), high = values.reduce((a, b) => Math.max(a, b));
  if (log) {
    [low, high] = [low / 1.2, high * 1.2];
  } else {
    // Air above and below; a flat line gets some too.
    const air = Math.max((high - low) * 0.06, Math.abs(high) * 1e-3, 1e-9);
    low = low >= 0 ? Math.max(0, low - air) : low - air;
    high = high <= top ? Math.min(top, high + air) : high + air;
  }
  const along = series.flatMap((s) => s.x ?? iterations);
  const first = along.reduce((a, b) => Math.min(a, b)), last = Math.max(along.reduce((a, b) => Math.max(a, b)), first + 1);
  const width = innerWidth(figure);
  const x = (v) => MARGIN.left + ((v - first) / (last - first)) * (width - MARGIN.left - MARGIN.right);
  const unit = log ? (v) => Math.log(v / low) / Math.log(high / low) : (v) => (v - low) / (high - low);
  const y = (v) => HEIGHT - MARGIN.bottom - unit(v) * (HEIGHT - MARGIN.top - MARGIN.bottom);

  const keys = html("div", "keys", "", figure);
  const readings = series.slice().reverse().map((s) => {
    const key = html("span", "", "", keys);
    const stroke = `stroke:var(--series-${s.colour})`;
    const swatch = element("svg", { viewBox: "0 0 14 8", style: "display:inline-block;width:14px;height:8px;margin-right:5px", "aria-hidden": "true" }, key);
    if (s.x) element("circle", { cx: 7, cy: 4, r: 3.5, style: `fill:var(--series-${s.colour})` }, swatch);
    else element("path", { d: "M1 4H13", class: `series ${s.style.replace("fine", "")}`, style: stroke }, swatch);
    key.append(`${s.name} `);
    return { series: s, text: html("b", "", "", key) };
  });
  const description = `${series.map((s) => s.name).join(", ")} by ${over}; last value of ${yName} ${format(series[series.length - 1].y.findLast(usable))}`;
  const svg = frame(figure, width, x, y, ticks(first, last, width / 70).filter(Number.isInteger), log ? logTicks(low, high) : ticks(low, high, 5),
    { x: over, y: yName }, description);
  for (const s of series) (s.x ? drawPoints : drawLine)(svg, s, iterations, x, (v) => (usable(v) ? y(v) : null));
  svg.dataset.values = values.length;

  // The values under the pointer, else the last ones.
  const cursor = element("line", { class: "cursor", y1: MARGIN.top, y2: HEIGHT - MARGIN.bottom, visibility: "hidden" }, svg);
  const where = html("span", "", "", keys);
  const read = (index) => {
    for (const { series: s, text } of readings) {
      const at = index === null ? s.y.findLastIndex((v) => v !== null) : s.x ? nearest(s.x, iterations[index]) : index;
      text.textContent = format(s.y[at] ?? null) + (s.x && at in s.x ? ` at ${s.x[at]}` : "");
    }
    where.textContent = index === null ? "" : `at ${iterations[index]}`;
    cursor.setAttribute("visibility", index === null ? "hidden" : "visible");
    if (index !== null) for (const end of ["x1", "x2"]) cursor.setAttribute(end, x(iterations[index]));
  };
  svg.addEventListener("pointermove", (event) => {
    const box = svg.getBoundingClientRect();
    const at = ((event.clientX - box.left) / box.width) * width;
    if (iterations.length > 0) read(nearest(iterations.map(x), at));
  });
  svg.addEventListener("pointerleave", () => read(null));
  read(null);
}

/** Bars from a histogram of points. */
function barChart(id, { start, step, counts }, { x: xName, unit }) {
  const figure = document.getElementById(id);
  const total = counts.reduce((a, b) => a + b, 0);
  if (total === 0) return empty(figure);
  const high = Math.max(...counts) * 1.06, end = start + step * counts.length;
  const width = innerWidth(figure);
  const x = (v) => MARGIN.left + ((v - start) / (end - start)) * (width - MARGIN.left - MARGIN.right);
  const y = (v) => HEIGHT - MARGIN.bottom - (v / high) * (HEIGHT - MARGIN.top - MARGIN.bottom);
  // A whole number is in the middle of its bar, a limit between two.
  const whole = unit === "" && step === 1;
  const keys = html("div", "keys", "", figure);
  const svg = frame(figure, width, (v) => x(whole ? v + 0.5 : v), y, ticks(start, whole ? end - 1 : end, width / 60).filter((v) => !whole || Number.isInteger(v)),
    ticks(0, high, 5).filter(Number.isInteger), { x: xName, y: "points" }, `Histogram of ${total} points by ${xName}`);
  counts.forEach((count, i) => {
    const from = start + i * step;
    const range = whole ? `${from}` : unit ? `${format(from)}${unit} to ${format(from + step)}${unit}` : `${from} to ${from + step - 1}`;
    const bar = element("rect", {
      class: "bar", x: x(from) + 0.75, width: Math.max(x(from + step) - x(from) - 1.5, 0.5), y: y(count), height: y(0) - y(count), rx: 1.5,
    }, svg);
    const text = `${range}: ${count} points, ${format(Number(((100 * count) / total).toPrecision(2)))} %`;
    element("title", {}, bar).textContent = text;
    bar.addEventListener("pointerenter", () => { keys.textContent = text; });
    bar.addEventListener("pointerleave", () => { keys.textContent = ""; });
  });
  svg.dataset.values = total;
}
