//! Square cells of the ground plan: points near some positions as seen from above.

use crate::math::Vec3;
use rayon::prelude::*;
use std::collections::HashSet;

/// A cell of the ground plan.
pub type PlanCell = [i64; 2];

/// The ground plan in square cells. Z points up.
#[derive(Clone, Copy)]
pub struct PlanCells {
    /// Side of a cell.
    pub width: f32,
}

impl PlanCells {
    /// Returns the cell of a position.
    pub fn of(self, position: Vec3) -> PlanCell {
        [position.x, position.y].map(|coordinate| (coordinate / self.width).floor() as i64)
    }

    /// Returns, in the order of `positions`, those in the cells of some targets and in the cells next to them.
    pub fn points_near(self, positions: &[Vec3], targets: impl Iterator<Item = Vec3>) -> Vec<u32> {
        let own: HashSet<PlanCell> = targets.map(|target| self.of(target)).collect();
        let around = |[x, y]: PlanCell| {
            (0..9).map(move |i| [x.saturating_add(i % 3 - 1), y.saturating_add(i / 3 - 1)])
        };
        let cells: HashSet<PlanCell> = own.into_iter().flat_map(around).collect();
        let is_near = |point: &u32| cells.contains(&self.of(positions[*point as usize]));
        (0..positions.len() as u32).into_par_iter().filter(is_near).collect()
    }
}

#[cfg(test)]
mod tests {
    //! Cells on both sides of the origin, and coordinates beyond all cells.

    use super::*;

    #[test]
    fn points_near_places_are_those_in_nine_cells_each() {
        let cells = PlanCells { width: 2.0 };
        assert_eq!(cells.of(Vec3::new(-0.1, 4.0, 99.0)), [-1, 2]);
        let positions: Vec<Vec3> = (-5..5).map(|i| Vec3::new(i as f32, 0.0, i as f32)).collect();
        let near = cells.points_near(&positions, [Vec3::new(0.5, 1.0, -7.0)].into_iter());
        assert_eq!(near, (3..9).collect::<Vec<u32>>());
        let far = [Vec3::new(f32::MAX, f32::MIN, 0.0)];
        assert_eq!(cells.points_near(&positions, far.into_iter()), []);
    }
}
