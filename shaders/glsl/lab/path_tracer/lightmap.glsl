// The light map: each side of a triangle is cut into patches, large ones into many, and these into `rows`^2 equal cells (Yuksel, Keyser
// and House 2010, "Mesh Colors"). Twin: src/lab/path_tracer/lightmap/layout.rs. Needs the binding `sides`.

// The part of a triangle whose edges are cut into `rows` parts in which a place lies, by the weights of the second and third corner: row
// by row along the third corner's weight, upright and inverted ones in turn. `at` becomes the place in it.
uint part_at(uint rows, inout vec2 at) {
    vec2 scaled = clamp(at, 0.0, 1.0) * float(rows);
    uint j = min(uint(scaled.y), rows - 1), i = min(uint(scaled.x), rows - 1 - j);
    at = scaled - vec2(i, j);
    bool inverted = at.x + at.y > 1.0 && i + j + 1 < rows;
    if (inverted) at = 1.0 - at;
    return j * (2 * rows - j) + 2 * i + (inverted ? 1 : 0);
}

// The place in the triangle of a place in one of its parts.
vec2 place_in_part(uint rows, uint part, vec2 at) {
    uint j = min(uint(float(rows) - sqrt(max(float(rows) * float(rows) - float(part), 0.0))), rows - 1);
    // The root may be off by one.
    while (j > 0 && j * (2 * rows - j) > part) --j;
    while ((j + 1) * (2 * rows - j - 1) <= part) ++j;
    uint along = part - j * (2 * rows - j);
    return (vec2(along / 2, j) + ((along & 1) != 0 ? 1.0 - at : at)) / float(rows);
}

// Number of a corner of cells: the i-th in the j-th row.
uint corner_at(uint rows, uint i, uint j) {
    return j * (2 * rows + 3 - j) / 2 + i;
}

// The patch at a place of a triangle; `at` becomes the place in it.
uint patch_at(uint slot, bool front, inout vec2 at) {
    Side side = sides[2 * slot + (front ? 0 : 1)];
    return side.first + part_at(side.splits, at);
}
