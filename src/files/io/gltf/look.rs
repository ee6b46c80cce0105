//! Materials and images of a glTF file as a photographer needs them.

use glam::{Mat3, Vec2, Vec3, Vec4};
use image::imageops::FilterType;

use super::buffers::Buffers;
use super::materials::decoded;
use super::schema::{self, Document, TextureInfo};
use crate::error::{Error, Result};
use crate::scene::model::{Alpha, Image, Map, Material, Wrap};

/// Texels of all images together: what devices show a shader of one buffer, in words.
const MAX_TEXELS: usize = 1 << 25;
/// Longest side that an image is kept at.
const LONGEST_SIDE: u32 = 4096;

/// Collects the images that materials refer to.
pub(super) struct Look<'a> {
    document: &'a Document,
    buffers: &'a Buffers<'a>,
    /// Images by their number in the file.
    known: Vec<Option<u32>>,
    /// Those that are referred to.
    pub images: Vec<Image>,
    /// How often one of them was halved.
    halved: u32,
}

impl<'a> Look<'a> {
    pub fn new(document: &'a Document, buffers: &'a Buffers<'a>) -> Self {
        Self { document, buffers, known: vec![None; buffers.root.images.len()], images: Vec::new(), halved: 0 }
    }

    /// A material of the file.
    ///
    /// # Errors
    /// Where an image that it refers to is missing or damaged, or a number is out of its range.
    pub fn material(&mut self, index: usize) -> Result<Material> {
        let material = &self.document.materials[index];
        let schema::Material { pbr_metallic_roughness: pbr, extensions: more, .. } = material;
        let alpha = match material.alpha_mode.as_str() {
            "OPAQUE" => Alpha::Opaque,
            "MASK" => Alpha::Mask(material.alpha_cutoff),
            "BLEND" => Alpha::Blend,
            other => return self.refuse(format!("material {index} has the alpha mode {other:?}; export it again")),
        };
        let volume = more.volume.thickness_factor > 0.0;
        let attenuation = Vec3::from(more.volume.attenuation_color).clamp(Vec3::splat(1e-6), Vec3::ONE);
        let far = more.volume.attenuation_distance;
        let absorption =
            if volume && far.is_finite() && far > 0.0 { -attenuation.map(f32::ln) / far } else { Vec3::ZERO };
        let scale = |info: &Option<TextureInfo>| info.as_ref().map_or(1.0, |info| info.scale);
        let found = Material {
            base: Vec4::from(pbr.base_color_factor),
            base_map: self.map(&pbr.base_color_texture)?,
            alpha,
            double_sided: material.double_sided,
            unlit: more.unlit.is_some(),
            metallic: pbr.metallic_factor,
            roughness: pbr.roughness_factor,
            metallic_roughness_map: self.map(&pbr.metallic_roughness_texture)?,
            normal_map: self.map(&material.normal_texture)?,
            normal_scale: scale(&material.normal_texture),
            emission: Vec3::from(material.emissive_factor) * more.emissive_strength.emissive_strength,
            emission_map: self.map(&material.emissive_texture)?,
            ior: more.ior.ior,
            specular: more.specular.specular_factor,
            specular_map: self.map(&more.specular.specular_texture)?,
            specular_colour: Vec3::from(more.specular.specular_color_factor),
            specular_colour_map: self.map(&more.specular.specular_color_texture)?,
            transmission: more.transmission.transmission_factor,
            transmission_map: self.map(&more.transmission.transmission_texture)?,
            volume,
            absorption,
            clearcoat: more.clearcoat.clearcoat_factor,
            clearcoat_map: self.map(&more.clearcoat.clearcoat_texture)?,
            clearcoat_roughness: more.clearcoat.clearcoat_roughness_factor,
            clearcoat_roughness_map: self.map(&more.clearcoat.clearcoat_roughness_texture)?,
            clearcoat_normal_map: self.map(&more.clearcoat.clearcoat_normal_texture)?,
            clearcoat_normal_scale: scale(&more.clearcoat.clearcoat_normal_texture),
            sheen: Vec3::from(more.sheen.sheen_color_factor),
            sheen_map: self.map(&more.sheen.sheen_color_texture)?,
            sheen_roughness: more.sheen.sheen_roughness_factor,
            sheen_roughness_map: self.map(&more.sheen.sheen_roughness_texture)?,
        };
        let shares = [
            found.metallic,
            found.roughness,
            found.specular,
            found.transmission,
            found.clearcoat,
            found.clearcoat_roughness,
            found.sheen_roughness,
        ];
        let colours = [found.base.truncate(), found.sheen];
        let within = shares.iter().all(|share| (0.0..=1.0).contains(share))
            && colours.iter().all(|c| c.min_element() >= 0.0 && c.max_element() <= 1.0);
        let positive = [found.emission, found.specular_colour].iter().all(|c| c.min_element() >= 0.0 && c.is_finite());
        // The standard's index of zero, for reflection without loss, has no body to refract in.
        if !(within && positive && (1.0..10.0).contains(&found.ior)) {
            return self.refuse(format!(
                "material {index} has a factor outside of its range (0 to 1; ior from 1); export it again"
            ));
        }
        Ok(found)
    }

    fn refuse<T>(&self, what: String) -> Result<T> {
        Err(Error::input(self.buffers.path, what))
    }

    /// The map that a reference to a texture denotes.
    fn map(&mut self, info: &Option<TextureInfo>) -> Result<Option<Map>> {
        let Some(info) = info else { return Ok(None) };
        let texture = self.document.textures.get(info.index);
        let Some((texture, source)) = texture.and_then(|texture| Some((texture, texture.source?))) else {
            let what = "is not there, or in a format of an extension; export it with PNG or JPEG textures";
            return self.refuse(format!("texture {} {what}", info.index));
        };
        let sampler = texture.sampler.and_then(|sampler| self.document.samplers.get(sampler));
        let wrap = |code: Option<u32>| match code {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let mut set = info.tex_coord;
        let mut transform = Mat3::IDENTITY;
        if let Some(change) = &info.extensions.transform {
            set = change.tex_coord.unwrap_or(set);
            // Rotation is counter-clockwise as the image is seen, whose v points down.
            transform = Mat3::from_scale_angle_translation(Vec2::ONE, -change.rotation, Vec2::from(change.offset))
                * Mat3::from_scale(Vec2::from(change.scale));
        }
        if set > 1 {
            return self
                .refuse(format!("texture {} takes texture coordinates {set}; of these 0 and 1 are read", info.index));
        }
        let wrap = [wrap(sampler.and_then(|s| s.wrap_s)), wrap(sampler.and_then(|s| s.wrap_t))];
        Ok(Some(Map { image: self.image(source)?, set, transform, wrap }))
    }

    /// Number of an image among those that are kept.
    fn image(&mut self, index: usize) -> Result<u32> {
        if let Some(known) = self.known.get(index).copied().flatten() {
            return Ok(known);
        }
        let image = match decoded(self.buffers, index) {
            Ok(image) => image,
            Err(what) => return self.refuse(format!("image {index} is missing: {what}")),
        };
        let image = match image.width().max(image.height()) {
            0..=LONGEST_SIDE => image,
            _ => image.resize(LONGEST_SIDE, LONGEST_SIDE, FilterType::Triangle),
        };
        let image = image.into_rgba8();
        let (width, height) = image.dimensions();
        let kept = self.images.len() as u32;
        self.images.push(Image { width, height, pixels: image.pixels().map(|pixel| pixel.0).collect() });
        // Decoding went well, so the image is in the list.
        self.known[index] = Some(kept);
        self.shrink();
        Ok(kept)
    }

    /// Halves the largest images until all fit.
    fn shrink(&mut self) {
        while self.images.iter().map(|image| image.pixels.len()).sum::<usize>() > MAX_TEXELS {
            let Some(largest) = self.images.iter_mut().max_by_key(|image| image.pixels.len()) else { return };
            *largest = half(largest);
            self.halved += 1;
        }
    }

    /// Reports which images were halved.
    pub fn note(&self, notes: &mut Vec<String>) {
        if self.halved > 0 {
            notes.push(format!("textures were halved {} times, to have {MAX_TEXELS} texels at most", self.halved));
        }
    }
}

/// An image of half the width and height; means of its bytes.
fn half(image: &Image) -> Image {
    let (width, height) = ((image.width / 2).max(1), (image.height / 2).max(1));
    let at = |x: u32, y: u32| image.pixels[(y.min(image.height - 1) * image.width + x.min(image.width - 1)) as usize];
    let pixel = |i: u32| {
        let (x, y) = (2 * (i % width), 2 * (i / width));
        let four = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        std::array::from_fn(|c| ((four.iter().map(|p| u32::from(p[c])).sum::<u32>() + 2) / 4) as u8)
    };
    Image { width, height, pixels: (0..width * height).map(pixel).collect() }
}
