//! Renders a file to a picture, with every choice made from the data.
//!
//! `cargo run --release -p surfel --example render_file -- scan.laz scan.png`
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "an example prints what it does")]

fn main() -> surfel::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let (Some(input), Some(output)) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: render_file CLOUD PICTURE");
        return Ok(());
    };
    let scene = surfel::load(input)?;
    for choice in scene.choices() {
        println!("{choice}");
    }
    for warning in scene.warnings() {
        println!("warning: {warning}");
    }
    scene.render()?.save(output)
}
