//! Constants of the integrators, for other implementations of them.

pub use super::background::MAX_SUN_RADIANCE;
pub use super::dimensions::{
    ALPHA_LAYER, ENVIRONMENT_DIRECTION, LOBE_DIRECTION, PUNCTUAL_LIGHT_POSITION, REFLECTED,
    REFRACTED, ROULETTE, SKY_DIRECTION, SKY_DISTANCE, SUN_DIRECTION,
};
pub use super::media::MIN_OFFSET_COS;
pub use super::shading::MIN_FACING_COS;
pub use super::specular::{
    ALBEDO_STEPS, MIN_GGX_ALPHA, MIN_GGX_COS, MIN_MASKING_COS, MIN_ROUGHNESS, directional_albedo,
};
pub use super::transmittance::{MAX_SURFACES, MIN_TRANSMITTANCE};
pub use super::whitted::{MAX_ALPHA_LAYERS, MIN_WEIGHT};
