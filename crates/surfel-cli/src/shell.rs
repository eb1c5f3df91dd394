//! Words of command lines that are shown to users.

/// Quotes a word so that a shell reads it as one: `#` would begin a comment, a space another word.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=,:+%@".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// Writes words as one line for a shell.
pub fn command_line(words: &[String]) -> String {
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    //! Words are quoted for a shell.

    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_change_them() {
        assert_eq!(quoted("a/demo.laz"), "a/demo.laz");
        assert_eq!(quoted("--spp=4"), "--spp=4");
        assert_eq!(quoted("#fff,#000"), "'#fff,#000'");
        assert_eq!(quoted("my scan.laz"), "'my scan.laz'");
        assert_eq!(quoted("it's here"), r"'it'\''s here'");
        assert_eq!(quoted(""), "''");
    }
}
