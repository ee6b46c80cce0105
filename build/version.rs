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
pub fn commit() -> String {
    println!("cargo:rerun-if-env-changed={COMMIT}");
    let given = std::env::var(COMMIT).ok().or_else(packed).or_else(checked_out);
    given.map_or_else(|| "unknown".into(), |commit| commit.chars().take(SHOWN).collect())
}

fn packed() -> Option<String> {
    let text = std::fs::read_to_string(PACKED).ok()?;
    let hash = text.split_once("\"sha1\"")?.1.split('"').nth(1)?;
    Some(hash.to_owned())
}

fn checked_out() -> Option<String> {
    // The source may lie inside another project's checkout.
    if !git(&["rev-parse", "--show-prefix"])?.is_empty() {
        return None;
    }
    let mut files = vec!["HEAD".to_owned(), "packed-refs".to_owned()];
    files.extend(git(&["symbolic-ref", "--quiet", "HEAD"]));
    for file in files {
        // A file that is not there would make every build run again.
        if let Some(path) = git(&["rev-parse", "--git-path", &file]).filter(|path| Path::new(path).exists()) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    git(&["rev-parse", "HEAD"])
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
