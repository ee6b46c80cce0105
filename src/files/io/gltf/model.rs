//! A glTF scene with all that a photograph shows of it.

use std::path::Path;

use glam::{DMat3, DMat4, DVec3, Vec2, Vec3, Vec4};
use gltf_json as json;
use json::mesh::{Primitive, Semantic};
use json::validation::Checked;

use super::buffers::{self, Buffers};
use super::look::Look;
use super::nodes::{self, MAX_TRIANGLES, Part};
use super::refuse_unreadable;
use super::schema::Document;
use crate::error::{Error, Result};
use crate::files::io::checks;
use crate::scene::model::{Face, Lamp, LampKind, Map, Material, Model, Vertex};

/// Extensions that are modelled, or change nothing about a photograph.
const KNOWN: [&str; 13] = [
    "KHR_texture_transform",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_ior",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_unlit",
    "KHR_materials_emissive_strength",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Reads the default scene of a .glb or .gltf file with its materials, textures and lamps. Node transforms are applied,
/// instanced meshes repeated; skins and morph targets are at rest, of variants the first look is taken. The frame is the
/// file's: right-handed, Y up. The notes report what was left out.
///
/// # Errors
/// [`Error::Input`] where the file is damaged, buffers or images are missing, it requires an extension that is not modelled,
/// or no triangle is left.
pub fn read_model(path: &Path, notes: &mut Vec<String>) -> Result<Model> {
    parse_model(path, &crate::files::io::read_file(path)?, notes)
}

/// As [`read_model`], of the bytes of a file; other files are looked for beside `path`.
///
/// # Errors
/// As [`read_model`]'s.
pub fn parse_model(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Model> {
    let (text, chunk) = buffers::split(path, bytes)?;
    let root: json::Root = crate::files::io::json(path, text)?;
    let document: Document = crate::files::io::json(path, text)?;
    let known = |name: &str| KNOWN.contains(&name);
    refuse_unreadable(path, &root, known, notes)?;
    let used = document.extensions_used.iter().map(String::as_str);
    let unknown: Vec<&str> = used.filter(|name| !known(name)).collect();
    if !unknown.is_empty() {
        notes.push(format!("not modelled, and left out: {}", unknown.join(", ")));
    }
    let buffers = Buffers::load(path, &root, chunk)?;
    let mut look = Look::new(&document, &buffers);
    let mut materials = (0..document.materials.len()).map(|i| look.material(i)).collect::<Result<Vec<Material>>>()?;
    look.note(notes);
    let plain = materials.len() as u32;
    if materials.is_empty() {
        notes.push("the scene has no materials: it is grey".into());
        materials.push(Material::grey());
    } else {
        materials.push(Material::default());
    }
    let model = Model { materials, images: look.images, ..Model::default() };
    let mut reader = Reader { path, root: &root, buffers: &buffers, plain, model, unplaced: 0 };
    let placed = nodes::placed(path, &root, notes)?;
    let left_out = nodes::for_each_part(path, &root, &buffers, &placed, |part| reader.add(&part))?;
    let Reader { mut model, unplaced, .. } = reader;
    for (node, world) in placed {
        if let Some(light) = document.nodes.get(node).and_then(|node| node.extensions.light.as_ref()) {
            model.lamps.push(lamp(path, &document, light.light, world)?);
        }
    }
    if left_out > 0 {
        notes.push(format!("{left_out} parts of points or lines were left out"));
    }
    if unplaced > 0 {
        notes.push(format!(
            "{unplaced} parts lack the texture coordinates that an image of theirs takes: it shows one colour there"
        ));
    }
    if model.dropped > 0 && model.faces.is_empty() {
        let what = format!(
            "all {} triangles lack area or are not finite (or beyond {:e}); export the scene again",
            model.dropped,
            checks::LARGEST
        );
        return Err(Error::input(path, what));
    }
    if model.dropped > 0 {
        notes.push(format!("{} triangles without area, or that are not finite, were dropped", model.dropped));
    }
    if model.faces.is_empty() {
        return Err(Error::input(path, "it holds no triangles that can be seen; export the scene with its meshes"));
    }
    Ok(model)
}

/// A lamp of the file where a node hangs it: it shines along the node's -Z.
fn lamp(path: &Path, document: &Document, index: usize, world: DMat4) -> Result<Lamp> {
    let Some(light) = document.extensions.lights.lights.get(index) else {
        return Err(Error::input(path, format!("lamp {index} is not there; export the scene again")));
    };
    let kind = match light.kind.as_str() {
        "point" => LampKind::Point,
        "directional" => LampKind::Directional,
        "spot" => LampKind::Spot { inner: light.spot.inner_cone_angle, outer: light.spot.outer_cone_angle },
        other => {
            let what = format!("lamp {index} is of the unknown kind {other:?}; make it point, spot or directional");
            return Err(Error::input(path, what));
        }
    };
    let direction = world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Y).as_vec3();
    let position = world.transform_point3(DVec3::ZERO);
    let colour = light.intensity * Vec3::from(light.color);
    if !(position.is_finite() && colour.is_finite() && colour.min_element() >= 0.0) {
        return Err(Error::input(path, format!("lamp {index} has no place or no colour; export the scene again")));
    }
    Ok(Lamp { kind, position, direction, colour, range: light.range.filter(|r| *r > 0.0).unwrap_or(f32::INFINITY) })
}

struct Reader<'a> {
    path: &'a Path,
    root: &'a json::Root,
    buffers: &'a Buffers<'a>,
    /// The material of parts that name none.
    plain: u32,
    model: Model,
    /// Parts without the texture coordinates that an image of their material takes.
    unplaced: usize,
}

impl Reader<'_> {
    fn refuse<T>(&self, what: impl Into<String>) -> Result<T> {
        Err(Error::input(self.path, what))
    }

    /// Values of an attribute, one for each of `count` vertices; none where there is no such attribute.
    fn attribute<const N: usize>(
        &self,
        what: &str,
        primitive: &Primitive,
        semantic: Semantic,
        count: usize,
    ) -> Result<Option<Vec<[f64; N]>>> {
        let Some(accessor) = primitive.attributes.get(&Checked::Valid(semantic)) else { return Ok(None) };
        let values = self.buffers.vectors::<N>(accessor.value(), what)?;
        if values.len() != count {
            return self.refuse(format!("{what} has {} values for {count} vertices; export it again", values.len()));
        }
        Ok(Some(values))
    }

    /// Alpha of vertex colours is a component that they may lack.
    fn colours(&self, what: &str, primitive: &Primitive, count: usize) -> Result<Option<Vec<[f64; 4]>>> {
        let Some(accessor) = primitive.attributes.get(&Checked::Valid(Semantic::Colors(0))) else { return Ok(None) };
        let kind = self.root.accessors.get(accessor.value()).map(|accessor| accessor.type_);
        if kind == Some(Checked::Valid(json::accessor::Type::Vec4)) {
            return self.attribute::<4>(what, primitive, Semantic::Colors(0), count);
        }
        let colours = self.attribute::<3>(what, primitive, Semantic::Colors(0), count)?;
        Ok(colours.map(|colours| colours.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()))
    }

    /// Adds the triangles of a part with its vertices.
    fn add(&mut self, part: &Part) -> Result<()> {
        let Part { what, primitive, world, positions, triangles } = part;
        let count = positions.len();
        if self.model.vertices.len() + count > 3 * MAX_TRIANGLES {
            return self.refuse(format!("the scene unfolds to over {MAX_TRIANGLES} triangles; simplify it first"));
        }
        let material = match primitive.material.map(|material| material.value() as u32) {
            Some(material) if material < self.plain => material,
            Some(material) => return self.refuse(format!("{what} has material {material}, which is not there")),
            None => self.plain,
        };
        let normals = self.attribute::<3>(what, primitive, Semantic::Normals, count)?;
        let tangents = self.attribute::<4>(what, primitive, Semantic::Tangents, count)?;
        let uvs = [0, 1].map(|set| self.attribute::<2>(what, primitive, Semantic::TexCoords(set), count));
        let [first, second] = uvs;
        let uvs = [first?, second?];
        let colours = self.colours(what, primitive, count)?;

        // Normals turn with the inverse transpose; the determinant's sign keeps them outside of a mirrored node.
        let linear = DMat3::from_mat4(*world);
        let side = if world.determinant() < 0.0 { -1.0 } else { 1.0 };
        let cofactor = DMat3::from_cols(
            linear.y_axis.cross(linear.z_axis),
            linear.z_axis.cross(linear.x_axis),
            linear.x_axis.cross(linear.y_axis),
        ) * side;
        let at = self.model.vertices.len() as u32;
        let pair = |values: &Option<Vec<[f64; 2]>>, i: usize| {
            values.as_ref().map_or(Vec2::ZERO, |values| Vec2::new(values[i][0] as f32, values[i][1] as f32))
        };
        for (i, position) in positions.iter().enumerate() {
            let direction = |matrix: DMat3, v: DVec3| (matrix * v).normalize_or_zero().as_vec3();
            self.model.vertices.push(Vertex {
                position: world.transform_point3(DVec3::from_array(*position)),
                normal: normals.as_ref().map_or(Vec3::ZERO, |n| direction(cofactor, DVec3::from_array(n[i]))),
                tangent: tangents.as_ref().map_or(Vec4::ZERO, |t| {
                    let [x, y, z, w] = t[i];
                    direction(linear, DVec3::new(x, y, z)).extend((w * side) as f32)
                }),
                uvs: [pair(&uvs[0], i), pair(&uvs[1], i)],
                colour: colours.as_ref().map_or([255; 4], |c| c[i].map(|v| (255.0 * v).round() as u8)),
            });
        }
        let first = self.model.faces.len();
        for triangle in triangles {
            let corners = triangle.map(|v| at + v);
            let [p, q, r] = corners.map(|v| self.model.vertices[v as usize].position);
            // As the device has them, in single precision.
            let area = (q - p).as_vec3().as_dvec3().cross((r - p).as_vec3().as_dvec3()).length();
            if area > 0.0 && area.is_finite() && [p, q, r].into_iter().all(checks::usable) {
                self.model.faces.push(Face { corners, material });
            } else {
                self.model.dropped += 1;
            }
        }
        let material = &self.model.materials[material as usize];
        self.unplaced += material.maps().any(|map| uvs[map.set as usize].is_none()) as usize;
        let map = material.normal_map.or(material.clearcoat_normal_map);
        if let Some(map) = map.filter(|_| tangents.is_none()) {
            add_tangents(&mut self.model.vertices, at as usize, &self.model.faces[first..], &map);
        }
        Ok(())
    }
}

/// Tangents of vertices from `first` on, which have none, from how texture coordinates run over their triangles: the mean
/// over these by area. Vertices are split where coordinates jump, so this is what the usual baker has.
fn add_tangents(vertices: &mut [Vertex], first: usize, faces: &[Face], map: &Map) {
    let mut sums = vec![(Vec3::ZERO, Vec3::ZERO); vertices.len() - first];
    for face in faces {
        let [a, b, c] = face.corners.map(|v| &vertices[v as usize]);
        let [u, v] = [b, c].map(|corner| corner.uvs[map.set as usize] - a.uvs[map.set as usize]);
        let [p, q] = [b, c].map(|corner| (corner.position - a.position).as_vec3());
        let turn = u.perp_dot(v);
        if turn == 0.0 {
            continue;
        }
        let weight = p.cross(q).length() * turn.signum();
        let along_u = weight * (v.y * p - u.y * q).normalize_or_zero();
        let along_v = weight * (u.x * q - v.x * p).normalize_or_zero();
        for corner in face.corners {
            let sum = &mut sums[corner as usize - first];
            sum.0 += along_u;
            sum.1 += along_v;
        }
    }
    for (vertex, (along_u, along_v)) in vertices[first..].iter_mut().zip(sums) {
        let tangent = (along_u - vertex.normal * vertex.normal.dot(along_u)).normalize_or_zero();
        // The map's v points down the image and green up it: the bitangent runs against v.
        let sign = if vertex.normal.cross(tangent).dot(along_v) > 0.0 { -1.0 } else { 1.0 };
        vertex.tangent = if tangent == Vec3::ZERO { Vec4::ZERO } else { tangent.extend(sign) };
    }
}

#[cfg(test)]
#[path = "model_tests.rs"]
mod tests;
