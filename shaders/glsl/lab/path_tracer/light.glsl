// Where light comes from: emitting triangles, lamps and the environment. Needs the bindings `lights`, `sky`, `aliases` and
// `setting`, and what hit.glsl needs.

float uniform_of(uint word) {
    return float(word >> 8u) * 5.9604644775390625e-8;
}

// A texel of the environment, no brighter than a limit.
vec4 sky_texel(int texel, float limit) {
    vec4 found = sky[texel];
    found.rgb *= min(1.0, limit / max(max(found.r, max(found.g, found.b)), 1e-30));
    return found;
}

// Of two ways to the same light, the weight of the one with density `own` (Veach 1997, the power heuristic).
float weight(float own, float other) {
    float ratio = other / own;
    return 1.0 / (1.0 + ratio * ratio);
}

// Radiance of the environment, and as the fourth the density with which its place is sampled, by area of the map:
// bilinear between texels' centres, around the map and clamped at the poles.
vec4 sky_at(vec2 uv, float limit) {
    int w = int(setting[0].sky_width), h = int(setting[0].sky_height);
    vec2 at = uv * vec2(w, h) - 0.5;
    ivec2 i = clamp(ivec2(floor(at)), ivec2(-1), ivec2(w, h) - 1);
    vec2 f = at - floor(at);
    int x0 = (i.x + w) % w, x1 = (i.x + 1 + w) % w, y0 = clamp(i.y, 0, h - 1), y1 = clamp(i.y + 1, 0, h - 1);
    vec4 top = mix(sky_texel(y0 * w + x0, limit), sky_texel(y0 * w + x1, limit), f.x);
    return mix(top, mix(sky_texel(y1 * w + x0, limit), sky_texel(y1 * w + x1, limit), f.x), f.y);
}

// Radiance from a direction, and the density by solid angle with which it is sampled.
vec4 sky_from(vec3 w, float limit) {
    vec4 found = sky_at(vec2(0.5 + atan(w.z, w.x) / (2.0 * PI), atan(length(w.xz), w.y) / PI), limit);
    found.w *= setting[0].sky_share / (2.0 * PI * PI * max(length(w.xz), 1e-6));
    return found;
}

// Density by solid angle with which the place of a hit on an emitting triangle is sampled from `distance` away.
float light_density(uint light, uint slot, float distance, float cosine) {
    if (light == NONE) return 0.0;
    float area = 0.5 * length(cross(primitives[3 * slot + 1].xyz, primitives[3 * slot + 2].xyz));
    return (1.0 - setting[0].sky_share) * lights[light].share * distance * distance / (area * max(cosine, 1e-6));
}

// The tent over [-1, 1] from a uniform number.
float tent(float u) {
    return u < 0.5 ? sqrt(2.0 * u) - 1.0 : 1.0 - sqrt(2.0 - 2.0 * u);
}

struct Lit {
    vec3 towards;
    float reach;   // how far the ray must pass
    vec3 light;    // radiance, or a lamp's equivalent, over the chance
    float density; // by solid angle; 0 for lamps, which no ray meets
    uint slot;     // the triangle that gives it, or NONE
};

// The direction of a place on the environment's map, in texels; past a pole the map's row is met again.
vec3 sky_direction(vec2 at) {
    vec2 uv = at / vec2(setting[0].sky_width, setting[0].sky_height);
    uv.y = uv.y < 0.0 ? -uv.y : (uv.y > 1.0 ? 2.0 - uv.y : uv.y);
    float polar = PI * uv.y, turn = 2.0 * PI * (uv.x - 0.5);
    return vec3(sin(polar) * cos(turn), cos(polar), sin(polar) * sin(turn));
}

// Light at a place from one source, drawn from the words `a` and `b`: from the compact ones, or from all others. A reach of 0 means
// that there is none.
Lit light_towards(vec3 from, uvec4 a, uvec4 b, bool compact) {
    Lit lit = Lit(vec3(0.0, 1.0, 0.0), 0.0, vec3(0.0), 0.0, NONE);
    float sky_share = compact ? 0.0 : setting[0].sky_share;
    if (uniform_of(a.x) < sky_share) {
        // Walker's alias method: each texel has a threshold and another texel.
        uint w = setting[0].sky_width, texels = w * setting[0].sky_height, index, low;
        umulExtended(a.y, texels, index, low);
        uvec2 alias = aliases[index];
        if (a.z > alias.x) index = alias.y;
        vec2 at = vec2(index % w, index / w) + 0.5 + vec2(tent(uniform_of(b.x)), tent(uniform_of(b.y)));
        lit.towards = sky_direction(at);
        vec4 found = sky_from(lit.towards, setting[0].sky_limit);
        lit.density = found.w;
        if (found.w > 0.0) {
            lit.light = found.rgb / found.w;
            lit.reach = MISS;
        }
        return lit;
    }
    uint first = compact ? setting[0].lights : 0, count = compact ? setting[0].compact : setting[0].lights;
    if (count == 0) return lit;
    uint chosen, low;
    umulExtended(a.y, count, chosen, low);
    chosen += first;
    if (a.z > lights[chosen].threshold) chosen = first + lights[chosen].other;
    Light light = lights[chosen];
    float chance = (1.0 - sky_share) * light.share;
    if (light.kind == LIGHT_TRIANGLE) {
        float r = sqrt(uniform_of(b.x)), v = uniform_of(b.y);
        vec2 at = vec2(r * (1.0 - v), r * v);
        vec3 v0 = primitives[3 * light.slot].xyz;
        vec3 e1 = primitives[3 * light.slot + 1].xyz, e2 = primitives[3 * light.slot + 2].xyz;
        vec3 to = v0 + at.x * e1 + at.y * e2 - from, n = cross(e1, e2);
        float distance = length(to), twice_area = length(n);
        lit.towards = to / distance;
        float cosine = -dot(lit.towards, n) / twice_area;
        Face face = faces[light.slot];
        uint flags = materials[face.material].flags;
        if (distance == 0.0 || cosine == 0.0 || (cosine < 0.0 && (flags & DOUBLE_SIDED) == 0)) return lit;
        vec3 emitted = materials[face.material].emission
            * map_or_one(materials[face.material].emission_map, uv0_at(face, at), uv1_at(face, at)).rgb;
        if (has_alpha(light.slot)) emitted *= opacity(light.slot, at);
        lit.density = light_density(chosen, light.slot, distance, abs(cosine));
        lit.light = emitted / lit.density;
        // A light at the same place is not blocked.
        lit.reach = distance * (1.0 - 4e-6);
        lit.slot = light.slot;
    } else if (light.kind == LIGHT_SKY) {
        // A texel's share of a bilinear map is a tent, which is sampled as it is.
        uint w = setting[0].sky_width;
        lit.towards = sky_direction(vec2(light.slot % w, light.slot / w) + 0.5 + vec2(tent(uniform_of(b.x)), tent(uniform_of(b.y))));
        float texel = 2.0 * PI * PI / float(w * setting[0].sky_height);
        lit.light = light.colour * (texel * length(lit.towards.xz) / chance);
        lit.reach = MISS;
    } else if (light.kind == LIGHT_DIRECTIONAL) {
        lit.towards = -light.direction;
        lit.light = light.colour / chance;
        lit.reach = MISS;
    } else {
        vec3 to = light.position - from;
        float distance = length(to);
        if (distance == 0.0) return lit;
        lit.towards = to / distance;
        float cone = clamp(-dot(lit.towards, light.direction) * light.cone_scale + light.cone_offset, 0.0, 1.0);
        float far = distance / light.range;
        float fade = clamp(1.0 - far * far * far * far, 0.0, 1.0);
        lit.light = light.colour * cone * cone * fade / (distance * distance * chance);
        lit.reach = distance;
    }
    return lit;
}
