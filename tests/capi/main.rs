//! The boundary for C: the header matches the source, and a C program plans on its own Vulkan device.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// If this failed, C programs would be compiled against functions and structs that the library does not have. With
/// `CAMSPLAT_WRITE_REFERENCE=1` the header is written anew.
#[test]
fn the_header_is_what_the_source_says() {
    let config = cbindgen::Config {
        language: cbindgen::Language::C,
        include_guard: Some("CAMSPLAT_H".into()),
        header: Some(
            "/* camsplat for C. Made of src/app/capi by cbindgen; see docs/guide/c.md and examples/c. */".into(),
        ),
        cpp_compat: true,
        documentation_style: cbindgen::DocumentationStyle::C99,
        usize_is_size_t: true,
        enumeration: cbindgen::EnumConfig {
            rename_variants: cbindgen::RenameRule::QualifiedScreamingSnakeCase,
            ..cbindgen::EnumConfig::default()
        },
        ..cbindgen::Config::default()
    };
    // The others follow from its modules.
    let source = root().join("src/app/capi/mod.rs");
    let made = cbindgen::Builder::new().with_config(config).with_src(source).generate().unwrap();
    let mut text = Vec::new();
    made.write(&mut text);
    let file = root().join("include/camsplat.h");
    if std::env::var_os("CAMSPLAT_WRITE_REFERENCE").is_some() {
        fs::write(&file, &text).unwrap();
    }
    let text = String::from_utf8(text).unwrap();
    assert!(
        fs::read_to_string(&file).is_ok_and(|header| header == text),
        "write it anew with CAMSPLAT_WRITE_REFERENCE=1"
    );
    for declared in
        ["camsplat_device_adopt(", "camsplat_plan_make(", "typedef struct CamsplatRequest", "CAMSPLAT_RESULT_OK"]
    {
        assert!(text.contains(declared), "{declared} is not in the header");
    }
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let [said, complained] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert!(output.status.success(), "{command:?}: {said}{complained}");
    said + &complained
}

/// Runs C programs against the library, each under the validation layers.
struct Programs {
    folder: PathBuf,
    library: PathBuf,
}

impl Programs {
    /// The library is built first; nothing where there is no C compiler or no Vulkan headers.
    fn new() -> Option<Self> {
        let cc = Command::new("cc").arg("--version").output();
        if !Path::new("/usr/include/vulkan/vulkan.h").is_file() || cc.is_err() {
            println!("skipped: no C compiler or no Vulkan headers here");
            return None;
        }
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
        let target = folder.parent().unwrap().to_path_buf();
        let build =
            ["rustc", "--release", "--lib", "--no-default-features", "--features", "capi", "--crate-type", "cdylib"];
        // Optimised less: it is built for this test alone, and builds in half the time.
        let less = ["--", "-C", "opt-level=1"];
        run(Command::new(env!("CARGO")).args(build).arg("--target-dir").arg(&target).args(less).current_dir(root()));
        Some(Self { folder, library: target.join("release") })
    }

    /// What a program says, which ends well and without a message of the layers.
    fn run(&self, source: &str, arguments: &[&str]) -> String {
        let program = self.folder.join(Path::new(source).file_stem().unwrap());
        let strict = [
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Wredundant-decls",
            "-Werror",
            "-Iinclude",
            source,
            "-lcamsplat",
            "-lvulkan",
            "-lm",
        ];
        let linked = ["-lpthread", "-o"];
        run(Command::new("cc")
            .args(strict)
            .arg("-L")
            .arg(&self.library)
            .args(linked)
            .arg(&program)
            .current_dir(root()));
        let layers = [
            ("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation"),
            ("LD_LIBRARY_PATH", self.library.to_str().unwrap()),
        ];
        let said = run(Command::new(&program).args(arguments).envs(layers));
        assert!(!said.contains("Validation Error") && !said.contains("VUID"), "{said}");
        // The loader says so where there is no such layer, and then the absence of its errors means nothing.
        assert!(!said.contains("VK_LAYER_KHRONOS_validation"), "{said}");
        said
    }
}

/// The lines with a camera's number and position.
fn cameras(said: &str) -> Vec<&str> {
    let is_camera = |line: &&str| {
        let words: Vec<&str> = line.split(' ').collect();
        words.len() == 4 && words.iter().all(|word| word.parse::<f64>().is_ok())
    };
    said.lines().filter(is_camera).collect()
}

/// If this failed, an application in C could not plan: the library would not link, misread its structs, harm its device, or crash
/// a program on an invalid request. One that draws meanwhile would have the planner on its queue where it should not be, or get another
/// plan.
#[test]
fn c_programs_plan_on_their_own_devices_and_between_their_frames_and_are_refused_nonsense() {
    let Some(programs) = Programs::new() else { return };
    programs.run("tests/capi/misuse.c", &[]);
    let said = programs.run("examples/c/plan.c", &[]);
    let planned = cameras(&said);
    assert!(planned.len() == 12 && said.contains("dB expected"), "{said}");
    for line in &planned {
        let place: Vec<f64> = line.split(' ').skip(1).map(|word| word.parse().unwrap()).collect();
        // Around the cube and not in it, above the ground.
        assert!(place[0].hypot(place[1]).hypot(place[2] - 1.0) > 1.8 && place[2] >= 0.0, "{line}");
    }

    let said = programs.run("examples/c/frame_loop.c", &[]);
    assert_eq!(cameras(&said), planned, "{said}");
    let counts = said.lines().find(|line| line.contains(" frames, ")).unwrap();
    let numbers: Vec<u32> = counts.split(' ').filter_map(|word| word.parse().ok()).collect();
    let [frames, submissions, of_a_frame] = numbers[..3] else { panic!("{counts}") };
    // Two submissions a frame at most, and a plan that is made of many.
    assert!(of_a_frame <= 2 && submissions > 100 && submissions <= 2 * frames, "{counts}");

    // Closed in the middle of it, with a planner that waits for the next frame.
    let said = programs.run("examples/c/frame_loop.c", &["30"]);
    assert!(said.contains("closed: stopped") && said.contains("30 frames") && cameras(&said).is_empty(), "{said}");
}
