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
        header: Some("/* camsplat for C. Made of src/capi.rs by cbindgen; see examples/plan.c. */".into()),
        cpp_compat: true,
        documentation_style: cbindgen::DocumentationStyle::C99,
        usize_is_size_t: true,
        ..cbindgen::Config::default()
    };
    let made = cbindgen::Builder::new().with_config(config).with_src(root().join("src/capi.rs")).generate().unwrap();
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
    for declared in ["camsplat_adopt(", "camsplat_plan(", "typedef struct CamsplatRequest"] {
        assert!(text.contains(declared), "{declared} is not in the header");
    }
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let [said, complained] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert!(output.status.success(), "{command:?}: {said}{complained}");
    said + &complained
}

/// If this failed, an application in C could not plan: the library would not link, misread its structs, harm its device, or crash
/// a program on an invalid request.
#[test]
fn c_programs_plan_on_their_own_devices_and_are_refused_nonsense() {
    if !Path::new("/usr/include/vulkan/vulkan.h").is_file() || Command::new("cc").arg("--version").output().is_err() {
        println!("skipped: no C compiler or no Vulkan headers here");
        return;
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let target = folder.parent().unwrap().to_path_buf();
    let build =
        ["rustc", "--release", "--lib", "--no-default-features", "--features", "capi", "--crate-type", "cdylib"];
    // Optimised less: it is built for this test alone, and builds in half the time.
    let less = ["--", "-C", "opt-level=1"];
    run(Command::new(env!("CARGO")).args(build).arg("--target-dir").arg(&target).args(less).current_dir(root()));
    let library = target.join("release");
    let program = |source: &str| {
        let program = folder.join(Path::new(source).file_stem().unwrap());
        let strict =
            ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Iinclude", source, "-lcamsplat", "-lvulkan", "-lm", "-o"];
        run(Command::new("cc").args(strict).arg(&program).arg("-L").arg(&library).current_dir(root()));
        let layers =
            [("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation"), ("LD_LIBRARY_PATH", library.to_str().unwrap())];
        run(Command::new(&program).envs(layers))
    };
    program("tests/capi_misuse.c");
    let said = program("examples/plan.c");
    let positions: Vec<Vec<f64>> = said
        .lines()
        .map(|line| line.split(' ').skip(1).map_while(|word| word.parse().ok()).collect::<Vec<f64>>())
        .filter(|position| position.len() == 3)
        .collect();
    assert_eq!(positions.len(), 12, "{said}");
    // Around the cube and not in it, above the ground.
    for position in &positions {
        let out = position[0].hypot(position[1]).hypot(position[2] - 1.0);
        assert!(out > 1.8 && position[2] >= 0.0, "{position:?}");
    }
    assert!(said.contains("dB expected") && said.contains("as expected: `views`"), "{said}");
    assert!(!said.contains("Validation Error") && !said.contains("VUID"), "{said}");
    // The loader says so where there is no such layer, and then the absence of its errors means nothing.
    assert!(!said.contains("VK_LAYER_KHRONOS_validation"), "{said}");
}
