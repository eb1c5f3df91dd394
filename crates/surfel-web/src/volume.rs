//! Volumes for pages: between the points of the scene and a base plane.

use crate::corners;
use crate::scene_provider::{Error, PreparedScene, Result};
use serde_json::{Value, json};
use surfel_core::flat::{BaseHeight, VolumeQuery, cut_and_fill};
use surfel_core::progress::Progress;

/// Checks a request of a page. `base` is `lowest`, `mean` or a height.
///
/// # Errors
///
/// Fails for corners that bound no area, another base, and a cell without size.
pub fn parse(
    corners: &[[f64; 3]],
    up: [f64; 3],
    base: &Value,
    cell_size: Option<f64>,
) -> Result<VolumeQuery> {
    let (corners, up) = corners::parse("volume", 3, corners, up)?;
    let base = match (base.as_str(), base.as_f64()) {
        (Some("lowest"), _) => BaseHeight::Lowest,
        (Some("mean"), _) => BaseHeight::Mean,
        (_, Some(height)) if height.is_finite() => BaseHeight::At(height),
        _ => {
            return Err(Error::invalid_request(
                "volume: expected the base lowest, mean or a height",
            ));
        }
    };
    if cell_size.is_some_and(|size| !(0.0 < size && size.is_finite())) {
        return Err(Error::invalid_request("volume: expected a cell size above 0"));
    }
    Ok(VolumeQuery { corners, up, base, cell_size })
}

/// Returns the volume as a page gets it.
///
/// # Errors
///
/// Fails for corners on a line, and if `progress` is cancelled.
pub fn volume(
    scene: &PreparedScene,
    query: &VolumeQuery,
    progress: &dyn Progress,
) -> Result<Value> {
    let volume = cut_and_fill(&scene.flat, query, progress)?;
    Ok(json!({
        "cut": volume.cut,
        "fill": volume.fill,
        "base": volume.base,
        "cell_size": volume.cell_size,
        "area": volume.area,
        "empty_fraction": volume.empty_fraction,
        "n_points": volume.n_points,
    }))
}

#[cfg(test)]
mod tests {
    //! Requests for volumes from pages.

    use super::*;

    const UP: [f64; 3] = [0.0, 0.0, 2.0];
    const TRIANGLE: [[f64; 3]; 3] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn volumes_of_pages_are_checked() {
        for (base, expected) in [
            (json!("lowest"), BaseHeight::Lowest),
            (json!("mean"), BaseHeight::Mean),
            (json!(-3.5), BaseHeight::At(-3.5)),
        ] {
            assert_eq!(parse(&TRIANGLE, UP, &base, None).unwrap().base, expected);
        }
        assert!(parse(&TRIANGLE[..2], UP, &json!("mean"), None).is_err());
        assert!(parse(&TRIANGLE, [0.0; 3], &json!("mean"), None).is_err());
        assert!(parse(&[[f64::NAN; 3]; 3], UP, &json!("mean"), None).is_err());
        for (base, cell_size) in [(json!("top"), None), (json!([]), None), (json!(1), Some(0.0))] {
            assert!(parse(&TRIANGLE, UP, &base, cell_size).is_err(), "{base} {cell_size:?}");
        }
    }
}
