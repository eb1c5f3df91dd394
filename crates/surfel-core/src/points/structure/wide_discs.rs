//! Discs that reach beyond the nearest points: they are narrowed where the points around do not confirm them, as around
//! stray points, small groups far from all others, and wires.
//!
//! The radius of a stray point is the distance to other surfaces, so that its disc hangs in the air between them. The
//! points of those surfaces have small radii: they do not reach the stray point. On a surface, points reach each other.
//! The plane of two parallel wires is as flat as a surface, but it is a narrow strip.

use super::point_shape::{PointShape, Structure};
use super::solids::apply_structure;
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::normals::planes::fit_plane;
use crate::progress::Progress;
use rayon::prelude::*;

/// Maximum number of surface points within a disc that was widened to close the gaps between scan lines.
const MAX_POINTS_OF_DISC: usize = 64;
/// Numbers of nearest points among which these are sought, in turn: others may lie among them.
const N_NEAREST_OF_DISC: [usize; 3] = [64, 256, 1024];
/// Number of neighbours that are asked whether they reach a point.
const N_NEIGHBORS: usize = 12;
/// Number of nearest points among which these neighbours are found.
const N_NEAREST: usize = 64;
/// Minimum distance between these neighbours, in radii: the nearest of all may lie on one scan line.
const MIN_SPACING: f32 = 0.3;
/// Minimum number of neighbours that reach a point of a surface.
const MIN_CONFIRMING: usize = 4;
/// Ratio of a distance to a neighbour's radius up to which the neighbour reaches a point.
const REACH: f32 = 2.0;
/// Ratio of a distance to a neighbour's radius up to which the neighbour reaches a point in its own plane.
const REACH_IN_PLANE: f32 = 16.0;
/// Minimum cosine between the normals of discs in one plane.
const MIN_COSINE: f32 = 0.9;
/// Maximum height of a point above the plane of a disc in the same plane, by its distance.
const MAX_SLOPE: f32 = 0.1;
/// Maximum ratio of the radius of a disc to the distance of the farthest neighbour that reaches it.
const MAX_OVERHANG: f32 = 1.5;
/// Ratio of a radius to the typical one below which a disc is not looked at.
const MIN_RATIO: f32 = 2.0;
/// Maximum width of a strip, as the ratio of its eigenvalues.
const MAX_STRIP_WIDTH: f32 = 0.12;
/// Minimum ratio of the radius of a disc to that of its nearest neighbours for more than one round.
const MIN_WIDENING: f32 = 2.0;
/// Maximum fraction of the neighbours that may be dense points in the disc's plane: with more, the disc is part of a
/// surface, not of a strip.
const MAX_DENSE_FRACTION: f32 = 0.25;
/// Number of rounds that tell a surface from a strip.
const MIN_STRIP_ROUNDS: usize = 3;
/// Width of the neighbours of such a round from which those of further rounds form no strip either.
const MAX_WIDTH_OF_ROUND: f32 = 0.5;
/// Maximum number of rounds in which the neighbours of neighbours are looked at. A pole, whose scan lines lie no farther
/// apart than the points on them, is a strip and a surface.
const N_STRIP_ROUNDS: usize = 8;
/// Number of rounds: points that a round takes from a surface confirm no others in the next one.
const N_ROUNDS: usize = 2;

/// A disc that may reach beyond the nearest points, with the neighbours that describe the surface there, nearest first.
pub struct WideDisc {
    pub point: u32,
    pub neighbors: Vec<u32>,
    /// Structure of the point if the neighbours do not confirm the disc.
    pub otherwise: Structure,
    /// True if the neighbours have changed since the disc was last looked at.
    has_changed: bool,
}

/// All wide discs.
struct WideDiscs<'a> {
    discs: &'a [WideDisc],
    /// Index of the disc of each point, `u32::MAX` if it has no wide one.
    disc_indices: Vec<u32>,
}

impl<'a> WideDiscs<'a> {
    fn new(discs: &'a [WideDisc], n_points: usize) -> Self {
        let mut disc_indices = vec![u32::MAX; n_points];
        for (disc_idx, disc) in (0..).zip(discs) {
            disc_indices[disc.point as usize] = disc_idx;
        }
        Self { discs, disc_indices }
    }

    /// Returns the disc of a point, if it is a wide one.
    fn of_point(&self, point: u32) -> Option<&WideDisc> {
        self.discs.get(self.disc_indices[point as usize] as usize)
    }

    /// True if another look at a disc would give the same result: neither its neighbours nor theirs have changed.
    fn is_stable(&self, disc: &WideDisc) -> bool {
        let has_changed =
            |neighbor: &u32| self.of_point(*neighbor).is_some_and(|other| other.has_changed);
        !disc.has_changed && !disc.neighbors.iter().any(has_changed)
    }
}

/// Narrows the widened discs that reach over densely sampled surfaces, where the points at hand describe the surface
/// better than a wide disc does.
pub fn limit_crowded_discs(
    tree: &KdTree,
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
    let limited = |point: &usize| -> Result<f32> {
        progress.check()?;
        let own = shapes[*point].radius;
        let reach = reach_of_surface(tree, *point, own, shapes);
        Ok(reach.map_or(own, |reach| reach.max(radii[*point])))
    };
    let limits = wide.par_iter().map(limited).collect::<Result<Vec<_>>>()?;
    for (point, radius) in wide.into_iter().zip(limits) {
        shapes[point].radius = radius;
    }
    Ok(())
}

/// Returns the distance from a point to the last of [`MAX_POINTS_OF_DISC`] nearest points of surfaces, itself among them, if
/// it is below `max_distance`.
fn reach_of_surface(
    tree: &KdTree,
    point: usize,
    max_distance: f32,
    shapes: &[PointShape],
) -> Option<f32> {
    let is_near = |neighbor: &Neighbor| neighbor.distance_squared.sqrt() < max_distance;
    let is_surface =
        |neighbor: &Neighbor| shapes[neighbor.index as usize].structure == Structure::Surface;
    for n_nearest in N_NEAREST_OF_DISC {
        let nearest = tree.nearest(tree.positions()[point], n_nearest, None);
        let mut of_surface = nearest.iter().filter(|neighbor| is_surface(neighbor));
        if let Some(last) = of_surface.nth(MAX_POINTS_OF_DISC - 1) {
            return is_near(last).then(|| last.distance_squared.sqrt());
        }
        if !nearest.last().is_some_and(is_near) {
            return None;
        }
    }
    None
}

/// Narrows `widened` discs and others beyond the typical radius to the neighbours that reach them. Points that too few
/// reach become scattered ones, and points of narrow strips become points of lines.
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
        wide.retain(|disc| shapes[disc.point as usize].is_disc());
        narrow(tree, radii, typical_radius, &mut wide, shapes, progress)?;
    }
    Ok(())
}

/// Narrows wide discs to those of their neighbours that reach them, and forgets the others.
fn narrow(
    tree: &KdTree,
    radii: &[f32],
    typical_radius: f32,
    discs: &mut [WideDisc],
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let positions = tree.positions();
    discs.par_iter_mut().for_each(|disc| disc.keep_confirming(positions, shapes));
    let wide = WideDiscs::new(discs, shapes.len());
    let narrowed = |disc: &WideDisc| -> Result<PointShape> {
        progress.check()?;
        let point = disc.point as usize;
        let mut shape = shapes[point];
        if wide.is_stable(disc) {
            return Ok(shape);
        }
        if disc.neighbors.len() < MIN_CONFIRMING {
            apply_structure(tree, point, radii[point], disc.otherwise, &mut shape);
            shape.radius = shape.radius.min(typical_radius);
        } else if is_strip(positions, disc, radii[point], &wide, shapes) {
            apply_structure(tree, point, radii[point], Structure::Line, &mut shape);
        } else {
            shape.radius = shape.radius.min(MAX_OVERHANG * disc.reach(positions));
        }
        Ok(shape)
    };
    let found = wide.discs.par_iter().map(narrowed).collect::<Result<Vec<_>>>()?;
    for (disc, shape) in discs.iter_mut().zip(found) {
        shapes[disc.point as usize] = shape;
        disc.has_changed = false;
    }
    Ok(())
}

/// True if the neighbours of a disc, their neighbours and so on form a strip, as the points of two wires do: a surface of
/// scan lines is wider the farther one looks.
fn is_strip(
    positions: &[Vec3],
    disc: &WideDisc,
    radius: f32,
    wide: &WideDiscs,
    shapes: &[PointShape],
) -> bool {
    let PointShape { normal, radius: widened, .. } = shapes[disc.point as usize];
    let n_rounds = if MIN_WIDENING * radius < widened { N_STRIP_ROUNDS } else { 1 };
    let (mut around, mut last) = (disc.neighbors.clone(), disc.neighbors.clone());
    for round in 1..=n_rounds {
        let is_dense_surface = |neighbor: &&u32| {
            wide.of_point(**neighbor).is_none()
                && MIN_COSINE < shapes[**neighbor as usize].normal.dot(normal).abs()
        };
        let n_dense = last.iter().filter(is_dense_surface).count();
        if MAX_DENSE_FRACTION * (last.len() as f32) < n_dense as f32 {
            return false;
        }
        let discs = last.iter().filter_map(|neighbor| wide.of_point(*neighbor));
        let mut next: Vec<u32> = discs.flat_map(|disc| disc.neighbors.iter().copied()).collect();
        next.sort_unstable();
        next.dedup();
        next.retain(|neighbor| !around.contains(neighbor));
        around.extend(&next);
        let neighbor = |index: &u32| Neighbor { index: *index, distance_squared: 0.0 };
        let neighbors: Vec<Neighbor> = around.iter().map(neighbor).collect();
        let width = fit_plane(positions, disc.point as usize, &neighbors).width;
        if width < MAX_STRIP_WIDTH {
            return true;
        }
        if MIN_STRIP_ROUNDS <= round && MAX_WIDTH_OF_ROUND < width {
            return false;
        }
        last = next;
    }
    false
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
        Ok(WideDisc::new(*point as u32, neighbors, Structure::Scatter))
    };
    others.par_iter().map(with_neighbors).collect()
}

impl WideDisc {
    /// Creates a disc that was not looked at yet.
    pub fn new(point: u32, neighbors: Vec<u32>, otherwise: Structure) -> Self {
        Self { point, neighbors, otherwise, has_changed: true }
    }

    /// Keeps the neighbours on surfaces that reach the point or lie in its plane.
    fn keep_confirming(&mut self, positions: &[Vec3], shapes: &[PointShape]) {
        let (position, normal) =
            (positions[self.point as usize], shapes[self.point as usize].normal);
        let n_neighbors = self.neighbors.len();
        self.neighbors.retain(|other| {
            let offset = positions[*other as usize] - position;
            let other = shapes[*other as usize];
            let distance = offset.length();
            let is_in_plane = || {
                distance <= REACH_IN_PLANE * other.radius
                    && MIN_COSINE < normal.dot(other.normal).abs()
                    && other.normal.dot(offset).abs() < MAX_SLOPE * distance
            };
            other.is_disc() && (distance <= REACH * other.radius || is_in_plane())
        });
        self.has_changed |= self.neighbors.len() < n_neighbors;
    }

    /// Returns the distance to the last neighbour.
    fn reach(&self, positions: &[Vec3]) -> f32 {
        let last = self.neighbors.last();
        last.map_or(0.0, |last| positions[*last as usize].distance(positions[self.point as usize]))
    }
}

#[cfg(test)]
mod tests {
    //! Stray points, wires and sparse parts of surfaces.

    use crate::math::{Random, Vec3};
    use crate::points::Structure;
    use crate::points::test_clouds::prepared;

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
    fn wires_with_dense_points_do_not_become_sheets() {
        // Number of wires, distance between them and between their points.
        for (n_wires, gap, step) in [(2, 0.5, 0.02), (3, 1.0, 0.07)] {
            let mut random = Random::new(5, 0);
            let mut noise = || 0.01 * random.next_gaussian() as f32;
            let n_points = (24.0 / step) as usize * n_wires;
            let mut points: Vec<Vec3> = (0..n_points)
                .map(|i| {
                    let along = step * (i / n_wires) as f32 + noise();
                    Vec3::new(along, gap * (i % n_wires) as f32 + noise(), 6.0 + noise())
                })
                .collect();
            points.extend(plane().iter().map(|point| 30.0 * (*point - Vec3::new(0.0, 0.5, 0.0))));
            let (_, structures) = prepared(points);
            let wires = structures[..n_points].iter();
            let n_lines = wires.filter(|kind| **kind == Structure::Line).count();
            assert!(8 * n_points < 10 * n_lines, "{n_lines} of {n_points}, {gap} apart");
        }
    }

    #[test]
    fn a_pole_of_a_few_scan_lines_is_a_surface() {
        // Half of a round pole, 0.1 thick and 3 high, of points that are 0.01 apart on lines 0.04 apart.
        let point = |i: usize| {
            let (sin, cos) = (0.8 * (i % 5) as f32 - 1.6).sin_cos();
            Vec3::new(0.05 * sin, 0.05 * cos, 0.01 * (i / 5) as f32)
        };
        let mut points: Vec<Vec3> = (0..1500).map(point).collect();
        points.extend(plane().iter().map(|point| *point - Vec3::new(0.5, 0.5, 0.0)));
        let (_, structures) = prepared(points);
        let pole = structures[..1500].iter();
        let n_lines = pole.filter(|kind| **kind == Structure::Line).count();
        assert!(n_lines < 150, "{n_lines}");
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
