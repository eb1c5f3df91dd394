//! Corners of lines and polygons in messages of pages.

use crate::scene_provider::{Error, Result};
use surfel_core::math::DVec3;
use surfel_core::words::counted;

/// Maximum number of corners.
const MAX_CORNERS: usize = 100;

/// Checks the corners of the figure `name` and the up axis; returns them with a unit axis.
///
/// # Errors
///
/// Fails if there are fewer corners than `min` or too many, and if a number is not finite.
pub fn parse(
    name: &str,
    min: usize,
    corners: &[[f64; 3]],
    up: [f64; 3],
) -> Result<(Vec<DVec3>, DVec3)> {
    if !(min..=MAX_CORNERS).contains(&corners.len()) {
        let found = corners.len();
        let text =
            format!("{name}: found {}, expected {min} to {MAX_CORNERS}", counted(found, "corner"));
        return Err(Error::invalid_request(text));
    }
    let corners: Vec<DVec3> = corners.iter().copied().map(DVec3::from_array).collect();
    let up = DVec3::from_array(up).try_normalize();
    let up = up.filter(|_| corners.iter().all(|corner| corner.is_finite()));
    let up =
        up.ok_or_else(|| Error::invalid_request(format!("{name}: expected finite numbers")))?;
    Ok((corners, up))
}
