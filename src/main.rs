//! The `camsplat` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(camsplat::app::cli::main(std::env::args_os()))
}
