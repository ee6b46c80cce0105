//! A mission held against the one that would be written now: all that it says there is said in the same way. What an app adds is passed over,
//! unless it is one more of something that there is.

use std::io::{Cursor, Read as _};

use roxmltree::Node;
use serde_json::Value;
use zip::ZipArchive;

use super::Format;
use super::litchi::cells;
use crate::files::io::xml;

/// By how much numbers may differ: headings, which DJI has in whole degrees, and others.
const OFF_HEADING: f64 = 0.51;
const OFF: f64 = 0.051;

/// What a file says otherwise than the one that would be written.
///
/// # Errors
/// In words, where one cannot be read.
pub fn differences(format: Format, wanted: &[u8], found: &[u8]) -> Result<Vec<String>, String> {
    let mut all = Vec::new();
    match format {
        Format::Dji => {
            for name in ["wpmz/template.kml", "wpmz/waylines.wpml"] {
                let (wanted, found) = (unpacked(wanted, name)?, unpacked(found, name)?);
                let [wanted, found] = [&wanted, &found].map(|text| xml::document(text));
                elements(name, wanted?.root_element(), found?.root_element(), &mut all);
            }
        }
        Format::Qgc => {
            let [wanted, found] =
                [wanted, found].map(|bytes| serde_json::from_slice::<Value>(bytes).map_err(|e| e.to_string()));
            values("", &wanted?, &found?, &mut all);
        }
        Format::Litchi => {
            let [wanted, found] = [wanted, found].map(String::from_utf8_lossy);
            let ((names, wanted), (their_names, found)) = (cells(&wanted), cells(&found));
            for (i, (wanted, found)) in wanted.iter().zip(&found).enumerate() {
                for (name, wanted) in names.iter().zip(wanted) {
                    let at = their_names.iter().position(|of| of == name);
                    let found = at.and_then(|at| found.get(at)).map_or("nothing", String::as_str);
                    compare(&format!("line {}, {name}", i + 2), wanted, found, &mut all);
                }
            }
        }
        Format::Ros | Format::Glb | Format::Blender | Format::Usd | Format::Kml | Format::Geojson => {}
    }
    Ok(all)
}

/// The text of a file in an archive.
pub fn unpacked(bytes: &[u8], name: &str) -> Result<String, String> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|e| format!("it is no archive: {e}"))?;
    let mut text = String::new();
    let mut packed = archive.by_name(name).map_err(|e| format!("{name}: {e}"))?;
    packed.read_to_string(&mut text).map_err(|e| format!("{name}: {e}"))?;
    Ok(text)
}

/// Compares texts, as lists of numbers where they are such.
fn compare(at: &str, wanted: &str, found: &str, all: &mut Vec<String>) {
    let numbers = |text: &str| text.split(',').map(|number| number.trim().parse().ok()).collect::<Option<Vec<f64>>>();
    let off = if at.contains("eading") { OFF_HEADING } else { OFF };
    let alike = match (numbers(wanted), numbers(found)) {
        // Places may have an altitude more, which counts for nothing.
        (Some(wanted), Some(found)) => {
            found.len() >= wanted.len() && wanted.iter().zip(&found).all(|(a, b)| (a - b).abs() <= off)
        }
        _ => wanted.trim() == found.trim(),
    };
    if !alike {
        all.push(format!("{at} is {}, not {}", found.trim(), wanted.trim()));
    }
}

fn elements(at: &str, wanted: Node<'_, '_>, found: Node<'_, '_>, all: &mut Vec<String>) {
    let text = |node: Node<'_, '_>| node.text().unwrap_or_default().to_owned();
    let mut names: Vec<&str> = Vec::new();
    for child in wanted.children().filter(Node::is_element).map(|child| child.tag_name().name()) {
        if !names.contains(&child) {
            names.push(child);
        }
    }
    if names.is_empty() {
        return compare(at, &text(wanted), &text(found), all);
    }
    for name in names {
        let of =
            |node: Node<'_, '_>| -> usize { node.children().filter(|child| child.tag_name().name() == name).count() };
        let (count, there) = (of(wanted), of(found));
        if count != there {
            all.push(format!("{at} has {there} of {name}, not {count}"));
            continue;
        }
        let [wanted, found] =
            [wanted, found].map(|node| node.children().filter(|child| child.tag_name().name() == name));
        for (i, (wanted, found)) in wanted.zip(found).enumerate() {
            let at = if count > 1 { format!("{name} {i}") } else { format!("{at}/{name}") };
            elements(&at, wanted, found, all);
        }
    }
}

fn values(at: &str, wanted: &Value, found: &Value, all: &mut Vec<String>) {
    match (wanted, found) {
        (Value::Object(wanted), Value::Object(found)) => {
            for (name, value) in wanted {
                values(&format!("{at}/{name}"), value, found.get(name).unwrap_or(&Value::Null), all);
            }
            // Every word there bars or allows something.
            if at == "/geoFence" {
                let more = found.iter().find(|(name, value)| !wanted.contains_key(*name) && !value.is_null());
                all.extend(more.map(|(name, _)| format!("{at} has {name}, which the plan has not")));
            }
        }
        (Value::Array(wanted), Value::Array(found)) if wanted.len() == found.len() => {
            for (i, (wanted, found)) in wanted.iter().zip(found).enumerate() {
                values(&format!("{at}/{i}"), wanted, found, all);
            }
        }
        (Value::Array(wanted), Value::Array(found)) => {
            all.push(format!("{at} has {} of them, not {}", found.len(), wanted.len()));
        }
        // What the plan leaves open an app may say.
        (Value::Null, _) => {}
        (Value::Number(number), Value::Null) if number.as_f64() == Some(0.0) => {}
        (Value::Number(_), Value::Number(_)) => {
            // A waypoint's and a take-off's fourth number is the heading.
            let at = if at.ends_with("/params/3") { format!("{at} (heading)") } else { at.to_owned() };
            compare(&at, &wanted.to_string(), &found.to_string(), all);
        }
        _ if wanted == found => {}
        _ => all.push(format!("{at} is {found}, not {wanted}")),
    }
}
