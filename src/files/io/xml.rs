//! XML of others.

use roxmltree::Document;

/// Elements that may be nested in each other: the parser goes into each by calling itself.
const DEEPEST: usize = 256;

/// Parses a document, with or without a byte-order mark.
///
/// # Errors
/// In words, where it is none or is nested too deeply.
pub(crate) fn document(text: &str) -> Result<Document<'_>, String> {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    let mut depth = 0usize;
    // Roughly: what looks like an element in a comment counts too.
    for tag in text.split('<').skip(1) {
        match tag.as_bytes().first() {
            Some(b'/') => depth = depth.saturating_sub(1),
            Some(b'!' | b'?') | None => {}
            Some(_) => depth += usize::from(!tag.split('>').next().is_some_and(|tag| tag.ends_with('/'))),
        }
        if depth > DEEPEST {
            return Err(format!("its elements are nested more than {DEEPEST} deep"));
        }
    }
    Document::parse(text).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a file of a megabyte would end the process.
    #[test]
    fn deep_documents_are_refused() {
        assert!(document(&"<a>".repeat(200_000)).unwrap_err().contains("nested"));
        let flat = format!("\u{feff}<a>{}</a>", "<b/><c></c>".repeat(10_000));
        assert!(document(&flat).is_ok());
    }
}
