//! Scanner stations and their rays.

use crate::sdf::DRay;
use std::f64::consts::{PI, TAU};
use surfel_core::math::DVec3;

/// A position of the scanner and the window that it scans from there.
#[derive(Clone, Debug, PartialEq)]
pub struct Station {
    /// Position in the scene.
    pub position: DVec3,
    /// Azimuth of the window's middle in radians, counter-clockwise from +X.
    pub azimuth_rad: f64,
    /// Width of the window in radians; 2 pi scans all around.
    pub azimuth_span_rad: f64,
    /// Lowest and highest elevation in radians above the horizon.
    pub elevation_rad: (f64, f64),
}

impl Station {
    /// Creates a station that scans all around, from 60 degrees below the horizon, where the tripod is, to the zenith.
    pub fn full_dome(position: DVec3) -> Self {
        Self {
            position,
            azimuth_rad: 0.0,
            azimuth_span_rad: TAU,
            elevation_rad: ((-60f64).to_radians(), 90f64.to_radians()),
        }
    }

    /// Creates a station whose window is centred on the azimuth of `target`.
    pub fn toward(
        position: DVec3,
        target: DVec3,
        span_rad: f64,
        elevation_rad: (f64, f64),
    ) -> Self {
        let offset = target - position;
        let azimuth_rad = offset.y.atan2(offset.x);
        Self { position, azimuth_rad, azimuth_span_rad: span_rad, elevation_rad }
    }

    /// Returns the number of azimuths at this angular step.
    pub fn n_columns(&self, step_rad: f64) -> usize {
        (self.azimuth_span_rad / step_rad).round() as usize
    }

    /// Returns the number of elevations at this angular step.
    pub fn n_rows(&self, step_rad: f64) -> usize {
        let (lowest, highest) = self.elevation_rad;
        ((highest - lowest) / step_rad).round() as usize
    }

    /// Returns the ray of a column (azimuth) and row (elevation).
    pub fn ray(&self, column: usize, row: usize, step_rad: f64) -> DRay {
        let start = self.azimuth_rad - 0.5 * self.azimuth_span_rad;
        let azimuth = start + (column as f64 + 0.5) * step_rad;
        let elevation = self.elevation_rad.0 + (row as f64 + 0.5) * step_rad;
        let horizontal = elevation.cos();
        let direction =
            DVec3::new(horizontal * azimuth.cos(), horizontal * azimuth.sin(), elevation.sin());
        DRay { origin: self.position, direction }
    }

    /// Returns true if `point` lies in the direction of the window.
    pub fn covers(&self, point: DVec3) -> bool {
        let offset = point - self.position;
        let elevation = offset.z.atan2(offset.truncate().length());
        let turn = (offset.y.atan2(offset.x) - self.azimuth_rad + PI).rem_euclid(TAU) - PI;
        let (lowest, highest) = self.elevation_rad;
        (lowest..=highest).contains(&elevation) && turn.abs() <= 0.5 * self.azimuth_span_rad
    }
}

#[cfg(test)]
mod tests {
    //! The window of a station.

    use super::*;

    #[test]
    fn a_window_covers_the_ends_of_its_rays() {
        let station = Station::toward(
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(-5.0, 1.9, 0.0),
            1.0,
            (-0.5, 0.2),
        );
        let step_rad = 0.1;
        for column in 0..station.n_columns(step_rad) {
            for row in 0..station.n_rows(step_rad) {
                let ray = station.ray(column, row, step_rad);
                assert!(station.covers(ray.origin + 7.0 * ray.direction));
                assert!(!station.covers(ray.origin - 7.0 * ray.direction));
            }
        }
    }
}
