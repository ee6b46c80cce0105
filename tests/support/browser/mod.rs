//! Pages opened in a real browser where there is one. They stay in the tests' folder under the target directory, to be looked
//! at.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Writes a page to this test's folder.
pub fn write(name: &str, page: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report");
    std::fs::create_dir_all(&folder).unwrap();
    write_to(folder.join(format!("{name}.html")), page)
}

/// Writes a page to a file. Frames are drawn by timers there: the browser's virtual time waits for timers, while under load it
/// may be over before the first animation frame has come.
pub fn write_to(path: PathBuf, page: &str) -> PathBuf {
    let frames = "<head><script>window.requestAnimationFrame = (draw) => setTimeout(draw, 0);</script>";
    std::fs::write(&path, page.replacen("<head>", frames, 1)).unwrap();
    path
}

/// The page's document after its scripts have run, or `None` (and a word on it) without a browser. The console must be empty.
pub fn rendered(page: &Path, flags: &[&str]) -> Option<String> {
    rendered_at(&format!("file://{}", page.display()), flags)
}

/// The same of the page at an address.
pub fn rendered_at(address: &str, flags: &[&str]) -> Option<String> {
    let profile = tempfile::tempdir().unwrap();
    for browser in ["chromium", "chromium-browser", "google-chrome"] {
        let output = Command::new(browser)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .args(["--enable-unsafe-swiftshader", "--virtual-time-budget=5000", "--window-size=1400,2400"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .args(flags)
            .args(["--enable-logging=stderr", "--dump-dom"])
            .arg(address)
            .output();
        if let Ok(output) = output {
            let dom = String::from_utf8_lossy(&output.stdout).into_owned();
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(dom.contains("</html>"), "{browser} gave no document: {said}");
            // A software driver complains of the 3D view's speed there.
            let logged = |line: &&str| line.contains(":CONSOLE") && !line.contains("GL Driver Message");
            let console: Vec<&str> = said.lines().filter(logged).collect();
            assert!(console.is_empty(), "{address}: {console:#?}");
            return Some(dom);
        }
    }
    println!("skipped: no Chromium");
    None
}

/// The page with a script that runs once the page has been drawn; `pixels(canvas)` there is what a canvas shows, as one text.
pub fn acting(page: &str, script: &str) -> String {
    let pixels = "const pixels = (canvas) => { const shown = document.createElement('canvas'); \
        [shown.width, shown.height] = [canvas.width, canvas.height]; const pen = shown.getContext('2d'); \
        pen.drawImage(canvas, 0, 0); return pen.getImageData(0, 0, canvas.width, canvas.height).data.join(); };";
    page.replace("</body>", &format!("<script>setTimeout(() => {{ {pixels} {script} }}, 200);</script></body>"))
}

/// The number in `name="..."`, looked for after `anchor`.
pub fn number_after(dom: &str, anchor: &str, name: &str) -> Option<u64> {
    let rest = &dom[dom.find(anchor)?..];
    let rest = &rest[rest.find(&format!("{name}=\""))? + name.len() + 2..];
    rest[..rest.find('"')?].parse().ok()
}

/// The part of the document that holds a plot.
pub fn figure<'a>(dom: &'a str, plot: &str) -> &'a str {
    let figure = &dom[dom.find(&format!(r#"id="{plot}""#)).unwrap()..];
    &figure[..figure.find("</figure>").unwrap()]
}
