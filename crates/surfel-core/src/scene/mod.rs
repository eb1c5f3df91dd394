//! Scenes: a graph of geometry with its materials, lights and animation, a background and a camera.

mod sample;
mod ground;
mod camera;
mod camera_fit;
mod depth_map;
mod turntable;
mod inliers;
mod corridor;
mod inside_view;
mod tunnel;
mod auto_viewpoint;
mod auto_camera;
mod environment;
mod light;
mod background;
mod texture;
mod material;
mod mesh;
mod cloud_geometry;
mod animation;
mod graph;
mod content_hash;
mod evaluate;
mod clip;
mod interior;
mod direction_cells;
mod station;
mod sunlit;
mod visible_normals;
mod validate;
pub mod color;

pub use animation::{
    Animation, Channel, Interpolation, KeyframeValue, Keyframes, Track, catmull_rom_path, orbit,
};
pub use auto_camera::{fit_camera, panorama_camera};
pub use background::Background;
pub use camera::{Camera, Lens, Projection, View};
pub use camera_fit::{CameraFit, default_view_up};
pub use clip::{Clip, ClipBox, ClipPlane};
pub use cloud_geometry::CloudGeometry;
pub use environment::{Environment, EnvironmentArrays};
pub use graph::{Geometry, Graph, Joint, Node, Primitive, Transform};
pub use ground::north;
pub use inliers::{PART, inlier_bounds};
pub use inside_view::InsideView;
pub use interior::{Room, find_room};
pub use light::{Light, PunctualLight, PunctualLightKind, Sky, Sun};
pub use material::{AlphaMode, Material, MaterialTextures};
pub use mesh::Mesh;
pub use station::{find_depth_camera, find_station, view_from_station};
pub use sunlit::sunlit_fraction;
pub use texture::{Texture, TextureEncoding, TextureRef, Wrap};
pub use tunnel::find_tunnel;
pub use visible_normals::visible_normals;

pub use crate::points::{Morph, Skin};

/// The world of one picture: right-handed, in the unit of its files, with Z up unless its camera says
/// otherwise.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Geometry, materials, punctual lights and animation.
    pub graph: Graph,
    /// Lights of the whole scene.
    pub lights: Vec<Light>,
    /// The background.
    pub background: Background,
    /// The camera.
    pub camera: Camera,
}
