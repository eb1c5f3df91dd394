//! One instant of a scene as plain arrays: the only thing that a kernel reads.

mod block;
mod bounds;
mod points;
mod refit;
mod source;

pub use block::{BlockPoint, PointBlock};
pub use points::{FlatPoints, NO_POINT, Slot};
pub use refit::{REBUILD_COST, Refit};

use crate::error::{Error, Result};
use crate::math::DVec3;
use crate::progress::Progress;
use crate::scene::{Background, Camera, Light, Material, Scene};
use crate::surface::{Boundary, SurfaceKind};

#[derive(Clone, Debug)]
pub struct FlatScene {
    /// World coordinates of the zero of everything below.
    pub origin: DVec3,
    pub points: FlatPoints,
    pub surface: SurfaceKind,
    pub boundary: Boundary,
    pub material: Material,
    pub lights: Vec<Light>,
    pub background: Background,
    pub camera: Camera,
}

impl FlatScene {
    /// Sorts the scene's points into their tree. The result does not depend on the number of threads.
    pub fn new(scene: &Scene, progress: &dyn Progress) -> Result<Self> {
        if scene.cloud.is_empty() {
            return Err(Error::EmptyCloud);
        }
        Ok(Self {
            origin: scene.cloud.origin,
            points: FlatPoints::new(&scene.cloud, scene.surface, &scene.colors, progress)?,
            surface: scene.surface,
            boundary: scene.boundary,
            material: scene.material.clone(),
            lights: scene.lights.clone(),
            background: scene.background,
            camera: scene.camera,
        })
    }
}
