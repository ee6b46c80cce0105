//! `camsplat vds` as a user runs it, on a capture of a ball that lies in a temporary folder.

use crate::support::command;
use crate::support::command::{Place, ended};
use camsplat::scene::surface::Surface;
use glam::DVec3;
use image::{GrayImage, Luma, Rgb, RgbImage};

/// A capture `shots` of the ball: eight photos around it, brighter where it faces +X, and masks.
fn capture() -> Place {
    let place = Place::new();
    std::fs::create_dir_all(place.path("shots/images")).unwrap();
    let mut frames = Vec::new();
    for k in 0..8 {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 8.0).sin_cos();
        // OpenGL axes: X to the right, Y up, Z back, away from the ball.
        let rows = [[-sin, 0.0, cos, 4.0 * cos], [cos, 0.0, sin, 4.0 * sin], [0.0, 1.0, 0.0, 0.0]];
        let image = RgbImage::from_fn(96, 96, |x, y| Rgb([40 + x as u8, 90, 60 + (y as u8 + 20 * k as u8) % 90]));
        image.save(place.path(&format!("shots/images/{k}.png"))).unwrap();
        frames.push(format!(
            "{{\"file_path\":\"images/{k}.png\",\"transform_matrix\":[{:?},{:?},{:?},[0,0,0,1]]}}",
            rows[0], rows[1], rows[2]
        ));
    }
    let head = "{\"fl_x\":120,\"fl_y\":120,\"cx\":48,\"cy\":48,\"w\":96,\"h\":96,\"frames\":[";
    place.write("shots/transforms.json", format!("{head}{}]}}", frames.join(",")));
    place
}

/// If this failed, what `vds` writes could not be planned with, or would not record what it is made of.
#[test]
fn scored_points_can_be_planned_for() {
    let place = capture();
    let ran = place.done("vds shots --surface ball.ply --points 500 --out points.ply");
    for word in ["500 points, 8 photos", "exposure gains", "variance", "score", "points.png"] {
        assert!(ran.out.contains(word), "{word:?} is missing in\n{}", ran.out);
    }
    let picture = image::open(place.path("points.png")).unwrap().to_rgb8();
    assert!(picture.pixels().any(|p| p.0[1] > 90), "no point is drawn");
    let text = String::from_utf8_lossy(&std::fs::read(place.path("points.ply")).unwrap()).into_owned();
    for property in ["nx", "radius", "vds"] {
        assert!(text.contains(&format!("property float {property}\n")), "{property} is missing");
    }
    place.done(&format!("plan points.ply {} --out plan", command::SHORT));
    let first = std::fs::read(place.path("points.ply")).unwrap();
    for threads in ["0", "1", "2"] {
        let mut command = place.command("vds shots --surface ball.ply --points 500 --out again.ply");
        assert_eq!(ended(command.env("LP_NUM_THREADS", threads).output().unwrap()).code, Some(0));
        let again = std::fs::read(place.path("again.ply")).unwrap();
        assert_eq!(first, again, "LP_NUM_THREADS={threads} gives other bits");
    }
}

/// If this failed, a plan for a capture would not heed its photos, or one without scores would wait for them.
#[test]
fn a_plan_for_a_capture_scores_its_points_first() {
    let place = capture();
    place.done("vds shots --surface ball.ply --points 500 --out all.ply");
    // Bare positions, as a reconstruction has them, and strays of which some are left out as outliers.
    let Ok(Surface::Points(mut cloud)) = camsplat::files::io::read_surface(&place.path("all.ply")) else {
        panic!("no points")
    };
    cloud.positions.extend((1..20).map(|i| DVec3::new(0.1 * f64::from(i * i), 1.2, 0.3)));
    place.write("shots/sparse.ply", camsplat::files::io::ply::write::points(&cloud.positions, &[], None));
    let transforms = place.read("shots/transforms.json").replacen('{', "{\"ply_file_path\":\"sparse.ply\",", 1);
    place.write("shots/transforms.json", transforms);
    let ran = place.done(&format!("plan shots --keep shots {} --method paper --out plan", command::SHORT));
    assert!(ran.out.contains("8 photos in") && ran.out.contains("5 views, 8 kept"), "{}", ran.out);
    // Scores change what is aimed at, not the surface: scoring the plan on the capture sees the same.
    let row = |text: &str, name: &str| {
        let line = text.lines().find(|line| line.starts_with(name) && line.contains('%')).unwrap();
        line.split_whitespace().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    let held_out = command::SHORT.split_whitespace().skip_while(|word| *word != "--held-out").nth(1).unwrap_or("1000");
    let scored = place.done(&format!("score shots plan/plan.json --all --cone --held-out {held_out}"));
    assert_eq!(row(&ran.out, "plan "), row(&scored.out, "cameras"));
    let ran = place.done(&format!("plan shots --method paper-no-vds {} --out bare", command::SHORT));
    assert!(ran.out.contains("photos are left unread (--method paper-no-vds)"), "{}", ran.out);
}

/// If this failed, one photo that was cut short on its way would cost a user all others, or pass for a whole one.
#[test]
fn a_photo_that_is_cut_short_is_left_out_on_demand() {
    let place = capture();
    let file = place.path("shots/images/3.png");
    let whole = std::fs::read(&file).unwrap();
    // The header is whole: only decoding shows it.
    std::fs::write(&file, &whole[..whole.len() / 2]).unwrap();
    for command in ["vds shots --surface ball.ply --points 300 --out a.ply", "proxy shots --resolution 64 --out a.ply"]
    {
        let ran = place.run(command);
        assert_eq!(ran.code, Some(2), "{command}: {}", ran.out);
        assert!(ran.err.contains("3.png") && ran.err.trim_end().lines().count() == 1, "{command}: {}", ran.err);
        assert!(!place.path("a.ply").exists());
    }
    let ran = place.done("vds shots --surface ball.ply --points 300 --skip-missing --out a.ply");
    assert!(ran.out.contains("left out") && ran.out.contains("3.png"), "{}", ran.out);
}

/// If this failed, a user would wait for photos to be decoded, or look at half a result, before learning what is wrong.
#[test]
fn what_cannot_be_scored_is_refused_in_one_line() {
    let place = capture();
    let refused = |arguments: &str, word: &str| {
        let ran = place.run(arguments);
        assert_eq!(ran.code, Some(2), "camsplat {arguments}: {}", ran.out);
        assert!(ran.err.contains(word) && ran.err.trim_end().lines().count() == 1, "{arguments}: {}", ran.err);
    };
    refused("vds shots --out points.ply", "the capture holds no points");
    refused("vds shots --surface ball.ply --points 2 --out points.ply", "--points is 2");
    refused("vds shots --surface ball.ply --out points.png", "ends in .ply");
    std::fs::copy(place.path("ball.ply"), place.path("shots/points3D.ply")).unwrap();
    std::fs::create_dir(place.path("o")).unwrap();
    place.write("o/s.ply", place.read("ball.ply"));
    for (arguments, word) in [
        ("vds shots --surface ball.ply --out ball.ply", "ball.ply: this is what is read"),
        ("vds shots --surface ball.ply --out shots/points3D.ply", "points3D.ply: this is what is read"),
        ("vds shots --surface ball.ply --out shots/images/3.ply", "3.png: this picture is already here without points"),
        ("proxy shots --out shots/images/3.png", "3.png: a file of another kind"),
        ("render ball.ply shots --out shots/images --force", "a part of shots"),
        ("train shots --trace shots/transforms.json --out t", "this is what is read"),
        ("select shots --count 3 --surface o/s.ply --out o --force", "s.ply is in it"),
    ] {
        refused(arguments, word);
    }
    std::fs::remove_file(place.path("shots/points3D.ply")).unwrap();
    refused("vds nowhere --out points.ply", "nowhere");
    GrayImage::from_pixel(40, 30, Luma([9])).save(place.path("shots/images/3.png")).unwrap();
    refused("vds shots --surface ball.ply --out points.ply", "3.png");
    std::fs::remove_file(place.path("shots/images/3.png")).unwrap();
    refused("vds shots --surface ball.ply --out points.ply", "missing");
    assert!(!place.path("points.ply").exists() && !place.path("points.png").exists());
    place.done("vds shots --surface ball.ply --points 300 --skip-missing --out points.ply");
    place.done(
        "vds shots --surface ball.ply --points 300 --skip-missing --no-exposure --seed 3 --memory 64 --out a.ply",
    );
}
