//! A placed stone shape, worn by weather and perhaps broken.

use super::stone;
use crate::noise::{fbm, noise, smoothstep, unit};
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// The rigid transform of a shape's own frame.
#[derive(Clone, Copy, Debug)]
pub struct LocalFrame {
    /// Origin of the frame in the scene.
    pub position: DVec3,
    /// Orthonormal x, y and z axes of the frame in the scene.
    pub axes: [DVec3; 3],
}

/// A break of a shape, which removes everything beyond the plane `normal . x = offset` of its own frame.
#[derive(Clone, Copy, Debug)]
pub struct Break {
    /// Unit normal.
    pub normal: DVec3,
    /// Offset along the normal.
    pub offset: f64,
}

/// A shape with pitted faces, chips and an optional break.
pub struct Weathered<S> {
    /// The shape.
    pub shape: S,
    /// Position and axes of the shape.
    pub frame: LocalFrame,
    /// The break, if the shape is broken.
    pub broken: Option<Break>,
    /// Seed of the wear.
    pub seed: u64,
}

impl LocalFrame {
    /// Creates the frame of an upright shape, rotated about Z.
    pub fn upright(position: DVec3, yaw_rad: f64) -> Self {
        let (sin, cos) = yaw_rad.sin_cos();
        Self { position, axes: [DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z] }
    }

    /// Creates the frame of a shape that leans by `tilt_rad` toward the direction `yaw_rad`. A quarter turn lies flat.
    pub fn leaning(position: DVec3, yaw_rad: f64, tilt_rad: f64) -> Self {
        let Self { axes: [ahead, side, up], .. } = Self::upright(position, yaw_rad);
        let (sin, cos) = tilt_rad.sin_cos();
        Self { position, axes: [cos * ahead - sin * up, side, cos * up + sin * ahead] }
    }

    fn local(&self, world: DVec3) -> DVec3 {
        let offset = world - self.position;
        DVec3::from(self.axes.map(|axis| axis.dot(offset)))
    }

    fn world(&self, local: DVec3) -> DVec3 {
        let [x, y, z] = self.axes;
        self.position + local.x * x + local.y * y + local.z * z
    }
}

impl<S: Sdf> Weathered<S> {
    /// Returns the depth of wear of the face at `local`.
    fn wear(&self, local: DVec3) -> f64 {
        let shifted = local + DVec3::splat(100.0 * unit(self.seed));
        let chips = smoothstep(0.35, 0.8, noise(shifted * 2.6));
        0.008 * (1.0 + fbm(shifted * 8.0, 2)) + 0.06 * chips
    }

    fn beyond_break(&self, local: DVec3) -> f64 {
        let Some(Break { normal, offset }) = self.broken else { return f64::NEG_INFINITY };
        let rough = fbm(local * 2.3 + DVec3::splat(100.0 * unit(self.seed)), 3);
        0.6 * (normal.dot(local) - offset + 0.3 * rough)
    }
}

impl<S: Sdf> Sdf for Weathered<S> {
    fn distance(&self, point: DVec3) -> f64 {
        let local = self.frame.local(point);
        let whole = self.shape.distance(local);
        // Wear only removes stone, so at a distance the whole shape gives a short enough distance.
        if 0.1 < whole {
            return whole;
        }
        // The factor compensates for the slope of the wear.
        (0.75 * (whole + self.wear(local))).max(self.beyond_break(local))
    }

    fn color(&self, point: DVec3, normal: DVec3) -> Vec3 {
        let fresh = self.shape.color(self.frame.local(point), normal);
        stone::weathered(fresh, point, normal)
    }

    fn bounds(&self) -> DAabb {
        let corners = self.shape.bounds().corners().map(|corner| self.frame.world(corner));
        DAabb {
            min: corners.into_iter().fold(DVec3::INFINITY, DVec3::min),
            max: corners.into_iter().fold(DVec3::NEG_INFINITY, DVec3::max),
        }
    }

    fn class(&self) -> u8 {
        self.shape.class()
    }
}

#[cfg(test)]
mod tests {
    //! Transforms of shapes.

    use super::*;

    #[test]
    fn transforms_are_inverse() {
        let frame = LocalFrame::leaning(DVec3::new(1.0, -2.0, 0.5), 0.7, 1.2);
        let point = DVec3::new(0.3, 4.0, -1.0);
        assert!((frame.local(frame.world(point)) - point).length() < 1e-12);
    }
}
