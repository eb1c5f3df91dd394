//! A stone shape put in its place, worn by weather and perhaps broken.

use super::noise::{fbm, noise, smoothstep, unit};
use super::site::{Bounds, Solid};
use super::stone;
use crate::math::DVec3;
use crate::math::Vec3;

/// Where a shape's own frame stands in the world.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    pub position: DVec3,
    /// The shape's x, y and z axes in the world; orthonormal.
    pub axes: [DVec3; 3],
}

/// The break of a shape: all beyond the plane `normal . x = offset` of its own frame is gone.
#[derive(Clone, Copy, Debug)]
pub struct Break {
    pub normal: DVec3,
    pub offset: f64,
}

/// `shape` with pitted faces, chips and an optional break.
pub struct Weathered<S> {
    pub shape: S,
    pub pose: Pose,
    pub broken: Option<Break>,
    pub seed: u64,
}

impl Pose {
    /// Standing upright, turned about Z.
    pub fn upright(position: DVec3, yaw_rad: f64) -> Self {
        let (sin, cos) = yaw_rad.sin_cos();
        Self { position, axes: [DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z] }
    }

    /// Leaning from upright by `tilt_rad` toward the direction `yaw_rad`; a quarter turn lies flat.
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

impl<S: Solid> Weathered<S> {
    /// Depth that weather has taken off the face at `local`.
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

impl<S: Solid> Solid for Weathered<S> {
    fn distance(&self, point: DVec3) -> f64 {
        let local = self.pose.local(point);
        let whole = self.shape.distance(local);
        // Wear only takes away: far off, the distance to the whole shape is short enough.
        if 0.1 < whole {
            return whole;
        }
        // 0.75 makes up for the slope of the wear.
        (0.75 * (whole + self.wear(local))).max(self.beyond_break(local))
    }

    fn color(&self, point: DVec3, normal: DVec3) -> Vec3 {
        let fresh = self.shape.color(self.pose.local(point), normal);
        stone::weathered(fresh, point, normal)
    }

    fn bounds(&self) -> Bounds {
        let corners = self.shape.bounds().corners().map(|corner| self.pose.world(corner));
        Bounds {
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
    use super::*;

    #[test]
    fn poses_go_there_and_back() {
        let pose = Pose::leaning(DVec3::new(1.0, -2.0, 0.5), 0.7, 1.2);
        let point = DVec3::new(0.3, 4.0, -1.0);
        assert!((pose.local(pose.world(point)) - point).length() < 1e-12);
    }
}
