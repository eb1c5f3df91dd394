//! Renders a turn around a file to a GIF.
//!
//! `cargo run --release -p surfel --example turntable -- statue.ply turn.gif`
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "an example prints what it does")]

use std::path::Path;
use surfel::SceneDescription;
use surfel::animate::PlannedMovie;
use surfel_core::progress::NoProgress;

fn main() -> surfel::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let (Some(input), Some(output)) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: turntable CLOUD MOVIE");
        return Ok(());
    };
    let mut description = SceneDescription::of_files([input]);
    description.output.turntable = Some(4.0);
    description.output.fps = Some(10.0);
    description.picture.resolution = Some((480, 270));

    PlannedMovie::new(&description, &NoProgress)?.render(Path::new(&output), false, &NoProgress)
}
