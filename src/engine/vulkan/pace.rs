//! How much work a submission holds. Drivers reset a device that works on one for a second or two, and whatever else is to be drawn waits
//! for its end.

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use super::context::{Context, SUBMISSION_TIME};
use super::recorder::Recorder;
use crate::Result;

/// Learns from submissions how many items of like work the next one should hold: as many as take 100 ms, or what the host says, if each costs what
/// those of the last one cost, and at most twice as many as before. So one takes five times as long only where an item costs five times as much.
#[derive(Clone, Debug)]
pub(crate) struct Pace {
    items: u32,
    target: Duration,
}

impl Pace {
    /// Begins with so many items, few enough for 100 ms on the slowest device, or fewer where submissions are to be shorter.
    pub fn new(context: &Context, first: u32) -> Self {
        Self::toward(context.submission_time(), first)
    }

    fn toward(target: Duration, first: u32) -> Self {
        let fewer = f64::from(first) * (target.as_secs_f64() / SUBMISSION_TIME.as_secs_f64()).min(1.0);
        Self { items: (fewer.round() as u32).max(1), target }
    }

    /// Items of the next submission.
    pub fn items(&self) -> u32 {
        self.items
    }

    /// A submission of so many items took so long.
    pub fn took(&mut self, items: u32, time: Duration) {
        if items == 0 {
            return;
        }
        let fit = f64::from(items) * self.target.as_secs_f64() / time.as_secs_f64().max(1e-9);
        // A short one shows what an item costs, but not that many cost as much.
        let most = if items > self.items / 2 { self.items.saturating_mul(2) } else { self.items };
        self.items = (fit as u32).clamp(1, most);
    }
}

/// Runs items of like work, each of so many units of what `pace` counts, in submissions of a length that it learns; `record` records those
/// of a range.
///
/// # Errors
/// Those of `record`, and where the device fails.
pub(crate) fn in_parts(
    context: &Arc<Context>,
    pace: &mut Pace,
    [items, units]: [u32; 2],
    mut record: impl FnMut(&mut Recorder, Range<u32>) -> Result<()>,
) -> Result<()> {
    let mut first = 0;
    while first < items {
        let count = (pace.items() / units.max(1)).clamp(1, items - first);
        let mut commands = Recorder::paced(context)?;
        record(&mut commands, first..first + count)?;
        pace.took(count.saturating_mul(units), commands.submit_and_wait()?);
        first += count;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The longest submission, and the mean of those after the tenth, of a device on which item `i` takes `cost(i)` seconds.
    fn run(first: u32, items: u32, cost: impl Fn(u32) -> f64) -> [f64; 2] {
        let mut pace = Pace::toward(SUBMISSION_TIME, first);
        let (mut done, mut times) = (0, Vec::new());
        while done < items {
            let count = pace.items().min(items - done);
            // A submission takes a little time whatever is in it.
            let time = 5e-5 + (done..done + count).map(&cost).sum::<f64>();
            pace.took(count, Duration::from_secs_f64(time));
            times.push(time);
            done += count;
        }
        let later = &times[10.min(times.len() - 1)..];
        [times.iter().copied().fold(0.0, f64::max), later.iter().sum::<f64>() / later.len() as f64]
    }

    /// By a fake clock. If this failed, slow devices would be reset in the middle of a plan, desktops would freeze, or fast devices would
    /// wait for the host between crumbs.
    #[test]
    fn submissions_take_a_tenth_of_a_second_and_never_half_a_second_on_any_device() {
        for item in [1e-7f64, 1e-5, 1e-3, 0.02] {
            let items = (20.0 / item).min(4e8) as u32;
            let [longest, usual] = run(4, items, |_| item);
            assert!(longest <= 0.11 && usual > 0.08, "{item} s an item: longest {longest}, usually {usual}");
        }
        // Nothing to do teaches nothing.
        let mut pace = Pace::toward(SUBMISSION_TIME, 1000);
        pace.took(0, Duration::from_secs(1));
        assert_eq!(pace.items(), 1000);
        // A frame loop's are shorter, the first too.
        let mut pace = Pace::toward(Duration::from_millis(5), 1000);
        assert_eq!(pace.items(), 50);
        pace.took(50, Duration::from_millis(10));
        assert_eq!(pace.items(), 25);
        // An item alone takes longer: one at a time.
        assert!(run(4, 50, |_| 0.3)[1] < 0.31);
        // Work that grows, that varies from item to item, and that becomes four times as heavy at once.
        let grows = run(1, 30_000, |i| 1e-4 * 1.001f64.powi(i as i32).min(300.0));
        let varies = run(1, 30_000, |i| if i % 7 == 0 { 3e-3 } else { 1e-4 });
        let jumps = run(1, 30_000, |i| if i < 15_000 { 1e-4 } else { 4e-4 });
        for [longest, _] in [grows, varies, jumps] {
            assert!(longest < 0.5, "{longest} s");
        }
    }
}
