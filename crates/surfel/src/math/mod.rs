//! Boxes, rays, frames, Morton order, sampling maps, weighted draws, eigenvectors and counter-based random numbers.

mod aabb;
mod distribution;
mod eigen;
mod frame;
mod lanes;
mod morton;
mod pair;
mod portable;
mod random;
mod ray;
mod sampling;

pub use aabb::Aabb;
pub use distribution::Distribution2d;
pub use eigen::{SymmetricMatrix, smallest_eigenvector};
pub use frame::{Frame, tangents};
pub use glam::{
    Affine3A, DAffine3, DMat3, DQuat, DVec2, DVec3, Mat3, Quat, Vec2, Vec3, Vec3A, Vec4,
};
pub use lanes::{Floats, LANES, LaneMask, Lanes, TO_INTEGER, Task, Vec3Lanes, WIDE, Wide};
pub use morton::morton_place;
pub use pair::Pair;
pub use portable::{PortableLanes, PortableMask};
pub use random::{Random, hash};
pub use ray::Ray;
pub use sampling::{cosine_hemisphere, disk, scrambled_pair, uniform_cone};
