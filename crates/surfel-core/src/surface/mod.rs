//! Surface kinds: the shape that a ray intersects at each point or triangle, one file per shape.

pub mod capsule;
pub mod disc;
pub mod edge_test;
mod field;
mod kind;
mod octree_depth;
mod shape;
pub mod smooth;
mod sphere;
mod splat;
pub mod triangle;

pub use capsule::Capsule;
pub use disc::Disc;
pub use edge_test::{
    CandidateHit, CandidateHitLanes, EdgeTest, EdgeTestResult, NEIGHBORHOOD_RADIUS_FACTOR,
    NeighborhoodStats,
};
pub use field::{FIELD_SUPPORT, FieldPoint, FieldSums, MIN_FIELD_WEIGHT, field_weight};
pub use kind::{SOLID_SPAWN_OFFSET, SurfaceKind};
pub use octree_depth::OctreeDepth;
pub use shape::{MAX_NORMAL_COMPONENT, PointLanes, RayLanes, Shape};
pub use smooth::{
    ColorSums, FIT_REACH, FitPoint, OverhangSums, PointSums, SUPPORT_FACTOR, SphereHit, SphereSums,
    edge_retest_factor,
};
pub use sphere::Sphere;
pub use splat::{
    MAX_GATHERED, MIN_PLANE_RATIO, SplatAccumulator, Surfel, fit_plane_normal, gather_limit,
};
pub use triangle::{RayFrame, RayRelativeTriangles, Triangle, TriangleLanes};
