//! What an author describes: a graph of geometry, what it is made of, what lights it, and who looks at it.

mod animation;
mod camera;
mod clip;
pub mod color;
mod environment;
mod framing;
mod graph;
mod light;
mod material;
mod mesh;
mod prospect;
mod texture;
mod validate;

pub use animation::{Animation, Channel, Interpolation, Keys, Track, Value, orbit, smooth_path};
pub use camera::{Camera, Projection, View};
pub use clip::{Clip, ClipBox, ClipPlane};
pub use environment::Environment;
pub use framing::{Framing, frame, look_around, upright, usual_bounds};
pub use graph::{Geometry, Graph, Joint, Node, Part, Points, Transform};
pub use light::{Lamp, LampKind, Light, Sky, Sun};
pub use material::{AlphaMode, Material, Textures};
pub use mesh::Mesh;
pub use texture::{Encoding, Texture, TextureRef, Wrap};

pub use crate::points::{Morph, Skin};

use crate::math::Vec3;

/// One picture's worth of world: right-handed, Z up, in the unit of its files.
#[derive(Clone, Debug)]
pub struct Scene {
    pub graph: Graph,
    pub lights: Vec<Light>,
    pub background: Background,
    pub camera: Camera,
}

/// What is seen where nothing is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    Transparent,
    /// The sky or the environment that gives light.
    Surroundings,
    /// Linear, from the top to the bottom of the picture; the same twice for a plain colour.
    Gradient {
        top: Vec3,
        bottom: Vec3,
    },
}

impl Background {
    /// Linear colour and alpha at a height from 0 (top of the picture) to 1 (bottom); nothing of surroundings,
    /// which depend on the direction.
    pub fn at(self, height: f32) -> [f32; 4] {
        match self {
            Self::Transparent | Self::Surroundings => [0.0; 4],
            Self::Gradient { top, bottom } => top.lerp(bottom, height).extend(1.0).to_array(),
        }
    }
}
