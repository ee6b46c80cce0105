// Textures: eight bits a channel in words, bilinear. Needs the bindings `maps` and `texels`.

int wrapped(int i, int n, uint mode) {
    if (mode == 1) return clamp(i, 0, n - 1);
    uint period = uint(mode == 2 ? 2 * n : n);
    // Coordinates are kept within 2^24 texels of the image, so the sum is positive.
    int at = int((uint(i) + (0x1000000u / period + 1) * period) % period);
    return at < n ? at : 2 * n - 1 - at;
}

vec4 texel_at(Map map, int x, int y) {
    int u = wrapped(x, int(map.width), map.flags >> WRAP_U & 3u), v = wrapped(y, int(map.height), map.flags >> WRAP_V & 3u);
    vec4 value = unpackUnorm4x8(texels[map.offset + uint(v) * map.width + uint(u)]);
    if ((map.flags & SRGB) != 0) {
        vec3 c = value.rgb;
        value.rgb = mix(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, lessThanEqual(c, vec3(0.04045)));
    }
    return value;
}

vec4 map_at(uint index, vec2 uv0, vec2 uv1) {
    Map map = maps[index];
    vec3 uv = vec3((map.flags & SECOND_SET) != 0 ? uv1 : uv0, 1.0);
    vec2 at = vec2(dot(map.row0, uv) * float(map.width), dot(map.row1, uv) * float(map.height)) - 0.5;
    at = clamp(at, vec2(-8388608.0), vec2(8388608.0));
    ivec2 i = ivec2(floor(at));
    vec2 f = at - floor(at);
    vec4 top = mix(texel_at(map, i.x, i.y), texel_at(map, i.x + 1, i.y), f.x);
    vec4 bottom = mix(texel_at(map, i.x, i.y + 1), texel_at(map, i.x + 1, i.y + 1), f.x);
    return mix(top, bottom, f.y);
}

// The same, or white where there is no map.
vec4 map_or_one(uint index, vec2 uv0, vec2 uv1) {
    return index == NONE ? vec4(1.0) : map_at(index, uv0, uv1);
}
