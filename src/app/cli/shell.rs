//! Commands for the user to paste.

/// A word as shells take it.
pub(super) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+@%=:,".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, the commands could not be pasted where a folder has a space or a quotation mark in its name.
    #[test]
    fn words_survive_a_shell() {
        assert_eq!(quoted("walk/images"), "walk/images");
        assert_eq!(quoted("my walk"), "'my walk'");
        assert_eq!(quoted("Ann's $HOME"), "'Ann'\\''s $HOME'");
    }
}
