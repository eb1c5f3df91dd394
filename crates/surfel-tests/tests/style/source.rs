//! Rust files as tokens, each with the crate and the module that it belongs to.

use proc_macro2::TokenStream;
use proc_macro2::TokenTree;
use std::fs;
use std::path::Path;
use std::path::PathBuf;

/// One crate of the workspace with all of its Rust files, those of tests and benchmarks included.
pub struct Crate {
    /// The name as Rust code writes it, with underscores.
    pub name: String,
    pub files: Vec<SourceFile>,
}

/// One Rust file.
pub struct SourceFile {
    /// The path from the root of the workspace.
    pub path: String,
    /// The path of the file's module from the crate's root, or `None` for files outside of the library.
    pub module: Option<Vec<String>>,
    pub tokens: Vec<TokenTree>,
}

/// Reads all crates below `crates/`, in the order of their names.
pub fn workspace() -> Vec<Crate> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut folders = entries(&root.join("crates"));
    folders.retain(|folder| folder.join("Cargo.toml").is_file());
    let read = |folder: &PathBuf| {
        let name = folder.file_name().unwrap().to_str().unwrap();
        let files = files_below(folder, "rs").into_iter().map(|file| {
            let text = fs::read_to_string(&file).unwrap();
            (file.strip_prefix(folder).unwrap().to_str().unwrap().replace('\\', "/"), text)
        });
        crate_of(name, files)
    };
    folders.iter().map(read).collect()
}

/// A crate made of files, each a path from the crate's folder and a text.
pub fn crate_of<P, T>(name: &str, files: impl IntoIterator<Item = (P, T)>) -> Crate
where
    P: AsRef<str>,
    T: AsRef<str>,
{
    let file = |(path, text): (P, T)| SourceFile {
        path: format!("crates/{name}/{}", path.as_ref()),
        module: module_path(path.as_ref()),
        tokens: tokens(text.as_ref()).unwrap_or_else(|| panic!("{} is no Rust", path.as_ref())),
    };
    Crate { name: name.replace('-', "_"), files: files.into_iter().map(file).collect() }
}

/// All files below a folder that have an extension, sorted.
pub fn files_below(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for path in entries(folder) {
        if path.is_dir() {
            files.extend(files_below(&path, extension));
        } else if path.extension().is_some_and(|found| found == extension) {
            files.push(path);
        }
    }
    files
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

fn tokens(text: &str) -> Option<Vec<TokenTree>> {
    Some(text.parse::<TokenStream>().ok()?.into_iter().collect())
}

/// `src/a/b.rs` and `src/a/b/mod.rs` are both the module `a::b`.
fn module_path(path: &str) -> Option<Vec<String>> {
    let path = path.strip_prefix("src/")?.strip_suffix(".rs")?;
    if path == "main" || path.starts_with("bin/") {
        return None;
    }
    let mut names: Vec<String> = path.split('/').map(str::to_owned).collect();
    names.pop_if(|name| name == "mod" || (path == "lib" && name == "lib"));
    Some(names)
}

/// The tokens of a list without items under `#[cfg(test)]`.
pub fn without_tests(tokens: &[TokenTree]) -> Vec<TokenTree> {
    let mut kept = Vec::new();
    let mut rest = tokens;
    while let [first, later @ ..] = rest {
        if is_punct(first, '#') && later.first().is_some_and(is_test_attribute) {
            // The item ends with the first semicolon or block.
            let is_end = |token: &TokenTree| is_punct(token, ';') || is_block(token);
            let n_skipped = later.iter().position(is_end).map_or(later.len(), |end| end + 1);
            rest = &later[n_skipped..];
        } else {
            kept.push(first.clone());
            rest = later;
        }
    }
    kept
}

fn is_test_attribute(token: &TokenTree) -> bool {
    let text = token.to_string().replace(' ', "");
    text.starts_with("[cfg(test") || text.starts_with("[cfg(all(test")
}

pub fn is_punct(token: &TokenTree, character: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == character)
}

fn is_block(token: &TokenTree) -> bool {
    use proc_macro2::Delimiter::Brace;
    matches!(token, TokenTree::Group(group) if group.delimiter() == Brace)
}

/// The name, if the token is one.
pub fn ident(token: &TokenTree) -> Option<String> {
    match token {
        TokenTree::Ident(ident) => Some(ident.to_string()),
        _ => None,
    }
}

/// The line in which a token begins, from 1.
pub fn line(token: &TokenTree) -> usize {
    token.span().start().line
}

#[cfg(test)]
mod tests {
    //! Module paths of files, and tokens without test code.

    use super::*;

    #[test]
    fn files_have_the_paths_of_their_modules() {
        let path = |file: &str| module_path(file).map(|names| names.join("::"));
        assert_eq!(path("src/lib.rs").as_deref(), Some(""));
        assert_eq!(path("src/a.rs").as_deref(), Some("a"));
        assert_eq!(path("src/a/mod.rs").as_deref(), Some("a"));
        assert_eq!(path("src/a/lib.rs").as_deref(), Some("a::lib"));
        assert_eq!((path("src/main.rs"), path("tests/a.rs")), (None, None));
    }

    #[test]
    fn test_code_is_left_out() {
        let text =
            "use a; #[cfg(test)] use b; #[cfg(test)] #[path = \"x\"] mod c { use d; } fn e() {}";
        let kept: String =
            without_tests(&tokens(text).unwrap()).iter().map(ToString::to_string).collect();
        assert_eq!(kept.replace(' ', ""), "usea;fne(){}");
    }
}
