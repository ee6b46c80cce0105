//! Constants that GLSL declares by a literal, as Rust constants, so that host and shader cannot disagree.

use std::fmt::Write as _;

/// `const uint TILE = 16;` and the like in a GLSL file, as Rust: integers as they are, floats in double precision.
/// Constants that are computed, and arrays, are left out.
pub fn constants(glsl: &str) -> String {
    let mut rust = String::new();
    for line in glsl.lines() {
        let code = line.split("//").next().unwrap_or_default().trim_end();
        let Some(declared) = code.strip_prefix("const ").and_then(|rest| rest.strip_suffix(';')) else { continue };
        let Some((kind, list)) = declared.split_once(' ') else { continue };
        let kind = match kind {
            "uint" => "u32",
            "int" => "i32",
            "float" => "f64",
            _ => continue,
        };
        for (name, value) in list.split(',').filter_map(|part| part.split_once('=')) {
            let (name, value) = (name.trim(), value.trim());
            if is_literal(value, kind) {
                let _ = writeln!(rust, "pub const {name}: {kind} = {};", value.trim_end_matches('u'));
            }
        }
    }
    rust
}

fn is_literal(value: &str, kind: &str) -> bool {
    match kind {
        "f64" => value.parse::<f64>().is_ok(),
        _ => match value.trim_end_matches('u').strip_prefix("0x") {
            Some(digits) => u32::from_str_radix(digits, 16).is_ok(),
            None => value.trim_end_matches('u').parse::<i64>().is_ok(),
        },
    }
}
