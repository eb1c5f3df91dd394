//! The figures of docs/quality.md: surfaces of points compared with what the points were taken from.
//!
//! `cargo bench -p surfel-tests --bench quality -- WORDS`: a word that names a surface kind selects this kind, any
//! other word selects the clouds whose name contains it. The standard output has the tables as the document shows them,
//! the standard error the seconds.
//!
//! `--write-clouds FOLDER` writes the clouds as PLY files, `--meshes FOLDER` compares meshes that docs/poisson.py made
//! from them, too, and `--pictures FOLDER` writes pictures of the truth and of each surface side by side.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a benchmark prints its tables")]

mod selection;
mod processor_time;
mod reconstruction;
mod pictures;
mod sampled;
mod scans;

use selection::Selection;
use surfel_tests::bench_args::is_timed;

fn main() {
    if !is_timed() {
        sampled::check();
        scans::check();
        return;
    }
    let selection = Selection::from_args();
    sampled::compare_shapes(&selection);
    sampled::cover_plane(&selection);
    scans::compare_scans(&selection);
}
