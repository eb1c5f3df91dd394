//! Axes of lines: a scanner measures points on the side of a wire that faces it. The capsules of points that are moved onto the
//! axis of the wire make one round line.

use crate::error::Result;
use crate::math::{DVec3, Vec3};
use crate::points::PointCloud;
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::normals::orient::has_stations;
use crate::points::radii::radius::kth_distance;
use crate::points::structure::point_shape::{PointShape, Structure};
use crate::points::structure::solids::{
    CAPSULE_ASPECT, LineFit, MAX_STRAIGHT_WIDTH, N_STRAIGHT_NEIGHBORS,
};
use crate::progress::Progress;
use crate::words::{counted, format_length};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_4, PI};

/// Maximum ratio of the length of a capsule on an axis to that before. Poles amid thin wires grow.
const MAX_GROWTH: f32 = 16.0;
/// Minimum number of a point's neighbours that have a straight line, too. Sparse points that lie on a line by chance have fewer.
const MIN_NEIGHBORS_ON_LINES: usize = N_STRAIGHT_NEIGHBORS / 3;
/// Minimum number of points of a neighbourhood on each of two lines.
const MIN_ON_LINE: usize = 3;
/// Minimum ratio of the gap between two lines to the extent of both.
const MIN_GAP: f64 = 0.7;
/// Number of directions across a line in which a gap is sought.
const N_GAP_DIRECTIONS: usize = 8;

/// Effect of moving points onto the axes of their lines.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineReport {
    /// Number of points that were moved.
    pub n_moved: usize,
    /// Mean distance by which these were moved.
    pub mean_distance: f32,
}

impl LineReport {
    /// Returns a sentence about the moved points for the user.
    pub fn line(&self) -> String {
        format!(
            "{} on straight lines moved onto their axes, by {} on average",
            counted(self.n_moved, "point"),
            format_length(self.mean_distance)
        )
    }
}

/// The axis of a straight line near one of its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineAxis {
    /// Index of the point.
    point: usize,
    /// The position on the axis that is nearest to the point.
    position: Vec3,
    /// Unit direction.
    direction: Vec3,
    /// Half the length of the point's capsule.
    half_length: f32,
}

/// Finds the axis of each point on a straight line among others, in the order of the points. `scanner` is the position of the scanner
/// relative to the origin of the cloud, unless the cloud has stations.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn find_axes(
    cloud: &PointCloud,
    tree: &KdTree,
    shapes: &[PointShape],
    scanner: Option<Vec3>,
    progress: &dyn Progress,
) -> Result<Vec<LineAxis>> {
    let positions = &cloud.positions;
    let scan_of_point = cloud.scan_of_point().filter(|_| has_stations(cloud));
    let toward_scanner = |point: usize| {
        let position = match &scan_of_point {
            Some(scans) => {
                (cloud.stations.get(scans.get(point))?.position? - cloud.origin).as_vec3()
            }
            None => scanner?,
        };
        Some((position - positions[point]).as_dvec3())
    };
    let line = |point: usize| {
        if point.is_multiple_of(4096) {
            progress.check()?;
        }
        if shapes[point].structure != Structure::Line {
            return Ok(None);
        }
        let line = StraightLine::of(tree, point, toward_scanner);
        // Stray points lie on a line by chance; their capsules are far shorter than that line is thick.
        let max_radius = f64::from(MAX_GROWTH / CAPSULE_ASPECT * shapes[point].radius);
        let line = line.filter(|line| line.radius <= max_radius);
        Ok(line.map(|line| (point, line)))
    };
    let lines = (0..shapes.len()).into_par_iter().map(line).filter_map(Result::transpose);
    let lines: Vec<(usize, StraightLine)> = lines.collect::<Result<_>>()?;
    let radius_at = |neighbor: &Neighbor| {
        let found = lines.binary_search_by_key(&(neighbor.index as usize), |(point, _)| *point);
        found.ok().map(|line_idx| lines[line_idx].1.radius)
    };
    let axis = |(point, line): &(usize, StraightLine)| {
        progress.check()?;
        // The radius of one line errs by a tenth, as 25 points show it. Neighbours are searched again, as their lists would take
        // more memory than the cloud where all of it is lines.
        let neighbors = tree.nearest(positions[*point], N_STRAIGHT_NEIGHBORS, Some(*point as u32));
        let radii = neighbors.iter().filter_map(radius_at);
        let (sum, n) = radii.fold((line.radius, 1), |(sum, n), radius| (sum + radius, n + 1));
        let radius = sum / n as f64;
        let is_line = MIN_NEIGHBORS_ON_LINES < n;
        Ok(is_line.then(|| line.axis(*point, positions[*point], radius, shapes[*point].radius)))
    };
    lines.par_iter().map(axis).filter_map(Result::transpose).collect()
}

/// Moves points onto their axes, and gives their capsules the directions and lengths of these. Returns none if there are no
/// axes.
pub fn move_to_axes(
    axes: &[LineAxis],
    positions: &mut [Vec3],
    shapes: &mut [PointShape],
) -> Option<LineReport> {
    if axes.is_empty() {
        return None;
    }
    let mut sum = 0.0;
    for axis in axes {
        let (position, shape) = (&mut positions[axis.point], &mut shapes[axis.point]);
        sum += f64::from(position.distance(axis.position));
        *position = axis.position;
        *shape = PointShape { normal: axis.direction, radius: axis.half_length, ..*shape };
    }
    Some(LineReport { n_moved: axes.len(), mean_distance: (sum / axes.len() as f64) as f32 })
}

/// The straight line through a point and its neighbours.
struct StraightLine {
    fit: LineFit,
    /// Distance from the point to its second neighbour.
    reach: f32,
    /// Mean of the unit vectors across the line toward the scanners of the points; zero if they are not known.
    toward_scanners: DVec3,
    /// Radius of the line.
    radius: f64,
}

impl StraightLine {
    /// Returns the line if the neighbours of a point lie on one.
    fn of(
        tree: &KdTree,
        point: usize,
        toward_scanner: impl Fn(usize) -> Option<DVec3>,
    ) -> Option<Self> {
        let positions = tree.positions();
        let neighbors = tree.nearest(positions[point], N_STRAIGHT_NEIGHBORS, Some(point as u32));
        let fit = LineFit::of(positions, point, &neighbors);
        if neighbors.len() < N_STRAIGHT_NEIGHBORS || MAX_STRAIGHT_WIDTH <= fit.width {
            return None;
        }
        let reach = kth_distance(&neighbors, 2);
        let direction = fit.direction.as_dvec3();
        let members = || neighbors.iter().map(|other| other.index as usize).chain([point]);
        let offset = |member: usize| {
            let offset = (positions[member] - positions[point]).as_dvec3() - fit.mean;
            offset.reject_from(direction)
        };
        let offsets: Vec<DVec3> = members().map(offset).collect();
        if are_two_lines(&offsets, direction, f64::from(reach)) {
            return None;
        }
        let across = |vector: DVec3| vector.reject_from(direction).normalize_or_zero();
        let toward: Option<Vec<DVec3>> =
            members().map(|member| toward_scanner(member).map(across)).collect();
        let Some(toward) = toward else {
            let radius = f64::from(fit.thickness);
            return Some(Self { fit, reach, toward_scanners: DVec3::ZERO, radius });
        };
        let n_members = toward.len() as f64;
        // The fit takes the position and the slope of the line from the same points.
        let n_free = n_members - 2.0;
        let toward_scanners = toward.iter().sum::<DVec3>() / n_members;
        let center = positions[point].as_dvec3();
        let mut radius = f64::from(fit.thickness);
        // The axis depends on the radius where several scanners see the line.
        for _ in 0..3 {
            let axis = center + fit.mean - shift(toward_scanners, radius);
            // Across the sight, points lie at even steps from one side of the line to the other, whatever the noise of ranges.
            let squares = members().zip(&toward).map(|(member, toward)| {
                (positions[member].as_dvec3() - axis).dot(direction.cross(*toward)).powi(2)
            });
            radius = (3.0 * squares.sum::<f64>() / n_free).sqrt();
        }
        Some(Self { fit, reach, toward_scanners, radius })
    }

    /// Returns the axis of a line of the given radius. `capsule` is half the length of the point's capsule, which grows only if it
    /// is thinner than the line.
    fn axis(&self, point: usize, position: Vec3, radius: f64, capsule: f32) -> LineAxis {
        let direction = self.fit.direction.as_dvec3();
        let on_axis = self.fit.mean.reject_from(direction) - shift(self.toward_scanners, radius);
        let reach = self.reach.min(capsule).max(CAPSULE_ASPECT * radius as f32);
        let half_length = if 0.0 < reach { reach } else { capsule };
        let position = (position.as_dvec3() + on_axis).as_vec3();
        LineAxis { point, position, direction: self.fit.direction, half_length }
    }
}

/// True if points, given by their offsets from a line along `direction`, lie on two lines side by side: across a gap that is far
/// wider than either, and than `reach`, the distance between points.
fn are_two_lines(offsets: &[DVec3], direction: DVec3, reach: f64) -> bool {
    let (u, v) = direction.any_orthonormal_pair();
    let mut heights = vec![0.0; offsets.len()];
    (0..N_GAP_DIRECTIONS).any(|step| {
        let (sin, cos) = (PI * step as f64 / N_GAP_DIRECTIONS as f64).sin_cos();
        let across = cos * u + sin * v;
        heights.iter_mut().zip(offsets).for_each(|(height, offset)| *height = offset.dot(across));
        heights.sort_unstable_by(f64::total_cmp);
        let min_gap = reach.max(MIN_GAP * (heights[heights.len() - 1] - heights[0]));
        (MIN_ON_LINE..=heights.len() - MIN_ON_LINE).any(|i| min_gap < heights[i] - heights[i - 1])
    })
}

/// Returns the offset of the mean of points from the axis of a cylinder, on whose sides toward scanners they lie at even steps
/// across the sight.
fn shift(toward_scanners: DVec3, radius: f64) -> DVec3 {
    FRAC_PI_4 * radius * toward_scanners
}

#[cfg(test)]
mod tests {
    //! Wires that one or more scanners see.

    use super::*;
    use crate::math::Random;
    use crate::points::{Denoise, Preparation, STATION, Scalar, ScanStation, Values, prepare};
    use crate::progress::NoProgress;

    const RADIUS: f64 = 0.012;

    /// Returns a wire along X through the origin, as seen from `stations` in turn, with noise along the rays.
    fn wire(stations: &[DVec3], noise: f64) -> PointCloud {
        let mut random = Random::new(6, 0);
        let mut point = |i: usize| {
            let along = 0.03 * i as f64 * DVec3::X;
            let toward = (stations[i % stations.len()] - along).reject_from(DVec3::X).normalize();
            let across = 2.0 * f64::from(random.next_f32()) - 1.0;
            let depth = RADIUS * (1.0 - across * across).sqrt() + noise * random.next_gaussian();
            (along + RADIUS * across * toward.cross(DVec3::X) + depth * toward).as_vec3()
        };
        let mut cloud = PointCloud::from_positions((0..600).map(&mut point).collect());
        let station =
            |position: &DVec3| ScanStation { position: Some(*position), ..ScanStation::default() };
        cloud.stations = stations.iter().map(station).collect();
        let indices = (0..600).map(|i| (i % stations.len()) as u16).collect();
        cloud.scalars.push(Scalar { name: STATION.to_owned(), values: Values::U16(indices) });
        cloud
    }

    fn moved(mut cloud: PointCloud, scanner: Option<Vec3>) -> (PointCloud, Vec<PointShape>) {
        let line = PointShape { structure: Structure::Line, normal: Vec3::Y, radius: 0.1 };
        let mut shapes = vec![line; cloud.len()];
        let axes = axes(&cloud, scanner, 0.1);
        let report = move_to_axes(&axes, &mut cloud.positions, &mut shapes).unwrap();
        assert_eq!(report.n_moved, cloud.len());
        assert!((0.5..1.5).contains(&(f64::from(report.mean_distance) / RADIUS)), "{report:?}");
        (cloud, shapes)
    }

    /// Returns the axes of a cloud all of whose points are taken for lines with capsules of this half length.
    fn axes(cloud: &PointCloud, scanner: Option<Vec3>, radius: f32) -> Vec<LineAxis> {
        let tree = KdTree::new(&cloud.positions, &NoProgress).unwrap();
        let line = PointShape { structure: Structure::Line, normal: Vec3::Y, radius };
        find_axes(cloud, &tree, &vec![line; cloud.len()], scanner, &NoProgress).unwrap()
    }

    /// Returns the greatest distance of points from the axis, and asserts that capsules are as thick as the wire.
    fn farthest_from_axis((cloud, shapes): &(PointCloud, Vec<PointShape>)) -> f64 {
        let middle = 20..580;
        assert!(shapes[middle.clone()].iter().all(|shape| 0.99 < shape.normal.x.abs()));
        let thickness = |shape: &PointShape| f64::from(shape.radius / CAPSULE_ASPECT) / RADIUS;
        let thicknesses: Vec<f64> = shapes[middle.clone()].iter().map(thickness).collect();
        let mean = thicknesses.iter().sum::<f64>() / thicknesses.len() as f64;
        assert!((0.8..1.1).contains(&mean), "{mean}");
        assert!(thicknesses.iter().all(|thickness| (0.65..1.3).contains(thickness)));
        let distance = |p: &Vec3| p.as_dvec3().reject_from(DVec3::X).length();
        cloud.positions[middle].iter().map(distance).fold(0.0, f64::max)
    }

    #[test]
    fn points_seen_from_stations_lie_on_the_axis() {
        let stations = [DVec3::new(2.0, -9.0, -5.0), DVec3::new(7.0, 8.0, -6.0)];
        for (noise, limit) in [(0.1, 0.45), (0.5, 0.7), (0.6, 0.9)] {
            for stations in [&stations[..1], &stations] {
                let moved = moved(wire(stations, noise * RADIUS), None);
                let distance = farthest_from_axis(&moved) / RADIUS;
                assert!(distance < limit, "{noise}: {distance}");
            }
        }
    }

    #[test]
    fn a_scanner_without_a_station_counts_as_well() {
        let scanner = DVec3::new(2.0, -9.0, -5.0);
        let mut cloud = wire(&[scanner], 0.1 * RADIUS);
        cloud.stations.clear();
        let known = farthest_from_axis(&moved(cloud.clone(), Some(scanner.as_vec3())));
        let unknown = farthest_from_axis(&moved(cloud, None));
        assert!(known < 0.5 * RADIUS && unknown < 1.2 * RADIUS, "{known} {unknown}");
        assert!(known < unknown);
    }

    #[test]
    fn lines_that_are_not_straight_have_no_axis() {
        let mut random = Random::new(7, 0);
        let mut point = |_| Vec3::from_array(std::array::from_fn(|_| random.next_f32()));
        let cloud = PointCloud::from_positions((0..200).map(&mut point).collect());
        assert_eq!(axes(&cloud, None, 0.1), []);
    }

    #[test]
    fn lines_far_thicker_than_their_capsules_have_no_axis() {
        // Stray points far from all others lie on a line by chance.
        let mut random = Random::new(8, 0);
        let mut across = || 0.4 * (random.next_f32() - 0.5);
        let points = (0..40).map(|i| Vec3::new(0.4 * i as f32, across(), across()));
        let cloud = PointCloud::from_positions(points.collect());
        assert!(!axes(&cloud, None, 0.1).is_empty());
        assert_eq!(axes(&cloud, None, 0.01), []);
    }

    #[test]
    fn two_wires_side_by_side_have_no_common_axis() {
        let n_axes = |distance: f32| {
            let point = |i: usize| Vec3::new(i as f32, (i % 3 % 2) as f32 * distance, 0.0);
            axes(&PointCloud::from_positions((0..60).map(point).collect()), None, 1.0).len()
        };
        // Coordinates are rounded in the second case.
        assert_eq!([0.0, 0.3, 2.5].map(n_axes), [60, 60, 0]);
    }

    #[test]
    fn a_wire_between_opposite_scanners_has_an_axis() {
        let stations = [DVec3::new(2.0, -9.0, 0.0), DVec3::new(7.0, 9.0, 0.0)];
        let cloud = wire(&stations, 0.1 * RADIUS);
        assert_eq!(axes(&cloud, None, 0.1).len(), cloud.len());
    }

    #[test]
    fn a_point_that_lies_on_a_line_alone_has_no_axis() {
        let points = (0..60).map(|i| Vec3::X * i as f32).collect();
        let cloud = PointCloud::from_positions(points);
        let tree = KdTree::new(&cloud.positions, &NoProgress).unwrap();
        let shape = |structure| PointShape { structure, normal: Vec3::Y, radius: 1.0 };
        let mut shapes = vec![shape(Structure::Scatter); 60];
        for (n_lines, n_axes) in [(1, 0), (60, 60)] {
            shapes[60 - n_lines..].fill(shape(Structure::Line));
            let found = find_axes(&cloud, &tree, &shapes, None, &NoProgress).unwrap();
            assert_eq!(found.len(), n_axes);
        }
    }

    #[test]
    fn prepare_moves_points_of_wires_unless_denoising_is_off() {
        let cloud = wire(&[DVec3::new(2.0, -9.0, -5.0)], 0.1 * RADIUS);
        let prepared = |denoise| {
            let preparation = Preparation { denoise, ..Preparation::default() };
            prepare(cloud.clone(), &preparation, &NoProgress).unwrap()
        };
        let (kept, report) = prepared(Denoise::Off);
        assert!(kept.positions == cloud.positions && report.lines.is_none());
        let (moved, report) = prepared(Denoise::Auto);
        assert_eq!(report.lines.unwrap().n_moved, cloud.len());
        let (radii, found) = (moved.radii(), report.radii.unwrap());
        assert_eq!(radii.iter().copied().reduce(f32::max), Some(found.max));
        let is_on_axis = |p: &Vec3| p.as_dvec3().reject_from(DVec3::X).length() < 0.5 * RADIUS;
        assert!(moved.positions[20..580].iter().all(is_on_axis));
    }
}
