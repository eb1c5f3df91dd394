//! Scenes of signed distance fields, one per file.

mod named_scene;
pub mod forest;
pub mod room;
pub mod ruin;
pub mod street;

pub use named_scene::{NamedScene, SceneView};
