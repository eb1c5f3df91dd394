//! Scans of built-in scenes compared with the scenes themselves.

use crate::pictures;
use crate::reconstruction::{self, METHOD};
use crate::selection::Selection;
use rayon::prelude::*;
use std::time::Instant;
use surfel_core::image::Image;
use surfel_core::math::Vec3;
use surfel_core::points::{Orientation, PointCloud, Preparation, select_points};
use surfel_core::progress::NoProgress;
use surfel_core::scene::Geometry;
use surfel_core::surface::SurfaceKind;
use surfel_scanner::Instrument;
use surfel_scanner::scenes::NamedScene;
use surfel_scanner::scenes::forest;
use surfel_scanner::scenes::room;
use surfel_scanner::scenes::ruin;
use surfel_scanner::scenes::street;
use surfel_tests::scan_quality::{self, KindQuality, ScanQuality};
use surfel_tests::scenes;
use surfel_tests::true_scene::TrueScene;

/// A scene and the instrument that measures it.
struct ScanCase {
    name: &'static str,
    /// The name in the heading of its table.
    title: &'static str,
    scene: fn() -> NamedScene,
    instrument: Box<dyn Instrument>,
}

fn all_scans() -> [ScanCase; 10] {
    fn case(
        name: &'static str,
        title: &'static str,
        scene: fn() -> NamedScene,
        instrument: impl Instrument + 'static,
    ) -> ScanCase {
        ScanCase { name, title, scene, instrument: Box::new(instrument) }
    }
    const STEP_DEG: f64 = 0.25;
    [
        case(
            "street-terrestrial",
            "Street, terrestrial",
            street::scene,
            street::terrestrial(STEP_DEG),
        ),
        case("street-spinning", "Street, spinning laser", street::scene, street::spinning()),
        case("street-standing", "Street, one revolution", street::scene, street::standing()),
        case("street-airborne", "Street, airborne", street::scene, street::airborne()),
        case(
            "forest-terrestrial",
            "Forest, terrestrial",
            forest::scene,
            forest::terrestrial(STEP_DEG),
        ),
        case("forest-airborne", "Forest, airborne", forest::scene, forest::airborne()),
        case("room-terrestrial", "Room, terrestrial", room::scene, room::terrestrial(STEP_DEG)),
        case("room-depth-image", "Room, depth image", room::scene, room::depth_image()),
        case("room-depth-camera", "Room, depth camera", room::scene, room::depth_camera()),
        case(
            "ruin-terrestrial",
            "Ruin, terrestrial",
            ruin::named_scene,
            ruin::terrestrial(STEP_DEG),
        ),
    ]
}

/// Scans the street coarsely and asserts a figure.
pub fn check() {
    let (scene, survey) = (street::scene(), street::terrestrial(1.0));
    let cloud = survey.scan(&scene.sdf, &NoProgress).unwrap();
    let views = TrueScene::new(&scene, &survey, 64);
    let points = scenes::points(cloud, SurfaceKind::Splat);
    let quality = scan_quality::compare(&views, &views.render(Geometry::Points(points)));
    let ground = quality.kinds.iter().find(|kind| kind.kind == "ground").unwrap();
    assert!(0.5 < ground.shown && 10.0 < ground.lit_psnr_db, "{quality:?}");
}

/// Figures and pictures of one surface.
struct Compared {
    surface: String,
    quality: ScanQuality,
    images: Vec<Image>,
}

impl Compared {
    fn new(surface: &str, views: &TrueScene, geometry: Geometry) -> Self {
        let images = views.render(geometry);
        let quality = scan_quality::compare(views, &images);
        Self { surface: surface.to_owned(), quality, images }
    }
}

/// Prints a table for every scan.
pub fn compare_scans(selection: &Selection) {
    const RESOLUTION: u32 = 384;
    for case in all_scans().iter().filter(|case| selection.includes(case.name)) {
        let scene = (case.scene)();
        let begin = Instant::now();
        let cloud = case.instrument.scan(&scene.sdf, &NoProgress).unwrap();
        report_secs(case.name, "scanned", begin);
        let begin = Instant::now();
        let views = TrueScene::new(&scene, &*case.instrument, RESOLUTION);
        report_secs(case.name, "truth traced", begin);
        let n_points = cloud.len();
        let compared = compare_surfaces(case, &scene, &cloud, &views, selection);
        print_tables(case.title, n_points, &compared);
        let truth = views.images();
        let images = compared.iter().map(|compared| &compared.images[0]);
        let strip: Vec<&Image> = std::iter::once(&truth[0]).chain(images).collect();
        pictures::write_strip(selection, case.name, &strip);
    }
}

/// Compares all surfaces of a scan, and its reconstruction, with the scene.
fn compare_surfaces(
    case: &ScanCase,
    scene: &NamedScene,
    cloud: &PointCloud,
    views: &TrueScene,
    selection: &Selection,
) -> Vec<Compared> {
    let mut compared = Vec::new();
    for (surface, kind) in &selection.kinds {
        let begin = Instant::now();
        // As the program has it: normals toward the stations.
        let preparation =
            Preparation { orientation: Orientation::Station, ..Preparation::default() };
        let mut points = scenes::prepared(cloud.clone(), &preparation, *kind);
        points.has_front_sides = points.cloud().has_stations();
        report_secs(case.name, &format!("{surface} prepared"), begin);
        if selection.written_clouds.is_some() {
            let (cloud, _) = select_points(cloud.clone(), &preparation, &NoProgress).unwrap();
            let cloud = with_normals(cloud, points.cloud(), scene, &*case.instrument);
            reconstruction::write_cloud(selection, case.name, &cloud);
        }
        let begin = Instant::now();
        compared.push(Compared::new(&format!("`{surface}`"), views, Geometry::Points(points)));
        report_secs(case.name, &format!("{surface} built and rendered"), begin);
    }
    if let Some(found) = reconstruction::read(selection, case.name) {
        eprintln!("{}: {METHOD} in {:.2} processor seconds", case.name, found.secs);
        compared.push(Compared::new(METHOD, views, Geometry::Triangles(found.mesh)));
    }
    compared
}

/// Returns the selected points of a scan with the normals of their prepared form, turned toward a position from which the instrument saw the
/// point: another program needs oriented normals, which it cannot tell without these positions.
fn with_normals(
    cloud: PointCloud,
    prepared: &PointCloud,
    scene: &NamedScene,
    instrument: &dyn Instrument,
) -> PointCloud {
    let toward_instrument = |(i, normal): (usize, &Vec3)| {
        let point = cloud.world_position(i);
        let viewpoints = instrument.viewpoints(point);
        let mut seen_from =
            viewpoints.iter().filter(|from| scene.sdf.is_visible_from(**from, point));
        let is_away =
            seen_from.next().is_some_and(|from| normal.as_dvec3().dot(*from - point) < 0.0);
        if is_away { -*normal } else { *normal }
    };
    let normals = prepared.normals.as_deref().unwrap_or_default();
    let normals = normals.par_iter().enumerate().map(toward_instrument).collect();
    PointCloud { normals: Some(normals), ..cloud }
}

fn report_secs(case: &str, done: &str, begin: Instant) {
    eprintln!("{case}: {done} in {:.2} s", begin.elapsed().as_secs_f64());
}

fn print_tables(title: &str, n_points: usize, compared: &[Compared]) {
    let background = |Compared { surface, quality, .. }: &Compared| {
        quality.false_hits.map(|fraction| format!("{:.2} % by {surface}", 100.0 * fraction))
    };
    let background: Vec<String> = compared.iter().filter_map(background).collect();
    let background = match &background[..] {
        [] => "no background".to_owned(),
        all => format!("background falsely covered: {}", all.join(", ")),
    };
    println!("\n{title}: {} points, {background}:\n", grouped(n_points));
    println!(
        "| object | surface | pixels | shown % | far off % | depth, mm | normals | \
         coverage error of blocks % | lit, dB |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    let n_kinds = compared.first().map_or(0, |compared| compared.quality.kinds.len());
    for kind_idx in 0..n_kinds {
        for Compared { surface, quality, .. } in compared {
            let kind = &quality.kinds[kind_idx];
            if 0 < kind.n_pixels {
                print_row(surface, kind);
            }
        }
    }
}

fn print_row(surface: &str, kind: &KindQuality) {
    println!(
        "| {} | {surface} | {} | {:.2} | {:.2} | {:.1} | {:.1}° | {:.1} | {:.1} |",
        kind.kind,
        kind.n_pixels,
        100.0 * kind.shown,
        100.0 * kind.far_off,
        1000.0 * kind.depth_rms,
        kind.normal_deg,
        100.0 * kind.block_coverage_error,
        kind.lit_psnr_db,
    );
}

/// Writes a number with commas between groups of three digits.
fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if 0 < i && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}
