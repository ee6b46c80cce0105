//! The page of the benchmark: where each method stands.

use std::fmt::Write as _;

use super::text::escape;
use crate::lab::benchmark::board::Table;

/// What is said of a board that was tried with small pictures.
pub const QUICK: &str = "small pictures and short training (--quick): these figures say nothing of methods";

/// What is said of a board of larger trainings than usual.
pub const FULL: &str = "trainings of --full: 1,000,000 splats around objects and 2,000,000 in rooms, 30,000 iterations";

/// A page of the tables, with a `note` on their trainings.
pub fn html(tables: &[Table], note: Option<&str>) -> String {
    let line = |cells: [String; 6], tag: &str| {
        let cells: String = cells.into_iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(&cell))).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let mut page = String::from(
        "<!DOCTYPE html>\n<html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n\
         <title>camsplat benchmark</title>\n<style>body{font:16px/1.5 sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}\
         table{border-collapse:collapse;width:100%}th,td{text-align:right;padding:.3rem .6rem;border-bottom:1px solid #ccc}\
         th:first-child,td:first-child{text-align:left}</style>\n<h1>Where should the cameras stand?</h1>\n\
         <p>Splats trained on the photos of each method. Differences are on the same scenes, with 95% intervals by scene.</p>\n",
    );
    if let Some(note) = note {
        // Writing to a string cannot fail.
        let _ = writeln!(page, "<p><strong>Note: {note}.</strong></p>");
    }
    for table in tables {
        let rows: String = table.rows().map(|row| line(row, "td")).collect();
        // Writing to a string cannot fail.
        let _ = write!(page, "<h2>{}</h2>\n<table>\n{}{rows}</table>\n", table.title(), line(table.header(), "th"));
    }
    page + "</html>\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::benchmark::Split;
    use crate::lab::benchmark::board::{Reached, tables};

    /// If this failed, a method's name could be taken for HTML.
    #[test]
    fn names_are_text() {
        let [scene, method] = ["a", "<b>&x"].map(str::to_owned);
        let measured = [Some(20.0), None, None];
        let one = Reached { split: Split::Test, room: true, scene, method, views: 50, seeds: 1, diverged: 1, measured };
        let page = html(&tables(&[one]), None);
        assert!(
            page.contains("<td>&lt;b&gt;&amp;x (1 diverged)</td>")
                && page.contains("<h2>Rooms of the test split, 50 views</h2>")
        );
    }
}
