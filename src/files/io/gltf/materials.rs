//! Base colours: factors and textures.

use std::collections::HashMap;
use std::io::Cursor;

use glam::{DVec2, DVec3};
use gltf_json as json;
use image::{DynamicImage, ImageReader, RgbImage};
use json::texture::{Sampler, WrappingMode};
use json::validation::Checked;

use super::buffers::{Buffers, resolve};
use crate::scene::colour;

/// Longest side that a texture is kept at: a triangle takes one texel, and a mean is a better one.
const LONGEST_SIDE: u32 = 1024;
/// Texels that are kept in all; textures beyond that are taken as white.
const MAX_TEXELS: u64 = 1 << 30;
/// Largest image that is decoded, in pixels a side and in bytes.
const LARGEST_SIDE: u32 = 16384;
const LARGEST_IMAGE: u64 = 1 << 29;

/// Looks up base colours; textures are decoded on first use.
pub(super) struct Paint<'a> {
    root: &'a json::Root,
    buffers: &'a Buffers<'a>,
    /// By index; none where an image cannot be used.
    images: HashMap<usize, Option<RgbImage>>,
    texels: u64,
    /// What a user should know about the colours.
    pub notes: Vec<String>,
}

impl<'a> Paint<'a> {
    /// No image is decoded yet.
    pub fn new(root: &'a json::Root, buffers: &'a Buffers<'a>) -> Self {
        Self { root, buffers, images: HashMap::new(), texels: 0, notes: Vec::new() }
    }

    /// Base colour of a material (the default one where there is none).
    fn base(&self, material: Option<usize>) -> Option<&'a json::material::PbrMetallicRoughness> {
        Some(&self.root.materials.get(material?)?.pbr_metallic_roughness)
    }

    /// Set of texture coordinates that a material's base colour texture uses, where it has one.
    pub fn uv_set(&self, material: Option<usize>) -> Option<u32> {
        let info = self.base(material)?.base_color_texture.as_ref()?;
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        Some(transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord))
    }

    /// Linear base colour of a material at texture coordinates.
    pub fn colour(&mut self, material: Option<usize>, uv: Option<DVec2>) -> DVec3 {
        let Some(base) = self.base(material) else { return DVec3::ONE };
        let [r, g, b, _] = base.base_color_factor.0.map(f64::from);
        let factor = DVec3::new(r, g, b);
        let texel = base.base_color_texture.as_ref().zip(uv).and_then(|(info, uv)| self.texel(info, uv));
        texel.map_or(factor, |texel| factor * texel)
    }

    /// Linear colour of a texture at `uv`.
    fn texel(&mut self, info: &json::texture::Info, uv: DVec2) -> Option<DVec3> {
        let texture = self.root.textures.get(info.index.value())?;
        let sampler = texture.sampler.and_then(|sampler| self.root.samplers.get(sampler.value()));
        let uv = transformed(info, uv);
        let image = self.image(texture.source.value())?;
        let wrap = |mode: fn(&Sampler) -> Checked<WrappingMode>, t: f64, size: u32| {
            let t = match sampler.map(mode) {
                Some(Checked::Valid(WrappingMode::ClampToEdge)) => t.clamp(0.0, 1.0),
                Some(Checked::Valid(WrappingMode::MirroredRepeat)) => 1.0 - (t.rem_euclid(2.0) - 1.0).abs(),
                _ => t.rem_euclid(1.0),
            };
            // A float cast takes NaN to the first texel.
            ((t * f64::from(size)) as u32).min(size - 1)
        };
        let x = wrap(|s| s.wrap_s, uv.x, image.width());
        let y = wrap(|s| s.wrap_t, uv.y, image.height());
        Some(DVec3::from_array(image.get_pixel(x, y).0.map(colour::linear)))
    }

    /// A decoded image, where it can be used.
    fn image(&mut self, index: usize) -> Option<&RgbImage> {
        if !self.images.contains_key(&index) {
            let image = match self.decode(index) {
                Ok(image) => Some(image),
                Err(what) => {
                    self.notes.push(format!("image {index} is not used, so colours are missing: {what}"));
                    None
                }
            };
            self.images.insert(index, image);
        }
        self.images[&index].as_ref()
    }

    /// Decodes an image from its buffer view or URI, and shrinks it.
    fn decode(&mut self, index: usize) -> Result<RgbImage, String> {
        let image = decoded(self.buffers, index)?;
        let image = match image.width().max(image.height()) {
            0..=LONGEST_SIDE => image,
            _ => image.thumbnail(LONGEST_SIDE, LONGEST_SIDE),
        };
        self.texels += u64::from(image.width()) * u64::from(image.height());
        if self.texels > MAX_TEXELS {
            return Err("there are too many images".into());
        }
        Ok(image.into_rgb8())
    }
}

/// Image `index` of a file, from its buffer view or URI; what is wrong with it where it cannot be had.
pub(super) fn decoded(buffers: &Buffers<'_>, index: usize) -> Result<DynamicImage, String> {
    let Some(image) = buffers.root.images.get(index) else { return Err("it is not there".into()) };
    let owned;
    let bytes = match (image.buffer_view, &image.uri) {
        (Some(view), _) => buffers.view(view.value()).map_err(|e| e.to_string())?,
        (None, Some(uri)) => {
            owned = resolve(buffers.path, uri)?;
            &owned
        }
        _ => return Err("it has no data".into()),
    };
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    limits.max_alloc = Some(LARGEST_IMAGE);
    reader.limits(limits);
    let image = reader.decode().map_err(|e| e.to_string())?;
    if image.width() == 0 || image.height() == 0 {
        return Err("it has no pixels".into());
    }
    Ok(image)
}

/// Texture coordinates after KHR_texture_transform: scaled, rotated about the origin, then moved.
fn transformed(info: &json::texture::Info, uv: DVec2) -> DVec2 {
    let Some(transform) = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref()) else { return uv };
    let pair = |v: [f32; 2]| DVec2::new(f64::from(v[0]), f64::from(v[1]));
    let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
    let scaled = pair(transform.scale.0) * uv;
    pair(transform.offset.0) + DVec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x)
}
