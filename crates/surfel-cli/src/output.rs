//! Checks of output paths: a run fails before its work where the result could not be written after it.

use crate::usage::Usage;
use std::path::{Path, PathBuf};

/// Name of standard output.
const STDOUT: &str = "-";

/// Fails where a picture could not be written.
pub fn check_picture(path: &Path) -> anyhow::Result<()> {
    surfel_formats::check_image_output(path).map_err(usage_error)
}

/// Fails if a picture has more pixels than its format holds.
pub fn check_picture_size(path: &Path, (width, height): (u32, u32)) -> anyhow::Result<()> {
    surfel_formats::check_image_size(path, width, height).map_err(usage_error)
}

/// Fails where a cloud could not be written.
pub fn check_cloud(path: &Path) -> anyhow::Result<()> {
    surfel_formats::check_cloud_output(path).map_err(usage_error)
}

/// Takes an extension, a size or a pipe that cannot be written for an error of usage.
fn usage_error(error: surfel_formats::Error) -> anyhow::Error {
    match error {
        surfel_formats::Error::Unsupported { .. } => Usage(error.to_string()).into(),
        other => anyhow::Error::from(other),
    }
}

/// Fails where a height map could not be written.
pub fn check_height_map(path: &Path) -> anyhow::Result<()> {
    surfel_formats::check_height_map(path).map_err(usage_error)
}

/// Fails where the numbers of a run could not be written.
pub fn check_stats(path: &Path) -> anyhow::Result<()> {
    if path == Path::new(STDOUT) {
        return Ok(());
    }
    Ok(surfel_formats::check_output_path(path)?)
}

/// Fails if an output would replace a file that is read, or another output. Each output has the option that names it.
pub fn check_replaces_nothing<'p>(
    outputs: &[(&str, &Path)],
    inputs: impl IntoIterator<Item = &'p PathBuf>,
) -> anyhow::Result<()> {
    let mut others: Vec<&Path> = inputs.into_iter().map(PathBuf::as_path).collect();
    for (option, output) in outputs.iter().filter(|(_, path)| *path != Path::new(STDOUT)) {
        if let Some(other) = others.iter().find(|other| is_same_file(other, output)) {
            let name = other.display();
            let text = format!("{option} {name}: would replace that file; name another output");
            return Err(Usage(text).into());
        }
        others.push(output);
    }
    Ok(())
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
