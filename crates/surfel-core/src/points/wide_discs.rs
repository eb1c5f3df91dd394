//! Discs that reach beyond the nearest points: they are narrowed where the points around do not confirm them, as around
//! stray points, small groups far from all others, and wires.
//!
//! The radius of a stray point is the distance to other surfaces, so that its disc hangs in the air between them. The
//! points of those surfaces have small radii: they do not reach the stray point. On a surface, points reach each other.
//! The plane of two parallel wires is as flat as a surface, but no point of it is surrounded by others.

use super::neighbors::KdTree;
use super::radius::kth_distance;
use super::solids::settle;
use super::structure::{PointShape, Structure};
use crate::error::Result;
use crate::math::Vec3;
use crate::progress::Progress;
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// Maximum number of surface points within a disc that was widened to close the gaps between scan lines.
const MAX_POINTS_OF_DISC: usize = 64;
/// Number of neighbours that are asked whether they reach a point.
const N_NEIGHBORS: usize = 12;
/// Number of nearest points among which these neighbours are found.
const N_NEAREST: usize = 64;
/// Minimum distance between these neighbours, in radii: the nearest of all may lie on one scan line.
const MIN_SPACING: f32 = 0.3;
/// Minimum number of neighbours that reach a point of a surface.
const MIN_CONFIRMING: usize = 4;
/// Minimum number of surrounded neighbours at the border of a surface.
const MIN_INSIDE: usize = 1;
/// Minimum cosine between the normals of a point at the border and of a surrounded neighbour.
const MIN_INSIDE_COSINE: f32 = 0.7;
/// Ratio of a distance to a neighbour's radius up to which the neighbour reaches a point.
const REACH: f32 = 2.0;
/// Minimum cosine between the normals of discs in one plane.
const MIN_COSINE: f32 = 0.9;
/// Maximum height of a point above the plane of a disc in the same plane, by its distance.
const MAX_SLOPE: f32 = 0.1;
/// Maximum ratio of the radius of a disc to the distance of the farthest neighbour that reaches it.
const MAX_OVERHANG: f32 = 1.5;
/// Ratio of a radius to the typical one below which a disc is not looked at.
const MIN_RATIO: f32 = 2.0;
/// Number of rounds: points that a round takes from a surface confirm no others in the next one.
const N_ROUNDS: usize = 2;
/// Maximum angle between the directions to successive neighbours around a point that is surrounded.
const MAX_GAP: f32 = 0.9 * PI;

/// A disc that may reach beyond the nearest points, with the neighbours that describe the surface there, nearest first.
pub struct WideDisc {
    pub point: u32,
    pub neighbors: Vec<u32>,
    /// Structure of the point if the neighbours do not confirm the disc.
    pub otherwise: Structure,
}

/// Narrows the widened discs that reach over densely sampled surfaces, where the points at hand describe the surface
/// better than a wide disc does.
pub fn limit_crowded_discs(
    positions: &[Vec3],
    radii: &[f32],
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let is_surface = |point: &usize| shapes[*point].structure == Structure::Surface;
    let is_wide = |point: &usize| is_surface(point) && radii[*point] < shapes[*point].radius;
    let wide: Vec<usize> = (0..shapes.len()).filter(is_wide).collect();
    if wide.is_empty() {
        return Ok(());
    }
    let surface: Vec<Vec3> =
        (0..shapes.len()).filter(is_surface).map(|point| positions[point]).collect();
    let tree = KdTree::new(&surface, progress)?;
    let limited = |point: &usize| -> Result<f32> {
        progress.check()?;
        let neighbors = tree.nearest(positions[*point], MAX_POINTS_OF_DISC, None);
        let reach = kth_distance(&neighbors, MAX_POINTS_OF_DISC);
        let is_crowded = neighbors.len() == MAX_POINTS_OF_DISC && reach < shapes[*point].radius;
        Ok(if is_crowded { reach.max(radii[*point]) } else { shapes[*point].radius })
    };
    let limits = wide.par_iter().map(limited).collect::<Result<Vec<_>>>()?;
    for (point, radius) in wide.into_iter().zip(limits) {
        shapes[point].radius = radius;
    }
    Ok(())
}

/// Narrows `widened` discs and others beyond the typical radius to the neighbours that reach them. Points that too few
/// reach become scattered ones, and points where hardly any is surrounded become points of lines.
pub fn narrow_lone_discs(
    tree: &KdTree,
    radii: &[f32],
    typical_radius: f32,
    widened: Vec<WideDisc>,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let mut wide = widened;
    wide.extend(other_wide_discs(tree, radii, MIN_RATIO * typical_radius, shapes, progress)?);
    for _ in 0..N_ROUNDS {
        wide.retain(|wide| shapes[wide.point as usize].is_disc());
        narrow(tree, radii, typical_radius, &mut wide, shapes, progress)?;
    }
    Ok(())
}

/// Narrows wide discs to those of their neighbours that reach them, and forgets the others.
fn narrow(
    tree: &KdTree,
    radii: &[f32],
    typical_radius: f32,
    wide: &mut [WideDisc],
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let positions = tree.positions();
    wide.par_iter_mut().for_each(|wide| wide.keep_confirming(positions, shapes));
    let mut is_surrounded: Vec<bool> = shapes.iter().map(PointShape::is_disc).collect();
    let gap = |wide: &WideDisc| wide.widest_gap(positions, shapes[wide.point as usize].normal);
    let gaps: Vec<f32> = wide.par_iter().map(gap).collect();
    for (wide, gap) in wide.iter().zip(gaps) {
        is_surrounded[wide.point as usize] &= gap < MAX_GAP;
    }
    let narrowed = |wide: &WideDisc| -> Result<PointShape> {
        progress.check()?;
        let WideDisc { point, neighbors, otherwise } = wide;
        let point = *point as usize;
        let mut shape = shapes[point];
        let is_inside = |other: &&u32| {
            let cosine = shapes[**other as usize].normal.dot(shape.normal).abs();
            is_surrounded[**other as usize] && MIN_INSIDE_COSINE < cosine
        };
        let n_inside = neighbors.iter().filter(is_inside).count();
        if neighbors.len() < MIN_CONFIRMING {
            settle(tree, point, radii[point], *otherwise, &mut shape);
            shape.radius = shape.radius.min(typical_radius);
        } else if !is_surrounded[point] && n_inside < MIN_INSIDE {
            settle(tree, point, radii[point], Structure::Line, &mut shape);
        } else {
            shape.radius = shape.radius.min(MAX_OVERHANG * wide.reach(positions));
        }
        Ok(shape)
    };
    let found = wide.par_iter().map(narrowed).collect::<Result<Vec<_>>>()?;
    for (wide, shape) in wide.iter().zip(found) {
        shapes[wide.point as usize] = shape;
    }
    Ok(())
}

/// Returns the surface points of more than a radius whose discs were not widened.
fn other_wide_discs(
    tree: &KdTree,
    radii: &[f32],
    min_radius: f32,
    shapes: &[PointShape],
    progress: &dyn Progress,
) -> Result<Vec<WideDisc>> {
    let is_other = |point: &usize| {
        let PointShape { structure, radius, .. } = shapes[*point];
        structure == Structure::Surface && min_radius < radius && radius <= radii[*point]
    };
    let others: Vec<usize> = (0..shapes.len()).filter(is_other).collect();
    let with_neighbors = |point: &usize| {
        progress.check()?;
        let positions = tree.positions();
        let spacing = MIN_SPACING * shapes[*point].radius;
        let mut neighbors: Vec<u32> = Vec::with_capacity(N_NEIGHBORS);
        for nearest in tree.nearest(positions[*point], N_NEAREST, Some(*point as u32)) {
            let position = positions[nearest.index as usize];
            let is_far = |other: &u32| spacing < positions[*other as usize].distance(position);
            if neighbors.len() < N_NEIGHBORS && neighbors.iter().all(is_far) {
                neighbors.push(nearest.index);
            }
        }
        Ok(WideDisc { point: *point as u32, neighbors, otherwise: Structure::Scatter })
    };
    others.par_iter().map(with_neighbors).collect()
}

impl WideDisc {
    /// Keeps the neighbours on surfaces that reach the point or lie in its plane.
    fn keep_confirming(&mut self, positions: &[Vec3], shapes: &[PointShape]) {
        let (position, normal) =
            (positions[self.point as usize], shapes[self.point as usize].normal);
        self.neighbors.retain(|other| {
            let offset = positions[*other as usize] - position;
            let other = shapes[*other as usize];
            let distance = offset.length();
            let is_in_plane = || {
                MIN_COSINE < normal.dot(other.normal).abs()
                    && other.normal.dot(offset).abs() < MAX_SLOPE * distance
            };
            other.is_disc() && (distance <= REACH * other.radius || is_in_plane())
        });
    }

    /// Returns the distance to the last neighbour.
    fn reach(&self, positions: &[Vec3]) -> f32 {
        let last = self.neighbors.last();
        last.map_or(0.0, |last| positions[*last as usize].distance(positions[self.point as usize]))
    }

    /// Returns the widest angle between the directions to successive neighbours, seen along the normal.
    fn widest_gap(&self, positions: &[Vec3], normal: Vec3) -> f32 {
        let (right, ahead) = normal.any_orthonormal_pair();
        // The directions to nearer points are noise.
        let min_distance = MIN_SPACING * self.reach(positions);
        let offset = |other: &u32| positions[*other as usize] - positions[self.point as usize];
        let offsets = self.neighbors.iter().map(offset);
        let offsets = offsets.filter(|offset| min_distance < offset.length());
        let angle = |offset: Vec3| offset.dot(ahead).atan2(offset.dot(right));
        let mut angles: Vec<f32> = offsets.map(angle).collect();
        angles.sort_unstable_by(f32::total_cmp);
        let (Some(first), Some(last)) = (angles.first(), angles.last()) else { return TAU };
        let around = first + TAU - last;
        angles.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f32::max)
    }
}

#[cfg(test)]
mod tests {
    //! Stray points, wires and sparse parts of surfaces.

    use crate::math::{Random, Vec3};
    use crate::points::{PointCloud, Preparation, PreparedCloud, Structure, prepare};
    use crate::progress::NoProgress;

    fn prepared(positions: Vec<Vec3>) -> (PreparedCloud, Vec<Structure>) {
        let cloud = PointCloud::from_positions(positions);
        let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let structures = cloud.structures().unwrap();
        (cloud, structures)
    }

    /// A plane of 5000 points whose spacing is 0.014.
    fn plane() -> Vec<Vec3> {
        let mut random = Random::new(1, 0);
        (0..5000).map(|_| Vec3::new(random.next_f32(), random.next_f32(), 0.0)).collect()
    }

    #[test]
    fn stray_points_far_from_a_surface_are_small() {
        let mut points = plane();
        let strays =
            [Vec3::new(0.5, 0.5, 0.4), Vec3::new(2.0, 0.5, 0.3), Vec3::new(0.1, 0.2, -0.6)];
        points.extend(strays);
        let (cloud, structures) = prepared(points);
        assert!(!structures[5000..].contains(&Structure::Surface));
        assert!(cloud.radii()[5000..].iter().all(|radius| *radius < 0.05));
    }

    #[test]
    fn small_groups_far_from_a_surface_do_not_reach_it() {
        let mut points = plane();
        let mut random = Random::new(2, 0);
        let group = |_| {
            Vec3::new(0.5, 0.5, 0.5) + 0.02 * Vec3::from_array([(); 3].map(|()| random.next_f32()))
        };
        points.extend((0..6).map(group));
        let (cloud, _) = prepared(points);
        assert!(cloud.radii()[5000..].iter().all(|radius| *radius < 0.05));
    }

    #[test]
    fn two_parallel_wires_do_not_become_a_sheet() {
        // Two wires 0.5 apart, 6 above the ground, of points that are 0.3 apart.
        let mut random = Random::new(3, 0);
        let mut noise = || 0.02 * (random.next_f32() - 0.5);
        let mut points: Vec<Vec3> = (0..200)
            .map(|i| Vec3::new(0.15 * i as f32, 0.5 * (i % 2) as f32 + noise(), 6.0 + noise()))
            .collect();
        points.extend(plane().iter().map(|point| 30.0 * (*point - Vec3::new(0.0, 0.5, 0.0))));
        let (cloud, _) = prepared(points);
        let n_wide = cloud.radii()[..200].iter().filter(|radius| 2.0 < **radius).count();
        assert_eq!(n_wide, 0);
    }

    #[test]
    fn sparse_parts_of_a_surface_stay_whole() {
        // The density falls from 40,000 to 400 points a unit.
        let mut random = Random::new(4, 0);
        let mut points: Vec<Vec3> = Vec::new();
        while points.len() < 20_000 {
            let (x, y) = (random.next_f32(), random.next_f32());
            if random.next_f32() < 10f32.powf(-2.0 * x) {
                points.push(Vec3::new(x, y, 0.0));
            }
        }
        let (_, structures) = prepared(points);
        let is_solid = |own: &&Structure| matches!(own, Structure::Line | Structure::Scatter);
        let n_solid = structures.iter().filter(is_solid).count();
        assert!(n_solid < 10, "{n_solid}");
    }
}
