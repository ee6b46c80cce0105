//! Where expected error lies: on the surface, and in the pictures of the viewers who see most of it.

use glam::{DVec3, Vec3};

use super::expected::{Expectation, Judge, MIN_SHOWN};
use super::law::Law;
use super::look::{Caster, Surroundings, Viewer};
use super::nearest::nearest_cameras;
use crate::Result;
use crate::engine::parallel::mapped;
use crate::planner::metrics::score_point::{View, view};
use crate::scene::camera::Camera;
use crate::visibility::device_scene::SceneGeometry;

/// Viewers that are pictured.
const PICTURED: usize = 5;
/// Longest side of their pictures in pixels.
const LONGEST: u32 = 120;
/// Looks that a point's error is the mean of.
const LOOKS: usize = 12;
/// Pairs of point and look that are worth their time.
const MAX_PAIRS: usize = 300_000_000;

/// Expected error on the surface, against its median over all that viewers look at there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ErrorMap {
    /// By point in decibels, in the order of the points.
    pub points: Vec<f32>,
    /// The viewers who see the greatest error on the surface, greatest first.
    pub worst: Vec<Worst>,
}

/// A viewer who sees much error.
#[derive(Clone, Debug, PartialEq)]
pub struct Worst {
    /// The viewer.
    pub camera: Camera,
    /// Decibels of the mean over what the viewer sees of the surface.
    pub db: f32,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// What the viewer looks at, 8-bit sRGB: shaded surface, from blue where error is small over white to red where it is great; grey
    /// beside the surface.
    pub picture: Vec<u8>,
    /// Decibels about the median at which its colours end, either way.
    pub span_db: f64,
}

/// What is expected of `cameras`, and its map at `points`, by the viewers of `judge`; all in the user's world.
///
/// # Errors
/// Where the device fails.
pub(crate) fn error_map(
    judge: &Judge,
    geometry: &SceneGeometry,
    around: Surroundings,
    law: &Law,
    cameras: &[Camera],
    points: &[DVec3],
) -> Result<(Expectation, ErrorMap)> {
    let expectation = judge.expect(cameras)?;
    let (looks, errors) = (judge.looks()?, judge.errors()?);
    let each = looks.len() / judge.viewers().len().max(1);
    let mut order: Vec<(usize, f32)> = looks
        .chunks(each.max(1))
        .zip(errors.chunks(each.max(1)))
        .enumerate()
        .filter_map(|(viewer, (looks, errors))| {
            let of = looks.iter().zip(errors).filter(|(look, _)| look.normal != [0.0; 3]);
            let (count, sum) = of.fold((0, 0.0), |(count, sum), (_, error)| (count + 1, sum + error.abs()));
            (count >= MIN_SHOWN).then(|| (viewer, sum / count as f32))
        })
        .collect();
    let shown: Vec<(Vec3, f32)> = looks
        .iter()
        .zip(errors)
        .filter(|(look, _)| look.normal != [0.0; 3])
        // Negative where no view sees the point.
        .map(|(look, error)| (Vec3::from(look.position), error.abs()))
        .collect();
    // Odd, so that it is not always the same pixel of every viewer.
    let every = (points.len() * shown.len()).div_ceil(MAX_PAIRS) | 1;
    let shown: Vec<(Vec3, f32)> = shown.into_iter().step_by(every).collect();
    let mut all: Vec<f32> = shown.iter().map(|(_, error)| *error).collect();
    let middle = all.len() / 2;
    let median = if all.is_empty() { 1.0 } else { f64::from(*all.select_nth_unstable_by(middle, f32::total_cmp).1) };
    let against = |error: f64| 10.0 * (error / median).max(f64::MIN_POSITIVE).log10();
    let at = mapped(points, |_, point| {
        let point = geometry.to_internal.point(*point).as_vec3();
        let mut near: Vec<(f32, f32)> = shown.iter().map(|(p, error)| (p.distance_squared(point), *error)).collect();
        if near.is_empty() {
            return f32::NAN;
        }
        let count = LOOKS.min(near.len());
        near.select_nth_unstable_by(count - 1, |a, b| a.0.total_cmp(&b.0));
        let mean = near[..count].iter().map(|(_, error)| f64::from(*error)).sum::<f64>() / count as f64;
        against(mean) as f32
    });
    let views: Vec<View> = cameras.iter().map(|camera| view(geometry, camera)).collect();
    let (caster, span_db) = (Caster::new(geometry, around), law.span_db());
    order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    // A file of few cameras names each many times.
    let mut worst: Vec<(usize, f32)> = Vec::new();
    for (i, error) in order {
        let pose = |i: usize| judge.viewers()[i].pose;
        if worst.len() < PICTURED && worst.iter().all(|(other, _)| pose(*other) != pose(i)) {
            worst.push((i, against(f64::from(error)) as f32));
        }
    }
    let pictured = |(i, db): (usize, f32)| {
        let camera = &judge.viewers()[i];
        let of = &camera.intrinsics;
        let longest = of.width.max(of.height).max(1);
        let size = [of.width, of.height].map(|side| (side * LONGEST).div_ceil(longest));
        let viewer = Viewer::new(camera, geometry);
        let rows: Vec<u32> = (0..size[1]).collect();
        let picture = mapped(&rows, |_, row| {
            let pixel = |column: u32| {
                let place = [(column, size[0]), (*row, size[1])].map(|(at, all)| (at as f32 + 0.5) / all as f32);
                let look = caster.look(&viewer, place);
                if look.normal == [0.0; 3] {
                    return [200; 3];
                }
                let found = nearest_cameras(&geometry.bvh, &look, &views);
                let db = against(law.error(&found, f64::from(look.footprint)));
                let facing = Vec3::from(look.normal).dot(Vec3::from(look.direction)).abs();
                shaded(db / span_db, facing)
            };
            (0..size[0]).flat_map(pixel).collect::<Vec<u8>>()
        });
        Worst { camera: camera.clone(), db, size, picture: picture.concat(), span_db }
    };
    Ok((expectation, ErrorMap { points: at, worst: worst.into_iter().map(pictured).collect() }))
}

/// The colour of so many decibels about the median, by `law`: from blue over white to red.
pub(crate) fn colour_of(db: f64, law: &Law) -> [u8; 3] {
    shaded(db / law.span_db(), 1.0)
}

/// The colour of a surface that faces the viewer so far, from -1, least error, to 1, most.
fn shaded(part: f64, facing: f32) -> [u8; 3] {
    const ENDS: [[f64; 3]; 2] = [[33.0, 102.0, 172.0], [178.0, 24.0, 43.0]];
    let part = part.clamp(-1.0, 1.0);
    let end = ENDS[usize::from(part > 0.0)];
    let light = 0.45 + 0.55 * f64::from(facing);
    end.map(|channel| (light * (245.0 + (channel - 245.0) * part.abs())).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::quality::law::NO_END;

    /// If this failed, pictures would be red throughout by a steep law, or hardly coloured by a flat one.
    #[test]
    fn colours_span_what_the_law_does() {
        let [object, room] = [true, false].map(Law::embedded);
        let flat = Law { angle: [1.0, 0.0, 0.0], most: NO_END as f32, ..Law::default() };
        // 0.7 radians at a logarithm each, in decibels.
        assert!((flat.span_db() - 3.04).abs() < 0.01 && room.span_db() > 3.0 * flat.span_db());
        for law in [object, room, flat] {
            let span = law.span_db();
            assert_eq!(colour_of(span, &law), [178, 24, 43]);
            assert_eq!(colour_of(2.0 * span, &law), [178, 24, 43]);
            assert_eq!(colour_of(0.0, &law), [245; 3]);
            assert_ne!(colour_of(0.9 * span, &law), [178, 24, 43]);
            assert_eq!(colour_of(-span, &law), [33, 102, 172]);
        }
    }
}
