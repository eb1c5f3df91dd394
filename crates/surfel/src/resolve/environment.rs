//! The environment map that the description names.

use crate::description::SceneDescription;
use crate::error::{Error, Result};
use surfel_core::math::Vec3;
use surfel_core::progress::Progress;
use surfel_core::scene::Environment;
use surfel_formats::HdrImage;

/// Reads the environment map, upright as in its file.
pub fn load_environment(
    description: &SceneDescription,
    progress: &dyn Progress,
) -> Result<Option<Environment>> {
    let Some(file) = &description.light.environment else { return Ok(None) };
    let image = surfel_formats::load_environment_map(file, progress)?;
    progress.end();
    let HdrImage { width, height, pixels } = image;
    let environment = Environment::new(width, height, pixels, Vec3::Z, 0.0)
        .map_err(|cause| Error::Content { files: vec![file.clone()], cause })?;
    if 0 < environment.n_repaired() {
        let what = "pixels repaired that are no light (negative, infinite, NaN)";
        progress.note(&format!("{}: {} {what}", file.display(), environment.n_repaired()));
    }
    Ok(Some(environment))
}
