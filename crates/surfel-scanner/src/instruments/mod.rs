//! Instruments that measure scenes, one kind per file.

mod airborne;
mod depth_camera;
mod instrument;
mod returns;
mod spinning;
mod station;
mod terrestrial;

pub use airborne::{AirborneLidar, FlightLine};
pub use depth_camera::DepthCamera;
pub use instrument::Instrument;
pub use spinning::SpinningLidar;
pub use station::Station;
pub use terrestrial::{Scanner, TerrestrialSurvey};
