//! Reduce against its twin, on the device with the validation layers on.

use crate::support::buffers::{SIZES, random};
use crate::support::device::{context, silent};
use camsplat::Result;
use camsplat::engine::primitives::{Count, Operation, Reduce, twin};
use camsplat::engine::vulkan::{Buffer, Recorder};

const OPERATIONS: [Operation; 6] =
    [Operation::SumF32, Operation::MinF32, Operation::MaxF32, Operation::SumU32, Operation::MinU32, Operation::MaxU32];

/// Floats of both signs and many magnitudes, as bits: sums of these show the order of the additions.
fn elements(operation: Operation, seed: u64, count: usize) -> Vec<u32> {
    let words = random(seed, count);
    match operation {
        Operation::SumU32 | Operation::MinU32 | Operation::MaxU32 => words,
        // Exponents from -16 to 15.
        _ => words.iter().map(|word| (word & 0x807f_ffff) | ((111 + (word >> 23 & 31)) << 23)).collect(),
    }
}

/// Were any element missed or added in another order, the bits would differ: sums of floats are compared as bits.
#[test]
fn bits_match_the_twin_at_every_size() -> Result<()> {
    let context = context();
    for operation in OPERATIONS {
        let reduce = Reduce::new(&context, operation, 1 << 25)?;
        for size in SIZES.into_iter().chain([(1 << 24) + 1]) {
            let elements = elements(operation, size as u64, size);
            let input = Buffer::from_slice(&context, "input", &elements)?;
            let output = Buffer::from_slice(&context, "output", &[1u32, 2, 3, 4])?;
            let mut recorder = Recorder::new(&context)?;
            reduce.record(&mut recorder, &input, Count::Host(size as u32), &output, 1)?;
            reduce.record(&mut recorder, &input, Count::Host(size as u32), &output, 2)?;
            recorder.submit_and_wait()?;
            let expected = twin::reduce(operation, &elements);
            assert_eq!(output.download::<u32>(4)?, [1, expected, expected, 4], "{operation:?} of {size} elements");
        }
    }
    silent(&context);
    Ok(())
}

/// The twin's own order is odd; were the twin wrong, shader and twin could agree on nonsense.
#[test]
fn the_twin_sums() {
    let elements = elements(Operation::SumF32, 5, 100_000);
    let exact: f64 = elements.iter().map(|bits| f32::from_bits(*bits) as f64).sum();
    let size: f64 = elements.iter().map(|bits| f32::from_bits(*bits).abs() as f64).sum();
    let sum = f32::from_bits(twin::reduce(Operation::SumF32, &elements)) as f64;
    assert!((sum - exact).abs() < 1e-6 * size, "{sum} and {exact}");
}

/// Were the order to depend on the capacity instead of the count, a counter on the device would change a sum's bits.
#[test]
fn a_counter_on_the_device_gives_the_bits_of_a_count_on_the_host() -> Result<()> {
    let context = context();
    let elements = elements(Operation::SumF32, 11, 300_000);
    let input = Buffer::from_slice(&context, "input", &elements)?;
    let reduce = Reduce::new(&context, Operation::SumF32, 300_000)?;
    for counted in [0, 1, 4097, 123_457] {
        let counters = Buffer::from_slice(&context, "counters", &[9u32, 9, counted as u32, 9])?;
        let mut recorder = Recorder::new(&context)?;
        reduce.record(&mut recorder, &input, Count::Device(&counters, 2), &counters, 0)?;
        recorder.submit_and_wait()?;
        assert_eq!(counters.download::<u32>(1)?[0], twin::reduce(Operation::SumF32, &elements[..counted]));
    }
    silent(&context);
    Ok(())
}
