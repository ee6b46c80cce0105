//! What probes see of the surface and of the region, on the device, against the twin.

use crate::support::device::context;
use camsplat::scene::octahedral;
use camsplat::scene::proxy::{Orientation, Proxy};
use camsplat::scene::region::{Region, Shape};
use camsplat::scene::samples;
use camsplat::scene::surface::{Points, Surface};
use camsplat::visibility::device_scene::{DeviceScene, SceneGeometry};
use camsplat::visibility::probe_depth::{ProbeMaps, probe_depth, probe_sky};
use glam::{DVec3, Vec3};

const RESOLUTION: u32 = 32;

/// Regions of each kind: a shell with a floor that holds the surface, a box within walls, a shell within walls.
fn scenes() -> [(&'static str, Surface, Region); 3] {
    let shell = Shape::Shell { centre: DVec3::ZERO, r_min: 1.2, r_max: 1.8 };
    let inside = Shape::Box { min: DVec3::splat(0.2), max: DVec3::new(5.8, 3.8, 2.6) };
    let amid = Shape::Shell { centre: DVec3::new(2.0, 1.8, 1.5), r_min: 0.4, r_max: 1.2 };
    [
        ("shell in a room", samples::room(), Region { shape: amid, up: DVec3::Z, floor: None, clearance: 0.1 }),
        ("object", samples::object(), Region { shape: shell, up: DVec3::Z, floor: Some(-0.3), clearance: 0.05 }),
        ("room", samples::room(), Region { shape: inside, up: DVec3::Z, floor: None, clearance: 0.15 }),
    ]
}

/// A scan of a surface: points with normals.
fn cloud(surface: &Surface) -> Surface {
    let points = Proxy::new(surface, Orientation::Trusted).expect("a good surface").sample(20_000, 5, 7);
    Surface::Points(Points {
        positions: points.iter().map(|point| point.position).collect(),
        normals: points.iter().map(|point| point.normal).collect(),
        oriented: true,
        ..Points::default()
    })
}

/// Were a map wrong, a camera would count as seeing through a wall, or light would be required from where no camera may be.
/// Device and twin take directions that differ in the last bits, so that a ray within about a millionth of a radian of the rim of
/// a triangle, a disc or the region may come out on the other side of it. A map of an object has a few dozen radians of rims, one
/// in a hundred thousand texels that near to them; discs have more rims. One in a thousand may differ.
#[test]
fn maps_are_those_of_the_twin() {
    let context = context();
    for (name, surface, region) in scenes() {
        for (kind, surface) in [("discs", cloud(&surface)), ("triangles", surface)] {
            let proxy = Proxy::new(&surface, Orientation::Trusted).expect("a good surface");
            let geometry = SceneGeometry::new(&proxy, &region).expect("a good region");
            let scene = DeviceScene::new(&context, geometry).expect("room for it");
            let maps = ProbeMaps::new(&context, &scene, &proxy.sample(48, 3, 0), RESOLUTION).expect("maps");
            let depth = maps.download().expect("depths");
            let directions: Vec<Vec3> = octahedral::directions(RESOLUTION).iter().map(|d| d.as_vec3()).collect();
            let (mut off, mut reached, mut missed) = (0, 0, 0);
            for (probe, row) in maps.probes.iter().zip(depth.chunks(directions.len())) {
                let twin = |direction: &Vec3| probe_depth(&scene.geometry, probe, *direction);
                for (device, twin) in row.iter().zip(directions.iter().map(twin)) {
                    // Relative to the distance, or to the surface's own size where it is near.
                    let close = (device - twin).abs() <= 1e-3 * twin.abs().max(0.01);
                    off += !close as usize;
                    reached += (twin > 0.0) as usize;
                    missed += (twin.abs() >= 1e30) as usize;
                }
                assert_eq!(probe.sky, probe_sky(row), "{name}, {kind}: the share of the sky");
            }
            assert!(1000 * off <= depth.len(), "{name}, {kind}: {off} of {} texels differ", depth.len());
            // Both answers must occur, or nothing was tested.
            assert!(50 * reached > depth.len() && 50 * (depth.len() - reached) > depth.len(), "{name}, {kind}");
            // Rays that leave an object's scene hit nothing.
            assert!(missed > 0 || name != "object", "{name}, {kind}");
        }
    }
    assert_eq!(context.messages(), Vec::<String>::new(), "the validation layers found fault");
}

/// A plan of few views keeps its first maps and drops hopeless probes from them; were rows out of step, a probe would see what
/// another sees.
#[test]
fn maps_that_are_kept_are_those_cast_alone() {
    let context = context();
    for (name, surface, region) in scenes() {
        let proxy = Proxy::new(&surface, Orientation::Trusted).expect("a good surface");
        let geometry = SceneGeometry::new(&proxy, &region).expect("a good region");
        let scene = DeviceScene::new(&context, geometry).expect("room for it");
        let points = proxy.sample(48, 3, 0);
        let maps = ProbeMaps::new(&context, &scene, &points, 16).expect("maps");
        let few: Vec<_> = points.into_iter().step_by(3).collect();
        let alone = ProbeMaps::new(&context, &scene, &few, 16).expect("maps");
        let wanted = |position: [f32; 3]| alone.probes.iter().any(|probe| probe.position == position);
        let kept = maps.with(&context, |probe| wanted(probe.position)).expect("room for it");
        assert_eq!(kept.probes, alone.probes, "{name}");
        assert_eq!(kept.download().expect("depths"), alone.download().expect("depths"), "{name}");
    }
}
