//! What a build is made of: the commit of its source, and a hash of its compiled shaders.

use std::path::Path;
use std::process::Command;

/// Overrides the commit, for packagers who build outside a checkout.
const COMMIT: &str = "CAMSPLAT_COMMIT";
/// What `cargo package` leaves in the source that it packs.
const PACKED: &str = ".cargo_vcs_info.json";
/// Characters of a commit that are shown.
const SHOWN: usize = 12;

/// The commit that the source is at, shortened: that of the environment, of the packed source, or of the checkout; "unknown" elsewhere.
/// A plus after the checkout's marks files that had been changed when the build script ran last, which is whenever shaders or the commit
/// change.
pub fn commit() -> String {
    println!("cargo:rerun-if-env-changed={COMMIT}");
    let given = std::env::var(COMMIT).ok().filter(|commit| !commit.is_empty()).or_else(packed).or_else(checked_out);
    given.unwrap_or_else(|| "unknown".into())
}

fn packed() -> Option<String> {
    let text = std::fs::read_to_string(PACKED).ok()?;
    let hash = text.split_once("\"sha1\"")?.1.split('"').nth(1)?;
    Some(shortened(hash))
}

fn checked_out() -> Option<String> {
    // The source may lie inside another project's checkout.
    if !git(&["rev-parse", "--show-prefix"])?.is_empty() {
        return None;
    }
    // The log of HEAD grows with every commit and checkout, wherever git keeps the branch itself.
    for file in ["HEAD", "logs/HEAD"] {
        // A file that is not there would make every build run again.
        if let Some(path) = git(&["rev-parse", "--git-path", file]).filter(|path| Path::new(path).exists()) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    let changed = !git(&["status", "--porcelain", "--untracked-files=no"])?.is_empty();
    Some(shortened(&git(&["rev-parse", "HEAD"])?) + if changed { "+" } else { "" })
}

fn shortened(commit: &str) -> String {
    commit.chars().take(SHOWN).collect()
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}

/// The 64-bit FNV-1a hash (Fowler, Noll and Vo) of `bytes` after what was hashed before.
pub fn fnv1a(before: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(before, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

/// [`fnv1a`] of nothing.
pub const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
