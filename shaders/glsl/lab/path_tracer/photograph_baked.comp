#version 450
#extension GL_GOOGLE_include_directive : require
// Adds samples to the pixels of a photograph of a scene with a light map. Each pixel has one thread, which sums its samples in
// their order, and ends once their spread says that a picture of eight bits would not show its error.
#include "shared/group.glsl"
#include "shared/random.glsl"
#include "shared/sequence.glsl"
#include "shared/bvh.glsl"
#include "lab/path_tracer/appearance.glsl"
layout(local_size_x = 64) in;

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
    float gain;     // exposure as a factor of radiance
    uint least;     // samples of a pixel at least
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
layout(binding = 14, std430) readonly buffer Cells { vec4 cells[]; };  // irradiance of compact sources; w: 1 where light is followed
layout(binding = 15, std430) readonly buffer Corners { vec4 corners[]; };  // irradiance of all else
layout(binding = 16, std430) buffer Exposure { vec4 exposure[]; };
layout(binding = 17, std430) buffer Spread { vec2 spread[]; };  // squares of the samples' luma, and their number
#include "lab/path_tracer/maps.glsl"
#include "lab/path_tracer/hit.glsl"
#include "lab/path_tracer/microfacet.glsl"
#include "lab/path_tracer/surface.glsl"
#include "lab/path_tracer/light.glsl"
#include "lab/path_tracer/lightmap.glsl"

// The map's light at a place of a patch: linear between the corners of its cell. At what a camera sees compact sources are looked
// for, elsewhere they are in the cells.
vec3 arriving_light(Patch own, vec2 at, bool seen) {
    vec2 within = at;
    vec3 compact = seen || setting[0].compact == 0 ? vec3(0.0) : cells[own.cells + part_at(own.rows, within)].rgb;
    vec2 scaled = clamp(at, 0.0, 1.0) * float(own.rows);
    uint j = min(uint(scaled.y), own.rows - 1), i = min(uint(scaled.x), own.rows - 1 - j);
    vec2 f = scaled - vec2(i, j);
    vec3 along = corners[own.corners + corner_at(own.rows, i + 1, j)].rgb;
    vec3 up = corners[own.corners + corner_at(own.rows, i, j + 1)].rgb;
    if (f.x + f.y > 1.0 && i + j + 1 < own.rows) {
        vec3 across = corners[own.corners + corner_at(own.rows, i + 1, j + 1)].rgb;
        return compact + (f.x + f.y - 1.0) * across + (1.0 - f.x) * up + (1.0 - f.y) * along;
    }
    return compact + max(1.0 - f.x - f.y, 0.0) * corners[own.corners + corner_at(own.rows, i, j)].rgb + f.x * along + f.y * up;
}

// Whether light is followed where a camera sees the place.
bool is_followed(Patch own, vec2 at) {
    return cells[own.cells + part_at(own.rows, at)].w > 0.0;
}
#include "lab/path_tracer/baked.glsl"

Path camera_path(uint pixel, uint number) {
    vec2 at = (vec2(pixel % width, pixel / width) + uniform_pair(pixel, number, 0) - principal) / focal;
    vec3 direction = normalize(at.x * right + at.y * down + forward);
    return Path(
        position, direction, vec3(0.0), vec3(0.0), vec3(1.0), 0.0, 0.0, MISS, 0, NONE, false, true, show_sky != 0, false, false);
}

// Error of a pixel, as a share of white, that a picture of eight bits does not show.
const float UNSEEN = 0.006;

// Whether the mean of so many samples is known well enough: by the slope of sRGB's curve, and not where it is white.
bool is_known(vec4 sum, vec2 of) {
    float mean = luma(sum.rgb) / of.y, variance = max(of.x / of.y - mean * mean, 0.0) / of.y;
    float level = gain * mean;
    float slope = level < 0.0031308 ? 12.92 : 0.4396 * pow(level, -0.58333);
    float error = slope * gain * sqrt(variance);
    return error <= UNSEEN || level - 2.0 * gain * sqrt(variance) > 1.1;
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= count) return;
    uint pixel = first + i;
    vec4 sum = first_sample == 0 ? vec4(0.0) : exposure[pixel];
    vec2 of = first_sample == 0 ? vec2(0.0) : spread[pixel];
    uint number = first_sample, last = first_sample + samples;
    // A pixel that was known before has fewer samples. It is asked when their number has doubled, however they are dispatched.
    uint times = first_sample / least;
    bool doubled = times > 0 && times * least == first_sample && (times & (times - 1)) == 0;
    if (uint(of.y) < first_sample || (doubled && is_known(sum, of))) return;
    Path path = camera_path(pixel, number);
    // One loop over the hits of all samples: a thread whose path has ended begins the next while others continue.
    while (number < last) {
        if (extend(path, pixel, number)) continue;
        vec3 light = sound(path.light) + sound(path.bounced);
        sum += vec4(light, path.alpha);
        of += vec2(luma(light) * luma(light), 1.0);
        path = camera_path(pixel, ++number);
    }
    // Where a device ends long loops, this is what the path has found so far.
    if (number < last) {
        sum += vec4(sound(path.light) + sound(path.bounced), path.alpha);
        of.y += 1.0;
    }
    exposure[pixel] = sum;
    spread[pixel] = of;
}
