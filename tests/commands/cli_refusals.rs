//! What bad input gets: one line with what is wrong, where, and what to do; exit code 2; nothing written.

use crate::support::command::{Place, SHORT, assert_refused, ball, ended, names, points};
use std::fs;

/// `plan` with the short options and others.
fn plan(surface: &str, options: &str) -> String {
    format!("plan {surface} --out o {SHORT} {options}")
}

/// As [`assert_refused`], for options of `plan ball.ply`.
#[track_caller]
fn assert_options_refused(cases: &[(&str, &[&str])]) {
    let place = Place::new();
    let arguments: Vec<String> = cases.iter().map(|(options, _)| plan("ball.ply", options)).collect();
    let cases: Vec<_> = arguments.iter().map(String::as_str).zip(cases.iter().map(|case| case.1)).collect();
    assert_refused(&place, &cases);
}

/// If this failed, a damaged file would end in a panic, in a plan for what was left of it, or in a message without a remedy.
#[test]
fn surfaces_that_are_none() {
    let place = Place::new();
    let whole = ball();
    for name in ["empty.ply", "empty.obj", "empty.glb"] {
        place.write(name, "");
    }
    place.write("header.ply", &whole[..40]);
    place.write("cut.ply", &whole[..whole.len() / 2]);
    place.write("nan.ply", points(&["0 0 0", "nan 0 1", "1 1 0", "0 inf -inf"]));
    place.write("one.ply", points(&["1 2 3"]));
    place.write("equal.ply", points(&["1 2 3"; 7]));
    place.write("word.obj", "v 0 0 0\nv 1 0 0\nv 0 up 0\nf 1 2 3\n");
    place.write("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    place.write("three.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    place.write("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    place.write("cut.glb", b"glTF\x02\0\0\0\xff\0\0\0");
    place.write("notes.txt", "a ball");
    place.write(
        "cameras.json",
        r#"{"camera_angle_x": 0.8, "frames": [{"file_path": "0", "transform_matrix":
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]}], "w": 100, "h": 100}"#,
    );
    fs::create_dir(place.path("folder")).unwrap();
    let cases: [(&str, &[&str]); 16] = [
        ("empty.ply", &["the file is empty", "export it again"]),
        ("empty.obj", &["the file is empty", "export it again"]),
        ("empty.glb", &["the file is empty", "export it again"]),
        ("header.ply", &["line 4", "no \"end_header\""]),
        ("cut.ply", &["vertex ", "byte ", "cut short", "export it again"]),
        ("nan.ply", &["at least 4"]),
        ("one.ply", &["only one point", "needs four"]),
        ("equal.ply", &["all 7 points are equal", "needs some extent"]),
        ("word.obj", &["line 3", "\"up\" is not a number", "export"]),
        ("range.obj", &["line 4", "vertex 9", "export"]),
        ("three.obj", &["3 distinct points", "at least 4"]),
        ("line.obj", &["no triangle has an area", "give a surface"]),
        ("cut.glb", &["cut.glb"]),
        ("notes.txt", &["give a .ply, .obj, .stl, .glb"]),
        ("folder", &["no COLMAP model", "give the"]),
        ("missing.ply", &["no such file", "check the path"]),
    ];
    for (surface, fragments) in cases {
        let start = format!("error: {surface}: ");
        let fragments = [fragments, &[start.as_str()]].concat();
        assert_refused(&place, &[(&plan(surface, ""), &fragments)]);
        assert_refused(&place, &[(&format!("score {surface} cameras.json"), &fragments)]);
    }
}

/// If this failed, cameras would be planned where they do not fit, or see nothing, and the user would learn it
/// from the photos.
#[test]
fn regions_that_are_none() {
    assert_options_refused(&[
        (
            "--shell 100,0,0,1,2",
            &[
                "no point of the surface can be seen from the region",
                "move or enlarge it",
                "--shell",
                "--preset room for a room",
            ],
        ),
        (
            "--box -3,-3,-3,3,3,3",
            &["no point of the surface", "--preset object for a surface that is seen from outside"],
        ),
        ("--box 1,1,1,-1,-1,-1", &["inverted", "lower then higher corner"]),
        ("--box 0,0,0,1,1,0", &["empty"]),
        ("--box 1,1,1", &["--box takes 6 numbers X0,Y0,Z0,X1,Y1,Z1, not 3"]),
        ("--box 0,0,0,1,1,1,1", &["--box takes 6 numbers", "not 7"]),
        ("--box 0,0,0,1,1,a", &["invalid value 'a' for '--box", "--help"]),
        ("--box NaN,0,0,1,1,1", &["not finite"]),
        ("--shell 1e9,0,0,1,2", &["times its own size away", "move the region nearer", "--shell"]),
        ("--shell 0,0,0,3,2", &["radii 3 and 2", "the inner must be"]),
        ("--shell 0,0,0,3,3", &["radii 3 and 3", "the inner must be"]),
        ("--shell 0,0,0,-1,3", &["radii -1 and 3", "the inner must be"]),
        ("--shell 0,0,0,2,inf", &["not finite"]),
        ("--shell 0,0,0,2", &["--shell takes 5 numbers CX,CY,CZ,RMIN,RMAX, not 4"]),
        ("--shell 0,0,0,2,3 --box 0,0,0,1,1,1", &["--shell", "cannot be used with", "--box"]),
        ("--floor 100", &["floor at height 100", "lower the floor"]),
        ("--floor nan", &["--floor", "give a height, auto or none"]),
        ("--clearance -1", &["clearance -1", "zero or more"]),
        ("--clearance inf", &["clearance inf"]),
        ("--clearance 10", &["smaller clearance"]),
        ("--up w", &["--up", "give one of x, y, z, -x, -y, -z"]),
        ("--preset sphere", &["'sphere' for '--preset", "possible values"]),
    ]);
}

/// If this failed, a typing error would be planned with, or produce a page of usage.
#[test]
fn numbers_that_are_none() {
    assert_options_refused(&[
        ("--size 800", &["--size", "such as 1920x1080"]),
        ("--size 0x600", &["--size", "such as 1920x1080"]),
        ("--size 800x", &["--size", "such as 1920x1080"]),
        ("--size 99999x1", &["--size", "such as 1920x1080"]),
        ("--size 1.5x2", &["--size", "such as 1920x1080"]),
        ("--fov 0", &["--fov is 0", "more than 1 and less than 170"]),
        ("--fov 180", &["--fov is 180"]),
        ("--fov -50", &["--fov is -50"]),
        ("--fov nan", &["--fov is NaN"]),
        ("--fov wide", &["'wide' for '--fov"]),
        ("--views", &["a value is required for '--views"]),
        ("--seed -1", &["'-1' for '--seed"]),
        ("--seed 0.5", &["'0.5' for '--seed"]),
        ("--gate-softness nan", &["--gate-softness is NaN", "positive"]),
        ("--gate-softness 0", &["--gate-softness is 0", "positive"]),
        ("--method paper --alpha nan", &["--alpha is NaN", "positive"]),
        ("--method paper --alpha 0.5", &["--alpha is 0.5", "less than 0.5"]),
        ("--method paper --scale nan", &["--scale is NaN", "positive"]),
        ("--method paper --scale -1", &["--scale is -1", "positive"]),
        ("--method paper --lambda-reg nan", &["--lambda-reg is NaN", "zero or a positive"]),
        ("--lambda-bound -1", &["--lambda-bound is -1", "zero or a positive"]),
        ("--method paper --lambda-scale inf", &["--lambda-scale is inf", "zero or a positive"]),
        ("--lr-position nan", &["--lr-position is NaN", "zero or a positive"]),
        ("--lr-direction -1", &["--lr-direction is -1", "zero or a positive"]),
        ("--method paper --lr-scale nan", &["--lr-scale is NaN", "zero or a positive"]),
        ("--method paper --resolution 20", &["--resolution is 20", "multiple of 8"]),
        ("--method paper --resolution 264", &["--resolution is 264", "multiple of 8"]),
        ("--probes 0", &["--probes is 0", "at least 1"]),
        ("--probes 16385", &["--probes is 16385", "at most 16384"]),
        ("--method paper --probes 65536", &["--probes is 65536", "at most 65535"]),
        ("--kernel metric", &["--kernel goes with --method paper"]),
        ("--pool 64", &["--pool goes with --method paper"]),
        ("--zzz red", &["unexpected argument '--zzz'", "--help"]),
        ("--veiws 3", &["unexpected argument '--veiws'", "similar argument exists: '--views'"]),
        ("more", &["unexpected argument 'more'"]),
    ]);
    let place = Place::new();
    assert_refused(
        &place,
        &[
            ("plan ball.ply --out o --views 0", &["--views is 0", "at least 1"]),
            ("plan ball.ply --out o --views -3", &["'-3' for '--views"]),
            ("plan ball.ply --out o", &["not provided", "--views"]),
            ("plan --out o --views 3", &["not provided", "<SURFACE>"]),
            ("plan ball.ply --out o --views 3 --iterations 0", &["--iterations is 0", "at least 1"]),
            ("plan ball.ply --out o --views 3 --held-out 0", &["--held-out is 0", "at least 1"]),
            ("plan ball.ply --out o --views 3 --connect 0.5", &["--connect is 0.5", "between 1 and 90"]),
            ("plan ball.ply --out o --views 3 --connect 20 --method paper", &["--connect goes with expected quality"]),
            (
                "plan ball.ply --out o --views 3 --connect 20 --method fibonacci",
                &["--method fibonacci", "leave the others out"],
            ),
            ("paint ball.ply", &["unrecognized subcommand 'paint'", "similar subcommands exist"]),
        ],
    );
}

/// If this failed, a command would replace the surface, cameras or plan that it reads, or write poses that are no numbers.
#[test]
fn what_is_read_is_not_written_over_and_poses_are_numbers() {
    let place = Place::new();
    place.done(&format!("plan ball.ply --out p {SHORT}"));
    place.write("p/s.ply", place.read("ball.ply"));
    place.write("image.png", "a picture");
    let read = "name another f";
    assert_refused(
        &place,
        &[
            (&format!("plan ball.ply --keep p --out p --force {SHORT}"), &["p is in it", read]),
            (&format!("plan p/s.ply --out p --force {SHORT}"), &["s.ply is in it", read]),
            (&format!("plan ball.ply --out o --trace ball.ply {SHORT}"), &["ball.ply: this is what is read", read]),
            ("score ball.ply p --json ball.ply", &["this is what is read", read]),
            ("score ball.ply p --json p/plan.json", &["plan.json: this is what is read", read]),
            ("score ball.ply p --json image.png", &["image.png: a file of another kind", read]),
            (&plan("ball.ply", "--lr-direction 1e30"), &["far too large", "give smaller ones"]),
        ],
    );
    place.done("score ball.ply p --json p/score.json");
    place.done("score ball.ply p --json p/score.json");
}

/// If this failed, a plan that cannot fit would exhaust the host's memory first, or fail long after that could have been known.
#[test]
fn counts_beyond_the_device() {
    let place = Place::new();
    assert_refused(
        &place,
        &[
            ("plan ball.ply --out o --views 4294967295", &["--views", "at most 200000"]),
            ("plan ball.ply --out o --views 200001 --dry-run", &["--views", "at most 200000"]),
            (
                "plan ball.ply --out o --views 3 --iterations 4294967295",
                &["\"history\"", "bytes of device memory", "fewer iterations"],
            ),
            ("plan ball.ply --out o --views 3 --method paper --pool 4294967295", &["--pool", "at most"]),
            ("plan ball.ply --out o --views 3 --held-out 4294967295", &["--held-out", "at most"]),
            ("score ball.ply cameras.json --held-out 4294967295", &["--held-out", "1 to"]),
        ],
    );
}

/// If this failed, a wrong file for --keep or score would panic, or count as no cameras at all.
#[test]
fn cameras_that_are_none() {
    let place = Place::new();
    place.done(&format!("plan ball.ply --out first {SHORT}"));
    let whole = place.read("first/transforms.json");
    place.write("cut.json", &whole[..whole.len() / 2]);
    place.write("empty.json", "");
    place.write("other.json", r#"{"hello": 1}"#);
    place.write("none.json", r#"{"frames": []}"#);
    let mut record: serde_json::Value = serde_json::from_str(&place.read("first/plan.json")).unwrap();
    record["cameras"][2]["intrinsics"]["focal"][0] = (-700.0).into();
    place.write("focal.json", record.to_string());
    fs::create_dir(place.path("folder")).unwrap();
    let images = fs::read(place.path("first/sparse/0/images.bin")).unwrap();
    fs::create_dir_all(place.path("cut/sparse/0")).unwrap();
    fs::copy(place.path("first/sparse/0/cameras.bin"), place.path("cut/sparse/0/cameras.bin")).unwrap();
    fs::write(place.path("cut/sparse/0/images.bin"), &images[..images.len() - 5]).unwrap();
    let cases: [(&str, &[&str]); 9] = [
        ("cut.json", &["cut.json: ", "line ", "export the file again"]),
        ("empty.json", &["empty.json: ", "the file is empty"]),
        ("other.json", &["other.json: ", "neither \"frames\"", "give one of these"]),
        ("none.json", &["none.json: ", "holds no cameras"]),
        ("focal.json", &["focal.json: ", "camera 2", "focal lengths [-700"]),
        ("ball.ply", &["ball.ply: ", "line 1"]),
        ("folder", &["folder: ", "no plan.json", "give the poses' file"]),
        ("cut", &["images.bin: ", "cut short"]),
        ("missing.json", &["missing.json: ", "no such file", "check the path"]),
    ];
    for (file, fragments) in cases {
        let (kept, scored) = (plan("ball.ply", &format!("--keep {file}")), format!("score ball.ply {file}"));
        assert_refused(&place, &[(&kept, fragments), (&scored, fragments)]);
    }
}

/// If this failed, a run could end, after all its work, in a folder that cannot be written, or overwrite a user's files.
#[test]
fn places_that_cannot_be_written() {
    let place = Place::new();
    fs::create_dir(place.path("full")).unwrap();
    place.write("full/mine.txt", "mine");
    place.write("file", "mine");
    place.done(&format!("plan ball.ply --out first {SHORT}"));
    assert_refused(
        &place,
        &[
            (&format!("plan ball.ply --out full {SHORT}"), &["full: ", "not empty", "--force"]),
            (&format!("plan ball.ply --out file {SHORT}"), &["file: ", "a file is already here", "name a folder"]),
            (&format!("plan ball.ply --out file/o {SHORT}"), &["file/o: ", "file is no folder", "name another place"]),
            (&format!("plan ball.ply --out / {SHORT}"), &["/: ", "name of its own"]),
            (&format!("plan ball.ply --out .. {SHORT}"), &["..: ", "name of its own"]),
            (&plan("ball.ply", "--trace file/a/t.json"), &["file/a/t.json: ", "file is no folder"]),
            (&plan("ball.ply", "--trace full"), &["full: ", "name a file"]),
            (&plan("ball.ply", "--renderdoc file/c"), &["file/c: ", "file is no folder"]),
            ("score ball.ply first --json file/m.json", &["file/m.json: ", "file is no folder"]),
            ("score ball.ply first --json full", &["full: ", "name a file"]),
            ("score ball.ply first --held-out 0", &["--held-out is 0"]),
        ],
    );
    assert_eq!(names(&place.path("full")), ["mine.txt"]);
    // With --force the user's own files stay.
    place.done(&format!("plan ball.ply --out full {SHORT} --force"));
    assert_eq!(place.read("full/mine.txt"), "mine");
    // A link that leads nowhere is found before the work, not after.
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("nowhere", place.path("link")).unwrap();
        assert_refused(&place, &[(&format!("plan ball.ply --out link {SHORT}"), &["link: ", "leads nowhere"])]);
    }
    // A folder that no user may write to, root included.
    if cfg!(target_os = "linux") {
        assert_refused(
            &place,
            &[(&format!("plan ball.ply --out /proc/o {SHORT}"), &["/proc: ", "name another folder"])],
        );
    }
}

/// If this failed, a user without a driver, or with a typing error in --device, would get no remedy.
#[test]
fn devices_that_are_not_there() {
    let place = Place::new();
    assert_refused(
        &place,
        &[
            (&plan("ball.ply", "--device abacus"), &["no device \"abacus\"", "0: ", "camsplat devices"]),
            (&plan("ball.ply", "--device 99"), &["no device \"99\"", "0: ", "camsplat devices"]),
        ],
    );
    place.write("none.json", r#"{"file_format_version": "1.0.0"}"#);
    for arguments in [plan("ball.ply", ""), plan("ball.ply", "--dry-run"), "devices".into()] {
        let before = names(&place.path(""));
        let mut command = place.command(&arguments);
        command.env("VK_DRIVER_FILES", place.path("none.json")).env("VK_ICD_FILENAMES", place.path("none.json"));
        let ran = ended(command.output().unwrap());
        assert_eq!((ran.code, ran.err.lines().count()), (Some(2), 1), "{arguments}: {}", ran.err);
        assert!(ran.err.contains("no Vulkan driver") && ran.err.contains("mesa-vulkan-drivers"), "{}", ran.err);
        assert_eq!(names(&place.path("")), before, "{arguments}");
    }
}

/// If this failed, renders would be compared with the wrong photos, or a typing error in a path end in a panic or half a table.
#[test]
fn images_that_cannot_be_compared() {
    let place = Place::new();
    let image = |name: &str, width, height| {
        fs::create_dir_all(place.path(name).parent().unwrap()).unwrap();
        image::RgbImage::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, 7]))
            .save(place.path(name))
            .unwrap();
    };
    image("a.png", 40, 36);
    image("b.png", 36, 40);
    image("c.png", 30, 36);
    image("d.png", 30, 10);
    image("one/a.png", 40, 36);
    image("two/b.png", 40, 36);
    image("both/a.png", 40, 36);
    image("both/a.jpg", 40, 36);
    fs::create_dir(place.path("none")).unwrap();
    place.write("none/a.txt", "an apple");
    place.write("text.png", "an apple");
    let whole = fs::read(place.path("a.png")).unwrap();
    place.write("cut.png", &whole[..whole.len() - 40]);
    let weights = fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/lpips/alex_f16.safetensors")).unwrap();
    place.write("cut.safetensors", &weights[..weights.len() / 2]);
    place.write("alex.safetensors", &weights);
    assert_refused(
        &place,
        &[
            ("metrics a.png none.png", &["none.png: ", "no such file or folder", "check the path"]),
            ("metrics none.png a.png", &["none.png: ", "no such file or folder"]),
            ("metrics a.png one", &["one: ", "this is a folder", "two images or two folders"]),
            ("metrics a.png b.png", &["a.png: ", "40 x 36", "b.png 36 x 40", "one size"]),
            ("metrics a.png text.png", &["text.png: ", "cannot be decoded", "give a PNG or JPEG"]),
            ("metrics a.png cut.png", &["cut.png: ", "cannot be decoded", "whole one"]),
            ("metrics c.png c.png", &["c.png: ", "30 x 36", "LPIPS alex needs 31", "another --lpips"]),
            ("metrics d.png d.png --lpips none", &["d.png: ", "30 x 10", "SSIM needs 11", "larger images"]),
            ("metrics one two", &["one: ", "no image here has the name of one in two", "without extension"]),
            ("metrics one none", &["none: ", "holds no PNG or JPEG"]),
            ("metrics both one", &["both: ", "two images are called \"a\"", "leave one"]),
            ("metrics a.png a.png --lpips vgg", &["needs its weights", "make_lpips_weights.py", "--lpips-vgg"]),
            ("metrics a.png a.png --lpips both", &["needs its weights", "CAMSPLAT_LPIPS_VGG"]),
            (
                "metrics a.png a.png --lpips vgg --lpips-vgg none.safetensors",
                &["none.safetensors: ", "no such file", "check the path"],
            ),
            ("metrics a.png a.png --lpips-alex one", &["one: ", "this is a folder", "file of weights"]),
            ("metrics a.png a.png --lpips-alex cut.safetensors", &["cut.safetensors: ", "no whole safetensors file"]),
            (
                "metrics a.png a.png --lpips vgg --lpips-vgg alex.safetensors",
                &["alex.safetensors: ", "\"conv0.weight\" has the shape", "weights of VGG16"],
            ),
            ("metrics a.png a.png --lpips squeeze", &["'squeeze' for '--lpips", "possible values"]),
            ("metrics a.png a.png --json a.png/m/m.json", &["m.json: ", "a.png is no folder"]),
            ("metrics a.png a.png --device abacus", &["no device \"abacus\"", "camsplat devices"]),
            // The name of an option is not an option where a user gives it.
            ("metrics a.png a.png --device lpips", &["no device \"lpips\""]),
            ("metrics a.png", &["not provided", "<REFERENCE>"]),
        ],
    );
}
