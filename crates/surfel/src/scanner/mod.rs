//! A virtual laser scanner and things to scan: clouds of any size whose true surface is known.

mod column;
mod foliage;
mod masonry;
mod noise;
pub mod ruin;
mod scan;
mod shapes;
mod site;
mod station;
mod stone;
mod terrain;
mod weathered;

pub use scan::Scanner;
pub use shapes::{Plane, Sphere};
pub use site::{Beam, Bounds, Hit, Site, Solid};
pub use station::Station;
