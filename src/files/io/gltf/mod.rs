//! glTF 2.0 meshes, binary or with external and embedded buffers.
//!
//! The crate `gltf-json` gives the schema only. Every reference, offset and count is checked here on use: its validation,
//! and the accessor iterators of the crate `gltf`, panic on files that point outside of themselves.

mod accessors;
mod buffers;
mod look;
mod materials;
mod model;
mod nodes;
mod schema;
mod splats;

pub use model::{parse_model, read_model};
pub(crate) use splats::holds_splats;
pub use splats::{parse_splats, write_splats};

use std::path::Path;

use glam::{DVec2, DVec3};
use gltf_json as json;
use json::mesh::Semantic;
use json::validation::Checked;
use serde::Deserialize;

use self::buffers::Buffers;
use self::materials::Paint;
use self::nodes::Part;
use super::checks;
use crate::error::{Error, Result};
use crate::scene::colour;
use crate::scene::surface::{Mesh, Surface};

/// Required extensions that change how a surface looks at most, not where it is.
const HARMLESS: [&str; 10] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_dds",
    "KHR_mesh_quantization",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
    "KHR_animation_pointer",
    "ADOBE_materials_",
];

/// Reads the triangles of the default scene from the bytes of a .glb or .gltf file; buffers and images that are not
/// inside are looked for beside `path`. Node transforms are applied, instanced meshes repeated, strips and fans
/// unfolded. The frame is the scene's: right-handed, Y up, usually metres.
///
/// A triangle's colour is its material's base colour factor, times the base colour texture at the middle of the
/// triangle (shrunk to 1024 texels a side first), times the mean of its vertices' colours, as 8-bit sRGB; alpha and all
/// other material properties are left out. Points and lines are left out, morph targets and skins are at rest; triangles with a
/// corner that is not finite are dropped, and a note counts them.
///
/// # Errors
/// When the file is damaged or cut short, points outside of itself, needs an extension that hides its geometry, or
/// fails the checks that all surfaces pass.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Surface> {
    let (text, chunk) = buffers::split(path, bytes)?;
    check_version(path, text)?;
    let root: json::Root = super::json(path, text)?;
    let harmless = |name: &str| HARMLESS.iter().any(|start| name.starts_with(start));
    refuse_unreadable(path, &root, harmless, notes)?;
    let buffers = Buffers::load(path, &root, chunk)?;
    let paint = Paint::new(&root, &buffers);
    let mut scene = Scene { buffers: &buffers, paint, mesh: Mesh::default(), dropped: 0 };
    let placed = nodes::placed(path, &root, notes)?;
    let left_out = nodes::for_each_part(path, &root, &buffers, &placed, |part| scene.add(&part))?;
    if left_out > 0 {
        notes.push(format!("{left_out} parts of points or lines were left out"));
    }
    if scene.dropped == 0 && scene.mesh.triangles.is_empty() {
        let others = if left_out > 0 { format!(", and {left_out} parts of points or lines") } else { String::new() };
        return Err(Error::input(
            path,
            format!("its scene shows no triangles{others}; export the meshes that it should show"),
        ));
    }
    if scene.dropped > 0 && scene.mesh.triangles.is_empty() {
        let what = format!(
            "all {} triangles have a corner that is not finite (or beyond {:e}); export the scene again",
            scene.dropped,
            checks::LARGEST
        );
        return Err(Error::input(path, what));
    }
    if scene.dropped > 0 {
        notes.push(format!("{} triangles with a corner that is not finite were dropped", scene.dropped));
    }
    notes.append(&mut scene.paint.notes);
    checks::surface(path, Surface::Mesh(scene.mesh), notes)
}

/// Refuses other versions, whose JSON has another form.
fn check_version(path: &Path, text: &[u8]) -> Result<()> {
    #[derive(Default, Deserialize)]
    struct Asset {
        version: Option<serde_json::Value>,
    }
    #[derive(Deserialize)]
    struct File {
        asset: Option<Asset>,
    }
    let File { asset } = super::json(path, text)?;
    let version = asset.unwrap_or_default().version;
    let version = version.as_ref().map(|version| version.as_str().map_or(version.to_string(), str::to_owned));
    match version {
        Some(version) if !version.starts_with("2.") => {
            Err(Error::input(path, format!("this is glTF {version:?}; convert it to glTF 2.0")))
        }
        _ => Ok(()),
    }
}

/// Refuses files that require extensions that `readable` does not accept as readable or harmless.
fn refuse_unreadable(
    path: &Path,
    root: &json::Root,
    readable: impl Fn(&str) -> bool,
    notes: &mut Vec<String>,
) -> Result<()> {
    let required = root.extensions_required.iter().map(String::as_str);
    let unread: Vec<&str> = required.filter(|name| !readable(name)).collect();
    if !unread.is_empty() {
        let what = format!(
            "it needs extensions that are not read ({}); export it without them (uncompressed)",
            unread.join(", ")
        );
        return Err(Error::input(path, what));
    }
    if root.extensions_used.iter().any(|name| name == "EXT_mesh_gpu_instancing") {
        notes.push("meshes repeated by EXT_mesh_gpu_instancing are read once only".into());
    }
    if !root.skins.is_empty() {
        notes.push("skinned meshes are read at rest".into());
    }
    Ok(())
}

/// The scene while it is unfolded.
struct Scene<'a> {
    buffers: &'a Buffers<'a>,
    paint: Paint<'a>,
    mesh: Mesh,
    /// Triangles whose corners cannot be computed with.
    dropped: usize,
}

impl Scene<'_> {
    /// Adds the triangles of a part with the vertices they use. Parts often share one table of vertices, of which each
    /// uses a few.
    fn add(&mut self, part: &Part) -> Result<()> {
        let Part { what, primitive, world, positions, triangles } = part;
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let material = primitive.material.map(|material| material.value());
        let uv_set = self.paint.uv_set(material);
        let uvs = match uv_set.and_then(|set| attribute(Semantic::TexCoords(set))) {
            Some(accessor) => self.buffers.vectors::<2>(accessor, what)?,
            None => Vec::new(),
        };
        let tints = match attribute(Semantic::Colors(0)) {
            Some(accessor) => self.buffers.vectors::<3>(accessor, what)?,
            None => Vec::new(),
        };
        let mut copies = vec![u32::MAX; positions.len()];
        let placed = |v: usize| world.transform_point3(DVec3::from_array(positions[v]));
        for triangle in triangles {
            let corners = triangle.map(|v| v as usize);
            if !corners.into_iter().map(placed).all(checks::usable) {
                self.dropped += 1;
                continue;
            }
            let mean_uv = mean(&uvs, corners).map(DVec2::from_array);
            let tint = mean(&tints, corners).map_or(DVec3::ONE, DVec3::from_array);
            self.mesh.colours.push(colour::srgb(self.paint.colour(material, mean_uv) * tint));
            self.mesh.triangles.push(corners.map(|v| {
                if copies[v] == u32::MAX {
                    copies[v] = self.mesh.positions.len() as u32;
                    self.mesh.positions.push(placed(v));
                }
                copies[v]
            }));
        }
        Ok(())
    }
}

/// Mean of an attribute over a triangle's corners; none where a corner has none.
fn mean<const N: usize>(values: &[[f64; N]], corners: [usize; 3]) -> Option<[f64; N]> {
    let [a, b, c] = corners.map(|v| values.get(v));
    let (a, b, c) = (a?, b?, c?);
    Some(std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0))
}

#[cfg(test)]
mod tests;
