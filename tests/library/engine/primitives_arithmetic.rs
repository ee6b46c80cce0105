//! The multiply-adds that other stages' arithmetic is measured against.

use crate::support::device::{context, silent};
use camsplat::Result;
use camsplat::engine::primitives::{Arithmetic, twin};
use camsplat::engine::vulkan::{Buffer, Recorder};

/// If this failed, the peak of arithmetic in the benchmarks would be that of fewer operations than it counts: a driver would have left
/// some out, or would have ended a long loop early.
#[test]
fn every_multiply_add_is_done() -> Result<()> {
    let context = context();
    let arithmetic = Arithmetic::new(&context)?;
    // All intermediate values are integers below 2^24, which are exact.
    for (threads, rounds, constants) in [
        (1, 0, [5.0, 7.0]),
        (257, 1, [1.0, 3.0]),
        (1000, 64, [-1.0, 1.0]),
        (256, 2000, [1.0, 1.0]),
        (70_000, 3, [1.0, -2.0]),
    ] {
        let target = Buffer::from_slice(&context, "target", &vec![0.5f32; threads])?;
        let mut recorder = Recorder::new(&context)?;
        arithmetic.record(&mut recorder, &target, rounds, constants);
        recorder.submit_and_wait()?;
        let found: Vec<f32> = target.download(threads)?;
        let expected: Vec<f32> = (0..threads as u32).map(|i| twin::multiply_add(i, rounds, constants)).collect();
        assert!(found == expected, "{threads} threads, {rounds} rounds");
    }
    silent(&context);
    Ok(())
}
