//! `camsplat manual`.

use std::path::PathBuf;

use clap::Args;
use clap_mangen::Man;

use super::session::Ended;
use crate::files::io::folder::OutputFolder;
use crate::{Error, Result};

/// Arguments of `camsplat manual`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Folder to write
    #[arg(long)]
    out: PathBuf,
    /// Write into a folder that is not empty; files of the same names are replaced, all others stay
    #[arg(long)]
    force: bool,
}

/// Writes a man page for the program and each of its subcommands.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let folder = OutputFolder::create(&arguments.out, arguments.force)?;
    let program = super::command();
    let pages = program.get_subcommands().map(|command| {
        let name = format!("camsplat-{}", command.get_name());
        command.clone().name(name.clone()).display_name(name)
    });
    for command in std::iter::once(program.clone()).chain(pages) {
        let name = format!("{}.1", command.get_name());
        let mut page = Vec::new();
        Man::new(command.version(env!("CARGO_PKG_VERSION")))
            .render(&mut page)
            .map_err(|source| Error::io(folder.path().join(&name), source))?;
        folder.write(&name, page)?;
    }
    folder.commit()?;
    say!("written  {}", arguments.out.display());
    Ok(Ended::Done)
}
