//! Radix sort against its twin, on the device with the validation layers on.

use std::sync::Arc;

use crate::support::buffers::{SIZES, random};
use crate::support::device::{context, silent};
use camsplat::Result;
use camsplat::engine::primitives::{Count, RadixSort, twin};
use camsplat::engine::vulkan::{Buffer, Context, Recorder};

/// Sorts on the device: (keys, values).
fn sort(
    context: &Arc<Context>,
    sorter: &RadixSort,
    keys: &[u32],
    values: &[u32],
    bits: u32,
) -> Result<(Vec<u32>, Vec<u32>)> {
    let count = keys.len();
    let key_buffer = Buffer::from_slice(context, "keys", keys)?;
    let value_buffer = Buffer::from_slice(context, "values", values)?;
    let mut recorder = Recorder::new(context)?;
    let sorted = sorter.pairs(&mut recorder, &key_buffer, &value_buffer, Count::Host(count as u32), bits)?;
    recorder.submit_and_wait()?;
    Ok((sorted.keys.download(count)?, sorted.values.download(count)?))
}

/// The way of this device, or that in which workgroups wait where this run says so; and the way that fits all devices.
fn sorters(context: &Arc<Context>, most: u32) -> Result<[RadixSort; 2]> {
    let waiting = match std::env::var(ONE_AFTER_ANOTHER) {
        Ok(_) => RadixSort::with_waiting(context, most)?,
        Err(_) => RadixSort::new(context, most)?,
    };
    Ok([waiting, RadixSort::without_waiting(context, most)?])
}

/// Set where workgroups run one after another, so that none ever waits for another.
const ONE_AFTER_ANOTHER: &str = "CAMSPLAT_TEST_ONE_AFTER_ANOTHER";

fn ramp(count: usize) -> Vec<u32> {
    (0..count as u32).collect()
}

/// Were a tile's end, a row of the table or a rank wrong, keys would be lost or out of order at some size.
#[test]
fn pairs_match_the_twin_at_every_size() -> Result<()> {
    let context = context();
    let sorters = sorters(&context, 1 << 23)?;
    for size in SIZES {
        let (keys, values) = (random(size as u64, size), ramp(size));
        let expected = twin::radix_sort(&keys, &values, 32);
        for (way, sorter) in sorters.iter().enumerate() {
            assert!(sort(&context, sorter, &keys, &values, 32)? == expected, "{size} pairs, way {way}");
        }
    }
    silent(&context);
    Ok(())
}

/// Values are the keys' old places: were equal keys not to keep their order, values would show it. Keys that are all
/// ones look like what a tile is filled up with.
#[test]
fn equal_keys_keep_their_order() -> Result<()> {
    let context = context();
    let sorters = sorters(&context, 100_003)?;
    let values = ramp(100_003);
    let random = random(1, 100_003);
    let cases: [(&str, Vec<u32>); 6] = [
        ("few distinct keys", random.iter().map(|key| key % 5 * 0x0101_0101).collect()),
        ("all equal", vec![0x1234_5678; 100_003]),
        ("all ones", vec![u32::MAX; 100_003]),
        ("ones among zeros", random.iter().map(|key| if key % 2 == 0 { u32::MAX } else { 0 }).collect()),
        ("already sorted", values.clone()),
        ("the other way round", values.iter().rev().copied().collect()),
    ];
    for (what, keys) in cases {
        let expected = twin::radix_sort(&keys, &values, 32);
        for (way, sorter) in sorters.iter().enumerate() {
            assert!(sort(&context, sorter, &keys, &values, 32)? == expected, "{what}, way {way}");
        }
    }
    silent(&context);
    Ok(())
}

/// Were a digit of fewer than 8 bits masked wrongly, or the result looked for in the wrong half of the ping-pong after
/// an odd number of passes, some number of bits would fail. Higher bits must be carried along, not sorted by.
#[test]
fn any_number_of_bits_sorts_by_these_bits_only() -> Result<()> {
    let context = context();
    let sorters = sorters(&context, 9001)?;
    let (keys, values) = (random(2, 9001), ramp(9001));
    for bits in 1..=32 {
        let expected = twin::radix_sort(&keys, &values, bits);
        for (way, sorter) in sorters.iter().enumerate() {
            assert!(sort(&context, sorter, &keys, &values, bits)? == expected, "{bits} bits, way {way}");
        }
    }
    silent(&context);
    Ok(())
}

/// Were keys sorted in another way when no values follow, this would differ; were values written, the spare buffer
/// behind would change.
#[test]
fn keys_alone_sort_like_keys_with_values() -> Result<()> {
    let context = context();
    let sorters = sorters(&context, 50_000)?;
    let keys = random(3, 50_000);
    for (bits, sorter) in [7, 12, 20, 32].into_iter().flat_map(|bits| sorters.iter().map(move |sorter| (bits, sorter)))
    {
        let buffer = Buffer::from_slice(&context, "keys", &keys)?;
        let mut recorder = Recorder::new(&context)?;
        let sorted = sorter.keys(&mut recorder, &buffer, Count::Host(50_000), bits)?;
        recorder.submit_and_wait()?;
        assert!(sorted.download::<u32>(50_000)? == twin::radix_sort(&keys, &keys, bits).0, "{bits} bits");
    }
    silent(&context);
    Ok(())
}

/// Were the counter not obeyed by every stage, keys behind it would be mixed in or moved.
#[test]
fn a_counter_on_the_device_says_how_many() -> Result<()> {
    let context = context();
    let sorters = sorters(&context, 1 << 20)?;
    let (keys, values) = (random(4, 70_000), ramp(70_000));
    let counters = [(0, 0), (1, 1), (2048, 2048), (33_333, 33_333), (u32::MAX, 70_000)];
    for ((counter, counted), sorter) in
        counters.into_iter().flat_map(|counter| sorters.iter().map(move |sorter| (counter, sorter)))
    {
        let key_buffer = Buffer::from_slice(&context, "keys", &keys)?;
        let value_buffer = Buffer::from_slice(&context, "values", &values)?;
        let counters = Buffer::from_slice(&context, "counters", &[7, 7, 7, counter])?;
        let mut recorder = Recorder::new(&context)?;
        let sorted = sorter.pairs(&mut recorder, &key_buffer, &value_buffer, Count::Device(&counters, 3), 32)?;
        recorder.submit_and_wait()?;
        let (mut expected_keys, mut expected_values) = twin::radix_sort(&keys[..counted], &values[..counted], 32);
        expected_keys.extend(&keys[counted..]);
        expected_values.extend(&values[counted..]);
        assert!(sorted.keys.download::<u32>(70_000)? == expected_keys, "keys, a counter of {counter}");
        assert!(sorted.values.download::<u32>(70_000)? == expected_values, "values, a counter of {counter}");
    }
    silent(&context);
    Ok(())
}

/// Depths as floats, then tiles: were the second sort not stable, or floats not in the order of their bits, depths
/// inside a tile would be out of order.
#[test]
fn floats_then_tiles_sort_as_compositing_needs() -> Result<()> {
    let context = context();
    let count = 30_000;
    let sorter = RadixSort::new(&context, count as u32)?;
    let depths: Vec<f32> = random(5, count).iter().map(|word| *word as f32 * 1e-6).collect();
    let tiles: Vec<u32> = random(6, count).iter().map(|word| word % 600).collect();
    let bits: Vec<u32> = depths.iter().map(|depth| depth.to_bits()).collect();
    let (_, by_depth) = sort(&context, &sorter, &bits, &ramp(count), 32)?;
    let keys: Vec<u32> = by_depth.iter().map(|&splat| tiles[splat as usize]).collect();
    let (_, order) = sort(&context, &sorter, &keys, &by_depth, 10)?;
    let sorted: Vec<(u32, f32)> = order.iter().map(|&splat| (tiles[splat as usize], depths[splat as usize])).collect();
    assert!(sorted.is_sorted());
    silent(&context);
    Ok(())
}

/// Were anything to depend on scheduling, one of many repeats would differ.
#[test]
fn repeats_give_equal_bits() -> Result<()> {
    let context = context();
    let sorters = sorters(&context, 200_000)?;
    let keys: Vec<u32> = random(8, 200_000).iter().map(|key| key >> 20).collect();
    let first = sort(&context, &sorters[0], &keys, &ramp(200_000), 12)?;
    for sorter in sorters.iter().cycle().take(10) {
        assert!(sort(&context, sorter, &keys, &ramp(200_000), 12)? == first);
    }
    silent(&context);
    Ok(())
}

/// The tests that run again with each width of subgroups.
const SUBGROUP_TESTS: [&str; 4] = [
    "the_environment_sets_the_width_of_subgroups",
    "equal_keys_keep_their_order",
    "any_number_of_bits_sorts_by_these_bits_only",
    "a_counter_on_the_device_says_how_many",
];

/// lavapipe takes the width of its subgroups, in bits, from the environment: other tests run again with subgroups of 4
/// to 128 threads. Were a rank to depend on the width, some keys would be out of order in one of them.
#[test]
fn subgroups_of_any_width_give_equal_bits() -> Result<()> {
    let program = std::env::current_exe().map_err(|e| camsplat::Error::io("the test", e))?;
    for width in ["128", "256", "512", "1024", "2048", "4096"] {
        let run = std::process::Command::new(&program)
            .arg("--exact")
            .args(SUBGROUP_TESTS.map(|name| format!("{}::{name}", module_path!().split_once("::").unwrap().1)))
            .env("LP_NATIVE_VECTOR_WIDTH", width)
            .output()
            .map_err(|e| camsplat::Error::io(&program, e))?;
        let said = String::from_utf8_lossy(&run.stdout);
        assert!(run.status.success() && said.contains("4 passed"), "subgroups of {width} bits:\n{said}");
    }
    Ok(())
}

/// lavapipe with one thread runs workgroups in their order: passes in which they could wait for one another never do, and sort as they do
/// on GPUs. Were a tile, a group of tiles or the last digit of a pass handled wrongly, keys would be out of order.
#[test]
fn passes_that_could_wait_sort_too() -> Result<()> {
    let tests = [
        "pairs_match_the_twin_at_every_size",
        "equal_keys_keep_their_order",
        "any_number_of_bits_sorts_by_these_bits_only",
        "keys_alone_sort_like_keys_with_values",
        "a_counter_on_the_device_says_how_many",
        "repeats_give_equal_bits",
    ];
    let program = std::env::current_exe().map_err(|e| camsplat::Error::io("the test", e))?;
    let run = std::process::Command::new(&program)
        .arg("--exact")
        .args(tests.map(|name| format!("{}::{name}", module_path!().split_once("::").unwrap().1)))
        .env("LP_NUM_THREADS", "1")
        .env(ONE_AFTER_ANOTHER, "1")
        .output()
        .map_err(|e| camsplat::Error::io(&program, e))?;
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success() && said.contains("6 passed"), "{said}");
    Ok(())
}

/// Were the variable to lose its meaning, the test above would test nothing.
#[test]
fn the_environment_sets_the_width_of_subgroups() -> Result<()> {
    let context = context();
    if let Ok(width) = std::env::var("LP_NATIVE_VECTOR_WIDTH")
        && context.physical().name.contains("llvmpipe")
    {
        assert_eq!((32 * context.physical().subgroup_size).to_string(), width);
    }
    Ok(())
}

/// Were these let through, shaders would reach outside buffers or a shift would overflow.
#[test]
fn what_does_not_fit_is_an_error() -> Result<()> {
    let context = context();
    assert!(RadixSort::new(&context, (1 << 28) + 1).is_err());
    let sorter = RadixSort::new(&context, 100)?;
    let (small, large) = (Buffer::device(&context, "small", 200)?, Buffer::device(&context, "large", 800)?);
    let mut recorder = Recorder::new(&context)?;
    assert!(sorter.keys(&mut recorder, &large, Count::Host(101), 32).is_err());
    assert!(sorter.pairs(&mut recorder, &large, &small, Count::Host(51), 32).is_err());
    assert!(sorter.keys(&mut recorder, &large, Count::Host(1), 0).is_err());
    assert!(sorter.keys(&mut recorder, &large, Count::Host(1), 33).is_err());
    Ok(())
}
