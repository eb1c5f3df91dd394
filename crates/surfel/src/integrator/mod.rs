//! Light along rays: what a batch of camera rays brings back.

mod direct;

pub use direct::{Batch, RayCounts, Samples, radiance};
