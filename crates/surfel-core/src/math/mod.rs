//! Boxes, rays, bases, Morton order, sampling maps, distributions, quantiles, eigenvectors, counter-based
//! random numbers, and the lanes in which kernels compute.

mod aabb;
mod basis;
mod distribution;
mod doubled_lanes;
mod eigen;
pub mod eigen_lanes;
mod lanes;
mod morton;
mod portable;
mod quantile;
mod random;
mod ray;
mod sample_indices;
mod sampling;
mod set_bits;
mod slab;

pub use aabb::Aabb;
pub use basis::{Basis, rotation_of, tangents};
pub use distribution::Distribution2d;
pub use doubled_lanes::DoubledLanes;
pub use eigen::{SymmetricMatrix, smallest_eigenvector};
pub use eigen_lanes::{CovarianceLanes, rounded_normal};
pub use glam::{
    Affine3A, DAffine3, DMat3, DQuat, DVec2, DVec3, Mat3, Quat, Vec2, Vec3, Vec3A, Vec4,
};
pub use lanes::{
    Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, ROUND_TO_INTEGER, SimdTask,
    Vec3Lanes,
};
pub use morton::morton_decode;
pub use portable::{PortableLanes, PortableMask};
pub(crate) use quantile::sampled_quantile;
pub use quantile::{TotalOrder, median, quantile};
pub use random::{Random, hash};
pub use ray::Ray;
pub use sample_indices::sample_indices;
pub use sampling::{cosine_hemisphere, disk, owen_sobol_2d, uniform_cone};
pub use set_bits::{SetBits, set_bits};
pub use slab::{MIN_DIRECTION, clip_to_box, clip_to_slab, finite_inverse, finite_inverse_vec3};
