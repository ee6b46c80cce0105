//! The engine on the queue of a host that draws: behind the host's lock, one submission at a time.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, ThreadId};
use std::time::Instant;

use ash::vk;
use camsplat::Error;
use camsplat::engine::vulkan::host::QueueLock;
use camsplat::engine::vulkan::{Buffer, Context, ContextOptions, Recorder};
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::scene::samples;
use glam::DVec3;

use crate::support::host::Host;
use crate::support::plans;

fn host() -> Host {
    Host::new(&Context::new(&ContextOptions::default()).unwrap().physical().name)
}

/// A host's lock that looks at a buffer whenever the engine is about to submit.
#[derive(Default)]
struct Watch {
    buffer: Mutex<Option<Buffer>>,
    seen: Mutex<Vec<u32>>,
}

impl QueueLock for Watch {
    fn locked(&self, submit: &mut dyn FnMut()) {
        if let Some(word) = self.buffer.lock().unwrap().as_ref().and_then(|buffer| buffer.peek(0)) {
            self.seen.lock().unwrap().push(word);
        }
        submit();
    }
}

/// If this failed, a frame of a host that allows submissions of a few milliseconds would wait for many of them.
#[test]
fn parts_of_a_recording_come_one_by_one() {
    let host = host();
    let watch = Arc::new(Watch::default());
    let context = host.adopted_between_frames(watch.clone(), 1);
    let buffer = Buffer::host(&context, "watched", 1 << 20).unwrap();
    let mut commands = Recorder::new(&context).unwrap();
    for value in 1..=5 {
        // Enough that the last of it has not happened when the next part could follow at once.
        (0..64).for_each(|_| commands.fill(&buffer, value - 1));
        commands.fill(&buffer, value);
        commands.cut().unwrap();
    }
    buffer.write(&[0u32]).unwrap();
    *watch.buffer.lock().unwrap() = Some(buffer);
    commands.submit_and_wait().unwrap();
    assert_eq!(*watch.seen.lock().unwrap(), [0, 1, 2, 3, 4, 5]);
    watch.buffer.lock().unwrap().take();
}

/// A host's lock that counts, remembers the threads, and submits a frame of the host's before each submission of the engine's.
struct Frames {
    device: ash::Device,
    queue: vk::Queue,
    frame: Mutex<Option<vk::CommandBuffer>>,
    submissions: AtomicU32,
    threads: Mutex<Vec<ThreadId>>,
}

impl Frames {
    fn new(host: &Host) -> Arc<Self> {
        let (device, queue) = (host.device.clone(), host.queue);
        let (frame, submissions, threads) = Default::default();
        Arc::new(Self { device, queue, frame, submissions, threads })
    }
}

impl QueueLock for Frames {
    fn locked(&self, submit: &mut dyn FnMut()) {
        self.submissions.fetch_add(1, Ordering::Relaxed);
        self.threads.lock().unwrap().push(thread::current().id());
        if let Some(frame) = *self.frame.lock().unwrap() {
            let commands = [frame];
            let info = [vk::SubmitInfo::default().command_buffers(&commands)];
            // SAFETY: the frame may be submitted while it is pending, what it uses outlives the test's runs, and the lock is held.
            unsafe { self.device.queue_submit(self.queue, &info, vk::Fence::null()) }.unwrap();
        }
        submit();
    }
}

/// If this failed, a host whose frames take long would get a plan of ever smaller submissions, which takes minutes; or its lock would be
/// taken by threads that it does not know.
#[test]
fn frames_of_the_host_do_not_count_as_work_of_the_engine() {
    const TARGET: u64 = 50;
    let host = host();
    let frames = Frames::new(&host);
    let context = host.adopted_between_frames(frames.clone(), TARGET);
    // A frame takes twice as long as the engine's submissions should.
    let buffer = Buffer::device(&context, "picture", 32 << 20).unwrap();
    let of = |fills: u32| host.record(&context, |recorder| (0..fills).for_each(|i| recorder.fill(&buffer, i)));
    let (one, _kept) = of(1);
    host.submit(one, 1);
    let begun = Instant::now();
    host.submit(one, 4);
    let fills = (2 * 4 * TARGET) as f64 / (begun.elapsed().as_secs_f64() * 1e3);
    let (frame, _also_kept) = of(fills.ceil() as u32);

    let scene = plans::object(&context);
    let paper = Config::paper(Preset::Object, 4).with_paper(|own| (own.pool, own.relocate_every) = (256, 0));
    let short = Config { iterations: 60, ..paper };
    let planner = plans::planner(&context, &scene, short);
    let submissions = || {
        planner.reset().unwrap();
        frames.submissions.store(0, Ordering::Relaxed);
        planner.run(None, |_| ControlFlow::Continue(())).unwrap();
        frames.submissions.load(Ordering::Relaxed)
    };
    let quiet = submissions();
    *frames.frame.lock().unwrap() = Some(frame);
    let drawing = submissions();
    *frames.frame.lock().unwrap() = None;
    assert!(quiet < 30 && drawing <= quiet + 6, "{quiet} submissions, and {drawing} while the host draws");
    let here = thread::current().id();
    assert!(frames.threads.lock().unwrap().iter().all(|thread| *thread == here));
    // SAFETY: nobody else uses the device.
    unsafe { host.device.device_wait_idle() }.unwrap();
}

/// A host's lock that lets so many submissions pass.
struct Allowance(AtomicU32);

impl QueueLock for Allowance {
    fn locked(&self, submit: &mut dyn FnMut()) {
        if self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_ok() {
            submit();
        }
    }
}

/// If this failed, an application that is closed would wait for the plan, or hang in its own lock.
#[test]
fn a_host_ends_a_plan_at_any_submission() {
    let host = host();
    let allowance = Arc::new(Allowance(AtomicU32::new(0)));
    let context = host.adopted_between_frames(allowance.clone(), 100);
    let surface = samples::object();
    let request = || camsplat::plan(&surface, 4).up(DVec3::Z).iterations(20);
    for allowed in [0, 1, 7, 40, 100] {
        allowance.0.store(allowed, Ordering::Relaxed);
        assert!(matches!(request().run_on(&context), Err(Error::Interrupted)), "after {allowed} submissions");
    }
    allowance.0.store(u32::MAX, Ordering::Relaxed);
    assert!(!request().run_on(&context).unwrap().interrupted());
    assert_eq!(*host.messages.lock().unwrap(), [""; 0]);
}

/// What a careless lock does with the engine's submission.
enum Careless {
    Twice,
    Panic,
}

/// A lock that is careless once.
#[derive(Default)]
struct Once(Mutex<Option<Careless>>);

impl QueueLock for Once {
    fn locked(&self, submit: &mut dyn FnMut()) {
        let how = self.0.lock().unwrap().take();
        submit();
        match how {
            Some(Careless::Twice) => submit(),
            Some(Careless::Panic) => panic!("the host's own fault"),
            None => (),
        }
    }
}

/// If this failed, safe code of a host could free what the device uses, or have one fence signalled twice.
#[test]
fn a_careless_lock_harms_nothing() {
    let host = host();
    let lock = Arc::new(Once::default());
    let context = host.adopted_between_frames(lock.clone(), 100);
    let large = Buffer::device(&context, "large", 64 << 20).unwrap();
    let fills = |recorder: &mut Recorder| (0..20).for_each(|i| recorder.fill(&large, i));
    let mut commands = Recorder::new(&context).unwrap();
    fills(&mut commands);
    *lock.0.lock().unwrap() = Some(Careless::Twice);
    commands.submit_and_wait().unwrap();
    assert_eq!(large.download::<u32>(1).unwrap(), [19]);

    let mut commands = Recorder::new(&context).unwrap();
    fills(&mut commands);
    *lock.0.lock().unwrap() = Some(Careless::Panic);
    assert!(catch_unwind(AssertUnwindSafe(|| commands.submit())).is_err());
    drop(commands);
    drop(large);
    // SAFETY: nobody else uses the device.
    unsafe { host.device.device_wait_idle() }.unwrap();
    assert_eq!(*host.messages.lock().unwrap(), [""; 0]);
    // What may have been running is never freed, and holds the host's device.
    drop(context);
    std::mem::forget(host);
}
