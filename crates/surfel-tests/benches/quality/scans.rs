//! Scans of built-in scenes compared with the scenes themselves.

use crate::selection::Selection;
use std::time::Instant;
use surfel_core::points::Preparation;
use surfel_core::progress::NoProgress;
use surfel_core::scanner::Instrument;
use surfel_core::scanner::scenes::NamedScene;
use surfel_core::scanner::scenes::forest;
use surfel_core::scanner::scenes::room;
use surfel_core::scanner::scenes::ruin;
use surfel_core::scanner::scenes::street;
use surfel_core::surface::SurfaceKind;
use surfel_tests::scan_quality::TrueScene;
use surfel_tests::scenes;

/// A scene and the instrument that measures it.
struct ScanCase {
    name: &'static str,
    scene: fn() -> NamedScene,
    instrument: Box<dyn Instrument>,
}

fn all_scans() -> [ScanCase; 8] {
    fn case(
        name: &'static str,
        scene: fn() -> NamedScene,
        instrument: impl Instrument + 'static,
    ) -> ScanCase {
        ScanCase { name, scene, instrument: Box::new(instrument) }
    }
    const STEP_DEG: f64 = 0.25;
    [
        case("street-terrestrial", street::scene, street::terrestrial(STEP_DEG)),
        case("street-spinning", street::scene, street::spinning()),
        case("street-airborne", street::scene, street::airborne()),
        case("forest-terrestrial", forest::scene, forest::terrestrial(STEP_DEG)),
        case("forest-airborne", forest::scene, forest::airborne()),
        case("room-terrestrial", room::scene, room::terrestrial(STEP_DEG)),
        case("room-depth-camera", room::scene, room::depth_camera()),
        case("ruin-terrestrial", ruin::named_scene, ruin::terrestrial(STEP_DEG)),
    ]
}

/// Scans the street coarsely and asserts a figure.
pub fn check() {
    let (scene, survey) = (street::scene(), street::terrestrial(1.0));
    let cloud = survey.scan(&scene.sdf, &NoProgress).unwrap();
    let views = TrueScene::new(&scene, &survey, 64);
    let quality = views.compare(&scenes::points(cloud, SurfaceKind::Splat));
    let ground = quality.kinds.iter().find(|kind| kind.kind == "ground").unwrap();
    assert!(0.5 < ground.shown, "{quality:?}");
}

/// Prints a table for every scan.
pub fn compare_scans(selection: &Selection) {
    const RESOLUTION: u32 = 384;
    for ScanCase { name, scene, instrument } in all_scans() {
        if !selection.includes(name) {
            continue;
        }
        let scene = scene();
        let begin = Instant::now();
        let cloud = instrument.scan(&scene.sdf, &NoProgress).unwrap();
        let scan_secs = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let views = TrueScene::new(&scene, &*instrument, RESOLUTION);
        let truth_secs = begin.elapsed().as_secs_f64();
        println!(
            "\n{name}: {} points, scanned in {scan_secs:.1} s, truth traced in {truth_secs:.1} s",
            cloud.len()
        );
        for (surface, kind) in &selection.kinds {
            let begin = Instant::now();
            let points = scenes::prepared(cloud.clone(), &Preparation::default(), *kind);
            let prepare_secs = begin.elapsed().as_secs_f64();
            let begin = Instant::now();
            let quality = views.compare(&points);
            let render_secs = begin.elapsed().as_secs_f64();
            println!(
                "\n`{surface}`: {:.2} % of the background falsely covered, prepared in \
                 {prepare_secs:.2} s, built and rendered in {render_secs:.2} s\n",
                100.0 * quality.false_hits
            );
            println!(
                "| object | pixels | shown % | far off % | depth, mm | normals | \
                 coverage error of blocks % |\n| --- | --- | --- | --- | --- | --- | --- |"
            );
            for kind in quality.kinds {
                println!(
                    "| {} | {} | {:.2} | {:.2} | {:.1} | {:.1}° | {:.1} |",
                    kind.kind,
                    kind.n_pixels,
                    100.0 * kind.shown,
                    100.0 * kind.far_off,
                    1000.0 * kind.depth_rms,
                    kind.normal_deg,
                    100.0 * kind.block_coverage_error,
                );
            }
        }
    }
}
