//! Directions of the rays of a scan's grid, with those that measured nothing.
//!
//! Most scanners turn by equal steps: one index of the grid is an azimuth, the other an elevation.

use super::scan_grid::ScanGrid;
use crate::math::{DVec3, Vec3, median};
use std::f64::consts::{PI, TAU};

/// Number of rays with points that the steps are found from.
const N_SAMPLES: usize = 20_000;
/// Minimum number of pairs of neighbouring rays.
const MIN_PAIRS: usize = 32;
/// Maximum elevation of these rays in radians: near the zenith, azimuths are inexact.
const MAX_ELEVATION: f64 = 1.3;
/// Maximum median distance of points from their rays, in steps.
const MAX_RESIDUAL: f64 = 0.25;

/// The equally spaced rays of a grid, in the scanner's axes.
pub struct GridRays {
    /// True if columns are azimuths and rows elevations.
    has_azimuth_columns: bool,
    azimuth: Steps,
    elevation: Steps,
    /// Cosine and sine of each azimuth and of each elevation.
    azimuths: Vec<[f64; 2]>,
    elevations: Vec<[f64; 2]>,
}

/// Equal steps of an angle in radians.
#[derive(Clone, Copy, Default)]
struct Steps {
    start: f64,
    step: f64,
}

/// A ray with a point.
struct Sample {
    cell: [usize; 2],
    azimuth: f64,
    elevation: f64,
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
        let azimuth = samples.iter().map(|s| (s.cell[azimuth_axis] as f64, s.azimuth));
        let elevation = samples.iter().map(|s| (s.cell[1 - azimuth_axis] as f64, s.elevation));
        let azimuth = Steps::fit(&azimuth.collect::<Vec<_>>(), steps[0])?;
        let elevation = Steps::fit(&elevation.collect::<Vec<_>>(), steps[1])?;
        let size = [grid.n_rows, grid.n_columns];
        Some(Self {
            has_azimuth_columns,
            azimuth,
            elevation,
            azimuths: azimuth.table(size[azimuth_axis]),
            elevations: elevation.table(size[1 - azimuth_axis]),
        })
    }

    /// Returns the unit direction of a ray of the grid.
    pub fn direction(&self, row: usize, column: usize) -> DVec3 {
        let (azimuth, elevation) =
            if self.has_azimuth_columns { (column, row) } else { (row, column) };
        let ([cos, sin], [level, up]) = (self.azimuths[azimuth], self.elevations[elevation]);
        DVec3::new(level * cos, level * sin, up)
    }

    /// Returns the row and column, as fractions, of the ray through a position in the scanner's axes.
    pub fn cell(&self, measured: DVec3) -> [f64; 2] {
        let (azimuth, elevation) = angles(measured);
        let n_of_turn = TAU / self.azimuth.step.abs();
        let azimuth = (azimuth - self.azimuth.start) / self.azimuth.step;
        let azimuth = (azimuth + 0.5).rem_euclid(n_of_turn) - 0.5;
        let elevation = (elevation - self.elevation.start) / self.elevation.step;
        if self.has_azimuth_columns { [elevation, azimuth] } else { [azimuth, elevation] }
    }

    /// Returns the angle between neighbouring rows and columns in radians, at a unit distance from the zenith axis.
    pub fn steps_rad(&self) -> [f64; 2] {
        let [azimuth, elevation] = [self.azimuth, self.elevation].map(|steps| steps.step.abs());
        if self.has_azimuth_columns { [elevation, azimuth] } else { [azimuth, elevation] }
    }
}

impl Steps {
    /// Fits equal steps of about `step` to pairs of an index and an angle; `None` if they are not equal.
    fn fit(pairs: &[(f64, f64)], step: f64) -> Option<Self> {
        if !(1e-6 < step.abs() && step.abs() < 0.5) {
            return None;
        }
        let count = pairs.len() as f64;
        let directions = pairs.iter().map(|(index, angle)| (angle - index * step).sin_cos());
        let (sin, cos) = directions.fold((0.0, 0.0), |(x, y), (sin, cos)| (x + sin, y + cos));
        let mut steps = Self { start: sin.atan2(cos), step };
        let mean = pairs.iter().map(|pair| pair.0).sum::<f64>() / count;
        for _ in 0..2 {
            let (mut sum, mut product, mut square) = (0.0, 0.0, 0.0);
            for (index, angle) in pairs {
                let residual = steps.residual(*index, *angle);
                sum += residual;
                product += (index - mean) * residual;
                square += (index - mean) * (index - mean);
            }
            let slope = if 0.0 < square { product / square } else { 0.0 };
            steps.start += sum / count - slope * mean;
            steps.step += slope;
        }
        let residuals = pairs.iter().map(|(index, angle)| steps.residual(*index, *angle).abs());
        (median(residuals)? < MAX_RESIDUAL * steps.step.abs()).then_some(steps)
    }

    fn residual(&self, index: f64, angle: f64) -> f64 {
        wrapped(angle - self.start - index * self.step)
    }

    fn table(&self, count: usize) -> Vec<[f64; 2]> {
        let angle = |index: usize| {
            let (sin, cos) = (self.start + index as f64 * self.step).sin_cos();
            [cos, sin]
        };
        (0..count).map(angle).collect()
    }
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
    use crate::points::scan::scan_grid::ScanGrids;
    use crate::points::scan::scan_grid::tests::scan;
    use crate::points::{PointCloud, Values};

    fn rays(cloud: &PointCloud) -> Option<(ScanGrid, GridRays)> {
        let grid = ScanGrids::new(cloud)?.scans.pop()??;
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
