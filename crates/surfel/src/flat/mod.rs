//! One instant of a scene as plain arrays: the only thing that a kernel reads.

mod block;
mod bounds;
mod cloud;
mod deform;
mod instance;
mod lamp;
mod mesh;
mod points;
mod refit;
mod scene;
mod source;
mod tree;
mod triangles;

pub use block::{BlockPoint, PointBlock};
pub use cloud::FlatCloud;
pub use instance::Instance;
pub use lamp::FlatLamp;
pub use mesh::FlatMesh;
pub use points::{FlatPoints, Slot};
pub use refit::{REBUILD_COST, Refit};
pub use scene::{FlatGeometry, FlatScene};
pub use tree::BlockTree;
pub use triangles::{FlatTriangles, TriangleBlock};
