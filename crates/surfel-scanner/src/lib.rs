//! Virtual laser scanners and scenes of signed distance fields, which give clouds of any size whose true surface is
//! known.

mod classes;
mod noise;
mod sdf;
mod parts;
mod instruments;
pub mod scenes;

pub use instruments::{
    AirborneLidar, DepthCamera, FlightLine, Instrument, Scanner, SpinningLidar, Station,
    TerrestrialSurvey,
};
pub use scenes::ruin;
pub use sdf::{DAabb, DRay, Sdf, SdfHit, SdfScene};
