//! Depth from pictures, hulls and the command `proxy` on a ball above a table.

use std::f64::consts::PI;

use crate::support::ball_scene::{BALL, HEIGHT, TABLE, WIDTH, cameras, photograph, pixel, ray, true_depth};
use crate::support::command::{Place, ended};
use crate::support::device::context;
use camsplat::engine::vulkan::Buffer;
use camsplat::files::io;
use camsplat::files::photos::volume::{Volume, around_focus};
use camsplat::files::photos::{Photo, PhotoSet};
use camsplat::photogrammetry::stereo::choose::neighbours;
use camsplat::photogrammetry::stereo::consistency::{check, support};
use camsplat::photogrammetry::stereo::cost::{NO_MATCH, Plane, Scene};
use camsplat::photogrammetry::stereo::depth::Sweeper;
use camsplat::photogrammetry::stereo::frame::{MAX_PAIRS, StereoPair, StereoView, device_pairs, device_views};
use camsplat::photogrammetry::stereo::hull::{Evidence, Hull, carve};
use camsplat::photogrammetry::stereo::{StereoOptions, ball_depths, reconstruct};
use camsplat::scene::camera::{Camera, Pose};
use camsplat::scene::surface::{Points, Surface};
use camsplat::scene::voxels::Grid;
use glam::{DVec2, DVec3, Vec2, Vec3};

/// What the device is given of cameras: views, pictures, pairs and masks of the ball.
struct Given {
    cameras: Vec<Camera>,
    views: Vec<StereoView>,
    pictures: Vec<f32>,
    pairs: Vec<StereoPair>,
    masks: Vec<f32>,
}

fn given(count: u32) -> Given {
    let cameras = cameras(count);
    let ranges = ball_depths(&cameras, &Volume { centre: DVec3::ZERO, radius: 1.0 });
    let near = neighbours(&cameras, &ranges);
    let mut views = device_views(&cameras, &ranges);
    views.iter_mut().zip(&near).for_each(|(view, near)| view.pairs = near.len() as u32);
    let all = |ball_only: bool| {
        let of = move |camera: &Camera| -> Vec<(f64, f64)> {
            (0..WIDTH * HEIGHT).map(|i| pixel(camera, i % WIDTH, i / WIDTH, ball_only)).collect()
        };
        cameras.iter().flat_map(of).collect::<Vec<_>>()
    };
    let pictures = all(false).into_iter().map(|(brightness, _)| brightness as f32).collect();
    let masks = all(true).into_iter().map(|(_, cover)| cover as f32).collect();
    Given { pairs: device_pairs(&cameras, &near), cameras, views, pictures, masks }
}

/// Planes of the sweep.
const HYPOTHESES: u32 = 48;

/// If this failed, the device would take the wrong depth for the best, by a cost that is not the one that is written down:
/// the sweep's cost is the least that the twin finds among the same planes (or less, by the parabola between them), and
/// after refinement each cost is the twin's of that very plane. Device and twin differ in rounding, so that a hundredth of
/// the pixels may differ by more than a thousandth.
#[test]
fn costs_are_those_of_the_twin() {
    let context = context();
    let given = given(16);
    let scene = Scene { views: &given.views, pictures: &given.pictures, pairs: &given.pairs };
    let sweeper = Sweeper::new(&context, &given.views, &given.pictures, &given.pairs).unwrap();
    let none = Hull::none(&context).unwrap();
    let view = &given.views[3];
    assert!(view.pairs >= 3, "{} neighbours test little", view.pairs);
    let at = |i: usize| [(i as u32 % WIDTH) as i32, (i as u32 / WIDTH) as i32];
    for rounds in [0, 4] {
        let map = sweeper.depth(3, HYPOTHESES, rounds, &none, 5).unwrap();
        let mut off = 0;
        let tested: Vec<usize> = (0..map.costs.len()).step_by(7).collect();
        for &i in &tested {
            let own = scene.cost(3, at(i), map.planes[i]);
            let mut wrong = (own - map.costs[i]).abs() > 1e-3;
            if rounds == 0 {
                let best = (0..HYPOTHESES)
                    .map(|k| {
                        let part = k as f32 / (HYPOTHESES - 1) as f32;
                        let inverse_depth = (1.0 - part) / view.far + part / view.near;
                        scene.cost(3, at(i), Plane { slope: Vec2::ZERO, inverse_depth })
                    })
                    .fold(NO_MATCH, f32::min);
                wrong |= map.costs[i] > best + 1e-3;
            }
            off += usize::from(wrong);
        }
        assert!(100 * off <= tested.len(), "{rounds} rounds: {off} of {} differ", tested.len());
    }
    assert_eq!(context.messages(), [""; 0], "the validation layers found fault");
}

/// Whether a pixel of true depth is within what is searched, and at least two neighbours see what it shows.
fn can_be_found(given: &Given, reference: usize, i: u32, truth: f64) -> bool {
    let view = &given.views[reference];
    let p = view.unproject((i % WIDTH) as f32 + 0.5, (i / WIDTH) as f32 + 0.5, truth as f32);
    let sees = |pair: &&StereoPair| {
        let to = pair.view as usize;
        given.views[to].texel(p).is_some_and(|(texel, depth)| {
            let texel = texel as u32 - given.views[to].first;
            let first = true_depth(&given.cameras[to], texel % WIDTH, texel / WIDTH, false);
            (f64::from(depth) / first - 1.0).abs() < 0.02
        })
    };
    let pairs = &given.pairs[MAX_PAIRS * reference..][..view.pairs as usize];
    (f64::from(view.near)..f64::from(view.far)).contains(&truth) && pairs.iter().filter(sees).count() >= 2
}

/// If this failed, a proxy from photos would be in the wrong place or full of holes: of pixels that at least two neighbours see
/// too, nine in ten must have a depth within 2% of the true one; all of them show texture. Refinement must help, or it is wasted time.
#[test]
fn depths_of_a_textured_scene_are_found() {
    let context = context();
    let given = given(16);
    let sweeper = Sweeper::new(&context, &given.views, &given.pictures, &given.pairs).unwrap();
    let none = Hull::none(&context).unwrap();
    let good = |rounds: usize| {
        let map = sweeper.depth(2, HYPOTHESES, rounds, &none, 0).unwrap();
        let (mut good, mut close, mut all) = (0, 0, 0);
        for i in 0..WIDTH * HEIGHT {
            let truth = true_depth(&given.cameras[2], i % WIDTH, i / WIDTH, false);
            if can_be_found(&given, 2, i, truth) {
                all += 1;
                let off = (f64::from(map.depth(i as usize)) / truth - 1.0).abs();
                good += u32::from(map.costs[i as usize] < 0.5 && off < 0.02);
                close += u32::from(off < 0.005);
            }
        }
        assert!(all > WIDTH * HEIGHT / 2, "{all} pixels test little");
        (f64::from(good) / f64::from(all), f64::from(close) / f64::from(all))
    };
    let (swept, refined) = (good(0), good(4));
    println!("within 2% and 0.5%: swept {swept:.3?}, refined {refined:.3?}");
    assert!(refined.0 >= 0.9, "only {:.1}% within 2%", 100.0 * refined.0);
    assert!(refined.1 > swept.1, "refinement: {refined:?} after {swept:?}");
}

/// If this failed, depths that no other view agrees with would stay, or good ones would go.
#[test]
fn support_is_that_of_the_twin_and_knows_wrong_depths() {
    let context = context();
    let given = given(12);
    let mut depths: Vec<f32> = given
        .cameras
        .iter()
        .flat_map(|camera| (0..WIDTH * HEIGHT).map(move |i| true_depth(camera, i % WIDTH, i / WIDTH, false) as f32))
        .collect();
    // A patch of view 4 floats before the scene.
    let wrong = |i: usize| i / (WIDTH * HEIGHT) as usize == 4 && i.is_multiple_of(5);
    (0..depths.len()).filter(|i| wrong(*i)).for_each(|i| depths[i] *= 0.8);
    let buffer = Buffer::from_slice(&context, "views", &given.views).unwrap();
    let device = check(&context, &given.views, &buffer, &depths, 0.01).unwrap();
    let (mut off, mut fooled, mut doubted) = (0, 0, 0);
    for (i, found) in device.iter().enumerate() {
        let (view, pixel) = (i / (WIDTH * HEIGHT) as usize, i as u32 % (WIDTH * HEIGHT));
        off += u32::from(*found != support(&given.views, &depths, view, [pixel % WIDTH, pixel / WIDTH], 0.01));
        fooled += u32::from(wrong(i) && found.agree > found.through);
        doubted += u32::from(!wrong(i) && depths[i] > 0.0 && found.agree == 0);
    }
    let all = device.len() as u32;
    assert!(1000 * off <= all, "{off} of {all} differ from the twin");
    let patch = (0..device.len()).filter(|i| wrong(*i)).count() as u32;
    assert!(20 * fooled <= patch, "{fooled} of {patch} floating depths were believed");
    assert!(20 * doubted <= all, "{doubted} of {all} true depths found no support");
}

/// If this failed, a hull would cut into the object or leave what the masks rule out. The hull of a ball holds the ball;
/// its surface points out of it.
#[test]
fn the_hull_is_that_of_the_twin_and_holds_the_ball() {
    let context = context();
    let given = given(12);
    let nothing = vec![0f32; given.masks.len()];
    let evidence = Evidence { views: &given.views, masks: &given.masks, depths: &nothing, least: 4, behind: 0.1 };
    let grid = Grid { origin: DVec3::splat(-0.8), cell: 1.6 / 40.0, dims: [40; 3] };
    let hull = Hull::carve(&context, grid, &evidence).unwrap();
    let (mut off, mut volume) = (0, 0.0);
    for (i, cell) in hull.cells().iter().enumerate() {
        let centre = grid.centre(grid.coordinates(i));
        off += u32::from((*cell != 0) != carve(&evidence, centre.as_vec3()));
        volume += f64::from(*cell) * grid.cell.powi(3);
        let inside = centre.distance(BALL.0) < BALL.1 - 0.5 * grid.cell;
        assert!(!inside || *cell != 0, "the hull lacks {centre}, which is in the ball");
    }
    assert!(off <= 10, "{off} voxels differ from the twin");
    let ball = 4.0 / 3.0 * PI * BALL.1.powi(3);
    assert!((1.0..1.5).contains(&(volume / ball)), "the hull has {:.2} times the ball's volume", volume / ball);
    let surface = hull.surface();
    let outward = surface.iter().filter(|(p, n)| n.dot(*p - BALL.0) > 0.0).count();
    assert!(surface.len() > 500 && 100 * outward >= 99 * surface.len(), "{outward} of {} outward", surface.len());
}

/// If this failed, depths behind a voxel would not carve it: a hollow would stay filled.
#[test]
fn depths_that_see_through_a_voxel_carve_it() {
    let context = context();
    let given = given(12);
    let whole = vec![1f32; given.masks.len()];
    let depths: Vec<f32> = given
        .cameras
        .iter()
        .flat_map(|camera| (0..WIDTH * HEIGHT).map(move |i| true_depth(camera, i % WIDTH, i / WIDTH, false) as f32))
        .collect();
    let evidence = Evidence { views: &given.views, masks: &whole, depths: &depths, least: 4, behind: 0.1 };
    let grid = Grid { origin: DVec3::splat(-0.7), cell: 1.4 / 20.0, dims: [20; 3] };
    let hull = Hull::carve(&context, grid, &evidence).unwrap();
    let at = |p: DVec3| hull.cells()[grid.index(grid.voxel(p))];
    assert_eq!((at(BALL.0), at(DVec3::new(0.05, 0.6, 0.1)), at(DVec3::new(0.0, 0.0, -0.6))), (1, 0, 1));
    let twin = (0..grid.voxels()).map(|i| carve(&evidence, grid.centre(grid.coordinates(i)).as_vec3()));
    let off = twin.zip(hull.cells()).filter(|(twin, cell)| *twin != (**cell != 0)).count();
    assert!(off <= 10, "{off} voxels differ from the twin");
}

/// If this failed, `proxy` would not give what a plan needs: points on the surface, everywhere on it, that face outward.
/// The underside of the ball no camera sees.
#[test]
fn a_ball_is_reconstructed_from_its_photos() {
    let context = context();
    let folder = tempfile::tempdir().unwrap();
    let photos = photograph(folder.path(), &cameras(12), true);
    let set = PhotoSet { photos, ..PhotoSet::default() };
    for hull in [true, false] {
        let options = StereoOptions { hull, ..StereoOptions::default() };
        let found = reconstruct(&context, &set, &options).unwrap();
        let points = &found.points;
        let (centre, radius) = BALL;
        let seen = |p: &DVec3| (*p - centre).z > -0.3 * radius;
        let upper: Vec<usize> = (0..points.positions.len()).filter(|i| seen(&points.positions[*i])).collect();
        let off = |i: &&usize| (points.positions[**i].distance(centre) / radius - 1.0).abs() > 0.06;
        let away = |i: &&usize| points.normals[**i].dot((points.positions[**i] - centre).normalize()) < 0.7;
        let (off, away) = (upper.iter().filter(off).count(), upper.iter().filter(away).count());
        assert!(50 * off <= upper.len(), "hull {hull}: {off} of {} points off the ball", upper.len());
        assert!(20 * away <= upper.len(), "hull {hull}: {away} of {} normals astray", upper.len());
        let holes = (0..500)
            .map(|i| {
                let z = 1.0 - 1.2 * (f64::from(i) + 0.5) / 500.0;
                let (sin, cos) = (2.4 * f64::from(i)).sin_cos();
                let around = (1.0 - z * z).sqrt();
                centre + radius * DVec3::new(around * cos, around * sin, z)
            })
            .filter(|p| points.positions.iter().all(|q| q.distance(*p) > 0.15 * radius))
            .count();
        assert!(holes <= if hull { 0 } else { 25 }, "hull {hull}: {holes} of 500 places have no point near");
        assert!(found.from_depths > 200, "hull {hull}: {} points from stereo", found.from_depths);
    }
    assert_eq!(context.messages(), [""; 0], "the validation layers found fault");
}

/// If this failed, the scene would be looked for where it is not.
#[test]
fn the_cameras_tell_where_the_scene_is() {
    let volume = around_focus(&cameras(8)).unwrap();
    assert!(volume.centre.length() < 1e-9 && (0.5..1.5).contains(&volume.radius), "{volume:?}");
    let parallel: Vec<Camera> = (0..6)
        .map(|i| {
            let pose = Pose::looking(DVec3::new(f64::from(i), 0.0, 0.0), DVec3::Y, DVec3::Z);
            Camera { pose, ..cameras(1).remove(0) }
        })
        .collect();
    assert_eq!(around_focus(&parallel), None);
}

/// A capture of the ball in a place for the command: pictures and a transforms.json.
fn capture(place: &Place, count: u32) {
    std::fs::create_dir_all(place.path("set")).unwrap();
    let cameras = cameras(count);
    photograph(&place.path("set"), &cameras, true);
    let frames: Vec<String> = cameras
        .iter()
        .map(|camera| {
            let [x, y, z] = [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z].map(|axis| camera.pose.rotation * axis);
            let p = camera.pose.position;
            let row = |i: usize| format!("[{}, {}, {}, {}]", x[i], y[i], z[i], p[i]);
            let matrix = format!("[{}, {}, {}, [0, 0, 0, 1]]", row(0), row(1), row(2));
            format!(r#"{{"file_path": "{}", "transform_matrix": {matrix}}}"#, camera.name)
        })
        .collect();
    let focal = cameras[0].intrinsics.focal[0];
    place.write(
        "set/transforms.json",
        format!(
            r#"{{"fl_x": {focal}, "fl_y": {focal}, "w": {WIDTH}, "h": {HEIGHT}, "frames": [{}]}}"#,
            frames.join(", ")
        ),
    );
}

/// If this failed, the same photos would give another proxy on another machine of the same make, or one that `plan` does not
/// read. (Drivers other than lavapipe do not read the variable.)
#[test]
fn the_command_writes_the_same_bits_on_any_number_of_threads() {
    let place = Place::new();
    capture(&place, 10);
    let mut first: Option<Vec<u8>> = None;
    for threads in ["0", "1", "2"] {
        let mut command = place.command("proxy set --out proxy.ply --photos 8");
        let ran = ended(command.env("LP_NUM_THREADS", threads).output().unwrap());
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "{}", ran.out);
        assert!(ran.out.contains("8 used") && ran.out.contains("from the hull"), "{}", ran.out);
        let bytes = std::fs::read(place.path("proxy.ply")).unwrap();
        assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "other bits with LP_NUM_THREADS={threads}");
    }
    let Surface::Points(points) = io::read_surface(&place.path("proxy.ply")).unwrap() else { panic!("no points") };
    let count = points.positions.len();
    assert!(points.oriented && count > 500 && points.normals.len() == count && points.radii.len() == count);
    place.done("plan proxy.ply --out plan --views 5 --held-out 60 --iterations 20 --checkpoint-every 10");
}

/// If this failed, a user would get a surface of nothing, or no hint at what is missing.
#[test]
fn captures_that_give_no_surface_are_refused() {
    let place = Place::new();
    capture(&place, 10);
    let cases: [(&str, &[&str]); 6] = [
        ("proxy set --out p.ply --photos 4", &["at least 5", "4 are asked for"]),
        ("proxy set --out p.ply --near 2 --far 1", &["--near 2", "0 < near < far"]),
        ("proxy set --out p.ply --hypotheses 3", &["--hypotheses is 3", "16 to 256"]),
        ("proxy set --out p.ply --use-points", &["no points", "--use-points"]),
        ("proxy set --out ball.ply/p.ply", &["ball.ply is no folder"]),
        ("proxy nothing --out p.ply", &["nothing"]),
    ];
    for (arguments, fragments) in cases {
        let ran = place.run(arguments);
        assert_eq!((ran.code, ran.err.lines().count()), (Some(2), 1), "camsplat {arguments}: {}{}", ran.out, ran.err);
        fragments
            .iter()
            .for_each(|f| assert!(ran.err.contains(f), "camsplat {arguments}: {f:?} is not in {}", ran.err));
        assert!(!place.path("p.ply").exists(), "camsplat {arguments} wrote");
    }
    for i in 0..6 {
        std::fs::remove_file(place.path(&format!("set/{i:02}.png"))).unwrap();
    }
    let missing = place.run("proxy set --out p.ply");
    assert!(missing.code == Some(2) && missing.err.contains("--skip-missing"), "{}", missing.err);
    let few = place.run("proxy set --out p.ply --skip-missing");
    assert!(few.code == Some(2) && few.err.contains("at least 5"), "{}", few.err);
}

/// If this failed, users would have to guess depths for photos of a walk, whose cameras look at no one place: stereo finds the range itself,
/// and points of the capture say it where there are any.
#[test]
fn the_depths_of_a_walk_are_found() {
    let context = context();
    let folder = tempfile::tempdir().unwrap();
    let along: Vec<Camera> = (0..8)
        .map(|i| {
            let position = DVec3::new(0.2 * f64::from(i) - 0.7, -2.2, 1.5);
            let pose = Pose::looking(position, DVec3::new(0.0, 0.85, -0.55), DVec3::Z);
            Camera { pose, ..cameras(12).remove(i as usize) }
        })
        .collect();
    assert_eq!(around_focus(&along), None, "these cameras look at one place");
    let photos = photograph(folder.path(), &along, false);
    let depths = along.iter().flat_map(|camera| {
        (0..WIDTH * HEIGHT).step_by(7).map(move |i| true_depth(camera, i % WIDTH, i / WIDTH, false))
    });
    let mut truth: Vec<f64> = depths.filter(|depth| *depth > 0.0).collect();
    truth.sort_unstable_by(f64::total_cmp);
    let (low, high) = (truth[truth.len() / 10], truth[truth.len() * 9 / 10]);
    let seen = along.iter().flat_map(|camera| {
        let of = move |i: u32| (i, true_depth(camera, 8 * (i % 16), 8 * (i / 16), false));
        let places = (0..192).map(of).filter(|(_, depth)| *depth > 0.0);
        places.map(|(i, depth)| {
            let pixel = DVec2::new(f64::from(8 * (i % 16)) + 0.5, f64::from(8 * (i / 16)) + 0.5);
            camera.pose.position + depth * ray(camera, pixel)
        })
    });
    let positions: Vec<DVec3> = seen.collect();
    for points in [Points::default(), Points { positions, ..Points::default() }] {
        let set = PhotoSet { photos: photos.clone(), points, ..PhotoSet::default() };
        let found = reconstruct(&context, &set, &StereoOptions { hull: false, ..StereoOptions::default() }).unwrap();
        let [near, far] = found.depths;
        assert!(near < low && 0.3 * low < near, "near {near} for {low}");
        assert!(far > high && far < 3.0 * high, "far {far} for {high}");
        let off = |p: &&DVec3| ((**p - BALL.0).length() - BALL.1).abs().min((p.z - TABLE).abs()) > 0.06;
        let astray = found.points.positions.iter().filter(off).count();
        assert!(20 * astray < found.points.positions.len(), "{astray} of {} points off", found.points.positions.len());
    }
    // Looking into the distance, where nothing can be matched, asks for the depths.
    let away: Vec<Photo> = photos
        .iter()
        .map(|photo| {
            let pose = Pose::looking(photo.camera.pose.position, DVec3::Z, DVec3::Y);
            Photo { camera: Camera { pose, ..photo.camera.clone() }, ..photo.clone() }
        })
        .collect();
    let empty = tempfile::tempdir().unwrap();
    let photos = photograph(empty.path(), &away.into_iter().map(|photo| photo.camera).collect::<Vec<_>>(), false);
    let set = PhotoSet { photos, ..PhotoSet::default() };
    let message = reconstruct(&context, &set, &StereoOptions { hull: false, ..StereoOptions::default() })
        .unwrap_err()
        .to_string();
    assert!(message.contains("`near` and `far`"), "{message}");
}

/// If this failed, photos at right angles to one another, which show no surface alike, would be taken for a match.
#[test]
fn photos_without_overlap_are_refused() {
    let context = context();
    let folder = tempfile::tempdir().unwrap();
    let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z];
    let apart: Vec<Camera> = axes
        .iter()
        .zip(cameras(5))
        .map(|(axis, camera)| Camera { pose: Pose::looking(2.5 * *axis, -*axis, DVec3::new(0.1, 0.2, 0.9)), ..camera })
        .collect();
    let set = PhotoSet { photos: photograph(folder.path(), &apart, false), ..PhotoSet::default() };
    let message = reconstruct(&context, &set, &StereoOptions::default()).unwrap_err().to_string();
    assert!(message.contains("no two of the photos"), "{message}");
}

/// Computed directly: a point on the axis, one pixel beside it, and back. Were projection off by half a pixel, all depths would be.
#[test]
fn views_project_as_cameras_do() {
    let camera = cameras(3).remove(1);
    let view = device_views(std::slice::from_ref(&camera), &[[1.0, 4.0]]).remove(0);
    for (x, y, depth) in [(64.0, 48.0, 2.0), (65.0, 48.0, 2.0), (0.5, 95.5, 3.0)] {
        let p = camera.pose.position + depth * ray(&camera, DVec2::new(x, y));
        let at = view.project(p.as_vec3());
        assert!((at - Vec3::new(x as f32, y as f32, depth as f32)).length() < 1e-3, "{at}");
        let back = view.unproject(x as f32, y as f32, depth as f32);
        assert!((back - p.as_vec3()).length() < 1e-5, "{back} for {p}");
    }
}
