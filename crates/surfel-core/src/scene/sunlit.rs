//! How much of what a scanner measured the sun reaches, by the scan itself: where a ray to the sun comes behind a
//! measured point, seen from the station, something shadows it.

use super::direction_cells::{PolarPoint, cells, polar_points};
use super::ground::ground_axes;
use super::sample::sample_points;
use crate::math::{Vec3, median};
use std::collections::BTreeMap;
use std::ops::Range;

/// Width and height of the cells of directions: a few rings of a spinning laser.
const CELL_DEG: f32 = 3.0;
/// Angle of the view to either side of its middle, seen from above: that of a picture of 16:9.
const HALF_VIEW_DEG: f32 = 50.0;
/// Maximum number of points that are looked at: enough for some 50 in each cell of directions.
const MAX_SAMPLES: usize = 400_000;
/// Maximum number of points whose way to the sun is followed.
const MAX_POINTS: usize = 5000;
/// Length of the first step toward the sun, as a fraction of the point's distance, and the ratio of each step's end to
/// that before.
const FIRST_STEP: f32 = 0.16;
const STEP_RATIO: f32 = 1.08;
/// Number of steps: the last is 15 times as long as the point is far.
const N_STEPS: i32 = 60;
/// Range of the ratio of a place's distance to that of the points in its direction in which a ray to the sun has just
/// passed through them. Farther behind it may have come around their edge.
const PASSED_RATIO: Range<f32> = 1.1..1.5;

/// Returns the fraction of the points in view that the sun reaches, or 1 if there are none. What lies where the scanner
/// measured nothing shadows nothing.
///
/// `station` is the scanner's position among `points`, `ahead` the horizontal direction of the view, and `to_sun` the
/// direction to the sun.
pub fn sunlit_fraction(points: &[Vec3], station: Vec3, ahead: Vec3, to_sun: Vec3, up: Vec3) -> f64 {
    let points = sample_points(points, MAX_SAMPLES);
    let distances = median_distances(&polar_points(station, &points, up));
    let offsets = points.iter().map(|point| *point - station);
    let is_in_view = |offset: &Vec3| {
        let level = offset.reject_from_normalized(up);
        HALF_VIEW_DEG.to_radians().cos() * level.length() < level.dot(ahead)
    };
    let in_view: Vec<Vec3> = offsets.filter(is_in_view).collect();
    let step = in_view.len().div_ceil(MAX_POINTS).max(1);
    let followed: Vec<Vec3> = in_view.into_iter().step_by(step).collect();
    let (east, north) = ground_axes(up);
    let is_shadowed = |offset: &Vec3| {
        (0..N_STEPS).any(|i| {
            let sampled = *offset + FIRST_STEP * STEP_RATIO.powi(i) * offset.length() * to_sun;
            PolarPoint::of_offset(sampled, east, north, up).is_some_and(|polar| {
                let measured = distances.get(&polar.cell(CELL_DEG));
                measured.is_some_and(|distance| PASSED_RATIO.contains(&(polar.distance / distance)))
            })
        })
    };
    let n_shadowed = followed.iter().filter(|offset| is_shadowed(offset)).count();
    1.0 - n_shadowed as f64 / followed.len().max(1) as f64
}

/// Returns the median distance in each cell of directions that has points.
fn median_distances(points: &[PolarPoint]) -> BTreeMap<(u32, u32), f32> {
    let cells = cells(points, CELL_DEG).into_iter();
    cells.filter_map(|(cell, distances)| Some((cell, median(distances)?))).collect()
}

#[cfg(test)]
mod tests {
    //! Scans of an open square, of an arcade, and from below a small roof.

    use super::*;
    use std::f32::consts::{PI, TAU};

    /// Returns what a spinning laser between a ground 2 m below it and a ceiling measures; `is_covered` tells where the
    /// ceiling is, and elsewhere is a wall 40 m away.
    fn scan(is_covered: impl Fn(Vec3) -> bool) -> Vec<Vec3> {
        let rays = (0..80).flat_map(|row| (0..360).map(move |column| (row, column)));
        let hit = |(row, column): (i32, i32)| {
            let elevation = PI * (0.5 + row as f32) / 80.0 - PI / 2.0;
            let (sin, cos) = (TAU * column as f32 / 360.0).sin_cos();
            let direction =
                Vec3::new(elevation.cos() * sin, elevation.cos() * cos, elevation.sin());
            let level = direction.truncate().length();
            if direction.z < 0.0 {
                return Some((2.0 / -direction.z).min(40.0 / level) * direction);
            }
            let at_ceiling = 1.5 / direction.z * direction;
            let at_wall = 40.0 / level * direction;
            let nearest = if is_covered(at_ceiling) && at_ceiling.length() < 40.0 {
                at_ceiling
            } else {
                at_wall
            };
            (nearest.z < 8.0).then_some(nearest)
        };
        rays.filter_map(hit).collect()
    }

    fn sunlit(points: &[Vec3]) -> f64 {
        let to_sun = Vec3::new(0.5, -0.5, 0.6).normalize();
        sunlit_fraction(points, Vec3::ZERO, Vec3::Y, to_sun, Vec3::Z)
    }

    #[test]
    fn the_sun_reaches_an_open_square_but_not_an_arcade() {
        let square = sunlit(&scan(|_| false));
        assert!(0.9 < square, "{square}");
        let arcade = sunlit(&scan(|_| true));
        assert!(arcade < 0.1, "{arcade}");
        let roof = sunlit(&scan(|position| position.truncate().length() < 2.5));
        assert!(0.5 < roof && roof < square, "{roof}");
        assert_eq!(sunlit(&[]), 1.0);
    }
}
