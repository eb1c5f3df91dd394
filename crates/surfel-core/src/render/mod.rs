//! Renderers: from a flat scene to a picture.

mod adaptive;
mod cpu;
mod footprint;
mod point_light;
mod raster;
mod region;
mod renderer;
mod settings;

pub use adaptive::MIN_ADAPTIVE_SAMPLES;
pub use cpu::CpuRenderer;
pub use footprint::POINT_SIZE_RANGE;
pub use raster::uses_rasterizer;
pub use region::RenderRegion;
pub use renderer::{RenderStats, Renderer};
pub use settings::{MAX_PIXELS, MAX_SAMPLES, Settings};

use crate::error::Result;
use crate::flat::FlatScene;

/// Checks that a picture can be rendered of `scene`.
///
/// # Errors
///
/// Fails if only some of the scene's surfaces are rasterised points: the rasterizer draws all of a scene
/// or none of it.
pub fn check(scene: &FlatScene) -> Result<()> {
    uses_rasterizer(scene).map(drop)
}

/// Checks surfaces before their trees are built; each is true if it is rasterised points.
///
/// # Errors
///
/// Fails where [`check`] would.
pub fn check_surfaces(are_raster: impl Iterator<Item = bool>) -> Result<()> {
    raster::all_or_none(are_raster).map(drop)
}
