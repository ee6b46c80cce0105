//! The command line: one file per subcommand, each parses, calls and prints.

/// Runs the command line and says how it ended.
pub fn main() -> std::process::ExitCode {
    std::process::ExitCode::SUCCESS
}
