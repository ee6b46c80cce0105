//! Whether options name places, which holds in the frame that a scene has alone.

use super::region::{LimitOptions, RegionOptions, SpaceOption, WallOption};
use super::subject::SubjectOption;
use crate::planner::quality::viewers::Viewers;

/// Whether region or viewers are given by places or directions of the scene.
pub fn places(region: &RegionOptions, viewers: &Viewers) -> bool {
    let LimitOptions { keep_out, wall, walk, .. } = &region.limits;
    let walls = wall.iter().any(|wall| matches!(wall, WallOption::At(_)));
    let space = matches!(region.space, Some(SpaceOption::File(_)));
    let subject = matches!(region.subject, Some(SubjectOption::Box(..) | SubjectOption::File(_)));
    let limited = !keep_out.is_empty() || walk.is_some() || walls || space || subject;
    let shaped = region.up.is_some() || region.box_.is_some() || region.shell.is_some();
    limited || shaped || !matches!(viewers, Viewers::Region | Viewers::Heights { .. })
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::super::viewers::ViewerOptions;
    use super::*;

    #[derive(clap::Parser)]
    struct Watching {
        #[command(flatten)]
        region: RegionOptions,
        #[command(flatten)]
        viewers: ViewerOptions,
    }

    /// If this failed, a place that the user named in COLMAP's frame would be sought in another, or `--wall none` would leave a room aslant.
    #[test]
    fn options_that_name_places_are_known() {
        let named = |options: &str| {
            let words = std::iter::once("watch").chain(options.split_whitespace());
            let Watching { region, viewers } =
                Watching::try_parse_from(words).unwrap_or_else(|e| panic!("{options}: {e}"));
            places(&region, &viewers.viewers().unwrap())
        };
        for options in [
            "--box 0,0,0,1,1,1",
            "--shell 0,0,0,1,2",
            "--up +z",
            "--wall 0,0,0,1,0,0",
            "--keep-out boxes.json",
            "--walk 0,0,0,0.3,1.8",
            "--space plan.json",
            "--subject 0,0,0,1,1,1",
            "--viewers cone:60,1,0,0",
        ] {
            assert!(named(options), "{options}");
        }
        for options in [
            "",
            "--preset room",
            "--heights 0.4,2",
            "--wall none",
            "--space known",
            "--subject largest",
            "--viewers heights:1,2",
        ] {
            assert!(!named(options), "{options}");
        }
    }
}
