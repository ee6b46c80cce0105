// Paths in a scene with a light map. Light that scatters widely is read off the map, but where that is off: there it is followed to the
// next hit. What mirrors, glass and glossy surfaces show is followed. Needs what photograph.comp has, shared/sequence.glsl,
// lightmap.glsl, the binding `cells`, the push constant `seed`, and two functions of the stage: `arriving_light`, the map's light at
// a place of a patch, with that of compact sources where nobody looks for it, and `is_followed`, whether what a camera sees there
// must not be read off the map.

// Hits of a path at most, and the first after which it may end by chance.
const uint MAX_HITS = 32;
const uint SURE_HITS = 4;
// Lobes with wider slopes scatter in all directions as far as later hits are concerned.
const float MIRROR = 0.03;
// At what a camera sees, or a surface that it sees is lit by, only wider lobes that reflect little are as good as diffuse.
const float DULL = 0.4;
const float DULL_ALBEDO = 0.2;
// Lobes are at least as wide where a later hit throws a sun's light.
const float WIDENED = 0.15;
// A path goes on with this many times the chance of what its lobes reflect: at what a camera sees, and later.
const float SEEN_CHANCE = 32.0;
const float LATER_CHANCE = 2.0;

struct Path {
    vec3 origin;
    vec3 direction;
    vec3 light;     // found so far, of sources
    vec3 bounced;   // and off the map
    vec3 left;      // what passes of light that is yet to be found
    float density;  // of the direction, by solid angle
    float alpha;
    float reach;    // of the first ray
    uint hits;
    uint own;       // the triangle that the ray starts from
    bool looked;    // whether lights were looked for where it starts
    bool seen;      // whether only mirrors lie between the camera and where it is
    bool sky;       // whether the environment counts where nothing is hit at all
    bool dim;       // whether compact sources do not count where they are met
    bool soft;      // whether it comes from a surface whose diffuse light is looked for
};

// A surface without its diffuse lobes, and without those that are named.
Surface remaining(Surface s, bool reflection, bool coat) {
    s.diffuse = vec3(0.0);
    s.p_diffuse = 0.0;
    s.sheen = vec3(0.0);
    s.p_sheen = 0.0;
    if (!reflection) {
        s.metallic = 0.0;
        s.f0 = vec3(0.0);
        s.f90 = 0.0;
        s.p_spec = 0.0;
    }
    if (!coat) s.p_coat = 0.0;
    return s;
}

// What diffuse lobes and sheen reflect in all.
vec3 matte_albedo(Surface s) {
    float most = max(s.sheen.r, max(s.sheen.g, s.sheen.b));
    vec3 sheen = most > 0.0 ? s.sheen * ((1.0 - s.below_sheen) / most) : vec3(0.0);
    return s.below_coat * (s.below_sheen * s.diffuse + sheen);
}

vec2 uniform_pair(uint item, uint number, uint dimension) {
    uvec2 words = sequence_pair(seed, item, number, dimension);
    return vec2(uniform_of(words.x), uniform_of(words.y));
}

// Light of a source at a hit, scattered to `wo`.
vec3 looked_for(Surface s, Hit hit, vec3 place, vec3 wo, uint item, uint number, uint dimension, bool compact) {
    uvec2 a = sequence_pair(seed, item, number, dimension), b = sequence_pair(seed, item, number, dimension + 1);
    uvec4 others = pcg4d(uvec4(seed, item, number, dimension));
    Lit lit = light_towards(place, uvec4(a.x, a.y, others.x, 0), uvec4(b, 0, 0), compact);
    if (lit.reach <= 0.0) return vec3(0.0);
    vec4 through = scattered(s, wo, lit.towards);
    if (max(through.r, max(through.g, through.b)) <= 0.0) return vec3(0.0);
    vec3 start = beside(hit, place, dot(lit.towards, s.side) > 0.0 ? s.side : -s.side);
    float share = passing(start, lit.towards, lit.reach, hit.slot, lit.slot);
    return through.rgb * lit.light * (share * (lit.density > 0.0 ? weight(lit.density, through.w) : 1.0));
}

// Follows a path to its next hit; `item` and `number` key its random numbers. False where it ends there.
bool extend(inout Path path, uint item, uint number) {
    uint k = path.hits++;
    if (k == MAX_HITS) return false;
    Hit hit = closest(path.origin, path.direction, path.own, uvec3(seed ^ 0x9e3779b9u, item, number * MAX_HITS + k), true);
    if (hit.t >= MISS) {
        if (k == 0 && !path.sky) return false;
        path.alpha = 1.0;
        if (setting[0].sky_width == 0) return false;
        // Compact parts of the environment have been looked for where others have.
        vec4 found = sky_from(path.direction, path.looked || path.dim ? setting[0].sky_limit : MISS);
        path.light += path.left * found.rgb * (path.looked ? weight(path.density, found.w) : 1.0);
        return false;
    }
    path.alpha = 1.0;
    if (k == 0) path.reach = hit.t;
    vec3 wo = -path.direction, emission;
    bool front;
    Surface s = surface_at(hit, wo, emission, front);
    Face face = faces[hit.slot];
    uint flags = materials[face.material].flags;
    if (!front && (flags & VOLUME) != 0) path.left *= exp(-hit.t * materials[face.material].absorption);
    if (max(emission.r, max(emission.g, emission.b)) > 0.0) {
        float other = path.looked ? light_density(face.light, hit.slot, hit.t, abs(dot(s.side, wo))) : 0.0;
        path.light += path.left * emission * (path.looked && face.light != NONE ? weight(path.density, other) : 1.0);
        if ((flags & UNLIT) != 0) return false;
    }
    vec3 place = primitives[3 * hit.slot].xyz + hit.at.x * primitives[3 * hit.slot + 1].xyz
        + hit.at.y * primitives[3 * hit.slot + 2].xyz;

    vec3 matte = matte_albedo(s);
    bool early = path.seen || path.soft;
    bool reflection = s.alpha <= MIRROR || (early && (s.alpha <= DULL || luma(s.glossy) > DULL_ALBEDO));
    bool coat = early || s.coat_alpha <= MIRROR;
    if (!reflection) matte += s.below_coat * s.below_sheen * s.glossy;
    if (!coat) matte += 1.0 - s.below_coat;
    bool followed = false;
    if (max(matte.r, max(matte.g, matte.b)) > 0.0) {
        vec2 at = hit.at;
        Patch own = patches[patch_at(hit.slot, front, at)];
        followed = path.seen && is_followed(own, at);
        if (!followed) path.bounced += path.left * matte * arriving_light(own, at, path.seen) / PI;
    }

    Surface rest = s;
    if (!followed) rest = remaining(s, reflection, coat);
    float chance = rest.p_diffuse + rest.p_sheen + rest.p_coat + rest.p_spec + rest.p_thin + rest.p_glass;
    float goes_on = min((path.seen ? SEEN_CHANCE : LATER_CHANCE) * s.albedo * chance, 1.0);
    vec2 picks = uniform_pair(item, number, 8 * k + 3);
    bool ends = !(chance > 0.0) || picks.y >= goes_on;
    if (!ends) {
        rest.p_diffuse /= chance;
        rest.p_sheen /= chance;
        rest.p_coat /= chance;
        rest.p_spec /= chance;
        rest.p_thin /= chance;
        rest.p_glass /= chance;
    }
    path.looked = !ends && path.seen && is_wide(rest);
    bool compact = setting[0].compact > 0 && (path.seen || is_wide(rest));
    // One call in a loop: drivers put a copy of the whole search in the place of every call.
    for (uint which = 0; which < 2; ++which) {
        bool of_compact = which == 0;
        if (of_compact ? !compact : !path.looked) continue;
        Surface own = rest;
        if (of_compact && path.seen) {
            own = s;
        } else if (of_compact) {
            // Later hits have compact sources' light in the map, but for what lobes throw of it that are followed. Narrow ones are widened,
            // since what they throw is met too seldom (Kaplanyan and Dachsbacher 2013). What passes sheets and glass is met by chance.
            own.alpha = max(own.alpha, WIDENED);
            own.coat_alpha = max(own.coat_alpha, WIDENED);
            own.p_thin = 0.0;
            own.p_glass = 0.0;
        }
        float of_all = of_compact ? 1.0 : goes_on;
        path.light += path.left / of_all * looked_for(own, hit, place, wo, item, number, 8 * k + (of_compact ? 1 : 4), of_compact);
    }
    if (ends) return false;
    path.left /= goes_on;
    path.soft = path.looked && followed;
    path.seen = path.seen && !path.looked;

    vec3 wi = sampled(rest, wo, vec4(uniform_pair(item, number, 8 * k + 6), picks.x, uniform_pair(item, number, 8 * k + 7).x));
    if (dot(wi, wi) == 0.0) return false;
    vec4 through = scattered(rest, wo, wi);
    if (!(through.w > 0.0)) return false;
    path.left *= through.rgb / through.w;
    path.density = through.w;
    float most = max(path.left.r, max(path.left.g, path.left.b));
    if (!(most > 0.0)) return false;
    if (k >= SURE_HITS) {
        float survives = min(most, 0.95);
        if (random4(seed, item, number, 8 * k + 8).x >= survives) return false;
        path.left /= survives;
    }
    path.origin = beside(hit, place, dot(wi, s.side) > 0.0 ? s.side : -s.side);
    path.direction = normalize(wi);
    path.own = hit.slot;
    // What curved mirrors throw of a sun on walls is not in the map; what glass lets through is.
    path.dim = path.dim || (!path.seen && dot(wi, s.side) > 0.0);
    return true;
}

// Light that is a number: a weight of 0 times a density beyond single precision is none.
vec3 sound(vec3 light) {
    return dot(light, vec3(1.0)) < 1e30 ? light : vec3(0.0);
}
