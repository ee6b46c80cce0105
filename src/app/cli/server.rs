//! A web server for browsers on this machine, or on the local network: a page, what it asks for, and the files of a folder.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use percent_encoding::percent_decode_str;

use super::session::go_on;
use crate::{Error, Result};

/// Connections that are answered at once, of all and of one other machine. Browsers keep some open without a request.
const CONNECTIONS: usize = 64;
const OF_ONE: usize = 16;
/// Time between two looks at whether someone connects, and whether to stop.
const BETWEEN_LOOKS: Duration = Duration::from_millis(10);
/// How long a request may take to arrive, and the reader of an answer to take more of it.
const PATIENCE: Duration = Duration::from_secs(10);
/// Bytes of a request's head, at most.
const MAX_HEAD: usize = 16_384;
/// Headers of a request, at most.
const MAX_HEADERS: usize = 100;
/// Names by which a browser on this machine knows it. A page elsewhere whose name is made to point here has another.
const HOSTS: [&str; 2] = ["127.0.0.1", "localhost"];
/// An address that no machine has (RFC 5737), by which the one is found that this machine has among others.
const OTHERS: Ipv4Addr = Ipv4Addr::new(192, 0, 2, 1);
/// What a browser is to know of every answer: that it is not to guess or keep it, that other pages may not have it, and that nothing
/// of it, which may be written by others, is to be sent anywhere, the secret path in its address least of all.
const HEADERS: &str = "X-Content-Type-Options: nosniff\r\nCache-Control: no-store\r\nCross-Origin-Resource-Policy: same-origin\r\n\
    Referrer-Policy: no-referrer\r\nConnection: close\r\n";

/// Makes what is at a path below the secret one, each time that it is asked for: the page at the empty one; none where there is nothing.
pub type Site = Box<dyn Fn(&str) -> Option<Result<Served>> + Send + Sync>;

/// What a [`Site`] has at a path.
pub enum Served {
    /// A page.
    Html(String),
    /// Data that the page asks for.
    Json(String),
}

/// Who can connect, and what pages may do.
#[derive(Clone, Copy, Debug, Default)]
pub struct Access {
    /// Port, 0 for any that is free.
    pub port: u16,
    /// Whether other machines of the local network can connect.
    pub shared: bool,
    /// Whether the page may ask this server for more: not one that shows what others have written.
    pub asks: bool,
}

/// Serves a page and a folder below a path that nobody else can guess: other users of the machine can connect too.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    shown: Arc<Shown>,
}

/// Connections that are open, by the machine at their other end; each holds its count as long as it is.
#[derive(Default)]
struct Open(HashMap<IpAddr, Arc<()>>);

impl Open {
    fn count(&mut self) -> usize {
        self.0.retain(|_, held| Arc::strong_count(held) > 1);
        self.0.values().map(|held| Arc::strong_count(held) - 1).sum()
    }

    /// Counts one more; none where another machine has as many as one may have.
    fn hold(&mut self, peer: IpAddr) -> Option<Arc<()>> {
        let held = self.0.entry(peer).or_default();
        (peer.is_loopback() || Arc::strong_count(held) <= OF_ONE).then(|| Arc::clone(held))
    }
}

struct Shown {
    /// First part of every path.
    secret: String,
    access: Access,
    site: Site,
    /// Whose files are served, without links in its path; none where the page needs none.
    root: Option<PathBuf>,
}

/// A request as far as it matters here.
struct HttpRequest {
    method: String,
    path: String,
    host: Option<String>,
}

/// An answer: status, media type, length and bytes.
struct Answer {
    status: &'static str,
    kind: &'static str,
    length: u64,
    body: Box<dyn Read>,
}

impl Server {
    /// Listens on a port of the loopback address, or of all where it is shared.
    ///
    /// # Errors
    /// Where the port is taken, the folder cannot be read or the system gives no random numbers.
    pub fn bind(access: Access, root: Option<&Path>, site: Site) -> Result<Self> {
        let Access { port, shared, .. } = access;
        let host = if shared { Ipv4Addr::UNSPECIFIED } else { Ipv4Addr::LOCALHOST };
        let refused = |e: io::Error| {
            Error::request(format!("port {port} of {host} cannot be served: {e}; give another `port`, or leave it out"))
        };
        let listener = TcpListener::bind((host, port)).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let random = |e| Error::request(format!("the system gives no random numbers for the address: {e}"));
        let secret = format!("{:016x}", getrandom::u64().map_err(random)?);
        let root = root.map(|root| root.canonicalize().map_err(|source| Error::io(root, source))).transpose()?;
        Ok(Self { listener, address, shown: Arc::new(Shown { secret, access, site, root }) })
    }

    /// Address of the page for a browser on this machine.
    pub fn url(&self) -> String {
        self.url_at(Ipv4Addr::LOCALHOST)
    }

    /// Address of the page for other machines of the local network; none where it is not shared, or there is no network.
    pub fn shared_url(&self) -> Option<String> {
        // Which of its addresses this machine would send from to others; nothing is sent.
        let socket = self.shown.access.shared.then(|| UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)))?.ok()?;
        socket.connect((OTHERS, 9)).ok()?;
        match socket.local_addr().ok()?.ip() {
            IpAddr::V4(address) if !address.is_loopback() => Some(self.url_at(address)),
            _ => None,
        }
    }

    fn url_at(&self, address: Ipv4Addr) -> String {
        format!("http://{address}:{}/{}/", self.address.port(), self.shown.secret)
    }

    /// Answers requests until the user stops it; a client that does not read its answer holds up neither the others nor the end.
    pub fn serve(&self) {
        let mut open = Open::default();
        while go_on().is_continue() {
            // Those beyond the limit wait with the system.
            let accepted = (open.count() < CONNECTIONS).then(|| self.listener.accept());
            if let Some(Ok((stream, peer))) = accepted {
                // One machine that keeps connections open does not keep others out.
                let Some(held) = open.hold(peer.ip()) else { continue };
                let shown = Arc::clone(&self.shown);
                // One that has gone away needs no answer; where the system has no thread left, closing is all that can be done.
                let _ = thread::Builder::new().spawn(move || {
                    let _ = shown.answer(stream);
                    drop(held);
                });
            } else {
                // Nobody connects now, or the system has no descriptor left now.
                thread::sleep(BETWEEN_LOOKS);
            }
        }
    }
}

impl Shown {
    fn answer(&self, mut stream: TcpStream) -> io::Result<()> {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let Some(request) = read_request(&mut stream)? else { return Ok(()) };
        let Answer { status, kind, length, body } = self.answer_to(&request);
        let asks = if self.access.asks { "'self'" } else { "'none'" };
        write!(
            stream,
            "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{HEADERS}Content-Security-Policy: \
             connect-src {asks}; form-action 'none'; base-uri 'none'; frame-ancestors 'none'\r\n\r\n"
        )?;
        if request.method != "HEAD" {
            io::copy(&mut body.take(length), &mut stream)?;
        }
        stream.flush()
    }

    fn answer_to(&self, request: &HttpRequest) -> Answer {
        if !request.host.as_deref().is_some_and(|host| is_ours(host, self.access.shared)) {
            return Answer::text("403 Forbidden", "this server is for the browser on its own machine");
        }
        if !matches!(request.method.as_str(), "GET" | "HEAD") {
            return Answer::text("405 Method Not Allowed", "files can only be read here");
        }
        let path = request.path.split(['?', '#']).next().unwrap_or_default();
        let Some(path) = path.strip_prefix('/').and_then(|path| path.strip_prefix(self.secret.as_str())) else {
            return Answer::text("404 Not Found", "open the whole address that camsplat printed");
        };
        match percent_decode_str(path).decode_utf8_lossy().strip_prefix('/') {
            Some(path) => match (self.site)(path) {
                Some(Ok(Served::Html(page))) => Answer::of("200 OK", "text/html; charset=utf-8", page),
                Some(Ok(Served::Json(data))) => Answer::of("200 OK", "application/json", data),
                Some(Err(error)) => Answer::text("500 Internal Server Error", &error.to_string()),
                None => self.file(path).unwrap_or_else(|| Answer::text("404 Not Found", "there is no such file here")),
            },
            None => Answer::text("404 Not Found", "the address ends in a slash"),
        }
    }

    /// A file of the folder, if there is one. Hidden files are not shown, and links that lead out of the folder not followed.
    fn file(&self, path: &str) -> Option<Answer> {
        let root = self.root.as_ref()?;
        if path.split('/').any(|part| part.starts_with('.')) {
            return None;
        }
        let path = root.join(path).canonicalize().ok()?;
        if !path.starts_with(root) || !fs::metadata(&path).ok()?.is_file() {
            return None;
        }
        let file = File::open(&path).ok()?;
        let length = file.metadata().ok()?.len();
        Some(Answer { status: "200 OK", kind: media_type(&path), length, body: Box::new(file) })
    }
}

impl Answer {
    fn of(status: &'static str, kind: &'static str, body: String) -> Self {
        Self { status, kind, length: body.len() as u64, body: Box::new(io::Cursor::new(body)) }
    }

    fn text(status: &'static str, why: &str) -> Self {
        Self::of(status, "text/plain; charset=utf-8", format!("{why}\n"))
    }
}

/// Reads a request's head; none where there is none, or what came is no request.
fn read_request(stream: &mut impl Read) -> io::Result<Option<HttpRequest>> {
    let deadline = Instant::now() + PATIENCE;
    let (mut head, mut part) = (Vec::new(), [0; 4096]);
    while head.len() < MAX_HEAD && Instant::now() < deadline {
        let count = stream.read(&mut part)?;
        if count == 0 {
            break;
        }
        head.extend_from_slice(&part[..count]);
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut parsed = httparse::Request::new(&mut headers);
        match parsed.parse(&head) {
            Ok(httparse::Status::Partial) => {}
            Ok(httparse::Status::Complete(_)) => {
                let host = parsed.headers.iter().find(|header| header.name.eq_ignore_ascii_case("host"));
                return Ok(Some(HttpRequest {
                    method: parsed.method.unwrap_or_default().to_owned(),
                    path: parsed.path.unwrap_or_default().to_owned(),
                    host: host.map(|host| String::from_utf8_lossy(host.value).into_owned()),
                }));
            }
            Err(_) => break,
        }
    }
    Ok(None)
}

/// Whether a request's Host is one of this server's names, with a port or without; where it is shared, also an address in numbers, which no
/// page elsewhere can make its own.
fn is_ours(host: &str, shared: bool) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    HOSTS.iter().any(|ours| ours.eq_ignore_ascii_case(name)) || shared && name.parse::<Ipv4Addr>().is_ok()
}

/// The media type of what camsplat writes; a browser saves what it cannot show.
fn media_type(file: &Path) -> &'static str {
    let extension = file.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("html") => "text/html; charset=utf-8",
        Some("png") => "image/png",
        Some("jpg" | "jpeg") => "image/jpeg",
        Some("svg") => "image/svg+xml",
        Some("json") => "application/json",
        Some("csv" | "md" | "txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, one machine in the network could keep all others from the page, or a browser of this machine be refused.
    #[test]
    fn one_machine_does_not_take_all_connections() {
        let mut open = Open::default();
        let (phone, tablet) = (IpAddr::from([192, 0, 2, 7]), IpAddr::from([192, 0, 2, 8]));
        let mut held: Vec<_> = (0..OF_ONE + 5).filter_map(|_| open.hold(phone)).collect();
        assert_eq!((held.len(), open.count()), (OF_ONE, OF_ONE));
        held.extend(open.hold(tablet));
        held.extend((0..2 * OF_ONE).filter_map(|_| open.hold(Ipv4Addr::LOCALHOST.into())));
        assert_eq!(open.count(), 3 * OF_ONE + 1);
        drop(held.drain(..OF_ONE));
        assert!(open.count() == 2 * OF_ONE + 1 && open.hold(phone).is_some());
    }
}
