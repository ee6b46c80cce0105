// What the stages of Gaussian splatting share: the camera, a projected Gaussian, the planes that parameters lie in.
// Twin of all formulas: src/splats/twin.

layout(constant_id = 0) const bool ANTIALIASED = false;

// A camera in the training frame. Rows of the camera-from-world rotation, with the translation in w.
struct View {
    vec4 row_x;
    vec4 row_y;
    vec4 row_z;
    vec3 position;
    float near;
    vec2 focal;
    vec2 principal;
    uint width;
    uint height;
    uint spare0;
    uint spare1;
};

// A Gaussian as a view sees it: centre in pixels, inverse covariance (xx, xy, yy) in pixels^-2 and its determinant, opacity
// with the loss by antialiasing, sRGB colour, depth along the optical axis. An opacity of zero: not seen.
struct Projected {
    vec2 mean;
    float depth;
    float opacity;
    vec3 conic;
    float determinant;
    vec3 colour;
    uint spare0;
};

// Planes of the parameters: value `plane` of Gaussian `i` is at `plane * stride + i`.
const uint CENTRE = 0;
const uint LOG_SCALE = 3;
const uint ROTATION = 6;
const uint OPACITY = 10;
const uint HARMONICS = 11;

const float MIN_ALPHA = 1.0 / 255.0;
const float MAX_ALPHA = 0.99;
const float MIN_TRANSMITTANCE = 1e-4;
// Variance in pixels^2 that every projection is widened by: of 3DGS, and of Mip-Splatting (Yu et al. 2024), where opacities make up
// for it.
const float LOW_PASS = 0.3;
const float MIP_LOW_PASS = 0.1;

float low_pass() {
    return ANTIALIASED ? MIP_LOW_PASS : LOW_PASS;
}

// Pixels of a tile along a side, and in all; instances between two checkpoints of the transmittance.
const uint TILE = 16;
const uint TILE_PIXELS = TILE * TILE;
const uint BLOCK = 128;

// Tiles of a picture in x and y.
uvec2 tiles_of(View view) {
    return (uvec2(view.width, view.height) + TILE - 1) / TILE;
}

#include "shared/sigmoid.glsl"

// Rotation matrix of a unit quaternion (w, x, y, z).
mat3 rotation_of(vec4 q) {
    float w = q.x, x = q.y, y = q.z, z = q.w;
    return mat3(
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
        2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
        2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
    );
}

// Camera-from-world rotation.
mat3 rotation_of(View view) {
    return transpose(mat3(view.row_x.xyz, view.row_y.xyz, view.row_z.xyz));
}

// A centre in camera axes.
vec3 to_camera(View view, vec3 centre) {
    vec4 p = vec4(centre, 1.0);
    return vec3(dot(view.row_x, p), dot(view.row_y, p), dot(view.row_z, p));
}

// Where a ray lies outside the picture by more than this, the projection is linearised at the limit: x/z and y/z.
vec2 clamped_ray(View view, vec3 p) {
    vec2 size = vec2(view.width, view.height), margin = 0.15 * size / view.focal;
    return clamp(p.xy / p.z, -view.principal / view.focal - margin, (size - view.principal) / view.focal + margin);
}

// Rows of the projection's Jacobian times the camera's rotation.
void linearised(View view, vec3 p, vec2 ray, out vec3 m[2]) {
    m[0] = view.focal.x / p.z * (view.row_x.xyz - ray.x * view.row_z.xyz);
    m[1] = view.focal.y / p.z * (view.row_y.xyz - ray.y * view.row_z.xyz);
}

// The covariance in pixels^2 of what has the axes `x` and `y` in the picture's two directions.
struct Spread {
    // Before the low-pass: xx, xy, yy.
    vec3 narrow;
    // Determinants before and after it. From the cross product: products of variances would lose all digits of needles.
    float sharp;
    float determinant;
};

Spread spread_of(vec3 x, vec3 y) {
    vec3 across = cross(x, y), narrow = vec3(dot(x, x), dot(x, y), dot(y, y));
    float sharp = dot(across, across);
    float blur = low_pass();
    return Spread(narrow, sharp, sharp + blur * (narrow.x + narrow.z) + blur * blur);
}

// What the low-pass takes from the opacity: square root of the ratio of areas.
float compensation(Spread spread) {
    return sqrt(spread.sharp / spread.determinant);
}

// The base-2 logarithm of a Gaussian's alpha at `d` from its mean, before the cap. `form` is its conic, times -log2(e), halved on
// the diagonal; `peak` the logarithm of its opacity. `precise`, since several stages decide by this value what counts.
float log_alpha(vec2 d, vec3 form, float peak) {
    precise float power = peak + (form.x * d.x + form.y * d.y) * d.x + form.z * d.y * d.y;
    return power;
}

vec3 form_of(Projected splat) {
    return -1.44269504 * vec3(0.5, 1.0, 0.5) * splat.conic;
}

// log2(MIN_ALPHA)
const float MIN_LOG_ALPHA = -7.99435344;
