//! Checks of files before they are read: that they are there, are of their kind, and fit into memory.

use super::memory::{MemoryEstimate, PIXEL, PIXEL_WITH_LAYERS, n_points};
use super::render_settings;
use super::sequence::is_streamed;
use crate::description::{Invalid, ObjectDescription, SceneDescription};
use crate::error::Result;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use surfel_core::render::Settings;
use surfel_formats::FileInfo;

/// Fails where a file is missing or not of its kind, and where all need more memory than they may take: before the
/// work.
///
/// # Errors
///
/// Fails for an empty scene, for materials of files that are not there, and as reading would.
pub fn check_files(description: &SceneDescription) -> Result<()> {
    description.check_is_not_empty()?;
    let objects = description.objects.iter();
    let files: BTreeSet<&Path> = objects
        .clone()
        .flat_map(|object| &object.files)
        .chain(&description.files)
        .map(PathBuf::as_path)
        .collect();
    check_materials(description)?;
    let inspected = files.into_iter().map(|file| match description.memory.get(file) {
        Some(content) => Ok((file, content.info())),
        None => Ok((file, surfel_formats::inspect(file)?)),
    });
    let mut infos = inspected.collect::<surfel_formats::Result<BTreeMap<&Path, FileInfo>>>()?;
    for object in objects.filter(|object| 1 < object.files.len()) {
        let settings = object.settings.over(&description.objects_default);
        if is_streamed(object, &settings)? {
            keep_largest_frame(&mut infos, object);
        }
    }
    let settings = &description.objects_default.preparation;
    let estimate =
        MemoryEstimate::from_files(&infos, settings.subsample, picture_bytes(description))
            .with_surfaces_of(description);
    let known = if settings.filters_points() { estimate.without_points() } else { estimate };
    known.check(description.run.memory_limit)
}

/// Leaves the largest file of a streamed sequence.
fn keep_largest_frame(infos: &mut BTreeMap<&Path, FileInfo>, object: &ObjectDescription) {
    let size = |file: &&PathBuf| {
        let info = infos.get(file.as_path())?;
        Some(info.n_triangles.unwrap_or_else(|| n_points(file, info)))
    };
    let largest = object.files.iter().max_by_key(size).cloned();
    let others = object.files.iter().filter(|file| Some(*file) != largest.as_ref());
    others.for_each(|file| _ = infos.remove(file.as_path()));
}

/// Fails if a material is for a file or an object that is not there.
fn check_materials(description: &SceneDescription) -> Result<(), Invalid> {
    let names = description.objects.iter().flat_map(ObjectDescription::names);
    let known: Vec<PathBuf> = description.files.iter().cloned().chain(names).collect();
    for choice in description.materials.choices() {
        let Some(target) = &choice.target else { continue };
        if !known.iter().any(|file| choice.names(file)) {
            return Err(description.unknown_target(target).within("material"));
        }
    }
    Ok(())
}

/// Returns the bytes of a description's picture.
pub fn picture_bytes(description: &SceneDescription) -> u64 {
    let Settings { width, height, with_aovs, .. } = render_settings(description);
    let pixel = if with_aovs { PIXEL_WITH_LAYERS } else { PIXEL };
    pixel * u64::from(width) * u64::from(height)
}
