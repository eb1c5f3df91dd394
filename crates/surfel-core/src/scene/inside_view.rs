//! Views from within a cloud.

use super::camera::{Camera, Projection};
use crate::math::{DVec3, Vec3};

/// A view from within a cloud: from the station of its scanner, or along a tunnel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InsideView {
    /// World position of the camera.
    pub position: DVec3,
    /// Unit vector into the longest view.
    pub direction: DVec3,
    /// Distance of what the camera looks at: the median of the points seen from a station.
    pub distance: f64,
    /// Vertical angle of view in degrees.
    pub view_angle_deg: f64,
}

impl InsideView {
    /// Returns the camera with its own angle of view unless `view_angle_deg` is given.
    pub fn camera(&self, up: Vec3, view_angle_deg: Option<f64>) -> Camera {
        Camera {
            position: self.position,
            focal_point: self.position + self.distance * self.direction,
            view_up: up.as_dvec3(),
            projection: Projection::Perspective {
                view_angle_deg: view_angle_deg.unwrap_or(self.view_angle_deg),
            },
        }
    }
}
