//! Hits of rays on the continuous surface of a cloud.

use crate::flat::Slot;
use crate::math::Vec3;
use crate::surface::SurfaceKind;

/// The hit of a ray on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Distance along the ray, infinite if nothing was hit.
    pub distance: f32,
    /// Index of the nearest point in its cloud.
    pub id: u32,
    /// Slot of that point in the tree of its kind of surface.
    pub slot: Slot,
    /// Radius of that point, in object space.
    pub radius: f32,
    /// Unit normal, facing the ray's origin.
    pub normal: Vec3,
    /// Linear colour.
    pub color: Vec3,
    /// The kind of the surface there.
    pub surface: SurfaceKind,
    /// True if that point's own normal faces away from the ray's origin: the ray hits its back.
    pub is_backface: bool,
}

impl SurfaceHit {
    /// The result of a ray that hits nothing.
    pub const MISS: Self = Self {
        distance: f32::INFINITY,
        id: u32::MAX,
        slot: 0,
        radius: 0.0,
        normal: Vec3::ZERO,
        color: Vec3::ZERO,
        surface: SurfaceKind::Points,
        is_backface: false,
    };

    /// True if nothing was hit.
    pub fn is_miss(&self) -> bool {
        self.id == u32::MAX
    }
}
