//! Checks of files before they are read: that they are there, are of their kind, and fit into memory.

use super::memory::{MemoryEstimate, PIXEL, PIXEL_WITH_LAYERS, n_points};
use super::render_settings;
use super::sequence::is_streamed;
use crate::description::{Invalid, ObjectDescription, SceneDescription, twins};
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
    let infos = inspected.collect::<surfel_formats::Result<BTreeMap<&Path, FileInfo>>>()?;
    let mut held: Vec<&PathBuf> = description.files.iter().collect();
    for (object, twin) in objects.zip(twins(&description.objects)) {
        let settings = object.settings.over(&description.objects_default);
        if twin.is_some() {
            continue;
        }
        if is_streamed(object, &settings, &description.memory)? {
            held.extend(largest_frame(&infos, object));
        } else {
            held.extend(&object.files);
        }
    }
    let held = held.into_iter().map(|file| (file.as_path(), &infos[file.as_path()]));
    let settings = &description.objects_default.preparation;
    let estimate = MemoryEstimate::from_files(held, settings.subsample, picture_bytes(description))
        .with_surfaces_of(description);
    let known = if settings.filters_points() { estimate.without_points() } else { estimate };
    known.check(description.run.memory_limit)
}

/// Returns the largest file of a streamed sequence.
fn largest_frame<'o>(
    infos: &BTreeMap<&Path, FileInfo>,
    object: &'o ObjectDescription,
) -> Option<&'o PathBuf> {
    let size = |file: &&PathBuf| {
        let info = &infos[file.as_path()];
        info.n_triangles.unwrap_or_else(|| n_points(file, info))
    };
    object.files.iter().max_by_key(size)
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
