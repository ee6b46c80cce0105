// Posed pictures and how pixels of one map to another. Pixel (0, 0) is the corner of the picture: centres are at halves.
// Twin: src/photogrammetry/stereo/frame.rs.
struct StereoView {
    vec3 across;  // unprojection: centre + z (across x + along y + corner) is the point of pixel (x, y) at depth z
    uint width;
    vec3 along;
    uint height;
    vec3 corner;
    uint first;  // place of its first pixel in the buffers of all views
    vec3 centre;
    uint pairs;  // neighbours
    vec3 row_x;  // projection: (row_x . p + shift_x, row_y . p + shift_y) / (row_z . p + shift_z) is the pixel of point p,
    float shift_x;
    vec3 row_y;
    float shift_y;
    vec3 row_z;  // and the denominator its depth
    float shift_z;
    float near;  // depths that are searched
    float far;
    uint spare0;
    uint spare1;
};

// How pixels of a view map to a neighbour: pixel q with inverse depth w is at (row_x . (q, 1) + shift_x w,
// row_y . (q, 1) + shift_y w) / (row_z . (q, 1) + shift_z w).
struct StereoPair {
    vec3 row_x;
    float shift_x;
    vec3 row_y;
    float shift_y;
    vec3 row_z;
    float shift_z;
    uint view;  // the neighbour
    uint spare0;
    uint spare1;
    uint spare2;
};

vec3 unproject(StereoView view, vec2 pixel, float depth) {
    return view.centre + depth * (pixel.x * view.across + pixel.y * view.along + view.corner);
}

// Pixel and depth of a point.
vec3 project(StereoView view, vec3 p) {
    float depth = dot(view.row_z, p) + view.shift_z;
    return vec3(vec2(dot(view.row_x, p) + view.shift_x, dot(view.row_y, p) + view.shift_y) / depth, depth);
}

bool in_picture(StereoView view, vec2 pixel) {
    return all(greaterThanEqual(pixel, vec2(0.0))) && all(lessThan(pixel, vec2(view.width, view.height)));
}
