// Whether a point is in the hull. Needs `hull` and the push constants origin, cell, cells_x, cells_y, cells_z; without a
// hull (no cells) every point is. Twin: src/photogrammetry/stereo/hull.rs.
bool in_hull(vec3 p) {
    if (cells_x == 0) return true;
    vec3 at = floor((p - origin) / cell);
    // Written so that NaN is outside.
    if (!(all(greaterThanEqual(at, vec3(0.0))) && all(lessThan(at, vec3(cells_x, cells_y, cells_z))))) return false;
    uvec3 voxel = uvec3(at);
    return hull[(voxel.z * cells_y + voxel.y) * cells_x + voxel.x] != 0;
}
