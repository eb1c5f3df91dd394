//! Elevation models: clouds with one point for each cell of a horizontal grid.

use crate::math::{Random, Vec3};

/// Number of random points whose coordinates tell the step of a grid.
const N_SAMPLES: usize = 4096;
/// Minimum number of points of a grid.
const MIN_POINTS: usize = 64;
/// Maximum distance of a point from its grid lines, in steps.
const MAX_OFFSET: f32 = 0.1;
/// Maximum number of cells for each point: there are none where a survey has no data.
const MAX_CELLS_PER_POINT: usize = 8;

/// The parallel lines of a grid.
struct GridLines {
    first: f32,
    step: f32,
    len: usize,
}

/// Returns the number of cells along X and Y of the grid that has all points in the middle of cells, at most one in
/// each; `None` if there is no such grid.
pub fn elevation_grid(positions: &[Vec3]) -> Option<[usize; 2]> {
    if positions.len() < MIN_POINTS {
        return None;
    }
    let columns = GridLines::through(positions, |position| position.x)?;
    let rows = GridLines::through(positions, |position| position.y)?;
    let n_cells = columns.len.checked_mul(rows.len)?;
    if MAX_CELLS_PER_POINT * positions.len() < n_cells {
        return None;
    }
    let mut is_taken = vec![false; n_cells];
    let takes_a_cell = |position: &Vec3| {
        let column = columns.index(position.x)?;
        let cell = &mut is_taken[rows.index(position.y)? * columns.len + column];
        (!std::mem::replace(cell, true)).then_some(())
    };
    positions.iter().try_for_each(takes_a_cell)?;
    Some([columns.len, rows.len])
}

impl GridLines {
    /// Returns the lines that some of the points lie on; `None` if they lie on none.
    fn through(positions: &[Vec3], coordinate: impl Fn(&Vec3) -> f32) -> Option<Self> {
        // An even step through the points could meet every other line alone.
        let mut random = Random::new(0, 0);
        let mut any_coordinate = |_| {
            let point = random.below(positions.len() as u64);
            coordinate(&positions[point as usize])
        };
        let mut sample: Vec<f32> = (0..N_SAMPLES).map(&mut any_coordinate).collect();
        sample.sort_by(f32::total_cmp);
        sample.dedup();
        let gaps = sample.windows(2).map(|pair| pair[1] - pair[0]);
        let mut lines =
            Self { first: sample[0], step: gaps.min_by(f32::total_cmp)?, len: usize::MAX };
        for value in &sample[1..] {
            let n_steps = lines.index(*value)?.max(1);
            lines.step = (value - lines.first) / n_steps as f32;
        }
        let coordinates = || positions.iter().map(&coordinate);
        lines.first = coordinates().min_by(f32::total_cmp)?;
        let last = coordinates().max_by(f32::total_cmp)?;
        lines.len = 1 + lines.index(last)?;
        Some(lines)
    }

    /// Returns the index of the line at a coordinate; `None` if none is there.
    fn index(&self, coordinate: f32) -> Option<usize> {
        let steps = (coordinate - self.first) / self.step;
        let index = steps.round();
        let is_near = (steps - index).abs() <= MAX_OFFSET && 0.0 <= index;
        (is_near && index < self.len as f32).then_some(index as usize)
    }
}

#[cfg(test)]
mod tests {
    //! Grids, with and without gaps, and points that are none.

    use super::*;

    /// Returns the points of a hill at a cell size of 0.3, rounded to hundredths as text files have them.
    fn hill() -> Vec<Vec3> {
        let rounded = |value: f32| (100.0 * value).round() / 100.0;
        let point = |i: i32| {
            let [x, y] = [i % 80, i / 80].map(|cell| rounded(7.123 + cell as f32 / 3.0));
            Vec3::new(x, y, 5.0 * (0.3 * x).sin() * (0.2 * y).cos())
        };
        (0..80 * 60).map(point).collect()
    }

    #[test]
    fn grids_are_found_in_any_order_and_with_gaps() {
        let mut points = hill();
        assert_eq!(elevation_grid(&points), Some([80, 60]));
        points.reverse();
        points.retain(|point| 9.0 < (*point - Vec3::new(20.0, 15.0, point.z)).length_squared());
        assert!(points.len() < 80 * 60);
        assert_eq!(elevation_grid(&points), Some([80, 60]));
    }

    #[test]
    fn walls_and_scans_are_no_grids() {
        let mut with_wall = hill();
        with_wall.push(with_wall[40] + Vec3::Z);
        assert_eq!(elevation_grid(&with_wall), None);
        let mut random = Random::new(3, 0);
        let mut moved =
            |point: &Vec3| *point + 0.3 * Vec3::new(random.next_f32(), random.next_f32(), 0.0);
        let scan: Vec<Vec3> = hill().iter().map(&mut moved).collect();
        assert_eq!(elevation_grid(&scan), None);
        assert_eq!(elevation_grid(&[Vec3::ZERO; 100]), None);
        assert_eq!(elevation_grid(&[]), None);
    }
}
