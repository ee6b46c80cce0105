//! Which side of a mesh its points are looked at from, where the mesh itself leaves that open.

use glam::DVec3;

use super::device_scene::SceneGeometry;
use super::raycast::Ray;
use crate::engine::parallel::mapped;
use crate::scene::proxy::SurfacePoint;
use crate::scene::random;

/// So many places that see a point are enough.
const ENOUGH: u32 = 32;
const SIDE_STREAM: u32 = 0x7369_6465;

impl SceneGeometry {
    /// `points` of the surface, in the user's world, with normals toward `places`, in the planner's frame.
    ///
    /// The winding of an open part of a mesh need not say which side that is: scans are inside out, faces are wound both ways, and of a
    /// sheet both sides are looked at. A point of one faces the side that places see, and where they see both either side, with probability
    /// by how many see it. One that none sees keeps its normal, and so do points of closed parts and of clouds.
    pub fn facing(&self, mut points: Vec<SurfacePoint>, places: &[DVec3]) -> Vec<SurfacePoint> {
        let turned = mapped(&points, |index, point| {
            let [mut front, mut back] = [0, 0];
            let [below, above] = [-point.lift, point.lift]
                .map(|lift| self.to_internal.point(point.position + lift * point.normal).as_vec3());
            let (at, normal) = (self.to_internal.point(point.position), self.to_internal.direction(point.normal));
            let places: &[DVec3] = if point.either_side { places } else { &[] };
            for place in places {
                let is_ahead = normal.dot(place - at) > 0.0;
                let origin = if is_ahead { above } else { below };
                let toward = place.as_vec3() - origin;
                let t_max = toward.length().max(f32::MIN_POSITIVE);
                if !self.bvh.any_hit(&Ray { origin, direction: toward / t_max, t_min: 0.0, t_max }) {
                    *(if is_ahead { &mut front } else { &mut back }) += 1;
                }
                if front + back == ENOUGH {
                    break;
                }
            }
            // A run takes fewer than 2^32 points.
            random::uniforms(0, SIDE_STREAM, index as u32)[0] * f64::from(front + back) < f64::from(back)
        });
        for (point, turned) in points.iter_mut().zip(turned) {
            if turned {
                point.normal = -point.normal;
            }
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::{Orientation, Proxy};
    use crate::scene::region::Region;
    use crate::scene::samples;
    use crate::scene::surface::{Mesh, Surface};

    /// Points of what `surface` becomes by `change`, as they are drawn and as they face: where one may stand all around it, above
    /// `floor`.
    fn points(surface: Surface, floor: Option<f64>, change: impl Fn(&mut Mesh)) -> [Vec<SurfacePoint>; 2] {
        let Surface::Mesh(mut mesh) = surface else { panic!("a sample is no mesh") };
        change(&mut mesh);
        let proxy = Proxy::new(&Surface::Mesh(mesh), Orientation::Outward(DVec3::ZERO)).unwrap();
        let region = Region::around_object(proxy.sphere, 0.4, DVec3::Z, floor).unwrap();
        let geometry = SceneGeometry::new(&proxy, &region).unwrap();
        let places: Vec<DVec3> = (0..100).map(|i| geometry.free.sample(0, 0, i)).collect();
        let drawn = proxy.sample(1000, 3, 0);
        [drawn.clone(), geometry.facing(drawn, &places)]
    }

    fn turn(triangle: &mut [u32; 3]) {
        triangle.swap(1, 2);
    }

    /// Points of a closed object face out already. If they were turned, plans and figures of all objects would change.
    #[test]
    fn points_of_closed_objects_stay_as_they_are() {
        for surface in [samples::sphere(1.0, 48), samples::cube(), samples::object()] {
            let [drawn, facing] = points(surface, None, |_| ());
            assert_eq!(drawn, facing);
        }
    }

    /// An open scan that is inside out, or whose faces are wound both ways, would be said to be unseen from everywhere around it.
    #[test]
    fn points_of_open_scans_face_out_however_they_are_wound() {
        let open = |mesh: &mut Mesh, every: usize| {
            let above = |t: &[u32; 3]| t.iter().all(|corner| mesh.positions[*corner as usize].z > -0.7);
            mesh.triangles = mesh.triangles.iter().copied().filter(above).collect();
            mesh.colours.clear();
            mesh.triangles.iter_mut().step_by(every).for_each(turn);
        };
        for every in [1, 2] {
            let [drawn, facing] = points(samples::sphere(1.0, 48), Some(-0.6), |mesh| open(mesh, every));
            let outward = |points: &[SurfacePoint]| points.iter().filter(|p| p.normal.dot(p.position) > 0.0).count();
            assert!(outward(&drawn) < 600, "{} of the points were wound outward", outward(&drawn));
            assert_eq!(outward(&facing), 1000, "with every {every} of its faces turned");
        }
    }

    /// Of a cloth in the air both sides are looked at, of one on a table the upper one alone, whichever side its faces have.
    #[test]
    fn points_of_sheets_face_either_side_as_they_are_seen() {
        let up = |points: &[SurfacePoint]| points.iter().filter(|point| point.normal.z > 0.0).count();
        let [drawn, facing] = points(samples::plane(1.0, 8), None, |_| ());
        assert!(up(&drawn) == 1000 && (430..=570).contains(&up(&facing)), "{} of 1000 face up", up(&facing));
        let [drawn, facing] =
            points(samples::plane(1.0, 8), Some(0.0), |mesh| mesh.triangles.iter_mut().for_each(turn));
        assert_eq!([up(&drawn), up(&facing)], [0, 1000]);
    }
}
