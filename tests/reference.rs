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
    let mut program = camsplat::cli::command().term_width(100);
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
    let file = root().join(REFERENCE);
    let said = reference();
    if std::env::var_os("CAMSPLAT_WRITE_REFERENCE").is_some() {
        fs::write(&file, &said).unwrap();
    }
    let written = fs::read_to_string(&file).unwrap();
    let differs = written.lines().zip(said.lines()).find(|(written, said)| written != said);
    assert!(
        written == said,
        "{REFERENCE} is not what --help says, first here: {differs:?}; write it anew with CAMSPLAT_WRITE_REFERENCE=1"
    );
}

/// Every Markdown page of the repository.
fn pages() -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        ["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].iter().map(|name| root().join(name)).collect();
    let mut folders = vec![root().join("docs")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                found.push(path);
            }
        }
    }
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
    assert!(words("README.md") <= 900, "README.md has {} words", words("README.md"));
    assert!(words("ARCHITECTURE.md") <= 3000, "ARCHITECTURE.md has {} words", words("ARCHITECTURE.md"));
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
    let names: Vec<String> = camsplat::cli::command().get_subcommands().map(|c| c.get_name().to_owned()).collect();
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

/// Stages whose twin in plain Rust has another name: how their names begin, the twin's file, and its name there.
const TWINS: [(&str, &str, &str); 24] = [
    ("bin_", "src/plan/dense.rs", "fn dense("),
    ("check_depth", "src/stereo/consistency.rs", "fn check("),
    ("copy_words", "tests/engine/primitives_copy.rs", "fn whole_vectors_are_copied_and_nothing_behind_them"),
    ("cover_weigh", "tests/engine/gaussian_fisher.rs", "fn what_is_not_covered_agrees_with_the_definition"),
    ("density_", "tests/engine/training.rs", "fn a_small_scene_is_learnt"),
    ("first_hit", "tests/engine/photograph.rs", "fn the_middle_of_a_pixel_is_where_the_surface_is"),
    ("fisher_", "src/gaussians/twin/fisher.rs", "fn information("),
    ("mcmc_split", "src/gaussians/twin/optimise.rs", "fn split("),
    ("mcmc_copy", "tests/engine/training.rs", "fn relocated_splats_look_as_their_source_did"),
    ("mcmc_", "src/gaussians/twin/optimise.rs", "fn draws("),
    ("noise_spread", "tests/engine/manifold.rs", "fn the_spread_is_the_variance_of_perturbed_pictures"),
    ("noise_", "src/gaussians/uncertainty/manifold.rs", "fn perturbation("),
    ("photo_", "src/gaussians/twin/loss.rs", "fn ssim("),
    ("plane_sweep", "src/stereo/cost.rs", "fn cost("),
    ("radix_", "src/primitives/twin.rs", "fn radix_sort("),
    ("refine_depth", "src/stereo/cost.rs", "fn cost("),
    ("relocate", "tests/engine/relocation.rs", "fn the_least_useful_are_relocated_and_only_into_the_region"),
    ("scan_", "src/primitives/twin.rs", "fn scan("),
    ("snapshot", "tests/engine/planner.rs", "fn a_plan_is_better_than_its_start"),
    ("splat_update", "src/gaussians/twin/optimise.rs", "fn adam("),
    ("splat_project", "src/gaussians/twin/project.rs", "fn project("),
    ("splat_", "src/gaussians/twin/composite.rs", "fn forward("),
    ("update_", "src/plan/update.rs", "fn update("),
    ("train_tally", "tests/engine/training.rs", "fn a_loss_that_is_no_number_ends_the_run"),
];

/// If this failed, a stage would have been added that nothing compares with what it should compute.
#[test]
fn every_stage_is_held_against_plain_rust() {
    let rust = |folder: &str| {
        let mut text = String::new();
        let mut folders = vec![root().join(folder)];
        while let Some(folder) = folders.pop() {
            for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
                match path.extension() {
                    _ if path.is_dir() => folders.push(path),
                    Some(extension) if extension == "rs" => text += &fs::read_to_string(&path).unwrap(),
                    _ => {}
                }
            }
        }
        text
    };
    let text = rust("src") + &rust("tests");
    let mut stages = Vec::new();
    for layer in fs::read_dir(root().join("shaders/glsl")).unwrap().map(|entry| entry.unwrap().path()) {
        let files = fs::read_dir(&layer).unwrap().map(|entry| entry.unwrap().path());
        stages.extend(files.filter(|path| path.extension().is_some_and(|extension| extension == "comp")));
    }
    assert!(stages.len() > 50, "only {} stages were found", stages.len());
    for stage in stages {
        let name = stage.file_stem().unwrap().to_str().unwrap();
        let own = ["(", "<"].iter().any(|end| text.contains(&format!("fn {name}{end}")));
        let elsewhere = TWINS.iter().find(|(start, ..)| name.starts_with(start));
        let holds =
            |file: &str, what: &str| fs::read_to_string(root().join(file)).is_ok_and(|text| text.contains(what));
        let held = elsewhere.is_some_and(|(_, file, what)| holds(file, what));
        assert!(own || held, "{name}: write its twin, a function of its name, or say in TWINS what holds it");
    }
}
