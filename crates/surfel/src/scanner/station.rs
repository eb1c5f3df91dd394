//! Where a scanner stands, and the beams that it sends from there.

use super::site::Beam;
use crate::math::DVec3;
use std::f64::consts::TAU;

/// One place that the scanner is set up at, and the window that it scans from there.
#[derive(Clone, Debug, PartialEq)]
pub struct Station {
    pub position: DVec3,
    /// Middle of the window, counter-clockwise from +X.
    pub azimuth_rad: f64,
    /// Width of the window; a full turn sees all around.
    pub azimuth_span_rad: f64,
    /// Lowest and highest beam above the horizon.
    pub elevation_rad: (f64, f64),
}

impl Station {
    /// All around and from 60 degrees below the horizon to the zenith: a tripod hides what is under it.
    pub fn full_dome(position: DVec3) -> Self {
        Self {
            position,
            azimuth_rad: 0.0,
            azimuth_span_rad: TAU,
            elevation_rad: ((-60f64).to_radians(), 90f64.to_radians()),
        }
    }

    /// A window centred on `target`.
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

    /// Number of azimuths at this angular step.
    pub fn n_columns(&self, step_rad: f64) -> usize {
        (self.azimuth_span_rad / step_rad).round() as usize
    }

    /// Number of elevations at this angular step.
    pub fn n_rows(&self, step_rad: f64) -> usize {
        let (lowest, highest) = self.elevation_rad;
        ((highest - lowest) / step_rad).round() as usize
    }

    pub fn beam(&self, column: usize, row: usize, step_rad: f64) -> Beam {
        let start = self.azimuth_rad - 0.5 * self.azimuth_span_rad;
        let azimuth = start + (column as f64 + 0.5) * step_rad;
        let elevation = self.elevation_rad.0 + (row as f64 + 0.5) * step_rad;
        let level = elevation.cos();
        let direction = DVec3::new(level * azimuth.cos(), level * azimuth.sin(), elevation.sin());
        Beam { origin: self.position, direction }
    }
}
