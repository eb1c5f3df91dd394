//! Height profiles: the points beside a line over the ground, by their distance along it and their height.

use super::FlatScene;
use super::visit_points::{PointId, VisitedPoint, visit_points};
use crate::error::Result;
use crate::math::{DVec3, hash};
use crate::progress::Progress;

/// The line and the width of a profile.
#[derive(Clone, Debug)]
pub struct ProfileLine {
    /// Corners of the line in world coordinates, at least two.
    pub corners: Vec<DVec3>,
    /// Width of the strip whose points are shown, half of it on each side of the line.
    pub width: f64,
    /// The unit vector up; the profile is level across it.
    pub up: DVec3,
}

/// A point of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfilePoint {
    /// The point in its cloud.
    pub id: PointId,
    /// Position in world coordinates, as blocks of points hold it.
    pub position: DVec3,
    /// Distance from the first corner along the level line.
    pub distance: f64,
    /// Level distance from the line, positive on its left side.
    pub offset: f64,
    /// Coordinate along the up axis.
    pub height: f64,
    /// Colour as sRGB.
    pub color: [u8; 3],
}

/// The points of a profile.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    /// The points by their distance.
    pub points: Vec<ProfilePoint>,
    /// Number of points beside the line; more than `points` holds if there are too many.
    pub n_found: u64,
}

/// Fraction of the limit that is chosen among more points, so that hardly ever some at the end are cut off.
const CHOSEN_FRACTION: f64 = 0.97;

/// A level part of a line between two corners.
struct Segment {
    start: DVec3,
    /// Level unit vectors along the line, and to its left.
    along: DVec3,
    left: DVec3,
    length: f64,
    /// Distance of the start along the whole line.
    distance: f64,
}

/// Returns at most `limit` points beside a line, a fixed random choice if there are more.
///
/// # Errors
///
/// Fails if `progress` is cancelled.
pub fn height_profile(
    scene: &FlatScene,
    line: &ProfileLine,
    limit: usize,
    progress: &dyn Progress,
) -> Result<Profile> {
    let segments = segments(line);
    let n_found = visit(scene, line, &segments, u64::MAX, progress, |_| ())?.len() as u64;
    let threshold = match n_found <= limit as u64 {
        true => u64::MAX,
        false => (CHOSEN_FRACTION * limit as f64 / n_found as f64 * u64::MAX as f64) as u64,
    };
    let mut points = visit(scene, line, &segments, threshold, progress, |point| point)?;
    points.truncate(limit);
    points.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    Ok(Profile { points, n_found })
}

fn segments(line: &ProfileLine) -> Vec<Segment> {
    let mut distance = 0.0;
    let pairs = line.corners.windows(2).filter_map(|pair| {
        let along = (pair[1] - pair[0]).reject_from_normalized(line.up);
        let length = along.length();
        let along = along.try_normalize()?;
        let left = line.up.cross(along);
        let segment = Segment { start: pair[0], along, left, length, distance };
        distance += length;
        Some(segment)
    });
    pairs.collect()
}

/// Calls `keep` for each point beside the line whose hash is at most `threshold`; returns the results in a fixed order.
fn visit<T: Send>(
    scene: &FlatScene,
    line: &ProfileLine,
    segments: &[Segment],
    threshold: u64,
    progress: &dyn Progress,
    keep: impl Fn(ProfilePoint) -> T + Sync,
) -> Result<Vec<T>> {
    visit_points(scene, progress, |point| {
        let is_chosen = threshold == u64::MAX || hash(point.key) <= threshold;
        if !is_chosen {
            return None;
        }
        point_in_strip(point, line, segments).map(&keep)
    })
}

/// Returns the place of a point in the profile if it is beside the line, on the first segment that it is beside.
fn point_in_strip(
    point: &VisitedPoint,
    line: &ProfileLine,
    segments: &[Segment],
) -> Option<ProfilePoint> {
    segments.iter().find_map(|segment| {
        let to_point = point.position - segment.start;
        let (along, offset) = (segment.along.dot(to_point), segment.left.dot(to_point));
        let is_in_strip =
            (0.0..=segment.length).contains(&along) && offset.abs() <= line.width / 2.0;
        is_in_strip.then(|| ProfilePoint {
            id: point.id,
            position: point.position,
            distance: segment.distance + along,
            offset,
            height: line.up.dot(point.position),
            color: point.color,
        })
    })
}

#[cfg(test)]
mod tests {
    //! Profiles across a known hill.

    use super::super::visit_points::slope::slope;
    use super::*;
    use crate::progress::NoProgress;

    fn line(corners: &[[f64; 2]], width: f64) -> ProfileLine {
        let origin = DVec3::new(484_000.0, 6_632_000.0, 0.0);
        let corners = corners.iter().map(|[x, y]| origin + DVec3::new(*x, *y, 300.0)).collect();
        ProfileLine { corners, width, up: DVec3::Z }
    }

    #[test]
    fn a_profile_has_the_points_of_its_strip_in_order() {
        let scene = slope();
        // Along x at y = 50, then along y at x = 80.
        let line = line(&[[10.0, 50.0], [80.0, 50.0], [80.0, 90.0]], 4.2);
        let profile = height_profile(&scene, &line, 10_000, &NoProgress).unwrap();
        // Five rows of 71 points, and five columns of 41, of which the corner's 3 x 3 belong to the first part.
        assert_eq!(profile.n_found, 5 * 71 + 5 * 41 - 3 * 3);
        assert_eq!(profile.points.len() as u64, profile.n_found);
        assert!(profile.points.is_sorted_by_key(|point| point.distance));
        // A point at the corner may belong to either part.
        for point in profile.points.iter().filter(|point| point.distance != 70.0) {
            let height = 100.0
                + 0.5
                    * match point.distance {
                        0.0..=70.0 => 10.0 + point.distance,
                        _ => 80.0 - point.offset,
                    };
            assert!((point.height - height).abs() < 1e-3, "{point:?} {height}");
            assert!(point.offset.abs() <= 2.1 && point.color == [10, 20, 30]);
        }
    }

    #[test]
    fn many_points_are_thinned_alike_each_time() {
        let scene = slope();
        let line = line(&[[0.0, 50.0], [100.0, 50.0]], 60.0);
        let profile = || height_profile(&scene, &line, 500, &NoProgress).unwrap();
        assert_eq!(profile().n_found, 61 * 101);
        assert!((300..=500).contains(&profile().points.len()), "{}", profile().points.len());
        assert_eq!(profile().points, profile().points);
        let spans_all =
            |points: &[ProfilePoint]| points[points.len() - 1].distance - points[0].distance;
        assert!(90.0 < spans_all(&profile().points));
    }

    #[test]
    fn a_line_without_length_has_no_points() {
        let profile =
            height_profile(&slope(), &line(&[[5.0, 5.0]; 3], 10.0), 10, &NoProgress).unwrap();
        assert_eq!((profile.n_found, profile.points.len()), (0, 0));
    }
}
