//! Clouds of which one is seen at a time, as 4-D scans: each is read when its time comes.

use crate::args::SceneArgs;
use crate::cloud::{into_cloud, load, make_points};
use crate::report::Report;
use crate::scene_file::Object;
use anyhow::{Context, anyhow};
use std::path::PathBuf;
use surfel::math::{DAffine3, Vec3};
use surfel::scene::Points;
use surfel_formats::is_cloud;

/// Whether an object is such a sequence. Meshes and scenes are all held instead, each under its own node.
pub fn is_read_in_turn(object: &Object, args: &SceneArgs) -> surfel_formats::Result<bool> {
    if object.is_merged || object.files.len() < 2 {
        return Ok(false);
    }
    for file in &object.files {
        if !args.preparation.vertices && !is_cloud(file)? {
            return Ok(false);
        }
    }
    Ok(true)
}

pub struct Sequence<'a> {
    files: &'a [PathBuf],
    fps: f64,
    /// Options that its clouds are made by.
    args: SceneArgs,
    /// Of the graph, where the one that is seen stands.
    pub geometry: usize,
    /// From the clouds' coordinates to the world's, where they are clipped.
    pub world_from_points: DAffine3,
    file_idx: usize,
}

impl<'a> Sequence<'a> {
    /// One whose first file is in the graph already.
    pub fn new(files: &'a [PathBuf], fps: f64, args: SceneArgs, geometry: usize) -> Self {
        Self { files, fps, args, geometry, world_from_points: DAffine3::IDENTITY, file_idx: 0 }
    }

    pub fn duration_secs(&self) -> f64 {
        self.files.len() as f64 / self.fps
    }

    /// The cloud of a time, ready, if it is another than before.
    pub fn seek(
        &mut self,
        time_secs: f64,
        up: Vec3,
        report: &Report,
    ) -> anyhow::Result<Option<Points>> {
        let file_idx = self.file_at(time_secs);
        if file_idx == self.file_idx {
            return Ok(None);
        }
        self.file_idx = file_idx;
        let file = &self.files[file_idx];
        let (graph, _) = load(file, &self.args, report)?;
        let cloud = into_cloud(graph)
            .map_err(|_| anyhow!("{}: is no cloud any more, as it was before", file.display()))?;
        let mut points = make_points(cloud, &self.args, up, report)
            .with_context(|| file.display().to_string())?;
        points.clip(&self.args.clip.clip(), &self.world_from_points);
        Ok(Some(points))
    }

    /// The last one stays.
    pub fn file_at(&self, time_secs: f64) -> usize {
        let has_begun = |file_idx: &usize| *file_idx as f64 / self.fps <= time_secs;
        (1..self.files.len()).take_while(has_begun).count()
    }
}
