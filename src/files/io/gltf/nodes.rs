//! The nodes of a glTF scene and the triangles of its parts.

use std::collections::HashSet;
use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use gltf_json as json;
use json::mesh::{Mode, Primitive, Semantic};
use json::validation::Checked;

use super::buffers::Buffers;
use crate::error::{Error, Result};

/// Triangles that instancing may unfold a scene into. A small file can ask for more than any memory holds.
pub(super) const MAX_TRIANGLES: usize = 1 << 26;

/// Every node of the default scene with its world-from-node matrix, from the roots on.
///
/// # Errors
/// Where nodes are not there, or the scene is no tree.
pub(super) fn placed(path: &Path, root: &json::Root, notes: &mut Vec<String>) -> Result<Vec<(usize, DMat4)>> {
    let refuse = |what: String| Err(Error::input(path, what));
    let scene = root.scene.map_or(0, |scene| scene.value());
    let roots: Vec<usize> = match root.scenes.get(scene) {
        Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
        None if root.scenes.is_empty() => {
            let children = root.nodes.iter().flat_map(|node| node.children.iter().flatten());
            let children: HashSet<usize> = children.map(|child| child.value()).collect();
            (0..root.nodes.len()).filter(|node| !children.contains(node)).collect()
        }
        None => return refuse(format!("it shows scene {scene}, which is not there; export it again")),
    };
    if root.scenes.len() > 1 {
        notes.push(format!("of {} scenes only scene {scene} is read", root.scenes.len()));
    }
    let mut open: Vec<(usize, DMat4)> = roots.into_iter().map(|node| (node, DMat4::IDENTITY)).collect();
    let mut visited = HashSet::new();
    let mut found = Vec::new();
    while let Some((index, parent)) = open.pop() {
        let Some(node) = root.nodes.get(index) else {
            return refuse(format!("node {index} is not there; export the scene again"));
        };
        if !visited.insert(index) {
            return refuse(format!("node {index} hangs in the scene twice; a scene must be a tree"));
        }
        let world = parent * transform(node);
        found.push((index, world));
        open.extend(node.children.iter().flatten().map(|child| (child.value(), world)));
    }
    if found.iter().any(|(node, _)| is_morphed(root, &root.nodes[*node])) {
        notes.push("morph targets are read at rest: their weights are not applied".into());
    }
    Ok(found)
}

/// Whether a node shows its mesh in another shape than at rest; its own weights go before those of the mesh.
fn is_morphed(root: &json::Root, node: &json::Node) -> bool {
    let Some(mesh) = node.mesh.and_then(|mesh| root.meshes.get(mesh.value())) else { return false };
    node.weights.as_ref().or(mesh.weights.as_ref()).is_some_and(|weights| weights.iter().any(|weight| *weight != 0.0))
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

/// A part of a mesh that has triangles, as a node places it.
pub(super) struct Part<'r> {
    /// What errors call it.
    pub(super) what: String,
    pub(super) primitive: &'r Primitive,
    /// World-from-mesh.
    pub(super) world: DMat4,
    /// Positions in the mesh's frame.
    pub(super) positions: Vec<[f64; 3]>,
    /// Triangles by three of them, which face outward under a mirroring node as well.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Gives `add` every part with triangles of the nodes in `placed`, one after the other. How many parts have points or lines in their
/// place.
///
/// # Errors
/// Where a mesh is not there, a part has no positions or refers to some that are not there, or all unfold to too many triangles; and
/// those of `add`.
pub(super) fn for_each_part(
    path: &Path,
    root: &json::Root,
    buffers: &Buffers,
    placed: &[(usize, DMat4)],
    mut add: impl FnMut(Part) -> Result<()>,
) -> Result<usize> {
    let refuse = |what: String| Err(Error::input(path, what));
    let (mut left_out, mut unfolded) = (0, 0);
    for &(node, world) in placed {
        let Some(mesh) = root.nodes[node].mesh.map(|mesh| mesh.value()) else { continue };
        let Some(parts) = root.meshes.get(mesh).map(|mesh| &mesh.primitives) else {
            return refuse(format!("mesh {mesh} is not there; export the scene again"));
        };
        for (i, primitive) in parts.iter().enumerate() {
            let what = format!("mesh {mesh}, part {i}");
            let Some((positions, mut triangles)) = triangles(path, buffers, &what, primitive)? else {
                left_out += 1;
                continue;
            };
            unfolded += triangles.len();
            if unfolded > MAX_TRIANGLES {
                return refuse(format!("the scene unfolds to over {MAX_TRIANGLES} triangles; simplify it first"));
            }
            // A mirrored node turns its triangles inside out.
            if world.determinant() < 0.0 {
                triangles.iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
            }
            add(Part { what, primitive, world, positions, triangles })?;
        }
    }
    Ok(left_out)
}

/// Positions, and triangles by three of them.
type Triangles = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// The triangles of a part, which errors call `what`, in its mesh's frame; none where it has points or lines.
///
/// # Errors
/// Where it has no positions, or refers to some that are not there.
fn triangles(path: &Path, buffers: &Buffers, what: &str, part: &Primitive) -> Result<Option<Triangles>> {
    let refuse = |what: String| Err(Error::input(path, what));
    let Some(positions) = part.attributes.get(&Checked::Valid(Semantic::Positions)) else {
        return refuse(format!("{what} has no positions; export it again"));
    };
    let positions = buffers.vectors::<3>(positions.value(), what)?;
    let indices = match part.indices {
        Some(accessor) => buffers.indices(accessor.value(), what)?,
        None => (0..positions.len() as u32).collect(),
    };
    let Some(triangles) = unfold(part.mode, &indices) else { return Ok(None) };
    let count = positions.len();
    if let Some(outside) = triangles.as_flattened().iter().find(|&&v| v as usize >= count) {
        return refuse(format!("{what} refers to vertex {outside} and there are only {count}; export it again"));
    }
    Ok(Some((positions, triangles)))
}

/// The triangles that a part's indices make in its mode; none where it has points or lines.
pub(super) fn unfold(mode: Checked<Mode>, indices: &[u32]) -> Option<Vec<[u32; 3]>> {
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
