//! Documentation: it begins each file and each module of tests, none of its lines opens like a fragment, and headings
//! stand apart.

use crate::source::Crate;
use crate::source::ident;
use crate::source::is_punct;
use crate::source::line;
use proc_macro2::TokenTree;

/// Openings that lean on the line above, such as "Of few instances: where ...".
const FRAGMENT_OPENINGS: [&str; 9] =
    ["Of", "What", "Where", "Which", "Who", "Whose", "Those", "The same", "Whoever"];

/// Headings of the sections of a function.
const HEADINGS: [&str; 3] = ["# Errors", "# Panics", "# Safety"];

/// Lists doc lines that begin with a fragment word.
pub fn fragments(crates: &[Crate]) -> Vec<String> {
    let mut found = Vec::new();
    for file in crates.iter().flat_map(|source| &source.files) {
        for (line, text) in doc_lines(&file.tokens) {
            if let Some(opening) = fragment_opening(&text) {
                found.push(format!("{}:{line}: a doc line begins with `{opening}`", file.path));
            }
        }
    }
    found
}

/// Lists headings of sections without an empty line before and after.
pub fn crowded_headings(crates: &[Crate]) -> Vec<String> {
    let mut found = Vec::new();
    for file in crates.iter().flat_map(|source| &source.files) {
        for lines in doc_lines(&file.tokens).windows(3) {
            let [(_, before), (line, text), (_, after)] = lines else { continue };
            let is_crowded = !before.trim().is_empty() || !after.trim().is_empty();
            if HEADINGS.contains(&text.trim()) && is_crowded {
                found.push(format!("{}:{line}: no empty line around `{}`", file.path, text.trim()));
            }
        }
    }
    found
}

/// Lists files that do not say in a `//!` line what they hold.
pub fn files_without_docs(crates: &[Crate]) -> Vec<String> {
    let files = crates.iter().flat_map(|source| &source.files);
    let bare = files.filter(|file| !starts_with_doc(&file.tokens));
    bare.map(|file| format!("{}:1: the file does not begin with a `//!` line", file.path)).collect()
}

/// Lists modules `tests` inside files that do not say in a `//!` line what they cover.
pub fn tests_without_docs(crates: &[Crate]) -> Vec<String> {
    let mut found = Vec::new();
    for file in crates.iter().flat_map(|source| &source.files) {
        for tokens in file.tokens.windows(3) {
            let [keyword, name, TokenTree::Group(body)] = tokens else { continue };
            let is_tests =
                ident(keyword).as_deref() == Some("mod") && ident(name).as_deref() == Some("tests");
            let body: Vec<TokenTree> = body.stream().into_iter().collect();
            if is_tests && !starts_with_doc(&body) {
                let line = line(keyword);
                let text = "the tests do not begin with a `//!` line that says what they cover";
                found.push(format!("{}:{line}: {text}", file.path));
            }
        }
    }
    found
}

/// Returns true if the first token is a `//!` comment.
fn starts_with_doc(tokens: &[TokenTree]) -> bool {
    matches!(tokens, [hash, bang, TokenTree::Group(group), ..]
        if is_punct(hash, '#') && is_punct(bang, '!') && doc_text(group).is_some())
}

fn fragment_opening(text: &str) -> Option<&'static str> {
    let text = text.trim_start();
    let is_opening = |opening: &&&str| {
        let rest = text.strip_prefix(**opening);
        rest.is_some_and(|rest| !rest.starts_with(|next: char| next.is_alphanumeric()))
    };
    FRAGMENT_OPENINGS.iter().find(is_opening).copied()
}

/// The lines of `///` and `//!` comments with their line numbers.
fn doc_lines(tokens: &[TokenTree]) -> Vec<(usize, String)> {
    let mut lines = Vec::new();
    for (i, token) in tokens.iter().enumerate() {
        let TokenTree::Group(group) = token else { continue };
        let follows_hash = i.checked_sub(1).is_some_and(|i| is_punct(&tokens[i], '#'))
            || i.checked_sub(2).is_some_and(|i| is_punct(&tokens[i], '#'));
        match doc_text(group) {
            Some(text) if follows_hash => lines.push((line(token), text)),
            _ => lines.extend(doc_lines(&group.stream().into_iter().collect::<Vec<_>>())),
        }
    }
    lines
}

/// The text of `[doc = "text"]`, which is the form of a doc comment among tokens.
fn doc_text(group: &proc_macro2::Group) -> Option<String> {
    let tokens: Vec<TokenTree> = group.stream().into_iter().collect();
    let [name, equals, TokenTree::Literal(text)] = &tokens[..] else { return None };
    let is_doc = ident(name).as_deref() == Some("doc") && is_punct(equals, '=');
    is_doc.then(|| text.to_string().trim_matches('"').to_owned())
}

#[cfg(test)]
mod tests {
    //! Violations of each rule for documentation are found in made-up files, and sentences are not reported.

    use super::*;
    use crate::source::crate_of;

    #[test]
    fn fragments_are_found_at_the_beginnings_of_doc_lines() {
        let text = "//! Where it stands.\n\n/// A point.\n/// Of few rays.\n/// Office hours.\n\
                    struct A {\n    /// The same as `a`.\n    b: u32,\n}\n\
                    // What a plain comment says counts as nothing.\n\
                    const C: &str = \"/// Who\";\n";
        let found = fragments(&[crate_of("demo", [("src/lib.rs", text)])]);
        assert_eq!(
            found,
            [
                "crates/demo/src/lib.rs:1: a doc line begins with `Where`",
                "crates/demo/src/lib.rs:4: a doc line begins with `Of`",
                "crates/demo/src/lib.rs:7: a doc line begins with `The same`",
            ]
        );
    }

    #[test]
    fn sentences_are_not_fragments() {
        let text = "//! Points.\n\n/// Returns the points of which `a` is one.\nfn a() {}\n";
        assert!(fragments(&[crate_of("demo", [("src/lib.rs", text)])]).is_empty());
    }

    #[test]
    fn headings_without_empty_lines_are_found() {
        let function = |lines: &str| format!("//! Points.\n\n{lines}\nfn a() {{}}\n");
        let found = |lines: &str| {
            crowded_headings(&[crate_of("demo", [("src/lib.rs", &function(lines)[..])])])
        };
        assert!(found("/// Reads.\n///\n/// # Errors\n///\n/// Fails.").is_empty());
        let expected = ["crates/demo/src/lib.rs:5: no empty line around `# Errors`"];
        assert_eq!(found("/// Reads.\n///\n/// # Errors\n/// Fails."), expected);
        let expected = ["crates/demo/src/lib.rs:4: no empty line around `# Panics`"];
        assert_eq!(found("/// Reads.\n/// # Panics\n///\n/// If empty."), expected);
    }

    #[test]
    fn files_without_a_first_doc_line_are_found() {
        let files = [
            ("tests/a.rs", "//! Tests of a.\nfn a() {}"),
            ("tests/b.rs", "/// Tests of b.\nfn b() {}"),
            ("tests/c.rs", "fn c() {}"),
        ];
        let found = files_without_docs(&[crate_of("demo", files)]);
        assert_eq!(found.len(), 2);
        assert!(found[0].starts_with("crates/demo/tests/b.rs:1"), "{found:?}");
        assert!(found[1].starts_with("crates/demo/tests/c.rs:1"), "{found:?}");
    }

    #[test]
    fn tests_without_a_first_doc_line_are_found() {
        let files = [
            (
                "src/a.rs",
                "//! A.\n#[cfg(test)]\nmod tests {\n    //! Tests of a.\n    use super::*;\n}",
            ),
            ("src/b.rs", "//! B.\n#[cfg(test)]\nmod tests {\n    use super::*;\n}"),
            ("src/c.rs", "//! C.\n#[cfg(test)]\nmod tests;"),
        ];
        let found = tests_without_docs(&[crate_of("demo", files)]);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("crates/demo/src/b.rs:3"), "{found:?}");
    }
}
