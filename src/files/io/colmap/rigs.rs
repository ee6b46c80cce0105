//! Rigs and frames, which COLMAP has since version 3.12: sensors that are fixed to each other, and where a rig was when all of them
//! fired. The pose of an image is that of its sensor in the rig after that of the rig in the world; COLMAP does not read the poses in the
//! file of images where there are frames, so that these may be stale.

use std::collections::HashMap;

use glam::{DQuat, DVec3};

use super::Image;

/// A rigid motion as COLMAP stores it: quaternion (w, x, y, z) and translation.
type Motion = ([f64; 4], [f64; 3]);

/// A camera, or something else that measures, by its number; that of a camera is also the number of its lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sensor {
    /// Whether it is a camera.
    pub is_camera: bool,
    /// Number among those of its kind.
    pub id: u32,
}

/// Sensors that are fixed to each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Number that frames refer to.
    pub id: u32,
    /// Sensors with their sensor-from-rig motion, where that is known; the first is the reference.
    pub sensors: Vec<(Sensor, Option<Motion>)>,
}

impl Rig {
    /// The motion of the reference sensor.
    pub const REFERENCE: Motion = ([1.0, 0.0, 0.0, 0.0], [0.0; 3]);
}

/// A rig at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Number of the rig.
    pub rig: u32,
    /// Its rig-from-world motion.
    pub pose: Motion,
    /// What was taken: the sensor, and the number of the image where that is a camera.
    pub images: Vec<(Sensor, u64)>,
}

/// Relative difference of poses that are taken for the same: text files have some ten digits.
const SAME: f64 = 1e-6;

/// Gives `images` the poses of rigs and frames. Poses that are the same but for rounding stay as they were, bit for bit; a note counts the
/// others.
pub(super) fn pose_images(rigs: &[Rig], frames: &[Frame], images: &mut [Image], notes: &mut Vec<String>) {
    let poses = poses(rigs, frames);
    let mut moved = 0;
    for image in images.iter_mut() {
        if let Some(pose) = poses.get(&u64::from(image.id)).filter(|pose| !same(pose, &image.stored)) {
            image.stored = *pose;
            moved += 1;
        }
    }
    if moved > 0 {
        let all = images.len();
        notes.push(format!(
            "{moved} of {all} images stand elsewhere by the rigs and frames than in the list of images: rigs and frames were followed"
        ));
    }
}

/// Camera-from-world motions of images by their number.
fn poses(rigs: &[Rig], frames: &[Frame]) -> HashMap<u64, Motion> {
    let mut sensors: HashMap<(u32, Sensor), Motion> = HashMap::new();
    for rig in rigs {
        sensors.extend(rig.sensors.iter().filter_map(|(sensor, pose)| Some(((rig.id, *sensor), (*pose)?))));
    }
    let mut poses = HashMap::new();
    for frame in frames {
        for (sensor, image) in frame.images.iter().filter(|(sensor, _)| sensor.is_camera) {
            if let Some(sensor_from_rig) = sensors.get(&(frame.rig, *sensor)) {
                poses.insert(*image, after(sensor_from_rig, &frame.pose));
            }
        }
    }
    poses
}

/// The motion that does `second`, then `first`.
fn after(first: &Motion, second: &Motion) -> Motion {
    if *first == Rig::REFERENCE {
        return *second;
    }
    let rotation = |[w, x, y, z]: [f64; 4]| DQuat::from_xyzw(x, y, z, w).normalize();
    let (a, b) = (rotation(first.0), rotation(second.0));
    let both = a * b;
    let translation = a * DVec3::from_array(second.1) + DVec3::from_array(first.1);
    ([both.w, both.x, both.y, both.z], translation.to_array())
}

/// Whether two motions are the same but for rounding; a quaternion and its negative are.
fn same(a: &Motion, b: &Motion) -> bool {
    let dot: f64 = a.0.iter().zip(&b.0).map(|(a, b)| a * b).sum();
    let length = |q: &[f64; 4]| q.iter().map(|v| v * v).sum::<f64>().sqrt();
    let (t, u) = (DVec3::from_array(a.1), DVec3::from_array(b.1));
    // The angle is the square root of what the cosine lacks.
    1.0 - dot.abs() / (length(&a.0) * length(&b.0)) <= SAME * SAME && t.distance(u) <= SAME * (1.0 + t.length())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{binary, text};
    use super::*;
    use crate::files::io::left_out::LeftOut;

    /// Two cameras; the second is turned by 90 degrees about z and 0.2 to the right.
    const RIGS: &str =
        "# rigs\n4 3 CAMERA 1 CAMERA 2 1 0.7071067811865476 0 0 0.7071067811865476 -0.2 0 0 IMU 1 0\n5 1 CAMERA 3\n";
    const FRAMES: &str = "1 4 0 1 0 0 1 2 3 3 CAMERA 1 7 CAMERA 2 8 IMU 1 9\n2 5 1 0 0 0 0 0 4 1 CAMERA 3 11\n";

    fn read_text() -> (Vec<Rig>, Vec<Frame>) {
        let mut left_out = LeftOut::default();
        let read = (text::rigs(RIGS.as_bytes(), &mut left_out), text::frames(FRAMES.as_bytes(), &mut left_out));
        assert!(left_out.is_empty(), "{left_out:?}");
        read
    }

    /// If this failed, the second camera of a rig would stand where the first one does, or turned the other way.
    #[test]
    fn an_image_has_the_pose_of_its_sensor_after_its_rig() {
        let (rigs, frames) = read_text();
        let poses = poses(&rigs, &frames);
        assert_eq!(poses[&7], ([0.0, 1.0, 0.0, 0.0], [1.0, 2.0, 3.0]));
        assert_eq!(poses[&11], ([1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 4.0]));
        assert_eq!(poses.len(), 3, "an IMU takes no images");
        // By matrices: x goes to y and y to -x in the second camera, which then moves to the left.
        let ([w, x, y, z], t) = poses[&8];
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (found, known) in [w, x, y, z].into_iter().zip([0.0, half, half, 0.0]) {
            assert!((found - known).abs() < 1e-12, "{:?}", poses[&8]);
        }
        assert!((DVec3::from_array(t) - DVec3::new(-2.2, 1.0, 3.0)).length() < 1e-12, "{t:?}");
    }

    /// If this failed, the same rigs would be read otherwise from binary files.
    #[test]
    fn binary_files_hold_the_same() {
        let (rigs, frames) = read_text();
        let motion = |bytes: &mut Vec<u8>, (q, t): &Motion| {
            q.iter().chain(t).for_each(|v| bytes.extend(v.to_le_bytes()));
        };
        let sensor = |bytes: &mut Vec<u8>, sensor: &Sensor| {
            bytes.extend(if sensor.is_camera { 0i32 } else { 1 }.to_le_bytes());
            bytes.extend(sensor.id.to_le_bytes());
        };
        let mut bytes = (rigs.len() as u64).to_le_bytes().to_vec();
        for rig in &rigs {
            bytes.extend([rig.id, rig.sensors.len() as u32].map(u32::to_le_bytes).concat());
            for (i, (part, pose)) in rig.sensors.iter().enumerate() {
                sensor(&mut bytes, part);
                if i > 0 {
                    bytes.push(u8::from(pose.is_some()));
                    pose.iter().for_each(|pose| motion(&mut bytes, pose));
                }
            }
        }
        assert_eq!(binary::rigs(Path::new("rigs.bin"), &bytes).unwrap(), rigs);
        for length in 0..bytes.len() {
            assert!(binary::rigs(Path::new("rigs.bin"), &bytes[..length]).is_err(), "{length} bytes");
        }
        let mut bytes = (frames.len() as u64).to_le_bytes().to_vec();
        for (i, frame) in frames.iter().enumerate() {
            bytes.extend([i as u32, frame.rig].map(u32::to_le_bytes).concat());
            motion(&mut bytes, &frame.pose);
            bytes.extend((frame.images.len() as u32).to_le_bytes());
            for (part, image) in &frame.images {
                sensor(&mut bytes, part);
                bytes.extend(image.to_le_bytes());
            }
        }
        assert_eq!(binary::frames(Path::new("frames.bin"), &bytes).unwrap(), frames);
        for length in 0..bytes.len() {
            assert!(binary::frames(Path::new("frames.bin"), &bytes[..length]).is_err(), "{length} bytes");
        }
    }

    /// If this failed, a model would not stay what it was to the bit, or a stale pose be taken for the right one.
    #[test]
    fn only_poses_that_differ_are_replaced() {
        let pose = ([0.5, 0.5, -0.5, 0.5], [1.0, 2.0, 3.0]);
        let near = ([-0.5, -0.5, 0.5, -0.500_000_000_1], [1.0, 2.000_000_000_1, 3.0]);
        assert!(same(&pose, &near));
        assert!(!same(&pose, &([0.5, 0.5, -0.5, 0.501], pose.1)));
        assert!(!same(&pose, &(pose.0, [1.0, 2.0, 3.001])));
        assert!(!same(&pose, &([0.0; 4], pose.1)), "no rotation");
    }
}
