//! The interface of all instruments.

use crate::error::Error;
use crate::error::Result;
use crate::math::DVec3;
use crate::points::PointCloud;
use crate::progress::Progress;
use crate::scanner::sdf::SdfScene;

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
