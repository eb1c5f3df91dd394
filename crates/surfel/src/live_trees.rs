//! The trees of a live scene, and what was made for its last descriptions.

use crate::built_scene::source_indices;
use crate::cache::Lru2;
use crate::description::SceneDescription;
use crate::error::Result;
use crate::known_trees::KnownTrees;
use crate::live_view::SceneTrees;
use crate::point_overlap::check_overlap;
use crate::resolve::{
    AutoSettings, LoadedScene, common_legend, finish_graph, hide_walls, with_common_ranges,
};
use surfel_core::math::DVec3;
use surfel_core::points::PreparedCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::{Background, Camera, Projection, Scene};

/// A camera for trees that nobody looks at yet.
const PLACEHOLDER_CAMERA: Camera = Camera {
    position: DVec3::ZERO,
    focal_point: DVec3::Y,
    view_up: DVec3::Z,
    projection: Projection::Panorama,
};

/// Results for the last descriptions.
#[derive(Debug, Default)]
pub struct BuildCache {
    pub prepared: Lru2<Vec<PreparedCloud>>,
    /// The clouds of added objects, apart, so that all others need not be prepared again beside them.
    pub prepared_added: Lru2<Vec<PreparedCloud>>,
    pub trees: Lru2<SceneTrees>,
    /// Trees of single geometries: those that a change leaves as they are need not be built again.
    pub known_trees: KnownTrees,
}

impl BuildCache {
    /// Drops all but the trees of single geometries.
    pub fn clear(&self) {
        self.prepared.clear();
        self.prepared_added.clear();
        self.trees.clear();
    }
}

/// Everything besides prepared clouds that trees are built of.
pub struct TreeSource<'a> {
    pub loaded: &'a LoadedScene,
    pub time_secs: f64,
    pub description: &'a SceneDescription,
    pub auto: &'a AutoSettings,
    /// True if points so large that each ray meets thousands of them are refused.
    pub limits_overlap: bool,
}

impl TreeSource<'_> {
    /// Builds the trees of the whole scene; lights and camera are set later.
    ///
    /// # Errors
    ///
    /// Fails for clouds that cannot be coloured, for points over each other that are refused, and if cancelled.
    pub fn build(
        self,
        clouds: Vec<PreparedCloud>,
        known: &KnownTrees,
        progress: &dyn Progress,
    ) -> Result<SceneTrees> {
        let Self { loaded, time_secs, description, auto, limits_overlap } = self;
        let up = auto.up;
        let description = with_common_ranges(loaded, &clouds, description, up, progress);
        let legend = common_legend(loaded, &clouds, &description, up);
        let raw = loaded.graph_without_points();
        let (mut graph, mut sequences) =
            finish_graph(loaded, raw, clouds, &description, up, progress)?;
        hide_walls(&mut graph, &auto.hidden_walls);
        for sequence in &mut sequences {
            sequence.seek(time_secs, &mut graph, up, progress)?;
        }
        let source_indices = source_indices(&graph);
        let (lights, background) = (Vec::new(), Background::Transparent);
        let scene = Scene { graph, lights, background, camera: PLACEHOLDER_CAMERA };
        if limits_overlap {
            check_overlap(&scene.graph)?;
        }
        let flat = known.build(&scene, progress)?;
        progress.end();
        let mut graph = scene.graph;
        graph.release_static();
        Ok(SceneTrees { graph, flat, source_indices, legend })
    }
}
