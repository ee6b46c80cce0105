//! The planner inside a host application: the host's device, the host's command buffer, the host's submissions.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

use ash::vk;
use camsplat::engine::primitives::{Count, RadixSort, twin};
use camsplat::engine::vulkan::host::Timeline;
use camsplat::engine::vulkan::{Buffer, Context, ContextOptions, Recorder};
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::paper::Pass;
use camsplat::planner::plan::planner::Planner;
use camsplat::planner::plan::preparation::Preparation;
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::record::Status;
use camsplat::planner::plan::run::Outcome;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::samples;
use glam::DVec3;

use crate::support::host::Host;

/// What runs the iterations.
enum Driver<'h> {
    /// The planner, on its own context.
    Planner,
    /// The host, block by block, each submitted again and again.
    Blocks(&'h Host),
    /// The planner, on the host's device and queue.
    PlannerOn(&'h Host),
    /// The same, by handles without types.
    PlannerOnRaw(&'h Host),
    /// The same, for a host that draws meanwhile.
    PlannerBetweenFrames(&'h Host),
}

/// Plans a small object and gives back what there is to compare, floats as they are.
fn plan(driver: &Driver<'_>, pass: Pass, own: &Arc<Context>) -> Outcome {
    let context = match driver {
        Driver::Planner => own.clone(),
        Driver::Blocks(host) | Driver::PlannerOn(host) => host.adopted(),
        Driver::PlannerOnRaw(host) => host.adopted_raw(),
        Driver::PlannerBetweenFrames(host) => host.adopted_between_frames(Arc::new(Mutex::default()), 1),
    };
    let intrinsics = Intrinsics::from_fov(800, 800, 50f64.to_radians());
    let choice = RegionChoice::default();
    let target = Target::new(&samples::object(), "object", Preset::Object, &choice, DVec3::Z, &intrinsics).unwrap();
    let paper =
        Config::paper(Preset::Object, 12).with_paper(|own| (own.pool, own.pass, own.relocate_every) = (256, pass, 10));
    let config = Config { seed: 5, iterations: 60, checkpoint_every: 20, ..paper };
    let problem = Problem::new(&target, intrinsics, &[]).unwrap();
    let preparation = Preparation::new(&context, &problem, config).unwrap();
    let scene = Arc::new(problem.on(&context).unwrap());
    let planner = Planner::new(&context, &scene, preparation).unwrap();
    match driver {
        Driver::Planner | Driver::PlannerOn(_) | Driver::PlannerOnRaw(_) | Driver::PlannerBetweenFrames(_) => {
            planner.run(None, |_| ControlFlow::Continue(())).unwrap()
        }
        Driver::Blocks(host) => {
            // One submission more than there are iterations for: it must do nothing.
            let blocks = planner.settings().iterations.div_ceil(planner.block());
            let (recorded, _kept) = host.record(&context, |recorder| planner.record_block(recorder).unwrap());
            host.submit(recorded, blocks as usize + 1);
            planner.outcome().unwrap()
        }
    }
}

/// Poses, history, iterations of the snapshots, poses of the snapshots.
type Bits = (Vec<[u64; 7]>, Vec<[u32; 6]>, Vec<u32>, Vec<[u64; 7]>);

/// Everything in an outcome that must not depend on what ran it, as bits.
fn bits(outcome: &Outcome) -> Bits {
    let pose = |pose: &Pose| {
        let (p, q) = (pose.position, pose.rotation);
        [p.x, p.y, p.z, q.w, q.x, q.y, q.z].map(f64::to_bits)
    };
    let poses = outcome.poses.iter().map(pose).collect();
    let history = outcome.history.iter().map(|r| {
        let floats = [r.loss, r.image, r.reg, r.bound, r.scale.unwrap_or(0.0)].map(f32::to_bits);
        [r.iteration, floats[0], floats[1], floats[2], floats[3], floats[4]]
    });
    let rows = outcome.snapshots.iter().map(|(iteration, _)| *iteration).collect();
    let snapshots = outcome.snapshots.iter().flat_map(|(_, poses)| poses.iter().map(pose)).collect();
    (poses, history.collect(), rows, snapshots)
}

/// If this failed, an application that embeds the planner would get another plan than the command gives for the same
/// seed, or one that changes with how it submits; or the planner would use the host's device in a way that Vulkan forbids.
#[test]
fn a_host_that_submits_itself_gets_the_same_bits() {
    let own = Context::new(&ContextOptions { validation: true, ..ContextOptions::default() }).unwrap();
    let host = Host::new(&own.physical().name);
    for pass in [Pass::Dense, Pass::Binned] {
        let expected = plan(&Driver::Planner, pass, &own);
        assert_eq!((expected.status, expected.history.len()), (Status::Complete, 60));
        assert_eq!(bits(&expected).2, [0, 20, 40, 60]);
        let drivers = [
            ("blocks", Driver::Blocks(&host)),
            ("planner", Driver::PlannerOn(&host)),
            ("raw handles", Driver::PlannerOnRaw(&host)),
            ("between frames", Driver::PlannerBetweenFrames(&host)),
        ];
        for (who, driver) in drivers {
            let found = plan(&driver, pass, &own);
            assert_eq!(found.status, Status::Complete, "{who}, {pass:?}");
            assert!(bits(&found) == bits(&expected), "{who}, {pass:?}: {:?} {:?}", found.poses, expected.poses);
        }
    }
    assert_eq!(own.messages(), [""; 0]);
    assert_eq!(*host.messages.lock().unwrap(), [""; 0]);
}

/// A planner of expected quality around the sample object, with cameras that are kept.
fn quality_planner(context: &Arc<Context>, kept: &[Camera]) -> Planner {
    let intrinsics = Intrinsics::from_fov(800, 800, 50f64.to_radians());
    let choice = RegionChoice::default();
    let target = Target::new(&samples::object(), "object", Preset::Object, &choice, DVec3::Z, &intrinsics).unwrap();
    let config = Config { seed: 5, iterations: 40, checkpoint_every: 20, ..Config::new(Preset::Object, 6) };
    let problem = Problem::new(&target, intrinsics, kept).unwrap();
    let preparation = Preparation::new(context, &problem, config).unwrap();
    let scene = Arc::new(problem.on(context).unwrap());
    Planner::new(context, &scene, preparation).unwrap()
}

/// A camera of the sample object's size that looks at it from a direction.
fn looking_in(from: DVec3) -> Camera {
    let from = from.normalize();
    let pose = Pose::looking(4.0 * from, -from, DVec3::Z);
    Camera { name: "given".into(), pose, intrinsics: Intrinsics::from_fov(800, 800, 50f64.to_radians()) }
}

/// If this failed, a host that plans view after view would get another plan from a planner it has used before than from a new one.
#[test]
fn a_planner_used_again_is_as_good_as_new() {
    let context = Context::new(&ContextOptions { validation: true, ..ContextOptions::default() }).unwrap();
    let run = |planner: &Planner| planner.run(None, |_| ControlFlow::Continue(())).unwrap();
    let given = [DVec3::X, DVec3::Y, DVec3::new(-1.0, 0.0, 0.3)].map(looking_in);
    let mut planner = quality_planner(&context, &given);
    let three = run(&planner);
    for count in [2, 0, 1] {
        planner.keep(&given[1..1 + count]).unwrap();
        let fresh = run(&quality_planner(&context, &given[1..1 + count]));
        assert!(bits(&run(&planner)) == bits(&fresh), "with {count} kept");
    }
    planner.keep(&given).unwrap();
    assert!(bits(&run(&planner)) == bits(&three));
    let refused = planner.keep(&[&given[..], &given[..1]].concat()).unwrap_err().to_string();
    assert!(refused.contains("made for 3"), "{refused}");

    // It begins at the given poses; with one pose short it does not.
    planner.begin_from(&three.poses).unwrap();
    let (iteration, begun) = &run(&planner).snapshots[0];
    let apart = |(a, b): (&Pose, &Pose)| a.position.distance(b.position).max(a.forward().distance(b.forward()));
    assert_eq!((*iteration, begun.len()), (0, three.poses.len()));
    assert!(begun.iter().zip(&three.poses).all(|pair| apart(pair) < 1e-5), "{begun:?}, not {:?}", three.poses);
    assert!(planner.begin_from(&three.poses[1..]).is_err());
    let mut lost = looking_in(DVec3::X);
    lost.pose.position.x = f64::NAN;
    assert!(planner.keep(&[lost.clone()]).is_err() && planner.look_from(&[lost.clone()]).is_err());
    assert!(planner.begin_from(&vec![lost.pose; three.poses.len()]).is_err());

    // Viewers on one side draw the cameras there.
    planner.look_from(&[looking_in(DVec3::NEG_Y), looking_in(DVec3::new(0.3, -1.0, 0.2))]).unwrap();
    let mean = |outcome: &Outcome| outcome.poses.iter().map(|pose| pose.position).sum::<DVec3>().y;
    let aside = run(&planner);
    assert!(mean(&aside) < mean(&three) - 1.0, "{} and {}", mean(&aside), mean(&three));
    assert!(planner.look_from(&[]).is_err());
    assert_eq!(context.messages(), [""; 0]);
}

/// If this failed, a host that records its blocks once would go on with the old start or viewers, or get a broken plan.
#[test]
fn recorded_blocks_serve_other_starts_and_viewers() {
    let own = Context::new(&ContextOptions::default()).unwrap();
    let host = Host::new(&own.physical().name);
    let context = host.adopted();
    let given = [DVec3::X, DVec3::Y].map(looking_in);
    let viewers = [looking_in(DVec3::NEG_Y), looking_in(DVec3::new(0.3, -1.0, 0.2))];
    let mut planner = quality_planner(&context, &given);
    let blocks = planner.settings().iterations.div_ceil(planner.block()) as usize;
    let (recorded, _kept) = host.record(&context, |recorder| planner.record_block(recorder).unwrap());
    host.submit(recorded, blocks);
    let first = planner.outcome().unwrap();
    let mut fresh = quality_planner(&own, &given);
    let run = |planner: &Planner| planner.run(None, |_| ControlFlow::Continue(())).unwrap();
    assert!(bits(&first) == bits(&run(&fresh)));
    for planner in [&mut planner, &mut fresh] {
        planner.begin_from(&first.poses).unwrap();
        planner.look_from(&viewers).unwrap();
    }
    host.submit(recorded, blocks);
    assert!(bits(&planner.outcome().unwrap()) == bits(&run(&fresh)));
    assert_eq!(*host.messages.lock().unwrap(), [""; 0]);
}

/// If this failed, a host that forgot an extension, or named a queue that cannot compute, would end in the first plan.
#[test]
fn devices_that_cannot_serve_are_refused() {
    let own = Context::new(&ContextOptions::default()).unwrap();
    let refusal =
        |host: &Host, family: u32| host.adopted_on(family).err().map(|error| error.to_string()).unwrap_or_default();
    let bare = Host::with(&own.physical().name, &[]);
    assert!(refusal(&bare, 0).contains("made without VK_KHR_push_descriptor"), "{}", refusal(&bare, 0));
    let whole = Host::new(&own.physical().name);
    assert!(refusal(&whole, 9).contains("queue family 9"), "{}", refusal(&whole, 9));
}

/// If this failed, a host's own stages could not follow the engine's on the device: they would read cameras that are not there yet.
#[test]
fn a_host_takes_the_cameras_from_the_device() {
    let own = Context::new(&ContextOptions::default()).unwrap();
    let host = Host::new(&own.physical().name);
    let context = host.adopted();
    let planner = quality_planner(&context, &[looking_in(DVec3::X)]);
    let target = Buffer::host(&context, "the host's", planner.device_cameras().size()).unwrap();
    let mut block = Recorder::new(&context).unwrap();
    planner.record_block(&mut block).unwrap();
    let info = vk::CommandBufferAllocateInfo::default().command_pool(host.pool).command_buffer_count(1);
    let region = [vk::BufferCopy::default().size(target.size())];
    let before;
    let (after_block, waits) = ([2u64], [vk::PipelineStageFlags::TRANSFER]);
    // SAFETY: the semaphore is of the host's device, which has timelines enabled; all that was made is waited for before it goes.
    unsafe {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let semaphore = host.device.create_semaphore(&vk::SemaphoreCreateInfo::default().push_next(&mut kind), None);
        let semaphore = semaphore.unwrap();
        let at = |value| [Timeline { semaphore, value }];
        block.submit_between(&at(1), &at(2)).unwrap();
        // The host's copy, submitted before anything has run, goes behind the block on the device.
        let commands = host.device.allocate_command_buffers(&info).unwrap();
        host.device.begin_command_buffer(commands[0], &vk::CommandBufferBeginInfo::default()).unwrap();
        host.device.cmd_copy_buffer(commands[0], planner.device_cameras().handle(), target.handle(), &region);
        host.device.end_command_buffer(commands[0]).unwrap();
        let mut values = vk::TimelineSemaphoreSubmitInfo::default().wait_semaphore_values(&after_block);
        let semaphores = [semaphore];
        let copy = vk::SubmitInfo::default()
            .command_buffers(&commands)
            .wait_semaphores(&semaphores)
            .wait_dst_stage_mask(&waits)
            .push_next(&mut values);
        host.device.queue_submit(host.queue, &[copy], vk::Fence::null()).unwrap();
        before = (planner.done(), block.pending().unwrap());
        host.device.signal_semaphore(&vk::SemaphoreSignalInfo::default().semaphore(semaphore).value(1)).unwrap();
        host.device.device_wait_idle().unwrap();
        host.device.free_command_buffers(host.pool, &commands);
        host.device.destroy_semaphore(semaphore, None);
    }
    block.wait().unwrap();
    assert_eq!(before, (0, 1), "the engine did not wait for the host");
    assert_eq!(planner.done(), planner.block());
    let found: Vec<u8> = target.read(target.size() as usize).unwrap();
    assert_eq!(found, bytemuck::cast_slice::<_, u8>(&planner.splats().unwrap()));
    assert_ne!(planner.splats().unwrap(), planner.start());
    assert_eq!(*host.messages.lock().unwrap(), [""; 0]);
}

/// If this failed, a host's buffers could not be sorted in place, what lies beside the part that it lends would be overwritten, or a part
/// that stages cannot use would be taken.
#[test]
fn a_part_of_a_hosts_buffer_is_sorted_in_place() {
    let own = Context::new(&ContextOptions::default()).unwrap();
    let host = Host::new(&own.physical().name);
    let context = host.adopted();
    let step = context.physical().storage_alignment.max(64);
    // The host's buffer has keys, then a gap, then values, each with something before and behind it.
    let keys: Vec<u32> = (0..500u32).map(|i| i.wrapping_mul(2_654_435_761) >> 8).collect();
    let words = (step / 4) as usize;
    let [first, second] = [words, 3 * words + 500_usize.next_multiple_of(words)];
    let mut all = vec![7u32; second + 500 + words];
    all[first..first + 500].copy_from_slice(&keys);
    all[second..second + 500].copy_from_slice(&(0..500).collect::<Vec<u32>>());
    let whole = Buffer::from_slice(&context, "the host's", &all).unwrap();
    let usage =
        vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
    let wrap = |usage, part| {
        // SAFETY: the buffer has more usages than these, and outlives what is wrapped here.
        unsafe { Buffer::wrap(&context, "part", whole.handle(), usage, part) }
    };
    let [part_keys, part_values] = [first, second].map(|at| wrap(usage, [4 * at as u64, 2000]).unwrap());
    let sort = RadixSort::new(&context, 500).unwrap();
    let mut commands = Recorder::new(&context).unwrap();
    let sorted = sort.pairs(&mut commands, &part_keys, &part_values, Count::Host(500), 32).unwrap();
    commands.submit_and_wait().unwrap();
    let (expected_keys, expected_values) = twin::radix_sort(&keys, &(0..500).collect::<Vec<u32>>(), 32);
    assert_eq!(sorted.keys.download::<u32>(500).unwrap(), expected_keys);
    assert_eq!(sorted.values.download::<u32>(500).unwrap(), expected_values);
    let after: Vec<u32> = whole.download(all.len()).unwrap();
    let beside = |i: &usize| !(first..first + 500).contains(i) && !(second..second + 500).contains(i);
    assert!((0..all.len()).filter(beside).all(|i| after[i] == 7));

    for (usage, part, reason) in [
        (vk::BufferUsageFlags::STORAGE_BUFFER, [0, 64], "made without TRANSFER_SRC | TRANSFER_DST"),
        (usage, [4 * step + 2, 64], "is no multiple of"),
        (usage, [0, 0], "0 bytes are not"),
        (usage, [0, 63], "63 bytes are not"),
        (usage, [0, u64::MAX - 3], "are not a multiple of four from 4 to"),
    ] {
        let refused = wrap(usage, part).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(refused.contains(reason), "{refused:?} does not say {reason}");
    }
    assert_eq!(*host.messages.lock().unwrap(), [""; 0]);
}

/// If this failed, the absence of messages above could mean that none are ever received.
#[test]
fn the_host_hears_the_validation_layers() {
    let own = Context::new(&ContextOptions::default()).unwrap();
    let host = Host::new(&own.physical().name);
    // SAFETY: a buffer without any usage breaks a rule, but one that no memory depends on: it is never bound nor used.
    unsafe {
        let buffer = host.device.create_buffer(&vk::BufferCreateInfo::default().size(16), None);
        buffer.into_iter().for_each(|buffer| host.device.destroy_buffer(buffer, None));
    }
    assert!(!host.messages.lock().unwrap().is_empty());
}
