//! Backgrounds: the colours of pixels that show no surface.

use crate::math::Vec3;

/// The background of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Background {
    /// Transparent: alpha is 0.
    #[default]
    Transparent,
    /// The environment or sky that lights the scene.
    Environment,
    /// A linear gradient from the top to the bottom of the picture; twice the same colour for a plain
    /// background.
    Gradient {
        /// Linear colour at the top of the picture.
        top: Vec3,
        /// Linear colour at the bottom of the picture.
        bottom: Vec3,
    },
}

impl Background {
    /// Returns the linear colour and alpha at a height from 0 (top of the picture) to 1 (bottom).
    ///
    /// The colour of an environment depends on the direction instead, so it is transparent here.
    pub fn color_at(self, height: f32) -> [f32; 4] {
        match self {
            Self::Transparent | Self::Environment => [0.0; 4],
            Self::Gradient { top, bottom } => top.lerp(bottom, height).extend(1.0).to_array(),
        }
    }
}
