//! Ranges of keys against their twin, on the device with the validation layers on.

use crate::support::buffers::{SIZES, random};
use crate::support::device::{context, silent};
use camsplat::Result;
use camsplat::engine::primitives::{Count, KeyRanges, twin};
use camsplat::engine::vulkan::{Buffer, Recorder};

/// If this failed, a tile would be drawn without some of its splats, or with those of another.
#[test]
fn each_key_has_the_elements_from_its_first_to_its_last() -> Result<()> {
    let context = context();
    for count in SIZES {
        let ranges = KeyRanges::new(&context, count as u32)?;
        // Some keys have no elements, and the last ones no range.
        let keys = (count as u32 / 3).max(4);
        let mut sorted: Vec<u32> = random(count as u64, count).iter().map(|word| word % (keys + 2)).collect();
        sorted.sort_unstable();
        for length in [count, count / 2] {
            let source = Buffer::from_slice(&context, "keys", &sorted)?;
            let number = Buffer::from_slice(&context, "number", &[9, length as u32])?;
            let target = Buffer::from_slice(&context, "ranges", &vec![7u32; 2 * keys as usize])?;
            let mut recorder = Recorder::new(&context)?;
            ranges.record(&mut recorder, &source, Count::Device(&number, 1), &target)?;
            recorder.submit_and_wait()?;
            let found: Vec<[u32; 2]> = target.download(keys as usize)?;
            assert!(found == twin::key_ranges(&sorted[..length], keys as usize), "{length} of {count}");
        }
    }
    silent(&context);
    Ok(())
}
