//! Volumes between the points of a scene and a base plane, on a grid of cells over level ground (2.5D).

use super::FlatScene;
use super::visit_points::{VisitedPoint, visit_points_in_turn};
use crate::error::{Error, Result};
use crate::math::DVec3;
use crate::points::Polygon;
use crate::progress::Progress;

/// The area, the base and the grid of a volume.
#[derive(Clone, Debug)]
pub struct VolumeQuery {
    /// Corners of a polygon in world coordinates, at least three. Seen from above, it bounds the volume.
    pub corners: Vec<DVec3>,
    /// The unit vector up.
    pub up: DVec3,
    /// Height of the base plane, which is level.
    pub base: BaseHeight,
    /// Side of a cell; none for twice the mean spacing of the points.
    pub cell_size: Option<f64>,
}

/// The height of a base plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BaseHeight {
    /// Height of the lowest corner.
    Lowest,
    /// Mean height of the corners.
    Mean,
    /// A coordinate along the up axis.
    At(f64),
}

/// Volumes above and below a base plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Volume {
    /// Volume between the base and points above it: what is cut to reach the base.
    pub cut: f64,
    /// Volume between the base and points below it: what is filled to reach the base.
    pub fill: f64,
    /// Height of the base.
    pub base: f64,
    /// Side of a cell.
    pub cell_size: f64,
    /// Level area of the polygon.
    pub area: f64,
    /// Fraction of the area whose cells hold no point; they count for nothing.
    pub empty_fraction: f64,
    /// Number of points over the area.
    pub n_points: u64,
}

/// Maximum number of cells; larger cells are taken for more.
const MAX_CELLS: f64 = 4_000_000.0;
/// Side of a cell in mean spacings of the points, so that few cells are empty.
const SPACINGS_PER_CELL: f64 = 2.0;

/// Returns the volumes between points and base: the height of a cell is the mean height of its points.
///
/// # Errors
///
/// Fails for corners that bound no area, and if `progress` is cancelled.
pub fn cut_and_fill(
    scene: &FlatScene,
    query: &VolumeQuery,
    progress: &dyn Progress,
) -> Result<Volume> {
    let ground = Ground::new(query);
    let polygon = Polygon::new(std::slice::from_ref(&ground.ring))?;
    let area = signed_area(&ground.ring).abs();
    if !area.is_normal() {
        let found = format!("corners around an area of {area}");
        return Err(Error::Setting { name: "polygon", found, expected: "an area" });
    }
    let inside = |point: &VisitedPoint| {
        let [x, y, height] = ground.coordinates(point.position);
        polygon.contains([x, y]).then_some([x, y, height])
    };
    let cell_size = match query.cell_size {
        Some(size) => size,
        None => {
            let mut n_points = 0;
            let count = |point: &VisitedPoint| inside(point).map(|_| ());
            visit_points_in_turn(scene, progress, count, |()| n_points += 1)?;
            spacing(area, n_points)
        }
    };
    let grid = Grid::new(&ground, cell_size);
    let (mut heights, mut n_points) = (vec![(0.0, 0u32); grid.n_columns * grid.n_rows], 0);
    visit_points_in_turn(scene, progress, inside, |[x, y, height]| {
        let (sum, n) = &mut heights[grid.cell_of([x, y])];
        *sum += height - ground.base;
        *n += 1;
        n_points += 1;
    })?;
    let (base, cell_size) = (ground.base, grid.cell_size);
    let mut volume = Volume { base, cell_size, area, n_points, ..Volume::default() };
    let mut empty_area = 0.0;
    for row in 0..grid.n_rows {
        progress.check()?;
        let strip = grid.row_of(&ground.ring, row);
        for column in 0..grid.n_columns {
            let covered = grid.covered_area(&strip, column);
            match heights[row * grid.n_columns + column] {
                (_, 0) => empty_area += covered,
                (sum, n) => {
                    let part = covered * sum / f64::from(n);
                    *(if 0.0 < part { &mut volume.cut } else { &mut volume.fill }) += part.abs();
                }
            }
        }
    }
    volume.empty_fraction = (empty_area / area).clamp(0.0, 1.0);
    Ok(volume)
}

/// Side of cells for a number of points on an area, with two digits.
fn spacing(area: f64, n_points: usize) -> f64 {
    let side = SPACINGS_PER_CELL * (area / n_points.max(1) as f64).sqrt();
    let unit = 10f64.powf(side.log10().floor() - 1.0);
    (side / unit).round() * unit
}

/// Coordinates over level ground, from the first corner so that large coordinates keep their precision.
struct Ground {
    start: DVec3,
    axes: [DVec3; 2],
    up: DVec3,
    /// The corners on the ground.
    ring: Vec<[f64; 2]>,
    base: f64,
}

impl Ground {
    fn new(query: &VolumeQuery) -> Self {
        let VolumeQuery { up, corners, base, .. } = query;
        let axis = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
        let east = axis.reject_from_normalized(*up).normalize_or_zero();
        let heights = || corners.iter().map(|corner| up.dot(*corner));
        let base = match base {
            BaseHeight::Lowest => heights().fold(f64::INFINITY, f64::min),
            BaseHeight::Mean => heights().sum::<f64>() / corners.len() as f64,
            BaseHeight::At(height) => *height,
        };
        let (start, axes) = (corners[0], [east, up.cross(east)]);
        let mut ground = Self { start, axes, up: *up, ring: Vec::new(), base };
        ground.ring = corners.iter().map(|corner| ground.position(*corner)).collect();
        ground
    }

    fn position(&self, point: DVec3) -> [f64; 2] {
        self.axes.map(|axis| axis.dot(point - self.start))
    }

    fn coordinates(&self, point: DVec3) -> [f64; 3] {
        let [x, y] = self.position(point);
        [x, y, self.up.dot(point)]
    }
}

/// Square cells over the bounds of the polygon.
struct Grid {
    low: [f64; 2],
    cell_size: f64,
    n_columns: usize,
    n_rows: usize,
}

impl Grid {
    fn new(ground: &Ground, wanted_size: f64) -> Self {
        let ends = |axis: usize| {
            let values = ground.ring.iter().map(|corner| corner[axis]);
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            })
        };
        let [(left, right), (bottom, top)] = [ends(0), ends(1)];
        let (width, height) = (right - left, top - bottom);
        let longest = width.max(height);
        let smallest = (width * height / MAX_CELLS).sqrt().max(longest / MAX_CELLS);
        let cell_size = wanted_size.max(smallest).min(longest);
        let n_cells = |length: f64| ((length / cell_size).ceil() as usize).max(1);
        let (n_columns, n_rows) = (n_cells(width), n_cells(height));
        Self { low: [left, bottom], cell_size, n_columns, n_rows }
    }

    fn cell_of(&self, position: [f64; 2]) -> usize {
        let index = |axis: usize, n: usize| {
            (((position[axis] - self.low[axis]) / self.cell_size) as usize).min(n - 1)
        };
        index(1, self.n_rows) * self.n_columns + index(0, self.n_columns)
    }

    /// The part of a polygon in a row of cells.
    fn row_of(&self, ring: &[[f64; 2]], row: usize) -> Vec<[f64; 2]> {
        self.clipped(ring, 1, row)
    }

    /// The area of the part of a row's polygon that lies in one of its cells.
    fn covered_area(&self, strip: &[[f64; 2]], column: usize) -> f64 {
        signed_area(&self.clipped(strip, 0, column)).abs()
    }

    fn clipped(&self, ring: &[[f64; 2]], axis: usize, cell: usize) -> Vec<[f64; 2]> {
        let low = self.low[axis] + cell as f64 * self.cell_size;
        let above = clip(ring, |corner| corner[axis] - low);
        clip(&above, |corner| low + self.cell_size - corner[axis])
    }
}

/// The part of a ring where `inside` is not negative, after Sutherland and Hodgman (1974). Where it falls apart, its
/// parts are joined by sides that lie on each other and enclose no area.
fn clip(ring: &[[f64; 2]], inside: impl Fn([f64; 2]) -> f64) -> Vec<[f64; 2]> {
    let mut clipped = Vec::new();
    for (i, &corner) in ring.iter().enumerate() {
        let next = ring[(i + 1) % ring.len()];
        let (here, there) = (inside(corner), inside(next));
        if 0.0 <= here {
            clipped.push(corner);
        }
        if (0.0 <= here) != (0.0 <= there) {
            let t = here / (here - there);
            clipped.push([0, 1].map(|axis| corner[axis] + t * (next[axis] - corner[axis])));
        }
    }
    clipped
}

/// Area of a ring, positive if its corners go counter-clockwise.
fn signed_area(ring: &[[f64; 2]]) -> f64 {
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|([x0, y0], [x1, y1])| x0 * y1 - x1 * y0).sum::<f64>() / 2.0
}

#[cfg(test)]
mod tests {
    //! Volumes over a slope against their closed forms.

    use super::super::visit_points::slope::slope;
    use super::*;
    use crate::progress::NoProgress;

    const ORIGIN: DVec3 = DVec3::new(484_000.0, 6_632_000.0, 100.0);

    /// A query over the slope z = 100 + x / 2.
    fn query(corners: &[[f64; 2]], base: BaseHeight, cell_size: Option<f64>) -> VolumeQuery {
        let corner = |[x, y]: &[f64; 2]| ORIGIN + DVec3::new(*x, *y, 0.5 * x);
        VolumeQuery { corners: corners.iter().map(corner).collect(), up: DVec3::Z, base, cell_size }
    }

    fn volume(query: &VolumeQuery) -> Volume {
        cut_and_fill(&slope(), query, &NoProgress).unwrap()
    }

    const SQUARE: [[f64; 2]; 4] = [[9.5, 9.5], [89.5, 9.5], [89.5, 59.5], [9.5, 59.5]];

    #[test]
    fn a_prism_lies_above_the_lowest_corner() {
        let found = volume(&query(&SQUARE, BaseHeight::Lowest, Some(1.0)));
        // Mean height 20 over 80 x 50.
        assert!((found.cut - 80_000.0).abs() < 1.0 && found.fill == 0.0, "{found:?}");
        assert!((found.base - 104.75).abs() < 1e-9 && (found.area - 4000.0).abs() < 1e-6);
        assert_eq!((found.n_points, found.empty_fraction, found.cell_size), (4000, 0.0, 1.0));
    }

    #[test]
    fn cut_and_fill_balance_about_the_mean() {
        let found = volume(&query(&SQUARE, BaseHeight::Mean, Some(1.0)));
        // Two wedges of 40 x 50 with a mean height of 10.
        assert!((found.cut - 20_000.0).abs() < 1.0, "{found:?}");
        assert!((found.cut - found.fill).abs() < 1e-3, "{found:?}");
        let above_all = volume(&query(&SQUARE, BaseHeight::At(200.0), None));
        assert!(above_all.cut == 0.0 && (above_all.fill - 4000.0 * (200.0 - 124.75)).abs() < 300.0);
        assert!((above_all.cell_size - 2.0).abs() < 1e-9, "{above_all:?}");
    }

    #[test]
    fn cells_at_the_border_count_by_their_area() {
        // An L of three squares of 20 x 20 whose corners lie within cells, either way around.
        let corners =
            [[20.3, 20.3], [60.3, 20.3], [60.3, 40.3], [40.3, 40.3], [40.3, 60.3], [20.3, 60.3]];
        let exact = 800.0 * 0.5 * 40.3 + 400.0 * 0.5 * 30.3;
        for corners in [corners.to_vec(), corners.iter().rev().copied().collect()] {
            let found = volume(&query(&corners, BaseHeight::At(100.0), Some(1.0)));
            assert!((found.area - 1200.0).abs() < 1e-6, "{found:?}");
            assert!((found.cut / exact - 1.0).abs() < 0.01, "{found:?} {exact}");
        }
    }

    #[test]
    fn cells_without_points_are_told() {
        let corners = [[80.0, 20.0], [120.5, 20.0], [120.5, 40.0], [80.0, 40.0]];
        let found = volume(&query(&corners, BaseHeight::At(100.0), Some(1.0)));
        // The points end at 100, half a cell before the border of the grid's cell.
        assert!((found.empty_fraction - 19.5 / 40.5).abs() < 0.03, "{found:?}");
        let outside =
            volume(&query(&[[200.0, 0.0], [210.0, 0.0], [210.0, 9.0]], BaseHeight::Mean, None));
        assert_eq!((outside.n_points, outside.cut, outside.fill), (0, 0.0, 0.0));
        assert!((outside.empty_fraction - 1.0).abs() < 1e-9);
    }

    #[test]
    fn small_cells_are_enlarged_to_the_limit() {
        let found = volume(&query(&SQUARE, BaseHeight::Lowest, Some(1e-9)));
        let least = (4000.0 / MAX_CELLS).sqrt();
        assert!((found.cell_size - least).abs() < 1e-9 && 0.9 < found.empty_fraction, "{found:?}");
    }

    #[test]
    fn corners_that_bound_nothing_are_rejected() {
        for corners in [
            &[[1.0, 1.0], [2.0, 2.0]][..],
            &[[1.0, 1.0], [2.0, 2.0], [4.0, 4.0]],
            &[[f64::NAN, 0.0], [1.0, 0.0], [1.0, 1.0]],
            &[[1e308, 0.0], [1.0, 0.0], [1.0, 1e308]],
        ] {
            let query = query(corners, BaseHeight::Lowest, None);
            assert!(cut_and_fill(&slope(), &query, &NoProgress).is_err(), "{corners:?}");
        }
    }
}
