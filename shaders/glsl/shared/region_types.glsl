// Where cameras may be placed: a shell about the origin or a box, above a floor.
struct DeviceRegion {
    vec3 box_min;
    uint is_box;
    vec3 box_max;
    float r_min;
    vec3 grid_origin;  // of the centre of voxel 0
    float r_max;
    uvec3 grid_size;
    float cell;
    float floor_z;
    float spare0;
    float spare1;
    float spare2;
};

