//! Rules of style that a program can check, for every crate of the workspace.

mod docs;
mod modules;
mod names;
mod source;

use source::Crate;
use source::workspace;

/// Panics with all violations of a rule.
fn check(rule: impl Fn(&[Crate]) -> Vec<String>) {
    let violations = rule(&workspace());
    assert!(violations.is_empty(), "{} violations:\n{}", violations.len(), violations.join("\n"));
}

#[test]
fn doc_lines_are_no_fragments() {
    check(docs::fragments);
}

#[test]
fn headings_of_sections_stand_apart() {
    check(docs::crowded_headings);
}

#[test]
fn each_file_says_what_it_holds() {
    check(docs::files_without_docs);
}

#[test]
fn tests_say_what_they_cover() {
    check(docs::tests_without_docs);
}

#[test]
fn limits_have_standard_names() {
    check(names::unusual_limits);
}

#[test]
fn public_types_have_distinct_names() {
    check(names::shared_type_names);
}

#[test]
fn modules_use_only_those_above_them() {
    check(modules::upward_uses);
}

#[test]
fn files_of_a_folder_use_each_other_in_one_direction() {
    check(modules::cycles);
}

#[test]
fn an_import_names_one_module() {
    check(modules::crowded_imports);
}
