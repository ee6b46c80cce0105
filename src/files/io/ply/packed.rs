//! The packed layout of PlayCanvas and SuperSplat (`.compressed.ply`): sixteen bytes a splat, and one more for each harmonic above the
//! constant one. [`super::decode`] reads it, and says what the bits are.

use super::decode::{CHUNK, PACKED_SPAN};
use crate::files::io::splats::order::along_morton;
use crate::files::io::splats::quantised::{WIDEST, byte, smallest_three};
use crate::scene::gaussians::Gaussians;
use crate::scene::harmonics::CONSTANT;

/// Bytes of a packed file, splats along a Morton curve so that the bounds of a chunk are narrow.
pub fn packed(gaussians: &Gaussians) -> Vec<u8> {
    let order = along_morton(&gaussians.centres);
    let each = 3 * gaussians.coefficients();
    let centre = |i: usize| gaussians.centres[i].as_vec3().to_array();
    let scale = |i: usize| gaussians.log_scales[i].map(|scale| scale.clamp(-WIDEST, WIDEST));
    let colour = |i: usize| [0, 1, 2].map(|k| 0.5 + CONSTANT as f32 * gaussians.harmonics[each * i + k]);
    let mode = if gaussians.antialiased { "comment SplatRenderMode: mip\n" } else { "" };
    let bounds: String = ["", "scale_", "rgb"]
        .iter()
        .flat_map(|group| ["min", "max"].map(|end| (group, end)))
        .flat_map(|(group, end)| match *group {
            "rgb" => ["r", "g", "b"].map(|axis| format!("property float {end}_{axis}\n")),
            group => ["x", "y", "z"].map(|axis| format!("property float {end}_{group}{axis}\n")),
        })
        .collect();
    let (count, chunks) = (gaussians.len(), gaussians.len().div_ceil(CHUNK));
    let rest: String = (0..each - 3).map(|k| format!("property uchar f_rest_{k}\n")).collect();
    let harmonics = if rest.is_empty() { String::new() } else { format!("element sh {count}\n{rest}") };
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by camsplat\n{mode}element chunk {chunks}\n{bounds}element vertex {count}\n\
         property uint packed_position\nproperty uint packed_rotation\nproperty uint packed_scale\nproperty uint packed_color\n\
         {harmonics}end_header\n"
    )
    .into_bytes();
    let mut words: Vec<u32> = Vec::with_capacity(4 * count);
    for chunk in order.chunks(CHUNK) {
        let groups: [&dyn Fn(usize) -> [f32; 3]; 3] = [&centre, &scale, &colour];
        let ends = groups.map(|values| Ends::of(chunk.iter().map(|i| values(*i))));
        ends.iter()
            .flat_map(|ends| [ends.low, ends.high])
            .flatten()
            .for_each(|value| bytes.extend(value.to_le_bytes()));
        for i in chunk {
            let [position, size, shade] = [0, 1, 2].map(|k| ends[k].shares(groups[k](*i)));
            let (left_out, others) = smallest_three(gaussians.rotations[*i]);
            let turn =
                others.iter().fold(left_out as u32, |word, part| word << 10 | steps(part / 2.0f64.sqrt() + 0.5, 10));
            let [r, g, b] = shade.map(|share| byte(255.0 * share));
            let alpha = byte(255.0 * gaussians.opacity(*i));
            words.extend([vector(position), turn, vector(size), u32::from_be_bytes([r, g, b, alpha])]);
        }
    }
    words.iter().for_each(|word| bytes.extend(word.to_le_bytes()));
    for i in order {
        // All of red first, as in the usual layout.
        for channel in 0..3 {
            let own = (1..each / 3).map(|k| f64::from(gaussians.harmonics[each * i + 3 * k + channel]));
            bytes.extend(own.map(|value| (256.0 * (value / PACKED_SPAN + 0.5)).clamp(0.0, 255.0) as u8));
        }
    }
    bytes
}

/// The least and the greatest of three values.
struct Ends {
    low: [f32; 3],
    high: [f32; 3],
}

impl Ends {
    fn of(values: impl Iterator<Item = [f32; 3]>) -> Self {
        let start = Self { low: [f32::MAX; 3], high: [f32::MIN; 3] };
        values.fold(start, |ends, value| Self {
            low: [0, 1, 2].map(|k| ends.low[k].min(value[k])),
            high: [0, 1, 2].map(|k| ends.high[k].max(value[k])),
        })
    }

    /// Where values lie between the ends, from 0 to 1.
    fn shares(&self, value: [f32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| {
            let [low, high, value] = [self.low[k], self.high[k], value[k]].map(f64::from);
            if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 }
        })
    }
}

/// A share of 1 in `bits` bits.
fn steps(share: f64, bits: u32) -> u32 {
    let most = f64::from((1u32 << bits) - 1);
    (share * most + 0.5).clamp(0.0, most) as u32
}

/// Three shares in 11, 10 and 11 bits.
fn vector([x, y, z]: [f64; 3]) -> u32 {
    steps(x, 11) << 21 | steps(y, 10) << 11 | steps(z, 11)
}
