//! Targets that vary with direction, per point camera (`probe_lobe.comp`), and their twin.

use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};

use super::device_scene::SceneGeometry;
use super::probe_depth::{ProbeMaps, ProbeSkyPush};
use crate::Result;
use crate::scene::{harmonics, octahedral};
use crate::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::gpu_struct! {
    /// How the view dependency of a probe varies with direction, in the planner's frame.
    pub struct Lobe {
        /// Its part of degree one.
        pub linear: [f32; 3],
        /// Makes its mean over the reachable directions 1.
        pub scale: f32,
        /// Diagonal of its part of degree two.
        pub diagonal: [f32; 3],
        /// Unused.
        pub spare0: f32,
        /// The elements xy, xz, yz of its part of degree two.
        pub off_diagonal: [f32; 3],
        /// Unused.
        pub spare1: f32,
    }
}

crate::stage!(
    /// A workgroup per probe: the scale of its lobe.
    pub PROBE_LOBE = probe_lobe(ProbeSkyPush) { read depth, write lobes } with [Lobe]
);

/// Largest scale: a lobe that is nearly dark wherever the region sees the probe is not blown up past this.
const MOST: f64 = 8.0;

impl Lobe {
    /// A lobe of the user's world in the planner's frame, not scaled yet. Harmonics of degrees one and two are g.w + w'Mw with
    /// M symmetric and without trace; as such they turn with the frame.
    pub fn new(lobe: &harmonics::Lobe, geometry: &SceneGeometry) -> Self {
        let [y, z, x, xy, yz, zz, xz, xx] = lobe.map(f64::from);
        let (root5, half) = (5f64.sqrt(), 0.5 * 15f64.sqrt());
        let linear = 3f64.sqrt() * DVec3::new(x, y, z);
        let off = DVec3::new(half * xy, half * xz, half * yz);
        let quadratic = DMat3::from_cols(
            DVec3::new(half * xx - 0.5 * root5 * zz, off.x, off.y),
            DVec3::new(off.x, -half * xx - 0.5 * root5 * zz, off.z),
            DVec3::new(off.y, off.z, root5 * zz),
        );
        let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| geometry.to_internal.direction(axis));
        let turn = DMat3::from_cols(axes[0], axes[1], axes[2]);
        let [x, y, z] = {
            let turned = turn * quadratic * turn.transpose();
            [turned.x_axis, turned.y_axis, turned.z_axis]
        };
        Self {
            linear: (turn * linear).as_vec3().to_array(),
            scale: 1.0,
            diagonal: DVec3::new(x.x, y.y, z.z).as_vec3().to_array(),
            off_diagonal: DVec3::new(x.y, x.z, y.z).as_vec3().to_array(),
            ..Self::default()
        }
    }

    /// Its value at unit direction `w`.
    pub fn at(&self, w: DVec3) -> f64 {
        let [linear, diagonal, off] = [self.linear, self.diagonal, self.off_diagonal].map(|v| Vec3::from(v).as_dvec3());
        let mixed = DVec3::new(w.x * w.y, w.x * w.z, w.y * w.z);
        f64::from(self.scale) * (1.0 + linear.dot(w) + diagonal.dot(w * w) + 2.0 * off.dot(mixed)).max(0.0)
    }

    /// The lobe scaled so that its mean over the texels with positive `depth` is 1: the twin of `probe_lobe`.
    pub fn scaled(&self, depth: &[f32]) -> Self {
        let plain = Self { scale: 1.0, ..*self };
        let directions = octahedral::directions(depth.len().isqrt() as u32);
        let reachable = directions.iter().zip(depth).filter(|(_, depth)| **depth > 0.0);
        let (sum, count) = reachable.fold((0.0, 0.0), |(sum, count), (w, _)| (sum + plain.at(*w), count + 1.0));
        Self { scale: (count / f64::max(sum, 1e-6)).min(MOST) as f32, ..plain }
    }
}

/// The lobes of `maps`' probes on the device, scaled; `lobes` are those of its probes in the user's world.
///
/// # Errors
/// Where device memory runs out or the device fails.
pub fn upload(
    context: &Arc<Context>,
    geometry: &SceneGeometry,
    maps: &ProbeMaps,
    lobes: &[harmonics::Lobe],
) -> Result<Buffer> {
    let lobes: Vec<Lobe> = lobes.iter().map(|lobe| Lobe::new(lobe, geometry)).collect();
    let buffer = Buffer::from_slice(context, "lobes", &lobes)?;
    let pipeline = Pipeline::new(context, &PROBE_LOBE, &[])?;
    let mut commands = Recorder::new(context)?;
    commands
        .stage(&pipeline)
        .bind(&[&maps.depth, &buffer])
        .push(&ProbeSkyPush { resolution: maps.resolution })
        .linear(lobes.len() as u32);
    commands.submit_and_wait()?;
    drop(commands);
    Ok(buffer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::{Orientation, Proxy};
    use crate::scene::region::Region;
    use crate::scene::samples;

    fn geometry(up: DVec3) -> SceneGeometry {
        let proxy = Proxy::new(&samples::cube(), Orientation::Trusted).unwrap();
        SceneGeometry::new(&proxy, &Region::around_object(proxy.sphere, 0.4, up, None).unwrap()).unwrap()
    }

    const LOBE: harmonics::Lobe = [0.1, -0.2, 0.15, 0.05, -0.1, 0.2, 0.07, -0.03];

    /// If this failed, a scene whose up is not +Z would be given other targets than the same scene upright.
    #[test]
    fn a_lobe_turns_with_the_frame() {
        for up in [DVec3::Z, DVec3::Y, DVec3::new(1.0, -2.0, 0.5)] {
            let geometry = geometry(up.normalize());
            let lobe = Lobe::new(&LOBE, &geometry);
            for w in octahedral::directions(8) {
                let inside = lobe.at(geometry.to_internal.direction(w));
                assert!((inside - harmonics::value(&LOBE, w)).abs() < 1e-6, "up {up}, {w}: {inside}");
            }
        }
    }

    /// Only the mean over what can be photographed counts: without this a point whose radiance varies below the floor would
    /// be given less than it asks for.
    #[test]
    fn a_scaled_lobe_keeps_the_mean_over_reachable_directions() {
        let lobe = Lobe::new(&LOBE, &geometry(DVec3::Z));
        let directions = octahedral::directions(16);
        let depth: Vec<f32> = directions.iter().map(|w| if w.z > 0.2 { 5.0 } else { -5.0 }).collect();
        let scaled = lobe.scaled(&depth);
        let open: Vec<f64> = directions.iter().filter(|w| w.z > 0.2).map(|w| scaled.at(*w)).collect();
        assert!((open.iter().sum::<f64>() / open.len() as f64 - 1.0).abs() < 1e-6);
        assert!((scaled.scale - 1.0).abs() > 0.01, "the case tests nothing");
        // In the dark everywhere: left at the most that it is scaled by.
        let dark = Lobe { linear: [0.0, 0.0, -9.0], ..lobe };
        assert_eq!(f64::from(dark.scaled(&depth).scale), MOST);
    }
}
