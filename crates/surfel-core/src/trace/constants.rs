//! Constants of the searches, for other implementations of them.

pub use crate::surface::MIN_SLIT_DEPTH;
pub use crate::trace::query::edge_test::RETRY_RADIUS_FACTOR;
pub use crate::trace::query::hit::{MAX_REJECTED_HITS, RESTART_OFFSET};
pub use crate::trace::query::smooth_hits::{MIN_SLIT_COSINE, SMOOTH_RESTART_OFFSET};
pub use crate::trace::query::smooth_query::{
    MAX_DISTANCE_FROM_DISC, MAX_FITS, MAX_LAST_STEP, TOLERANCE,
};
pub use crate::trace::simd::node_boxes::ROUNDING;

/// Constants of the surface of moving least squares.
pub mod mls {
    pub use crate::trace::query::mls_query::{
        LIST_MARGIN, MAX_DISTANCE_FROM_BALL, MAX_FITS, MAX_STEP, MIN_COLOR_WEIGHT, N_PLANES,
        RESTART_FRACTION, RESTART_OFFSET, TOLERANCE,
    };
    pub use crate::trace::query::mls_surface::MAX_TRIED_BALLS;
}

/// Constants of the field of weighted planes.
pub mod field {
    pub use crate::trace::query::field_query::OVERLAP;
    pub use crate::trace::query::ray_field::{
        BRACKET_MARGIN, LINEAR_STEP, MIN_COLOR_WEIGHT, N_SAMPLES,
    };
}

/// Constants of octrees.
pub mod octree {
    pub use crate::trace::query::octree_query::{CORNER_MARGIN, N_PARTS};
    pub use crate::trace::traversal::octree_walk::MAX_CELL_MARGIN;
}

/// Constants of trained Gaussians.
pub mod gaussian {
    pub use crate::trace::query::gaussian_buffer::BUFFER_SIZE;
}
