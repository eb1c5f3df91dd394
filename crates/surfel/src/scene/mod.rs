//! What an author describes: a cloud, how it is shaped, coloured and lit, and who looks at it.

mod animation;
mod camera;
pub mod color;
mod framing;
mod graph;
mod light;
mod material;
mod mesh;
mod prospect;
mod texture;
mod validate;

pub use animation::{Animation, Channel, Interpolation, Keys, Track, Value};
pub use camera::{Camera, Projection, View};
pub use framing::{Framing, frame, look_around, upright, usual_bounds};
pub use graph::{Geometry, Graph, Joint, Node, Part, Points, Transform};
pub use light::{Lamp, LampKind, Light, Sky, Sun};
pub use material::{AlphaMode, Material, Textures};
pub use mesh::{Mesh, Morph, Skin};
pub use texture::{Texture, TextureRef, Wrap};

use crate::math::Vec3;
use crate::points::PointCloud;
use crate::surface::{Boundary, SurfaceKind};

/// One picture's worth of world: right-handed, Z up, in the cloud's unit.
#[derive(Clone, Debug)]
pub struct Scene {
    pub cloud: PointCloud,
    pub surface: SurfaceKind,
    pub boundary: Boundary,
    /// One a point, sRGB-encoded.
    pub colors: Vec<[u8; 3]>,
    pub material: Material,
    pub lights: Vec<Light>,
    pub background: Background,
    pub camera: Camera,
}

/// What is seen where no point is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    Transparent,
    /// Linear, from the top to the bottom of the picture; the same twice for a plain colour.
    Gradient {
        top: Vec3,
        bottom: Vec3,
    },
}

impl Background {
    /// Linear colour and alpha at a height from 0 (top of the picture) to 1 (bottom).
    pub fn at(self, height: f32) -> [f32; 4] {
        match self {
            Self::Transparent => [0.0; 4],
            Self::Gradient { top, bottom } => top.lerp(bottom, height).extend(1.0).to_array(),
        }
    }
}
