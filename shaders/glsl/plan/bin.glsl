// What the binned pass shares: 8 x 8 texels to a tile, and where a splat's kernel ends.

const uint TILE = 8;
const uint TILES_WIDE = RESOLUTION / TILE;
const uint TILES = TILES_WIDE * TILES_WIDE;

// Cosine and sine of the angle from the splat's direction at which its kernel is cut off (KERNEL_CUTOFF).
vec2 cut_off(float scale, float d) {
    if (KERNEL == ANGULAR) {
        float c = max(1.0 - KERNEL_CUTOFF * scale * scale, -1.0);
        return vec2(c, sqrt(max(1.0 - c * c, 0.0)));
    }
    float s = min(sqrt(2.0 * KERNEL_CUTOFF) * scale / d, 1.0);
    return vec2(sqrt(1.0 - s * s), s);
}

// Does the cone about unit direction `n` with cosine and sine `cut` reach into a tile, bounded by a cone with its axis in
// xyz and its half angle's cosine in w? A little generous, so that rounding loses no texel.
bool reaches(vec3 n, vec2 cut, vec4 tile) {
    float tile_sin = sqrt(max(1.0 - tile.w * tile.w, 0.0));
    // The angles add up to half a turn or more: everything is reached.
    if (cut.y * tile.w + cut.x * tile_sin <= 0.0) return true;
    return dot(n, tile.xyz) >= cut.x * tile.w - cut.y * tile_sin - 1e-5;
}

// Texel, row-major in the image, of texel `k` of a tile.
uint tile_texel(uint tile, uint k) {
    uvec2 corner = TILE * uvec2(tile % TILES_WIDE, tile / TILES_WIDE);
    return (corner.y + k / TILE) * RESOLUTION + corner.x + k % TILE;
}
