//! The angular-gap test: do the points surround a hit, or does it lie beyond the edge of the surface?

use crate::math::{Frame, Vec3};

/// Points within this many radii of the hit count ...
pub const NEIGHBOR_REACH: f32 = 1.3;
/// ... if they are not farther than this many from the tangent plane.
const THICKNESS: f32 = 0.8;
/// More points than this do not change the answer.
pub const MAX_NEIGHBORS: usize = 64;

/// How the points lie around a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surroundings {
    /// No gap of 150 degrees: on the surface.
    Enclosed,
    /// A gap of 150 to 200 degrees: at an edge, taken if nothing better follows.
    Edge,
    /// A wider gap, or too few points: beyond the surface.
    Outside,
}

/// Judges a hit with unit `normal` by the points around it, given relative to the hit; those out of
/// reach of `radius` are passed over.
pub fn surroundings(normal: Vec3, radius: f32, offsets: &[Vec3]) -> Surroundings {
    let frame = Frame::around(normal);
    let mut directions = [(0.0f32, 0.0f32); MAX_NEIGHBORS];
    let (mut n_near, mut n) = (0, 0);
    for offset in offsets {
        if n == MAX_NEIGHBORS {
            break;
        }
        let reach = NEIGHBOR_REACH * radius;
        if offset.length_squared() < reach * reach && normal.dot(*offset).abs() < THICKNESS * radius
        {
            n_near += 1;
            let (x, y) = frame.project(*offset);
            let length = (x * x + y * y).sqrt();
            // A point straight under the hit has no angle.
            if 1e-3 * radius < length {
                directions[n] = (x / length, y / length);
                n += 1;
            }
        }
    }
    if n_near < 4 { Surroundings::Outside } else { judge_gaps(&mut directions[..n]) }
}

fn judge_gaps(directions: &mut [(f32, f32)]) -> Surroundings {
    const COS_150: f32 = -0.866_025_4;
    const COS_200: f32 = -0.939_692_6;
    if directions.is_empty() {
        return Surroundings::Outside;
    }
    directions.sort_unstable_by(|a, b| pseudo_angle(*a).total_cmp(&pseudo_angle(*b)));
    let mut worst = Surroundings::Enclosed;
    for (i, &(x, y)) in directions.iter().enumerate() {
        let (next_x, next_y) = directions[(i + 1) % directions.len()];
        let (cos, sin) = (x * next_x + y * next_y, x * next_y - y * next_x);
        // A single direction, or several equal ones, leaves a full turn.
        let is_full_turn = i + 1 == directions.len() && sin == 0.0 && 0.0 < cos;
        if is_full_turn || (sin < 0.0 && COS_200 < cos) {
            return Surroundings::Outside;
        }
        if sin < 0.0 || cos < COS_150 {
            worst = Surroundings::Edge;
        }
    }
    worst
}

/// Grows with the angle of a unit vector, from 0 to 4 (no arc tangent: the same on every machine).
fn pseudo_angle((x, y): (f32, f32)) -> f32 {
    if 0.0 <= y { 1.0 - x } else { 3.0 + x }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_angles(degrees: &[f32]) -> Vec<Vec3> {
        degrees.iter().map(|a| Vec3::new(a.to_radians().cos(), a.to_radians().sin(), 0.1)).collect()
    }

    fn judge(degrees: &[f32]) -> Surroundings {
        surroundings(Vec3::Z, 1.0, &at_angles(degrees))
    }

    #[test]
    fn the_largest_gap_decides() {
        assert_eq!(judge(&[0.0, 90.0, 180.0, 270.0]), Surroundings::Enclosed);
        assert_eq!(judge(&[0.0, 70.0, 140.0, 211.0]), Surroundings::Enclosed);
        assert_eq!(judge(&[0.0, 60.0, 120.0, 208.0]), Surroundings::Edge);
        assert_eq!(judge(&[10.0, 60.0, 120.0, 171.0]), Surroundings::Edge);
        assert_eq!(judge(&[10.0, 60.0, 120.0, 169.0]), Surroundings::Outside);
        assert_eq!(judge(&[0.0, 20.0, 40.0, 60.0]), Surroundings::Outside);
        assert_eq!(judge(&[300.0, 301.0, 299.0, 298.0]), Surroundings::Outside);
        assert_eq!(judge(&[45.0; 5]), Surroundings::Outside);
        assert_eq!(judge(&[0.0, 120.0, 240.0]), Surroundings::Outside);
    }

    #[test]
    fn points_off_the_plane_or_out_of_reach_do_not_count() {
        let mut points = at_angles(&[0.0, 90.0, 180.0]);
        for stray in [Vec3::new(0.0, -1.4, 0.0), Vec3::new(0.0, -0.5, 0.9)] {
            points.push(stray);
            assert_eq!(surroundings(Vec3::Z, 1.0, &points), Surroundings::Outside);
            points.pop();
        }
        points.push(Vec3::new(0.0, -1.2, 0.0));
        assert_eq!(surroundings(Vec3::Z, 1.0, &points), Surroundings::Enclosed);
    }
}
