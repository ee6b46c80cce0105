// What the loss's stages share: photos as they are stored, and the window of SSIM. Included after the workgroup's size.

// A pixel that the photo does not show; `UNKNOWN` in splats/data/undistort.rs.
const uint UNKNOWN = 0x00ffffffu;

// Colour of a stored pixel (8 bits each of red, green, blue and straight alpha, red lowest) over a background.
vec3 over(uint stored, vec3 background) {
    vec4 v = unpackUnorm4x8(stored);
    return mix(background, v.xyz, v.w);
}

// Gaussian of standard deviation 1.5, cut off at 5 pixels and normalised.
const int RADIUS = 5;
const float WINDOW[11] = float[](
    0.0010283801, 0.0075987581, 0.0360007721, 0.1093606895, 0.2130055377, 0.2660117249, 0.2130055377, 0.1093606895,
    0.0360007721, 0.0075987581, 0.0010283801
);
const float C1 = 1e-4;
const float C2 = 9e-4;

// Share of L1 in the loss; the rest is 1 - SSIM.
const float L1_SHARE = 0.8;

// A tile with what the window reaches around it.
const uint HALO = TILE + 2 * RADIUS;
// A thread has so many pixels, side by side in the window's first pass and one below the other in its second: what it reads
// from shared memory serves all of them.
const uint THREADS = gl_WorkGroupSize.x;
const uint RUN = TILE_PIXELS / THREADS;
const uint RUNS = TILE / RUN;
const uint REACH = RUN + 2 * RADIUS;
