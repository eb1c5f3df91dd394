//! The demo site: a temple in ruins, 30 metres across.

use super::column::{Column, Drum};
use super::foliage::Foliage;
use super::masonry::{Arch, Ashlar, MarbleBall};
use super::noise::unit;
use super::scan::Scanner;
use super::site::Site;
use super::station::Station;
use super::terrain::Terrain;
use super::weathered::{Break, Pose, Weathered};
use crate::error::Result;
use crate::math::DVec3;
use crate::math::hash;
use crate::points::PointCloud;
use crate::progress::Progress;

/// A camera: eye and target in the site's own coordinates, vertical field of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    pub eye: DVec3,
    pub target: DVec3,
    pub vertical_fov_deg: f64,
}

/// Top of the platform, where the columns stand.
pub const FLOOR: f64 = 1.05;
/// Middle of the polished ball.
pub const BALL_CENTER: DVec3 = DVec3::new(-0.5, 0.1, FLOOR + 2.05);
pub const BALL_RADIUS: f64 = 1.0;
/// Where a survey of the site places its origin: UTM zone 34 north, heights above the ellipsoid.
pub const UTM_ORIGIN: DVec3 = DVec3::new(562_340.0, 4_183_210.0, 148.0);

const COLUMN_HEIGHT: f64 = 5.6;
const COLUMN_RADIUS: f64 = 0.5;
const ROW_OFFSET: f64 = 3.7;
const TERRAIN: Terrain = Terrain { radius: 24.0, platform: (10.0, 5.9) };

/// The whole site; its origin lies in the middle of the platform, at the height of the ground.
pub fn site() -> Site {
    let mut site = Site::default();
    add_columns(&mut site);
    add_beams(&mut site);
    add_ball(&mut site);
    add_arch(&mut site);
    add_fallen(&mut site);
    add_greenery(&mut site);
    add_platform(&mut site);
    site.add(TERRAIN);
    site
}

/// A three-quarter view for a picture of 16 to 9.
pub fn view() -> View {
    View {
        eye: DVec3::new(-15.5, -20.5, 6.8),
        target: DVec3::new(1.6, 0.0, 2.2),
        vertical_fov_deg: 32.5,
    }
}

/// Masts around the ruin, a tripod before it and one between its columns.
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

/// A scan of the ruin with about `n_points` points.
pub fn scan(n_points: usize, progress: &dyn Progress) -> Result<PointCloud> {
    // Points a scan gives times the square of its angular step, measured at a million points.
    const POINTS_TIMES_STEP_SQUARED: f64 = 14.74;
    let step_rad = (POINTS_TIMES_STEP_SQUARED / n_points.max(100) as f64).sqrt();
    let scanner = Scanner { step_rad, origin: UTM_ORIGIN, ..Scanner::default() };
    scanner.scan(&site(), &stations(), progress)
}

fn add_platform(site: &mut Site) {
    for step in 0..3u8 {
        let inset = 0.5 * f64::from(step);
        // The lowest step goes down into the ground.
        let depth = if step == 0 { 0.8 } else { 0.0 };
        let height = 0.35 + depth;
        let shape = Ashlar {
            half: DVec3::new(10.2 - inset, 6.1 - inset, 0.5 * height),
            block: DVec3::new(1.36, 1.22, 2.0),
            seed: 900 + u64::from(step),
        };
        let bottom = 0.35 * f64::from(step) - depth;
        site.add(Weathered {
            shape,
            pose: at(0.0, 0.0, bottom),
            broken: None,
            seed: 30 + u64::from(step),
        });
    }
}

/// Height that is left of each column, from west to east; 9 is a whole one.
const FRONT_ROW: [f64; 7] = [9.0, 3.2, 1.3, 0.75, 2.4, 9.0, 9.0];
const BACK_ROW: [f64; 7] = [9.0, 9.0, 9.0, 9.0, 4.3, 9.0, 2.7];

fn add_columns(site: &mut Site) {
    let rows = [(-ROW_OFFSET, FRONT_ROW), (ROW_OFFSET, BACK_ROW)];
    for (row_idx, (y, heights)) in rows.into_iter().enumerate() {
        for (i, left) in heights.into_iter().enumerate() {
            let seed = hash((10 * row_idx + i) as u64);
            let shape = Column { height: COLUMN_HEIGHT, radius: COLUMN_RADIUS, seed };
            let lean = DVec3::new(unit(seed) - 0.5, unit(seed ^ 1) - 0.5, 1.0).normalize();
            let broken = (left < COLUMN_HEIGHT).then_some(Break { normal: lean, offset: left });
            site.add(Weathered { shape, pose: at(column_x(i), y, FLOOR), broken, seed });
        }
    }
}

fn column_x(i: usize) -> f64 {
    2.6 * (i as f64 - 3.0)
}

/// Architraves: along the back over four columns, and over the last two of the front.
fn add_beams(site: &mut Site) {
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
    site.add(Weathered {
        shape: beam(west, east, 1.2, 71),
        pose: back,
        broken: Some(snapped),
        seed: 71,
    });
    let (west, east) = (column_x(5) - 0.6, column_x(6) + 0.6);
    let front = at(middle(west, east), -ROW_OFFSET, top);
    site.add(Weathered { shape: beam(west, east, 0.6, 72), pose: front, broken: None, seed: 72 });
}

fn add_ball(site: &mut Site) {
    let base = DVec3::new(BALL_CENTER.x, BALL_CENTER.y, FLOOR);
    let foot = Ashlar { half: DVec3::new(0.95, 0.95, 0.14), block: DVec3::splat(3.0), seed: 81 };
    let die = Ashlar { half: DVec3::new(0.72, 0.72, 0.55), block: DVec3::splat(3.0), seed: 82 };
    site.add(MarbleBall { center: BALL_CENTER, radius: BALL_RADIUS });
    site.add(Weathered { shape: foot, pose: Pose::upright(base, 0.0), broken: None, seed: 81 });
    site.add(Weathered { shape: die, pose: Pose::upright(base, 0.0), broken: None, seed: 82 });
}

/// Middle of the arch's foot.
const ARCH: (f64, f64) = (15.2, -3.4);
const ARCH_YAW_RAD: f64 = -0.8;

fn add_arch(site: &mut Site) {
    let (x, y) = ARCH;
    let pose = Pose::upright(DVec3::new(x, y, TERRAIN.height(x, y) - 0.4), ARCH_YAW_RAD);
    let shape =
        Arch { spring_height: 3.2, inner_radius: 1.7, ring: 0.85, half_depth: 0.6, seed: 5 };
    site.add(Weathered { shape, pose, broken: None, seed: 5 });
    for (side, length, left, seed) in [(-1.0, 1.1, 1.7, 51), (1.0, 1.6, 2.6, 52)] {
        let shape =
            Ashlar { half: DVec3::new(length, 0.5, 1.75), block: DVec3::new(0.9, 2.0, 0.5), seed };
        let foot = pose.position + side * (2.6 + length) * pose.axes[0];
        let broken = Break { normal: DVec3::new(0.45 * side, 0.0, 0.9).normalize(), offset: left };
        site.add(Weathered {
            shape,
            pose: Pose { position: foot, ..pose },
            broken: Some(broken),
            seed,
        });
    }
}

fn add_fallen(site: &mut Site) {
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
        let pose = Pose::leaning(position, yaw, 1.5 + 0.2 * unit(seed));
        site.add(Weathered { shape, pose, broken: None, seed });
    }
    for i in 0..46u64 {
        let seed = hash(300 + i);
        let angle = std::f64::consts::TAU * unit(seed);
        let reach = 1.0 + 0.75 * unit(seed ^ 1).powi(2);
        add_boulder(site, 11.0 * reach * angle.cos(), 7.0 * reach * angle.sin(), seed);
    }
}

/// A block or a splinter of one, half sunk in.
fn add_boulder(site: &mut Site, x: f64, y: f64, seed: u64) {
    let size = 0.14 + 0.36 * unit(seed ^ 2).powi(3);
    let half = size * DVec3::new(1.0 + 0.8 * unit(seed ^ 3), 1.0, 0.6 + 0.3 * unit(seed ^ 4));
    let shape = Ashlar { half, block: DVec3::splat(4.0), seed };
    let position = DVec3::new(x, y, TERRAIN.height(x, y) - 0.5 * half.z);
    let pose = Pose::leaning(position, 6.0 * unit(seed ^ 5), 0.5 * unit(seed ^ 6));
    site.add(Weathered { shape, pose, broken: None, seed });
}

fn add_greenery(site: &mut Site) {
    let mut add = |x: f64, y: f64, half: DVec3, seed| {
        let center = DVec3::new(x, y, TERRAIN.height(x, y) + 0.8 * half.z);
        site.add(Foliage { center, half, seed });
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

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::upright(DVec3::new(x, y, z), 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::scanner::Beam;

    #[test]
    fn a_scan_has_every_part_of_the_ruin_and_about_the_points_asked_for() {
        let cloud = scan(60_000, &Silent).unwrap();
        assert!((54_000..66_000).contains(&cloud.len()), "{}", cloud.len());
        assert!(cloud.positions.iter().all(|p| p.is_finite()));
        assert!(cloud.intensity.as_ref().unwrap().iter().all(|i| (0.0..=65535.0).contains(i)));
        let near = |place: DVec3, reach: f64| {
            cloud.positions.iter().filter(|p| (p.as_dvec3() - place).length() < reach).count()
        };
        assert!(200 < near(BALL_CENTER, BALL_RADIUS + 0.02));
        for i in [0, 1, 2, 3, 5] {
            let middle_of_shaft = DVec3::new(column_x(i), ROW_OFFSET, FLOOR + 3.0);
            assert!(50 < near(middle_of_shaft, 1.0), "column {i}");
        }
        let crown = DVec3::new(ARCH.0, ARCH.1, TERRAIN.height(ARCH.0, ARCH.1) - 0.4 + 3.2 + 2.1);
        assert!(20 < near(crown, 0.9));
        let ground = cloud.classification.as_ref().unwrap().iter().filter(|&&class| class == 2);
        assert!(10_000 < ground.count());
    }

    #[test]
    fn points_lie_on_the_site() {
        let cloud = scan(50_000, &Silent).unwrap();
        let site = site();
        for position in &cloud.positions {
            let distance = site.distance(position.as_dvec3());
            // Five deviations of the noise, and the stop of the search.
            assert!(distance.abs() < 0.011, "{position}: {distance}");
        }
    }

    #[test]
    fn the_view_sees_the_ball() {
        let View { eye, target, .. } = view();
        let toward_ball = (BALL_CENTER - eye).normalize();
        assert!(0.95 < toward_ball.dot((target - eye).normalize()));
        let beam = Beam { origin: eye, direction: toward_ball };
        let hit = site().first_hit(&beam, 100.0).unwrap();
        let expected = (BALL_CENTER - eye).length() - BALL_RADIUS;
        assert!((hit.distance - expected).abs() < 1e-3, "{}", hit.distance);
    }
}
