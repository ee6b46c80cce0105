//! What the tests of the built command share: a temporary folder with surfaces in it, and runs of the binary there.
#![allow(dead_code, reason = "each test binary uses a part")]

pub mod gltf;

use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Output, Stdio};

use camsplat::planner::plan::record::PlanRecord;
use tempfile::TempDir;

/// Options that keep a plan small.
pub const SMALL: &str = "--views 5 --held-out 60";
/// Options that keep a run short, too.
pub const SHORT: &str = "--views 5 --held-out 60 --iterations 20 --checkpoint-every 10";

/// Everything that a plan leaves, in the order of names.
pub const FILES: [&str; 10] = [
    "cameras.csv",
    "coverage.ply",
    "frusta.ply",
    "plan.json",
    "points.ply",
    "report.html",
    "sparse/0/cameras.bin",
    "sparse/0/images.bin",
    "sparse/0/points3D.bin",
    "transforms.json",
];

/// A temporary folder that the command runs in; it holds `ball.ply`, a ball of radius 1 around the origin.
pub struct Place {
    folder: TempDir,
}

/// How a run ended.
pub struct Ran {
    /// Exit code; none where a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Ran {
    /// Lines that warn of something other than a CPU device, which tests may run on.
    pub fn warnings(&self) -> Vec<&str> {
        let lines = self.out.lines().filter(|line| line.contains("warning"));
        lines.filter(|line| !line.starts_with("warning: this runs on ")).collect()
    }
}

impl Place {
    pub fn new() -> Self {
        let place = Self { folder: tempfile::tempdir().unwrap() };
        place.write("ball.ply", ball());
        place
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        fs::write(self.path(name), contents).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// The record in `folder`/plan.json.
    pub fn plan(&self, folder: &str) -> PlanRecord {
        serde_json::from_str(&self.read(&format!("{folder}/plan.json"))).unwrap()
    }

    /// Names of the folders in `folder`, in their order.
    pub fn folders(&self, folder: &str) -> Vec<String> {
        let inside = fs::read_dir(self.path(folder)).unwrap().map(|entry| entry.unwrap());
        let folders = inside.filter(|entry| entry.path().is_dir());
        let mut names: Vec<String> = folders.map(|entry| entry.file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Every file below `folder`, in the order of names; hidden ones too.
    pub fn files(&self, folder: &str) -> Vec<String> {
        let mut files = Vec::new();
        let root = self.path(folder);
        list(&root, &root, &mut files);
        files.sort();
        files
    }

    /// The command with its arguments, not yet started, in this folder.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_camsplat"));
        command.args(arguments.split_whitespace()).current_dir(self.folder.path());
        command.env_remove("CAMSPLAT_VALIDATION").env_remove("CAMSPLAT_LPIPS_VGG");
        if validated() {
            command.env("CAMSPLAT_VALIDATION", "1");
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Runs `camsplat` with arguments separated by spaces.
    pub fn run(&self, arguments: &str) -> Ran {
        ended(self.command(arguments).output().unwrap())
    }

    /// Like [`Place::run`], for what must work.
    #[track_caller]
    pub fn done(&self, arguments: &str) -> Ran {
        let ran = self.run(arguments);
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "camsplat {arguments}");
        ran
    }
}

/// Whether the validation layers watch every command (`CAMSPLAT_TEST_VALIDATION=1 cargo test --release --test commands`), which takes several
/// times as long.
fn validated() -> bool {
    std::env::var_os("CAMSPLAT_TEST_VALIDATION").is_some()
}

/// What a process that ended leaves; fails where the validation layers had something to say.
pub fn ended(output: Output) -> Ran {
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(!err.lines().any(|line| line.starts_with("validation: ")), "{err}");
    Ran { code: output.status.code(), out, err }
}

/// Reads a child's output up to the line that starts with `start`; fails where there is none.
pub fn read_until(child: &mut Child, start: &str) -> BufReader<ChildStdout> {
    let mut output = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    loop {
        line.clear();
        assert!(output.read_line(&mut line).unwrap() > 0, "the run ended without a line that starts with {start:?}");
        if line.starts_with(start) {
            return output;
        }
    }
}

/// Sends `signal` to a child and waits for its end.
pub fn stop(mut child: Child, mut output: impl Read, signal: &str) -> Ran {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    let mut out = String::new();
    output.read_to_string(&mut out).unwrap();
    let mut err = String::new();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    Ran { code: child.wait().unwrap().code(), out, err }
}

/// Names in a folder, hidden ones too.
pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Runs each case and asserts that it is refused with a line that holds every fragment.
#[track_caller]
pub fn assert_refused(place: &Place, cases: &[(&str, &[&str])]) {
    for (arguments, fragments) in cases {
        let before = names(&place.path(""));
        let ran = place.run(arguments);
        assert_eq!(ran.code, Some(2), "camsplat {arguments}: {}{}", ran.out, ran.err);
        assert_eq!(ran.err.lines().count(), 1, "camsplat {arguments}: {}", ran.err);
        assert!(ran.err.starts_with("error: "), "camsplat {arguments}: {}", ran.err);
        for fragment in *fragments {
            assert!(ran.err.contains(fragment), "camsplat {arguments}: {fragment:?} is not in {}", ran.err);
        }
        assert_eq!(names(&place.path("")), before, "camsplat {arguments} left something");
    }
}

fn list(root: &Path, folder: &Path, files: &mut Vec<String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            list(root, &path, files);
        } else {
            files.push(path.strip_prefix(root).unwrap().to_string_lossy().into_owned());
        }
    }
}

/// A ball as an ASCII PLY mesh.
pub fn ball() -> String {
    const RINGS: usize = 8;
    const SECTORS: usize = 16;
    let mut vertices = String::new();
    let mut faces = String::new();
    for ring in 0..=RINGS {
        for sector in 0..SECTORS {
            let (sin, cos) = (std::f64::consts::PI * ring as f64 / RINGS as f64).sin_cos();
            let (y, x) = (std::f64::consts::TAU * sector as f64 / SECTORS as f64).sin_cos();
            writeln!(vertices, "{} {} {}", sin * x, sin * y, cos).unwrap();
            let (a, b) = (ring * SECTORS + sector, ring * SECTORS + (sector + 1) % SECTORS);
            if ring < RINGS {
                writeln!(faces, "4 {a} {} {} {b}", a + SECTORS, b + SECTORS).unwrap();
            }
        }
    }
    format!(
        "{}element face {}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}",
        header((RINGS + 1) * SECTORS).trim_end_matches("end_header\n"),
        RINGS * SECTORS
    )
}

/// An ASCII PLY of points.
pub fn points(positions: &[&str]) -> String {
    format!("{}{}\n", header(positions.len()), positions.join("\n"))
}

fn header(vertices: usize) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
}
