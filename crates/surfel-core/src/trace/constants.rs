//! Constants of the searches, for other implementations of them.

pub use crate::trace::query::edge_test::RETRY_RADIUS_FACTOR;
pub use crate::trace::query::smooth_hits::{
    MIN_SLIT_COSINE, MIN_SLIT_DEPTH, SMOOTH_RESTART_OFFSET,
};
pub use crate::trace::query::smooth_query::{
    MAX_DISTANCE_FROM_DISC, MAX_FITS, MAX_LAST_STEP, TOLERANCE,
};
pub use crate::trace::query::splat_query::RESTART_OFFSET;
pub use crate::trace::query::surface_hit::MAX_REJECTED_HITS;
