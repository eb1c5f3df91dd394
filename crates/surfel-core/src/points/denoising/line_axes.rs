//! Axes of lines: a scanner measures points on the side of a wire that faces it. Moved onto the axis of the wire, their
//! capsules make one round line.

use crate::error::Result;
use crate::math::{DVec3, SymmetricMatrix, Vec3};
use crate::points::PointCloud;
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::normals::orient::has_stations;
use crate::points::radii::radius::kth_distance;
use crate::points::structure::point_shape::{PointShape, Structure};
use crate::points::structure::solids::CAPSULE_ASPECT;
use crate::progress::Progress;
use crate::words::{counted, format_length};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_4;

/// Number of neighbours that give the axis of a line.
const N_AXIS_NEIGHBORS: usize = 24;
/// Maximum ratio of the deviations across and along a straight line.
const MAX_STRAIGHT_WIDTH: f64 = 0.1;
/// Ratio of the radius of a round line to the standard deviation, across it, of points that face one unknown scanner.
const RADIUS_OF_DEVIATION: f64 = 1.4;

/// Effect of moving the points of lines.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineReport {
    /// Number of points that were moved.
    pub n_moved: usize,
    /// Mean distance by which these were moved.
    pub mean_distance: f32,
}

impl LineReport {
    /// Returns a line about the moved points for the user.
    pub fn line(&self) -> String {
        format!(
            "{} of lines moved onto the axis of each line, by {} on average",
            counted(self.n_moved, "point"),
            format_length(self.mean_distance)
        )
    }
}

/// Finds the axes of straight lines near the points of these, by index of the point. `scanner` is the position of the scanner
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
) -> Result<Vec<(usize, Axis)>> {
    let with_stations = has_stations(cloud);
    let toward_scanner = |point: usize| {
        let scanner = match with_stations {
            true => cloud.station_of(point)?.position.map(|p| (p - cloud.origin).as_vec3()),
            false => scanner,
        }?;
        Some((scanner - cloud.positions[point]).as_dvec3())
    };
    let of_lines: Vec<usize> =
        (0..shapes.len()).filter(|point| shapes[*point].structure == Structure::Line).collect();
    let neighbors =
        |point: usize| tree.nearest(cloud.positions[point], N_AXIS_NEIGHBORS, Some(point as u32));
    let axis = |point: &usize| {
        progress.check()?;
        Ok(Axis::of(&cloud.positions, toward_scanner, *point, &neighbors(*point)))
    };
    let found: Vec<Option<Axis>> = of_lines.par_iter().map(axis).collect::<Result<_>>()?;
    let axes = of_lines.into_iter().zip(found);
    let axes: BTreeMap<usize, Axis> =
        axes.filter_map(|(point, axis)| Some((point, axis?))).collect();
    // The radius of one axis errs by a sixth, as it has few points.
    let evened = |(point, axis): (&usize, &Axis)| {
        let neighbors = neighbors(*point);
        let radii = neighbors.iter().filter_map(|other| axes.get(&(other.index as usize)));
        let (sum, n) = radii.fold((axis.radius, 1), |(sum, n), axis| (sum + axis.radius, n + 1));
        let radius = sum / n as f32;
        (*point, Axis { radius, ..*axis })
    };
    Ok(axes.par_iter().map(evened).collect())
}

/// Moves points onto the axes of their lines, and gives their capsules the radius of the lines.
pub fn move_to_axes(
    axes: &[(usize, Axis)],
    positions: &mut [Vec3],
    shapes: &mut [PointShape],
) -> LineReport {
    let mut sum = 0.0;
    for (point, axis) in axes {
        sum += f64::from(positions[*point].distance(axis.position));
        positions[*point] = axis.position;
        shapes[*point].normal = axis.direction;
        shapes[*point].radius = axis.reach.max(CAPSULE_ASPECT * axis.radius);
    }
    LineReport { n_moved: axes.len(), mean_distance: (sum / axes.len().max(1) as f64) as f32 }
}

/// The axis of a line near one of its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// The position on the axis that is nearest to the point.
    position: Vec3,
    /// Unit direction.
    direction: Vec3,
    /// Radius of the line.
    radius: f32,
    /// Distance to the second neighbour.
    reach: f32,
}

impl Axis {
    /// Returns the axis if the neighbours lie on a straight line.
    fn of(
        positions: &[Vec3],
        toward_scanner: impl Fn(usize) -> Option<DVec3>,
        point: usize,
        neighbors: &[Neighbor],
    ) -> Option<Self> {
        let center = positions[point].as_dvec3();
        let members = || neighbors.iter().map(|other| other.index as usize).chain([point]);
        let offset = |other: usize| positions[other].as_dvec3() - center;
        let weight = 1.0 / (neighbors.len() + 1) as f64;
        let mean = weight * members().map(offset).sum::<DVec3>();
        let mut scatter = SymmetricMatrix::default();
        members().for_each(|other| scatter.add_outer(offset(other) - mean, weight));
        let (values, vectors) = scatter.eigen();
        let [across, along] = [values[0] + values[1], values[2]].map(|value| value.max(0.0).sqrt());
        if along <= 0.0 || MAX_STRAIGHT_WIDTH < across / along {
            return None;
        }
        let direction = vectors[2].try_normalize()?;
        let toward =
            |other| Some(toward_scanner(other)?.reject_from(direction).normalize_or_zero());
        let toward: Option<DVec3> = members().map(toward).sum();
        // Points on the side of a cylinder that faces a scanner, at even steps across it, lie nearer to the scanner than the axis
        // by π/4 of the radius on average.
        let (radius, shift) = match toward {
            Some(toward) => {
                let toward = weight * toward;
                let one_sided = FRAC_PI_4 * FRAC_PI_4 * toward.length_squared();
                let radius = across / (1.0 - one_sided).sqrt();
                (radius, FRAC_PI_4 * radius * toward)
            }
            None => (RADIUS_OF_DEVIATION * across, DVec3::ZERO),
        };
        let on_axis = mean - mean.dot(direction) * direction - shift;
        Some(Self {
            position: (center + on_axis).as_vec3(),
            direction: direction.as_vec3(),
            radius: radius as f32,
            reach: kth_distance(neighbors, 2),
        })
    }
}

#[cfg(test)]
mod tests {
    //! Wires that one or more scanners see.

    use super::*;
    use crate::math::Random;
    use crate::points::STATION;
    use crate::points::ScanStation;
    use crate::points::{Scalar, Values};
    use crate::progress::NoProgress;

    const RADIUS: f64 = 0.012;

    /// Returns a wire along X through the origin, as seen from `stations` in turn, with noise of 1 mm along the rays.
    fn wire(stations: &[DVec3]) -> PointCloud {
        let mut random = Random::new(6, 0);
        let mut point = |i: usize| {
            let along = 0.02 * i as f64 * DVec3::X;
            let toward = (stations[i % stations.len()] - along).reject_from(DVec3::X).normalize();
            let across = 2.0 * f64::from(random.next_f32()) - 1.0;
            let depth = RADIUS * (1.0 - across * across).sqrt() + 0.001 * random.next_gaussian();
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
        let axes = axes(&cloud, scanner);
        let report = move_to_axes(&axes, &mut cloud.positions, &mut shapes);
        assert_eq!(report.n_moved, cloud.len());
        assert!((0.5..1.0).contains(&(f64::from(report.mean_distance) / RADIUS)), "{report:?}");
        (cloud, shapes)
    }

    /// Returns the axes of a cloud all of whose points are taken for lines.
    fn axes(cloud: &PointCloud, scanner: Option<Vec3>) -> Vec<(usize, Axis)> {
        let tree = KdTree::new(&cloud.positions, &NoProgress).unwrap();
        let line = PointShape { structure: Structure::Line, normal: Vec3::Y, radius: 0.1 };
        find_axes(cloud, &tree, &vec![line; cloud.len()], scanner, &NoProgress).unwrap()
    }

    /// Returns the greatest distance of points from the axis, and asserts that capsules are as thick as the wire.
    fn farthest_from_axis((cloud, shapes): &(PointCloud, Vec<PointShape>)) -> f64 {
        for shape in &shapes[20..580] {
            assert!(0.999 < shape.normal.x.abs(), "{shape:?}");
            let thickness = f64::from(shape.radius / CAPSULE_ASPECT) / RADIUS;
            assert!((0.8..1.3).contains(&thickness), "{thickness}");
        }
        let distance = |p: &Vec3| p.as_dvec3().reject_from(DVec3::X).length();
        cloud.positions[20..580].iter().map(distance).fold(0.0, f64::max)
    }

    #[test]
    fn points_seen_from_stations_lie_on_the_axis() {
        let stations = [DVec3::new(2.0, -9.0, -5.0), DVec3::new(7.0, 8.0, -6.0)];
        for stations in [&stations[..1], &stations] {
            let distance = farthest_from_axis(&moved(wire(stations), None));
            assert!(distance < 0.5 * RADIUS, "{distance}");
        }
    }

    #[test]
    fn a_scanner_without_a_station_counts_as_well() {
        let scanner = DVec3::new(2.0, -9.0, -5.0);
        let mut cloud = wire(&[scanner]);
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
        assert_eq!(axes(&cloud, None), []);
    }
}
