// What the binned pass shares: 8 x 8 texels to a tile, and where a splat's kernel ends.

const uint TILE = 8;
const uint TILES_WIDE = RESOLUTION / TILE;
const uint TILES = TILES_WIDE * TILES_WIDE;

// Cosine and sine of the angle from the splat's direction at which its kernel is cut off (KERNEL_CUTOFF).
vec2 cut_off(float scale, float d) {
    if (KERNEL == ANGULAR) {
        precise float c = max(1.0 - KERNEL_CUTOFF * scale * scale, -1.0);
        precise float sine = sqrt(max(1.0 - c * c, 0.0));
        return vec2(c, sine);
    }
    precise float s = min(sqrt(2.0 * KERNEL_CUTOFF) * scale / d, 1.0);
    precise float cosine = sqrt(1.0 - s * s);
    return vec2(cosine, s);
}

// A splat as a probe sees it: its unit direction, and where its kernel is cut off.
struct Disc {
    vec3 n;
    vec2 cut;
};

// Here and in `reaches` everything is `precise`: two stages must count the same, so that a driver may not contract one differently.
Disc disc_of(vec3 centre, vec3 probe, float log_scale) {
    precise vec3 ray = centre - probe;
    precise float square = ray.x * ray.x + ray.y * ray.y + ray.z * ray.z;
    precise float d = max(sqrt(square), 1e-6);
    precise vec3 n = ray / d;
    return Disc(n, cut_off(exp(log_scale), d));
}

// Does the disc reach into a tile, bounded by a cone with its axis in xyz and its half angle's cosine in w? A little generous, so that
// rounding loses no texel.
bool reaches(Disc disc, vec4 tile) {
    precise float tile_sin = sqrt(max(1.0 - tile.w * tile.w, 0.0));
    // The angles add up to half a turn or more: everything is reached.
    precise float sum = disc.cut.y * tile.w + disc.cut.x * tile_sin;
    if (sum <= 0.0) return true;
    precise float apart = disc.n.x * tile.x + disc.n.y * tile.y + disc.n.z * tile.z;
    precise float least = disc.cut.x * tile.w - disc.cut.y * tile_sin - 1e-5;
    return apart >= least;
}

// Texel, row-major in the image, of texel `k` of a tile.
uint tile_texel(uint tile, uint k) {
    uvec2 corner = TILE * uvec2(tile % TILES_WIDE, tile / TILES_WIDE);
    return (corner.y + k / TILE) * RESOLUTION + corner.x + k % TILE;
}
