//! The view that a page shows: its scene, camera and size.

use crate::scene_provider::PreparedScene;
use serde_json::Value;
use std::sync::Arc;
use std::time::Instant;
use surfel_core::scene::Camera;

/// The view that a client's pictures show.
#[derive(Clone)]
pub struct ViewState {
    /// The scene; none until the first one is prepared, and after rendering failed.
    pub scene: Option<Arc<PreparedScene>>,
    /// Number of the scene, which its pictures carry.
    pub scene_number: u16,
    /// The camera; none until the first scene is prepared.
    pub camera: Option<Camera>,
    /// The camera in the form in which the page sent it.
    pub camera_settings: Value,
    /// Width and height of the picture in pixels.
    pub size: (u32, u32),
    /// Sequence number of the last message that took effect.
    pub seq: u32,
    /// True if the user is dragging.
    pub is_moving: bool,
    /// When the view changed last.
    pub changed_at: Instant,
}

impl ViewState {
    /// Returns whether there are a scene and a camera to render.
    pub fn is_complete(&self) -> bool {
        self.scene.is_some() && self.camera.is_some()
    }
}
