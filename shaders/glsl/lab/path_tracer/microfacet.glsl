// Microfacets in the frame of the surface, whose normal is +Z. Twin, for the tables: src/lab/path_tracer/albedo.rs.

// GGX's density of slopes; written with the slopes themselves, so that narrow lobes keep their digits.
float ggx(vec3 h, float alpha) {
    vec3 scaled = vec3(h.xy / alpha, h.z);
    float squared = dot(scaled, scaled);
    return 1.0 / (PI * alpha * alpha * squared * squared);
}

// Smith's share of microfacets that are seen from a direction.
float smith(float z, float alpha) {
    return 2.0 * z / (z + sqrt(alpha * alpha + (1.0 - alpha * alpha) * z * z));
}

// Share that is seen from both, over 4 z z'; height-correlated.
float visibility(float z, float other, float alpha) {
    float a = alpha * alpha;
    return 0.5 / (other * sqrt(a + (1.0 - a) * z * z) + z * sqrt(a + (1.0 - a) * other * other));
}

// A microfacet's normal among those seen from `o`: Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical
// Caps".
vec3 sample_facet(vec3 o, float alpha, vec2 u) {
    vec3 wide = normalize(vec3(alpha * o.xy, o.z));
    float turn = 2.0 * PI * u.x;
    float z = (1.0 - u.y) * (1.0 + wide.z) - wide.z;
    float s = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    vec3 h = vec3(s * cos(turn), s * sin(turn), z) + wide;
    return normalize(vec3(alpha * h.xy, max(h.z, 0.0)));
}

// Reflection at a smooth dielectric; `eta` is the index beyond over the index on this side.
float fresnel(float cosine, float eta) {
    float beyond = 1.0 - (1.0 - cosine * cosine) / (eta * eta);
    if (beyond <= 0.0) return 1.0;
    float t = sqrt(beyond);
    float s = (cosine - eta * t) / (cosine + eta * t), p = (eta * cosine - t) / (eta * cosine + t);
    return 0.5 * (s * s + p * p);
}

float schlick(float cosine) {
    float m = clamp(1.0 - cosine, 0.0, 1.0);
    return m * m * m * m * m;
}

// Masking of cloth's fibres: Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF".
float sheen_curve(float x, float alpha) {
    float q = (1.0 - alpha) * (1.0 - alpha);
    float a = mix(21.5473, 25.3245, q), b = mix(3.82987, 3.32435, q), c = mix(0.19823, 0.16801, q);
    float d = mix(-1.97760, -1.27393, q), e = mix(-4.32054, -4.85967, q);
    return a / (1.0 + b * pow(x, c)) + d * x + e;
}

float sheen_lambda(float cosine, float alpha) {
    float z = min(cosine, 1.0);
    return exp(z < 0.5 ? sheen_curve(z, alpha) : 2.0 * sheen_curve(0.5, alpha) - sheen_curve(1.0 - z, alpha));
}

// The sheen's reflection of white cloth: Charlie's distribution with that masking.
float sheen_lobe(vec3 o, vec3 i, float alpha) {
    vec3 h = normalize(o + i);
    float sine = length(h.xy);
    float d = (2.0 + 1.0 / alpha) * pow(sine, 1.0 / alpha) / (2.0 * PI);
    return d / ((1.0 + sheen_lambda(o.z, alpha) + sheen_lambda(i.z, alpha)) * 4.0 * o.z * i.z);
}

// Tables over the root of the cosine and over roughness, both in [0, 1]: see src/lab/path_tracer/albedo.rs. Needs `albedo`.
const uint TABLE = 32;

float table_at(uint offset, float z, float alpha) {
    vec2 at = clamp(vec2(sqrt(max(z, 0.0)), sqrt(alpha)), 0.0, 1.0) * float(TABLE - 1);
    uvec2 i = min(uvec2(at), uvec2(TABLE - 2));
    vec2 f = at - vec2(i);
    uint low = offset + i.y * TABLE + i.x, high = low + TABLE;
    return mix(mix(albedo[low], albedo[low + 1], f.x), mix(albedo[high], albedo[high + 1], f.x), f.y);
}

const uint GGX_TABLE = 0, GGX_GRAZING_TABLE = TABLE * TABLE, SHEEN_TABLE = 2 * TABLE * TABLE;
