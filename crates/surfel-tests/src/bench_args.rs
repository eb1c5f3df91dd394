//! Command lines and environment variables of the benchmarks.

use std::path::PathBuf;

/// Returns true if `cargo bench` runs the program; `cargo test` only checks that it works.
pub fn is_timed() -> bool {
    std::env::args().any(|argument| argument == "--bench")
}

/// Returns the number of points in the environment variable `POINTS`, or the `usual` one.
pub fn n_points(usual: usize) -> usize {
    std::env::var("POINTS").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// Removes an option and its folder from the arguments, and returns the folder.
///
/// # Panics
///
/// Panics if the option has no folder.
pub fn take_folder(args: &mut Vec<String>, name: &str) -> Option<PathBuf> {
    let at = args.iter().position(|word| word == name)?;
    let mut taken = args.drain(at..=at + 1);
    taken.nth(1).map(PathBuf::from)
}
