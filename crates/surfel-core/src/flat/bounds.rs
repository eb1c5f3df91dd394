//! Bounding boxes of blocks, computed from the points as kernels decode them.

use super::block::PointBlock;
use crate::math::{Aabb, Floats, Lanes, PortableLanes, Vec3};
use crate::points::CAPSULE_ASPECT;
use crate::surface::{SurfaceKind, leaves};

/// Relative margin of radii for rounding here and in the kernels.
const RADIUS_ROUNDING: f32 = 4e-6;
/// Relative margin of coordinates for rounding here and in the kernels.
const POSITION_ROUNDING: f32 = 4.0 * f32::EPSILON;

/// Returns a box that contains the shapes of all points of `block`.
pub(super) fn block_bounds(kind: SurfaceKind, block: &PointBlock) -> Aabb {
    let points = block.points::<PortableLanes>(Vec3::ZERO);
    let radius = points.radius * PortableLanes::splat(1.0 + RADIUS_ROUNDING);
    let center = [points.center.x, points.center.y, points.center.z];
    // The squares are integers below 2^20, so that sums and differences are exact. Normals of unused lanes are zero.
    let squares = [points.normal.x, points.normal.y, points.normal.z].map(|n| n * n);
    let length_squared = squares[0] + squares[1] + squares[2];
    let length_squared = length_squared.max(PortableLanes::splat(1.0));
    let mut bounds = Aabb::EMPTY;
    for axis in 0..3 {
        let across = ((length_squared - squares[axis]) / length_squared).sqrt();
        let extent = match kind {
            SurfaceKind::Capsule => {
                let along = (squares[axis] / length_squared).sqrt();
                let thickness = radius * PortableLanes::splat(1.0 / CAPSULE_ASPECT);
                (radius - thickness) * along + thickness
            }
            SurfaceKind::Leaves => radius * PortableLanes::splat(leaves::REACH),
            _ if kind.uses_discs() => radius * across,
            _ => radius,
        };
        let extent = extent + radius * PortableLanes::splat(RADIUS_ROUNDING);
        bounds.min[axis] =
            (center[axis] - extent).store().into_iter().fold(f32::INFINITY, f32::min);
        bounds.max[axis] =
            (center[axis] + extent).store().into_iter().fold(f32::NEG_INFINITY, f32::max);
    }
    let padding = POSITION_ROUNDING * bounds.min.abs().max(bounds.max.abs());
    Aabb { min: bounds.min - padding, max: bounds.max + padding }
}

#[cfg(test)]
mod tests {
    //! Boxes of single points.

    use super::*;
    use crate::flat::block::BlockPoint;

    #[test]
    fn the_box_of_a_capsule_is_no_wider_than_the_capsule() {
        for (normal, size) in [
            (Vec3::X, Vec3::new(2.0, 0.5, 0.5)),
            (Vec3::new(0.0, 0.6, -0.8), Vec3::new(0.5, 1.4, 1.7)),
        ] {
            let point = BlockPoint { position: Vec3::ZERO, normal, radius: 1.0, color: [0; 3] };
            let bounds = block_bounds(SurfaceKind::Capsule, &PointBlock::new(&[point]));
            assert!(bounds.size().distance(size) < 0.01, "{bounds:?}");
            assert!(bounds.size().cmpge(size - 0.005).all(), "{bounds:?}");
        }
    }
}
