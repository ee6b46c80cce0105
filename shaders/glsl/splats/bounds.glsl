// Where in a tile a Gaussian's alpha can count.

// Bounds of the ellipse on which alpha falls to its least value, within the tile at `corner`: first pixel in x and y, and one
// past the last.
uvec4 bounds_within(Projected splat, uvec2 corner) {
    float level = 2.0 * log(splat.opacity / MIN_ALPHA);
    // A hundredth of a pixel for what rounding takes; pixel i has its centre at i + 0.5.
    vec2 half_extent = sqrt(max(level * splat.conic.zx / splat.determinant, 0.0)) + 0.01;
    vec2 mean = splat.mean - vec2(corner);
    uvec2 first = uvec2(clamp(ceil(mean - half_extent - 0.5), 0.0, float(TILE)));
    uvec2 end = uvec2(clamp(floor(mean + half_extent + 0.5), 0.0, float(TILE)));
    return uvec4(first, max(first, end));
}
