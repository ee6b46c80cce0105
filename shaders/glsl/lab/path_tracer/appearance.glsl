// What scenes that are photographed are made of; src/lab/path_tracer/layout.rs has the same.

const uint NONE = 0xffffffffu;
const float PI = 3.14159265358979;

struct Vertex {
    vec3 normal;  // zero: the triangle's own
    uint colour;  // RGBA8, linear
    vec4 tangent;
    vec2 uv0;
    vec2 uv1;
};

// Triangles lie in the order of the hierarchy's leaves, as `primitives` do.
struct Face {
    uint a;
    uint b;
    uint c;
    uint material;
    uint light;  // its number among the lights, or NONE
};

const uint ALPHA_MASK = 1, ALPHA_BLEND = 2, DOUBLE_SIDED = 4, UNLIT = 8, VOLUME = 16;

struct Material {
    vec3 base;
    float alpha;
    vec3 emission;
    float cutoff;
    vec3 absorption;
    float ior;
    vec3 specular_colour;
    float specular;
    vec3 sheen;
    float sheen_roughness;
    float metallic;
    float roughness;
    float transmission;
    float clearcoat;
    float clearcoat_roughness;
    float normal_scale;
    float clearcoat_normal_scale;
    uint flags;
    uint base_map;
    uint metallic_roughness_map;
    uint normal_map;
    uint emission_map;
    uint transmission_map;
    uint clearcoat_map;
    uint clearcoat_roughness_map;
    uint clearcoat_normal_map;
    uint sheen_map;
    uint sheen_roughness_map;
    uint specular_map;
    uint specular_colour_map;
    uint glass;  // where its table of a refracting interface's albedo begins
    uint spare0;
    uint spare1;
    uint spare2;
};

const uint SECOND_SET = 1, SRGB = 2, WRAP_U = 2, WRAP_V = 4;

struct Map {
    vec3 row0;  // image coordinates from (u, v, 1)
    uint offset;
    vec3 row1;
    uint flags;
    uint width;
    uint height;
    uint spare0;
    uint spare1;
};

const uint LIGHT_TRIANGLE = 0, LIGHT_POINT = 1, LIGHT_DIRECTIONAL = 2, LIGHT_SKY = 3;

struct Light {
    vec3 position;
    uint kind;
    vec3 direction;
    uint slot;  // the triangle, or the environment's texel
    vec3 colour;
    float range;
    float cone_scale;
    float cone_offset;
    float share;     // chance to be chosen among the lights
    uint threshold;  // words above it choose the other light in its place
    uint other;
    uint spare0;
    uint spare1;
    uint spare2;
};

struct Setting {
    uint sky_width;  // 0: no environment
    uint sky_height;
    uint lights;
    float sky_share;  // chance that a light is looked for in the environment
    float radius;     // of the scene about the origin
    uint compact;     // with a light map: sources too small for it, which lie after the other lights
    float sky_limit;  // with a light map: what is brighter in the environment is such a source
};

// A side of a triangle in the light map; fronts and backs take turns.
struct Side {
    uint first;   // its first patch
    uint splits;  // its edges are cut into so many parts, and it into their square of patches
};

// A part of a side that is cut into cells of one size.
struct Patch {
    uint cells;    // its first cell
    uint corners;  // its first corner of cells
    uint rows;     // its edges are cut into so many parts
    float share;   // of the rays that a cell of usual size gets, for each of its cells
    uint side;
};

// What the rays of a cell have brought.
struct Sum {
    vec3 direct;     // irradiance of sources that are not compact
    float squares;   // of the luma of that
    vec3 bounced;    // irradiance of what reflects widely
    float nearness;  // one over the distance of what is met
    vec3 compact;    // irradiance of compact sources
    float rays;
    float halves;    // luma of `direct` of even rays less that of odd ones
    float spare0;
    float spare1;
    float spare2;
};
