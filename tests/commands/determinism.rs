//! The built command gives the same plan, to the bit, whatever the number of threads and whatever runs beside it.

use crate::support::command::{Place, ended};
use camsplat::files::io;
use camsplat::planner::plan::record::{IterationRecord, Status};
use camsplat::scene::camera::Camera;

/// A run that is short, and whose batches wrap around in the pool.
const SMALL: &str = "--views 30 --probes 9 --held-out 60 --iterations 20 --checkpoint-every 10";

/// The ways through the planner that have their own stages.
const WAYS: [&str; 3] = [
    "--method ours",
    "--method paper --pool 64 --pass dense --relocate-every 5",
    "--method paper --pool 64 --pass binned --relocate-every 5",
];

/// What a plan records, except the time it took.
struct Planned {
    /// The bytes of transforms.json.
    transforms: String,
    history: Vec<IterationRecord>,
    cameras: Vec<Camera>,
    device: String,
}

/// Plans with the software driver set by `environment`, and relocates on the way.
fn planned(place: &Place, way: &str, environment: &[(&str, &str)]) -> Planned {
    let arguments = format!("plan ball.ply --out o --force {SMALL} {way}");
    let ran = ended(place.command(&arguments).envs(environment.iter().copied()).output().unwrap());
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "camsplat {arguments} with {environment:?}");
    let plan = place.plan("o");
    assert_eq!((plan.status, plan.history.len()), (Status::Complete, 20), "{way}");
    let cameras = io::read_cameras(&place.path("o").join("transforms.json")).unwrap();
    Planned { transforms: place.read("o/transforms.json"), history: plan.history, cameras, device: plan.device }
}

/// If this failed, no plan could be repeated, and no difference between two plans could be attributed to an option. A sum
/// in the order in which threads happen to end would do it. (On other drivers than lavapipe the variable is not read,
/// and this is four times the same run.)
#[test]
fn a_plan_is_the_same_to_the_bit_on_any_number_of_threads() {
    let place = Place::new();
    for way in WAYS {
        let first = planned(&place, way, &[]);
        assert!(first.history.iter().all(|row| row.loss.is_finite()) && first.cameras.len() == 30);
        // Several threads more than once: what depends on which of them is first may be the same by chance.
        for threads in ["0", "1", "2", "3"] {
            let again = planned(&place, way, &[("LP_NUM_THREADS", threads)]);
            assert_eq!(first.transforms, again.transforms, "{way}, LP_NUM_THREADS={threads}");
            assert_eq!(first.history, again.history, "{way}, LP_NUM_THREADS={threads}");
        }
    }
}

/// Subgroups are 4 wide on lavapipe with vectors of 128 bits and 8 wide with 256, 32 or 64 on GPUs: a result that depends
/// on that is one that depends on the device. Nothing in the planner's own stages is shared by subgroup, and lavapipe
/// generates the same arithmetic for either width, so that even the bits must be the same.
#[test]
fn a_plan_does_not_depend_on_the_subgroup_size() {
    let place = Place::new();
    for way in WAYS {
        let [narrow, wide] = ["128", "256"].map(|bits| planned(&place, way, &[("LP_NATIVE_VECTOR_WIDTH", bits)]));
        // The driver's name contains the width, which shows that the variable was read; other drivers ignore it.
        if narrow.device.contains("llvmpipe") {
            assert_ne!(narrow.device, wide.device, "both runs were on vectors of one width");
        }
        assert_eq!(narrow.transforms, wide.transforms, "{way}");
        assert_eq!(narrow.history, wide.history, "{way}");
    }
}
