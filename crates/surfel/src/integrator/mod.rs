//! Light along rays: what a batch of camera rays brings back.
//!
//! An integrator is one file behind [`Integrator`]; `direct` (light from lamps and skies), `shading` (what
//! a hit is made of), `media` (glass within glass), `specular` (mirrors and gloss), `surroundings` (what is
//! seen where nothing is) and `through` (light that surfaces let pass) are there for all of them.

mod direct;
mod media;
mod shading;
mod specular;
mod surroundings;
mod through;
mod whitted;

pub(crate) use surroundings::surroundings;
pub use whitted::Whitted;

use crate::error::Result;
use crate::flat::FlatScene;
use crate::math::{Ray, Vec3, Vec4};
use crate::trace::{SceneHit, Tracer};
use shading::Shading;

/// A way to find the light along rays.
pub trait Integrator: Sync {
    /// The light along each camera ray of a batch, premultiplied by how much of it hides the background.
    fn radiance(&self, batch: &Batch) -> Result<(Vec<Vec4>, RayCounts)>;
}

/// A batch of camera rays and what they hit.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    pub tracer: &'a Tracer<'a>,
    pub rays: &'a [Ray],
    pub hits: &'a [SceneHit],
    pub samples: Samples<'a>,
}

/// Which of its pixel's samples each ray of a batch is.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// Random key of each ray's pixel.
    pub keys: &'a [u64],
    /// Number of each ray among its pixel's.
    pub indices: &'a [u32],
    /// What is behind the scene in each ray's pixel, with alpha.
    pub behind: &'a [Vec4],
    /// Rays toward each extended light from each hit.
    pub n_light: u32,
}

/// The colour of a surface, without light: linear.
pub fn albedo(scene: &FlatScene, ray: &Ray, hit: &SceneHit) -> Vec3 {
    Shading::new(scene, ray, hit).base_color
}

/// Rays traced, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    pub primary: u64,
    pub shadow: u64,
    pub sky: u64,
    /// Reflected, refracted, and gone on through what is not quite there.
    pub secondary: u64,
}

impl RayCounts {
    pub fn all(&self) -> u64 {
        self.primary + self.shadow + self.sky + self.secondary
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.shadow += other.shadow;
        self.sky += other.sky;
        self.secondary += other.secondary;
    }
}
