//! Names: limits are called `MAX_` and `MIN_`, and no two public types of the workspace share a name.

use crate::source::Crate;
use crate::source::ident;
use crate::source::line;
use crate::source::without_tests;
use proc_macro2::TokenTree;
use std::collections::BTreeMap;

/// Beginnings of names that have a standard counterpart.
const REPLACED: [(&str, &str); 5] = [
    ("MOST_", "MAX_"),
    ("LEAST_", "MIN_"),
    ("FEWEST_", "MIN_"),
    ("WIDEST_", "MAX_"),
    ("PATIENCE", "a name that ends with TIMEOUT"),
];

/// Types that each crate or each command may have of its own.
const SHARED: [&str; 3] = ["Error", "Result", "Args"];

/// Lists identifiers with a beginning that has a standard counterpart.
pub fn unusual_limits(crates: &[Crate]) -> Vec<String> {
    let mut found = Vec::new();
    for file in crates.iter().flat_map(|source| &source.files) {
        for_each_ident(&file.tokens, &mut |name, line| {
            let replaced = REPLACED.iter().find(|(beginning, _)| name.starts_with(beginning));
            if let Some((_, standard)) = replaced {
                found.push(format!("{}:{line}: `{name}` should begin with {standard}", file.path));
            }
        });
    }
    found
}

fn for_each_ident(tokens: &[TokenTree], visit: &mut impl FnMut(&str, usize)) {
    for token in tokens {
        match token {
            TokenTree::Ident(name) => visit(&name.to_string(), line(token)),
            TokenTree::Group(group) => {
                for_each_ident(&group.stream().into_iter().collect::<Vec<_>>(), visit);
            }
            _ => {}
        }
    }
}

/// Lists public types of one name that are declared in more than one file of the workspace's libraries.
pub fn shared_type_names(crates: &[Crate]) -> Vec<String> {
    let mut declarations: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for file in crates.iter().flat_map(|source| &source.files) {
        if file.module.is_some() {
            for (name, line) in public_types(&file.tokens) {
                declarations.entry(name).or_default().push(format!("{}:{line}", file.path));
            }
        }
    }
    let is_shared = |(name, declarations): &(String, Vec<String>)| {
        let file = |declaration: &String| declaration.split(':').next().map(str::to_owned);
        let is_one_file =
            declarations.iter().all(|declaration| file(declaration) == file(&declarations[0]));
        !SHARED.contains(&name.as_str()) && !is_one_file
    };
    let shared = declarations.into_iter().filter(is_shared);
    shared
        .map(|(name, declarations)| {
            format!("{}: `{name}` is also {}", declarations[0], declarations[1..].join(", "))
        })
        .collect()
}

/// Names after `pub struct`, `pub enum`, `pub union`, `pub trait` and `pub type`, in inline modules, too.
fn public_types(tokens: &[TokenTree]) -> Vec<(String, usize)> {
    let tokens = without_tests(tokens);
    let mut found = Vec::new();
    for window in tokens.windows(3) {
        let [before, kind, name] = window else { continue };
        let kinds = ["struct", "enum", "union", "trait", "type"];
        let is_type = ident(kind).is_some_and(|kind| kinds.contains(&kind.as_str()));
        if is_type && ident(before).as_deref() == Some("pub") {
            found.extend(ident(name).map(|text| (text, line(name))));
        }
        if let (Some("mod"), TokenTree::Group(body)) = (ident(before).as_deref(), name) {
            found.extend(public_types(&body.stream().into_iter().collect::<Vec<_>>()));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    //! Unusual names of limits and shared names of types are found in made-up crates.

    use super::*;
    use crate::source::crate_of;

    #[test]
    fn limits_of_unusual_names_are_found() {
        let text = "const MOST_RAYS: u32 = 1; fn a() { b(LEAST_RAYS, MAX_RAYS, ALMOST_ALL) }";
        let found = unusual_limits(&[crate_of("demo", [("benches/a.rs", text)])]);
        assert_eq!(
            found,
            [
                "crates/demo/benches/a.rs:1: `MOST_RAYS` should begin with MAX_",
                "crates/demo/benches/a.rs:1: `LEAST_RAYS` should begin with MIN_",
            ]
        );
    }

    #[test]
    fn public_types_of_one_name_are_found_across_crates() {
        let crates = [
            crate_of("a", [("src/lib.rs", "pub struct Place; pub type Error = u8; struct Ray;")]),
            crate_of("b", [("src/x.rs", "pub mod inner { pub enum Place {} }\npub struct Ray;")]),
            crate_of(
                "c",
                [("src/lib.rs", "pub enum Error {} #[cfg(test)] mod t { pub struct Place; }")],
            ),
            crate_of("d", [("tests/all.rs", "pub struct Place;")]),
        ];
        assert_eq!(
            shared_type_names(&crates),
            ["crates/a/src/lib.rs:1: `Place` is also crates/b/src/x.rs:1"]
        );
    }

    #[test]
    fn variants_for_platforms_in_one_file_are_one_type() {
        let text = "#[cfg(unix)] pub struct File; #[cfg(not(unix))] pub struct File;";
        assert!(shared_type_names(&[crate_of("a", [("src/lib.rs", text)])]).is_empty());
    }
}
