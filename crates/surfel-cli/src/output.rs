//! Checks of output paths: a run fails before its work where the result could not be written after it.

use crate::usage::Usage;
use anyhow::bail;
use std::path::{Path, PathBuf};
use surfel::SceneDescription;

/// Fails where a picture could not be written.
pub fn check_picture(path: &Path) -> anyhow::Result<()> {
    surfel_formats::check_image_output(path).map_err(usage_error)?;
    check_is_file(path)
}

/// Fails where a cloud could not be written.
pub fn check_cloud(path: &Path) -> anyhow::Result<()> {
    surfel_formats::check_cloud_output(path).map_err(usage_error)?;
    check_is_file(path)
}

/// Takes an extension that cannot be written for an error of usage.
fn usage_error(error: surfel_formats::Error) -> anyhow::Error {
    match error {
        surfel_formats::Error::Unsupported { .. } => Usage(error.to_string()).into(),
        other => anyhow::Error::from(other),
    }
}

/// Fails where a height map could not be written, or would take the place of the picture.
pub fn check_height_map(path: &Path, picture: &Path) -> anyhow::Result<()> {
    surfel_formats::check_height_map(path)?;
    check_is_file(path)?;
    if is_same_file(path, picture) {
        let text = "picture and height map have the same name; name another file for one";
        return Err(Usage(text.into()).into());
    }
    Ok(())
}

/// Fails where the numbers of a run would take the place of the picture, or of what it is made from.
pub fn check_stats(
    stats: &Path,
    output: &Path,
    typed: &[PathBuf],
    description: &SceneDescription,
) -> anyhow::Result<()> {
    if stats == Path::new("-") {
        return Ok(());
    }
    check_is_file(stats)?;
    surfel_formats::check_output_path(stats)?;
    let objects = description.objects.iter().flat_map(|object| &object.files);
    let inputs = objects.chain(&description.files).chain(typed).map(PathBuf::as_path);
    match inputs.chain([output]).find(|path| is_same_file(path, stats)) {
        Some(path) => {
            let name = path.display();
            let text = format!("--stats {name}: would replace that file; name another");
            Err(Usage(text).into())
        }
        None => Ok(()),
    }
}

/// Returns true if two paths name one file. A file that does not exist yet is compared by its folder.
fn is_same_file(a: &Path, b: &Path) -> bool {
    let resolved = |path: &Path| {
        let parent = path.parent().filter(|parent| *parent != Path::new(""));
        let folder = parent.unwrap_or(Path::new(".")).canonicalize().ok()?;
        Some(path.canonicalize().unwrap_or(folder.join(path.file_name()?)))
    };
    a == b || resolved(a).is_some_and(|a| Some(a) == resolved(b))
}

fn check_is_file(path: &Path) -> anyhow::Result<()> {
    // A finished file is renamed to its name, and would replace a pipe or a device there.
    if path.metadata().is_ok_and(|found| !found.is_file()) {
        bail!("{}: is a device or a pipe; name a file", path.display());
    }
    Ok(())
}
