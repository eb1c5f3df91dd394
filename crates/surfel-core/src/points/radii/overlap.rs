//! How many discs of points lie over each other.

use crate::math::{Aabb, DVec3};
use std::f64::consts::PI;

/// Returns the number of discs over each other, about: the area of `n_points` of these radii, which may be a sample, as a
/// fraction of that of a box around the discs. `bounds` is that of their centres. 2 to 5 are usual.
pub fn mean_overlap(n_points: usize, radii: impl Iterator<Item = f32>, bounds: Aabb) -> f32 {
    let sums = radii.map(f64::from).fold((0usize, 0.0, 0.0), |(count, sum, squares), radius| {
        (count + 1, sum + radius, squares + radius * radius)
    });
    let (count, sum, squares) = sums;
    if count == 0 {
        return 0.0;
    }
    let DVec3 { x, y, z } = bounds.size().as_dvec3() + 2.0 * sum / count as f64;
    let area = 2.0 * (x * y + y * z + z * x);
    (PI * n_points as f64 * (squares / count as f64) / area) as f32
}

#[cfg(test)]
mod tests {
    //! Overlap of discs on a lattice.

    use super::*;
    use crate::math::Vec3;

    #[test]
    fn the_overlap_of_a_sheet_is_counted_on_both_of_its_sides() {
        let bounds = Aabb { min: Vec3::ZERO, max: Vec3::new(100.0, 100.0, 0.0) };
        let sampled =
            |n_sampled: usize| mean_overlap(10_000, vec![1.0; n_sampled].into_iter(), bounds);
        let expected = (PI * 1e4 / (2.0 * (102.0 * 102.0 + 2.0 * 102.0 * 2.0))) as f32;
        assert!((sampled(10_000) - expected).abs() < 1e-4, "{}", sampled(10_000));
        assert_eq!((sampled(100), sampled(0)), (sampled(10_000), 0.0));
    }
}
