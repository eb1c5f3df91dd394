//! The arguments that say what is seen: files, scene files, and the options of their picture.

use crate::global::Global;
use crate::inputs::expand;
use crate::options::{KeyOptions, Scope};
use crate::report::Report;
use clap::Args;
use std::path::PathBuf;
use surfel::SceneDescription;
use surfel::description::{Invalid, Section, is_scene_file};
use surfel_core::scene::Background;
use surfel_formats::FORMATS;

/// Files and options of a scene.
#[derive(Args, Debug)]
pub struct SceneArgs<S: Scope> {
    #[arg(value_name = "FILE", required = true, help = files_help())]
    pub files: Vec<PathBuf>,
    /// Short for --background transparent.
    #[arg(long, conflicts_with = "background", help_heading = Section::Picture.heading(), hide_short_help = true)]
    no_background: bool,
    #[command(flatten)]
    options: KeyOptions<S>,
}

/// Describes the argument `files`.
fn files_help() -> String {
    let extensions = FORMATS.iter().flat_map(|format| format.extensions);
    let extensions: Vec<String> = extensions.map(|extension| format!(".{extension}")).collect();
    format!(
        "Point clouds, meshes and glTF scenes ({}) and scene files (.toml, .json); several make one scene. \
         A folder stands for its files, `*` for any part of a name, - for standard input",
        extensions.join(", ")
    )
}

impl<S: Scope> SceneArgs<S> {
    /// Returns the description of scene files and options, in which files with settings of their own are objects.
    ///
    /// # Errors
    ///
    /// Fails for files that cannot be read, and for keys and values that are not valid.
    pub fn description(
        &self,
        global: &Global,
        report: &Report,
    ) -> anyhow::Result<SceneDescription> {
        let mut description = self.startup(global, report)?;
        description.apply_object_settings()?;
        Ok(description)
    }

    /// Returns the description of scene files and options: later scene files lie over earlier ones, the command line
    /// over all of them.
    ///
    /// # Errors
    ///
    /// Fails for files that cannot be read, and for keys and values that are not valid.
    pub fn startup(&self, global: &Global, report: &Report) -> anyhow::Result<SceneDescription> {
        let mut description = SceneDescription::default();
        let mut layer = self.options.description.clone()?;
        for file in expand(&self.files, report)? {
            if is_scene_file(&file) {
                description.overlay(SceneDescription::read(&file)?);
            } else {
                layer.files.push(file);
            }
        }
        if self.no_background {
            layer.picture.background = Some(Background::Transparent);
        }
        layer.run = global.run.description.clone()?.run;
        let has_typed_settings = layer.overrides.object_settings.is_some();
        description.overlay(layer);
        let scene_file = self.files.iter().find(|file| is_scene_file(file));
        let of_scene_file =
            |error: Invalid| scene_file.into_iter().fold(error, |error, file| error.in_file(file));
        // Names may clash between scene files, and keys between a file and the command line.
        let checked = description.check().and_then(|()| description.check_is_not_empty());
        checked.map_err(of_scene_file)?;
        let applied = description.clone().apply_object_settings();
        // Settings of the command line take the place of those of scene files.
        applied.map_err(|e| if has_typed_settings { e } else { of_scene_file(e) })?;
        Ok(description)
    }
}
