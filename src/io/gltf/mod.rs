//! glTF 2.0 meshes, binary or with external and embedded buffers.
//!
//! The crate `gltf-json` gives the schema only. Every reference, offset and count is checked here on use: its validation,
//! and the accessor iterators of the crate `gltf`, panic on files that point outside of themselves.

mod accessors;
mod buffers;
mod materials;

use std::collections::HashSet;
use std::path::Path;

use glam::{DMat4, DQuat, DVec2, DVec3};
use gltf_json as json;
use json::mesh::{Mode, Primitive, Semantic};
use json::validation::Checked;

use self::buffers::Buffers;
use self::materials::Paint;
use super::checks;
use crate::error::{Error, Result};
use crate::scene::colour;
use crate::scene::surface::{Mesh, Surface};

/// Triangles that instancing may unfold a scene into. A small file can ask for more than any memory holds.
const MOST_TRIANGLES: usize = 1 << 26;

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
/// other material properties are left out. Points and lines are left out, morph targets and skins are at rest.
///
/// # Errors
/// When the file is damaged or cut short, points outside of itself, needs an extension that hides its geometry, or
/// fails the checks that all surfaces pass.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Surface> {
    let (text, chunk) = buffers::split(path, bytes)?;
    let root: json::Root = super::json(path, text)?;
    refuse_unreadable(path, &root, notes)?;
    let buffers = Buffers::load(path, &root, chunk)?;
    let mut scene = Scene {
        path,
        root: &root,
        buffers: &buffers,
        paint: Paint::new(&root, &buffers),
        mesh: Mesh::default(),
        left_out: 0,
    };
    scene.walk(notes)?;
    if scene.left_out > 0 {
        notes.push(format!("{} parts of points or lines were left out", scene.left_out));
    }
    notes.append(&mut scene.paint.notes);
    checks::surface(path, Surface::Mesh(scene.mesh))
}

/// Refuses other versions and extensions without which the geometry is not there.
fn refuse_unreadable(path: &Path, root: &json::Root, notes: &mut Vec<String>) -> Result<()> {
    if !root.asset.version.starts_with("2.") {
        let what = format!("this is glTF {:?}; convert it to glTF 2.0", root.asset.version);
        return Err(Error::input(path, what));
    }
    let unreadable = |name: &&String| !HARMLESS.iter().any(|start| name.starts_with(start));
    if let Some(name) = root.extensions_required.iter().find(unreadable) {
        let what = format!("it needs the extension {name:?}, which is not read; export it without (uncompressed)");
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
    path: &'a Path,
    root: &'a json::Root,
    buffers: &'a Buffers<'a>,
    paint: Paint<'a>,
    mesh: Mesh,
    /// Parts without triangles.
    left_out: usize,
}

impl Scene<'_> {
    fn refuse<T>(&self, what: impl Into<String>) -> Result<T> {
        Err(Error::input(self.path, what))
    }

    /// Visits every node of the scene from its roots.
    fn walk(&mut self, notes: &mut Vec<String>) -> Result<()> {
        let scene = self.root.scene.map_or(0, |scene| scene.value());
        let roots: Vec<usize> = match self.root.scenes.get(scene) {
            Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
            None if self.root.scenes.is_empty() => {
                let children = self.root.nodes.iter().flat_map(|node| node.children.iter().flatten());
                let children: HashSet<usize> = children.map(|child| child.value()).collect();
                (0..self.root.nodes.len()).filter(|node| !children.contains(node)).collect()
            }
            None => return self.refuse(format!("it shows scene {scene}, which is not there; export it again")),
        };
        if self.root.scenes.len() > 1 {
            notes.push(format!("of {} scenes only scene {scene} is read", self.root.scenes.len()));
        }
        let mut open: Vec<(usize, DMat4)> = roots.into_iter().map(|node| (node, DMat4::IDENTITY)).collect();
        let mut visited = HashSet::new();
        while let Some((index, parent)) = open.pop() {
            let Some(node) = self.root.nodes.get(index) else {
                return self.refuse(format!("node {index} is not there; export the scene again"));
            };
            if !visited.insert(index) {
                return self.refuse(format!("node {index} hangs in the scene twice; a scene must be a tree"));
            }
            let world = parent * transform(node);
            if let Some(mesh) = node.mesh {
                self.add(mesh.value(), world)?;
            }
            open.extend(node.children.iter().flatten().map(|child| (child.value(), world)));
        }
        Ok(())
    }

    /// Adds a mesh as a node places it.
    fn add(&mut self, index: usize, world: DMat4) -> Result<()> {
        let Some(mesh) = self.root.meshes.get(index) else {
            return self.refuse(format!("mesh {index} is not there; export the scene again"));
        };
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            self.add_primitive(&format!("mesh {index}, part {i}"), primitive, world)?;
        }
        Ok(())
    }

    /// Adds the triangles of a part with the vertices they use. Parts often share one table of vertices, of which each
    /// uses a few.
    fn add_primitive(&mut self, what: &str, primitive: &Primitive, world: DMat4) -> Result<()> {
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let Some(positions) = attribute(Semantic::Positions) else {
            return self.refuse(format!("{what} has no positions; export it again"));
        };
        let positions = self.buffers.vectors::<3>(positions, what)?;
        let indices = match primitive.indices {
            Some(accessor) => self.buffers.indices(accessor.value(), what)?,
            None => (0..positions.len() as u32).collect(),
        };
        let Some(triangles) = unfold(primitive.mode, &indices) else {
            self.left_out += 1;
            return Ok(());
        };
        if let Some(outside) = triangles.as_flattened().iter().find(|&&v| v as usize >= positions.len()) {
            return self.refuse(format!(
                "{what} refers to vertex {outside} and there are only {}; export it again",
                positions.len()
            ));
        }
        if self.mesh.triangles.len() + triangles.len() > MOST_TRIANGLES {
            return self.refuse(format!("the scene unfolds to over {MOST_TRIANGLES} triangles; simplify it first"));
        }
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
        // A mirrored node turns its triangles inside out.
        let mirrored = world.determinant() < 0.0;
        let mut copies = vec![u32::MAX; positions.len()];
        for triangle in triangles {
            let [a, b, c] = triangle.map(|v| v as usize);
            let mean_uv = mean(&uvs, [a, b, c]).map(DVec2::from_array);
            let tint = mean(&tints, [a, b, c]).map_or(DVec3::ONE, DVec3::from_array);
            self.mesh.colours.push(colour::srgb(self.paint.colour(material, mean_uv) * tint));
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            self.mesh.triangles.push(corners.map(|v| {
                if copies[v] == u32::MAX {
                    copies[v] = self.mesh.positions.len() as u32;
                    self.mesh.positions.push(world.transform_point3(DVec3::from_array(positions[v])));
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

/// Parent-from-node matrix.
fn transform(node: &json::Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let vector = |v: Option<[f32; 3]>, default| v.map_or(default, |v| DVec3::from_array(v.map(f64::from)));
    let rotation = node.rotation.unwrap_or_default().0;
    let rotation = DQuat::from_array(rotation.map(f64::from));
    // Exporters print few digits, and a rotation without length can only mean none.
    let rotation = if rotation.length() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    DMat4::from_scale_rotation_translation(
        vector(node.scale, DVec3::ONE),
        rotation,
        vector(node.translation, DVec3::ZERO),
    )
}

/// The triangles that a part's indices make in its mode; none where it has points or lines.
fn unfold(mode: Checked<Mode>, indices: &[u32]) -> Option<Vec<[u32; 3]>> {
    match mode {
        Checked::Valid(Mode::Triangles) => Some(indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()),
        // Every second triangle of a strip is turned over, so that all face the same way.
        Checked::Valid(Mode::TriangleStrip) => Some(
            indices
                .windows(3)
                .enumerate()
                .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] })
                .collect(),
        ),
        Checked::Valid(Mode::TriangleFan) => {
            let (first, rest) = indices.split_first()?;
            Some(rest.windows(2).map(|t| [t[0], t[1], *first]).collect())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests;
