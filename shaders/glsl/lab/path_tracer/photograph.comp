#version 450
#extension GL_GOOGLE_include_directive : require
// Light that reaches the pixels of a photograph: a path a sample, traced from the camera (Kajiya 1986, "The Rendering
// Equation"), with lights looked for at every hit and both ways weighted by the power heuristic (Veach 1997). Samples are
// added to a pixel in their order, and every random number is a function of seed, pixel, sample and place in the path, so
// neither tiles nor batches show.
#include "shared/group.glsl"
#include "shared/random.glsl"
#include "shared/bvh.glsl"
#include "lab/path_tracer/appearance.glsl"
layout(local_size_x = 64) in;

// How lights are found: looked for at every hit, met by chance, or both.
const uint BOTH = 0, LIGHTS = 1, CHANCE = 2;
layout(constant_id = 0) const uint STRATEGY = BOTH;
layout(constant_id = 1) const bool COUNT_RAYS = false;  // whether rays are counted in place of alpha

layout(push_constant) uniform Push {
    vec3 position;
    uint first;  // pixel of the first thread
    vec3 right;
    uint count;  // pixels of this dispatch
    vec3 down;
    uint width;
    vec3 forward;
    uint seed;
    vec2 focal;
    vec2 principal;
    uint first_sample;
    uint samples;
    uint show_sky;  // 1: the environment is seen behind the scene
    float gain;     // as photograph_baked.comp has
    uint least;
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
layout(binding = 12, std430) buffer Exposure { vec4 exposure[]; };
#include "lab/path_tracer/maps.glsl"
#include "lab/path_tracer/hit.glsl"
#include "lab/path_tracer/microfacet.glsl"
#include "lab/path_tracer/surface.glsl"
#include "lab/path_tracer/light.glsl"

// Hits of a path at most, and the first after which it may end by chance.
const uint MAX_HITS = 64;
const uint SURE_HITS = 4;

// A path between two of its rays.
struct Path {
    vec3 origin;
    vec3 direction;
    vec3 light;     // found so far
    vec3 left;      // what passes of light that is yet to be found
    float density;  // of the direction, by solid angle
    float alpha;
    float rays;
    uint hits;
    uint own;       // the triangle that the ray starts from
    bool looked;    // whether lights were looked for at the last hit
};

Path camera_path(uint pixel, uint number) {
    vec4 jitter = random4(seed, pixel, number, 0);
    vec2 at = (vec2(pixel % width, pixel / width) + jitter.xy - principal) / focal;
    vec3 direction = normalize(at.x * right + at.y * down + forward);
    return Path(position, direction, vec3(0.0), vec3(1.0), 0.0, 0.0, 0.0, 0, NONE, false);
}

// Follows a path to its next hit. False where it ends there.
bool extend(inout Path path, uint pixel, uint number) {
    uint k = path.hits++;
    if (k == MAX_HITS) return false;
    Hit hit = closest(path.origin, path.direction, path.own, uvec3(seed ^ 0x9e3779b9u, pixel, number * MAX_HITS + k), true);
    path.rays += 1.0;
    if (hit.t >= MISS) {
        if (k == 0 && show_sky == 0) return false;
        path.alpha = 1.0;
        if (setting[0].sky_width == 0) return false;
        vec4 found = sky_from(path.direction, setting[0].sky_limit);
        float share = path.looked ? (STRATEGY == LIGHTS ? 0.0 : weight(path.density, found.w)) : 1.0;
        path.light += path.left * found.rgb * share;
        return false;
    }
    path.alpha = 1.0;
    vec3 wo = -path.direction, emission;
    bool front;
    Surface s = surface_at(hit, wo, emission, front);
    Face face = faces[hit.slot];
    uint flags = materials[face.material].flags;
    if (!front && (flags & VOLUME) != 0) path.left *= exp(-hit.t * materials[face.material].absorption);
    if (max(emission.r, max(emission.g, emission.b)) > 0.0) {
        float other = path.looked ? light_density(face.light, hit.slot, hit.t, abs(dot(s.side, wo))) : 0.0;
        bool twice = path.looked && face.light != NONE;
        path.light += path.left * emission * (twice ? (STRATEGY == LIGHTS ? 0.0 : weight(path.density, other)) : 1.0);
        if ((flags & UNLIT) != 0) return false;
    }
    vec3 place = primitives[3 * hit.slot].xyz + hit.at.x * primitives[3 * hit.slot + 1].xyz
        + hit.at.y * primitives[3 * hit.slot + 2].xyz;

    path.looked = STRATEGY != CHANCE && is_wide(s);
    uvec4 words = pcg4d(uvec4(seed, pixel, number, 4 * k + 1));
    if (path.looked || setting[0].lights > 0) {
        Lit lit = light_towards(place, words, pcg4d(uvec4(seed, pixel, number, 4 * k + 2)), false);
        // Lamps are met by no ray, whatever the strategy.
        if (lit.reach > 0.0 && (path.looked || lit.density == 0.0)) {
            vec4 through = scattered(s, wo, lit.towards);
            float most = max(through.r, max(through.g, through.b));
            if (most > 0.0) {
                bool twice = STRATEGY == BOTH && lit.density > 0.0;
                vec3 start = beside(hit, place, dot(lit.towards, s.side) > 0.0 ? s.side : -s.side);
                float share = passing(start, lit.towards, lit.reach, hit.slot, lit.slot);
                path.rays += 1.0;
                path.light += path.left * through.rgb * lit.light * (share * (twice ? weight(lit.density, through.w) : 1.0));
            }
        }
    }

    vec3 wi = sampled(s, wo, random4(seed, pixel, number, 4 * k + 3));
    if (dot(wi, wi) == 0.0) return false;
    vec4 through = scattered(s, wo, wi);
    if (!(through.w > 0.0)) return false;
    path.left *= through.rgb / through.w;
    path.density = through.w;
    float most = max(path.left.r, max(path.left.g, path.left.b));
    if (!(most > 0.0)) return false;
    if (k >= SURE_HITS) {
        float survives = min(most, 0.95);
        if (random4(seed, pixel, number, 4 * k + 4).x >= survives) return false;
        path.left /= survives;
    }
    path.origin = beside(hit, place, dot(wi, s.side) > 0.0 ? s.side : -s.side);
    path.direction = normalize(wi);
    path.own = hit.slot;
    return true;
}

// What a path adds to its pixel.
vec4 found_by(Path path) {
    // A weight of 0 times a density beyond single precision is no light.
    vec3 light = dot(path.light, vec3(1.0)) < 1e30 ? path.light : vec3(0.0);
    return vec4(light, COUNT_RAYS ? path.rays : path.alpha);
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= count) return;
    uint pixel = first + i;
    vec4 sum = first_sample == 0 ? vec4(0.0) : exposure[pixel];
    uint number = first_sample, last = first_sample + samples;
    Path path = camera_path(pixel, number);
    // One loop over the hits of all samples: a thread whose path has ended begins the next while others continue.
    while (number < last) {
        if (extend(path, pixel, number)) continue;
        sum += found_by(path);
        path = camera_path(pixel, ++number);
    }
    // Where a device ends long loops, this is what the path has found so far.
    if (number < last) sum += found_by(path);
    exposure[pixel] = sum;
}
