//! `camsplat completions`.

use clap::Args;
use clap_complete::{Shell, generate};

use super::session::Ended;
use crate::Result;

/// Arguments of `camsplat completions`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Shell to write completions for
    #[arg(value_enum)]
    shell: Shell,
}

/// Prints the completions.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let mut text = Vec::new();
    generate(arguments.shell, &mut super::command(), "camsplat", &mut text);
    say!("{}", String::from_utf8_lossy(&text).trim_end());
    Ok(Ended::Done)
}
