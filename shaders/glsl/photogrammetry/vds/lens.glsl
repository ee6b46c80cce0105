// Posed lenses with distortion. Twin: `Distortion` and `Lens` in src/scene/lens.rs; made by
// src/visibility/lens_view.rs.

struct LensView {
    vec3 position;
    float limit;       // radius |(x/z, y/z)| past which directions are outside the lens
    vec3 right;        // the image's axes, unit length
    float fov;         // the FOV model's angle; zero for every other
    vec3 down;
    uint fisheye;      // 1: the radius is an angle
    vec3 forward;
    uint after_radial; // 1: tangential and prism terms are taken of the radially distorted point
    vec2 focal;        // pixels
    vec2 principal;
    vec2 size;         // of the image, in pixels
    vec2 tangential;
    vec4 prism;
    vec3 rational;
    float division;    // the division model's k; zero for every other
    float radial[6];
    float unified[2];  // alpha and beta of the enhanced unified model; zero for every other
};

// (u, v) before distortion to what the pinhole is applied to.
vec2 lens_distort(LensView view, vec2 p) {
    float r = length(p);
    float turned = 1.0;
    if (r > 1e-6 && view.fisheye != 0) turned = atan(r) / r;
    else if (r > 1e-6 && view.fov > 0.0) turned = atan(2.0 * r * tan(0.5 * view.fov)) / (r * view.fov);
    else if (view.division != 0.0) turned = 2.0 / (1.0 + sqrt(max(1.0 - 4.0 * view.division * r * r, 0.0)));
    else if (view.unified[0] != 0.0) {
        turned = 1.0 / (view.unified[0] * sqrt(1.0 + view.unified[1] * r * r) + 1.0 - view.unified[0]);
    }
    p *= turned;
    float r2 = dot(p, p);
    float above = 0.0;
    for (int k = 5; k >= 0; --k) above = (above + view.radial[k]) * r2;
    float below = ((view.rational.z * r2 + view.rational.y) * r2 + view.rational.x) * r2;
    vec2 bent = (1.0 + above) / (1.0 + below) * p;
    float p1 = view.tangential.x, p2 = view.tangential.y;
    vec2 q = p, tangent;
    if (view.after_radial != 0) {
        q = bent;
        r2 = dot(q, q);
        tangent = 2.0 * dot(q, view.tangential) * q + r2 * view.tangential;
    } else {
        tangent = vec2(2.0 * p1 * q.x * q.y + p2 * (r2 + 2.0 * q.x * q.x), 2.0 * p2 * q.x * q.y + p1 * (r2 + 2.0 * q.y * q.y));
    }
    return bent + tangent + r2 * (view.prism.xz + r2 * view.prism.yw);
}

// Pixel of a point; false behind the camera, where the lens bends no light to, and outside the image.
bool lens_pixel(LensView view, vec3 point, out vec2 pixel) {
    vec3 off = point - view.position;
    float z = dot(off, view.forward);
    vec2 flat_ = vec2(dot(off, view.right), dot(off, view.down)) / z;
    pixel = vec2(0.0);
    if (!(z > 0.0 && length(flat_) <= view.limit)) return false;
    pixel = view.focal * lens_distort(view, flat_) + view.principal;
    return all(greaterThanEqual(pixel, vec2(0.0))) && all(lessThan(pixel, view.size));
}
