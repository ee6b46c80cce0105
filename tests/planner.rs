//! The planner on the device against its twin, on scenes that our own code makes.

use std::ops::ControlFlow;
use std::sync::Arc;

use camsplat::metrics::score_point::{Field, Scorer, aggregate};
use camsplat::plan::config::{Config, Preset};
use camsplat::plan::planner::Planner;
use camsplat::scene::camera::{Camera, Intrinsics};
use camsplat::scene::proxy::{Orientation, Proxy};
use camsplat::scene::region::Region;
use camsplat::scene::samples;
use camsplat::visibility::device_scene::DeviceScene;
use camsplat::vulkan::{Context, Options};
use glam::DVec3;

fn context() -> Arc<Context> {
    Context::new(&Options { validation: true, ..Options::default() })
        .expect("lavapipe and validation layers: ./setup.sh")
}

fn intrinsics() -> Intrinsics {
    Intrinsics::from_fov(800, 800, 50f64.to_radians())
}

#[test]
fn smoke() {
    let context = context();
    let t = std::time::Instant::now();
    for preset in [Preset::Object, Preset::Room] {
        let surface = if preset == Preset::Object { samples::object() } else { samples::room() };
        let proxy = Proxy::new(&surface, Orientation::Trusted).unwrap();
        let region = if preset == Preset::Object {
            Region::around_object(proxy.sphere, 0.5 * intrinsics().inscribed_cone(), DVec3::Z, None).unwrap()
        } else {
            Region::inside_room(proxy.robust_bounds(), None, DVec3::Z).unwrap()
        };
        let scene = DeviceScene::new(&context, &proxy, &region).unwrap();
        println!("scene {:?}", t.elapsed());
        let config = Config::new(preset, if preset == Preset::Object { 50 } else { 300 });
        let planner = Planner::new(&context, &scene, &proxy, &intrinsics(), &[], config).unwrap();
        println!("planner {:?} s0 {} {:?}", t.elapsed(), planner.start_scale(), planner.settings());
        println!("R {}", planner.maps().resolution);
        let outcome = planner.run(None, |_| ControlFlow::Continue(())).unwrap();
        println!("run {:?} {}", t.elapsed(), outcome.seconds);
        let points = proxy.sample(1000, 0, 1);
        let scorer = Scorer::new(&context, &scene, &points).unwrap();
        for h in outcome.history.iter().step_by(100) {
            println!("{h:?}");
        }
        for (i, poses) in &outcome.snapshots {
            if i % 200 != 0 {
                continue;
            }
            let cameras: Vec<Camera> = poses
                .iter()
                .enumerate()
                .map(|(k, pose)| Camera { name: format!("{k}"), pose: *pose, intrinsics: intrinsics() })
                .collect();
            println!("{i} {:?}", aggregate(&scorer.score(&cameras, Field::Cone).unwrap()));
        }
        println!("score {:?}", t.elapsed());
    }
    assert_eq!(context.messages(), Vec::<String>::new());
}
