//! Walls that photos of a room did not show: plain ones, which stereo does not find, and unphotographed ones.

use glam::DVec3;

use super::bvh::Bvh;
use super::raycast::Ray;
use crate::Result;
use crate::engine::parallel::mapped;
use crate::scene::free_space::{FreeSpace, RESOLUTION};
use crate::scene::known::KnownSpace;
use crate::scene::limits::Limits;
use crate::scene::proxy::{Disc, Occluder, Proxy};
use crate::scene::random;
use crate::scene::region::Region;

/// Viewpoints in the region, and rays from each.
const PLACES: u32 = 256;
const RAYS: u32 = 512;
/// What both are drawn with.
const SEED: u64 = 0x7761_6c6c;
/// Discs along the longest side of the room.
const ALONG: f64 = 48.0;
/// Rays that must reach a place on the bounds before there is taken to be a wall, and more than are stopped so near to it, in discs,
/// that they show one: some slip between the discs of a wall that is known.
const MIN_RAYS: i32 = 2;
const NEAR: f64 = 3.0;

/// Puts discs on the bounds of what photos show wherever rays from free space leave it: a room has an end, and cameras
/// that look towards unknown space are better than none. The discs block rays, and no point is drawn from them. The bounds are
/// those of the proxy, without stray points, and of the space of cameras with its clearance. Returns how many discs there are; triangles
/// stay as they are.
///
/// # Errors
/// Where region and limits leave no free space, or the surface cannot be represented.
pub fn close(proxy: &mut Proxy, region: &Region, limits: &Limits) -> Result<usize> {
    let Occluder::Discs(_) = &proxy.occluder else { return Ok(0) };
    let (low, high) = proxy.robust_bounds();
    let (least, most) = limits.space.as_ref().map_or_else(|| region.bounds(), KnownSpace::bounds);
    let (low, high) = (low.min(least - region.clearance), high.max(most + region.clearance));
    let to_internal = region.to_planner_frame();
    let bvh = Bvh::new(&proxy.occluder, &to_internal)?;
    // Heights and ground, which hold for cameras alone, are along an up that is not this frame's third axis.
    let free = FreeSpace::among(&proxy.occluder, region, &limits.of_everybody(), RESOLUTION)?;
    let cell = (high - low).max_element() / ALONG;
    let cells = ((high - low) / cell).ceil().max(DVec3::ONE);
    // A grid on each of the six sides: two axes along it, the third across.
    let along = |side: usize| [(side / 2 + 1) % 3, (side / 2 + 2) % 3];
    let first: Vec<usize> = (0..=6)
        .scan(0, |sum, side| {
            let here = *sum;
            *sum += along(side % 6).map(|axis| cells[axis] as usize).iter().product::<usize>();
            Some(here)
        })
        .collect();
    let places: Vec<DVec3> = (0..PLACES).map(|i| free.sample(SEED, 0, i)).collect();
    let escapes = mapped(&places, |i, place| {
        let origin = to_internal.point(*place).as_vec3();
        let ray = |k: u32| {
            let [u, v, ..] = random::uniforms(SEED, 1 + i as u32, k);
            let direction = random::direction(u, v);
            let inside = to_internal.direction(direction).as_vec3().normalize();
            let ray = Ray { origin, direction: inside, t_min: 0.0, t_max: f32::MAX };
            let (side, end) = leaving(*place, direction, (low, high))?;
            match bvh.closest_hit(&ray) {
                None => Some((side, end, 1)),
                Some(hit) => {
                    // What is seen at the end or beyond it is known: there is a wall, or a way out.
                    let seen = to_internal.inverse().length(f64::from(hit.distance));
                    (seen > place.distance(end) - NEAR * cell).then_some((side, end, -1))
                }
            }
        };
        (0..RAYS).filter_map(ray).collect::<Vec<(usize, DVec3, i32)>>()
    });
    let mut counts = vec![0i32; first[6]];
    let index = |side: usize, p: DVec3| {
        let at = along(side).map(|axis| (((p[axis] - low[axis]) / cell) as usize).min(cells[axis] as usize - 1));
        first[side] + at[0] * cells[along(side)[1]] as usize + at[1]
    };
    for (side, p, vote) in escapes.into_iter().flatten() {
        counts[index(side, p)] += vote;
    }
    let mut discs = Vec::new();
    for side in 0..6 {
        let [a, b] = along(side);
        for (i, _) in counts[first[side]..first[side + 1]].iter().enumerate().filter(|(_, count)| **count >= MIN_RAYS) {
            let (row, column) = (i / cells[b] as usize, i % cells[b] as usize);
            let (mut centre, mut normal) = (if side % 2 == 0 { low } else { high }, DVec3::ZERO);
            centre[a] = low[a] + cell * (row as f64 + 0.5);
            centre[b] = low[b] + cell * (column as f64 + 0.5);
            normal[side / 2] = if side % 2 == 0 { 1.0 } else { -1.0 };
            // Out to the corners of its cell.
            discs.push(Disc { centre, normal, radius: 0.72 * cell });
        }
    }
    let found = discs.len();
    proxy.assume(discs);
    Ok(found)
}

/// The side of a box, twice the axis and one more for the upper one, and the place on it where a ray from within leaves.
fn leaving(origin: DVec3, direction: DVec3, (low, high): (DVec3, DVec3)) -> Option<(usize, DVec3)> {
    let distance = |axis: usize| {
        let wall = if direction[axis] > 0.0 { high[axis] } else { low[axis] };
        (wall - origin[axis]) / direction[axis]
    };
    let nearest = (0..3).filter(|axis| direction[*axis] != 0.0).min_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
    Some((2 * nearest + usize::from(direction[nearest] > 0.0), origin + distance(nearest) * direction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::Orientation;
    use crate::scene::samples;
    use crate::scene::surface::{Points, Surface};

    /// The sample room, which is 6 x 4 x 2.8, as points, without those that `missing` selects.
    fn points(missing: impl Fn(DVec3) -> bool) -> (Proxy, Region) {
        let mesh = Proxy::new(&samples::room(), Orientation::Trusted).unwrap();
        let drawn = mesh.sample(30_000, 1, 0).into_iter().filter(|point| !missing(point.position));
        let (positions, normals): (Vec<_>, Vec<_>) = drawn.map(|point| (point.position, point.normal)).unzip();
        let region = Region::inside_room(mesh.bounds(), None, DVec3::Z).unwrap();
        let surface = Surface::Points(Points { positions, normals, oriented: true, ..Points::default() });
        (Proxy::new(&surface, Orientation::Trusted).unwrap(), region)
    }

    /// If this failed, plans from few photos would look away from walls that photos did not show, since viewers do not look at
    /// empty space; or a known room would get walls that do not exist.
    #[test]
    fn a_wall_that_is_missing_is_put_where_the_room_ends() {
        let (mut whole, region) = points(|_| false);
        let (low, high) = whole.robust_bounds();
        let few = close(&mut whole, &region, &Limits::default()).unwrap();
        let (mut open, _) = points(|p| p.x > high.x - 0.05 && p.z > 0.1);
        let before = open.occluder.len();
        let found = close(&mut open, &region, &Limits::default()).unwrap();
        let size = high - low;
        let cell = size.max_element() / ALONG;
        let wall = size.y * size.z / (cell * cell);
        assert!((few as f64) < 0.1 * wall, "{few} discs in a room that is known");
        assert!(found as f64 > 0.6 * wall && (found as f64) < 1.4 * wall, "{found} of {wall} discs");
        let Occluder::Discs(discs) = &open.occluder else { unreachable!() };
        let on_it = discs[before..].iter().filter(|disc| disc.centre.x > high.x - 0.2 && disc.normal.x < -0.9).count();
        assert!(on_it as f64 > 0.9 * found as f64, "{on_it} of {found}");
        // No ray leaves any more, and no point is drawn from what is only assumed.
        let bvh = Bvh::new(&open.occluder, &region.to_planner_frame()).unwrap();
        let origin = region.to_planner_frame().point(0.5 * (low + high)).as_vec3();
        let out = (0..500).filter(|i| {
            let [u, v, ..] = random::uniforms(9, 9, *i);
            let direction = random::direction(u, v).as_vec3();
            direction.x > 0.5 && !bvh.any_hit(&Ray { origin, direction, t_min: 0.0, t_max: f32::MAX })
        });
        assert!(out.count() < 5);
        let sampled = open.sample(2000, 3, 0);
        assert!(sampled.iter().filter(|p| p.position.x > high.x - 0.02 && p.position.z > 0.2).count() < 40);
        assert_eq!(open.colours().len(), open.occluder.len());
    }
}
