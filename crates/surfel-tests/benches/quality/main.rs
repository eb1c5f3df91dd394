//! The figures of docs/quality.md: surfaces of points compared with what the points were taken from.
//!
//! `cargo bench -p surfel-tests --bench quality -- WORDS`: a word that names a surface kind selects this kind, any
//! other word selects the clouds whose name contains it.
#![expect(clippy::print_stdout, reason = "a benchmark prints its table")]

mod selection;
mod sampled;
mod scans;

use selection::Selection;

fn main() {
    // `cargo test` only checks that the program works.
    if !std::env::args().any(|argument| argument == "--bench") {
        sampled::check();
        scans::check();
        return;
    }
    let selection = Selection::from_args();
    sampled::compare_shapes(&selection);
    sampled::cover_plane(&selection);
    scans::compare_scans(&selection);
}
