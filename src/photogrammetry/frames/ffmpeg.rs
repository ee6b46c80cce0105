//! Videos through the program ffmpeg: small grey frames for the analysis, and the chosen ones in full size.
//!
//! Arguments are given to the program as they are, without a shell. The video's name follows `file:`, and no other protocol is allowed, so
//! that neither a name nor a playlist leads elsewhere. ffmpeg turns frames as their rotation metadata says, in both runs alike, and numbers
//! them in the order in which they are shown.

use std::ffi::{OsStr, OsString};
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, ErrorKind};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use super::Format;
use super::grey::Grey;
use super::sharpness;
use crate::engine::parallel::lock;
use crate::error::{Error, Result};

/// Most pixels of a side of the small frames that are accepted: with more, what comes is not what was asked for.
const LARGEST: usize = 4 * sharpness::SIDE;

/// Gives `take` every frame, shrunk to the size that sharpness is measured at, with the seconds that have been read and those that there
/// are, as far as they are known. The times of the frames are returned: none where the video does not say them all.
///
/// # Errors
/// Where ffmpeg is not there or finds no video; [`Error::Interrupted`] where `take` asks for a stop.
pub fn analyse(
    video: &Path,
    mut take: impl FnMut(Grey, [f64; 2]) -> ControlFlow<()>,
) -> Result<(Option<Vec<f64>>, Vec<String>)> {
    let side = sharpness::SIDE;
    let filters = format!(
        "scale=w='if(gte(iw,ih),min({side},iw),-2)':h='if(gte(iw,ih),-2,min({side},ih))':flags=area,format=gray,showinfo,setpts=N/(25*TB)"
    );
    let mut run = Run::start(video, |command| {
        command.args(["-vf", &filters, "-r", "25", "-f", "image2pipe", "-c:v", "pgm", "pipe:1"]);
    })?;
    let mut frames = 0;
    while let Some(frame) = read_pgm(&mut run.output).map_err(|error| run.unreadable(video, &error))? {
        frames += 1;
        let seconds = lock(&run.log).seconds();
        Error::unless_stopped(take(frame, seconds))?;
    }
    let log = run.end(video, frames > 0)?;
    let times = (log.times.len() == frames).then_some(log.times);
    Ok((times, log.notes))
}

/// Writes the frames of these numbers, ascending, into `folder` as `000000.jpg` (or `.png`) and so on.
///
/// # Errors
/// As [`analyse`]; where ffmpeg writes another number of frames.
pub fn extract(
    video: &Path,
    frames: &[usize],
    folder: &Path,
    format: Format,
    mut go_on: impl FnMut() -> ControlFlow<()>,
) -> Result<()> {
    let selected = format!("select='{}'", any_of(frames));
    // JPEG files hold colours as BT.601 has them and in full range, whatever the video's.
    let filters = match format {
        Format::Jpeg => format!("{selected},scale=out_color_matrix=bt601:out_range=full,setpts=N/(25*TB)"),
        Format::Png => format!("{selected},format=rgb24,setpts=N/(25*TB)"),
    };
    let number = frames.len().to_string();
    let mut run = Run::start(video, |command| {
        command.args(["-vf", &filters, "-r", "25", "-frames:v", &number]);
        if format == Format::Jpeg {
            command.args(["-q:v", "2"]);
        }
        // The pattern is relative: a percent sign in the folder's name would be taken for a part of it.
        command.args(["-f", "image2", "-start_number", "0"]).arg(format!("%06d.{}", format.extension()));
        command.args(["-progress", "pipe:1"]).current_dir(folder);
    })?;
    let mut line = String::new();
    // A few lines every half second, until the end.
    while run.output.read_line(&mut line).is_ok_and(|length| length > 0) {
        line.clear();
        Error::unless_stopped(go_on())?;
    }
    run.end(video, true)?;
    Error::unless_stopped(go_on())?;
    let written = (0..frames.len()).filter(|i| folder.join(format!("{i:06}.{}", format.extension())).is_file()).count();
    if written != frames.len() {
        let what =
            format!("ffmpeg wrote {written} of {} frames the second time; is the file being changed?", frames.len());
        return Err(Error::input(video, what));
    }
    Ok(())
}

/// An expression that is not 0 for frames of these numbers: a balanced tree of sums, since ffmpeg evaluates sums recursively.
fn any_of(frames: &[usize]) -> String {
    let mut text = String::new();
    fn add(frames: &[usize], text: &mut String) {
        match frames {
            [] => text.push('0'),
            [frame] => {
                // Writing to a string does not fail.
                let _ = write!(text, "eq(n,{frame})");
            }
            _ => {
                let (left, right) = frames.split_at(frames.len() / 2);
                text.push('(');
                add(left, text);
                text.push('+');
                add(right, text);
                text.push(')');
            }
        }
    }
    add(frames, &mut text);
    text
}

/// What ffmpeg reports while it runs.
#[derive(Default)]
struct Log {
    /// Seconds of the video, by its header.
    duration: Option<f64>,
    /// Time of each frame.
    times: Vec<f64>,
    /// The first error, and how many there were.
    error: Option<String>,
    errors: usize,
    /// For the user, once all has been read.
    notes: Vec<String>,
}

impl Log {
    fn seconds(&self) -> [f64; 2] {
        let done = self.times.last().copied().unwrap_or_default();
        [done, self.duration.unwrap_or_default().max(done)]
    }

    /// Takes a line, which begins with the reporting part and the level in brackets.
    fn take(&mut self, line: &str, input: &str) {
        let after = |mark: &str| line.split_once(mark).map(|(_, rest)| rest.trim_start());
        if let Some(time) = after(" pts_time:").filter(|_| line.contains("showinfo")) {
            let time = time.split_whitespace().next().and_then(|time| time.parse().ok());
            self.times.extend(time.filter(|time: &f64| time.is_finite()));
        } else if let Some(duration) = after("Duration: ").filter(|_| self.duration.is_none()) {
            self.duration = clock(duration.split(',').next().unwrap_or_default());
        } else if let Some(error) = ["[error] ", "[fatal] ", "[panic] "].iter().find_map(|level| after(level)) {
            self.errors += 1;
            let error = error.replace(input, "").trim_start_matches([':', ' ']).trim().to_owned();
            self.error.get_or_insert(error);
        }
    }
}

/// Seconds of `HH:MM:SS.ss`.
fn clock(text: &str) -> Option<f64> {
    let parts: Vec<f64> = text.trim().split(':').map(str::parse).collect::<Result<_, _>>().ok()?;
    match parts[..] {
        [hours, minutes, seconds] => Some(3600.0 * hours + 60.0 * minutes + seconds),
        _ => None,
    }
}

/// ffmpeg at work on a video; dropped before its end, it is ended.
struct Run {
    child: Child,
    output: BufReader<ChildStdout>,
    log: Arc<Mutex<Log>>,
    listener: Option<JoinHandle<()>>,
}

impl Run {
    /// Starts ffmpeg on the first video stream of a file, with the arguments that `add` gives for its output.
    fn start(video: &Path, add: impl FnOnce(&mut Command)) -> Result<Self> {
        let path = std::path::absolute(video).map_err(|source| Error::io(video, source))?;
        let mut input = OsString::from("file:");
        input.push(&path);
        let mut command = Command::new("ffmpeg");
        command.args(["-hide_banner", "-nostdin", "-nostats", "-loglevel", "level+info"]);
        // `V` leaves out pictures that are attached to sound.
        command.args(["-protocol_whitelist", "file"]).arg("-i").arg(&input).args(["-map", "0:V:0"]);
        add(&mut command);
        let mut child =
            command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().map_err(missing)?;
        let streams = child.stdout.take().zip(child.stderr.take());
        let (output, errors) = streams.ok_or_else(|| Error::request("the system gives no pipe to ffmpeg"))?;
        let log = Arc::new(Mutex::new(Log::default()));
        let mut run = Self { child, output: BufReader::with_capacity(1 << 20, output), log, listener: None };
        let log = Arc::clone(&run.log);
        let input = input.to_string_lossy().into_owned();
        let listen = move || {
            let mut errors = BufReader::new(errors);
            let mut line = Vec::new();
            while errors.read_until(b'\n', &mut line).is_ok_and(|length| length > 0) {
                lock(&log).take(&String::from_utf8_lossy(&line), &input);
                line.clear();
            }
        };
        let listener = std::thread::Builder::new().name("ffmpeg".into()).spawn(listen);
        run.listener =
            Some(listener.map_err(|e| Error::request(format!("the system gives no thread to read ffmpeg in ({e})")))?);
        Ok(run)
    }

    /// Waits for the end of ffmpeg and hands over what it reported.
    fn end(mut self, video: &Path, has_video: bool) -> Result<Log> {
        let status = self.child.wait().map_err(|source| Error::io(OsStr::new("ffmpeg"), source))?;
        self.listener.take().map(JoinHandle::join);
        let mut log = std::mem::take(&mut *lock(&self.log));
        let reason = log.error.take();
        let said = reason.as_ref().map_or(String::new(), |reason| format!(" ({reason})"));
        if !has_video {
            return Err(Error::input(
                video,
                format!("ffmpeg finds no video in it{said}; give a video, or a folder of pictures"),
            ));
        }
        if !status.success() {
            let what = format!(
                "ffmpeg failed on it{said}; try `ffmpeg -i` on the file, and give one that it reads to the end"
            );
            return Err(Error::input(video, what));
        }
        if log.errors > 0 {
            log.notes
                .push(format!("ffmpeg reported {} errors in the video{said}; frames there may be damaged", log.errors));
        }
        Ok(log)
    }

    /// The error where what ffmpeg sends is no picture.
    fn unreadable(&self, video: &Path, error: &std::io::Error) -> Error {
        Error::input(video, format!("ffmpeg ended in the middle of a frame ({error}); try `ffmpeg -i` on the file"))
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        // After its end neither does anything; what fails here leaves nothing behind that could be helped.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn missing(error: std::io::Error) -> Error {
    match error.kind() {
        ErrorKind::NotFound => Error::request(
            "the program ffmpeg, which reads videos, is not there; install it (apt-get install ffmpeg, brew install ffmpeg), or give a \
             folder of frames",
        ),
        _ => Error::request(format!("ffmpeg does not start ({error}); install it again")),
    }
}

/// The next picture of a stream of binary PGM files; none at its end.
fn read_pgm(stream: &mut impl BufRead) -> std::io::Result<Option<Grey>> {
    let refuse = |what: &str| std::io::Error::new(ErrorKind::InvalidData, what.to_owned());
    if stream.fill_buf()?.is_empty() {
        return Ok(None);
    }
    let mut words = [const { String::new() }; 4];
    for word in &mut words {
        loop {
            let mut byte = [0];
            stream.read_exact(&mut byte)?;
            match byte[0] {
                // A single white space ends the last word; values follow.
                byte if byte.is_ascii_whitespace() && word.is_empty() => {}
                byte if byte.is_ascii_whitespace() => break,
                byte if word.len() < 8 => word.push(char::from(byte)),
                _ => return Err(refuse("no picture")),
            }
        }
    }
    let [magic, width, height, most] = words;
    let side = |word: &str| word.parse().ok().filter(|side| (1..=LARGEST).contains(side));
    let (Some(width), Some(height)) = (side(&width), side(&height)) else { return Err(refuse("no size")) };
    if magic != "P5" || most != "255" {
        return Err(refuse("no grey picture"));
    }
    let mut values = vec![0; width * height];
    stream.read_exact(&mut values)?;
    Ok(Some(Grey { width, height, values }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, frames would be cut at the wrong bytes, or a broken stream would end the program or fill the memory.
    #[test]
    fn a_stream_of_pictures_is_read_one_by_one() {
        let stream = b"P5\n3 2\n255\n\n23456P5\n1 1\n255\nx".to_vec();
        let mut rest = &stream[..];
        assert_eq!(read_pgm(&mut rest).unwrap().unwrap(), Grey { width: 3, height: 2, values: b"\n23456".to_vec() });
        assert_eq!(read_pgm(&mut rest).unwrap().unwrap().values, b"x");
        assert_eq!(read_pgm(&mut rest).unwrap(), None);
        for damaged in
            ["P5\n3 2\n255\n1234", "P6\n1 1\n255\nx", "P5\n99999 99999\n255\n", "P5\n0 1\n255\n", "P5", "PPPPPPPPPPPP"]
        {
            assert!(read_pgm(&mut damaged.as_bytes()).is_err(), "{damaged}");
        }
    }

    /// If this failed, times of frames would be missing in frames.csv, or the reason for a failure would not be given.
    #[test]
    fn the_log_is_understood() {
        let mut log = Log::default();
        for line in [
            "  [info] Duration: 01:02:03.50, start: 0.000000, bitrate: 4000 kb/s",
            "[Parsed_showinfo_2 @ 0x55] [info] config in time_base: 1/15360, frame_rate: 30/1",
            "[Parsed_showinfo_2 @ 0x55] [info] n:   0 pts:      0 pts_time:0       duration:    512 duration_time:0.0333333 fmt:gray",
            "[Parsed_showinfo_2 @ 0x55] [info] n:   1 pts:    512 pts_time:0.0333333 duration:    512",
            "[h264 @ 0x1] [error] error while decoding MB 3 4",
            "[error] file:/tmp/a.mp4: Invalid data found when processing input",
        ] {
            log.take(line, "file:/tmp/a.mp4");
        }
        assert_eq!((log.duration, &log.times[..]), (Some(3723.5), &[0.0, 0.033_333_3][..]));
        assert_eq!((log.errors, log.error.as_deref()), (2, Some("error while decoding MB 3 4")));
        let mut log = Log::default();
        log.take("[error] file:/tmp/a.mp4: Invalid data found", "file:/tmp/a.mp4");
        assert_eq!(log.error.as_deref(), Some("Invalid data found"));
        assert_eq!([clock("00:00:10"), clock("N/A"), clock("1:2")], [Some(10.0), None, None]);
    }

    /// If this failed, thousands of chosen frames would overflow ffmpeg's stack.
    #[test]
    fn the_selection_is_a_shallow_tree() {
        assert_eq!(any_of(&[3, 7, 9]), "(eq(n,3)+(eq(n,7)+eq(n,9)))");
        let text = any_of(&(0..5000).collect::<Vec<_>>());
        let depth = text.bytes().scan(0i32, |depth, byte| {
            *depth += i32::from(byte == b'(') - i32::from(byte == b')');
            Some(*depth)
        });
        assert!(depth.max().unwrap() < 20 && text.len() < 120_000);
    }
}
