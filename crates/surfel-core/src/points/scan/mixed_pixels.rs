//! Mixed pixels: points in the air between two surfaces, from pulses that hit the edge of the near one and the far one
//! together.
//!
//! In the grid of a scan, such a point lies between a point of a near and one of a far surface, and the lines to both
//! are nearly along the ray: at an incidence above 80 degrees. On a surface that rays graze all lines are so; there the
//! lines between the points beyond decide.

use super::scan_grid::{ScanGrid, ScanGrids};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::PointCloud;
use crate::progress::Progress;
use rayon::prelude::*;

/// Minimum cosine of the angle between a ray and the line to the next point: that of 10 degrees.
const MIN_COSINE: f32 = 0.985;
/// Maximum number of mixed pixels side by side: a pulse is rarely wider than three rays.
const MAX_RUN: isize = 3;
/// Minimum ratio of the jump of the range to its changes on the near and on the far surface. Less is noise.
const MIN_JUMP: f32 = 4.0;
/// Maximum relative difference of a range from that of a plane through two others.
const MAX_PLANE_ERROR: f32 = 0.02;

/// The choice whether mixed pixels are dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum MixedPixels {
    /// They are dropped.
    #[default]
    Drop,
    /// They stay.
    Keep,
}

/// Returns the points of a cloud that are no mixed pixels; `None` if it has none, or no grids.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn without_mixed_pixels(
    cloud: &PointCloud,
    progress: &dyn Progress,
) -> Result<Option<Vec<u32>>> {
    let Some(grids) = ScanGrids::new(cloud, progress)? else { return Ok(None) };
    let mut mixed: Vec<u32> = Vec::new();
    for grid in grids.scans.iter().flatten() {
        let is_mixed = |([row, column], _): &&([usize; 2], usize)| {
            let lines = [[1, 0], [0, 1]].map(|step| GridLine {
                grid,
                positions: &cloud.positions,
                cell: [*row as isize, *column as isize],
                step,
            });
            lines.iter().any(GridLine::is_mixed)
        };
        let mut cells = grid.cells();
        loop {
            progress.check()?;
            let cells: Vec<([usize; 2], usize)> = cells.by_ref().take(1 << 20).collect();
            if cells.is_empty() {
                break;
            }
            mixed.par_extend(cells.par_iter().filter(is_mixed).map(|(_, point)| *point as u32));
        }
    }
    if mixed.is_empty() {
        return Ok(None);
    }
    mixed.par_sort_unstable();
    let is_kept = |point: &u32| mixed.binary_search(point).is_err();
    Ok(Some((0..cloud.len() as u32).filter(is_kept).collect()))
}

/// The points before and after a point along a row or a column of a grid.
struct GridLine<'a> {
    grid: &'a ScanGrid,
    positions: &'a [Vec3],
    cell: [isize; 2],
    step: [isize; 2],
}

impl GridLine<'_> {
    /// Returns true if the point is mixed of one surface before and one after it.
    fn is_mixed(&self) -> bool {
        let Some(sense) = self.veil(0, 1) else { return false };
        if self.veil(-1, 0) != Some(sense) {
            return false;
        }
        // The points at the ends of the run are those of the surfaces.
        let end = |direction: isize| {
            (1..=MAX_RUN).find(|i| self.is_even(direction * i, direction * (i + 1)))
        };
        let (Some(before), Some(after)) = (end(-1), end(1)) else { return false };
        let is_run = (-before..after).all(|i| self.veil(i, i + 1) == Some(sense));
        if !is_run || MAX_RUN < before + after - 1 {
            return false;
        }
        self.is_jump(-before, after)
            && !self.is_on_plane(-before, -1)
            && !self.is_on_plane(after, 1)
    }

    /// Returns the offset from the scanner to the `i`-th point from this one.
    fn offset(&self, i: isize) -> Option<Vec3> {
        let [row, column] = [0, 1].map(|axis| self.cell[axis] + i * self.step[axis]);
        Some(self.positions[self.grid.point(row, column)?] - self.grid.station)
    }

    /// Returns true if the range grows from one point to the next, false if it falls, and `None` if the line between
    /// them is not along the ray or one was not measured.
    fn veil(&self, i: isize, next: isize) -> Option<bool> {
        let (from, to) = (self.offset(i)?, self.offset(next)?);
        let (line, ray) = (to - from, 0.5 * (from + to));
        let along = line.dot(ray);
        (MIN_COSINE * line.length() * ray.length() < along.abs()).then_some(0.0 < along)
    }

    /// Returns true if two points are of one surface, which rays do not graze.
    fn is_even(&self, i: isize, next: isize) -> bool {
        self.offset(i).is_some() && self.offset(next).is_some() && self.veil(i, next).is_none()
    }

    /// Returns true if the range differs far more from one end of the run to the other than on each surface.
    fn is_jump(&self, before: isize, after: isize) -> bool {
        let range = |i: isize| self.offset(i).map_or(f32::NAN, Vec3::length);
        let jump = (range(after) - range(before)).abs();
        let near = (range(before) - range(before - 1)).abs();
        let far = (range(after + 1) - range(after)).abs();
        MIN_JUMP * (near + far) < jump
    }

    /// Returns true if the point continues the plane through the last two points at one end: on a plane, the reciprocal
    /// of the range changes by equal steps.
    fn is_on_plane(&self, end: isize, direction: isize) -> bool {
        let inverse = |i: isize| self.offset(i).map_or(f32::NAN, |offset| 1.0 / offset.length());
        let slope = inverse(end) - inverse(end + direction);
        let expected = inverse(end) + slope * end.abs() as f32;
        (expected - inverse(0)).abs() < MAX_PLANE_ERROR * inverse(0)
    }
}

#[cfg(test)]
mod tests {
    //! Grids with a jump, with and without points in between.

    use super::*;
    use crate::points::scan::scan_grid::tests::scan;
    use crate::progress::NoProgress;

    /// Returns the ranges of the points that are dropped.
    fn dropped(cloud: &PointCloud) -> Vec<f32> {
        let kept = without_mixed_pixels(cloud, &NoProgress).unwrap();
        let Some(kept) = kept else { return Vec::new() };
        let all = 0..cloud.len() as u32;
        let dropped = all.filter(|point| kept.binary_search(point).is_err());
        dropped.map(|point| cloud.positions[point as usize].length().round()).collect()
    }

    /// Returns a wall at 5 m before one at 9 m, with `n_between` columns of points in the air between them.
    fn two_walls(n_between: usize) -> PointCloud {
        scan(10, 20, |_, column| {
            let is_between = (10..10 + n_between).contains(&column);
            Some(match column {
                _ if is_between => 5.0 + (column - 9) as f32 * 4.0 / (n_between + 1) as f32,
                0..10 => 5.0,
                _ => 9.0,
            })
        })
    }

    #[test]
    fn points_between_two_walls_are_dropped() {
        assert_eq!(dropped(&two_walls(0)), []);
        assert_eq!(dropped(&two_walls(1)), [7.0; 10]);
        assert_eq!(dropped(&two_walls(3)).len(), 30);
        assert_eq!(dropped(&two_walls(5)), [], "so many are a surface");
    }

    #[test]
    fn surfaces_that_rays_graze_and_thin_things_stay() {
        // The ground 1.6 m under the scanner: the last rows are at an incidence above 80 degrees.
        let ground = |row: usize| 1.6 / (0.01f32 * (30 - row) as f32).sin();
        let grazed = scan(60, 20, |row, _| (row < 29).then(|| ground(row)));
        assert_eq!(dropped(&grazed), []);
        // A wall that stands on it, and one before it.
        let walls = scan(60, 20, |row, _| Some(if row < 27 { ground(row) } else { 53.4 }));
        assert_eq!(dropped(&walls), []);
        let behind = scan(60, 20, |row, _| Some(if row < 20 { 3.0 } else { ground(row.min(28)) }));
        assert_eq!(dropped(&behind), []);
        let wire = scan(20, 20, |row, _| Some(if row == 7 { 3.0 } else { 9.0 }));
        assert_eq!(dropped(&wire), []);
        let steep = scan(20, 20, |row, column| Some(4.0 + 0.1 * (row + column) as f32));
        assert_eq!(dropped(&steep), []);
    }

    #[test]
    fn small_grids_have_no_mixed_pixels() {
        for (n_rows, n_columns) in [(1, 1), (1, 4), (2, 2)] {
            assert_eq!(
                dropped(&scan(n_rows, n_columns, |_, column| Some(column as f32 + 1.0))),
                []
            );
        }
        assert_eq!(
            dropped(&scan(1, 7, |_, i| Some([5.0, 5.0, 5.0, 7.0, 9.0, 9.0, 9.0][i]))),
            [7.0]
        );
        let absent = [Some(5.0), Some(5.0), None, Some(7.0), Some(9.0), Some(9.0), Some(9.0)];
        assert_eq!(dropped(&scan(1, 7, |_, i| absent[i])), []);
    }
}
