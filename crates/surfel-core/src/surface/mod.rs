//! Surface kinds: the shape that a ray intersects at each point or triangle, one file per shape.

pub mod align;
pub mod capsule;
pub mod disc;
pub mod edge_test;
mod field;
pub mod gaussian;
mod kind;
pub mod leaves;
pub mod mls;
mod octree_depth;
pub mod options;
mod shape;
pub mod smooth;
mod sphere;
mod splat;
pub mod triangle;
mod weight;

pub use align::Align;
pub use capsule::Capsule;
pub use disc::Disc;
pub use edge_test::{
    CandidateHit, CandidateHitLanes, EdgeTest, EdgeTestResult, NEIGHBORHOOD_RADIUS_FACTOR,
    NeighborhoodStats,
};
pub use field::{FIELD_SUPPORT, FieldPoint, FieldSums, MIN_FIELD_WEIGHT};
pub use gaussian::{GaussianLanes, WhitenedGaussian};
pub use kind::{SOLID_ROUNDING, SOLID_SPAWN_OFFSET, SurfaceKind};
pub use leaves::Leaves;
pub use octree_depth::OctreeDepth;
pub use options::{GatherLimit, SurfaceOptions};
pub use shape::{MAX_NORMAL_COMPONENT, PointLanes, RayLanes, Shape};
pub use smooth::{
    ColorSums, FIT_REACH, FitPoint, LEAVING_DISTANCE, MAX_EXACT_TERMS, MIN_SLIT_DEPTH,
    OverhangSums, PointSums, SUPPORT_FACTOR, SphereHit, SphereSums, edge_retest_factor,
};
pub use sphere::Sphere;
pub use splat::{
    Blend, MAX_CANDIDATES, MAX_GATHERED, MIN_DISC_WEIGHT, NearestDisc, SplatAccumulator, Surfel,
    gather_limit,
};
pub use triangle::{RayFrame, RayRelativeTriangles, Triangle, TriangleLanes};
pub use weight::support_weight;
