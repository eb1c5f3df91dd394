//! Shows progress while a file is rendered, and cancels after a number of seconds.
//!
//! `cargo run --release -p surfel --example progress_and_cancel -- scan.laz scan.png 10`
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "an example prints what it does")]

use std::time::{Duration, Instant};
use surfel::{SceneDescription, resolve};
use surfel_core::progress::Progress;

/// Prints stages and choices, and cancels at a deadline.
struct Printer {
    deadline: Instant,
}

impl Progress for Printer {
    fn begin(&self, stage: &str, total: u64) {
        println!("{stage}: {total} units");
    }

    fn note(&self, line: &str) {
        println!("{line}");
    }

    fn is_cancelled(&self) -> bool {
        self.deadline < Instant::now()
    }
}

fn main() -> surfel::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, seconds] = &arguments[..] else {
        eprintln!("usage: progress_and_cancel CLOUD PICTURE SECONDS");
        return Ok(());
    };
    let limit = Duration::from_secs(seconds.parse().unwrap_or(10));
    let progress = Printer { deadline: Instant::now() + limit };
    let description = SceneDescription::of_files([input]);
    let render = || {
        let scene = resolve(&description, &progress)?.build(&progress)?;
        let (image, _) = scene.render_with(&progress)?;
        image.save(output)
    };
    match render() {
        Err(error) if error.is_cancelled() => println!("cancelled after {limit:?}"),
        result => result?,
    }
    Ok(())
}
