//! Scan against its twin, on the device with the validation layers on.

use crate::support::buffers::{SIZES, random};
use crate::support::device::{context, silent};
use camsplat::Result;
use camsplat::engine::primitives::{Count, Scan, twin};
use camsplat::engine::vulkan::{Buffer, Recorder};

const UNTOUCHED: u32 = 0xdead_beef;

/// Were blocks, rows or their offsets joined wrongly at some size, the sums would differ there; were the end of the
/// input missed, what lies behind the sums would change.
#[test]
fn sums_match_the_twin_at_every_size() -> Result<()> {
    let context = context();
    let scan = Scan::new(&context, 1 << 25)?;
    for size in SIZES.into_iter().chain([(1 << 24) + 1]) {
        let values = random(size as u64, size);
        let (expected, expected_total) = twin::scan(&values);
        let input = Buffer::from_slice(&context, "input", &values)?;
        let output = Buffer::from_slice(&context, "output", &vec![UNTOUCHED; size + 4])?;
        let total = Buffer::from_slice(&context, "total", &[UNTOUCHED; 4])?;
        let mut recorder = Recorder::new(&context)?;
        scan.record(&mut recorder, &input, &output, Count::Host(size as u32), (&total, 2))?;
        // Once more over the same buffers: the same bits, and no barrier missing in between.
        scan.record(&mut recorder, &input, &output, Count::Host(size as u32), (&total, 2))?;
        recorder.submit_and_wait()?;
        let sums: Vec<u32> = output.download(size + 4)?;
        assert!(sums[..size] == expected, "sums of {size} elements");
        assert_eq!(sums[size..], [UNTOUCHED; 4], "behind {size} sums");
        assert_eq!(total.download::<u32>(4)?, [UNTOUCHED, UNTOUCHED, expected_total, UNTOUCHED], "total of {size}");
    }
    silent(&context);
    Ok(())
}

/// Were the counter read from elsewhere, or not checked against the capacity, elements behind it would be touched.
#[test]
fn a_counter_on_the_device_says_how_many() -> Result<()> {
    let context = context();
    let scan = Scan::new(&context, 70_000)?;
    let values = random(7, 70_000);
    let input = Buffer::from_slice(&context, "input", &values)?;
    for (counter, counted) in [(0, 0), (1, 1), (4096, 4096), (50_001, 50_001), (u32::MAX, 70_000)] {
        let output = Buffer::from_slice(&context, "output", &vec![UNTOUCHED; 70_000])?;
        let counters = Buffer::from_slice(&context, "counters", &[UNTOUCHED, counter, UNTOUCHED, UNTOUCHED])?;
        let mut recorder = Recorder::new(&context)?;
        scan.record(&mut recorder, &input, &output, Count::Device(&counters, 1), (&counters, 3))?;
        recorder.submit_and_wait()?;
        let (mut expected, total) = twin::scan(&values[..counted]);
        expected.resize(70_000, UNTOUCHED);
        assert!(output.download::<u32>(70_000)? == expected, "a counter of {counter}");
        assert_eq!(counters.download::<u32>(4)?[3], total);
    }
    silent(&context);
    Ok(())
}

/// Rows of a sparse matrix: n + 1 offsets in one buffer. Were the last stage to write past its count, it would erase
/// the total.
#[test]
fn the_total_may_follow_the_sums() -> Result<()> {
    let context = context();
    let scan = Scan::new(&context, 5000)?;
    let values = random(3, 5000);
    let input = Buffer::from_slice(&context, "input", &values)?;
    let output = Buffer::device(&context, "offsets", 4 * 5001)?;
    let mut recorder = Recorder::new(&context)?;
    scan.record(&mut recorder, &input, &output, Count::Host(5000), (&output, 5000))?;
    recorder.submit_and_wait()?;
    let (mut expected, total) = twin::scan(&values);
    expected.push(total);
    assert!(output.download::<u32>(5001)? == expected);
    silent(&context);
    Ok(())
}

/// Were these let through, shaders would reach outside buffers.
#[test]
fn what_does_not_fit_is_an_error() -> Result<()> {
    let context = context();
    assert!(Scan::new(&context, (1 << 28) + 1).is_err());
    let scan = Scan::new(&context, 100)?;
    let small = Buffer::device(&context, "small", 4 * 50)?;
    let large = Buffer::device(&context, "large", 4 * 200)?;
    let mut recorder = Recorder::new(&context)?;
    assert!(scan.record(&mut recorder, &large, &large, Count::Host(101), (&large, 0)).is_err());
    assert!(scan.record(&mut recorder, &large, &small, Count::Host(51), (&large, 0)).is_err());
    assert!(scan.record(&mut recorder, &large, &large, Count::Host(1), (&small, 50)).is_err());
    assert!(scan.record(&mut recorder, &large, &large, Count::Device(&small, 50), (&large, 0)).is_err());
    Ok(())
}
