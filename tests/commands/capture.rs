//! `--renderdoc`: a capture that RenderDoc takes, opened again by RenderDoc.

use std::process::{Command, Output};

use crate::support::command::{FILES, Place, SHORT, ended};
use serde_json::Value;

/// Opens a capture on the local device and prints the tree of actions, the names of all buffers and the first words of
/// `settings` as they were when the iteration began.
const OPEN: &str = r#"
import json, struct, sys
import renderdoc as rd
rd.InitialiseReplay(rd.GlobalEnvironment(), [])
capture = rd.OpenCaptureFile()
assert capture.OpenFile(sys.argv[1], "", None) == rd.ResultCode.Succeeded, "cannot be opened"
status, replay = capture.OpenCapture(rd.ReplayOptions(), None)
assert status == rd.ResultCode.Succeeded, "cannot be replayed: %s" % status
names = replay.GetStructuredFile()
tree = lambda actions: [{"name": a.GetName(names), "children": tree(a.children)} for a in actions]
buffers = [r for r in replay.GetResources() if r.type == rd.ResourceType.Buffer]
replay.SetFrameEvent(1, True)
settings = [r.resourceId for r in buffers if r.name == "settings"]
words = struct.unpack("4I", replay.GetBufferData(settings[0], 0, 16)) if settings else []
print(json.dumps({"actions": tree(replay.GetRootActions()), "buffers": [r.name for r in buffers], "settings": words}))
replay.Shutdown()
capture.Shutdown()
rd.ShutdownReplay()
"#;

/// Buffers that the stages of an iteration are bound to.
const BUFFERS: [&str; 11] = [
    "settings",
    "control",
    "splats",
    "viewers",
    "looks",
    "law",
    "slots",
    "partials",
    "viewer losses",
    "moments",
    "history",
];

/// A place in which RenderDoc leaves its own files in the place, too; none where it is not installed.
fn place() -> Option<Place> {
    if Command::new("renderdoccmd").arg("version").output().is_err() {
        println!("skipped: RenderDoc is not installed");
        return None;
    }
    Some(Place::new())
}

fn succeeded(output: Output) -> String {
    let ran = ended(output);
    assert_eq!(ran.code, Some(0), "{}{}", ran.out, ran.err);
    ran.out
}

/// If this failed, debugging a fault on a GPU would start from a capture that is empty, that no tool opens, or in which
/// nothing has a name.
#[test]
fn a_capture_of_one_iteration_opens_again_with_its_names() {
    let Some(place) = place() else { return };
    let mut command = place.command(&format!("plan ball.ply --out o {SHORT} --renderdoc taken"));
    let out = succeeded(command.env("HOME", place.path("")).output().unwrap());
    let named = out.lines().find_map(|line| line.strip_prefix("capture  ")).expect(&out);
    assert!(named.starts_with("taken") && named.ends_with(".rdc"), "{named}");
    assert_eq!(place.files("o"), FILES);

    let python = ["python3", "/usr/bin/python3"].into_iter().find(|python| {
        let import = Command::new(python).args(["-c", "import renderdoc"]).output();
        import.is_ok_and(|output| output.status.success())
    });
    let Some(python) = python else {
        println!("python3 has no module `renderdoc`: the capture is only parsed, not replayed");
        return parsed(&place, named);
    };
    let mut open = Command::new(python);
    open.args(["-c", OPEN, named]).current_dir(place.path("")).env("HOME", place.path(""));
    let found: Value = serde_json::from_str(succeeded(open.output().unwrap()).lines().last().unwrap()).unwrap();
    let is_dispatch = |action: &Value| action["name"].as_str().unwrap().contains("Dispatch");
    let actions = found["actions"].as_array().unwrap();
    let stages = actions.iter().filter(|action| action["children"].as_array().unwrap().iter().any(is_dispatch));
    let stages: Vec<&str> = stages.map(|action| action["name"].as_str().unwrap()).collect();
    assert_eq!(stages, ["look", "viewed", "update_quality"], "{actions:?}");
    assert!(!actions.iter().any(is_dispatch), "a dispatch outside every stage: {actions:?}");
    let buffers: Vec<&str> = found["buffers"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    for name in BUFFERS {
        assert!(buffers.contains(&name), "{name} is not in {buffers:?}");
    }
    // What the buffers hold is in the capture as well: splats, kept and viewers of an iteration.
    assert_eq!(found["settings"].as_array().unwrap()[..3], [5, 0, 20]);
}

/// Without the module: RenderDoc's own converter reads the file and writes what is in it as XML.
fn parsed(place: &Place, capture: &str) {
    let mut convert = Command::new("renderdoccmd");
    convert.args(["convert", "-f", capture, "-o", "taken.zip.xml", "-c", "zip.xml"]);
    succeeded(convert.current_dir(place.path("")).env("HOME", place.path("")).output().unwrap());
    let text = place.read("taken.zip.xml");
    let holds =
        |tag: &str, name: &str| text.lines().any(|l| l.contains(tag) && l.contains(&format!(">{name}</string>")));
    for stage in ["look", "viewed", "update_quality"] {
        assert!(holds("pLabelName", stage), "{stage}");
    }
    for name in BUFFERS {
        assert!(holds("ObjectName", name), "{name}");
    }
}

/// If this failed, RenderDoc's converter would find something else in a capture than its replay does, and the check
/// where there is no Python module would check nothing.
#[test]
fn a_capture_can_be_parsed_without_replaying_it() {
    let Some(place) = place() else { return };
    let mut command = place.command(&format!("plan ball.ply --out o {SHORT} --renderdoc taken"));
    let out = succeeded(command.env("HOME", place.path("")).output().unwrap());
    parsed(&place, out.lines().find_map(|line| line.strip_prefix("capture  ")).expect(&out));
}

/// If this failed, capturing an iteration would change the plan that follows.
#[test]
fn a_capture_does_not_change_the_plan() {
    let Some(place) = place() else { return };
    place.done(&format!("plan ball.ply --out plain {SHORT}"));
    let mut command = place.command(&format!("plan ball.ply --out captured {SHORT} --renderdoc taken"));
    succeeded(command.env("HOME", place.path("")).output().unwrap());
    let (plain, captured) = (place.plan("plain"), place.plan("captured"));
    assert_eq!((plain.cameras, plain.history), (captured.cameras, captured.history));
}

/// If this failed, a capture that was not taken would go unnoticed, or leave half a plan.
#[test]
fn a_capture_that_cannot_be_taken_is_an_error() {
    let Some(place) = place() else { return };
    let mut command = place.command(&format!("plan ball.ply --out o {SHORT} --renderdoc taken"));
    // The switch with which RenderDoc 1.24's layer stays out of a process; later versions have one of their own.
    let version =
        String::from_utf8_lossy(&Command::new("renderdoccmd").arg("version").output().unwrap().stdout).into_owned();
    let number = version.split_whitespace().find_map(|word| word.strip_prefix('v')).unwrap_or_default();
    let switch = format!("DISABLE_VULKAN_RENDERDOC_CAPTURE_{}", number.replace('.', "_"));
    let ran = ended(command.env("HOME", place.path("")).env(&switch, "1").output().unwrap());
    assert_eq!((ran.code, ran.err.lines().count()), (Some(2), 1), "{switch}: {}{}", ran.out, ran.err);
    assert!(ran.err.contains("could not take the capture"), "{}", ran.err);
    assert!(!place.path("o").exists());
}
