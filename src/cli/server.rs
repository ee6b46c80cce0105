//! A web server for this machine's own browser: the files of a folder, and one page that is none of them.

use std::fs::File;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use percent_encoding::percent_decode_str;
use tiny_http::{Header, Method, Request, Response, StatusCode};

use super::session::{self, go_on};
use crate::{Error, Result};

/// Requests that are answered at once: a browser asks for some pictures at a time, and one that stalls must not hold up the others.
const WORKERS: usize = 4;
/// Time between two looks at whether to stop.
const BETWEEN_LOOKS: Duration = Duration::from_millis(100);
/// Names by which a browser on this machine knows it. A page elsewhere whose name is made to point here has another.
const HOSTS: [&str; 2] = ["127.0.0.1", "localhost"];

/// Serves a folder on the loopback address.
pub struct Server {
    http: tiny_http::Server,
    address: SocketAddr,
    /// Whose files are served, without links in its path; none where the page needs none.
    root: Option<PathBuf>,
    /// What is at `/`; else the folder's report.
    page: Option<String>,
}

impl Server {
    /// Listens on a port of the loopback address, 0 for any that is free.
    ///
    /// # Errors
    /// Where the port is taken or the folder cannot be read.
    pub fn bind(port: u16, root: Option<&Path>, page: Option<String>) -> Result<Self> {
        let refused = |e: &dyn std::fmt::Display| {
            Error::request(format!(
                "port {port} of 127.0.0.1 cannot be served: {e}; give another `port`, or leave it out"
            ))
        };
        let http = tiny_http::Server::http((Ipv4Addr::LOCALHOST, port)).map_err(|e| refused(&e))?;
        let address = http.server_addr().to_ip().ok_or_else(|| refused(&"it is no IP address"))?;
        let root = root.map(|root| root.canonicalize().map_err(|source| Error::io(root, source))).transpose()?;
        Ok(Self { http, address, root, page })
    }

    /// Address of the page.
    pub fn url(&self) -> String {
        format!("http://{}/", self.address)
    }

    /// Answers requests until the user stops it.
    pub fn serve(&self) {
        let session = session::current();
        thread::scope(|scope| {
            for _ in 0..WORKERS {
                scope.spawn(|| {
                    session.within(|| {
                        while go_on().is_continue() {
                            if let Ok(Some(request)) = self.http.recv_timeout(BETWEEN_LOOKS) {
                                // A browser that has gone away needs no answer.
                                let _ = self.answer(request);
                            }
                        }
                    });
                });
            }
        });
    }

    fn answer(&self, request: Request) -> io::Result<()> {
        if !is_from_here(&request) {
            return refuse(request, 403, "this server is for the browser on its own machine");
        }
        if !matches!(request.method(), Method::Get | Method::Head) {
            return refuse(request, 405, "files can only be read here");
        }
        let path = request.url().split(['?', '#']).next().unwrap_or_default();
        let path = percent_decode_str(path.trim_start_matches('/')).decode_utf8_lossy().into_owned();
        match (&self.page, path.as_str()) {
            (Some(page), "") => {
                request.respond(with_headers(Response::from_string(page.as_str()), "text/html; charset=utf-8"))
            }
            (None, "") => self.file("report.html", request),
            (_, path) => self.file(path, request),
        }
    }

    /// Answers with a file of the folder, or that there is none. Hidden files are not shown, and links that lead out of the folder not
    /// followed.
    fn file(&self, path: &str, request: Request) -> io::Result<()> {
        let within = |root: &PathBuf| {
            if path.split('/').any(|part| part.starts_with('.')) {
                return None;
            }
            let file = root.join(path).canonicalize().ok()?;
            (file.starts_with(root) && file.is_file()).then_some(file)
        };
        match self.root.as_ref().and_then(within).map(|file| (media_type(&file), File::open(file))) {
            Some((kind, Ok(file))) => request.respond(with_headers(Response::from_file(file), kind)),
            _ => refuse(request, 404, "there is no such file here"),
        }
    }
}

/// Whether a browser on this machine asked for this server by one of its names.
fn is_from_here(request: &Request) -> bool {
    let host = request.headers().iter().find(|header| header.field.equiv("Host"));
    host.is_some_and(|host| {
        let name = host.value.as_str();
        HOSTS.contains(&name.rsplit_once(':').map_or(name, |(name, _)| name))
    })
}

fn refuse(request: Request, code: u16, why: &str) -> io::Result<()> {
    let answer = Response::from_string(format!("{why}\n")).with_status_code(StatusCode(code));
    request.respond(with_headers(answer, "text/plain; charset=utf-8"))
}

/// Adds what a browser is to know: what it gets, that it is not to guess or keep it, and that other pages may not have it.
fn with_headers<R: io::Read>(mut response: Response<R>, kind: &str) -> Response<R> {
    let headers = [
        ("Content-Type", kind),
        ("X-Content-Type-Options", "nosniff"),
        ("Cache-Control", "no-store"),
        ("Cross-Origin-Resource-Policy", "same-origin"),
    ];
    for (name, value) in headers {
        if let Ok(header) = Header::from_bytes(name, value) {
            response.add_header(header);
        }
    }
    response
}

/// The media type of what camsplat writes; a browser saves what it cannot show.
fn media_type(file: &Path) -> &'static str {
    match file.extension().and_then(|extension| extension.to_str()) {
        Some("html") => "text/html; charset=utf-8",
        Some("png") => "image/png",
        Some("jpg" | "jpeg" | "JPG" | "JPEG") => "image/jpeg",
        Some("svg") => "image/svg+xml",
        Some("json") => "application/json",
        Some("csv" | "md" | "txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}
