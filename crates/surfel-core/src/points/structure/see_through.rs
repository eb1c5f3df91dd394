//! Discs through which a scanner saw the land below: the wires of a power line side by side, the lattice of a pylon.
//!
//! Wires that lie a few spacings apart are a plane for their neighbours. A roof hides the land below it, except beyond its
//! edges; below a wire land was measured all around.

use super::octants::{Octants, octant};
use super::plan_cells::{PlanCell, PlanCells};
use super::point_shape::{PointShape, Structure};
use super::solids::apply_structure;
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::KdTree;
use crate::progress::Progress;
use rayon::prelude::*;
use std::collections::HashMap;

/// Number of points nearest to a disc as seen from above, among which the land is sought.
const N_AROUND: usize = 96;
/// Minimum height of a disc above the land, in typical radii. It is also higher than wide.
const MIN_HEIGHT: f32 = 3.0;
/// Minimum distance as seen from above of a point of the land, in typical radii: below a point of a wall lie others of it.
const MIN_DISTANCE: f32 = 0.5;
/// Number of successive octants without land at which a disc may hide it, as a roof does.
const MIN_EMPTY: usize = 2;
/// Width of the cells that tell which discs stand high, in typical radii.
const CELL: f32 = 4.0;
/// Maximum number of points among which the lowest are sought.
const MAX_SAMPLE: usize = 1 << 20;

/// Makes lines of the discs through which land was seen, if they are wider than the typical one: dense points hide what lies
/// below. Z points up.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn open_see_through_discs(
    tree: &KdTree,
    radii: &[f32],
    typical_radius: f32,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    if !(0.0 < typical_radius && typical_radius.is_finite()) {
        return Ok(());
    }
    let positions = tree.positions();
    let lowest = LowestPoints::new(positions, CELL * typical_radius);
    let min_height = |radius: f32| radius.max(MIN_HEIGHT * typical_radius);
    let is_candidate = |point: &usize| {
        let shape = &shapes[*point];
        let height = positions[*point].z - lowest.around(positions[*point]);
        shape.is_disc() && typical_radius < shape.radius && min_height(shape.radius) < height
    };
    let candidates: Vec<usize> = (0..shapes.len()).into_par_iter().filter(is_candidate).collect();
    if candidates.is_empty() {
        return Ok(());
    }
    let near = lowest.plan.points_near(positions, candidates.iter().map(|point| positions[*point]));
    let near: Vec<Vec3> = near.into_iter().map(|point| positions[point as usize]).collect();
    let plan: Vec<Vec3> = near.iter().map(|position| position.with_z(0.0)).collect();
    let plan = KdTree::new(&plan, progress)?;
    let is_open = |point: &usize| -> Result<bool> {
        progress.check()?;
        let far = MIN_DISTANCE * typical_radius;
        Ok(sees_land(&plan, &near, positions[*point], min_height(shapes[*point].radius), far))
    };
    let is_open = candidates.par_iter().map(is_open).collect::<Result<Vec<_>>>()?;
    let opened = candidates.iter().zip(is_open).filter(|(_, is_open)| *is_open);
    let opened: Vec<usize> = opened.map(|(point, _)| *point).collect();
    let line_shape = |point: &usize| {
        let mut shape = shapes[*point];
        apply_structure(tree, *point, radii[*point], Structure::Line, &mut shape);
        shape
    };
    let line_shapes: Vec<PointShape> = opened.par_iter().map(line_shape).collect();
    opened.into_iter().zip(line_shapes).for_each(|(point, shape)| shapes[point] = shape);
    Ok(())
}

/// True if points farther than `min_distance` on all sides of a disc, as seen from above, lie `min_height` below it. `plan`
/// holds the places of `near` without their heights.
fn sees_land(plan: &KdTree, near: &[Vec3], own: Vec3, min_height: f32, min_distance: f32) -> bool {
    let mut sides = Octants::default();
    for neighbor in plan.nearest(own.with_z(0.0), N_AROUND, None) {
        let offset = near[neighbor.index as usize] - own;
        let is_far = min_distance * min_distance < neighbor.distance_squared;
        if is_far && offset.z < -min_height {
            sides.insert(octant(offset.x, offset.y));
        }
    }
    !sides.has_gap(MIN_EMPTY)
}

/// The heights of the lowest points in the cells of the ground plan, of at most [`MAX_SAMPLE`] points.
struct LowestPoints {
    plan: PlanCells,
    cells: HashMap<PlanCell, f32>,
}

impl LowestPoints {
    fn new(positions: &[Vec3], width: f32) -> Self {
        let mut lowest = Self { plan: PlanCells { width }, cells: HashMap::new() };
        for position in positions.iter().step_by(positions.len().div_ceil(MAX_SAMPLE).max(1)) {
            let cell = lowest.plan.of(*position);
            let height = lowest.cells.entry(cell).or_insert(f32::INFINITY);
            *height = height.min(position.z);
        }
        lowest
    }

    /// Returns the height of the lowest point in the cell of a position.
    fn around(&self, position: Vec3) -> f32 {
        self.cells.get(&self.plan.of(position)).copied().unwrap_or(position.z)
    }
}

#[cfg(test)]
mod tests {
    //! Wires side by side over land, and roofs.

    use super::*;
    use crate::math::Random;
    use crate::points::{PointCloud, Preparation, PreparedCloud, prepare};
    use crate::progress::NoProgress;

    /// Prepares points over land of 200x200 with a spacing of 0.7.
    fn over_land(mut points: Vec<Vec3>) -> (PreparedCloud, Vec<Structure>) {
        let mut random = Random::new(1, 0);
        let mut coordinate = || 200.0 * (random.next_f32() - 0.5);
        points.extend((0..80_000).map(|_| Vec3::new(coordinate(), coordinate(), 0.0)));
        let cloud = PointCloud::from_positions(points);
        let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let structures = cloud.structures().unwrap();
        (cloud, structures)
    }

    #[test]
    fn wires_side_by_side_do_not_become_sheets() {
        let mut random = Random::new(2, 0);
        // Heights and sides of the wires of a pylon. The distances between points are random.
        let positions = [(15.2, 6.0), (15.2, -6.0), (19.2, 5.0), (19.2, -5.0), (23.2, 4.0)];
        let mut wires: Vec<Vec3> = Vec::new();
        for (height, side) in positions {
            let mut noise = || 0.05 * (random.next_f32() - 0.5);
            let point = |_| {
                let (y, z) = (side + noise(), height + noise());
                Vec3::new(160.0 * 20.0 * noise(), y, z)
            };
            wires.extend((0..500).map(point));
        }
        let n_wires = wires.len();
        let (cloud, structures) = over_land(wires);
        let is_sheet =
            |point: &usize| structures[*point] == Structure::Surface && 1.5 < cloud.radii()[*point];
        let n_sheets = (0..n_wires).filter(is_sheet).count();
        assert!(n_sheets < n_wires / 25, "{n_sheets} of {n_wires}");
        assert!(!structures[n_wires..].contains(&Structure::Line));
    }

    #[test]
    fn sparse_roofs_stay_surfaces() {
        let mut random = Random::new(3, 0);
        let mut coordinate = || 12.0 * (random.next_f32() - 0.5);
        let roof: Vec<Vec3> =
            (0..150).map(|_| Vec3::new(coordinate(), coordinate(), 8.0)).collect();
        let mut random = Random::new(1, 0);
        let mut coordinate = || 200.0 * (random.next_f32() - 0.5);
        let land = (0..80_000).map(|_| Vec3::new(coordinate(), coordinate(), 0.0));
        // The roof hides the land below it.
        let land = land.filter(|p| 6.0 < p.x.abs().max(p.y.abs()));
        let n_roof = roof.len();
        let cloud = PointCloud::from_positions(roof.into_iter().chain(land).collect());
        let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let structures = cloud.structures().unwrap();
        let is_surface = |structure: &&Structure| **structure == Structure::Surface;
        let n_surface = structures[..n_roof].iter().filter(is_surface).count();
        assert!(n_roof - n_roof / 20 < n_surface, "{n_surface} of {n_roof}");
    }
}
