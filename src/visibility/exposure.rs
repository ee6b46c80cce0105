//! Which side of a disc is the outer one, and which discs lie buried inside, where the cloud itself does not define it: a
//! trained splat has centres under the surface, and the shortest axis of a splat has no sign.

use glam::Vec3;

use super::bvh::Bvh;
use super::raycast::Ray;
use crate::Result;
use crate::engine::parallel::mapped;
use crate::scene::octahedral;
use crate::scene::proxy::{Disc, Occluder, Proxy};
use crate::scene::similarity::Similarity;

/// Directions from each disc: the texels of an octahedral map of so many a side.
const RESOLUTION: u32 = 5;
/// A disc of whose rays fewer than this part escapes on either side is buried.
const MIN_OPEN: f32 = 0.125;

/// Turns each disc of an object to the side from which more rays escape, and marks the buried ones: they still block rays, but no
/// point is drawn from them. Triangles stay as they are. Returns how many are buried.
///
/// # Errors
/// Where the discs are too many or too far out for the hierarchy.
pub(crate) fn expose(proxy: &mut Proxy) -> Result<usize> {
    let to_unit = Similarity::to_unit_sphere(proxy.sphere.0, proxy.sphere.1.max(f64::MIN_POSITIVE));
    let bvh = Bvh::new(&proxy.occluder, &to_unit)?;
    let Occluder::Discs(discs) = &mut proxy.occluder else { return Ok(0) };
    let directions: Vec<Vec3> = octahedral::directions(RESOLUTION).iter().map(|d| d.as_vec3()).collect();
    // Part of the rays on the side of `normal` that escape from there.
    let open = |centre: Vec3, normal: Vec3, lift: f32| {
        let outward = directions.iter().filter(|direction| direction.dot(normal) > 0.1);
        let (mut all, mut free) = (0, 0);
        for &direction in outward {
            let origin = centre + lift * normal;
            all += 1;
            free += !bvh.any_hit(&Ray { origin, direction, t_min: 0.0, t_max: f32::MAX }) as u32;
        }
        free as f32 / (all as f32).max(1.0)
    };
    let sides = |disc: &Disc| {
        let centre = to_unit.point(disc.centre).as_vec3();
        let (normal, lift) = (disc.normal.as_vec3(), to_unit.length(disc.radius) as f32);
        [open(centre, normal, lift), open(centre, -normal, lift)]
    };
    let open = mapped(discs, |_, disc| sides(disc));
    let mut buried = Vec::with_capacity(discs.len());
    for (disc, [front, back]) in discs.iter_mut().zip(open) {
        if back > front {
            disc.normal = -disc.normal;
        }
        buried.push(front.max(back) < MIN_OPEN);
    }
    let count = buried.iter().filter(|buried| **buried).count();
    // A cloud of which nothing is open is no object seen from outside: nothing better is known of it then.
    if count < buried.len() {
        proxy.buried = buried;
        return Ok(count);
    }
    Ok(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::Orientation;
    use crate::scene::random;
    use crate::scene::surface::{Points, Surface};
    use glam::DVec3;

    /// A ring's inner side faces its axis: pointing all normals away from the centre would put its probes inside it. And
    /// points under the surface must not be planned for.
    #[test]
    fn a_rings_discs_face_out_and_its_core_is_buried() {
        let ring = |i: u32, tube: f64| {
            let [u, v, ..] = random::uniforms(3, 0, i);
            let (a, b) = (std::f64::consts::TAU * u, std::f64::consts::TAU * v);
            let centre = DVec3::new(a.cos(), a.sin(), 0.0);
            let out = b.cos() * centre + b.sin() * DVec3::Z;
            (centre + tube * out, out)
        };
        let (shell, core) = (6000, 300);
        let all: Vec<_> = (0..shell + core).map(|i| ring(i, if i < shell { 0.4 } else { 0.05 })).collect();
        let points = Points {
            positions: all.iter().map(|p| p.0).collect(),
            normals: all.iter().map(|p| p.1).collect(),
            radii: vec![0.06; all.len()],
            ..Points::default()
        };
        let mut proxy = Proxy::new(&Surface::Points(points), Orientation::Outward(DVec3::ZERO)).unwrap();
        let buried = expose(&mut proxy).unwrap();
        let Occluder::Discs(discs) = &proxy.occluder else { panic!("points became triangles") };
        let (mut wrong, mut seen_core) = (0, 0);
        for (disc, buried) in discs.iter().zip(&proxy.buried) {
            let flat = DVec3::new(disc.centre.x, disc.centre.y, 0.0).normalize();
            let out = disc.centre - flat;
            if out.length() < 0.2 {
                seen_core += !*buried as usize;
            } else {
                wrong += (disc.normal.dot(out) < 0.0 || *buried) as usize;
            }
        }
        // A randomly scattered shell leaves gaps of a percent or two through which some of the core is seen.
        assert!(seen_core < core as usize / 20, "{seen_core} points of the core were left open; {buried} are buried");
        assert!(wrong < discs.len() / 50, "{wrong} of {} discs of the shell face in or are called buried", discs.len());
        let drawn = proxy.sample(2000, 0, 0);
        let flat = |p: DVec3| DVec3::new(p.x, p.y, 0.0).normalize();
        let in_core = drawn.iter().filter(|point| point.position.distance(flat(point.position)) < 0.2).count();
        assert!(in_core <= seen_core, "{in_core} probes stand in the core");
    }
}
