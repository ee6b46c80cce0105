// Where cameras may be placed (region_types.glsl) and the free space of the voxel field. Needs the bindings `region` and
// `free_distance`. Twins: src/scene/region.rs (shape and floor) and src/scene/free_space.rs (the field), put together in
// src/visibility/device_scene.rs.

float free_space_at(ivec3 voxel) {
    uvec3 c = uvec3(clamp(voxel, ivec3(0), ivec3(region[0].grid_size) - 1));
    return free_distance[(c.z * region[0].grid_size.y + c.y) * region[0].grid_size.x + c.x];
}

// Distance to free space (xyz: its gradient) by trilinear interpolation; zero inside.
vec4 free_space(vec3 p) {
    vec3 g = (p - region[0].grid_origin) / region[0].cell;
    vec3 q = clamp(g, vec3(0.0), vec3(region[0].grid_size) - 1.001);
    ivec3 i = ivec3(floor(q));
    vec3 f = q - vec3(i);
    float c000 = free_space_at(i), c100 = free_space_at(i + ivec3(1, 0, 0));
    float c010 = free_space_at(i + ivec3(0, 1, 0)), c110 = free_space_at(i + ivec3(1, 1, 0));
    float c001 = free_space_at(i + ivec3(0, 0, 1)), c101 = free_space_at(i + ivec3(1, 0, 1));
    float c011 = free_space_at(i + ivec3(0, 1, 1)), c111 = free_space_at(i + ivec3(1, 1, 1));
    vec4 x0 = mix(vec4(c000, c010, c001, c011), vec4(c100, c110, c101, c111), f.x);
    vec2 y0 = mix(x0.xz, x0.yw, f.y);
    vec4 dx = vec4(c100, c110, c101, c111) - vec4(c000, c010, c001, c011);
    vec2 dx_y = mix(dx.xz, dx.yw, f.y);
    vec2 dy = x0.yw - x0.xz;
    vec3 gradient = vec3(mix(dx_y.x, dx_y.y, f.z), mix(dy.x, dy.y, f.z), y0.y - y0.x) / region[0].cell;
    return vec4(gradient, mix(y0.x, y0.y, f.z));
}

// Squared distances outside the shape, below the floor and from free space, and their gradient. The field is soft within a voxel of its edge, where the
// analytic shape is exact and the field is not.
float region_violation(vec3 p, out vec3 gradient) {
    vec3 outside;
    if (region[0].is_box != 0) {
        outside = p - clamp(p, region[0].box_min, region[0].box_max);
    } else {
        float r = length(p);
        outside = r > 1e-6 ? p * ((r - clamp(r, region[0].r_min, region[0].r_max)) / r) : vec3(0.0, 0.0, -region[0].r_min);
    }
    float below = min(p.z - region[0].floor_z, 0.0);
    float violation = dot(outside, outside) + below * below;
    outside.z += below;
    vec4 field = free_space(p);
    float deep = max(field.w - region[0].cell, 0.0);
    gradient = 2.0 * outside + 2.0 * deep * field.xyz;
    return violation + deep * deep;
}

bool region_contains(vec3 p) {
    bool inside = p.z >= region[0].floor_z;
    if (region[0].is_box != 0) {
        inside = inside && all(greaterThanEqual(p, region[0].box_min)) && all(lessThanEqual(p, region[0].box_max));
    } else {
        float r2 = dot(p, p);
        inside = inside && r2 >= region[0].r_min * region[0].r_min && r2 <= region[0].r_max * region[0].r_max;
    }
    return inside && free_space(p).w < 0.5 * region[0].cell;
}
