//! The environment map that the description names.

use crate::description::SceneDescription;
use crate::error::{Error, Result};
use surfel_core::math::Vec3;
use surfel_core::progress::Progress;
use surfel_core::scene::Environment;
use surfel_core::words::counted;
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
        let pixels = counted(environment.n_repaired(), "pixel");
        let what = "with a negative, infinite or NaN value";
        progress.note(&format!("{}: repaired {pixels} {what}", file.display()));
    }
    Ok(Some(environment))
}
