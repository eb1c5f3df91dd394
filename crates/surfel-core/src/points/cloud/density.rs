//! The number of points per area on the ground.

use crate::math::Vec3;
use rayon::prelude::*;

/// Returns the mean number of points per square unit of the XY plane, over the cells of a grid that hold points. The
/// cells have sides of `cell`, which should be several times the distance between points. It is `None` without points
/// or a positive cell.
pub fn points_per_area(positions: &[Vec3], cell: f32) -> Option<f64> {
    if positions.is_empty() || !(0.0 < cell && cell < f32::INFINITY) {
        return None;
    }
    let cell_of = |p: &Vec3| [(p.x / cell).floor() as i32, (p.y / cell).floor() as i32];
    let mut cells: Vec<[i32; 2]> = positions.par_iter().map(cell_of).collect();
    cells.par_sort_unstable();
    cells.dedup();
    Some(positions.len() as f64 / (cells.len() as f64 * f64::from(cell) * f64::from(cell)))
}

#[cfg(test)]
mod tests {
    //! Densities that are known.

    use super::*;

    #[test]
    fn a_grid_of_points_has_its_density_whatever_its_height() {
        let positions: Vec<Vec3> = (0..40_000)
            .map(|i| Vec3::new(0.5 * (i % 200) as f32 - 20.0, 0.25 * (i / 200) as f32, i as f32))
            .collect();
        assert_eq!(points_per_area(&positions, 2.0), Some(8.0));
        assert_eq!(points_per_area(&positions, 0.0), None);
        assert_eq!(points_per_area(&[], 1.0), None);
    }
}
