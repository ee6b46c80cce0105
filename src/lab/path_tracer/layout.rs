//! Structs and stages that host and device share: `shaders/glsl/lab/path_tracer/appearance.glsl`, `photograph.comp`, `first_hit.comp`.

use crate::engine::vulkan::shaders::glsl::lab::path_tracer::{appearance, photograph};

/// In place of an index: there is none.
pub(crate) const NONE: u32 = appearance::NONE;

/// Flags of [`Material`].
pub(crate) const ALPHA_MASK: u32 = appearance::ALPHA_MASK;
/// As much light passes as alpha is short of 1.
pub(crate) const ALPHA_BLEND: u32 = appearance::ALPHA_BLEND;
/// The back shines as well.
pub(crate) const DOUBLE_SIDED: u32 = appearance::DOUBLE_SIDED;
/// The base colour is what is seen.
pub(crate) const UNLIT: u32 = appearance::UNLIT;
/// The surface bounds a body that refracts.
pub(crate) const VOLUME: u32 = appearance::VOLUME;

/// Flags of [`Map`]; two bits each from 2 and from 4 on are the wrap modes in u and v.
pub(crate) const SECOND_SET: u32 = appearance::SECOND_SET;
/// Colours are sRGB.
pub(crate) const SRGB: u32 = appearance::SRGB;
/// Where the bits of u and v begin.
pub(crate) const WRAP: [u32; 2] = [2, 4];

/// Kinds of [`Light`].
pub(crate) const LIGHT_TRIANGLE: u32 = appearance::LIGHT_TRIANGLE;
/// A point or a spot.
pub(crate) const LIGHT_POINT: u32 = appearance::LIGHT_POINT;
/// Parallel light.
pub(crate) const LIGHT_DIRECTIONAL: u32 = appearance::LIGHT_DIRECTIONAL;
/// What a texel of the environment has above the limit.
pub(crate) const LIGHT_SKY: u32 = appearance::LIGHT_SKY;

crate::gpu_struct! {
    /// A corner of triangles.
    pub struct Vertex {
        /// Unit normal, or zero.
        pub normal: [f32; 3],
        /// RGBA8, linear.
        pub colour: u32,
        /// Tangent and sign of the bitangent.
        pub tangent: [f32; 4],
        /// First texture coordinates.
        pub uv0: [f32; 2],
        /// Second texture coordinates.
        pub uv1: [f32; 2],
    }
}

crate::gpu_struct! {
    /// A triangle; these lie in the order of the hierarchy's leaves.
    pub struct Face {
        /// First corner.
        pub a: u32,
        /// Second corner.
        pub b: u32,
        /// Third corner.
        pub c: u32,
        /// Index of the material.
        pub material: u32,
        /// Number among the lights, or [`NONE`].
        pub light: u32,
    }
}

crate::gpu_struct! {
    /// A material; maps are indices or [`NONE`].
    pub struct Material {
        /// Base colour.
        pub base: [f32; 3],
        /// Base colour's alpha, 0 to 1.
        pub alpha: f32,
        /// Emitted radiance, linear RGB.
        pub emission: [f32; 3],
        /// Alpha below which there is nothing.
        pub cutoff: f32,
        /// Absorption by world unit.
        pub absorption: [f32; 3],
        /// Index of refraction.
        pub ior: f32,
        /// Colour of a dielectric's reflection.
        pub specular_colour: [f32; 3],
        /// Its factor.
        pub specular: f32,
        /// Colour of sheen.
        pub sheen: [f32; 3],
        /// Its roughness.
        pub sheen_roughness: f32,
        /// Share of a metal.
        pub metallic: f32,
        /// Roughness as glTF has it, 0 to 1.
        pub roughness: f32,
        /// Share that passes.
        pub transmission: f32,
        /// Share of a coat.
        pub clearcoat: f32,
        /// Its roughness.
        pub clearcoat_roughness: f32,
        /// Factor of the normal map.
        pub normal_scale: f32,
        /// Factor of the coat's.
        pub clearcoat_normal_scale: f32,
        /// What it is.
        pub flags: u32,
        /// Base colour.
        pub base_map: u32,
        /// Roughness and metallic.
        pub metallic_roughness_map: u32,
        /// Index of the map of normals; [`NONE`] for none.
        pub normal_map: u32,
        /// Index of the map of emission; [`NONE`] for none.
        pub emission_map: u32,
        /// Index of the map of transmission; [`NONE`] for none.
        pub transmission_map: u32,
        /// Index of the map of the clear coat; [`NONE`] for none.
        pub clearcoat_map: u32,
        /// Its roughness.
        pub clearcoat_roughness_map: u32,
        /// Its normals.
        pub clearcoat_normal_map: u32,
        /// Index of the map of the sheen's colour; [`NONE`] for none.
        pub sheen_map: u32,
        /// Its roughness.
        pub sheen_roughness_map: u32,
        /// Factor of reflection.
        pub specular_map: u32,
        /// Its colour.
        pub specular_colour_map: u32,
        /// Where the tables of its interface begin, or [`NONE`].
        pub glass: u32,
        /// Unused.
        pub spare0: u32,
        /// Unused.
        pub spare1: u32,
        /// Unused.
        pub spare2: u32,
    }
}

crate::gpu_struct! {
    /// An image on a surface.
    pub struct Map {
        /// First row of the matrix from (u, v, 1) to the image.
        pub row0: [f32; 3],
        /// First texel.
        pub offset: u32,
        /// Second row.
        pub row1: [f32; 3],
        /// What it is.
        pub flags: u32,
        /// Columns of texels.
        pub width: u32,
        /// Rows of texels.
        pub height: u32,
        /// Unused.
        pub spare0: u32,
        /// Unused.
        pub spare1: u32,
    }
}

crate::gpu_struct! {
    /// A source of light that is looked for.
    pub(crate) struct Light {
        /// Of a lamp.
        pub position: [f32; 3],
        /// What it is.
        pub kind: u32,
        /// In which a lamp shines.
        pub direction: [f32; 3],
        /// The triangle, in the order of the leaves, or the environment's texel.
        pub slot: u32,
        /// Intensity or irradiance of a lamp.
        pub colour: [f32; 3],
        /// Where a lamp has faded.
        pub range: f32,
        /// A spot's light is the square of the cosine times this,
        pub cone_scale: f32,
        /// plus this, between 0 and 1.
        pub cone_offset: f32,
        /// Chance among the lights.
        pub share: f32,
        /// Of the alias table: words above it choose the other light in its place.
        pub threshold: u32,
        /// The other light.
        pub other: u32,
        /// Unused.
        pub spare0: u32,
        /// Unused.
        pub spare1: u32,
        /// Unused.
        pub spare2: u32,
    }
}

crate::gpu_struct! {
    /// Constants of the whole scene.
    pub struct Setting {
        /// Columns of the environment, 0 for none.
        pub sky_width: u32,
        /// Its rows.
        pub sky_height: u32,
        /// Number of lights.
        pub lights: u32,
        /// Chance that a light is looked for in the environment.
        pub sky_share: f32,
        /// Radius of the scene about the origin.
        pub radius: f32,
        /// With a light map: sources too small for it, which lie after the other lights.
        pub compact: u32,
        /// With a light map: what is brighter in the environment is such a source.
        pub sky_limit: f32,
    }
}

crate::gpu_struct! {
    /// A side of a triangle in the light map; fronts and backs take turns.
    pub(crate) struct Side {
        /// Its first patch.
        pub first: u32,
        /// Its edges are cut into so many parts, and it into their square of patches.
        pub splits: u32,
    }
}

crate::gpu_struct! {
    /// A part of a side that is cut into cells of one size.
    pub(crate) struct Patch {
        /// Its first cell.
        pub cells: u32,
        /// Its first corner of cells.
        pub corners: u32,
        /// Its edges are cut into so many parts.
        pub rows: u32,
        /// Of the rays that a cell of usual size gets, for each of its cells.
        pub share: f32,
        /// The side.
        pub side: u32,
    }
}

crate::gpu_struct! {
    /// What the rays of a cell have brought.
    pub(crate) struct Sum {
        /// Irradiance of sources that are not compact.
        pub direct: [f32; 3],
        /// Squares of the luma of that.
        pub squares: f32,
        /// Irradiance of what reflects widely.
        pub bounced: [f32; 3],
        /// One over the distance of what is met.
        pub nearness: f32,
        /// Irradiance of compact sources.
        pub compact: [f32; 3],
        /// Rays that have been added up.
        pub rays: f32,
        /// Luma of `direct` of even rays less that of odd ones.
        pub halves: f32,
        /// Unused.
        pub spare0: f32,
        /// Unused.
        pub spare1: f32,
        /// Unused.
        pub spare2: f32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`BakeGatherStage`].
    pub(crate) struct BakeGatherPush {
        /// Cell of the first thread.
        pub first: u32,
        /// Cells of the map.
        pub count: u32,
        /// Key of the random numbers.
        pub seed: u32,
        /// First ray of a cell of usual size.
        pub first_ray: u32,
        /// Rays of such a cell.
        pub rays: u32,
        /// 1: sums begin anew where a ray is added.
        pub anew: u32,
        /// Error of direct light, relative to all light, from which a cell needs no more rays.
        pub tolerance: f32,
        /// Rays below which nothing is said of a cell's error.
        pub least: u32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`BakeSettleStage`].
    pub(crate) struct BakeSettlePush {
        /// Cells of the map.
        pub count: u32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`PhotographStage`] and [`PhotographBakedStage`]; axes are the camera's in the world.
    pub(crate) struct PhotographPush {
        /// Camera centre.
        pub position: [f32; 3],
        /// Pixel of the first thread.
        pub first: u32,
        /// X axis.
        pub right: [f32; 3],
        /// Pixels of this part of the picture.
        pub count: u32,
        /// Y axis.
        pub down: [f32; 3],
        /// Columns of the picture.
        pub width: u32,
        /// Z axis.
        pub forward: [f32; 3],
        /// Key of the random numbers.
        pub seed: u32,
        /// Focal lengths in pixels.
        pub focal: [f32; 2],
        /// Principal point in pixels.
        pub principal: [f32; 2],
        /// Number of the first sample.
        pub first_sample: u32,
        /// Samples per pixel in this submission.
        pub samples: u32,
        /// 1: the environment is seen behind the scene.
        pub show_sky: u32,
        /// Exposure as a factor of radiance; only [`PhotographBakedStage`] looks at it.
        pub gain: f32,
        /// Samples of a pixel at least, and the same.
        pub least: u32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`FirstHitStage`].
    pub(crate) struct FirstHitPush {
        /// Camera centre.
        pub position: [f32; 3],
        /// Pixels of the picture.
        pub count: u32,
        /// X axis.
        pub right: [f32; 3],
        /// Columns of the picture.
        pub width: u32,
        /// Y axis.
        pub down: [f32; 3],
        /// 1: pixels are those of the list.
        pub chosen_only: u32,
        /// Z axis.
        pub forward: [f32; 3],
        /// Unused.
        pub spare0: u32,
        /// Focal lengths in pixels.
        pub focal: [f32; 2],
        /// Principal point in pixels.
        pub principal: [f32; 2],
    }
}

/// Texels of the environment's alias table: threshold and other texel.
pub(crate) type Alias = [u32; 2];

/// How light is found: tests hold the three against each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strategy {
    /// Lights are looked for and met by chance, weighted.
    #[default]
    Both = photograph::BOTH as isize,
    /// Lights are looked for.
    Lights = photograph::LIGHTS as isize,
    /// Lights are met by chance.
    Chance = photograph::CHANCE as isize,
}

crate::specialisation! {
    /// Constants of [`PhotographStage`].
    pub(crate) struct PhotographConstants {
        /// How light is found.
        strategy: Strategy,
        /// Whether rays are counted in place of alpha.
        count_rays: bool,
    }
}

crate::stage!(
    /// Adds samples to the pixels of a photograph.
    pub(crate) PhotographStage = photograph<PhotographConstants>(PhotographPush) {
        read nodes, read primitives, read vertices, read faces, read materials, read maps, read texels, read lights, read sky,
        read aliases, read albedo, read setting, write exposure
    } with [crate::visibility::bvh::Node, Vertex, Face, Material, Map, Light, Setting]
);

crate::stage!(
    /// What lies in the middle of pixels.
    pub(crate) FirstHitStage = first_hit(FirstHitPush) {
        read nodes, read primitives, read vertices, read faces, read materials, read maps, read texels, read setting,
        read chosen, write found
    } with [crate::visibility::bvh::Node, Vertex, Face, Material, Map, Setting]
);

crate::stage!(
    /// Adds samples to the pixels of a photograph of a scene with a light map.
    pub(crate) PhotographBakedStage = photograph_baked(PhotographPush) {
        read nodes, read primitives, read vertices, read faces, read materials, read maps, read texels, read lights, read sky,
        read aliases, read albedo, read setting, read sides, read patches, read cells, read corners, write exposure, write spread
    } with [crate::visibility::bvh::Node, Vertex, Face, Material, Map, Light, Setting, Side, Patch]
);

crate::stage!(
    /// Adds rays to the cells of the light map.
    pub(crate) BakeGatherStage = bake_gather(BakeGatherPush) {
        read nodes, read primitives, read vertices, read faces, read materials, read maps, read texels, read lights, read sky,
        read aliases, read albedo, read setting, read sides, read patches, read cells, read owners, write sums
    } with [crate::visibility::bvh::Node, Vertex, Face, Material, Map, Light, Setting, Side, Patch, Sum]
);

crate::stage!(
    /// The light map's cells as their sums have them.
    pub(crate) BakeSettleStage = bake_settle(BakeSettlePush) { read sums, write cells } with [Sum]
);
