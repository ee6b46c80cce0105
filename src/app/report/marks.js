// Walls and boxes that a user marks on the surface, and the options that say the same to a plan.

// Points around a click that a wall is laid through.
const WALL_POINTS = 40;
// How far from a point a click may be, in pixels.
const MARK_WITHIN = 12;

/** What clicks have marked so far. */
function markSurface(form, { positions, origin, up, bulk, cameras }) {
  const said = form.querySelector(".mark .detail"), options = form.elements.namedItem("options");
  const at = (i) => [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
  let places = [], wall = null;

  /** The point that is nearest to the eye among those near a click; `project` gives a place on the canvas, or none. */
  function clicked(project, eye, [x, y]) {
    let best = null, nearest = Infinity;
    for (let i = 0; i < positions.length / 3; i++) {
      const p = at(i), on = project(p);
      if (!on || Math.hypot(on[0] - x, on[1] - y) > MARK_WITHIN) continue;
      const away = length(sub(p, eye));
      if (away < nearest) [best, nearest] = [p, away];
    }
    return best;
  }

  /** The plane through the points around a place, its normal to the side of the nearest camera. */
  function plane(place) {
    const away = (i) => { const d = sub(at(i), place); return dot(d, d); };
    const near = [...Array(positions.length / 3).keys()].map((i) => [away(i), i]).sort((a, b) => a[0] - b[0]).slice(0, WALL_POINTS);
    const around = near.map(([, i]) => at(i));
    const point = scale(around.reduce(add), 1 / around.length);
    const offsets = around.map((p) => sub(p, point));
    // The two directions in which the points spread most, one after the other; the third is the normal.
    const spread = (start, without) => {
      let v = start;
      for (let k = 0; k < 50; k++) {
        v = offsets.reduce((sum, d) => add(sum, scale(d, dot(d, v))), [0, 0, 0]);
        if (without) v = sub(v, scale(without, dot(v, without)));
        const size = length(v);
        if (!(size > 0)) return null;
        v = scale(v, 1 / size);
      }
      return v;
    };
    const first = spread([0.36, 0.48, 0.8], null), second = first && spread(cross(first, Math.abs(first[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]), first);
    if (!second) return null;
    const normal = normalize(cross(first, second));
    const nearest = cameras.reduce((a, b) => (length(sub(b.position, place)) < length(sub(a.position, place)) ? b : a), cameras[0]);
    return { point, normal: scale(normal, nearest && dot(sub(nearest.position, point), normal) < 0 ? -1 : 1) };
  }

  const corners = () => [0, 1].map((k) => places.reduce((a, b) => a.map((v, axis) => (k ? Math.max : Math.min)(v, b[axis]))));
  // Four digits of the scene's size, which may be in any unit.
  const digits = Math.min(Math.max(3 - Math.floor(Math.log10(length(sub(bulk[1], bulk[0])) || 1)), 0), 12), unit = 10 ** -digits;
  const numbers = (list) => list.map((v) => v.toFixed(digits)).join(",");

  function say() {
    const mode = form.mark.value;
    let text = "";
    if (mode === "wall" && wall) text = `--wall ${numbers(add(wall.point, origin))},${wall.normal.map((v) => v.toFixed(4)).join(",")}`;
    if (mode === "box" && places.length > 1) {
      const box = numbers(corners().flatMap((p, k) => add(p, origin).map((v) => v + (k - 0.5) * unit)));
      text = `--box ${box}\n\nto keep cameras out of it, save\n{"boxes": [[${box}]]}\nas box.json and give --keep-out box.json`;
    }
    said.textContent = { wall: "Click the surface where the wall is.", box: "Click two or more places that the box is to hold." }[mode] ?? "";
    options.hidden = text === "";
    options.value = text;
  }

  return {
    begin() {
      [places, wall] = [[], null];
      say();
    },
    click(project, eye, on) {
      const place = clicked(project, eye, on);
      if (!place) return;
      places.push(place);
      if (form.mark.value === "wall") wall = plane(place);
      say();
    },
    /** What is marked, as lines. */
    lines() {
      if (form.mark.value === "wall" && wall) return wallLines(wall, bulk, up);
      if (form.mark.value !== "box" || places.length === 0) return [];
      const ends = corners(), corner = (i) => [0, 1, 2].map((axis) => ends[(i >> axis) & 1][axis]);
      return [...Array(8).keys()].flatMap((i) => [0, 1, 2].filter((axis) => !((i >> axis) & 1)).map((axis) => [corner(i), corner(i | (1 << axis))]));
    },
  };
}

