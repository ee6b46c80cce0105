//! The `camsplat` command.

fn main() -> std::process::ExitCode {
    camsplat::cli::main()
}
