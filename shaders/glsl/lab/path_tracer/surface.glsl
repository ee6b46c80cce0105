// What a surface does with light at a hit: lobes, their values and samples. The formulas are those of glTF 2.0 and its
// extensions (Khronos, appendix B and KHR_materials_*); where these leave a choice, it is made so that no lobe gains or loses
// light: reflection is raised by what is scattered between microfacets (Turquin 2019, "Practical multiple scattering
// compensation for microfacet models"), and what lies below a layer is dimmed by the layer's albedo.

// Narrower slopes than this are a mirror to every eye.
const float MIN_ALPHA = 1e-3;
const float MIN_SHEEN_ALPHA = 5e-3;

struct Surface {
    vec3 n;     // shading frame; n is on the side that the path comes from
    vec3 t;
    vec3 b;
    vec3 side;  // the triangle's normal on that side
    float alpha;
    vec3 base;
    float metallic;
    vec3 metal_scale;
    vec3 f0;       // of the dielectric, straight ahead, with its share
    float f90;
    vec3 spec_scale;
    vec3 diffuse;
    vec3 glossy;   // what metal and dielectric reflect in all, below coat and sheen
    vec3 thin;     // passes a thin sheet
    float glass;   // share of a refracting interface
    float eta;     // its index beyond over the one on this side
    float glass_scale;
    vec3 coat_n;
    float coat;
    float coat_alpha;
    float coat_scale;
    vec3 sheen;
    float sheen_alpha;
    float below_coat;
    float below_sheen;
    float albedo;  // of all lobes, by luma
    float p_coat;  // chances of the lobes
    float p_sheen;
    float p_spec;
    float p_diffuse;
    float p_thin;
    float p_glass;
};

// Two directions that make a frame with `n`: Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
void frame_of(vec3 n, out vec3 t, out vec3 b) {
    float s = n.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (s + n.z), c = n.x * n.y * a;
    t = vec3(1.0 + s * n.x * n.x * a, s * c, -s * n.x);
    b = vec3(c, s + n.y * n.y * a, -n.y);
}

vec3 local(Surface s, vec3 w) {
    return vec3(dot(w, s.t), dot(w, s.b), dot(w, s.n));
}

float luma(vec3 c) {
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}

// What scattering between microfacets adds to reflection of `f0`, where single scattering leaves `single` of white.
vec3 raised(vec3 f0, float single) {
    return 1.0 + f0 * (1.0 - single) / single;
}

// A normal on the side of `wo`: one that faces away is turned just far enough.
vec3 facing(vec3 n, vec3 wo) {
    float z = dot(n, wo);
    return z < 1e-3 ? normalize(n + (1e-3 - z) * wo) : n;
}

vec3 bumped(uint map, float scale, vec2 uv0, vec2 uv1, vec3 n, vec4 tangent) {
    vec3 t = tangent.xyz - n * dot(n, tangent.xyz);
    if (map == NONE || dot(t, t) < 1e-12) return n;
    t = normalize(t);
    vec3 m = 2.0 * map_at(map, uv0, uv1).xyz - 1.0;
    m.xy *= scale;
    return normalize(m.x * t + m.y * tangent.w * cross(n, t) + m.z * n);
}

// The surface at a hit of a ray against `wo`, and what it emits towards it. `front` is the side.
Surface surface_at(Hit hit, vec3 wo, out vec3 emission, out bool front) {
    Surface s;
    Face face = faces[hit.slot];
    Material m = materials[face.material];
    vec2 uv0 = uv0_at(face, hit.at), uv1 = uv1_at(face, hit.at);
    vec3 weights = vec3(1.0 - hit.at.x - hit.at.y, hit.at);
    vec3 own = normalize(cross(primitives[3 * hit.slot + 1].xyz, primitives[3 * hit.slot + 2].xyz));
    front = dot(own, wo) >= 0.0;
    s.side = front ? own : -own;
    vec3 n = weights.x * vertices[face.a].normal + weights.y * vertices[face.b].normal + weights.z * vertices[face.c].normal;
    n = dot(n, n) > 1e-6 ? normalize(n) : own;
    vec4 tangent =
        weights.x * vertices[face.a].tangent + weights.y * vertices[face.b].tangent + weights.z * vertices[face.c].tangent;
    tangent.w = tangent.w < 0.0 ? -1.0 : 1.0;
    float turn = front ? 1.0 : -1.0;
    vec3 bump = turn * bumped(m.normal_map, m.normal_scale, uv0, uv1, n, tangent);
    s.n = facing(bump, wo);
    frame_of(s.n, s.t, s.b);
    s.base = m.base * colour_at(face, hit.at).rgb * map_or_one(m.base_map, uv0, uv1).rgb;
    emission = m.emission * map_or_one(m.emission_map, uv0, uv1).rgb;
    if (!front && (m.flags & DOUBLE_SIDED) == 0) emission = vec3(0.0);
    if ((m.flags & UNLIT) != 0) emission = s.base;

    vec4 metallic_roughness = map_or_one(m.metallic_roughness_map, uv0, uv1);
    s.metallic = m.metallic * metallic_roughness.b;
    float roughness = m.roughness * metallic_roughness.g;
    s.alpha = max(roughness * roughness, MIN_ALPHA);
    float transmission = m.transmission * map_or_one(m.transmission_map, uv0, uv1).r;
    bool volume = (m.flags & VOLUME) != 0 && m.glass != NONE;
    float z = dot(s.n, wo);
    float single = table_at(GGX_TABLE, z, s.alpha), grazing = table_at(GGX_GRAZING_TABLE, z, s.alpha);
    float white = single + grazing;

    // A refracting body takes its share from the opaque dielectric altogether, a thin sheet from its diffuse part only.
    float dielectric = (1.0 - s.metallic) * (volume ? 1.0 - transmission : 1.0);
    float f = (m.ior - 1.0) / (m.ior + 1.0);
    float specular = m.specular * map_or_one(m.specular_map, uv0, uv1).a;
    vec3 colour = m.specular_colour * map_or_one(m.specular_colour_map, uv0, uv1).rgb;
    s.f0 = min(f * f * colour, vec3(1.0)) * specular;
    s.f90 = specular;
    s.spec_scale = raised(s.f0, white);
    vec3 reflected = min((s.f0 * single + s.f90 * grazing) * s.spec_scale, vec3(1.0));
    s.metal_scale = raised(s.base, white);
    vec3 metal = (s.base * single + grazing) * s.metal_scale;
    s.diffuse = dielectric * (volume ? 1.0 : 1.0 - transmission) * (1.0 - reflected) * s.base;
    s.thin = volume ? vec3(0.0) : dielectric * transmission * (1.0 - reflected) * s.base / white;
    s.glass = volume ? (1.0 - s.metallic) * transmission : 0.0;
    s.eta = front ? m.ior : 1.0 / m.ior;
    s.glass_scale = 1.0;
    if (s.glass > 0.0) s.glass_scale = 1.0 / table_at(m.glass + (front ? 0 : TABLE * TABLE), z, s.alpha);
    s.f0 *= dielectric;
    s.f90 *= dielectric;
    reflected *= dielectric;
    s.glossy = s.metallic * metal + reflected;

    s.coat = m.clearcoat * map_or_one(m.clearcoat_map, uv0, uv1).r;
    s.below_coat = 1.0;
    s.coat_n = s.n;
    s.coat_alpha = MIN_ALPHA;
    s.coat_scale = 0.0;
    if (s.coat > 0.0) {
        float rough = m.clearcoat_roughness * map_or_one(m.clearcoat_roughness_map, uv0, uv1).g;
        s.coat_alpha = max(rough * rough, MIN_ALPHA);
        vec3 own_n = turn * bumped(m.clearcoat_normal_map, m.clearcoat_normal_scale, uv0, uv1, n, tangent);
        s.coat_n = facing(own_n, wo);
        float cz = dot(s.coat_n, wo);
        float c_single = table_at(GGX_TABLE, cz, s.coat_alpha), c_grazing = table_at(GGX_GRAZING_TABLE, cz, s.coat_alpha);
        s.coat_scale = s.coat * raised(vec3(0.04), c_single + c_grazing).x;
        s.below_coat = 1.0 - s.coat_scale * (0.04 * c_single + c_grazing);
    }
    s.sheen = m.sheen * map_or_one(m.sheen_map, uv0, uv1).rgb;
    float most = max(s.sheen.r, max(s.sheen.g, s.sheen.b));
    s.below_sheen = 1.0;
    s.sheen_alpha = 1.0;
    if (most > 0.0) {
        float rough = m.sheen_roughness * map_or_one(m.sheen_roughness_map, uv0, uv1).a;
        s.sheen_alpha = max(rough * rough, MIN_SHEEN_ALPHA);
        s.below_sheen = 1.0 - most * table_at(SHEEN_TABLE, z, s.sheen_alpha);
    }

    float below = s.below_coat * s.below_sheen;
    s.p_coat = 1.0 - s.below_coat;
    s.p_sheen = s.below_coat * (1.0 - s.below_sheen);
    s.p_spec = below * luma(s.glossy);
    s.p_diffuse = below * luma(s.diffuse);
    s.p_thin = below * luma(s.thin) * white;
    s.p_glass = below * s.glass;
    float all = s.p_coat + s.p_sheen + s.p_spec + s.p_diffuse + s.p_thin + s.p_glass;
    s.albedo = all;
    float scale = all > 0.0 ? 1.0 / all : 0.0;
    s.p_coat *= scale;
    s.p_sheen *= scale;
    s.p_spec *= scale;
    s.p_diffuse *= scale;
    s.p_thin *= scale;
    s.p_glass *= scale;
    return s;
}

// Whether any lobe is wide enough for a light to be looked for.
bool is_wide(Surface s) {
    return s.p_diffuse + s.p_sheen > 0.0 || s.alpha > 2e-3 || (s.p_coat > 0.0 && s.coat_alpha > 2e-3);
}

// Light scattered from `wi` to `wo` by the surface, times the cosine of `wi`, and the density with which `wi` is sampled.
vec4 scattered(Surface s, vec3 wo, vec3 wi) {
    vec3 o = local(s, wo), i = local(s, wi);
    vec3 f = vec3(0.0);
    float pdf = 0.0, below = s.below_coat * s.below_sheen;
    float a = s.alpha;
    if (i.z > 0.0 && dot(wi, s.side) > 0.0) {
        vec3 h = normalize(o + i);
        float d = ggx(h, a), v = visibility(o.z, i.z, a), seen = smith(o.z, a) * d / (4.0 * o.z);
        float cosine = dot(o, h), m = schlick(cosine);
        vec3 metal = s.metallic * (s.base + (1.0 - s.base) * m) * s.metal_scale;
        vec3 dielectric = (s.f0 + (s.f90 - s.f0) * m) * s.spec_scale;
        f += below * d * v * i.z * (metal + dielectric);
        f += below * i.z / PI * s.diffuse;
        pdf += s.p_spec * seen + s.p_diffuse * i.z / PI;
        if (s.p_glass > 0.0) {
            float r = fresnel(cosine, s.eta);
            f += below * s.glass * s.glass_scale * r * d * v * i.z;
            pdf += s.p_glass * r * seen;
        }
        if (s.p_sheen > 0.0) {
            f += s.below_coat * sheen_lobe(o, i, s.sheen_alpha) * i.z * s.sheen;
            pdf += s.p_sheen / (2.0 * PI);
        }
    }
    if (i.z < 0.0 && dot(wi, s.side) < 0.0) {
        if (s.p_thin > 0.0) {
            vec3 mirrored = vec3(i.xy, -i.z);
            vec3 h = normalize(o + mirrored);
            float d = ggx(h, a);
            f += below * d * visibility(o.z, mirrored.z, a) * mirrored.z * s.thin;
            pdf += s.p_thin * smith(o.z, a) * d / (4.0 * o.z);
        }
        if (s.p_glass > 0.0) {
            // Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces".
            vec3 h = normalize(o + s.eta * i);
            h = h.z < 0.0 ? -h : h;
            float ho = dot(h, o), hi = dot(h, i);
            if (ho > 0.0 && hi < 0.0) {
                float root = ho + s.eta * hi;
                float through = 1.0 - fresnel(ho, s.eta);
                float seen = smith(o.z, a) * ggx(h, a) * ho * -hi * s.eta * s.eta / (o.z * root * root) * through;
                f += below * s.glass * s.glass_scale * seen * smith(-i.z, a) * s.base;
                pdf += s.p_glass * seen;
            }
        }
    }
    if (s.p_coat > 0.0) {
        vec3 t, b;
        frame_of(s.coat_n, t, b);
        vec3 co = vec3(dot(wo, t), dot(wo, b), dot(wo, s.coat_n)), ci = vec3(dot(wi, t), dot(wi, b), dot(wi, s.coat_n));
        if (ci.z > 0.0 && dot(wi, s.side) > 0.0) {
            vec3 h = normalize(co + ci);
            float d = ggx(h, s.coat_alpha);
            f += s.coat_scale * (0.04 + 0.96 * schlick(dot(co, h))) * d * visibility(co.z, ci.z, s.coat_alpha) * ci.z;
            pdf += s.p_coat * smith(co.z, s.coat_alpha) * d / (4.0 * co.z);
        }
    }
    return vec4(f, pdf);
}

// A direction for light to come from; zero where the lobe that was drawn sends nothing.
vec3 sampled(Surface s, vec3 wo, vec4 u) {
    vec3 o = local(s, wo), i;
    float pick = u.z;
    if (pick < s.p_coat) {
        vec3 t, b;
        frame_of(s.coat_n, t, b);
        vec3 co = vec3(dot(wo, t), dot(wo, b), dot(wo, s.coat_n));
        i = reflect(-co, sample_facet(co, s.coat_alpha, u.xy));
        vec3 wi = i.x * t + i.y * b + i.z * s.coat_n;
        return i.z > 0.0 && dot(wi, s.side) > 0.0 ? wi : vec3(0.0);
    }
    pick -= s.p_coat;
    if (pick < s.p_diffuse) {
        float r = sqrt(u.x), turn = 2.0 * PI * u.y;
        i = vec3(r * cos(turn), r * sin(turn), sqrt(1.0 - u.x));
    } else if (pick < s.p_diffuse + s.p_sheen) {
        float r = sqrt(1.0 - u.x * u.x), turn = 2.0 * PI * u.y;
        i = vec3(r * cos(turn), r * sin(turn), u.x);
    } else {
        pick -= s.p_diffuse + s.p_sheen;
        vec3 h = sample_facet(o, s.alpha, u.xy);
        bool through = pick >= s.p_spec + s.p_thin && s.p_glass > 0.0 && u.w >= fresnel(dot(o, h), s.eta);
        i = through ? refract(-o, h, 1.0 / s.eta) : reflect(-o, h);
        // What ends up on the wrong side is light lost between microfacets; another lobe must not take it for its own.
        if (through == (i.z >= 0.0)) return vec3(0.0);
        if (!through && pick >= s.p_spec && pick < s.p_spec + s.p_thin) i.z = -i.z;
    }
    return i.x * s.t + i.y * s.b + i.z * s.n;
}
