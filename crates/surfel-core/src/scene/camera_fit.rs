//! Cameras along a given direction that show all of a set of points.

use super::camera::{Camera, Projection};
use super::ground::ground_axes;
use crate::math::{DVec3, Vec3};

/// Settings of an automatic camera; everything else follows from the cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraFit {
    /// Unit vector to the zenith of the world.
    pub up: Vec3,
    /// Width over height of the picture.
    pub aspect: f64,
    /// True for an orthographic projection, false for a perspective one.
    pub is_orthographic: bool,
    /// Vertical angle of view in degrees of a perspective projection.
    pub view_angle_deg: f64,
    /// Direction of view; `None` chooses one from the points.
    pub direction: Option<DVec3>,
    /// Direction that is up in the picture; `None` takes [`default_view_up`].
    pub view_up: Option<DVec3>,
    /// Angle in degrees by which the chosen viewpoint is rotated about `up`, clockwise seen from above.
    pub azimuth_deg: f64,
    /// Elevation in degrees of the viewpoint above the horizon; `None` chooses it from the shape of the
    /// points.
    pub elevation_deg: Option<f64>,
    /// Zoom factor; values above 1 bring the camera nearer.
    pub zoom: f64,
    /// True if the camera goes around the points about `up`, and shows all of them from everywhere.
    pub is_turntable: bool,
}

impl Default for CameraFit {
    /// Returns a perspective of 35 degrees for a 16:9 picture with Z up, from a chosen viewpoint.
    fn default() -> Self {
        Self {
            up: Vec3::Z,
            aspect: 16.0 / 9.0,
            is_orthographic: false,
            view_angle_deg: 35.0,
            direction: None,
            view_up: None,
            azimuth_deg: 0.0,
            elevation_deg: None,
            zoom: 1.0,
            is_turntable: false,
        }
    }
}

/// Margin on each side of the picture, as a fraction of its size.
pub(super) const MARGIN: f64 = 0.04;

/// Returns the direction that is up in a picture seen along `forward`: the world's `up`, or north where the
/// view goes along `up`, as on a map.
pub fn default_view_up(up: Vec3, forward: DVec3) -> DVec3 {
    let is_along_up = forward.normalize_or_zero().cross(up.as_dvec3()).length() < 1e-3;
    let up = if is_along_up { ground_axes(up).1 } else { up };
    up.as_dvec3()
}

/// Returns the camera that looks along `forward` and shows all of `points`, in their coordinates.
pub(super) fn fit_along(forward: DVec3, points: &[Vec3], fit: &CameraFit) -> Camera {
    let view_up = fit.view_up.unwrap_or_else(|| default_view_up(fit.up, forward));
    let axes = Camera {
        position: DVec3::ZERO,
        focal_point: forward,
        view_up,
        projection: Projection::Orthographic { height: 1.0 },
    }
    .axes();
    let local: Vec<DVec3> =
        points.iter().map(|p| DVec3::from_array(axes.map(|axis| p.as_dvec3().dot(axis)))).collect();
    let (position, focal_point, projection) = fit_local(&local, fit);
    let from_local = |p: DVec3| p.x * axes[0] + p.y * axes[1] + p.z * axes[2];
    Camera {
        position: from_local(position),
        focal_point: from_local(focal_point),
        view_up,
        projection,
    }
}

/// Returns the position, focal point and projection that show all `points`, in the camera's own axes.
fn fit_local(points: &[DVec3], fit: &CameraFit) -> (DVec3, DVec3, Projection) {
    let low = points.iter().fold(DVec3::INFINITY, |all, p| all.min(*p));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |all, p| all.max(*p));
    let (center, size) = (0.5 * (low + high), (high - low).max(DVec3::splat(1e-6)));
    let scale = 1.0 / (1.0 - 2.0 * MARGIN) / fit.zoom;
    if fit.is_orthographic {
        let height = scale * size.y.max(size.x / fit.aspect);
        let position = center.with_z(low.z - size.length());
        return (position, center, Projection::Orthographic { height });
    }
    let tan = (fit.view_angle_deg.to_radians() / 2.0).tan();
    // All points must lie inside of each side plane of the view: p.x - x <= t (p.z - z) and its mirror
    // image bound x + t z and x - t z; one x and one z meet both with equality.
    let apex = |axis: usize, t: f64| {
        let right = points.iter().map(|p| p[axis] - t * p.z).fold(f64::MIN, f64::max);
        let left = points.iter().map(|p| p[axis] + t * p.z).fold(f64::MAX, f64::min);
        (0.5 * (left + right), (left - right) / (2.0 * t))
    };
    let (x, z_of_x) = apex(0, (1.0 - 2.0 * MARGIN) * tan * fit.aspect);
    let (y, z_of_y) = apex(1, (1.0 - 2.0 * MARGIN) * tan);
    let z = z_of_x.min(z_of_y).min(low.z - 1e-3 * size.length());
    let distance = (center.z - z) / fit.zoom;
    let focal_point = DVec3::new(x, y, center.z);
    (
        focal_point.with_z(center.z - distance),
        focal_point,
        Projection::Perspective { view_angle_deg: fit.view_angle_deg },
    )
}
