//! The copy that other stages' bandwidth is measured against.

use crate::support::buffers::random;
use crate::support::device::{context, silent};
use camsplat::Result;
use camsplat::engine::primitives::Copy;
use camsplat::engine::vulkan::{Buffer, Recorder};

/// If this failed, the bandwidth in the benchmarks would be that of a stage that copies less than it reports, or more.
#[test]
fn whole_vectors_are_copied_and_nothing_behind_them() -> Result<()> {
    let context = context();
    let copy = Copy::new(&context)?;
    // Words of the source and of the target; whole vectors of four are copied, as many as both hold.
    for (from, to, copied) in [(4, 4, 4), (1024, 1028, 1024), (1030, 4096, 1028), (70_000, 50_002, 50_000)] {
        let words = random(from as u64, from);
        let source = Buffer::from_slice(&context, "source", &words)?;
        let target = Buffer::from_slice(&context, "target", &vec![7u32; to])?;
        let mut recorder = Recorder::new(&context)?;
        copy.record(&mut recorder, &source, &target);
        recorder.submit_and_wait()?;
        let found: Vec<u32> = target.download(to)?;
        assert!(found[..copied] == words[..copied], "{from} words to {to}");
        assert!(found[copied..].iter().all(|word| *word == 7), "behind {copied} words of {to}");
    }
    silent(&context);
    Ok(())
}
