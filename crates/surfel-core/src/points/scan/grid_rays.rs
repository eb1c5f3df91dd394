//! Directions of the rays of a scan's grid, with those that measured nothing.
//!
//! Most scanners turn by equal steps: one index of the grid is an azimuth, the other an elevation. Where the scanner turns
//! on during each sweep, both angles depend on both indices.

use super::scan_grid::{ScanGrid, ScanGrids};
use crate::math::{DVec3, Vec3, median};
use crate::points::{PointCloud, ScanStation};
use crate::progress::NoProgress;
use std::f64::consts::{PI, TAU};

/// Number of rays with points that the steps are found from.
const N_SAMPLES: usize = 20_000;
/// Minimum number of pairs of neighbouring rays.
const MIN_PAIRS: usize = 32;
/// Maximum elevation of these rays in radians: near the zenith, azimuths are inexact.
const MAX_ELEVATION: f64 = 1.3;
/// Maximum median distance of points from their rays, in steps.
const MAX_RESIDUAL: f64 = 0.25;
/// Minimum median distance without a drift, in steps, at which a drift is looked for.
const MIN_DRIFT_RESIDUAL: f64 = 0.05;

/// The equally spaced rays of a grid, in the scanner's axes.
pub struct GridRays {
    /// True if columns are azimuths and rows elevations.
    has_azimuth_columns: bool,
    azimuth: Steps,
    elevation: Steps,
    /// Cosine and sine of the azimuth and of the elevation by their own and by the other index.
    azimuths: [Vec<[f64; 2]>; 2],
    elevations: [Vec<[f64; 2]>; 2],
}

/// Equal steps of an angle in radians.
#[derive(Clone, Copy, Default)]
struct Steps {
    start: f64,
    /// Change from one index to the next.
    step: f64,
    /// Change from one to the next of the other index.
    drift: f64,
}

/// An angle with its own index and the other one.
#[derive(Clone, Copy)]
struct AngleOfCell {
    index: f64,
    other: f64,
    angle: f64,
}

/// A ray with a point.
struct Sample {
    cell: [usize; 2],
    azimuth: f64,
    elevation: f64,
}

/// Sets the positions of stations that are not stated to the zero of the world coordinates if the rays of their grids have
/// equal steps as seen from there. Returns the number of the stations found.
pub fn locate_stations(cloud: &mut PointCloud) -> usize {
    let is_unknown = |station: &ScanStation| station.position.is_none();
    let unknown: Vec<usize> =
        (0..cloud.stations.len()).filter(|scan| is_unknown(&cloud.stations[*scan])).collect();
    for &scan in &unknown {
        cloud.stations[scan].position = Some(DVec3::ZERO);
    }
    let grids = match unknown.is_empty() {
        true => None,
        // Nothing cancels it.
        false => ScanGrids::new(cloud, &NoProgress).unwrap_or_default(),
    };
    let has_rays = |scan: usize| {
        let grid = grids.as_ref().and_then(|grids| grids.scans[scan].as_ref());
        grid.is_some_and(|grid| GridRays::new(grid, &cloud.positions).is_some())
    };
    let wrong: Vec<usize> = unknown.iter().copied().filter(|scan| !has_rays(*scan)).collect();
    for &scan in &wrong {
        cloud.stations[scan].position = None;
    }
    unknown.len() - wrong.len()
}

impl GridRays {
    /// Finds the directions of a grid's rays from its points at `positions`; `None` if they are not equally spaced.
    pub fn new(grid: &ScanGrid, positions: &[Vec3]) -> Option<Self> {
        let n_points = grid.cells().count();
        let sampled = grid.cells().step_by(n_points / N_SAMPLES + 1);
        let sample = |(cell, point): ([usize; 2], usize)| {
            let (azimuth, elevation) = angles(grid.measured(positions[point]));
            (elevation.abs() < MAX_ELEVATION).then_some(Sample { cell, azimuth, elevation })
        };
        let samples: Vec<Sample> = sampled.filter_map(sample).collect();
        let turn_to = |sample: &Sample, [rows, columns]: [isize; 2]| {
            let [row, column] = sample.cell.map(|index| index as isize);
            let point = grid.point(row + rows, column + columns)?;
            let (azimuth, elevation) = angles(grid.measured(positions[point]));
            Some((wrapped(azimuth - sample.azimuth), elevation - sample.elevation))
        };
        let median_turn = |offset: [isize; 2]| {
            let turns = samples.iter().filter_map(|sample| turn_to(sample, offset));
            let (azimuths, elevations): (Vec<f64>, Vec<f64>) = turns.unzip();
            let is_enough = MIN_PAIRS <= azimuths.len();
            is_enough.then_some((median(azimuths)?, median(elevations)?))
        };
        let (along_rows, along_columns) = (median_turn([1, 0])?, median_turn([0, 1])?);
        let has_azimuth_columns = along_columns.1.abs() < along_columns.0.abs();
        let (azimuth_axis, steps) = match has_azimuth_columns {
            true => (1, [along_columns.0, along_rows.1]),
            false => (0, [along_rows.0, along_columns.1]),
        };
        let of_cells = |axis: usize, angle: fn(&Sample) -> f64| {
            let of_cell = |sample: &Sample| AngleOfCell {
                index: sample.cell[axis] as f64,
                other: sample.cell[1 - axis] as f64,
                angle: angle(sample),
            };
            samples.iter().map(of_cell).collect::<Vec<_>>()
        };
        let azimuth = Steps::fit(&of_cells(azimuth_axis, |sample| sample.azimuth), steps[0])?;
        let elevation =
            Steps::fit(&of_cells(1 - azimuth_axis, |sample| sample.elevation), steps[1])?;
        let size = [grid.n_rows, grid.n_columns];
        let (n_azimuths, n_elevations) = (size[azimuth_axis], size[1 - azimuth_axis]);
        Some(Self {
            has_azimuth_columns,
            azimuth,
            elevation,
            azimuths: azimuth.tables(n_azimuths, n_elevations),
            elevations: elevation.tables(n_elevations, n_azimuths),
        })
    }

    /// Returns the unit direction of a ray of the grid.
    pub fn direction(&self, row: usize, column: usize) -> DVec3 {
        let (azimuth, elevation) =
            if self.has_azimuth_columns { (column, row) } else { (row, column) };
        let [cos, sin] = sum_of_angles(&self.azimuths, azimuth, elevation);
        let [level, up] = sum_of_angles(&self.elevations, elevation, azimuth);
        DVec3::new(level * cos, level * sin, up)
    }

    /// Returns the row and column, as fractions, of the ray through a position in the scanner's axes.
    pub fn cell(&self, measured: DVec3) -> [f64; 2] {
        let angles = angles(measured);
        let n_of_turn = TAU / self.azimuth.step.abs();
        let (mut azimuth, mut elevation) = (0.0, 0.0);
        // Once more with the drift, which is far less than a step.
        for _ in 0..2 {
            elevation = self.elevation.index(angles.1, azimuth);
            azimuth = self.azimuth.index(angles.0, elevation);
            azimuth = (azimuth + 0.5).rem_euclid(n_of_turn) - 0.5;
        }
        if self.has_azimuth_columns { [elevation, azimuth] } else { [azimuth, elevation] }
    }

    /// Returns the angle between neighbouring rows and columns in radians, at a unit distance from the zenith axis.
    pub fn steps_rad(&self) -> [f64; 2] {
        let [azimuth, elevation] = [self.azimuth, self.elevation].map(|steps| steps.step.abs());
        if self.has_azimuth_columns { [elevation, azimuth] } else { [azimuth, elevation] }
    }
}

impl Steps {
    /// Fits equal steps of about `step`, if need be with a drift; `None` if they are not equal.
    fn fit(angles: &[AngleOfCell], step: f64) -> Option<Self> {
        if !(1e-6 < step.abs() && step.abs() < 0.5) {
            return None;
        }
        let directions = angles.iter().map(|cell| (cell.angle - cell.index * step).sin_cos());
        let (sin, cos) = directions.fold((0.0, 0.0), |(x, y), (sin, cos)| (x + sin, y + cos));
        let steps = Self { start: sin.atan2(cos), step, drift: 0.0 };
        let fit = |has_drift| {
            let steps = steps.refined(angles, has_drift).refined(angles, has_drift);
            let residuals = angles.iter().map(|cell| steps.residual(cell).abs());
            Some((median(residuals)? / steps.step.abs(), steps))
        };
        let (mut residual, mut steps) = fit(false)?;
        if MIN_DRIFT_RESIDUAL < residual
            && let Some((with_drift, drifting)) = fit(true)
            && with_drift < 0.5 * residual
        {
            (residual, steps) = (with_drift, drifting);
        }
        (residual < MAX_RESIDUAL).then_some(steps)
    }

    /// Returns the steps of least squares, with or without a drift.
    fn refined(&self, angles: &[AngleOfCell], has_drift: bool) -> Self {
        let count = angles.len() as f64;
        let mean = |value: fn(&AngleOfCell) -> f64| angles.iter().map(value).sum::<f64>() / count;
        let (index, other) = (mean(|cell| cell.index), mean(|cell| cell.other));
        let (mut sum, mut products, mut squares) = (0.0, [0.0; 2], [0.0; 3]);
        for cell in angles {
            let (residual, a, b) = (self.residual(cell), cell.index - index, cell.other - other);
            sum += residual;
            products[0] += a * residual;
            products[1] += b * residual;
            squares[0] += a * a;
            squares[1] += a * b;
            squares[2] += b * b;
        }
        let determinant = squares[0] * squares[2] - squares[1] * squares[1];
        let slopes = if has_drift && 1e-6 * squares[0] * squares[2] < determinant {
            [
                (squares[2] * products[0] - squares[1] * products[1]) / determinant,
                (squares[0] * products[1] - squares[1] * products[0]) / determinant,
            ]
        } else if 0.0 < squares[0] {
            [products[0] / squares[0], 0.0]
        } else {
            [0.0; 2]
        };
        Self {
            start: self.start + sum / count - slopes[0] * index - slopes[1] * other,
            step: self.step + slopes[0],
            drift: self.drift + slopes[1],
        }
    }

    fn residual(&self, cell: &AngleOfCell) -> f64 {
        wrapped(cell.angle - self.start - cell.index * self.step - cell.other * self.drift)
    }

    /// Returns the index, as a fraction, of an angle beside one of the other index.
    fn index(&self, angle: f64, other: f64) -> f64 {
        (angle - self.start - other * self.drift) / self.step
    }

    /// Returns cosine and sine of the angle of each index, and of its change by each of the other index.
    fn tables(&self, n_indices: usize, n_others: usize) -> [Vec<[f64; 2]>; 2] {
        let cos_sin = |angle: f64| [angle.cos(), angle.sin()];
        let own = (0..n_indices).map(|index| cos_sin(self.start + index as f64 * self.step));
        let by_other = (0..n_others).map(|other| cos_sin(other as f64 * self.drift));
        [own.collect(), by_other.collect()]
    }
}

/// Returns cosine and sine of an angle that depends on two indices.
fn sum_of_angles([own, by_other]: &[Vec<[f64; 2]>; 2], index: usize, other: usize) -> [f64; 2] {
    let ([cos_a, sin_a], [cos_b, sin_b]) = (own[index], by_other[other]);
    [cos_a * cos_b - sin_a * sin_b, sin_a * cos_b + cos_a * sin_b]
}

/// Returns azimuth and elevation of a position in the scanner's axes.
fn angles(measured: DVec3) -> (f64, f64) {
    let level = measured.truncate().length();
    (measured.y.atan2(measured.x), measured.z.atan2(level))
}

/// Returns an angle between -pi and pi.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    //! Rays of grids whose steps are known, and of grids that have none.

    use super::*;
    use crate::math::DQuat;
    use crate::points::Values;
    use crate::points::scan::scan_grid::tests::scan;

    fn rays(cloud: &PointCloud) -> Option<(ScanGrid, GridRays)> {
        let grid = ScanGrids::new(cloud, &NoProgress).unwrap()?.scans.pop()??;
        let rays = GridRays::new(&grid, &cloud.positions)?;
        Some((grid, rays))
    }

    #[test]
    fn rays_without_points_have_directions() {
        let is_open = |row: usize, column: usize| row < 20 && (10..40).contains(&column);
        let mut cloud = scan(60, 80, |row, column| {
            (!is_open(row, column)).then_some(3.0 + (column % 7) as f32)
        });
        for swapped in [false, true] {
            let turn = DQuat::from_rotation_x(0.1);
            let mut turned = cloud.clone();
            turned.stations[0].rotation = turn;
            turned.positions.iter_mut().for_each(|p| *p = (turn * p.as_dvec3()).as_vec3());
            let (grid, rays) = rays(&turned).unwrap();
            for ([row, column], point) in grid.cells() {
                let direction = grid.measured(turned.positions[point]).normalize();
                assert!(direction.distance(rays.direction(row, column)) < 1e-4);
                let cell = rays.cell(direction);
                assert!((cell[0] - row as f64).abs() < 0.01, "{swapped} {cell:?}");
                assert!((cell[1] - column as f64).abs() < 0.01, "{swapped} {cell:?}");
            }
            let (row, column) = if swapped { (25, 5) } else { (5, 25) };
            let (azimuth, elevation) = (0.01f64 * (25.0 - 40.0), 0.01f64 * (5.0 - 30.0));
            let expected = DVec3::new(
                elevation.cos() * azimuth.cos(),
                elevation.cos() * azimuth.sin(),
                elevation.sin(),
            );
            assert!(rays.direction(row, column).distance(expected) < 1e-4);
            let rows = cloud.scalars[0].values.clone();
            cloud.scalars[0].values = std::mem::replace(&mut cloud.scalars[1].values, rows);
        }
    }

    #[test]
    fn a_station_that_is_not_stated_is_at_the_zero_if_rays_have_equal_steps_from_there() {
        let range = |row: usize, column: usize| Some(2.0 + ((row * column) % 5) as f32);
        let mut cloud = scan(40, 40, range);
        cloud.stations[0].position = None;
        assert!(ScanGrids::new(&cloud, &NoProgress).unwrap().is_none());
        assert_eq!(locate_stations(&mut cloud), 1);
        assert_eq!(cloud.stations[0].position, Some(DVec3::ZERO));
        let elsewhere = DVec3::new(0.5, -0.5, 0.2);
        cloud.positions.iter_mut().for_each(|position| *position += elsewhere.as_vec3());
        cloud.stations[0].position = None;
        assert_eq!(locate_stations(&mut cloud), 0);
        assert_eq!(cloud.stations[0].position, None);
        cloud.stations[0].position = Some(elsewhere);
        assert_eq!(locate_stations(&mut cloud), 0);
        assert_eq!(cloud.stations[0].position, Some(elsewhere));
    }

    #[test]
    fn a_scanner_may_turn_on_during_a_sweep() {
        let mut cloud = scan(300, 80, |_, _| Some(3.0));
        let indices = [0, 1].map(|axis| cloud.scalars[axis].values.clone());
        let direction = |row: f64, column: f64| {
            let azimuth = 0.01 * (column - 1.5 * row / 300.0);
            let elevation = 0.004 * (row - 150.0) + 0.00002 * column;
            let (level, up) = (elevation.cos(), elevation.sin());
            DVec3::new(level * azimuth.cos(), level * azimuth.sin(), up)
        };
        for (point, position) in cloud.positions.iter_mut().enumerate() {
            *position = (3.0 * direction(indices[0].get(point), indices[1].get(point))).as_vec3();
        }
        let (grid, rays) = rays(&cloud).unwrap();
        for ([row, column], _) in grid.cells() {
            let expected = direction(row as f64, column as f64);
            assert!(rays.direction(row, column).distance(expected) < 1e-5);
            let cell = rays.cell(expected);
            assert!((cell[0] - row as f64).abs() < 0.01, "{row} {column}: {cell:?}");
            assert!((cell[1] - column as f64).abs() < 0.01, "{row} {column}: {cell:?}");
        }
    }

    #[test]
    fn grids_without_equal_steps_have_no_rays() {
        let mut cloud = scan(40, 40, |_, _| Some(3.0));
        assert!(rays(&cloud).is_some());
        let Values::I32(rows) = &mut cloud.scalars[0].values else { unreachable!() };
        rows.iter_mut().enumerate().for_each(|(i, row)| *row = (*row * 7919 + i as i32 * 31) % 40);
        assert!(rays(&cloud).is_none());
        assert!(rays(&scan(1, 1, |_, _| Some(3.0))).is_none());
        assert!(rays(&scan(1, 400, |_, _| Some(3.0))).is_none());
        assert!(rays(&scan(40, 40, |_, _| Some(0.0))).is_none());
    }
}
