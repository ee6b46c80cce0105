//! Recorders that follow one another: what one is done with serves the next.

use std::sync::Arc;
use std::thread;

use camsplat::Result;
use camsplat::vulkan::{Buffer, Context, Options, Recorder};

/// More than are kept at once.
const MANY: usize = 20;

fn context() -> Result<Arc<Context>> {
    Context::new(&Options { validation: true, ..Options::default() })
}

/// Fills a buffer through so many recorders that are alive at once, and reads the last value back.
fn fill(context: &Arc<Context>, values: std::ops::Range<u32>) -> Result<Vec<u32>> {
    let buffers: Vec<Buffer> = values.clone().map(|_| Buffer::device(context, "filled", 16)).collect::<Result<_>>()?;
    let mut recorders = Vec::new();
    for (buffer, value) in buffers.iter().zip(values) {
        let mut commands = Recorder::timed_whole(context)?;
        commands.fill(buffer, value);
        commands.submit()?;
        recorders.push(commands);
    }
    for commands in &mut recorders {
        commands.wait()?;
        let timings = commands.timings()?;
        assert!(timings.len() == 1 && timings[0].end >= timings[0].start, "{timings:?}");
    }
    drop(recorders);
    buffers.iter().map(|buffer| Ok(buffer.download::<u32>(4)?[3])).collect()
}

/// If this failed, a recorder would run what an earlier one recorded, end before its work is done, or take times of another,
/// and results would silently differ from run to run.
#[test]
fn recorders_after_others_do_their_own_work() -> Result<()> {
    let context = context()?;
    // Dropped before it is submitted; refused, since the copy passes the end; submitted twice.
    let (small, large) = (Buffer::device(&context, "small", 16)?, Buffer::device(&context, "large", 32)?);
    let mut unsubmitted = Recorder::timed(&context, 4)?;
    unsubmitted.fill(&small, 1);
    assert!(unsubmitted.timings().is_err(), "nothing has run");
    drop(unsubmitted);
    let mut refused = Recorder::new(&context)?;
    refused.copy(&large, &small, 32);
    assert!(refused.submit_and_wait().is_err());
    drop(refused);
    let mut twice = Recorder::timed(&context, 4)?;
    twice.fill(&small, 2);
    twice.submit()?;
    twice.submit()?;
    assert!(twice.timings().is_err(), "it has not been waited for");
    twice.wait()?;
    assert_eq!(twice.timings()?.iter().map(|timing| timing.name).collect::<Vec<_>>(), ["fill"]);
    drop(twice);
    assert_eq!(small.download::<u32>(4)?, [2; 4]);

    thread::scope(|scope| {
        let workers: Vec<_> = [100u32, 1000]
            .into_iter()
            .map(|first| {
                let context = &context;
                scope.spawn(move || {
                    for round in 0..3 {
                        let values = first + round..first + round + MANY as u32;
                        assert_eq!(fill(context, values.clone())?, values.collect::<Vec<_>>());
                    }
                    Ok(())
                })
            })
            .collect();
        workers.into_iter().try_for_each(|worker| worker.join().unwrap())
    })?;
    assert_eq!(context.messages(), [""; 0]);
    Ok(())
}
