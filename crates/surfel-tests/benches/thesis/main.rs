//! The tables and figures of C. Wiesmeier, Ray Tracing Point Clouds (2011), repeated: the figures of docs/thesis.md.
//!
//! `cargo bench -p surfel-tests --bench thesis -- WORDS`: the words `table1`, `table2`, `kinds`, `further`, `counts`,
//! `structures`, `edges` and `figures` select parts, without any all are made. With `--features counts`, which slows the
//! others, `counts` prints evaluations instead of times, and `structures` has the columns of the kd-tree. The standard
//! output has the tables as the document shows them, the standard error what is skipped. `--pictures FOLDER` writes the
//! figures and a picture of each kind.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a benchmark prints its tables")]

mod clouds;
mod timing;
mod tables;
mod edges;
mod kinds;
mod further;
mod counts;
mod structures;
mod figures;

use surfel_tests::bench_args::{is_timed, take_folder};

fn main() {
    if !is_timed() {
        kinds::check();
        return edges::check();
    }
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let folder = take_folder(&mut args, "--pictures");
    let words: Vec<String> = args.into_iter().filter(|word| !word.starts_with('-')).collect();
    let is_wanted = |part: &str| words.is_empty() || words.iter().any(|word| word == part);
    if is_wanted("table1") {
        tables::print_table_1();
    }
    if is_wanted("table2") {
        tables::print_table_2();
    }
    if is_wanted("kinds") {
        kinds::print_kinds(folder.as_deref());
    }
    if is_wanted("further") {
        further::print_further_work();
    }
    if is_wanted("counts") {
        counts::print_counts();
    }
    if is_wanted("structures") {
        structures::print_structures();
    }
    if is_wanted("edges") {
        edges::print_edges();
    }
    if is_wanted("figures") {
        match &folder {
            Some(folder) => figures::write_figures(folder),
            None => eprintln!("figures skipped: no --pictures FOLDER"),
        }
    }
}
