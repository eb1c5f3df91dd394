//! One instant of a scene as plain arrays, the only scene data that kernels read.

mod block;
mod block_tree;
mod bounds;
mod deform;
mod instance;
mod mesh;
mod point_columns;
mod points;
mod field;
mod gaussians;
mod cloud;
mod punctual_light;
mod refit;
mod scene;
mod visit_points;
mod profile;
mod volume;
mod triangles;

pub use block::{BlockPoint, PointBlock};
pub use block_tree::{BlockTree, Slot};
pub use cloud::FlatCloud;
pub use field::{
    CellCorners, CellPlane, FieldLeaf, FieldTree, KdChild, MAX_KD_DEPTH, MAX_OCTREE_DEPTH, Octree,
    OctreeNode, OctreeOptions, max_field_bytes,
};
pub use gaussians::{FlatGaussians, GaussianBlock, MAX_GAUSSIAN_BYTES};
pub use instance::Instance;
pub use mesh::FlatMesh;
pub use point_columns::PointColumns;
pub use points::FlatPoints;
pub use profile::{Profile, ProfileLine, ProfilePoint, height_profile};
pub use punctual_light::FlatPunctualLight;
pub use refit::{MAX_COST_RATIO, Refit};
pub use scene::{FlatGeometry, FlatScene};
pub use triangles::{FlatTriangles, TriangleBlock};
pub use visit_points::PointId;
pub use volume::{BaseHeight, Volume, VolumeQuery, cut_and_fill};
