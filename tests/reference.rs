//! The documentation that the program can check: the command reference, and the links between pages.

#[path = "support/command/mod.rs"]
mod command;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

const REFERENCE: &str = "docs/reference/commands.md";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Help of every subcommand as the reference has it.
fn reference() -> String {
    let mut text = String::from(
        "# Commands\n\nGenerated from the program's own help: `CAMSPLAT_WRITE_REFERENCE=1 cargo test --release --test reference`.\n\n",
    );
    let mut program = camsplat::app::cli::command().term_width(100);
    program.build();
    let mut add = |path: &str, command: &clap::Command| {
        let mut command = command.clone().bin_name(path).term_width(100);
        let help = command.render_long_help().to_string();
        let lines = help.lines().map(str::trim_end).collect::<Vec<_>>().join("\n");
        writeln!(text, "## {path}\n\n```text\n{}\n```\n", lines.trim_end()).unwrap();
    };
    for command in program.get_subcommands().filter(|command| command.get_name() != "help") {
        let path = format!("camsplat {}", command.get_name());
        let inner: Vec<_> = command.get_subcommands().filter(|inner| inner.get_name() != "help").collect();
        if inner.is_empty() {
            add(&path, command);
        }
        inner.iter().for_each(|inner| add(&format!("{path} {}", inner.get_name()), inner));
    }
    text.trim_end().to_owned() + "\n"
}

/// If this failed, the reference would promise options that the program does not have, or hide some that it has.
#[test]
fn the_command_reference_is_what_the_program_says_of_itself() {
    check_generated(REFERENCE, &reference());
}

/// Functions of the Python package that take the options of a command, and what they have of these by other names or do without.
const TYPED: [(&str, &[&str]); 6] = [
    ("plan", &["views", "curve", "out", "dry-run"]),
    ("score", &["json"]),
    ("select", &["count", "out"]),
    ("train", &["out", "dry-run"]),
    ("evaluate", &["out", "prepare"]),
    ("next", &["views", "from", "json", "surface"]),
];

/// The type of an option in Python.
fn python_type(arg: &clap::Arg) -> String {
    use std::any::TypeId;
    let name = arg.get_long().unwrap_or_default();
    let kind = arg.get_value_parser().type_id();
    let values: Vec<String> = arg.get_possible_values().iter().map(|value| format!("{:?}", value.get_name())).collect();
    let form = arg.get_value_names().unwrap_or_default().join(" ");
    let one = match form.as_str() {
        _ if !arg.get_action().takes_values() => "bool".into(),
        _ if ["keep", "viewers"].contains(&name) => "Union[File, Cameras, Plan, npt.ArrayLike]".into(),
        _ if name == "surface" && values.is_empty() => "Scene".into(),
        _ if !values.is_empty() => format!("Literal[{}]", values.join(", ")),
        "WxH" => "tuple[int, int]".into(),
        "HEIGHT" => "Union[float, str]".into(),
        _ if kind == TypeId::of::<f64>() || kind == TypeId::of::<f32>() => match arg.get_value_delimiter() {
            Some(_) => return "Numbers".into(),
            None => "float".into(),
        },
        _ if [TypeId::of::<u32>(), TypeId::of::<u64>(), TypeId::of::<usize>()].iter().any(|id| kind == *id) => {
            "int".into()
        }
        _ if kind == TypeId::of::<PathBuf>() => "File".into(),
        form if form.contains(',') => "Numbers".into(),
        _ if ["device", "devices"].contains(&name) => "Union[str, int]".into(),
        _ => "str".into(),
    };
    match arg.get_action() {
        clap::ArgAction::Append => format!("Union[{one}, Sequence[{one}]]"),
        _ => one,
    }
}

/// The options of commands as the Python package has them.
fn python_options() -> String {
    let mut text = String::from(
        r#""""Options of commands as keywords. Generated: `CAMSPLAT_WRITE_REFERENCE=1 cargo test --release --test reference`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, TypedDict, Union

import numpy.typing as npt

if TYPE_CHECKING:
    from ._cameras import Cameras, Scene
    from ._plan import Plan

File = Union[str, os.PathLike[str]]
Numbers = Sequence[float]
"#,
    );
    let program = camsplat::app::cli::command();
    for (command, without) in TYPED {
        let name = format!("{}{}Options", command[..1].to_uppercase(), &command[1..]);
        writeln!(text, "\n\nclass {name}(TypedDict, total=False):\n    \"\"\"Options of `camsplat {command}`.\"\"\"")
            .unwrap();
        for arg in program.find_subcommand(command).unwrap().get_arguments() {
            let Some(long) = arg.get_long().filter(|long| !without.contains(long)) else { continue };
            let help = arg.get_help().unwrap().to_string();
            // The one that is a keyword of Python ends in an underscore.
            let field = if long == "pass" { "pass_".into() } else { long.replace('-', "_") };
            writeln!(text, "\n    {field}: {}\n    \"\"\"{help}\"\"\"", python_type(arg)).unwrap();
        }
    }
    text
}

/// Asserts that a file which is generated is what it would be if it were generated now.
#[track_caller]
fn check_generated(name: &str, generated: &str) {
    let file = root().join(name);
    if std::env::var_os("CAMSPLAT_WRITE_REFERENCE").is_some() {
        fs::write(&file, generated).unwrap();
    }
    let written = fs::read_to_string(&file).unwrap_or_default();
    let differs = written.lines().zip(generated.lines()).find(|(written, generated)| written != generated);
    assert!(
        written == generated,
        "{name} is not what the program's help says, first here: {differs:?}; write it anew with CAMSPLAT_WRITE_REFERENCE=1"
    );
}

/// If this failed, Python's checkers and editors would offer options that the program does not have, or refuse some that it has.
#[test]
fn the_options_of_the_python_package_are_those_of_the_program() {
    check_generated("python/camsplat/_options.py", &python_options());
}

/// Every Markdown page of the repository.
fn pages() -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        ["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].iter().map(|name| root().join(name)).collect();
    let docs = files(Path::new("docs")).into_iter();
    found.extend(docs.filter(|path| path.extension().is_some_and(|extension| extension == "md")));
    found
}

/// The anchors of a page's headings, as Git hosts make them.
fn anchors(text: &str) -> Vec<String> {
    let anchor = |heading: &str| -> String {
        let kept = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    text.lines().filter(|line| line.starts_with('#')).map(anchor).collect()
}

/// If this failed, a reader who follows a link of the documentation would reach a dead end.
#[test]
fn every_link_between_pages_leads_somewhere() {
    let mut followed = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if link.contains("://") || link.contains(char::is_whitespace) {
                continue;
            }
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { page.clone() } else { page.parent().unwrap().join(path) };
            assert!(target.exists(), "{}: {link} is not there", page.display());
            let known = || anchors(&fs::read_to_string(&target).unwrap());
            assert!(anchor.is_empty() || known().iter().any(|known| known == anchor), "{}: {link}", page.display());
            followed += 1;
        }
    }
    assert!(followed > 20, "only {followed} links were found");
}

/// If this failed, the first page that users read would have grown too long to be read.
#[test]
fn the_readme_stays_short_and_lines_stay_narrow() {
    let words = |name: &str| fs::read_to_string(root().join(name)).unwrap().split_whitespace().count();
    for (page, most) in [("README.md", 900), ("ARCHITECTURE.md", 3000)] {
        let words = words(page);
        assert!(words <= most, "{page} has {words} words of {most} at most; move what few readers need to docs");
    }
    for page in pages().iter().filter(|page| !page.starts_with(root().join("docs/results"))) {
        for (number, line) in (1..).zip(fs::read_to_string(page).unwrap().lines()) {
            assert!(line.chars().count() <= 140, "{}:{number} has {} characters", page.display(), line.chars().count());
        }
    }
}

/// If this failed, the man pages or the completions of a shell would be empty or miss a subcommand.
#[test]
fn completions_and_man_pages_name_every_subcommand() {
    let place = command::Place::new();
    let names: Vec<String> = camsplat::app::cli::command().get_subcommands().map(|c| c.get_name().to_owned()).collect();
    assert!(names.len() > 10, "{names:?}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = place.done(&format!("completions {shell}")).out;
        let missing: Vec<_> = names.iter().filter(|name| !script.contains(name.as_str())).collect();
        assert!(missing.is_empty(), "{shell}: {missing:?}");
    }
    place.done("manual --out man");
    let mut pages: Vec<String> = names.iter().map(|name| format!("camsplat-{name}.1")).collect();
    pages.push("camsplat.1".into());
    pages.sort();
    assert_eq!(place.files("man"), pages);
    let page = place.read("man/camsplat-plan.1");
    assert!(page.contains(".TH camsplat-plan") && page.contains("keep\\-out"), "{page}");
    let refused = place.run("manual --out man");
    assert!(refused.code == Some(2) && refused.err.contains("not empty"), "{}", refused.err);
}

/// Private words that readers had to translate, and their replacements.
const PRIVATE: [(&str, &str); 8] = [
    ("came apart", "diverged"),
    ("come apart", "diverge"),
    ("nobody chose", "held-out test views"),
    ("all the way", "the full pipeline"),
    (" told ", "reported, measured"),
    (" tells ", "reports, measures"),
    (" hears ", "receives"),
    ("trained over white", "trained on a white background"),
];

/// If this failed, users would meet words that only we know.
#[test]
fn guides_and_help_use_the_words_of_the_field() {
    let is_read_first = |page: &&PathBuf| {
        page.ends_with("README.md") || page.starts_with(root().join("docs/guide")) || page.ends_with("commands.md")
    };
    for page in pages().iter().filter(is_read_first) {
        let text = fs::read_to_string(page).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
        for (word, instead) in PRIVATE {
            assert!(!text.contains(word), "{}: {word:?} should be {instead:?}", page.display());
        }
    }
}

/// The page that says which plain Rust holds each stage.
const FORMULAS: &str = "docs/internals/formulas.md";

/// What stands in backquotes in a part of a table's row.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// All files under a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() { folders.push(path) } else { found.push(path) }
        }
    }
    found
}

/// All Rust text under a folder.
fn rust(folder: &Path) -> String {
    let sources = files(folder).into_iter().filter(|path| path.extension().is_some_and(|extension| extension == "rs"));
    sources.map(|path| fs::read_to_string(path).unwrap()).collect()
}

/// Whether a text has a function of a name that takes something else than an object: a stage's twin, not a test or what records it.
fn has_twin(text: &str, name: &str) -> bool {
    let starts = |end: &str| {
        text.split(&format!("fn {name}{end}")).skip(1).map(|rest| rest.trim_start().to_owned()).collect::<Vec<_>>()
    };
    let own = starts("(")
        .iter()
        .any(|rest| !rest.starts_with(')') && !rest.starts_with("&self") && !rest.starts_with("&mut self"));
    own || !starts("<").is_empty()
}

/// If this failed, a stage would have been added that nothing compares with what it should compute, or that no host records.
#[test]
fn every_stage_is_held_against_plain_rust() {
    let page = fs::read_to_string(root().join(FORMULAS)).unwrap();
    let rows = page
        .split("## Stages without")
        .nth(1)
        .expect("the table of stages")
        .lines()
        .filter(|line| line.starts_with("| `"));
    let mut elsewhere = Vec::new();
    for row in rows {
        let cells: Vec<_> = row.trim_matches('|').split('|').map(quoted).collect();
        let (stages, function, file) = (&cells[0], &cells[1][0], &cells[2][0]);
        let text = fs::read_to_string(root().join(file)).unwrap_or_default();
        assert!(text.contains(&format!("fn {function}")), "{FORMULAS}: there is no function {function} in {file}");
        elsewhere.extend(stages.iter().cloned());
    }
    let mut found = files(Path::new("shaders/glsl"));
    found.retain(|path| path.extension().is_some_and(|extension| extension == "comp"));
    assert!(found.len() > 50, "only {} stages were found", found.len());
    let names: Vec<_> = found.iter().map(|path| path.file_stem().unwrap().to_str().unwrap()).collect();
    for (name, path) in names.iter().zip(&found) {
        // The folder of the same name.
        let folder = path.parent().unwrap().strip_prefix(root().join("shaders/glsl")).unwrap();
        let source = rust(&Path::new("src").join(folder));
        let declared = ["(", "<", " {", " with"].iter().any(|end| source.contains(&format!("Stage = {name}{end}")));
        assert!(declared, "{name}: no stage! has it");
        let held = elsewhere.iter().any(|stage| stage == name) || has_twin(&source, name);
        assert!(held, "{name}: write its twin, a function of its name, or say in {FORMULAS} what holds it");
    }
    let gone: Vec<_> = elsewhere.iter().filter(|stage| !names.contains(&stage.as_str())).collect();
    assert!(gone.is_empty(), "{FORMULAS} has stages that are not there: {gone:?}");
}

/// If this failed, a newcomer would look for a formula in a file that is not there.
#[test]
fn the_table_of_formulas_names_files_that_exist() {
    let page = fs::read_to_string(root().join(FORMULAS)).unwrap();
    let mut checked = 0;
    let mut storey = String::new();
    for row in page.lines() {
        if row.starts_with("## ") {
            storey = quoted(row).concat();
        }
        if !row.starts_with("| ") {
            continue;
        }
        for name in quoted(row).iter().filter(|name| [".rs", ".comp", ".glsl"].iter().any(|end| name.ends_with(end))) {
            let folders = ["", "src", "shaders/glsl"].map(|folder| root().join(folder));
            let is_there = |folder: &PathBuf| folder.join(name).exists() || folder.join(&storey).join(name).exists();
            assert!(folders.iter().any(is_there), "{FORMULAS}: there is no {name}");
            checked += 1;
        }
    }
    assert!(checked > 100, "only {checked} files were named");
}
