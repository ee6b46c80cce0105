// How the view dependency of a probe varies with direction, in the planner's frame: scale times 1 + g.w + w'Mw. Twin:
// src/visibility/probe_lobe.rs.
struct Lobe {
    vec3 linear;        // g
    float scale;        // makes the mean over the reachable directions 1
    vec3 diagonal;      // of M
    float spare0;
    vec3 off_diagonal;  // M_xy, M_xz, M_yz
    float spare1;
};

float lobe_at(Lobe lobe, vec3 w) {
    float f = 1.0 + dot(lobe.linear, w) + dot(lobe.diagonal, w * w)
        + 2.0 * dot(lobe.off_diagonal, vec3(w.x * w.y, w.x * w.z, w.y * w.z));
    return lobe.scale * max(f, 0.0);
}
