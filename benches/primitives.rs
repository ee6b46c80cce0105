//! GPU time of scan, reduce, radix sort and ranges of keys, at sizes that show how it grows. Results are first checked against the twins: a
//! device that gets them wrong gets no row.

mod report;

use std::process::{Command, ExitCode};
use std::sync::Arc;

use camsplat::Result;
use camsplat::engine::primitives::{Count, KeyRanges, Operation, RadixSort, Reduce, Scan, twin};
use camsplat::engine::vulkan::{Buffer, Context};
use report::{Amount, Job, Report};

fn main() -> ExitCode {
    report::run("primitives", rows)
}

fn rows(context: Arc<Context>, report: &mut Report) -> Result<()> {
    let on_cpu = context.physical().is_cpu();
    let mut sizes = vec![1 << 16, 1 << 20, 1 << 22];
    if !on_cpu {
        sizes.extend([1 << 25, 1 << 27]);
    }
    for &count in &sizes {
        scan(&context, report, count)?;
        reduce(&context, report, count)?;
        key_ranges(&context, report, count)?;
        radix_sort(&context, report, count, "", &RadixSort::new(&context, count)?)?;
        let without_waiting = RadixSort::without_waiting(&context, count)?;
        radix_sort(&context, report, count, "_without_waiting", &without_waiting)?;
    }
    match cub(&sizes) {
        Some(rows) => println!("CUB, what was sorted, how many, ns:\n{rows}"),
        None => println!("CUB: not measured, since nvcc did not build benches/cub/radix_sort.cu or it failed"),
    }
    Ok(())
}

/// What CUB's sort takes on the same device, where there is nvcc.
fn cub(sizes: &[u32]) -> Option<String> {
    let program = std::env::temp_dir().join(format!("camsplat-cub-{}", std::process::id()));
    let built = Command::new("nvcc")
        .args(["-O3", "-std=c++17", "-arch=native", "benches/cub/radix_sort.cu", "-o"])
        .arg(&program)
        .status()
        .ok()?;
    let run = Command::new(&program).args(sizes.iter().map(u32::to_string)).output();
    // Where nothing was built there is nothing to remove.
    let _ = std::fs::remove_file(&program);
    let run = run.ok()?;
    (built.success() && run.status.success()).then(|| String::from_utf8_lossy(&run.stdout).into_owned())
}

/// Bytes as the modules of the primitives state them.
fn amount(count: u32, bytes_each: u64, operations_each: u64) -> Amount {
    let count = count as u64;
    Amount { count, bytes: bytes_each * count, operations: operations_each * count }
}

fn random(count: u32) -> Vec<u32> {
    let mut state = 1u64;
    let mut next = || {
        // Knuth's MMIX generator; its upper half is random enough for keys.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 32) as u32
    };
    (0..count).map(|_| next()).collect()
}

/// Operations are additions: one to the sum of a block, one to the sums within.
fn scan(context: &Arc<Context>, report: &mut Report, count: u32) -> Result<()> {
    if !report.wants("scan", u64::from(count)) {
        return Ok(());
    }
    let scan = Scan::new(context, count)?;
    let elements = random(count);
    let input = Buffer::from_slice(context, "input", &elements)?;
    let output = Buffer::device(context, "output", input.size())?;
    let total = Buffer::device(context, "total", 4)?;
    let mut job = Job::new(
        context,
        3,
        |_| {},
        |recorder| scan.record(recorder, &input, &output, Count::Host(count), (&total, 0)),
    )?;
    job.run()?;
    assert!(output.download::<u32>(elements.len())? == twin::scan(&elements).0, "a scan went wrong");
    report.row("scan", amount(count, 12, 2), &mut job)
}

/// Operations are additions.
fn reduce(context: &Arc<Context>, report: &mut Report, count: u32) -> Result<()> {
    if !report.wants("reduce_sum_f32", u64::from(count)) {
        return Ok(());
    }
    let reduce = Reduce::new(context, Operation::SumF32, count)?;
    let elements: Vec<u32> = random(count).iter().map(|word| (*word as f32 * 1e-9).to_bits()).collect();
    let input = Buffer::from_slice(context, "input", &elements)?;
    let output = Buffer::device(context, "output", 4)?;
    let mut job =
        Job::new(context, 2, |_| {}, |recorder| reduce.record(recorder, &input, Count::Host(count), &output, 0))?;
    job.run()?;
    assert!(output.download::<u32>(1)? == [twin::reduce(Operation::SumF32, &elements)], "a sum went wrong");
    report.row("reduce_sum_f32", amount(count, 4, 1), &mut job)
}

/// Of keys with eight elements each on average. Operations are comparisons with the keys before and behind.
fn key_ranges(context: &Arc<Context>, report: &mut Report, count: u32) -> Result<()> {
    if !report.wants("key_ranges", u64::from(count)) {
        return Ok(());
    }
    let ranges = KeyRanges::new(context, count)?;
    let keys = count / 8;
    let mut elements: Vec<u32> = random(count).iter().map(|word| word % keys).collect();
    elements.sort_unstable();
    let input = Buffer::from_slice(context, "input", &elements)?;
    let output = Buffer::device(context, "output", 8 * u64::from(keys))?;
    let mut job =
        Job::new(context, 2, |_| {}, |recorder| ranges.record(recorder, &input, Count::Host(count), &output))?;
    job.run()?;
    let found: Vec<[u32; 2]> = output.download(keys as usize)?;
    assert!(found == twin::key_ranges(&elements, keys as usize), "ranges of keys went wrong");
    // The filling writes each range once more.
    report.row("key_ranges", amount(count, 4 + 2 * 8 / 8, 2), &mut job)
}

/// Operations of a key in each of four passes: a shift and a mask to its digit, an addition to count it, one to place it.
fn radix_sort(context: &Arc<Context>, report: &mut Report, count: u32, way: &str, sort: &RadixSort) -> Result<()> {
    let names = ["keys", "pairs"].map(|what| format!("radix_sort_{what}{way}"));
    if !names.iter().any(|name| report.wants(name, u64::from(count))) {
        return Ok(());
    }
    let (unsorted, ramp) = (random(count), (0..count).collect::<Vec<u32>>());
    let input = Buffer::from_slice(context, "input", &unsorted)?;
    let order = Buffer::from_slice(context, "order", &ramp)?;
    let keys = Buffer::device(context, "keys", input.size())?;
    let values = Buffer::device(context, "values", input.size())?;
    let expected = twin::radix_sort(&unsorted, &ramp, 32);
    let stages = sort.stages(32);
    let mut keys_job = Job::new(
        context,
        stages,
        |recorder| recorder.copy(&input, &keys, input.size()),
        |recorder| sort.keys(recorder, &keys, Count::Host(count), 32).map(drop),
    )?;
    keys_job.run()?;
    // Four passes end in the caller's buffers.
    assert!(keys.download::<u32>(ramp.len())? == expected.0, "a sort of keys went wrong");
    report.row(&names[0], amount(count, 36, 16), &mut keys_job)?;
    let mut pairs_job = Job::new(
        context,
        stages,
        |recorder| {
            recorder.copy(&input, &keys, input.size());
            recorder.copy(&order, &values, order.size());
        },
        |recorder| sort.pairs(recorder, &keys, &values, Count::Host(count), 32).map(drop),
    )?;
    pairs_job.run()?;
    let sorted: (Vec<u32>, Vec<u32>) = (keys.download(ramp.len())?, values.download(ramp.len())?);
    assert!(sorted == expected, "a sort of pairs went wrong");
    report.row(&names[1], amount(count, 68, 16), &mut pairs_job)
}
