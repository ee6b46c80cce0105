// Linear dispatches: the host lays more than 65,535 workgroups out in x and y (linear_groups in recorder.rs).
uint group_index() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}
