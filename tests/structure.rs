//! The shape of the source: no files that use each other in a circle, layers that look down only, a library that knows no options.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

type Module = Vec<String>;

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Every file of the library by its module path.
fn modules() -> BTreeMap<Module, String> {
    let mut found = BTreeMap::new();
    let mut folders = vec![source()];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let stem = path.strip_prefix(source()).unwrap().with_extension("");
                let mut module: Module = stem.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
                if module.last().is_some_and(|last| last == "mod") || module == ["lib"] {
                    module.pop();
                }
                found.insert(module, fs::read_to_string(&path).unwrap());
            }
        }
    }
    found
}

/// The code of a file: without comments, and without its tests, which are at its end.
fn code(text: &str) -> String {
    let text = text.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    text.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// The paths of a `use` tree: `a::{b, c::{d, e}}` is `a::b`, `a::c::d` and `a::c::e`.
fn paths(tree: &str) -> Vec<String> {
    let Some((before, inner)) = tree.split_once('{') else {
        return vec![tree.split(" as ").next().unwrap_or_default().trim().to_owned()];
    };
    let inner = inner.rsplit_once('}').map_or(inner, |(inner, _)| inner);
    let (mut depth, mut parts) = (0, vec![String::new()]);
    for c in inner.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        match (c, depth) {
            (',', 0) => parts.push(String::new()),
            _ => parts.last_mut().unwrap().push(c),
        }
    }
    let parts = parts.iter().map(|part| part.trim()).filter(|part| !part.is_empty());
    parts.flat_map(|part| paths(&format!("{}{part}", before.trim()))).collect()
}

/// What a file takes from others: in `use` declarations, and by whole paths in its code.
fn taken(text: &str, in_facade: bool) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = String::new();
    let mut declared: Option<String> = None;
    for line in code(text).lines() {
        let trimmed = line.trim();
        let begins = trimmed.starts_with("use ") || trimmed.starts_with("pub") && trimmed.contains(" use ");
        match declared.as_mut() {
            Some(all) => all.push_str(trimmed),
            None if begins => declared = Some(trimmed.to_owned()),
            None => rest = rest + line + "\n",
        }
        if let Some(all) = declared.take_if(|all| all.ends_with(';')) {
            // What a facade re-exports it does not use.
            if !(in_facade && all.starts_with("pub")) {
                let tree = all.split_once("use ").map_or("", |(_, tree)| tree).trim_end_matches(';');
                found.extend(paths(tree));
            }
        }
    }
    let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let inline = rest.split(|c| !is_part(c)).filter(|path| path.starts_with("crate::") || path.starts_with("super::"));
    found.extend(inline.map(str::to_owned));
    found
}

/// Which files each file uses; what a `mod.rs` re-exports counts for the file that it is from.
fn uses() -> BTreeMap<Module, BTreeSet<Module>> {
    let modules = modules();
    let is_facade =
        |module: &Module| modules.keys().any(|other| other.len() > module.len() && other.starts_with(module));
    let mut handed = BTreeMap::new();
    for (module, text) in modules.iter().filter(|(module, _)| is_facade(module)) {
        for line in code(text).split(';').map(str::trim).filter(|line| line.starts_with("pub use ")) {
            for path in paths(line.trim_start_matches("pub use ")) {
                let parts: Vec<&str> = path.split("::").map(str::trim).collect();
                let child: Module = module.iter().cloned().chain([parts[0].to_owned()]).collect();
                if modules.contains_key(&child) {
                    handed.insert((module.clone(), parts[parts.len() - 1].to_owned()), child);
                }
            }
        }
    }
    let resolve = |from: &Module, path: &str| -> Option<Module> {
        let parts: Vec<&str> = path.split("::").map(str::trim).filter(|part| !part.is_empty()).collect();
        let mut base = from.clone();
        let mut left = &parts[..];
        match left.first()? {
            &"crate" => (base, left) = (Module::new(), &left[1..]),
            &"super" | &"self" => {
                while let Some(first @ (&"super" | &"self")) = left.first() {
                    if *first == "super" {
                        base.pop();
                    }
                    left = &left[1..];
                }
            }
            _ => {
                let child: Module = base.iter().cloned().chain([left[0].to_owned()]).collect();
                modules.contains_key(&child).then_some(())?;
            }
        }
        while let Some(next) = left.first() {
            let child: Module = base.iter().cloned().chain([(*next).to_owned()]).collect();
            if !modules.contains_key(&child) {
                break;
            }
            (base, left) = (child, &left[1..]);
        }
        let named = left.first().and_then(|name| handed.get(&(base.clone(), (*name).to_owned())));
        Some(named.cloned().unwrap_or(base))
    };
    let of = |module: &Module, text: &str| -> BTreeSet<Module> {
        let found = taken(text, is_facade(module)).into_iter().filter_map(|path| resolve(module, &path));
        // A folder's `mod.rs` calls its own files, which take its types: together they are one thing to a reader. The root holds
        // the error type and macros for all layers.
        found.filter(|other| !other.starts_with(module) && !other.is_empty() && modules.contains_key(other)).collect()
    };
    modules
        .iter()
        .filter(|(module, _)| !module.is_empty())
        .map(|(module, text)| (module.clone(), of(module, text)))
        .collect()
}

/// Everything that `from` uses, directly or not.
fn reached(uses: &BTreeMap<Module, BTreeSet<Module>>, from: &Module) -> BTreeSet<Module> {
    let mut seen = BTreeSet::new();
    let mut next = vec![from.clone()];
    while let Some(module) = next.pop() {
        for other in uses.get(&module).into_iter().flatten() {
            if seen.insert(other.clone()) {
                next.push(other.clone());
            }
        }
    }
    seen
}

/// If this failed, two files could only be understood together, or neither be changed without the other.
#[test]
fn no_files_use_each_other_in_a_circle() {
    let uses = uses();
    let links: usize = uses.values().map(BTreeSet::len).sum();
    assert!(uses.len() > 200 && links > 800, "only {links} uses of {} files were found", uses.len());
    let circles: Vec<String> =
        uses.keys().filter(|module| reached(&uses, module).contains(*module)).map(|module| module.join("::")).collect();
    assert!(circles.is_empty(), "these files use each other in a circle: {}", circles.join(", "));
}

/// The folders and files, as modules, of each row of ARCHITECTURE.md's table of layers, from the top down.
fn layers() -> Vec<Vec<Module>> {
    let page = fs::read_to_string(source().with_file_name("ARCHITECTURE.md")).unwrap();
    let rows = page.lines().filter(|line| line.starts_with("| ") && line.contains("| `src/"));
    let folders = |row: &str| {
        let cell = row.split('|').nth(2).unwrap();
        let names = cell.split('`').filter_map(|part| part.strip_prefix("src/"));
        names.map(|name| name.trim_end_matches(".rs").split('/').map(str::to_owned).collect()).collect()
    };
    rows.map(folders).collect()
}

/// If this failed, a layer would use one above it, or ARCHITECTURE.md would have them in another order than the code.
#[test]
fn layers_look_down_only() {
    let (uses, layers) = (uses(), layers());
    // A file belongs to the row that names the innermost folder it is in.
    let level = |module: &Module| {
        let length = |layer: &Vec<Module>| {
            layer.iter().filter(|name| module.starts_with(name)).map(|name| name.len()).max().unwrap_or(0)
        };
        let rows = layers.iter().enumerate().map(|(row, layer)| (length(layer), row)).filter(|(length, _)| *length > 0);
        rows.max_by_key(|(length, row)| (*length, usize::MAX - row)).map(|(_, row)| row)
    };
    // The error type belongs to all layers, the binary uses the command line, and a storey's own file says what is in it.
    let is_outside = |module: &Module| {
        ["error", "main"].contains(&module[0].as_str())
            || layers.iter().flatten().any(|name| name.len() > 1 && name[..1] == module[..])
    };
    let mut wrong = BTreeSet::new();
    for (module, others) in uses.iter().filter(|(module, _)| !is_outside(module)) {
        let at = level(module).unwrap_or_else(|| panic!("{} is in no row of the table of layers", module.join("::")));
        for other in others.iter().filter(|other| !is_outside(other)) {
            if level(other).is_none_or(|below| below < at) {
                wrong.insert(format!("{} uses {}", module.join("::"), other.join("::")));
            }
        }
    }
    assert!(layers.len() > 15 && wrong.is_empty(), "{wrong:#?}");
}

/// If this failed, the product could not be had without what it is judged by.
#[test]
fn only_the_program_and_its_reports_use_the_lab() {
    let of_the_program = ["app::cli", "app::report", "lab"];
    for (module, others) in uses() {
        let path = module.join("::");
        let used: Vec<_> = others.iter().filter(|other| other[0] == "lab").collect();
        assert!(used.is_empty() || of_the_program.iter().any(|part| path.starts_with(part)), "{path} uses {used:?}");
    }
}

/// If this failed, errors of the library would name options that it does not have. Settings are in backquotes, and the
/// command line puts its options there.
#[test]
fn the_library_names_no_options() {
    let of_the_program = ["app::cli", "app::report", "lab::evaluate"];
    for (module, text) in modules() {
        if of_the_program.iter().any(|part| module.join("::").starts_with(part)) {
            continue;
        }
        for line in code(&text).lines() {
            let option = line.match_indices("--").find(|(at, _)| {
                let before = line[..*at].chars().next_back();
                before.is_none_or(|c| !c.is_alphanumeric())
                    && line[at + 2..].starts_with(|c: char| c.is_ascii_lowercase())
            });
            // A command line of COLMAP has options of its own.
            let other = line.contains("colmap ");
            assert!(option.is_none() || other, "{}: {line:?} names an option", module.join("::"));
        }
    }
}
