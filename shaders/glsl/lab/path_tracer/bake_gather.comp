#version 450
#extension GL_GOOGLE_include_directive : require
// Adds rays to the cells of the light map: light that arrives at a place of the cell from a direction drawn by the cosine, and from a
// source that is looked for (irradiance by Veach 1997, the power heuristic). Light that what is met reflects widely is what the map
// has so far, so a ray is one bounce of all light.
// Held by: `tests/library/lab/lightmap.rs`, known answers.
#include "shared/group.glsl"
#include "shared/random.glsl"
#include "shared/sequence.glsl"
#include "shared/bvh.glsl"
#include "lab/path_tracer/appearance.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint first;      // cell of the first thread
    uint count;      // cells of this dispatch
    uint seed;
    uint first_ray;  // of a cell of usual size
    uint rays;
    uint anew;       // 1: sums begin anew where a ray is added
    float tolerance; // error of direct light, relative to all light, from which a cell needs no more rays
    uint least;      // rays below which nothing is said of a cell's error
};

layout(binding = 0, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 1, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 2, std430) readonly buffer Vertices { Vertex vertices[]; };
layout(binding = 3, std430) readonly buffer Faces { Face faces[]; };
layout(binding = 4, std430) readonly buffer Materials { Material materials[]; };
layout(binding = 5, std430) readonly buffer Maps { Map maps[]; };
layout(binding = 6, std430) readonly buffer Texels { uint texels[]; };
layout(binding = 7, std430) readonly buffer Lights { Light lights[]; };
layout(binding = 8, std430) readonly buffer Sky { vec4 sky[]; };
layout(binding = 9, std430) readonly buffer Aliases { uvec2 aliases[]; };
layout(binding = 10, std430) readonly buffer Albedo { float albedo[]; };
layout(binding = 11, std430) readonly buffer SettingBlock { Setting setting[]; };
layout(binding = 12, std430) readonly buffer Sides { Side sides[]; };
layout(binding = 13, std430) readonly buffer Patches { Patch patches[]; };
layout(binding = 14, std430) readonly buffer Cells { vec4 cells[]; };  // irradiance, of all sources
layout(binding = 15, std430) readonly buffer Owners { uint owners[]; };  // the patch of each cell
layout(binding = 16, std430) buffer Sums { Sum sums[]; };
#include "lab/path_tracer/maps.glsl"
#include "lab/path_tracer/hit.glsl"
#include "lab/path_tracer/microfacet.glsl"
#include "lab/path_tracer/surface.glsl"
#include "lab/path_tracer/light.glsl"
#include "lab/path_tracer/lightmap.glsl"

// All light, as far as it is known; nothing is seen by a camera here.
vec3 arriving_light(Patch own, vec2 at, bool seen) {
    return cells[own.cells + part_at(own.rows, at)].rgb;
}

// No camera sees anything here.
bool is_followed(Patch own, vec2 at) {
    return false;
}
#include "lab/path_tracer/baked.glsl"

// Even and odd rays have sequences of their own, so that their difference tells the error of their mean.
uvec2 ray_words(uint cell, uint number, uint dimension) {
    return sequence_pair(seed, cell, number / 2, 0x10000 + 16 * (number & 1) + dimension);
}

vec2 ray_pair(uint cell, uint number, uint dimension) {
    uvec2 words = ray_words(cell, number, dimension);
    return vec2(uniform_of(words.x), uniform_of(words.y));
}

bool is_known(Sum sum, float least) {
    float n = sum.rays;
    if (n < max(least, 2.0)) return false;
    float direct = luma(sum.direct) / n, all = direct + luma(sum.bounced) / n;
    float variance = max(sum.squares / n - direct * direct, 0.0) / n;
    return variance <= tolerance * tolerance * all * all;
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= count) return;
    uint cell = first + i;
    Patch own_patch = patches[owners[cell]];
    // Cells smaller than usual have a part of the rays, the first at least.
    uint begin = uint(ceil(float(first_ray) * own_patch.share)), end = uint(ceil(float(first_ray + rays) * own_patch.share));
    if (anew != 0) {
        begin = first_ray;
        end = first_ray + uint(ceil(float(rays) * own_patch.share));
    }
    Sum sum = sums[cell];
    // Small cells have as small a part of the rays below which nothing is said.
    if (end <= begin || (anew == 0 && is_known(sum, own_patch.share * float(least)))) return;
    if (anew != 0) sum = Sum(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0.0, 0.0, 0.0);

    uint slot = own_patch.side / 2, part = owners[cell] - sides[own_patch.side].first, splits = sides[own_patch.side].splits;
    bool front = (own_patch.side & 1) == 0;
    vec3 v0 = primitives[3 * slot].xyz, e1 = primitives[3 * slot + 1].xyz, e2 = primitives[3 * slot + 2].xyz;
    vec3 own = normalize(cross(e1, e2));
    vec3 side = front ? own : -own;
    Face face = faces[slot];
    // One loop over the hits of all rays: a thread whose path has ended begins the next while others continue.
    uint number = begin;
    Path path;
    bool lives = false;
    vec3 direct = vec3(0.0);
    while (number < end) {
        if (!lives) {
            vec2 u = ray_pair(cell, number, 0);
            if (u.x + u.y > 1.0) u = 1.0 - u;
            vec2 at = place_in_part(splits, part, place_in_part(own_patch.rows, cell - own_patch.cells, u));
            vec3 n = (1.0 - at.x - at.y) * vertices[face.a].normal + at.x * vertices[face.b].normal + at.y * vertices[face.c].normal;
            n = dot(n, n) > 1e-6 ? normalize(n) : own;
            // The shading normal on this side, as surfaces that are seen from here have it.
            n = front ? n : -n;
            vec3 place = v0 + at.x * e1 + at.y * e2;
            vec3 start = beside(Hit(0.0, slot, at), place, side);
            direct = vec3(0.0);
            for (uint compact = 0; compact < (setting[0].compact > 0 ? 2 : 1); ++compact) {
                uint dimension = 1 + 2 * compact;
                uvec2 a = ray_words(cell, number, dimension), b = ray_words(cell, number, dimension + 1);
                uint threshold = pcg4d(uvec4(seed, cell, number, 0x20000 + dimension)).x;
                Lit lit = light_towards(place, uvec4(a, threshold, 0), uvec4(b, 0, 0), compact == 1);
                float cosine = dot(n, lit.towards);
                if (lit.reach <= 0.0 || cosine <= 0.0 || dot(side, lit.towards) <= 0.0) continue;
                float share = cosine * passing(start, lit.towards, lit.reach, slot, lit.slot);
                if (lit.density > 0.0) share *= weight(lit.density, cosine / PI);
                if (share <= 0.0) continue;
                if (compact == 0) direct += share * lit.light;
                else sum.compact += share * lit.light;
            }
            u = ray_pair(cell, number, 5);
            float r = sqrt(u.x), turn = 2.0 * PI * u.y, z = sqrt(1.0 - u.x);
            vec3 t, b;
            frame_of(n, t, b);
            vec3 direction = r * cos(turn) * t + r * sin(turn) * b + z * n;
            path = Path(start, direction, vec3(0.0), vec3(0.0), vec3(1.0), z / PI, 0.0, MISS, 0, slot, true, false, true, false, true);
            lives = dot(direction, side) > 0.0 && z > 0.0;
        } else {
            lives = extend(path, cell, number);
        }
        if (lives) continue;
        direct += PI * sound(path.light);
        sum.direct += direct;
        sum.squares += luma(direct) * luma(direct);
        sum.halves += (number & 1) == 0 ? luma(direct) : -luma(direct);
        sum.bounced += PI * sound(path.bounced);
        sum.nearness += 1.0 / path.reach;
        sum.rays += 1.0;
        ++number;
    }
    sums[cell] = sum;
}
