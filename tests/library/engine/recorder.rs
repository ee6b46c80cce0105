//! Recorders that follow one another: what one is done with serves the next.

use std::sync::Arc;
use std::thread;
use std::time::Duration;

use ash::vk;
use camsplat::engine::primitives::Copy;
use camsplat::engine::vulkan::host::{HostDevice, Timeline};
use camsplat::engine::vulkan::{Buffer, Context, ContextOptions, Recorder};
use camsplat::{Error, Result};

use crate::support::host::Host;

/// More than are kept at once.
const MANY: usize = 20;

fn context() -> Result<Arc<Context>> {
    Context::new(&ContextOptions { validation: true, ..ContextOptions::default() })
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

/// If this failed, twenty lines of safe code could free memory that the device uses: the process or the whole desktop would go down, or
/// the buffer of someone else would be written.
#[test]
fn what_was_submitted_stays_in_memory_whatever_becomes_of_its_owners() -> Result<()> {
    let context = context()?;
    let bytes = 64 << 20;
    let (from, to) = (Buffer::device(&context, "from", bytes)?, Buffer::device(&context, "to", bytes)?);
    let copy = Copy::new(&context)?;
    let allocated = context.allocated();
    let mut commands = Recorder::new(&context)?;
    for value in 0..20 {
        commands.fill(&from, value);
        copy.record(&mut commands, &from, &to);
    }
    commands.submit()?;
    drop((copy, from));
    assert_eq!(context.allocated(), allocated, "freed while it ran");
    std::mem::forget(commands);
    // All that was submitted before has run when this has.
    assert_eq!(to.download::<u32>(1)?, [19]);
    drop(to);
    assert_eq!(context.allocated(), allocated, "a forgotten recorder frees nothing");

    // One that is dropped frees what it alone has kept.
    let other = Buffer::device(&context, "other", bytes)?;
    let mut commands = Recorder::new(&context)?;
    commands.fill(&other, 1);
    drop(other);
    commands.submit_and_wait()?;
    assert_eq!(context.allocated(), allocated + bytes);
    drop(commands);
    assert_eq!(context.allocated(), allocated);
    assert_eq!(context.messages(), [""; 0]);
    Ok(())
}

/// If this failed, safe code could hand one device the buffers of another, run past the end of a buffer, or ask for more than a device does.
#[test]
fn what_the_device_cannot_do_is_refused_and_nothing_runs() -> Result<()> {
    let [context, other] = [context()?, context()?];
    let (buffer, foreign) =
        (Buffer::from_slice(&context, "buffer", &[7u32; 8])?, Buffer::device(&other, "foreign", 32)?);
    let refusal = |record: &dyn Fn(&mut Recorder)| {
        let mut commands = Recorder::new(&context)?;
        record(&mut commands);
        commands.fill(&buffer, 1);
        let refusal = commands.submit_and_wait().unwrap_err().to_string();
        let again = commands.submit_and_wait().unwrap_err().to_string();
        assert!(again.contains("record it anew"), "{again}");
        assert_eq!(buffer.download::<u32>(8)?, [7; 8], "{refusal}");
        Ok(refusal)
    };
    let copy = Copy::new(&context)?;
    for (record, part) in [
        (
            &(|commands: &mut Recorder| commands.copy(&buffer, &foreign, 32)) as &dyn Fn(&mut Recorder),
            "of another context",
        ),
        (&|commands| commands.fill(&foreign, 0), "\"foreign\" is of another context"),
        (&|commands| copy.record(commands, &buffer, &foreign), "of another context"),
        (&|commands| commands.copy_region(&buffer, 8, &buffer, 16, 16), "overlaps itself"),
        (&|commands| commands.copy_region(&buffer, u64::MAX, &buffer, 0, 16), "passes the end"),
    ] {
        let refusal: Result<String> = refusal(record);
        assert!(refusal.as_ref().is_ok_and(|refusal| refusal.contains(part)), "{refusal:?}, not {part}");
    }
    // Copies within a buffer that do not overlap are fine.
    let mut commands = Recorder::new(&context)?;
    commands.copy_region(&buffer, 0, &buffer, 16, 16);
    commands.submit_and_wait()?;
    assert!(buffer.download_from::<u32>(usize::MAX / 2, 8).is_err() && buffer.read::<u32>(1).is_err());
    assert_eq!([context.messages(), other.messages()].concat(), [""; 0]);
    Ok(())
}

/// If this failed, values read from a buffer could change under the reader: a value checked would not be the value used.
#[test]
fn what_is_read_from_a_host_buffer_is_a_copy() -> Result<()> {
    let context = context()?;
    let buffer = Buffer::host(&context, "host", 32)?;
    buffer.write(&[1u32, 2, 3])?;
    let held: Vec<u32> = buffer.read(3)?;
    buffer.write(&[9u32; 3])?;
    assert_eq!((held, buffer.read::<u32>(3)?), (vec![1, 2, 3], vec![9; 3]));
    assert!(buffer.read::<u32>(9).is_err() && buffer.write(&[0u32; 9]).is_err());
    Ok(())
}

/// If this failed, a device that hangs would hang the program with it, without a word of what it was doing.
#[test]
fn waiting_has_an_end_that_names_the_stages() -> Result<()> {
    let host = Host::new(&context()?.physical().name);
    // SAFETY: the host outlives the context, which ends before it.
    let context =
        unsafe { Context::adopt(HostDevice { wait_limit: Some(Duration::from_millis(500)), ..host.lend() }) }?;
    let buffer = Buffer::device(&context, "buffer", 32)?;
    let copy = Copy::new(&context)?;
    let other = Buffer::device(&context, "other", 32)?;
    // SAFETY: the device lives until the end, and the semaphore until all has run.
    let semaphore = unsafe {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        host.device.create_semaphore(&vk::SemaphoreCreateInfo::default().push_next(&mut kind), None).unwrap()
    };
    let mut commands = Recorder::new(&context)?;
    commands.fill(&buffer, 1);
    copy.record(&mut commands, &buffer, &other);
    // SAFETY: the semaphore is a timeline of this device and lives until all has run.
    unsafe { commands.submit_between(&[Timeline { semaphore, value: 1 }], &[])? };
    let error = commands.wait().unwrap_err();
    assert!(matches!(error, Error::Unfinished { first: "fill", last: "copy_words", .. }), "{error}");
    assert_eq!(error.exit_code(), 1);
    assert!(matches!(commands.pending(), Err(Error::Unfinished { .. })), "polling has an end too");
    let reached = vk::SemaphoreSignalInfo::default().semaphore(semaphore).value(1);
    // SAFETY: as above.
    unsafe { host.device.signal_semaphore(&reached) }.unwrap();
    commands.wait()?;
    assert_eq!(other.download::<u32>(1)?, [1]);
    // SAFETY: nothing waits for it any more.
    unsafe { host.device.destroy_semaphore(semaphore, None) };
    assert_eq!(*host.messages.lock().unwrap(), [""; 0]);
    Ok(())
}

/// If this failed, safe code could write into a command buffer that the device reads, or free what it uses.
#[test]
fn what_was_submitted_takes_nothing_more() -> Result<()> {
    let context = context()?;
    let buffer = Buffer::device(&context, "filled", 64)?;
    let submitted = || {
        let mut commands = Recorder::new(&context)?;
        commands.fill(&buffer, 1);
        commands.submit()?;
        Ok::<_, Error>(commands)
    };
    let more = |record: &dyn Fn(&mut Recorder)| -> Result<String> {
        let mut commands = submitted()?;
        record(&mut commands);
        Ok(commands.submit_and_wait().unwrap_err().to_string())
    };
    let copy = Copy::new(&context)?;
    let other = Buffer::device(&context, "copied", 64)?;
    let refused = [
        more(&|commands| commands.fill(&buffer, 2))?,
        more(&|commands| commands.copy(&buffer, &other, 64))?,
        more(&|commands| copy.record(commands, &buffer, &other))?,
        more(&|commands| commands.cut().unwrap())?,
    ];
    assert!(refused.iter().all(|what| what.contains("begin another")), "{refused:?}");
    assert!(submitted()?.finish().is_err_and(|error| error.to_string().contains("submit this one")));
    assert_eq!(buffer.download::<u32>(16)?, [1; 16]);

    // In a host's command buffer it is the host that submits.
    let host = Host::new(&context.physical().name);
    let adopted = host.adopted();
    let buffer = Buffer::device(&adopted, "filled", 64)?;
    let (recorded, _kept) = host.record(&adopted, |recorder| {
        recorder.fill(&buffer, 3);
        let refused = recorder.submit_and_wait().unwrap_err().to_string();
        assert!(refused.contains("a host submits"), "{refused}");
    });
    host.submit(recorded, 1);
    assert_eq!(buffer.download::<u32>(16)?, [3; 16]);
    assert_eq!(context.messages(), [""; 0]);
    assert_eq!(*host.messages.lock().unwrap(), [""; 0]);
    Ok(())
}
