// Which tiles a projected Gaussian reaches: those with a pixel centre inside the ellipse on which its alpha falls to
// MIN_ALPHA. Exact, row of tiles by row of tiles: an ellipse cut by a band is convex, so that what it covers in x is an
// interval. `precise`, since two stages must count the same.

struct Reach {
    vec2 mean;
    vec3 conic;
    // Of the quadratic form on the ellipse, and the form's determinant.
    float level;
    float determinant;
    // Half the ellipse's extent in x.
    float half_width;
    // Rows of tiles, first and one past the last.
    int first;
    int end;
};

Reach reach_of(Projected splat, uvec2 tiles) {
    precise float level = 2.0 * log(splat.opacity / MIN_ALPHA);
    float determinant = splat.determinant;
    precise float half_width = sqrt(max(level * splat.conic.z / determinant, 0.0));
    precise float half_height = sqrt(max(level * splat.conic.x / determinant, 0.0));
    // Tile t has the pixel centres from 16 t + 0.5 to 16 t + 15.5.
    precise float top = (splat.mean.y - half_height - 15.5) / 16.0, bottom = (splat.mean.y + half_height - 0.5) / 16.0;
    int first = int(clamp(ceil(top), 0.0, float(tiles.y))), end = int(clamp(floor(bottom) + 1.0, 0.0, float(tiles.y)));
    if (!(splat.opacity >= MIN_ALPHA)) end = first;
    return Reach(splat.mean, splat.conic, level, determinant, half_width, first, end);
}

// Tiles of a row, first and one past the last.
ivec2 tiles_in_row(Reach reach, int row, uvec2 tiles) {
    float from = float(row) * 16.0 + 0.5 - reach.mean.y, to = from + 15.0;
    // The ellipse is widest to the right at -turn, to the left at turn; cut by the band, at the nearest height inside it.
    precise float turn = reach.conic.y * reach.half_width / reach.conic.z;
    precise float at_right = clamp(-turn, from, to), at_left = clamp(turn, from, to);
    precise float right_root = sqrt(max(reach.level * reach.conic.x - reach.determinant * at_right * at_right, 0.0));
    precise float left_root = sqrt(max(reach.level * reach.conic.x - reach.determinant * at_left * at_left, 0.0));
    precise float right = reach.mean.x + (right_root - reach.conic.y * at_right) / reach.conic.x;
    precise float left = reach.mean.x - (left_root + reach.conic.y * at_left) / reach.conic.x;
    // A hundredth of a pixel for what rounding takes.
    precise float first = (left - 15.51) / 16.0, last = (right - 0.49) / 16.0;
    int begin = int(clamp(ceil(first), 0.0, float(tiles.x))), end = int(clamp(floor(last) + 1.0, 0.0, float(tiles.x)));
    return ivec2(begin, max(end, begin));
}
