//! Walls below roofs: the discs of walls seen from the air are wide, and would stand out above the roof and beyond the corners
//! of a building.

use super::plan_cells::PlanCells;
use super::point_shape::PointShape;
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::KdTree;
use crate::progress::Progress;
use rayon::prelude::*;

/// Maximum cosine between the normal of a wall and the vertical.
const MAX_COSINE: f32 = 0.3;
/// Number of points, as seen from above, among which the highest is sought.
const N_NEAREST: usize = 24;
/// Number of positions on each side of a disc at which the highest points are sought.
const N_SAMPLES: i32 = 4;
/// Ratio of a radius to the next one that is tried.
const STEP: f32 = 0.8;

/// Narrows upright discs that are wider than the typical one until they lie, all along, below the highest points around as
/// seen from above, by a typical radius at most higher. Z points up.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn narrow_to_roofs(
    positions: &[Vec3],
    typical_radius: f32,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let is_wide_wall = |point: &usize| {
        let shape = &shapes[*point];
        shape.is_disc() && typical_radius < shape.radius && shape.normal.z.abs() < MAX_COSINE
    };
    let walls: Vec<usize> = (0..shapes.len()).filter(is_wide_wall).collect();
    let widest = walls.iter().map(|point| shapes[*point].radius).fold(typical_radius, f32::max);
    let cells = PlanCells { width: widest };
    let near = cells.points_near(positions, walls.iter().map(|point| positions[*point]));
    let plan: Vec<Vec3> = near.iter().map(|p| positions[*p as usize].with_z(0.0)).collect();
    let plan = KdTree::new(&plan, progress)?;
    let highest = |position: Vec3| {
        let nearest = plan.nearest(position.with_z(0.0), N_NEAREST, None);
        let heights = nearest.iter().map(|p| positions[near[p.index as usize] as usize].z);
        heights.fold(f32::NEG_INFINITY, f32::max)
    };
    let narrowed = |point: &usize| -> Result<f32> {
        progress.check()?;
        let (position, shape) = (positions[*point], &shapes[*point]);
        let along = shape.normal.cross(Vec3::Z).normalize_or_zero();
        let is_below = |radius: f32| {
            let is_below_at = |i: i32| {
                let offset = i as f32 / N_SAMPLES as f32 * radius;
                let top = position.z + (radius * radius - offset * offset).sqrt();
                top <= highest(position + offset * along) + typical_radius
            };
            (-N_SAMPLES..=N_SAMPLES).all(is_below_at)
        };
        let radii = std::iter::successors(Some(shape.radius), |radius| Some(STEP * radius));
        let mut wide = radii.take_while(|radius| typical_radius < *radius);
        Ok(wide.find(|radius| is_below(*radius)).unwrap_or(typical_radius))
    };
    let radii = walls.par_iter().map(narrowed).collect::<Result<Vec<_>>>()?;
    walls.into_iter().zip(radii).for_each(|(point, radius)| shapes[point].radius = radius);
    Ok(())
}
