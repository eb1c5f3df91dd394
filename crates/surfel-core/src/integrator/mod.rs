//! Integrators: the radiance along a batch of camera rays.
//!
//! Each integrator is one file behind [`Integrator`]; `whitted` is the only one so far. The other files
//! serve all integrators: `batch` (the trait and its arguments), `shading` (material and normals at a
//! hit), `media` (nested dielectrics and absorption), `specular` (Fresnel and GGX), `background` (radiance
//! of rays that leave the scene), `transmittance` (shadow rays through glass), `dimensions` (which random
//! numbers are drawn for what) and `direct` (direct lighting).

mod background;
mod batch;
mod dimensions;
mod direct;
mod media;
mod shading;
mod specular;
mod transmittance;
mod whitted;
pub mod constants;

pub(crate) use background::background_radiance;
pub use batch::{CameraRayBatch, Integrator, PixelSamples, RayCounts};
pub use shading::albedo;
pub use whitted::Whitted;
