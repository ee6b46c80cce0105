//! `camsplat view`: what the browser gets of a plan, a capture, trained splats and a folder of runs, and what nobody else gets.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStdout};

use crate::support::browser::{number_after, rendered, write_to};
use crate::support::command::{Place, assert_refused, stop};
use crate::support::splats::scene;
use camsplat::files::io;

/// A server that was started by a command.
pub struct Served {
    /// None once it has been stopped.
    pub child: Option<Child>,
    output: Option<ChildStdout>,
    port: u16,
    /// First part of every path, with a slash before it.
    pub secret: String,
    /// What was printed before the address, and until something was waited for.
    pub said: String,
}

impl Drop for Served {
    /// A test that fails leaves no server behind.
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            child.kill().unwrap();
            child.wait().unwrap();
        }
    }
}

impl Served {
    fn new(place: &Place, arguments: &str) -> Self {
        Self::begun(place, &format!("view {arguments}"), "view ")
    }

    /// By a whole command, which prints the address on the line that begins so.
    pub fn begun(place: &Place, arguments: &str, beginning: &str) -> Self {
        let mut child = place.command(&format!("{arguments} --no-browser")).spawn().unwrap();
        let output = child.stdout.take();
        let mut served = Self { child: Some(child), output, port: 0, secret: String::new(), said: String::new() };
        let line = served.until(beginning);
        let (_, rest) = line.split_once("http://127.0.0.1:").unwrap();
        let address: Vec<&str> = rest.split('/').take(2).collect();
        (served.port, served.secret) = (address[0].parse().unwrap(), format!("/{}", address[1]));
        served
    }

    /// Waits for a line that begins so, and returns it.
    #[track_caller]
    pub fn until(&mut self, beginning: &str) -> String {
        let output = self.output.as_mut().unwrap();
        // Byte by byte: the end of the line is the only sign that it is complete.
        let (mut line, mut byte) = (Vec::new(), [0]);
        loop {
            assert_eq!(output.read(&mut byte).unwrap(), 1, "it ended without a line {beginning:?}: {}", self.said);
            if byte[0] != b'\n' {
                line.push(byte[0]);
                continue;
            }
            let whole = String::from_utf8_lossy(&std::mem::take(&mut line)).into_owned();
            self.said += &format!("{whole}\n");
            if whole.starts_with(beginning) {
                return whole;
            }
        }
    }

    /// A connection on which a file was asked for.
    fn asked(&self, method: &str, path: &str, host: &str) -> TcpStream {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        write!(stream, "{method} {path} HTTP/1.0\r\nHost: {host}\r\n\r\n").unwrap();
        stream
    }

    /// Status and body of the answer to a request of a file below the secret path.
    pub fn ask(&self, method: &str, path: &str, host: &str) -> (u16, String) {
        self.ask_whole(method, &format!("{}{path}", self.secret), host)
    }

    /// As [`Self::ask`], for a whole path.
    fn ask_whole(&self, method: &str, path: &str, host: &str) -> (u16, String) {
        let mut stream = self.asked(method, path, host);
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
    }

    pub fn get(&self, path: &str) -> (u16, String) {
        self.ask("GET", path, &format!("127.0.0.1:{}", self.port))
    }

    /// The page at `/`, as a browser shows it; none without a browser.
    fn shown(&self, place: &Place) -> Option<String> {
        let (status, page) = self.get("/");
        assert_eq!(status, 200, "{page}");
        rendered(&write_to(place.path("shown.html"), &page), &[])
    }

    /// Address of the page.
    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}{}/", self.port, self.secret)
    }

    pub fn end(mut self) -> String {
        let ran = stop(self.child.take().unwrap(), self.output.take().unwrap(), "-INT");
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "{}", ran.out);
        ran.out
    }
}

/// If this failed, a browser would show no report, or a page from elsewhere could read files of this machine through it.
#[test]
fn a_plan_is_served_to_this_machine_and_nothing_else_is() {
    let place = Place::new();
    place.done("plan ball.ply --views 4 --iterations 5 --out plan");
    place.write("secret.txt", "secret");
    std::os::unix::fs::symlink(place.path("secret.txt"), place.path("plan/link.txt")).unwrap();
    fs::create_dir(place.path("plan/.hid")).unwrap();
    place.write("plan/.hid/key", "secret");
    let served = Served::new(&place, "plan");
    let report = place.read("plan/report.html");
    assert_eq!(served.get("/"), (200, report.clone()));
    assert_eq!(served.get("/report.html?x=1#y"), (200, report.clone()));
    assert_eq!(served.ask("GET", "/", &format!("LocalHost:{}", served.port)), (200, report));
    assert_eq!(served.get("/cameras.csv"), (200, place.read("plan/cameras.csv")));
    for path in [
        "/none",
        "/../secret.txt",
        "/%2e%2e/secret.txt",
        "/..%2fsecret.txt",
        "/link.txt",
        "/.hid/key",
        "/sparse",
        "//etc/passwd",
        "/%00",
    ] {
        let (status, body) = served.get(path);
        assert!(
            (400..500).contains(&status) && !body.contains("secret\n") && body != "secret",
            "{path}: {status} {body}"
        );
    }
    // Whoever does not know the address, such as other users of the machine, gets nothing.
    for path in ["/", "/report.html", "/0000000000000000/report.html", served.secret.as_str()] {
        assert_eq!(served.ask_whole("GET", path, "localhost").0, 404, "{path}");
    }
    assert_eq!(served.ask("GET", "/", "evil.example").0, 403);
    assert_eq!(served.ask("GET", "/", "127.0.0.1.evil.example:80").0, 403);
    assert_eq!(served.ask("POST", "/", "localhost").0, 405);
    served.end();
}

/// If this failed, some clients that do not read, or send nothing, would hold up the page of others, or the end of the server.
#[test]
fn clients_that_stall_hold_up_nobody() {
    let place = Place::new();
    place.done("plan ball.ply --views 3 --iterations 2 --size 32x32 --out plan");
    // More than the buffers of a connection take.
    fs::write(place.path("plan/large.bin"), vec![0u8; 32 << 20]).unwrap();
    let served = Served::new(&place, "plan");
    let large = format!("{}/large.bin", served.secret);
    let unread: Vec<_> = (0..12).map(|_| served.asked("GET", &large, "localhost")).collect();
    let silent: Vec<_> = (0..12).map(|_| TcpStream::connect(("127.0.0.1", served.port)).unwrap()).collect();
    assert_eq!(served.get("/"), (200, place.read("plan/report.html")));
    served.end();
    drop((unread, silent));
}

/// If this failed, one folder that cannot be shown would hide the others, or a name look like something else to the browser.
#[test]
fn a_list_of_runs_has_what_can_be_read_and_says_what_it_lacks() {
    let place = Place::new();
    place.done("plan ball.ply --views 3 --iterations 2 --size 32x32 --out runs/run:1");
    place.write("runs/transforms.json", "{");
    fs::create_dir(place.path("runs/linked")).unwrap();
    std::os::unix::fs::symlink(place.path("runs/run:1/report.html"), place.path("runs/linked/report.html")).unwrap();
    let name = std::os::unix::ffi::OsStrExt::from_bytes(b"no\xfftext");
    fs::create_dir(place.path("runs").join::<&std::ffi::OsStr>(name)).unwrap();
    let served = Served::new(&place, "runs");
    for said in ["the capture here cannot be shown", "1 report below runs", "left out: 1"] {
        assert!(served.said.contains(said), "{}", served.said);
    }
    let (_, list) = served.get("/");
    assert!(list.contains("href=\"run%3A1/report.html\"") && !list.contains("href=\"linked"), "{list}");
    assert_eq!(served.get("/run%3A1/report.html").0, 200);
    // A run that ends later is there when the list is loaded again.
    place.done("plan ball.ply --views 4 --iterations 2 --size 32x32 --out runs/later");
    assert!(served.get("/").1.contains("href=\"later/report.html\""));
    served.end();
}

/// If this failed, a capture or trained splats without a report could not be looked at, or runs beside each other not be found.
#[test]
fn captures_splats_and_runs_have_pages_too() {
    let place = Place::new();
    place.done("plan ball.ply --views 4 --iterations 5 --size 32x32 --out runs/one/plan");
    place.done("plan ball.ply --views 5 --iterations 5 --size 32x32 --out runs/two");
    place.write("splats.ply", io::ply::write::gaussians(&scene(3, 400, 0)));

    let served = Served::new(&place, "runs");
    let (_, list) = served.get("/");
    for link in ["one/plan/report.html", "two/report.html"] {
        assert!(list.contains(&format!("href=\"{link}\"")), "{list}");
        assert_eq!(served.get(&format!("/{link}")), (200, place.read(&format!("runs/{link}"))));
    }
    assert!(list.contains("ball.ply: 4 views") && list.contains("2 reports"), "{list}");
    served.end();

    place.done("render splats.ply runs/two --out runs/two/images");
    fs::remove_file(place.path("runs/two/report.html")).unwrap();
    for (path, views) in [("runs/two", true), ("splats.ply", false)] {
        let served = Served::new(&place, path);
        if let Some(dom) = served.shown(&place) {
            assert!(dom.contains(r#"data-ready="ok""#), "{path}: {dom}");
            assert!(number_after(&dom, "<canvas", "data-drawn").is_some_and(|drawn| drawn > 1000), "{path}");
            assert_eq!(
                dom.matches("<button type=\"button\" data-camera=").count(),
                if views { 5 } else { 0 },
                "{path}"
            );
        }
        served.end();
    }
}

/// If this failed, who asked how many views are worth taking would be refused the answer as no capture.
#[test]
fn a_curve_has_a_page() {
    let place = Place::new();
    place.done("plan ball.ply --curve --iterations 1 --held-out 60 --size 32x32 --out curve");
    let served = Served::new(&place, "curve");
    let (code, page) = served.get("/");
    assert!(code == 200 && page.contains(place.read("curve/curve.svg").trim()), "{page}");
    served.end();
}

/// If this failed, a mistake would open an empty page.
#[test]
fn what_cannot_be_shown_is_refused() {
    let place = Place::new();
    fs::create_dir(place.path("empty")).unwrap();
    let busy = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = busy.local_addr().unwrap().port();
    place.done("plan ball.ply --views 3 --iterations 2 --out plan");
    assert_refused(
        &place,
        &[
            ("view nowhere --no-browser", &["nowhere: ", "no such file or folder", "check the path"]),
            ("view empty --no-browser", &["empty"]),
            ("view ball.ply --no-browser", &["ball.ply"]),
            (&format!("view plan --no-browser --port {taken}"), &["--port", "in use"]),
        ],
    );
}
