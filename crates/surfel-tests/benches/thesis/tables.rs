//! Tables 1 and 2 of the thesis.

use super::clouds::{self, Subject};
use super::timing::{Times, scene, times};
use surfel_core::flat::FlatScene;
use surfel_core::progress::NoProgress;
use surfel_core::surface::SurfaceKind;

/// The rows of Table 1: a kind with its name in the thesis, and `trace` and `render` of the four clouds in milliseconds.
const TABLE_1: [(SurfaceKind, &str, [[f64; 2]; 4]); 5] = [
    (SurfaceKind::Sphere, "sphere", [[5.2, 25.3], [6.4, 17.8], [16.5, 48.7], [5.9, 19.7]]),
    (SurfaceKind::Disc, "disc", [[7.4, 38.0], [10.3, 21.9], [26.3, 119.0], [9.2, 25.3]]),
    (
        SurfaceKind::SplatMean,
        "multi mean",
        [[9.2, 38.0], [14.5, 27.9], [38.9, 135.0], [12.4, 28.0]],
    ),
    (SurfaceKind::Splat, "multi aligned", [[9.3, 38.5], [14.6, 26.4], [39.0, 135.0], [12.3, 28.0]]),
    (
        SurfaceKind::SplatFit,
        "multi runtime",
        [[39.0, 102.0], [74.0, 87.0], [85.0, 183.0], [46.5, 67.8]],
    ),
];

/// The rows of Table 2: thousands of points, and `trace` and `render` in milliseconds.
const TABLE_2: [(usize, [f64; 2]); 5] = [
    (10, [7.9, 41.0]),
    (30, [11.7, 41.9]),
    (100, [18.6, 44.9]),
    (300, [22.7, 78.2]),
    (1000, [44.3, 140.0]),
];

/// Prints the times of all kinds for four clouds.
pub fn print_table_1() {
    let subjects =
        [clouds::bunny(), Some(clouds::cube()), Some(clouds::ruin_scan()), Some(clouds::head())];
    println!("| cloud | surface | thesis: trace, render | 1 thread | 2 threads | GPU |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (column, subject) in subjects.iter().enumerate() {
        let Some(subject) = subject else {
            eprintln!("Table 1: the bunny is skipped, its file is not there");
            continue;
        };
        for (name, kind) in SurfaceKind::ALL {
            if matches!(kind, SurfaceKind::Points | SurfaceKind::Gaussian) {
                continue;
            }
            let known = TABLE_1.iter().find(|(known, ..)| *known == kind);
            let thesis = known.map_or("".to_owned(), |(_, name, all)| {
                let [trace, render] = all[column];
                format!("{name}: {trace}, {render}")
            });
            print_row(&[subject.name, &format!("`{name}`"), &thesis], subject, kind);
        }
    }
}

/// Prints the times of `splat` by the number of points.
pub fn print_table_2() {
    let all = clouds::ruin_scan();
    println!(
        "\n| points | thesis: trace, render | 1 thread | 2 threads | GPU |\n| --- | --- | --- | --- | --- |"
    );
    for (thousands, [trace, render]) in TABLE_2 {
        let subject = all.subset(1000 * thousands);
        let cells = [format!("{thousands}k"), format!("{trace}, {render}")];
        print_row(&[&cells[0], &cells[1]], &subject, SurfaceKind::Splat);
    }
}

fn print_row(cells: &[&str], subject: &Subject, kind: SurfaceKind) {
    let flat = FlatScene::new(&scene(subject, kind), &NoProgress).unwrap();
    let text = |Times { trace, render }: Times| format!("{trace:.1}, {render:.1}");
    let [one, two, gpu] = times(&flat).map(|times| times.map(text).unwrap_or_default());
    println!("| {} | {one} | {two} | {gpu} |", cells.join(" | "));
}
