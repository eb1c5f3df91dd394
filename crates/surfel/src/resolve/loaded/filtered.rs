//! A scene without the points that a description drops.

use super::super::cloud::filtered_copy;
use super::LoadedScene;
use crate::description::SceneDescription;
use crate::error::Result;
use surfel_core::progress::Progress;
use surfel_core::scene::Geometry;

impl LoadedScene {
    /// Returns true if the settings of a description drop points that are still there.
    pub(crate) fn has_more_than(&self, description: &SceneDescription) -> bool {
        let drops = |(i, _)| self.settings_of(i, description).preparation.filters_points();
        !self.is_filtered && self.clouds().any(drops)
    }

    /// Returns a copy without the points that the settings of a description drop. Points keep the indices that they have
    /// among those that were read.
    ///
    /// # Errors
    ///
    /// Fails for filters that do not fit the columns, and for those that keep no point.
    pub(crate) fn filtered(
        &self,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut graph = self.graph_without_points();
        for (i, cloud) in self.clouds() {
            let settings = self.settings_of(i, description).preparation;
            let kept = filtered_copy(cloud, &settings, progress)?;
            graph.geometries[i] = Geometry::Points(kept);
        }
        Ok(Self {
            graph,
            file_infos: self.file_infos.clone(),
            read_files: self.read_files.clone(),
            camera_motion: self.camera_motion.clone(),
            environment: self.environment.clone(),
            files: self.files.clone(),
            objects: self.objects.clone(),
            owners: self.owners.clone(),
            sequences: self.sequences.clone(),
            keeps_all_columns: self.keeps_all_columns,
            is_filtered: true,
        })
    }
}
