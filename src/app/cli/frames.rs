//! `camsplat frames`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;

use super::overwrite_guard::check_output_folder;
use super::progress::{self, withdraw_on_interrupt};
use super::session::{Ended, go_on};
use super::shell;
use crate::files::io::folder::OutputFolder;
use crate::photogrammetry::frames::choice::{self, Choice, DUPLICATE, Gap};
use crate::photogrammetry::frames::{self, Analysis, Format, Progress, Source};
use crate::{Error, Result};

/// Arguments of `camsplat frames`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// A video in any format that the program ffmpeg reads, or a folder of .jpg or .png pictures in the order of their names
    #[arg(value_name = "VIDEO|FOLDER")]
    source: PathBuf,
    /// Number of frames; fewer are written if the rest are near-duplicates
    #[arg(long, value_parser = clap::value_parser!(u32).range(2..=5000))]
    count: u32,
    /// Folder to write: images/ and frames.csv
    #[arg(long)]
    out: PathBuf,
    /// Write into a folder that is not empty; files of the same names are replaced, all others stay
    #[arg(long)]
    force: bool,
    /// Write the frames of a video as .png, without further loss, in place of .jpg of high quality
    #[arg(long)]
    png: bool,
}

/// Most frames for which every pair is matched, which finds where a walk comes back to.
const EXHAUSTIVE: usize = 300;

/// Chooses, writes the folder and prints what to run next.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let folder = OutputFolder::create(&arguments.out, arguments.force)?;
    check_output_folder(&arguments.out, [&arguments.source])?;
    let source = Source::open(&arguments.source)?;
    withdraw_on_interrupt()?;
    match choose_and_write(arguments, &source, folder) {
        // ffmpeg is stopped by the same Ctrl-C, and fails of it.
        Err(_) if go_on().is_break() => {
            say!("stopped; nothing is written");
            Ok(Ended::Stopped)
        }
        Err(error) => Err(error),
        Ok(chosen) => {
            print_next(&arguments.out, chosen);
            Ok(Ended::Done)
        }
    }
}

/// Returns how many frames were chosen.
fn choose_and_write(arguments: &Arguments, source: &Source, folder: OutputFolder) -> Result<usize> {
    let format = if arguments.png { Format::Png } else { Format::Jpeg };
    let unit = if matches!(source, Source::Video(_)) { "seconds of the video" } else { "pictures" };
    let bar = progress::Progress::over("reading", 0, unit);
    let analysis = frames::analyse(source, format, |progress| {
        let (done, all) = match progress {
            Progress::Seconds(done, all) => (done as u32, all.ceil() as u32),
            Progress::Pictures(done, all) => (done as u32, all as u32),
        };
        bar.advance(done, all)
    });
    bar.finish();
    let analysis = analysis?;
    analysis.notes.iter().for_each(|note| say!("{note}"));
    let choice = choice::choose(&analysis.frames, arguments.count as usize);
    print_found(&analysis);
    print_chosen(arguments.count as usize, &analysis, &choice);
    frames::write(source, &analysis, &choice, format, &folder, go_on)?;
    Error::unless_stopped(go_on())?;
    folder.commit()?;
    say!("written  {} and {}", arguments.out.join("images").display(), arguments.out.join("frames.csv").display());
    print_left_over(&arguments.out, &analysis, &choice);
    Ok(choice.frames.len())
}

fn print_found(analysis: &Analysis) {
    let frames = &analysis.frames;
    let seconds = |from: usize, to: usize| Some(frames.get(to)?.time? - frames.get(from)?.time?);
    let last = frames.len().saturating_sub(1);
    let long = seconds(0, last).map_or(String::new(), |seconds| format!(" in {seconds:.1} s"));
    say!("found    {} frames{long}", frames.len());
    let travel = frames.last().map_or(0.0, |frame| frame.travel);
    let pauses = choice::pauses(frames);
    let still: f64 = pauses.iter().filter_map(|[from, to]| seconds(*from, *to)).sum();
    let paused = match pauses.len() {
        0 => String::new(),
        1 => format!("; it stands still for {still:.1} s"),
        number => format!("; it stands still for {still:.1} s, in {number} pauses"),
    };
    say!("motion   the picture moves by {travel:.1} times its own size{paused}");
}

fn print_chosen(count: usize, analysis: &Analysis, choice: &Choice) {
    let Analysis { frames, names, .. } = analysis;
    let number = choice.frames.len();
    say!(
        "chosen   {number} frames, one for each {:.1}% that the picture moves, fewer where it is blurred",
        100.0 * choice.step
    );
    if number < count {
        let why = match number == frames.len() {
            true => "there are no more".into(),
            false => format!(
                "more would be near-duplicates, less than {:.0}% of the picture apart, or blurred",
                100.0 * DUPLICATE
            ),
        };
        say!("         {count} were requested: {why}");
    }
    let at = |frame: usize| match frames[frame].time {
        Some(time) => format!("{time:.1} s"),
        None => names[frame].clone(),
    };
    let some = |places: Vec<String>| {
        const FEW: usize = 5;
        let rest = places.len().saturating_sub(FEW);
        let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
        format!("{}{more}", places[..places.len() - rest].join(", "))
    };
    if !choice.blurred.is_empty() {
        let places = some(choice.blurred.iter().map(|frame| at(*frame)).collect());
        say!("warning  {} chosen frames are blurred, and nothing sharper is near: {places}", choice.blurred.len());
    }
    let (closes, splits): (Vec<&Gap>, Vec<&Gap>) = choice.gaps.iter().partition(|gap| gap.closes);
    let widest = closes.iter().map(|gap| gap.motion).fold(0.0, f64::max);
    if !closes.is_empty() {
        say!(
            "warning  SfM may lose the connection in {} gaps, the widest {:.0}% of the picture; --count {} closes them: {}",
            closes.len(),
            100.0 * widest,
            choice.enough.unwrap_or(count),
            some(closes.iter().map(|gap| at(gap.from)).collect())
        );
    }
    if !splits.is_empty() {
        say!(
            "warning  SfM may split the walk where the picture cannot be followed (a cut, a fast turn, a plain wall); film these places \
             again, slower: {}",
            some(splits.iter().map(|gap| at(gap.from)).collect())
        );
    }
}

/// Warns of pictures of earlier runs, which COLMAP would take as well.
fn print_left_over(out: &Path, analysis: &Analysis, choice: &Choice) {
    let written: BTreeSet<&str> = choice.frames.iter().map(|frame| analysis.names[*frame].as_str()).collect();
    let images = out.join("images");
    let names = crate::files::io::photos::files::images_in(&images);
    let others = names.iter().filter(|name| !written.contains(name.as_str())).count();
    if others > 0 {
        say!("warning  {} has {others} other pictures, which COLMAP takes too; remove them first", images.display());
    }
    if out.join("database.db").exists() {
        say!("warning  {} is of an earlier run of COLMAP; remove it first", out.join("database.db").display());
    }
}

/// Prints the commands that lead from frames to photos with poses, and to the best of them.
fn print_next(out: &Path, chosen: usize) {
    let quoted = |path: &Path| shell::quoted(&path.to_string_lossy());
    let [database, images, sparse] = ["database.db", "images", "sparse"].map(|name| quoted(&out.join(name)));
    let matcher = if chosen <= EXHAUSTIVE { "exhaustive_matcher" } else { "sequential_matcher" };
    let best = out.with_file_name(format!("{}-best", out.file_name().unwrap_or_default().to_string_lossy()));
    say!("next     camera poses by COLMAP, then the photos that serve best:");
    say!("colmap feature_extractor --database_path {database} --image_path {images} \\");
    say!("    --ImageReader.single_camera 1 --ImageReader.camera_model OPENCV");
    say!("colmap {matcher} --database_path {database}");
    say!("mkdir -p {sparse}");
    say!("colmap mapper --database_path {database} --image_path {images} --output_path {sparse}");
    say!("camsplat select {} --count {} --out {}", quoted(out), chosen.div_ceil(2), quoted(&best));
}
