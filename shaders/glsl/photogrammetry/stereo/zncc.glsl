// How alike a window of one view and its image in a neighbour are, where a plane carries the one to the other.
// Needs `views`, `pairs` and `pictures`. Twin: src/photogrammetry/stereo/cost.rs.

// Neighbours of a view at most.
const uint MAX_PAIRS = 4;
// Half a window; of its pixels every other one is compared, as on a chequerboard.
const int RADIUS = 3;
const float TAPS = 25.0;
// Added to the sums of squares: about the noise of shrunk 8-bit pictures. Where there is no texture, nothing matches.
const float NOISE = 3e-4;
// Cost of what cannot be compared; matches cost 0 to 2.
const float NO_MATCH = 4.0;

// Brightness of a pixel; the picture is clamped at its edge.
float brightness(uint first, uint width, uint height, ivec2 pixel) {
    ivec2 p = clamp(pixel, ivec2(0), ivec2(width, height) - 1);
    return pictures[first + uint(p.y) * width + uint(p.x)];
}

// Brightness between pixels.
float sampled(uint first, uint width, uint height, vec2 pixel) {
    vec2 at = clamp(pixel, vec2(0.0), vec2(width, height)) - 0.5;
    vec2 low = floor(at), part = at - low;
    ivec2 p = ivec2(low);
    float upper = mix(brightness(first, width, height, p), brightness(first, width, height, p + ivec2(1, 0)), part.x);
    float lower = mix(brightness(first, width, height, p + ivec2(0, 1)), brightness(first, width, height, p + ivec2(1, 1)), part.x);
    return mix(upper, lower, part.y);
}

// Where a pixel with an inverse depth is in the neighbour; z is positive in front of it.
vec3 carried(StereoPair pair, vec2 q, float w) {
    vec3 at = vec3(q, 1.0);
    vec3 x = vec3(dot(pair.row_x, at) + pair.shift_x * w, dot(pair.row_y, at) + pair.shift_y * w, dot(pair.row_z, at) + pair.shift_z * w);
    return vec3(x.xy / x.z, x.z);
}

// 1 - ZNCC from sums over a window: of the reference, its squares, the neighbour, its squares, the products.
float dissimilarity(float a, float aa, float b, float bb, float ab) {
    float va = max(aa - a * a / TAPS, 0.0) + NOISE, vb = max(bb - b * b / TAPS, 0.0) + NOISE;
    return 1.0 - (ab - a * b / TAPS) * inversesqrt(va * vb);
}

// A window of the reference view: its pixels less their middle one, their sum and the sum of their squares.
struct Window {
    float own[25];
    float around;
    float sum;
    float squares;
};

Window window(StereoView view, ivec2 pixel) {
    Window w;
    w.around = brightness(view.first, view.width, view.height, pixel);
    w.sum = 0.0;
    w.squares = 0.0;
    int tap = 0;
    for (int y = -RADIUS; y <= RADIUS; ++y) {
        for (int x = -RADIUS + ((y + RADIUS) & 1); x <= RADIUS; x += 2) {
            float own = brightness(view.first, view.width, view.height, pixel + ivec2(x, y)) - w.around;
            w.own[tap++] = own;
            w.sum += own;
            w.squares += own * own;
        }
    }
    return w;
}

// Cost of a plane (slope of inverse depth, inverse depth) at pixel `centre`, whose window is `w`: the mean over the better
// half of the neighbours, since an occlusion spoils the others only.
float plane_cost(StereoView view, uint reference, vec2 centre, vec3 plane, Window w) {
    float best = NO_MATCH, second = NO_MATCH;
    uint compared = 0;
    for (uint n = 0; n < view.pairs; ++n) {
        StereoPair pair = pairs[MAX_PAIRS * reference + n];
        vec3 at = carried(pair, centre, plane.z);
        if (at.z <= 0.0 || !in_picture(views[pair.view], at.xy)) continue;
        uint first = views[pair.view].first, width = views[pair.view].width, height = views[pair.view].height;
        float b = 0.0, bb = 0.0, ab = 0.0;
        int tap = 0;
        for (int y = -RADIUS; y <= RADIUS; ++y) {
            for (int x = -RADIUS + ((y + RADIUS) & 1); x <= RADIUS; x += 2) {
                vec2 off = vec2(x, y);
                float other = sampled(first, width, height, carried(pair, centre + off, plane.z + dot(plane.xy, off)).xy) - w.around;
                b += other;
                bb += other * other;
                ab += w.own[tap++] * other;
            }
        }
        float cost = dissimilarity(w.sum, w.squares, b, bb, ab);
        second = min(second, max(best, cost));
        best = min(best, cost);
        ++compared;
    }
    // Of at most four neighbours the better half is one or two.
    return compared > 2 ? 0.5 * (best + second) : best;
}
