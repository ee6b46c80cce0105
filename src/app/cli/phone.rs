//! The page of `camsplat watch`, for browsers on this machine and phones in its network.

use std::sync::Arc;

use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;

use super::server::{Access, Served, Server};
use crate::Result;
use crate::app::watch::board::{PAGE, Shared};

/// Serves the page of `board` to who has `access`, says where it is, and opens it where `browser` says so.
///
/// # Errors
/// As [`Server::bind`].
pub fn serve(board: Arc<Shared>, access: Access, browser: bool) -> Result<Server> {
    let site = move |path: &str| match path {
        "" => Some(Ok(Served::Html(PAGE.into()))),
        _ => {
            // By the version that the page has; a negative one is none.
            let had: i64 = path.strip_prefix("board/")?.parse().ok()?;
            Some(board.json(u64::try_from(had).ok()).map(Served::Json))
        }
    };
    let server = Server::bind(access, None, Box::new(site))?;
    let url = server.url();
    say!("page     {url}, until Ctrl-C");
    match server.shared_url() {
        Some(shared) => {
            say!("phone    {shared}: whoever has this address in your network can see the photos and change nothing");
            if let Ok(code) = QrCode::new(&shared) {
                say!("{}", code.render::<Dense1x2>().quiet_zone(true).build());
            }
        }
        None if access.shared => say!("note     no local network was found; the page is for this machine alone"),
        None => {}
    }
    if browser && open::that_detached(&url).is_err() {
        say!("note     no browser could be opened; open the address in one");
    }
    Ok(server)
}
