//! Splats in glTF: the extension KHR_gaussian_splatting (github.com/KhronosGroup/glTF, release candidate of 2026), with the kernel
//! "ellipse", and its compression by SPZ.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat3, DMat4, DQuat, DVec3};
use gltf_json as json;
use serde::Deserialize;
use serde_json::json;

use super::buffers::{self, Buffers};
use super::nodes;
use crate::error::{Error, Result};
use crate::files::io::left_out::LeftOut;
use crate::files::io::splats::spz;
use crate::files::io::splats::usable::usable;
use crate::scene::colour;
use crate::scene::gaussians::{Gaussians, MAX_DEGREE, coefficients};
use crate::scene::harmonics::CONSTANT;
use crate::scene::similarity::Similarity;

/// The extension, and what its attributes begin with.
const EXTENSION: &str = "KHR_gaussian_splatting";
/// Its compression by SPZ.
const COMPRESSED: &str = "KHR_gaussian_splatting_compression_spz";
/// How far a node's axes may be from those of a rotation and one scale.
const EVEN: f64 = 1e-3;

/// What `gltf-json` does not know of a file.
#[derive(Deserialize)]
struct File {
    #[serde(default)]
    meshes: Vec<Mesh>,
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    #[serde(default)]
    attributes: BTreeMap<String, usize>,
    #[serde(default)]
    extensions: BTreeMap<String, serde_json::Value>,
}

/// Whether a file of that beginning holds splats rather than triangles.
pub(crate) fn holds_splats(path: &Path, bytes: &[u8]) -> bool {
    let name = EXTENSION.as_bytes();
    buffers::split(path, bytes).is_ok_and(|(text, _)| text.windows(name.len()).any(|window| window == name))
}

/// Reads the splats of the default scene from the bytes of a .glb or .gltf file, in the scene's frame.
///
/// # Errors
/// When the file is damaged or cut short, points outside of itself, or holds no splats that can be used.
pub fn parse_splats(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Gaussians> {
    let (text, chunk) = buffers::split(path, bytes)?;
    let root: json::Root = crate::files::io::json(path, text)?;
    let file: File = crate::files::io::json(path, text)?;
    let buffers = Buffers::load(path, &root, chunk)?;
    let mut all: Option<Gaussians> = None;
    let mut left_out = LeftOut::default();
    for (node, world) in nodes::placed(path, &root, notes)? {
        let Some(mesh) = root.nodes[node].mesh.map(|mesh| mesh.value()) else { continue };
        for (i, primitive) in file.meshes.get(mesh).iter().flat_map(|mesh| &mesh.primitives).enumerate() {
            let what = format!("mesh {mesh}, part {i}");
            let Some(extension) = primitive.extensions.get(EXTENSION) else { continue };
            let Some(map) = similarity(&world) else {
                left_out.add(format!("{what}: its node stretches it unevenly or mirrors it"));
                continue;
            };
            if extension.get("colorSpace").and_then(|space| space.as_str()) == Some("lin_rec709_display") {
                left_out.add(format!("{what}: its colours are blended as linear values, which is not known here"));
                continue;
            }
            let part = part(path, &buffers, primitive, extension, &what, notes)?.through(&map);
            match &mut all {
                None => all = Some(part),
                Some(all) => append(all, part),
            }
        }
    }
    let Some(all) = all else {
        let why = left_out.first().map(|what| format!(" ({what})")).unwrap_or_default();
        return Err(Error::input(path, format!("its scene shows no splats that can be read{why}; export it again")));
    };
    left_out.note("parts", notes);
    let gaussians = usable(path, all, notes)?;
    notes.push(format!("{} splats with harmonics of degree {}, glTF", gaussians.len(), gaussians.degree));
    Ok(gaussians)
}

/// The splats of a primitive in its mesh's frame.
fn part(
    path: &Path,
    buffers: &Buffers,
    primitive: &Primitive,
    extension: &serde_json::Value,
    what: &str,
    notes: &mut Vec<String>,
) -> Result<Gaussians> {
    let inner = extension.get("extensions").and_then(|inner| inner.as_object());
    if let Some((name, packed)) = inner.into_iter().flatten().find(|(name, _)| name.starts_with(COMPRESSED)) {
        let view = packed.get("bufferView").and_then(|view| view.as_u64()).and_then(|view| usize::try_from(view).ok());
        let refuse = || Error::input(path, format!("{what}: {name} names no buffer view; export the file again"));
        return spz::parse(path, buffers.view(view.ok_or_else(refuse)?)?, notes);
    }
    let attribute = |name: &str| primitive.attributes.get(name).copied();
    let own = |name: &str| attribute(&format!("{EXTENSION}:{name}"));
    let missing =
        |name: &str| Error::input(path, format!("{what} has no attribute {name}, as splats must; export it again"));
    let needed = |name: &str| own(name).ok_or_else(|| missing(name));
    let positions = buffers.vectors::<3>(attribute("POSITION").ok_or_else(|| missing("POSITION"))?, what)?;
    let rotations = buffers.vectors::<4>(needed("ROTATION")?, what)?;
    let scales = buffers.vectors::<3>(needed("SCALE")?, what)?;
    let opacities = buffers.vectors::<1>(needed("OPACITY")?, what)?;
    let name = |degree: u32, k: u32| format!("SH_DEGREE_{degree}_COEF_{k}");
    let whole = |degree: &u32| (0..=2 * degree).all(|k| own(&name(*degree, k)).is_some());
    let degree = (1..=MAX_DEGREE).take_while(whole).count() as u32;
    let bands = (0..=degree).flat_map(|degree| (0..=2 * degree).map(move |k| name(degree, k)));
    let bands: Vec<Vec<[f64; 3]>> =
        bands.map(|name| buffers.vectors::<3>(needed(&name)?, what)).collect::<Result<_>>()?;
    let count = positions.len();
    if [rotations.len(), scales.len(), opacities.len()]
        .iter()
        .chain(bands.iter().map(|band| band.len()).collect::<Vec<_>>().iter())
        .any(|length| *length != count)
    {
        return Err(Error::input(path, format!("{what} has attributes of different lengths; export it again")));
    }
    Ok(Gaussians {
        centres: positions.into_iter().map(DVec3::from_array).collect(),
        log_scales: scales.into_iter().map(|scale| scale.map(|v| v.ln() as f32)).collect(),
        rotations: rotations.into_iter().map(|[x, y, z, w]| [w, x, y, z].map(|v| v as f32)).collect(),
        opacities: opacities.into_iter().map(|[opacity]| (opacity / (1.0 - opacity)).ln() as f32).collect(),
        degree,
        harmonics: (0..count).flat_map(|i| bands.iter().flat_map(move |band| band[i].map(|v| v as f32))).collect(),
        antialiased: false,
    })
}

/// The map of a node's matrix that turns, moves and scales evenly; none for another.
fn similarity(world: &DMat4) -> Option<Similarity> {
    let axes = DMat3::from_mat4(*world);
    let scale = axes.determinant().cbrt();
    let turned = axes * (1.0 / scale);
    let even = (turned.transpose() * turned - DMat3::IDENTITY).to_cols_array().iter().all(|v| v.abs() < EVEN);
    let rotation = if turned == DMat3::IDENTITY { DQuat::IDENTITY } else { DQuat::from_mat3(&turned).normalize() };
    (scale > 0.0 && even).then(|| Similarity { rotation, scale, translation: world.w_axis.truncate() })
}

/// Puts `more` behind `all`; of two degrees the greater is kept, with zeros for the other.
fn append(all: &mut Gaussians, more: Gaussians) {
    let degree = all.degree.max(more.degree);
    let widened = |gaussians: &Gaussians| -> Vec<f32> {
        let (from, to) = (3 * gaussians.coefficients(), 3 * coefficients(degree));
        let zeros = vec![0.0; to - from];
        gaussians.harmonics.chunks_exact(from).flat_map(|own| own.iter().chain(&zeros).copied()).collect()
    };
    let mut harmonics = widened(all);
    harmonics.extend(widened(&more));
    (all.degree, all.harmonics) = (degree, harmonics);
    all.centres.extend(more.centres);
    all.log_scales.extend(more.log_scales);
    all.rotations.extend(more.rotations);
    all.opacities.extend(more.opacities);
    all.antialiased &= more.antialiased;
}

/// Bytes of a .glb file with one node, whose frame is the model's: viewers that know no splats draw points of its colours.
///
/// # Errors
/// Where the model is larger than such a file may be, 4 GiB.
pub fn write_splats(gaussians: &Gaussians) -> Result<Vec<u8>> {
    let count = gaussians.len();
    let each = gaussians.coefficients();
    let mut parts =
        Parts { count, binary: Vec::new(), views: Vec::new(), accessors: Vec::new(), attributes: BTreeMap::new() };
    let centre = |i: usize| gaussians.centres[i].as_vec3().to_array();
    parts.floats("POSITION", &|i| centre(i));
    let ends = |pick: fn(f32, f32) -> f32| {
        (0..count).map(centre).reduce(|a, b| [0, 1, 2].map(|k| pick(a[k], b[k]))).unwrap_or_default()
    };
    // Which the format asks for.
    parts.accessors[0]["min"] = json!(ends(f32::min));
    parts.accessors[0]["max"] = json!(ends(f32::max));
    let constant = |i: usize, k: usize| 0.5 + CONSTANT * f64::from(gaussians.harmonics[3 * each * i + k]);
    parts.floats("COLOR_0", &|i| {
        let linear = DVec3::from([0, 1, 2].map(|k| colour::decoded(constant(i, k).clamp(0.0, 1.0))));
        [linear.x as f32, linear.y as f32, linear.z as f32, gaussians.opacity(i) as f32]
    });
    let own = |name: &str| format!("{EXTENSION}:{name}");
    parts.floats(&own("ROTATION"), &|i| {
        let [w, x, y, z] = gaussians.rotations[i].map(f64::from);
        let unit = DQuat::from_xyzw(x, y, z, w).normalize();
        [unit.x, unit.y, unit.z, unit.w].map(|v| v as f32)
    });
    parts.floats(&own("SCALE"), &|i| gaussians.log_scales[i].map(f32::exp));
    parts.floats(&own("OPACITY"), &|i| [gaussians.opacity(i) as f32]);
    let mut at = 0;
    for degree in 0..=gaussians.degree {
        for k in 0..=2 * degree {
            parts.floats(&own(&format!("SH_DEGREE_{degree}_COEF_{k}")), &|i| {
                let start = 3 * (each * i + at);
                [0, 1, 2].map(|channel| gaussians.harmonics[start + channel])
            });
            at += 1;
        }
    }
    let extension = json!({ "kernel": "ellipse", "colorSpace": "srgb_rec709_display", "projection": "perspective", "sortingMethod": "cameraDistance" });
    let text = json!({
        "asset": { "version": "2.0", "generator": "camsplat" },
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": parts.attributes, "mode": 0, "extensions": { EXTENSION: extension } }] }],
        "accessors": parts.accessors,
        "bufferViews": parts.views,
        "buffers": [{ "byteLength": parts.binary.len() }],
    });
    let mut text = text.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = u32::try_from(12 + 8 + text.len() + 8 + parts.binary.len());
    let length = length
        .map_err(|_| Error::request(format!("{count} splats are more than a .glb file holds; write another format")))?;
    let mut bytes = b"glTF".to_vec();
    bytes.extend([2, length, text.len() as u32].map(u32::to_le_bytes).concat());
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend((parts.binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(parts.binary);
    Ok(bytes)
}

/// The parts of a file in the making.
struct Parts {
    count: usize,
    binary: Vec<u8>,
    views: Vec<serde_json::Value>,
    accessors: Vec<serde_json::Value>,
    attributes: BTreeMap<String, usize>,
}

impl Parts {
    /// Adds an attribute of `N` floats for each splat.
    fn floats<const N: usize>(&mut self, name: &str, value: &dyn Fn(usize) -> [f32; N]) {
        let start = self.binary.len();
        (0..self.count).flat_map(value).for_each(|v| self.binary.extend(v.to_le_bytes()));
        self.views.push(
            json!({ "buffer": 0, "byteOffset": start, "byteLength": self.binary.len() - start, "target": 34962 }),
        );
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let view = self.views.len() - 1;
        self.accessors.push(json!({ "bufferView": view, "componentType": 5126, "count": self.count, "type": kind }));
        self.attributes.insert(name.into(), view);
    }
}
