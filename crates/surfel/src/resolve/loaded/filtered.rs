//! A scene without the points that a description drops.

use super::super::cloud::filtered_copy;
use super::LoadedScene;
use crate::description::SceneDescription;
use crate::error::Result;
use std::iter::successors;
use surfel_core::math::DAffine3;
use surfel_core::progress::Progress;
use surfel_core::scene::{Geometry, Node};

impl LoadedScene {
    /// Returns true if the settings of a description drop points that are still there.
    pub(crate) fn has_more_than(&self, description: &SceneDescription) -> bool {
        let drops = |(i, _)| self.settings_of(i, description).preparation.filters_points();
        !self.is_filtered && self.clouds().any(drops)
    }

    /// Returns the transform from the coordinates of a geometry to those of its file, by the first node that shows it.
    pub(super) fn file_from_geometry(&self, geometry: usize) -> DAffine3 {
        let nodes = &self.graph.nodes;
        let shows = |node: &Node| node.primitives.iter().any(|part| part.geometry == geometry);
        let object = self.owners[geometry].map(|object_idx| self.objects[object_idx].node);
        let of_file = successors(nodes.iter().position(shows), |node| nodes[*node].parent)
            .take_while(|node| Some(*node) != object);
        of_file.fold(DAffine3::IDENTITY, |file, node| nodes[node].transform.matrix() * file)
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
            let kept = filtered_copy(cloud, &self.file_from_geometry(i), &settings, progress)?;
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
            file_ends: self.file_ends.clone(),
            keeps_all_columns: self.keeps_all_columns,
            is_filtered: true,
            up_parts: self.up_parts.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    //! Filters of clouds below moved nodes.

    use super::*;
    use crate::memory_files::{FileContent, MemoryContent};
    use crate::resolve::KeepOptions;
    use crate::resolve::cloud::graph_of;
    use serde_json::json;
    use std::f64::consts::FRAC_PI_2;
    use std::path::Path;
    use std::sync::Arc;
    use surfel_core::math::{DQuat, DVec3, Vec3};
    use surfel_core::points::PointCloud;
    use surfel_core::progress::NoProgress;
    use surfel_core::scene::Transform;
    use surfel_formats::FileInfo;

    /// Returns an object high up whose file has points 10 to 18 above zero, below a node that turns +Y to +Z.
    fn turned_column() -> SceneDescription {
        let points = (0..9).map(|i| Vec3::Y * i as f32).collect();
        let mut graph = graph_of(PointCloud::from_positions(points));
        graph.nodes[0].transform = Transform::Trs {
            translation: DVec3::new(0.0, 0.0, 10.0),
            rotation: DQuat::from_rotation_x(FRAC_PI_2),
            scale: DVec3::ONE,
        };
        let file = FileContent { graph, info: FileInfo::default() };
        let mut description = SceneDescription::default();
        description.memory.insert("memory:column", MemoryContent::File(Arc::new(file)));
        let table = json!({ "file": "memory:column", "translate": [0, 0, 1000] });
        description.add_object(table.as_object().unwrap(), Path::new("")).unwrap();
        description
    }

    #[test]
    fn filters_see_the_coordinates_of_the_file() {
        for (key, value) in [("filter", "z > 12.5"), ("crop", "([-1,1],[-1,1],[12.5,50])")] {
            let mut description = turned_column();
            description.set(key, &json!(value), Path::new("")).unwrap();
            let read = |all_columns: bool| {
                let keep = KeepOptions { all_columns, ..KeepOptions::default() };
                LoadedScene::read(&description, keep, &NoProgress).unwrap()
            };
            let n_points = |scene: &LoadedScene| scene.clouds().map(|(_, cloud)| cloud.len()).sum();
            let (all, kept): (LoadedScene, LoadedScene) = (read(true), read(false));
            let filtered = all.filtered(&description, &NoProgress).unwrap();
            let counts: [usize; 3] = [&all, &filtered, &kept].map(n_points);
            assert_eq!(counts, [9, 6, 6], "{key}");
            let prepared = all.prepared(&description, |_| true, &NoProgress).unwrap();
            assert_eq!(prepared[0].len(), 6, "{key}");
        }
    }
}
