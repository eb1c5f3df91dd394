//! A scene under one description, at one time: what is drawn, and what its pixels and rays lead back to.

use crate::built_scene::{sources_of, world_bounds};
use crate::crs::{Unit, georeference};
use crate::description::SceneDescription;
use crate::error::Result;
use crate::overlay::Overlay;
use crate::picture::RenderedImage;
use crate::ray_query::RayCaster;
use crate::resolve::{LoadedScene, coordinate_system};
use std::sync::Arc;
use surfel_core::flat::{FlatScene, Instance};
use surfel_core::image::{Image, NO_ID};
use surfel_core::math::Vec3;
use surfel_core::render::Settings;
use surfel_core::scene::color::{ColorSource, Legend};
use surfel_core::scene::{Graph, Room};
use surfel_core::trace::Simd;
use surfel_formats::Georeference;

/// Trees over the points of a scene, and what shows which point is which.
#[derive(Debug)]
pub struct SceneTrees {
    /// The graph without the points.
    pub graph: Graph,
    /// The flat scene without lights.
    pub flat: FlatScene,
    /// For each geometry, the index that each point had when it was read; empty for triangles.
    pub source_indices: Vec<Vec<u32>>,
    /// The meaning of the colours.
    pub legend: Legend,
}

/// A scene under one description, at one time.
#[derive(Clone, Debug)]
pub struct LiveView {
    /// The content of the files.
    pub loaded: Arc<LoadedScene>,
    /// The arrays that rays are traced against, with camera and exposed lights.
    pub flat: FlatScene,
    /// Size and quality of pictures.
    pub settings: Settings,
    /// The complete description, with everything that was chosen and the exposure.
    pub description: SceneDescription,
    /// The source of colours that was chosen for the first cloud.
    pub color_source: Option<ColorSource>,
    /// True if the scene moves the camera.
    pub moves_camera: bool,
    /// Unit of the coordinates.
    pub(crate) unit: Unit,
    /// The room on a turntable, whose walls before the camera are hidden.
    pub turned_room: Option<Room>,
    /// The trees, which several views share.
    pub trees: Arc<SceneTrees>,
}

impl LiveView {
    /// Returns the legend, scale bar, north arrow and caption of pictures of the view.
    pub fn overlay(&self) -> Overlay {
        self.overlay_with(self.trees.legend.clone())
    }

    fn overlay_with(&self, legend: Legend) -> Overlay {
        let up = self.description.world.up.unwrap_or(Vec3::Z);
        Overlay::of(&self.description.picture, legend, (up, self.unit))
    }

    /// Draws the overlay onto a picture of the view, which becomes a file as the description says.
    pub fn finished(&self, image: Image) -> RenderedImage {
        self.finished_with(image, self.trees.legend.clone())
    }

    /// Draws the overlay with another legend onto a picture of the view, which becomes a file as the description says.
    pub fn finished_with(&self, image: Image, legend: Legend) -> RenderedImage {
        self.finished_by(image, &self.overlay_with(legend))
    }

    /// Draws the overlay of a movie onto a frame, whose legend keeps its corner.
    pub(crate) fn finished_frame(&self, image: Image) -> RenderedImage {
        let mut overlay = self.overlay();
        overlay.is_fixed = true;
        self.finished_by(image, &overlay)
    }

    fn finished_by(&self, image: Image, overlay: &Overlay) -> RenderedImage {
        let scene = (&self.flat, &self.description);
        RenderedImage::finish(image, overlay, scene, self.georeference())
    }

    /// Returns where the pixels of a picture lie, if the camera looks straight down without perspective.
    pub fn georeference(&self) -> Option<Georeference> {
        let system = coordinate_system(&self.loaded, &self.description);
        let size = (self.settings.width, self.settings.height);
        georeference(&self.flat.camera, size, system.as_ref())
    }

    /// Returns for each instance the number of what it shows: 0 is all files without an object, if there are any; the
    /// objects follow in their order.
    pub fn contents(&self) -> Vec<u32> {
        let content = |instance: &Instance| self.loaded.content_of(instance.node_idx as usize);
        let contents = self.flat.instances.iter().map(content);
        contents.map(|content| content.map_or(NO_ID, |content| content as u32)).collect()
    }

    /// Returns the corners of a box around everything, in world coordinates: least and greatest.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        world_bounds(&self.flat)
    }

    /// Returns what casts rays at the view.
    ///
    /// # Errors
    ///
    /// Fails for views of round points, which have no surface.
    pub fn ray_caster(&self, simd: Simd) -> Result<RayCaster<'_>> {
        RayCaster::new(&self.flat, simd, self.sources())
    }

    /// Returns for each instance the index that each of its points had when it was read; empty for triangles.
    pub fn sources(&self) -> Vec<&[u32]> {
        sources_of(&self.flat, &self.trees.source_indices)
    }
}
