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

/// Checks the number of places that an instrument measures from, which points tell by 16 bits, and that of its rays.
pub fn check_size(n_places: usize, n_rays: f64) -> Result<()> {
    const MAX_PLACES: usize = u16::MAX as usize - 1;
    const MAX_RAYS: f64 = 4_294_967_296.0;
    if MAX_PLACES < n_places {
        let (found, expected) = (n_places.to_string(), "at most 65534");
        return Err(Error::Setting { name: "number of places", found, expected });
    }
    if MAX_RAYS < n_rays || n_rays.is_nan() {
        let (found, expected) = (n_rays.to_string(), "at most 4294967296, by longer steps");
        return Err(Error::Setting { name: "number of rays", found, expected });
    }
    Ok(())
}

/// Checks a property that must be a positive finite number.
pub fn check_positive(name: &'static str, found: f64) -> Result<()> {
    if 0.0 < found && found.is_finite() {
        return Ok(());
    }
    Err(Error::Setting { name, found: found.to_string(), expected: "a positive number" })
}
