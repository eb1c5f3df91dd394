//! Height profiles for pages: the points of the scene beside a line.

use crate::corners;
use crate::scene_provider::{Error, PreparedScene, Result};
use serde_json::{Value, json};
use surfel_core::flat::{PointId, Profile, ProfileLine, ProfilePoint, height_profile};
use surfel_core::math::DVec3;
use surfel_core::progress::Progress;

/// Maximum number of points that a page gets.
const MAX_POINTS: usize = 20_000;

/// Checks a line from a page.
///
/// # Errors
///
/// Fails if it has fewer than two corners or too many, and if a number is not what it should be.
pub fn parse(corners: &[[f64; 3]], width: f64, up: [f64; 3]) -> Result<ProfileLine> {
    let (corners, up) = corners::parse("profile", 2, corners, up)?;
    if !(0.0 < width && width.is_finite()) {
        return Err(Error::invalid_request("profile: expected a width above 0"));
    }
    Ok(ProfileLine { corners, width, up })
}

/// Returns the points of a profile as a page gets them: a list for each of their properties.
///
/// # Errors
///
/// Fails if `progress` is cancelled.
pub fn profile(
    scene: &PreparedScene,
    line: &ProfileLine,
    progress: &dyn Progress,
) -> Result<Value> {
    let Profile { points, n_found } = height_profile(&scene.flat, line, MAX_POINTS, progress)?;
    let ids: Vec<PointId> = points.iter().map(|point| point.id).collect();
    let exact = (scene.locate)(&scene.flat, &ids);
    let positions: Vec<[f64; 3]> = points
        .iter()
        .zip(exact)
        .map(|(point, exact)| exact.unwrap_or(point.position.to_array()).map(rounded))
        .collect();
    let heights = positions.iter().map(|position| rounded(line.up.dot(DVec3::from(*position))));
    let numbers =
        |number: fn(&ProfilePoint) -> f64| points.iter().map(number).map(short).collect::<Vec<_>>();
    Ok(json!({
        "n_found": n_found,
        "distances": numbers(|point| point.distance),
        "offsets": numbers(|point| point.offset),
        "heights": heights.collect::<Vec<f64>>(),
        "positions": positions,
        "colors": points.iter().map(|point| point.color).collect::<Vec<_>>(),
    }))
}

/// Rounds to twelve digits: micrometres on a national grid, without the rounding errors of sums.
fn rounded(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// Rounds to nine digits, more than the f32 offsets of points hold.
fn short(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    //! Valid and invalid lines.

    use super::*;

    #[test]
    fn lines_are_checked() {
        let up = [0.0, 0.0, 2.0];
        let line = parse(&[[0.0; 3], [1.0; 3]], 0.5, up).unwrap();
        assert_eq!((line.corners.len(), line.width, line.up), (2, 0.5, DVec3::Z));
        for corners in [vec![], vec![[0.0; 3]], vec![[0.0; 3]; 101], vec![[f64::NAN; 3], [0.0; 3]]]
        {
            assert!(parse(&corners, 1.0, up).is_err(), "{}", corners.len());
        }
        for width in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(parse(&[[0.0; 3], [1.0; 3]], width, up).is_err(), "{width}");
        }
        assert!(parse(&[[0.0; 3], [1.0; 3]], 1.0, [0.0; 3]).is_err());
    }
}
