//! The interface of all instruments.

use crate::sdf::SdfScene;
use surfel_core::Error;
use surfel_core::Result;
use surfel_core::math::DVec3;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;

/// An instrument with the positions that it measures from.
pub trait Instrument: Sync {
    /// Measures `scene`.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Setting`] for a property out of range and [`Error::Cancelled`] if `progress` is cancelled.
    fn scan(&self, scene: &SdfScene, progress: &dyn Progress) -> Result<PointCloud>;

    /// Returns positions from which the instrument sends pulses toward `point`, whether or not something is in the way.
    fn viewpoints(&self, point: DVec3) -> Vec<DVec3>;
}

/// Checks a property that must be a positive finite number.
pub fn check_positive(name: &'static str, found: f64) -> Result<()> {
    if 0.0 < found && found.is_finite() {
        return Ok(());
    }
    Err(Error::Setting { name, found: found.to_string(), expected: "a positive number" })
}
