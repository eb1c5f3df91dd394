//! Casts rays straight down onto a cloud and looks up the points that they hit.
//!
//! `cargo run --release -p surfel --example cast_rays -- scan.laz`
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "an example prints what it does")]

fn main() -> surfel::Result<()> {
    let Some(input) = std::env::args().nth(1) else {
        eprintln!("usage: cast_rays CLOUD");
        return Ok(());
    };
    let scene = surfel::load(&input)?;
    let [low, high] = scene.bounds();
    let n = 5;
    let at =
        |axis: usize, i: usize| low[axis] + (i as f64 + 0.5) / n as f64 * (high[axis] - low[axis]);
    let ray = |i: usize| [at(0, i % n), at(1, i / n), high[2] + 1.0, 0.0, 0.0, -1.0];
    let rays: Vec<[f64; 6]> = (0..n * n).map(ray).collect();
    for (ray, hit) in rays.iter().zip(scene.cast_rays(&rays)?) {
        match hit {
            Some(hit) => println!(
                "{:.2} {:.2}: height {:.3}, point {:?}",
                ray[0], ray[1], hit.position[2], hit.point
            ),
            None => println!("{:.2} {:.2}: nothing", ray[0], ray[1]),
        }
    }
    Ok(())
}
