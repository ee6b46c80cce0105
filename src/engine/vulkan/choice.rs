//! Which device to run on, and why not on another.

use super::physical::{Class, Physical};
use crate::{Error, Result};

/// A GPU with less free memory than this is in use by something else, and comes after those that have more.
const LITTLE_MEMORY: u64 = 256 << 20;

/// A device, and what the user should know of the choice: a line each.
#[derive(Debug)]
pub(super) struct Choice {
    pub device: usize,
    pub notes: Vec<String>,
}

/// The device selected by index or by a part of its name; by default the best that can be used: GPUs before software, through their own
/// driver before layered ones, discrete before integrated, with memory free before full, and the most free memory first.
///
/// # Errors
/// Where no device matches, or the one that does lacks something; the message names it.
pub(super) fn choose(devices: &[Physical], wanted: Option<&str>) -> Result<Choice> {
    let names = || {
        let list: Vec<String> = devices.iter().enumerate().map(|(i, d)| format!("{i}: {}", d.name)).collect();
        list.join(", ")
    };
    let Some(wanted) = wanted else {
        let rank = |device: &Physical| {
            let full = device.free < LITTLE_MEMORY;
            let behind = [Class::Software, Class::Layered].map(|class| device.class == class);
            (behind, full, device.class, std::cmp::Reverse(device.free))
        };
        let usable = (0..devices.len()).filter(|&i| devices[i].lacks.is_empty());
        let device = usable.min_by_key(|&i| rank(&devices[i])).ok_or_else(|| {
            Error::NoDevice(format!("no device can be used ({}); `camsplat devices` says what each lacks", names()))
        })?;
        return Ok(Choice { device, notes: notes(devices, device) });
    };
    let lower = wanted.to_lowercase();
    let found = match wanted.parse::<usize>() {
        Ok(index) if index < devices.len() => Some(index),
        // A number may also be a part of a name.
        _ => devices.iter().position(|device| device.name.to_lowercase().contains(&lower)),
    };
    let device = found.ok_or_else(|| {
        Error::NoDevice(format!("no device {wanted:?}; there is {} (see `camsplat devices`)", names()))
    })?;
    let chosen = &devices[device];
    match chosen.lacks.is_empty() {
        true => Ok(Choice { device, notes: Vec::new() }),
        false => Err(Error::NoDevice(format!("{} lacks {}", chosen.name, chosen.lacks.join(", ")))),
    }
}

/// Which GPUs were passed over though one would have expected them, and whether there is no GPU at all.
fn notes(devices: &[Physical], chosen: usize) -> Vec<String> {
    let device = &devices[chosen];
    let mut notes = Vec::new();
    for (i, other) in devices.iter().enumerate() {
        if i == chosen || other.class > device.class || other.class == Class::Software {
            continue;
        }
        if !other.lacks.is_empty() {
            notes.push(format!("{} is passed over: it lacks {}", other.name, other.lacks.join(", ")));
        } else if other.free < LITTLE_MEMORY && device.free >= LITTLE_MEMORY {
            let free = other.free >> 20;
            notes.push(format!("{} is passed over: only {free} MiB of its memory are free", other.name));
        }
    }
    if device.class == Class::Software {
        let why = if notes.is_empty() { "there is no GPU with a Vulkan driver" } else { "no GPU can be used" };
        notes.push(format!("warning: this runs on {}, a {} and slow, since {why}", device.name, device.kind));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::vulkan::physical::Kind;

    const GIB: u64 = 1 << 30;

    fn device(name: &str, class: Class, free: u64) -> Physical {
        let kind = if class == Class::Software { Kind::Cpu } else { Kind::Other };
        Physical { name: name.into(), class, free, kind, ..Physical::default() }
    }

    fn lacking(what: &str, device: Physical) -> Physical {
        Physical { lacks: vec![what.into()], ..device }
    }

    /// If this failed, plans would run on the slower of two devices, or on a duplicate under WSL2, without a word.
    #[test]
    fn the_fastest_device_that_can_be_used_is_taken() {
        let takes = |devices: &[Physical], name: &str| {
            let choice = choose(devices, None).unwrap();
            assert_eq!(devices[choice.device].name, name);
            choice.notes
        };
        let lavapipe = || device("llvmpipe", Class::Software, 8 * GIB);
        let small = || device("laptop", Class::Discrete, 4 * GIB);
        let shared = || device("iris", Class::Integrated, 16 * GIB);
        assert_eq!(takes(&[lavapipe(), shared(), small()], "laptop"), [""; 0]);
        assert_eq!(takes(&[small(), device("large", Class::Discrete, 24 * GIB)], "large"), [""; 0]);
        assert_eq!(takes(&[device("dzn laptop", Class::Layered, 24 * GIB), small()], "laptop"), [""; 0]);
        assert_eq!(takes(&[lavapipe(), device("dzn laptop", Class::Layered, GIB)], "dzn laptop"), [""; 0]);
        assert_eq!(
            takes(&[device("laptop", Class::Discrete, 100 << 20), shared()], "iris"),
            ["laptop is passed over: only 100 MiB of its memory are free"]
        );
        // Its own driver before a layered one, also where it is full and the other does not say how full it is.
        assert_eq!(
            takes(
                &[device("dzn laptop", Class::Layered, 8 * GIB), device("laptop", Class::Discrete, 100 << 20)],
                "laptop"
            ),
            [""; 0]
        );
        // Both full, and a full GPU still before software.
        assert_eq!(takes(&[device("laptop", Class::Discrete, 0), lavapipe()], "laptop"), [""; 0]);
    }

    /// If this failed, the user would not learn why a GPU is idle while the CPU plans.
    #[test]
    fn what_is_passed_over_and_software_in_place_of_a_gpu_are_said() {
        let lavapipe = || device("llvmpipe", Class::Software, 8 * GIB);
        let choice = choose(&[lavapipe()], None).unwrap();
        assert_eq!(
            choice.notes,
            ["warning: this runs on llvmpipe, a CPU and slow, since there is no GPU with a Vulkan driver"]
        );
        let old = || lacking("VK_KHR_push_descriptor", device("old", Class::Discrete, GIB));
        let choice = choose(&[old(), lavapipe()], None).unwrap();
        assert_eq!((choice.device, choice.notes.len()), (1, 2));
        assert_eq!(choice.notes[0], "old is passed over: it lacks VK_KHR_push_descriptor");
        assert!(choice.notes[1].ends_with("since no GPU can be used"), "{:?}", choice.notes);
        // What was asked for is taken without a word, and refused where it cannot be.
        let both = [old(), lavapipe()];
        let numbered = [device("RTX 4090", Class::Discrete, GIB)];
        assert_eq!(choose(&numbered, Some("4090")).unwrap().device, 0);
        for wanted in ["1", "LLVM"] {
            let choice = choose(&both, Some(wanted)).unwrap();
            assert_eq!((choice.device, choice.notes), (1, vec![]));
        }
        for (wanted, refused) in [("0", "old lacks VK_KHR"), ("2", "no device \"2\"; there is 0: old, 1: llvmpipe")] {
            let error = choose(&both, Some(wanted)).unwrap_err().to_string();
            assert!(error.starts_with(refused), "{error}");
        }
        assert!(choose(&[old()], None).unwrap_err().to_string().starts_with("no device can be used (0: old)"));
    }
}
