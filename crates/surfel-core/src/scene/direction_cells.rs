//! Points as a scanner would have measured them, by cells of directions: they tell whether one stood there.

use super::ground::ground_axes;
use crate::math::{Vec3, median, quantile};
use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};

/// Width and height of the cells of directions: many rays of a scanner, and about one distance.
const CELL_DEG: f32 = 5.0;
/// Minimum number of points in a cell that counts: the logarithm of fewer is mostly noise.
const MIN_CELL_POINTS: usize = 4;
/// Width and height of the cells in which a ray sees but one surface.
const NARROW_CELL_DEG: f32 = 1.5;
/// Ratio of the distance of a point to that of the nearest ones of its narrow cell from which it lies behind them.
const BEHIND_RATIO: f32 = 1.3;

/// A point as the scanner measured it.
pub struct PolarPoint {
    /// Distance from the scanner.
    pub distance: f32,
    /// Clockwise from north seen from above, from 0 to 2 pi.
    pub azimuth_rad: f32,
    /// Above the horizontal plane, from -pi/2 to pi/2.
    pub elevation_rad: f32,
}

impl PolarPoint {
    /// Returns the point at `offset` from the scanner, or `None` for the scanner's own place.
    pub fn of_offset(offset: Vec3, east: Vec3, north: Vec3, up: Vec3) -> Option<Self> {
        let distance = offset.length();
        let azimuth_rad = offset.dot(east).atan2(offset.dot(north)).rem_euclid(TAU);
        let elevation_rad = (offset.dot(up) / distance).clamp(-1.0, 1.0).asin();
        (0.0 < distance).then_some(Self { distance, azimuth_rad, elevation_rad })
    }

    /// Returns row and column of the cell of directions of this width and height.
    pub fn cell(&self, cell_deg: f32) -> (u32, u32) {
        let cell_rad = cell_deg.to_radians();
        let row = (self.elevation_rad + PI / 2.0) / cell_rad;
        (row as u32, (self.azimuth_rad / cell_rad) as u32)
    }
}

/// Returns the points as measured from `station`, without missing measurements, which lie at the station itself.
pub fn polar_points(station: Vec3, points: &[Vec3], up: Vec3) -> Vec<PolarPoint> {
    let (east, north) = ground_axes(up);
    let polar = |point: &Vec3| PolarPoint::of_offset(*point - station, east, north, up);
    points.iter().filter_map(polar).collect()
}

/// Returns the distances of the points by cells of directions of this width and height.
pub fn cells(points: &[PolarPoint], cell_deg: f32) -> BTreeMap<(u32, u32), Vec<f32>> {
    let mut cells: BTreeMap<(u32, u32), Vec<f32>> = BTreeMap::new();
    for point in points {
        cells.entry(point.cell(cell_deg)).or_default().push(point.distance);
    }
    cells
}

/// Returns the variance of the logarithms of distances within cells of directions, as a fraction of that of all: 1 for
/// points that fill space.
pub fn spread_within_cells(points: &[PolarPoint]) -> f64 {
    let sum_of_squares = |distances: &[f32]| {
        let logarithms = distances.iter().map(|distance| f64::from(*distance).ln());
        let mean = logarithms.clone().sum::<f64>() / distances.len() as f64;
        logarithms.map(|logarithm| (logarithm - mean).powi(2)).sum::<f64>()
    };
    let all: Vec<f32> = points.iter().map(|point| point.distance).collect();
    let within: f64 = cells(points, CELL_DEG).values().map(|cell| sum_of_squares(cell)).sum();
    within / sum_of_squares(&all).max(f64::MIN_POSITIVE)
}

/// Returns the fraction of the points that lie behind others of their narrow cell.
pub fn fraction_behind(points: &[PolarPoint]) -> f64 {
    let (mut n_behind, mut n_counted) = (0, 0);
    for distances in cells(points, NARROW_CELL_DEG).into_values() {
        // A stray point may lie before all others.
        let nearest = quantile(distances.iter().copied(), 0.1);
        if let Some(nearest) = nearest.filter(|_| MIN_CELL_POINTS <= distances.len()) {
            let limit = BEHIND_RATIO * nearest;
            n_behind += distances.iter().filter(|distance| limit < **distance).count();
            n_counted += distances.len();
        }
    }
    f64::from(n_behind as u32) / f64::from((n_counted as u32).max(1))
}

/// Returns the slope of the line of least squares through ln(points) over ln(median distance squared) of the cells of
/// directions, or `None` if all cells are equally far.
pub fn density_slope(points: &[PolarPoint]) -> Option<f64> {
    let full = cells(points, CELL_DEG)
        .into_values()
        .filter(|distances| MIN_CELL_POINTS <= distances.len());
    let logarithms = full.filter_map(|distances| {
        let n_points = distances.len() as f64;
        Some((2.0 * f64::from(median(distances)?).ln(), n_points.ln()))
    });
    let logarithms: Vec<(f64, f64)> = logarithms.collect();
    let n = logarithms.len() as f64;
    let (sum_x, sum_y) = logarithms.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0, y + p.1));
    let (mean_x, mean_y) = (sum_x / n, sum_y / n);
    let (variance, covariance) = logarithms.iter().fold((0.0, 0.0), |(xx, xy), (x, y)| {
        (xx + (x - mean_x) * (x - mean_x), xy + (x - mean_x) * (y - mean_y))
    });
    (0.0 < variance).then(|| covariance / variance)
}
