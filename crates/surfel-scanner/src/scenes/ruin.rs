//! The demo scene: a temple in ruins, 30 metres across.

use super::named_scene::{NamedScene, SceneView};
use crate::classes::{BUILDING, GROUND, MEDIUM_VEGETATION};
use crate::instruments::{Scanner, Station, TerrestrialSurvey};
use crate::noise::unit;
use crate::parts::column::{ColumnSdf, Drum};
use crate::parts::foliage::Foliage;
use crate::parts::masonry::{Arch, Ashlar, MarbleBall};
use crate::parts::terrain::Terrain;
use crate::parts::weathered::{Break, LocalFrame, Weathered};
use crate::sdf::SdfScene;
use surfel_core::Result;
use surfel_core::math::DVec3;
use surfel_core::math::hash;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;

/// Height of the platform that the columns stand on.
pub const FLOOR: f64 = 1.05;
/// Centre of the polished ball.
pub const BALL_CENTER: DVec3 = DVec3::new(-0.5, 0.1, FLOOR + 2.05);
/// Radius of the polished ball.
pub const BALL_RADIUS: f64 = 1.0;
/// World coordinates of the scene's origin: UTM zone 34 north, heights above the ellipsoid.
pub const UTM_ORIGIN: DVec3 = DVec3::new(562_340.0, 4_183_210.0, 148.0);

const COLUMN_HEIGHT: f64 = 5.6;
const COLUMN_RADIUS: f64 = 0.5;
const ROW_OFFSET: f64 = 3.7;
const TERRAIN: Terrain = Terrain { radius: 24.0, platform: (10.0, 5.9) };

/// Returns the scene. Its origin lies in the middle of the platform, at the height of the ground.
pub fn scene() -> SdfScene {
    let mut scene = SdfScene::default();
    add_columns(&mut scene);
    add_beams(&mut scene);
    add_ball(&mut scene);
    add_arch(&mut scene);
    add_fallen(&mut scene);
    add_greenery(&mut scene);
    add_platform(&mut scene);
    scene.add(TERRAIN);
    scene
}

/// Returns a three-quarter view for an aspect ratio of 16 to 9.
pub fn view() -> SceneView {
    SceneView {
        position: DVec3::new(-15.5, -20.5, 6.8),
        focal_point: DVec3::new(1.6, 0.0, 2.2),
        view_angle_deg: 32.5,
    }
}

/// Returns the scanner's stations: masts around the ruin, a tripod before it and one between its columns.
pub fn stations() -> [Station; 6] {
    let center = DVec3::new(0.0, 0.0, FLOOR);
    let toward = |x, y, above: f64, span: f64, low: f64, high: f64| {
        let position = DVec3::new(x, y, TERRAIN.height(x, y) + above);
        Station::toward(position, center, span.to_radians(), (low.to_radians(), high.to_radians()))
    };
    let inside = Station {
        elevation_rad: ((-45f64).to_radians(), 75f64.to_radians()),
        ..Station::full_dome(DVec3::new(3.2, -0.9, FLOOR + 1.8))
    };
    [
        toward(-14.0, -17.0, 8.5, 110.0, -50.0, 12.0),
        toward(2.0, -15.5, 1.8, 150.0, -35.0, 40.0),
        toward(17.5, -9.0, 8.0, 120.0, -50.0, 12.0),
        toward(-4.0, 15.5, 6.5, 220.0, -45.0, 25.0),
        toward(-17.5, 5.5, 5.0, 170.0, -45.0, 20.0),
        inside,
    ]
}

/// Returns the scene with names for its objects by their ASPRS class, with the view of the demo and one from behind.
pub fn named_scene() -> NamedScene {
    let sdf = scene();
    let name = |part_idx: usize| match sdf.part(part_idx).class() {
        GROUND => "ground",
        MEDIUM_VEGETATION => "plants",
        BUILDING => "masonry",
        _ => "ball",
    };
    let object_names = (0..sdf.n_parts()).map(name).collect();
    let mut scene = NamedScene { object_names, sdf, views: vec![view()] };
    scene.look([9.0, 17.0, 5.0], [0.0, 0.0, 3.0]);
    scene
}

/// Returns the demo's survey with an angle of `step_deg` between rays.
pub fn terrestrial(step_deg: f64) -> TerrestrialSurvey {
    let step_rad = step_deg.to_radians();
    let scanner = Scanner { step_rad, with_grid: true, ..Scanner::default() };
    TerrestrialSurvey { scanner, stations: stations().to_vec() }
}

/// Scans the ruin with about `n_points` points.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](surfel_core::Error::Cancelled) if `progress` is cancelled.
pub fn scan(n_points: usize, progress: &dyn Progress) -> Result<PointCloud> {
    // Number of points of a scan times the square of its angular step, measured at a million points.
    const POINTS_TIMES_STEP_SQUARED: f64 = 14.74;
    let step_rad = (POINTS_TIMES_STEP_SQUARED / n_points.max(100) as f64).sqrt();
    let scanner = Scanner { step_rad, origin: UTM_ORIGIN, ..Scanner::default() };
    scanner.scan(&scene(), &stations(), progress)
}

fn add_platform(scene: &mut SdfScene) {
    for step in 0..3u8 {
        let inset = 0.5 * f64::from(step);
        // The lowest step extends into the ground.
        let depth = if step == 0 { 0.8 } else { 0.0 };
        let height = 0.35 + depth;
        let shape = Ashlar {
            half: DVec3::new(10.2 - inset, 6.1 - inset, 0.5 * height),
            block: DVec3::new(1.36, 1.22, 2.0),
            seed: 900 + u64::from(step),
        };
        let bottom = 0.35 * f64::from(step) - depth;
        scene.add(Weathered {
            shape,
            frame: at(0.0, 0.0, bottom),
            broken: None,
            seed: 30 + u64::from(step),
        });
    }
}

/// Remaining height of each column, from west to east; 9 is a whole column.
const FRONT_ROW: [f64; 7] = [9.0, 3.2, 1.3, 0.75, 2.4, 9.0, 9.0];
const BACK_ROW: [f64; 7] = [9.0, 9.0, 9.0, 9.0, 4.3, 9.0, 2.7];

fn add_columns(scene: &mut SdfScene) {
    let rows = [(-ROW_OFFSET, FRONT_ROW), (ROW_OFFSET, BACK_ROW)];
    for (row_idx, (y, heights)) in rows.into_iter().enumerate() {
        for (i, left) in heights.into_iter().enumerate() {
            let seed = hash((10 * row_idx + i) as u64);
            let shape = ColumnSdf { height: COLUMN_HEIGHT, radius: COLUMN_RADIUS, seed };
            let lean = DVec3::new(unit(seed) - 0.5, unit(seed ^ 1) - 0.5, 1.0).normalize();
            let broken = (left < COLUMN_HEIGHT).then_some(Break { normal: lean, offset: left });
            scene.add(Weathered { shape, frame: at(column_x(i), y, FLOOR), broken, seed });
        }
    }
}

fn column_x(i: usize) -> f64 {
    2.6 * (i as f64 - 3.0)
}

/// Adds the architraves: along the back over four columns, and over the last two of the front.
fn add_beams(scene: &mut SdfScene) {
    let top = FLOOR + COLUMN_HEIGHT;
    let beam = |from: f64, to: f64, height: f64, seed| Ashlar {
        half: DVec3::new(0.5 * (to - from), 0.46, 0.5 * height),
        block: DVec3::new(2.6, 2.0, 0.6),
        seed,
    };
    let middle = |from: f64, to: f64| 0.5 * (from + to);
    let (west, east) = (column_x(0) - 0.6, column_x(3) + 1.0);
    let snapped = Break {
        normal: DVec3::new(0.93, 0.0, 0.37).normalize(),
        offset: 0.5 * (east - west) - 0.6,
    };
    let back = at(middle(west, east), ROW_OFFSET, top);
    scene.add(Weathered {
        shape: beam(west, east, 1.2, 71),
        frame: back,
        broken: Some(snapped),
        seed: 71,
    });
    let (west, east) = (column_x(5) - 0.6, column_x(6) + 0.6);
    let front = at(middle(west, east), -ROW_OFFSET, top);
    scene.add(Weathered { shape: beam(west, east, 0.6, 72), frame: front, broken: None, seed: 72 });
}

fn add_ball(scene: &mut SdfScene) {
    let base = DVec3::new(BALL_CENTER.x, BALL_CENTER.y, FLOOR);
    let foot = Ashlar { half: DVec3::new(0.95, 0.95, 0.14), block: DVec3::splat(3.0), seed: 81 };
    let die = Ashlar { half: DVec3::new(0.72, 0.72, 0.55), block: DVec3::splat(3.0), seed: 82 };
    scene.add(MarbleBall { center: BALL_CENTER, radius: BALL_RADIUS });
    scene.add(Weathered {
        shape: foot,
        frame: LocalFrame::upright(base, 0.0),
        broken: None,
        seed: 81,
    });
    scene.add(Weathered {
        shape: die,
        frame: LocalFrame::upright(base, 0.0),
        broken: None,
        seed: 82,
    });
}

/// Middle of the arch's base.
const ARCH: (f64, f64) = (15.2, -3.4);
const ARCH_YAW_RAD: f64 = -0.8;

fn add_arch(scene: &mut SdfScene) {
    let (x, y) = ARCH;
    let frame = LocalFrame::upright(DVec3::new(x, y, TERRAIN.height(x, y) - 0.4), ARCH_YAW_RAD);
    let shape =
        Arch { spring_height: 3.2, inner_radius: 1.7, ring: 0.85, half_depth: 0.6, seed: 5 };
    scene.add(Weathered { shape, frame, broken: None, seed: 5 });
    for (side, length, left, seed) in [(-1.0, 1.1, 1.7, 51), (1.0, 1.6, 2.6, 52)] {
        let shape =
            Ashlar { half: DVec3::new(length, 0.5, 1.75), block: DVec3::new(0.9, 2.0, 0.5), seed };
        let foot = frame.position + side * (2.6 + length) * frame.axes[0];
        let broken = Break { normal: DVec3::new(0.45 * side, 0.0, 0.9).normalize(), offset: left };
        scene.add(Weathered {
            shape,
            frame: LocalFrame { position: foot, ..frame },
            broken: Some(broken),
            seed,
        });
    }
}

fn add_fallen(scene: &mut SdfScene) {
    // x, y, direction of the drum's axis, its height.
    let drums = [
        (-4.6, -8.4, 0.5, 1.15),
        (-2.2, -9.6, 1.25, 1.15),
        (1.6, -8.0, 2.7, 0.9),
        (6.4, -8.8, 0.2, 1.1),
    ];
    for (i, (x, y, yaw, height)) in drums.into_iter().enumerate() {
        let seed = hash(200 + i as u64);
        let shape = Drum { height, radius: 0.47, seed };
        let position = DVec3::new(x, y, TERRAIN.height(x, y) + 0.36);
        let frame = LocalFrame::leaning(position, yaw, 1.5 + 0.2 * unit(seed));
        scene.add(Weathered { shape, frame, broken: None, seed });
    }
    for i in 0..46u64 {
        let seed = hash(300 + i);
        let angle = std::f64::consts::TAU * unit(seed);
        let distance = 1.0 + 0.75 * unit(seed ^ 1).powi(2);
        add_boulder(scene, 11.0 * distance * angle.cos(), 7.0 * distance * angle.sin(), seed);
    }
}

/// Adds a block or a fragment of one, half buried.
fn add_boulder(scene: &mut SdfScene, x: f64, y: f64, seed: u64) {
    let size = 0.14 + 0.36 * unit(seed ^ 2).powi(3);
    let half = size * DVec3::new(1.0 + 0.8 * unit(seed ^ 3), 1.0, 0.6 + 0.3 * unit(seed ^ 4));
    let shape = Ashlar { half, block: DVec3::splat(4.0), seed };
    let position = DVec3::new(x, y, TERRAIN.height(x, y) - 0.5 * half.z);
    let frame = LocalFrame::leaning(position, 6.0 * unit(seed ^ 5), 0.5 * unit(seed ^ 6));
    scene.add(Weathered { shape, frame, broken: None, seed });
}

fn add_greenery(scene: &mut SdfScene) {
    let mut add = |x: f64, y: f64, half: DVec3, seed| {
        let center = DVec3::new(x, y, TERRAIN.height(x, y) + 0.8 * half.z);
        scene.add(Foliage { center, half, seed });
    };
    add(13.5, 8.5, DVec3::new(0.95, 0.95, 4.6), 1);
    add(16.6, 5.2, DVec3::new(0.85, 0.85, 3.8), 2);
    add(-13.5, 10.5, DVec3::new(0.9, 0.9, 4.2), 3);
    add(-11.6, 4.5, DVec3::new(0.9, 0.7, 0.6), 4);
    add(9.0, -9.6, DVec3::new(0.7, 0.8, 0.5), 5);
    add(-0.9, -7.2, DVec3::new(0.6, 0.45, 0.4), 6);
    add(11.6, -7.8, DVec3::new(1.0, 0.8, 0.7), 7);
    add(-14.5, -3.5, DVec3::new(0.8, 0.9, 0.6), 8);
}

fn at(x: f64, y: f64, z: f64) -> LocalFrame {
    LocalFrame::upright(DVec3::new(x, y, z), 0.0)
}

#[cfg(test)]
mod tests {
    //! Scans of the ruin.

    use super::*;
    use crate::DRay;
    use surfel_core::progress::NoProgress;

    #[test]
    fn a_scan_has_every_part_of_the_ruin_and_about_the_requested_points() {
        let cloud = scan(60_000, &NoProgress).unwrap();
        assert!((54_000..66_000).contains(&cloud.len()), "{}", cloud.len());
        assert!(cloud.positions.iter().all(|p| p.is_finite()));
        assert!(cloud.intensity.as_ref().unwrap().iter().all(|i| (0.0..=65535.0).contains(i)));
        let n_near = |center: DVec3, radius: f64| {
            cloud.positions.iter().filter(|p| (p.as_dvec3() - center).length() < radius).count()
        };
        assert!(200 < n_near(BALL_CENTER, BALL_RADIUS + 0.02));
        for i in [0, 1, 2, 3, 5] {
            let middle_of_shaft = DVec3::new(column_x(i), ROW_OFFSET, FLOOR + 3.0);
            assert!(50 < n_near(middle_of_shaft, 1.0), "column {i}");
        }
        let crown = DVec3::new(ARCH.0, ARCH.1, TERRAIN.height(ARCH.0, ARCH.1) - 0.4 + 3.2 + 2.1);
        assert!(20 < n_near(crown, 0.9));
        let ground = cloud.classification.as_ref().unwrap().iter().filter(|&&class| class == 2);
        assert!(10_000 < ground.count());
    }

    #[test]
    fn points_lie_on_the_surface() {
        let cloud = scan(50_000, &NoProgress).unwrap();
        let scene = scene();
        for position in &cloud.positions {
            let distance = scene.distance(position.as_dvec3());
            // Five deviations of the noise plus the tolerance of sphere tracing.
            assert!(distance.abs() < 0.011, "{position}: {distance}");
        }
    }

    #[test]
    fn the_named_scene_has_a_name_for_every_part() {
        let named = named_scene();
        assert_eq!(named.object_names.len(), named.sdf.n_parts());
        let mut kinds = named.object_kinds();
        kinds.sort_unstable();
        assert_eq!(kinds, ["ball", "ground", "masonry", "plants"]);
    }

    #[test]
    fn the_view_shows_the_ball() {
        let SceneView { position, focal_point, .. } = view();
        let toward_ball = (BALL_CENTER - position).normalize();
        assert!(0.95 < toward_ball.dot((focal_point - position).normalize()));
        let ray = DRay { origin: position, direction: toward_ball };
        let hit = scene().first_hit(&ray, 100.0).unwrap();
        let expected = (BALL_CENTER - position).length() - BALL_RADIUS;
        assert!((hit.distance - expected).abs() < 1e-3, "{}", hit.distance);
    }
}
