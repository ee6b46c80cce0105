//! `camsplat watch`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use glam::DVec3;

use super::named;
use super::options::{DeviceOptions, print_messages};
use super::phone;
use super::photographed;
use super::place;
use super::progress::close_on_interrupt;
use super::region::RegionOptions;
use super::server::Access;
use super::session::{self, Ended, go_on};
use super::viewers::ViewerOptions;
use crate::app::report::way;
use crate::app::watch::board::{Flaw, Shared, Shown};
use crate::app::watch::given::{PoseFiles, folders_of_photos};
use crate::app::watch::inbox::{Arrival, Inbox, below};
use crate::app::watch::person;
use crate::app::watch::sfm::{self, Sfm};
use crate::app::watch::video::{self, Videos};
use crate::engine::parallel::lock;
use crate::engine::vulkan::Context;
use crate::files::io;
use crate::files::io::photos::ReadOptions;
use crate::files::io::photos::files::images_in;
use crate::files::photos::PhotoSet;
use crate::planner::plan::config::Config;
use crate::planner::plan::enough::{Advice, MORE};
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::Camera;
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// Arguments of `camsplat watch`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Folder that photos and videos arrive in, by any means. Where it is a capture with poses (of Polycam, Record3D, a transforms.json,
    /// COLMAP), those are taken; else COLMAP finds them. Of videos frames are chosen, which needs ffmpeg
    folder: PathBuf,
    /// Folder for what is worked out; nothing else is written [default: .camsplat in the folder of the photos]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Let phones in the local network see the page too, by an address with a secret in it, which is printed as a QR code; they can
    /// change nothing
    #[arg(long)]
    share: bool,
    /// Port to serve the page on [default: any that is free]
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Print the address without opening a browser
    #[arg(long)]
    no_browser: bool,
    /// Python with the package pycolmap, which finds poses
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    python: PathBuf,
    #[command(flatten)]
    region: RegionOptions,
    #[command(flatten)]
    viewers: ViewerOptions,
    #[command(flatten)]
    device: DeviceOptions,
    /// Seed of every random number
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Folder of what is worked out, in the folder of the photos.
const HIDDEN: &str = ".camsplat";
/// Between two looks at the folder.
const BETWEEN_LOOKS: Duration = Duration::from_millis(500);
/// Between two looks at whether there is anything to do, or to stop.
const SHORT: Duration = Duration::from_millis(50);
/// After a fault, at first and at most.
const PAUSE: Duration = Duration::from_secs(5);
const LONGEST_PAUSE: Duration = Duration::from_secs(60);
/// What to do where there are too few photos.
const MORE_PHOTOS: &str = "Take five photos of the same thing, each half a step beside the last";
const SMALLER_STEPS: &str = "No two photos show enough of the same: take smaller steps between them";
/// Photos with a pose before there is advice.
const FEWEST: usize = 3;
/// Places that are shown.
const SHOWN: usize = 5;
/// Points of the surface at which photos are judged.
const HELD_OUT: u32 = 1000;

/// What is said of photos without a pose, where they are found and where they are given.
const UNPLACED: &str = "could not be placed: other photos show too little of the same; take another halfway to those";
const NO_POSE: &str = "has no pose yet in the files of the capture";

/// One run.
struct Watch<'a> {
    arguments: &'a Arguments,
    context: Arc<Context>,
    viewers: Viewers,
    /// What finds poses where none lie beside the photos; none as long as it was not needed.
    sfm: Mutex<Option<Sfm>>,
    board: Arc<Shared>,
    /// The photos that are there, and how often they have changed.
    arrived: Mutex<(u64, Vec<Arrival>)>,
    changed: Condvar,
    videos: Mutex<Videos>,
    /// What a step was the last time, so that it stays one.
    apart: Mutex<Option<[String; 2]>>,
    /// Where the photos lie.
    images: PathBuf,
    /// Folder of what is worked out.
    work: PathBuf,
}

/// What is looked at every now and then.
struct Looks {
    inbox: Inbox,
    /// Frames of videos.
    frames: Inbox,
    poses: PoseFiles,
    /// The folders of pictures for which it was settled which have photos.
    settled: Option<BTreeSet<String>>,
}

/// Watches until the user stops it.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let folder = &arguments.folder;
    let kind = std::fs::metadata(folder).map_err(|source| io::unreadable(folder, source))?;
    if !kind.is_dir() {
        return Err(Error::input(folder, "this is no folder; name the one that photos arrive in"));
    }
    arguments.region.choice()?;
    let viewers = arguments.viewers.viewers()?;
    let work = arguments.out.clone().unwrap_or_else(|| folder.join(HIDDEN));
    let given = io::photos::is_capture(folder);
    let sfm = if given { None } else { Some(Sfm::find(&arguments.python, &work.join("sfm"))?) };
    let kept = work.join("photos.json");
    io::folder::make_parent(&kept)?;
    if work.canonicalize().ok() == folder.canonicalize().ok() {
        return Err(Error::input(&work, "the photos arrive here; name another folder for --out, or leave it out"));
    }
    // It ends with the process, however that ends.
    let lock = File::create(work.join("lock")).map_err(|source| Error::io(&work, source))?;
    if lock.try_lock().is_err() {
        return Err(Error::input(
            folder,
            "another `camsplat watch` is at work here; stop that one, or name another --out",
        ));
    }
    let inside = folder.join("images");
    let images = if images_in(&inside).is_empty() { folder.clone() } else { inside };
    close_on_interrupt()?;
    let context = arguments.device.open()?;
    say!("device   {}", context.physical().title());
    match &sfm {
        None => say!("poses    of {}, as they lie there", folder.display()),
        Some(sfm) => say!("poses    by COLMAP (pycolmap {})", sfm.version),
    }
    let board = Arc::new(Shared::default());
    let title = folder.canonicalize().unwrap_or_else(|_| folder.clone());
    board.change(|board| board.title = title.file_name().unwrap_or_default().to_string_lossy().into_owned());
    let access = Access { port: arguments.port, shared: arguments.share, asks: true };
    let server = phone::serve(Arc::clone(&board), access, !arguments.no_browser)?;
    let videos = Videos::new(folder, &work);
    let frames = Inbox::open(videos.frames(), &work.join("frames.json"))?;
    let mut looks = Looks { inbox: Inbox::open(&images, &kept)?, frames, poses: PoseFiles::new(folder), settled: None };
    if given {
        // A capture that cannot be read is refused at once.
        folders_of_photos(folder, &images)?;
    }
    let (arrived, changed, sfm, videos) = (Mutex::default(), Condvar::new(), Mutex::new(sfm), Mutex::new(videos));
    let apart = Mutex::default();
    let watch = Watch { arguments, context, viewers, sfm, board, arrived, changed, videos, apart, images, work };
    let session = session::current();
    thread::scope(|scope| {
        scope.spawn(|| session.within(|| watch.look_after(&mut looks)));
        scope.spawn(|| session.within(|| watch.advise_on_and_on()));
        server.serve();
    });
    print_messages(&watch.context);
    Ok(Ended::Done)
}

impl Watch<'_> {
    /// Looks at the folder every now and then, and says at once which photos are of no use.
    fn look_after(&self, looks: &mut Looks) {
        // Photos that lie there already are looked at by the second one; what an earlier run has seen counts as well.
        self.look(looks);
        let mut first = true;
        while go_on().is_continue() {
            let begun = Instant::now();
            let is_there = || self.arguments.folder.is_dir();
            let changed = is_there() && self.look(looks);
            // It may have gone while it was looked at, and what was not found then was not deleted.
            if is_there() {
                if changed | std::mem::take(&mut first) {
                    let mut photos = [looks.inbox.photos(), looks.frames.photos()].concat();
                    photos.sort_by_key(|photo| photo.written);
                    self.show(&photos, None);
                    self.board.change(|board| board.current = false);
                    let mut arrived = lock(&self.arrived);
                    *arrived = (arrived.0 + 1, photos);
                    self.changed.notify_all();
                }
            } else if !first {
                // Photos that were moved away with their folder are not deleted.
                let gone = format!("{} is gone; this goes on when it is back", self.arguments.folder.display());
                self.board.change(|board| board.fault = Some(gone.clone()));
                say!("failed   {gone}");
                first = true;
            }
            while begun.elapsed() < BETWEEN_LOOKS && go_on().is_continue() {
                thread::sleep(SHORT);
            }
        }
        self.changed.notify_all();
    }

    /// Whether photos, videos or poses have changed.
    fn look(&self, looks: &mut Looks) -> bool {
        let folder = &self.arguments.folder;
        let given = io::photos::is_capture(folder);
        let mut changed = looks.poses.scan() | looks.inbox.scan();
        // Photos of a capture lie in the folders that it names, some of which may be filled after its poses are there.
        if changed || looks.settled.as_ref() != Some(looks.inbox.folders()) {
            let only = given.then(|| folders_of_photos(folder, &self.images)).transpose();
            looks.settled = Some(looks.inbox.folders().clone());
            match only {
                Ok(only) => looks.inbox.look_only_in(only),
                // A file that is being written, or of which no photo is there yet.
                Err(error) => say!("failed   {error}"),
            }
            changed |= looks.inbox.scan();
        }
        let mut videos = lock(&self.videos);
        // Frames have no poses that lie beside them.
        changed |= !given && videos.scan();
        looks.frames.look_only_in(Some(if given { Vec::new() } else { videos.folders() }));
        drop(videos);
        changed | looks.frames.scan()
    }

    /// Shows how many photos there are, and what is wrong with some; `posed` are those with a pose, where that is known.
    fn show(&self, photos: &[Arrival], posed: Option<&BTreeSet<String>>) {
        let given = io::photos::is_capture(&self.arguments.folder);
        let unplaced = if given { NO_POSE } else { UNPLACED };
        let videos = if given { Vec::new() } else { lock(&self.videos).faults() };
        self.board.change(|board| {
            let lost = |photo: &Arrival| match posed {
                Some(posed) => !posed.contains(&photo.name),
                // As it was found the last time.
                None => board.flaws.iter().any(|flaw| flaw.name == photo.name && flaw.why == unplaced),
            };
            let flaw = |photo: &Arrival| {
                let why = photo.flaw.clone().or_else(|| lost(photo).then(|| unplaced.into()))?;
                Some(Flaw { name: photo.name.clone(), why })
            };
            let videos = videos.into_iter().map(|(name, why)| Flaw { name, why });
            let flaws: Vec<Flaw> = videos.chain(photos.iter().rev().filter_map(flaw)).collect();
            for flaw in flaws.iter().filter(|flaw| !board.flaws.contains(flaw)) {
                say!("photo    {}: {}", flaw.name, flaw.why);
            }
            board.photos = photos.len();
            if let Some(posed) = posed {
                board.posed = photos.iter().filter(|photo| posed.contains(&photo.name)).count();
            }
            board.flaws = flaws;
        });
    }

    /// Works out what to do next, each time that the photos have changed; after a fault again after a while, twice as long each time.
    fn advise_on_and_on(&self) {
        let (mut done, mut again) = (0, None);
        let mut pause = PAUSE;
        while go_on().is_continue() {
            let photos = {
                let arrived = lock(&self.arrived);
                let waited = self.changed.wait_timeout_while(arrived, SHORT, |arrived| arrived.0 == done);
                let Ok((arrived, timeout)) = waited else { return };
                if timeout.timed_out() && again.is_none_or(|at| Instant::now() < at) {
                    continue;
                }
                done = arrived.0;
                arrived.1.clone()
            };
            let begun = Instant::now();
            let is_there = || self.arguments.folder.is_dir();
            let advised = is_there().then(|| self.step(&photos));
            // Of a folder that is gone nothing can be said; when it is back there is another step.
            let Some(advised) = advised.filter(|_| is_there()) else {
                again = None;
                continue;
            };
            match advised {
                Err(Error::Interrupted) => return,
                Err(error) => {
                    let line = session::current().with_options(error.to_string());
                    say!("failed   {line}");
                    again = Some(Instant::now() + pause);
                    pause = (2 * pause).min(LONGEST_PAUSE);
                    self.board.change(|board| {
                        (board.fault, board.stage, board.current) = (Some(line), "Trying again soon".into(), false);
                    });
                }
                Ok(hint) => {
                    (again, pause) = (None, PAUSE);
                    let seconds = begun.elapsed().as_secs_f64();
                    let (count, s) = (photos.len(), if photos.len() == 1 { "" } else { "s" });
                    let current = hint.is_none() && lock(&self.arrived).0 == done;
                    let stage =
                        hint.unwrap_or_else(|| format!("Up to date with {count} photo{s}, after {seconds:.0} s"));
                    self.board.change(|board| (board.fault, board.stage, board.current) = (None, stage, current));
                }
            }
        }
    }

    fn stage(&self, stage: &str) {
        self.board.change(|board| (board.stage, board.current) = (stage.into(), false));
    }

    /// Poses, and advice, for the photos that are there; what to do where there are too few for that.
    fn step(&self, photos: &[Arrival]) -> Result<Option<String>> {
        let given = io::photos::is_capture(&self.arguments.folder);
        if !given && let Some(read) = self.read_video()? {
            // Its frames arrive as other photos do.
            return Ok(Some(read));
        }
        let usable: Vec<&Arrival> = photos.iter().filter(|photo| photo.flaw.is_none()).collect();
        let mut notes = Vec::new();
        let (mut set, surface, up) = match given {
            true => {
                self.stage("Reading the poses");
                let (set, surface) = self.given(&usable, &mut notes)?;
                (set, surface, None)
            }
            false => {
                if usable.len() < FEWEST {
                    return Ok(Some(self.too_few(0, MORE_PHOTOS)));
                }
                self.stage(&format!("Finding out where {} photos were taken", usable.len()));
                match self.found(&usable, &mut notes)? {
                    Some(found) => found,
                    None => return Ok(Some(self.too_few(0, SMALLER_STEPS))),
                }
            }
        };
        let is_there = |name: &String| usable.iter().any(|photo| photo.name == *name);
        set.apart = lock(&self.apart).clone().filter(|pair| pair.iter().all(is_there));
        let posed: BTreeSet<String> = set.photos.iter().map(|photo| photo.camera.name.clone()).collect();
        self.show(photos, Some(&posed));
        if set.photos.len() < FEWEST {
            return Ok(Some(self.too_few(set.photos.len(), MORE_PHOTOS)));
        }
        self.stage("Working out where to stand next");
        let last =
            photos.iter().rev().find_map(|taken| set.photos.iter().find(|photo| photo.camera.name == taken.name));
        // There are at least three.
        let Some(last) = last.or(set.photos.last()).map(|photo| photo.camera.clone()) else { return Ok(None) };
        // What COLMAP cannot join with other photos is lost.
        let connect = (!given).then(|| sfm::connected(usable.iter().map(|photo| posed.contains(&photo.name))));
        let shown = self.advice(&set, &surface, &last, (connect, up), &mut notes)?;
        let shown = shown.map(|shown| Shown { notes, ..shown });
        if let Some(shown) = &shown {
            say!("photos   {} of {} have a pose", posed.len(), photos.len());
            say!("enough   {}: {} {}", shown.enough, shown.gain, shown.hidden);
            for (number, place) in (1..).zip(&shown.next) {
                say!("next {number:<4}from {}: {}", place.from, place.words);
            }
        }
        self.board.change(|board| board.advice = shown);
        Ok(None)
    }

    /// Says that there are too few photos for advice.
    fn too_few(&self, posed: usize, what: &str) -> String {
        say!("photos   {posed} with a pose, too few for advice");
        self.board.change(|board| (board.posed, board.advice) = (posed, None));
        what.into()
    }

    /// Chooses frames of a video that has arrived; what was done, where there was one.
    fn read_video(&self) -> Result<Option<String>> {
        let videos = lock(&self.videos);
        let task = videos.unread().and_then(|name| Some((videos.task(&name)?, name)));
        drop(videos);
        let Some(((file, stamp, out), name)) = task else { return Ok(None) };
        self.stage(&format!("Choosing frames of {name}"));
        match video::read(&file, stamp, &out, go_on) {
            Ok(frames) => say!("video    {name}: {frames} frames"),
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            // Of ffmpeg, which a stop ends as well.
            Err(_) if go_on().is_break() => return Err(Error::Interrupted),
            Err(error) => {
                let why = error.to_string().replace(&format!("{}: ", file.display()), "");
                lock(&self.videos).failed(&name, stamp, why);
            }
        }
        let mut arrived = lock(&self.arrived);
        arrived.0 += 1;
        self.show(&arrived.1, None);
        Ok(Some(format!("Looked through {name}")))
    }

    /// The capture that the folder is.
    fn given(&self, usable: &[&Arrival], notes: &mut Vec<String>) -> Result<(PhotoSet, Surface)> {
        let (surface, mut set) = session::overheard(notes, || photographed::read(&self.arguments.folder, None, true))?;
        for photo in &mut set.photos {
            if let Some(name) = photo.image.as_deref().and_then(|file| below(&self.images, file)) {
                photo.camera.name = name;
            }
        }
        let names: BTreeSet<&str> = usable.iter().map(|photo| photo.name.as_str()).collect();
        Ok((set.filtered(|photo| names.contains(photo.camera.name.as_str())), surface))
    }

    /// The capture that structure from motion makes of photos, and its up where it was levelled; none where it places none.
    fn found(
        &self,
        usable: &[&Arrival],
        notes: &mut Vec<String>,
    ) -> Result<Option<(PhotoSet, Surface, Option<DVec3>)>> {
        let mut kept = lock(&self.sfm);
        let sfm = match &mut *kept {
            Some(sfm) => sfm,
            // Poses lay beside the photos before.
            none => none.insert(Sfm::find(&self.arguments.python, &self.work.join("sfm"))?),
        };
        let posed: BTreeSet<String> = sfm.pose(usable.iter().copied(), go_on)?.into_iter().collect();
        if posed.is_empty() {
            return Ok(None);
        }
        let mut set = io::photos::read(&sfm.model(), &ReadOptions::default())?;
        let files: BTreeMap<&str, &PathBuf> = usable.iter().map(|photo| (photo.name.as_str(), &photo.file)).collect();
        for photo in &mut set.photos {
            let file = files.get(photo.camera.name.as_str()).map(|file| (*file).clone());
            photo.image = file.filter(|file| file.is_file());
        }
        notes.append(&mut set.notes);
        set.metre = session::overheard(notes, || place::metre(&set))?;
        let set = set.filtered(|photo| posed.contains(&photo.camera.name) && photo.image.is_some()).with_points_seen();
        // Who names places has looked at COLMAP's model.
        let level = if named::places(&self.arguments.region, &self.viewers) { None } else { person::levelled(&set) };
        let (up, set) = (level.is_some().then_some(DVec3::Z), level.unwrap_or(set));
        let surface = Surface::Points(set.points.clone());
        Ok(Some((set, surface, up)))
    }

    /// What to do next, and how it is shown.
    fn advice(
        &self,
        set: &PhotoSet,
        surface: &Surface,
        last: &Camera,
        (connect, up): (Option<f32>, Option<DVec3>),
        notes: &mut Vec<String>,
    ) -> Result<Option<Shown>> {
        let Arguments { folder, region, seed, .. } = self.arguments;
        let (target, preset) = session::overheard(notes, || {
            let of = PhotoSet { path: folder.clone(), ..set.clone() };
            let mut region = region.clone().explored(set);
            region.up = region.up.or(up);
            let target = region.target_of(surface, folder, Some(&of), &last.intrinsics, None)?;
            let preset = region.preset_of(&target);
            let reached = up.is_some() && target.limits.heights.is_none();
            let target = if reached { person::in_reach(target, set)? } else { target };
            if let (true, Some([low, high])) = (reached, target.limits.heights) {
                say!(
                    "         cameras at heights {low:.3} to {high:.3}, which a person reaches (--heights for others)"
                );
            }
            Ok::<_, Error>((target, preset))
        })?;
        let plain = Config::beside_photos(preset, MORE);
        let plain = connect.map_or(Ok(plain.clone()), |degrees| plain.connected_to_kept(degrees))?;
        let config = Config { seed: *seed, held_out: HELD_OUT, viewers: self.viewers.clone(), ..plain };
        config.validate()?;
        let cameras = set.cameras();
        let mut advice = Advice::new(&self.context, &target, last.intrinsics, &cameras, None, &config, &mut go_on)?;
        advice.nearest_first(last.pose.position);
        let next = &advice.further[..SHOWN.min(advice.further.len())];
        let pair = || way::apart(set, target.region.up).map(|pair| pair.map(str::to_owned));
        *lock(&self.apart) = set.apart.clone().or_else(pair);
        let shown = Shown::new(&advice, next, set, &target.region, region.preset.is_some())?;
        Ok(shown.map(|shown| shown.within(connect)))
    }
}
