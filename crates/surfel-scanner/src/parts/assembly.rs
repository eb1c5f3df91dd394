//! Objects put together from ellipsoids, capsules and boxes.

use super::masonry::box_distance;
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// A solid of an assembly.
#[derive(Clone, Copy, Debug)]
pub enum Solid {
    /// An ellipsoid with half axes along X, Y and Z.
    Ellipsoid {
        /// Centre.
        center: DVec3,
        /// Half axes.
        half: DVec3,
    },
    /// All points within a radius of a line segment.
    Capsule {
        /// Ends of the segment.
        ends: [DVec3; 2],
        /// Radius.
        radius: f64,
    },
    /// A box with rounded edges.
    Box {
        /// Centre.
        center: DVec3,
        /// Half sizes, with the rounding.
        half: DVec3,
        /// Radius of the edges.
        rounding: f64,
    },
}

/// A union of solids with one colour.
#[derive(Clone, Debug)]
pub struct Assembly {
    /// The solids.
    pub solids: Vec<Solid>,
    /// Distance within which solids melt into each other; 0 gives sharp creases.
    pub blend: f64,
    /// sRGB-encoded colour.
    pub color: Vec3,
    /// ASPRS class.
    pub class: u8,
}

impl Solid {
    /// Creates a box with sharp edges.
    pub fn block(center: [f64; 3], half: [f64; 3]) -> Self {
        Self::Box { center: center.into(), half: half.into(), rounding: 0.0 }
    }

    /// Creates a capsule.
    pub fn capsule(from: [f64; 3], to: [f64; 3], radius: f64) -> Self {
        Self::Capsule { ends: [from.into(), to.into()], radius }
    }

    /// Creates an ellipsoid.
    pub fn ellipsoid(center: [f64; 3], half: [f64; 3]) -> Self {
        Self::Ellipsoid { center: center.into(), half: half.into() }
    }

    /// Returns the signed distance to the surface.
    pub fn distance(&self, point: DVec3) -> f64 {
        match *self {
            Self::Ellipsoid { center, half } => ellipsoid_distance(point - center, half),
            Self::Capsule { ends, radius } => segment_distance(point, ends) - radius,
            Self::Box { center, half, rounding } => {
                box_distance(point - center, half - DVec3::splat(rounding)) - rounding
            }
        }
    }

    fn bounds(&self) -> DAabb {
        match *self {
            Self::Ellipsoid { center, half } | Self::Box { center, half, .. } => {
                DAabb::around(center, half)
            }
            Self::Capsule { ends: [a, b], radius } => {
                DAabb { min: a.min(b) - DVec3::splat(radius), max: a.max(b) + DVec3::splat(radius) }
            }
        }
    }
}

impl Sdf for Assembly {
    fn distance(&self, point: DVec3) -> f64 {
        let distances = self.solids.iter().map(|solid| solid.distance(point));
        distances.fold(f64::INFINITY, |a, b| smooth_min(a, b, self.blend))
    }

    fn color(&self, _point: DVec3, _normal: DVec3) -> Vec3 {
        self.color
    }

    fn bounds(&self) -> DAabb {
        let empty = DAabb { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };
        let union = |all: DAabb, solid: &Solid| {
            let bounds = solid.bounds();
            DAabb { min: all.min.min(bounds.min), max: all.max.max(bounds.max) }
        };
        let DAabb { min, max } = self.solids.iter().fold(empty, union);
        // Blended solids bulge by at most a quarter of the blend per pair.
        let margin = DVec3::splat(self.blend + 1e-6);
        DAabb { min: min - margin, max: max + margin }
    }

    fn class(&self) -> u8 {
        self.class
    }
}

/// Returns the distance to a line segment.
pub fn segment_distance(point: DVec3, [a, b]: [DVec3; 2]) -> f64 {
    let (along, offset) = (b - a, point - a);
    let fraction = (offset.dot(along) / along.length_squared()).clamp(0.0, 1.0);
    (offset - fraction * along).length()
}

/// Returns a lower bound of the distance to an ellipsoid about the origin.
fn ellipsoid_distance(point: DVec3, half: DVec3) -> f64 {
    ((point / half).length() - 1.0) * half.min_element()
}

/// Returns the smaller of two distances, and less where they are nearly equal (the quadratic smooth minimum).
fn smooth_min(a: f64, b: f64, blend: f64) -> f64 {
    let overlap = (blend - (a - b).abs()).max(0.0);
    let dip = if overlap == 0.0 { 0.0 } else { overlap * overlap / (4.0 * blend) };
    a.min(b) - dip
}

#[cfg(test)]
mod tests {
    //! Distances of solids and of their blends.

    use super::*;

    #[test]
    fn distances_are_zero_on_the_surface_of_each_solid() {
        let solids = [
            (Solid::ellipsoid([1.0, 0.0, 0.0], [1.0, 2.0, 0.5]), [1.0, 2.0, 0.0]),
            (Solid::capsule([0.0; 3], [0.0, 0.0, 4.0], 0.5), [0.3, 0.4, 1.0]),
            (Solid::block([0.0, 0.0, 1.0], [1.0, 2.0, 1.0]), [1.0, 0.5, 1.5]),
        ];
        for (solid, on_surface) in solids {
            assert!(solid.distance(on_surface.into()).abs() < 1e-12, "{solid:?}");
        }
    }

    #[test]
    fn blending_fills_the_crease_between_solids() {
        let solids =
            vec![Solid::ellipsoid([0.0; 3], [1.0; 3]), Solid::ellipsoid([1.5, 0.0, 0.0], [1.0; 3])];
        let sharp = Assembly { solids, blend: 0.0, color: Vec3::ONE, class: 1 };
        let smooth = Assembly { blend: 0.3, ..sharp.clone() };
        let crease = DVec3::new(0.75, 0.0, 0.7);
        assert!(smooth.distance(crease) < sharp.distance(crease) - 0.05);
        let far = DVec3::new(-3.0, 0.0, 0.0);
        assert_eq!(smooth.distance(far), sharp.distance(far));
    }
}
