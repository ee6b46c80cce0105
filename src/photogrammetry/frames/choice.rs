//! Which frames of a walk to keep: even steps of motion, the sharpest frames near them, none twice.
//!
//! Between two frames the picture moves by some share of itself ([`Frame::travel`]). `count` targets lie in even steps `h` along that path.
//! Two things bend it:
//!
//! * Where frames are blurred, which is where the camera turns fast, more of them teach nothing: motion there counts by the square of their
//!   sharpness, relative to what the camera can do, but enough for steps of [`CONNECTED`], with which SfM finds its way through.
//! * Where the path from one frame to the next is longer than `h`, there is nothing in between to choose: it counts as `h`.
//!
//! With `d` the motion between two frames, `w` its weight and `c` = [`CONNECTED`], `h` solves `Σ min(max(w, min(h / c, 1)) d, h) = h (count - 1)`.
//!
//! The frames near the targets are then chosen together, by dynamic programming: the sum over all of `ln(sharpness)`, less
//! `(gap / h - 1)²` for each gap between neighbours on the bent path. To be half a step too early, with the next frame in place, costs as
//! much as two fifths of the sharpness. That is enough to step around a blurred stretch. So that no hole is left, the motion of a gap beyond
//! [`CONNECTED`] costs too, its square being 1 at [`APART`].

/// What is kept of each frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    /// Seconds since the start; none in a folder of pictures, or where the video does not say.
    pub time: Option<f64>,
    /// See [`super::sharpness::of`].
    pub sharpness: f64,
    /// See [`super::travel::Step`].
    pub travel: f64,
    /// Whether the motion to this frame was measured.
    pub followed: bool,
}

/// Least motion between two frames that are chosen: with less, the second shows what the first does.
pub const DUPLICATE: f64 = 0.01;
/// Motion between neighbours beyond which SfM may not connect them: a third of what the one shows is no longer in the other, and few
/// points are in three frames.
pub const APART: f64 = 0.3;
/// The longest step: neighbours that are meant to be this far apart connect, though some gaps turn out longer.
pub const CONNECTED: f64 = 0.2;
/// Steps to each side of a target within which frames are candidates, and most candidates of a target.
const REACH: f64 = 0.75;
const CANDIDATES: usize = 128;
/// Sharpness of frames that show nothing, for the logarithm.
const DULL: f64 = 1e-3;
/// What leaving out a target costs: more than any frame, for it happens only where all others are duplicates.
const OMITTED: f64 = 1e3;
/// A chosen frame is blurred where it is less than half as sharp as the upper quartile of so many chosen neighbours to each side.
const BLURRED: f64 = 0.5;
const NEIGHBOURS: usize = 6;

/// What was chosen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// Indices of the chosen frames, ascending.
    pub frames: Vec<usize>,
    /// The even step, as a share of the picture; blurred stretches have longer ones.
    pub step: f64,
    /// Neighbours that SfM may not connect.
    pub gaps: Vec<Gap>,
    /// Chosen frames that are blurred, with nothing sharper near.
    pub blurred: Vec<usize>,
    /// How many frames would close the gaps that more frames close, where there are any.
    pub enough: Option<usize>,
}

/// Two chosen neighbours that are far apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// The earlier frame.
    pub from: usize,
    /// The later one.
    pub to: usize,
    /// Motion between them.
    pub motion: f64,
    /// Whether more frames would help: not where the picture moves too far from one frame to the next, or cannot be followed.
    pub closes: bool,
}

/// Chooses `count` frames, or fewer where the others would be duplicates.
pub fn choose(frames: &[Frame], count: usize) -> Choice {
    let mut choice = chosen(frames, count);
    let closes = |choice: &Choice| choice.gaps.iter().any(|gap| gap.closes);
    if !closes(&choice) {
        return choice;
    }
    // A quarter more at a time: the number is advice.
    let moved = frames.windows(2).map(|pair| (pair[1].travel - pair[0].travel).clamp(0.0, CONNECTED));
    let mut enough = (count + 1).max((moved.sum::<f64>() / CONNECTED).ceil() as usize + 1);
    while enough < frames.len() && closes(&chosen(frames, enough)) {
        enough += enough.div_ceil(4);
    }
    choice.enough = Some(enough.min(frames.len()));
    choice
}

/// As [`choose`], without advice.
fn chosen(frames: &[Frame], count: usize) -> Choice {
    let Some(last) = frames.len().checked_sub(1) else { return Choice::default() };
    let moved: Vec<f64> = frames.windows(2).map(|pair| (pair[1].travel - pair[0].travel).max(0.0)).collect();
    let most = count.clamp(1, frames.len()) - 1;
    let path = Path { weights: weights(frames), moved: &moved };
    let step = path.even_step(most);
    let mut places = vec![0.0];
    places.extend(path.steps(step).scan(0.0, |place, motion| {
        *place += motion;
        Some(*place)
    }));
    // A little more than a whole number by rounding is that number.
    let steps = ((places[last] / step + 1e-6).floor() as usize).min(most);
    let chosen = match steps {
        0 => frames
            .iter()
            .enumerate()
            .max_by(|(_, a), (_, b)| a.sharpness.total_cmp(&b.sharpness))
            .map(|(i, _)| i)
            .into_iter()
            .collect(),
        _ => best_path(frames, &places, steps),
    };
    let gaps = gaps(frames, &moved, &chosen);
    Choice { step, gaps, blurred: blurred(frames, &chosen), enough: None, frames: chosen }
}

/// What motion to each frame but the first counts: the square of how sharp it is beside the upper quartile of all, at most 1.
fn weights(frames: &[Frame]) -> Vec<f64> {
    let mut sharpness: Vec<f64> = frames.iter().map(|frame| frame.sharpness).collect();
    sharpness.sort_unstable_by(f64::total_cmp);
    let sharp = sharpness[3 * (sharpness.len() - 1) / 4].max(DULL);
    frames[1..].iter().map(|frame| (frame.sharpness / sharp).min(1.0).powi(2)).collect()
}

/// The path from frame to frame.
struct Path<'a> {
    moved: &'a [f64],
    weights: Vec<f64>,
}

impl Path<'_> {
    /// What each motion counts where even steps are of this length.
    fn steps(&self, step: f64) -> impl Iterator<Item = f64> {
        let least = (step / CONNECTED).min(1.0);
        self.moved.iter().zip(&self.weights).map(move |(motion, weight)| (weight.max(least) * motion).min(step))
    }

    /// The step of which `steps` lead along the whole path; no less than a duplicate's. The shorter a step, the more of them.
    fn even_step(&self, steps: usize) -> f64 {
        let number = |step: f64| self.steps(step).sum::<f64>() / step;
        let (mut low, mut high) = (DUPLICATE, self.moved.iter().sum::<f64>().max(DUPLICATE));
        if number(low) <= steps as f64 {
            return low;
        }
        // Halved until the bounds are neighbours in double precision, at the latest.
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if number(middle) > steps as f64 { low = middle } else { high = middle }
        }
        high
    }
}

/// A candidate of a target, and the best choice that ends in it.
struct Ending {
    frame: usize,
    /// Worth of the choice.
    worth: f64,
    /// The target before and the candidate there; none where it begins here.
    before: Option<[usize; 2]>,
}

/// The best frames for the targets at 0, 1, ... `steps` even steps along `places`.
fn best_path(frames: &[Frame], places: &[f64], steps: usize) -> Vec<usize> {
    let step = places[places.len() - 1] / steps as f64;
    let gain = |frame: usize| frames[frame].sharpness.max(DULL).ln();
    let mut targets: Vec<Vec<Ending>> = Vec::with_capacity(steps + 1);
    for k in 0..=steps {
        let at = k as f64 * step;
        let (low, high) = (at - REACH * step, at + REACH * step);
        let near = places.partition_point(|place| *place < low)..places.partition_point(|place| *place <= high);
        let off = |frame: usize| (places[frame] - at) / step;
        let mut candidates: Vec<usize> = near.collect();
        let rank = |frame: usize| gain(frame) - off(frame) * off(frame);
        // In a pause there may be thousands, all but the sharpest of which are useless.
        candidates.sort_by(|a, b| rank(*b).total_cmp(&rank(*a)).then(a.cmp(b)));
        candidates.truncate(CANDIDATES);
        candidates.sort_unstable();
        let ending = |frame: usize| {
            let begins = (k < 2).then(|| (-OMITTED * k as f64, None));
            let follows =
                (1..=2usize).filter_map(|back| Some((back, k.checked_sub(back)?))).flat_map(|(back, target)| {
                    let of_target: &Vec<Ending> = &targets[target];
                    of_target.iter().enumerate().filter_map(move |(i, before)| {
                        let is_new = frames[frame].travel - frames[before.frame].travel >= DUPLICATE * (1.0 - 1e-6);
                        let gap = (places[frame] - places[before.frame]) / step - 1.0;
                        let motion = frames[frame].travel - frames[before.frame].travel;
                        let hole = ((motion - CONNECTED) / (APART - CONNECTED)).max(0.0);
                        let worth = before.worth - gap * gap - hole * hole - OMITTED * (back - 1) as f64;
                        (frame > before.frame && is_new).then_some((worth, Some([target, i])))
                    })
                });
            // Of equals the first, so that the same frames give the same choice.
            let best =
                begins.into_iter().chain(follows).reduce(|best, other| if other.0 > best.0 { other } else { best })?;
            Some(Ending { frame, worth: best.0 + gain(frame), before: best.1 })
        };
        let endings = candidates.into_iter().filter_map(ending).collect();
        targets.push(endings);
    }
    let ends = targets.iter().enumerate().skip(steps.saturating_sub(1)).flat_map(|(k, endings)| {
        endings.iter().enumerate().map(move |(i, ending)| (ending.worth - OMITTED * (steps - k) as f64, [k, i]))
    });
    let mut at = ends.reduce(|best, other| if other.0 > best.0 { other } else { best }).map(|(_, at)| at);
    let mut chosen = Vec::with_capacity(steps + 1);
    while let Some([k, i]) = at {
        let ending = &targets[k][i];
        chosen.push(ending.frame);
        at = ending.before;
    }
    chosen.reverse();
    chosen
}

/// Chosen neighbours that SfM may not connect.
fn gaps(frames: &[Frame], moved: &[f64], chosen: &[usize]) -> Vec<Gap> {
    let gap = |pair: &[usize]| {
        let [from, to] = [pair[0], pair[1]];
        let motion = frames[to].travel - frames[from].travel;
        let is_followed = frames[from + 1..=to].iter().all(|frame| frame.followed);
        let closes = is_followed && moved[from..to].iter().all(|motion| *motion < APART);
        (motion > APART || !is_followed).then_some(Gap { from, to, motion, closes })
    };
    chosen.windows(2).filter_map(gap).collect()
}

/// Stretches of at least a second, as their first and last frames, in which the picture stays the same.
pub fn pauses(frames: &[Frame]) -> Vec<[usize; 2]> {
    const LONG: f64 = 1.0;
    let seconds = |from: usize, to: usize| Some(frames[to].time? - frames[from].time?);
    let mut found = Vec::new();
    let mut from = 0;
    while from < frames.len() {
        let stays = |frame: &Frame| frame.followed && frame.travel - frames[from].travel < DUPLICATE;
        let to = from + frames[from + 1..].iter().take_while(|frame| stays(frame)).count();
        let is_long = seconds(from, to).is_some_and(|seconds| seconds >= LONG);
        if is_long {
            found.push([from, to]);
        }
        from = if is_long { to + 1 } else { from + 1 };
    }
    found
}

/// Chosen frames that are far less sharp than chosen frames around them.
fn blurred(frames: &[Frame], chosen: &[usize]) -> Vec<usize> {
    let of = |place: usize| frames[chosen[place]].sharpness;
    let is_blurred = |place: &usize| {
        let around = place.saturating_sub(NEIGHBOURS)..(place + NEIGHBOURS + 1).min(chosen.len());
        let mut sharpness: Vec<f64> = around.map(of).collect();
        sharpness.sort_unstable_by(f64::total_cmp);
        of(*place) < BLURRED * sharpness[3 * (sharpness.len() - 1) / 4]
    };
    (0..chosen.len()).filter(is_blurred).map(|place| chosen[place]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames with these motions between them, as sharp as `sharpness` has them.
    fn walk(moved: &[f64], sharpness: impl Fn(usize) -> f64) -> Vec<Frame> {
        let mut travel = 0.0;
        let frame = |i: usize| {
            travel += if i == 0 { 0.0 } else { moved[i - 1] };
            Frame { time: None, sharpness: sharpness(i), travel, followed: true }
        };
        (0..=moved.len()).map(frame).collect()
    }

    fn gaps_of(frames: &[Frame], choice: &Choice) -> Vec<f64> {
        choice.frames.windows(2).map(|pair| frames[pair[1]].travel - frames[pair[0]].travel).collect()
    }

    /// If this failed, a camera that pauses and hurries would give many frames of one place and few of another.
    #[test]
    fn chosen_frames_are_even_in_motion_whatever_the_speed() {
        // Slow, a pause of 200 frames, fast, slow again.
        let speed = |i: usize| match i {
            0..100 => 0.004,
            100..300 => 0.0,
            300..360 => 0.02,
            _ => 0.002,
        };
        let moved: Vec<f64> = (0..500).map(speed).collect();
        let frames = walk(&moved, |_| 0.2);
        let choice = choose(&frames, 24);
        assert_eq!(choice.frames.len(), 24);
        let gaps = gaps_of(&frames, &choice);
        let mean = frames[500].travel / 23.0;
        assert!(gaps.iter().all(|gap| (gap / mean - 1.0).abs() < 0.25), "{mean}: {gaps:?}");
        assert!(choice.frames.iter().filter(|frame| (100..=300).contains(*frame)).count() <= 1);
        assert_eq!((choice.gaps.len(), choice.blurred.len()), (0, 0));
    }

    /// If this failed, blurred frames would be trained on where sharp ones are beside them.
    #[test]
    fn blurred_frames_are_stepped_around() {
        // A step is ten frames: every second target lies in the middle of a blurred stretch.
        let blurred = |i: usize| (i + 4) % 20 < 8;
        let frames = walk(&[0.01; 400], |i| if blurred(i) { 0.05 } else { 0.2 });
        let choice = choose(&frames, 41);
        assert_eq!(choice.frames.len(), 41);
        assert!(choice.frames.iter().all(|frame| !blurred(*frame)), "{:?}", choice.frames);
        let gaps = gaps_of(&frames, &choice);
        assert!(gaps.iter().all(|gap| (0.03..=0.2).contains(gap)), "{gaps:?}");
    }

    /// If this failed, one sharp frame would tear a hole into the walk.
    #[test]
    fn evenness_weighs_more_than_a_little_sharpness() {
        let frames = walk(&[0.01; 100], |i| if i % 10 == 5 { 0.22 } else { 0.2 });
        let gaps = gaps_of(&frames, &choose(&frames, 11));
        assert!(gaps.iter().all(|gap| (gap - 0.1).abs() < 0.03), "{gaps:?}");
    }

    /// If this failed, a still camera would give copies of one picture, which cost time and teach nothing.
    #[test]
    fn duplicates_are_not_chosen() {
        let still = walk(&[0.0; 300], |i| if i == 77 { 0.3 } else { 0.2 });
        assert_eq!(choose(&still, 20).frames, [77]);
        let little = walk(&[0.0005; 300], |_| 0.2);
        let choice = choose(&little, 100);
        assert_eq!(choice.frames.len(), 16);
        assert!(gaps_of(&little, &choice).iter().all(|gap| *gap > 0.0099));
    }

    /// If this failed, fewer frames than asked for would come out of a folder of pictures that are far apart.
    #[test]
    fn where_all_differ_as_many_come_out_as_are_asked_for() {
        let moved: Vec<f64> = (0..29).map(|i| 0.02 + 0.03 * f64::from(i % 7)).collect();
        let frames = walk(&moved, |i| 0.1 + 0.01 * (i % 5) as f64);
        for count in [2, 3, 10, 20, 25, 29, 30, 500] {
            assert_eq!(choose(&frames, count).frames.len(), count.min(30), "{count}");
        }
        assert_eq!(choose(&frames, 30).frames, (0..30).collect::<Vec<_>>());
        assert_eq!(choose(&frames, 1).frames.len(), 1);
        assert_eq!(choose(&[], 5), Choice::default());
    }

    /// If this failed, COLMAP would lose the connection without a warning, or the warning would ask for too few frames.
    #[test]
    fn gaps_are_reported_with_a_number_that_closes_them() {
        let frames = walk(&[0.02; 300], |_| 0.2);
        let choice = choose(&frames, 10);
        assert!(choice.gaps.len() == 9 && choice.gaps.iter().all(|gap| gap.closes), "{:?}", choice.gaps);
        // A step of a fifth of the picture, 6 pictures long.
        assert_eq!(choice.enough, Some(31));
        assert_eq!(choose(&frames, 31).gaps, []);
        // A jump from one frame to the next, and a frame that could not be followed: more frames do not help.
        let mut frames = walk(&[[0.02; 50], [0.02; 50]].concat(), |_| 0.2);
        frames[30..].iter_mut().for_each(|frame| frame.travel += 0.5);
        frames[70].followed = false;
        let choice = choose(&frames, 40);
        let found: Vec<[usize; 2]> = choice.gaps.iter().map(|gap| [gap.from, gap.to]).collect();
        assert!(matches!(found[..], [[29, 30], [a, b]] if a < 70 && b >= 70), "{found:?}");
        assert!(choice.gaps.iter().all(|gap| !gap.closes), "{:?}", choice.gaps);
    }

    /// If this failed, users would not learn why their frames are not even in time.
    #[test]
    fn pauses_are_found() {
        let moved: Vec<f64> =
            (0..200).map(|i| if (50..100).contains(&i) || i > 190 { 0.0001 } else { 0.005 }).collect();
        let mut frames = walk(&moved, |_| 0.2);
        assert_eq!(pauses(&frames), [] as [[usize; 2]; 0]);
        frames.iter_mut().enumerate().for_each(|(i, frame)| frame.time = Some(i as f64 / 30.0));
        let found = pauses(&frames);
        assert!(matches!(found[..], [[48..=50, 100..=102]]), "{found:?}");
        assert_eq!(pauses(&[]), [] as [[usize; 2]; 0]);
    }

    /// If this failed, a fast turn would be given most of the frames, all blurred, or so few that SfM loses its way through it.
    #[test]
    fn blurred_stretches_are_given_what_connects_them() {
        let blurred = |i: usize| (100..300).contains(&i);
        let frames = walk(&[0.01; 500], |i| if blurred(i) { 0.06 } else { 0.2 });
        let choice = choose(&frames, 41);
        assert_eq!((choice.frames.len(), choice.gaps.len()), (41, 0));
        let inside = choice.frames.iter().filter(|frame| blurred(**frame)).count();
        // The stretch is two fifths of the walk: 16 frames, if blur did not count, and 10 in steps that connect.
        assert!((9..=11).contains(&inside), "{inside} of {:?}", choice.frames);
        let reported = choice.blurred.iter().filter(|frame| blurred(**frame)).count();
        assert!(reported > 0 && reported == choice.blurred.len(), "{:?}", choice.blurred);
        // So few that all have to be as far apart as possible: even, blurred or not.
        let few = choose(&frames, 11);
        assert!(gaps_of(&frames, &few).iter().all(|gap| (gap / 0.5 - 1.0).abs() < 0.3), "{:?}", few.frames);
    }

    /// If this failed, a turn that is blurred from its beginning to its end would be reported to be as good as the rest.
    #[test]
    fn frames_without_a_sharper_one_near_are_reported() {
        let blurred = |i: usize| (150..190).contains(&i);
        let frames = walk(&[0.01; 400], |i| if blurred(i) { 0.05 } else { 0.2 });
        let choice = choose(&frames, 41);
        assert!((1..=2).contains(&choice.blurred.len()), "{:?}", choice.blurred);
        assert!(choice.blurred.iter().all(|frame| blurred(*frame)));
    }
}
