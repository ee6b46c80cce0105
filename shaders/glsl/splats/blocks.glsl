// A tile in blocks of LANES pixels, eight wide, that as many threads work on side by side: its lanes. What does not reach a
// block costs its lanes nothing. Included after splats/bounds.glsl.
#extension GL_KHR_shader_subgroup_basic : require

// Threads that share a block: 8 or 32.
layout(constant_id = 3) const uint LANES = 8;
// Whether they are a subgroup. Where not, shared memory does what subgroups do, with the same result.
layout(constant_id = 4) const bool SUBGROUPS = false;

const uint WIDE = 8;
const uint HIGH = LANES / WIDE;
const uint BLOCKS = TILE_PIXELS / LANES;

// The number of a thread in its workgroup, lane by lane.
uint numbered() {
    return SUBGROUPS ? gl_SubgroupID * LANES + gl_SubgroupInvocationID : gl_LocalInvocationIndex;
}

// Where in the tile a block's pixel is that belongs to a lane.
uvec2 pixel_in(uint block, uint lane) {
    return uvec2(block % 2 * WIDE + lane % WIDE, block / 2 * HIGH + lane / WIDE);
}

// A bit for each block that bounds within the tile reach into. There are two blocks in a row of them.
uint blocks_of(uvec4 bounds) {
    if (bounds.x >= bounds.z || bounds.y >= bounds.w) return 0;
    uint columns = (bounds.x < WIDE ? 1u : 0u) | (bounds.z > WIDE ? 2u : 0u);
    uint first = bounds.y / HIGH, rows = (bounds.w + HIGH - 1) / HIGH - first;
    uint pairs = rows < 16 ? (1u << 2 * rows) - 1 : ~0u;
    return (pairs & columns * 0x55555555u) << 2 * first;
}
