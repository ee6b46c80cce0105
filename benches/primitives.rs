//! GPU time of scan, reduce and radix sort, at sizes that show how it grows.

mod report;

use std::sync::Arc;

use camsplat::Result;
use camsplat::primitives::{Count, Operation, RadixSort, Reduce, Scan};
use camsplat::vulkan::{Buffer, Context};
use report::{Amount, Job, Report};

fn main() -> Result<()> {
    let context = report::context()?;
    let mut report = Report::new(&context)?;
    let on_cpu = context.physical().kind == "CPU";
    let mut sizes = vec![1 << 16, 1 << 20, 1 << 22];
    if !on_cpu {
        sizes.push(1 << 25);
    }
    for count in sizes {
        scan(&context, &mut report, count)?;
        reduce(&context, &mut report, count)?;
        radix_sort(&context, &mut report, count)?;
    }
    report.finish("primitives")
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

/// Operations are additions.
fn scan(context: &Arc<Context>, report: &mut Report, count: u32) -> Result<()> {
    let scan = Scan::new(context, count)?;
    let input = Buffer::from_slice(context, "input", &random(count))?;
    let output = Buffer::device(context, "output", input.size())?;
    let total = Buffer::device(context, "total", 4)?;
    let mut job = Job::new(
        context,
        3,
        |_| {},
        |recorder| scan.record(recorder, &input, &output, Count::Host(count), (&total, 0)),
    )?;
    report.row("scan", amount(count, 12, 2), &mut job)
}

/// Operations are additions.
fn reduce(context: &Arc<Context>, report: &mut Report, count: u32) -> Result<()> {
    let reduce = Reduce::new(context, Operation::SumF32, count)?;
    let input = Buffer::from_slice(context, "input", &random(count))?;
    let output = Buffer::device(context, "output", 4)?;
    let mut job =
        Job::new(context, 2, |_| {}, |recorder| reduce.record(recorder, &input, Count::Host(count), &output, 0))?;
    report.row("reduce_sum_f32", amount(count, 4, 1), &mut job)
}

/// Operations are keys ranked.
fn radix_sort(context: &Arc<Context>, report: &mut Report, count: u32) -> Result<()> {
    let sort = RadixSort::new(context, count)?;
    let input = Buffer::from_slice(context, "input", &random(count))?;
    let keys = Buffer::device(context, "keys", input.size())?;
    let values = Buffer::device(context, "values", input.size())?;
    let stages = 3 * RadixSort::passes(32);
    let mut keys_job = Job::new(
        context,
        stages,
        |recorder| recorder.copy(&input, &keys, input.size()),
        |recorder| sort.keys(recorder, &keys, Count::Host(count), 32).map(drop),
    )?;
    report.row("radix_sort_keys", amount(count, 52, 4), &mut keys_job)?;
    let mut pairs_job = Job::new(
        context,
        stages,
        |recorder| recorder.copy(&input, &keys, input.size()),
        |recorder| sort.pairs(recorder, &keys, &values, Count::Host(count), 32).map(drop),
    )?;
    report.row("radix_sort_pairs", amount(count, 84, 4), &mut pairs_job)
}
