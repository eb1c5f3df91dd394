//! Constants of the searches, for other implementations of them.

pub use crate::trace::query::edge_test::RETRY_RADIUS_FACTOR;
pub use crate::trace::query::smooth_query::{
    MAX_DISTANCE_FROM_DISC, MAX_FITS, MAX_LAST_STEP, TOLERANCE,
};
pub use crate::trace::query::surface::{
    MAX_REJECTED_HITS, MIN_SLIT_COSINE, MIN_SLIT_DEPTH, RESTART_OFFSET, SMOOTH_RESTART_OFFSET,
};
