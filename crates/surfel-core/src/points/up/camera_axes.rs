//! The axes of a depth camera in whose own coordinates a cloud was measured.

use super::sample::sample;
use crate::math::Vec3;

/// Maximum tangent of the angle between the optical axis of a depth camera and a point that it sees.
const MAX_SLOPE: f32 = 1.2;
/// Minimum fraction of the points within the field of view of a depth camera.
const MIN_FRACTION_IN_VIEW: f64 = 0.99;

/// The axes of a depth camera at zero, with X to the right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CameraAxes {
    /// Y down and Z ahead, as in computer vision.
    YDown,
    /// Y up and Z to the back, as in computer graphics.
    YUp,
}

impl CameraAxes {
    /// Returns the axes of the depth camera whose field of view nearly all points lie in and fill. `offsets` are those of the
    /// points from the camera.
    pub fn of_points(offsets: &[Vec3]) -> Option<Self> {
        let sample = sample(offsets);
        let fits = |axes: &Self| {
            let seen: Vec<Vec3> = sample.iter().copied().filter(|p| axes.sees(*p)).collect();
            let fills_view = |axis: usize| {
                let slopes = seen.iter().map(|p| p[axis] / p.z);
                let (low, high) =
                    slopes.fold((0.0f32, 0.0f32), |(low, high), s| (low.min(s), high.max(s)));
                // The field of view is at least 20 degrees wide on both sides of the axis together.
                low < -0.05 && 0.05 < high && 0.35 < high - low
            };
            let are_seen = MIN_FRACTION_IN_VIEW * sample.len() as f64 <= seen.len() as f64;
            are_seen && fills_view(0) && fills_view(1)
        };
        [Self::YDown, Self::YUp].into_iter().find(fits)
    }

    /// Returns true if the camera sees a point at this offset from it.
    pub fn sees(self, offset: Vec3) -> bool {
        offset.x.abs().max(offset.y.abs()) < MAX_SLOPE * offset.dot(self.ahead())
    }

    /// Returns the direction of the view.
    pub fn ahead(self) -> Vec3 {
        match self {
            Self::YDown => Vec3::Z,
            Self::YUp => Vec3::NEG_Z,
        }
    }

    /// Returns the direction that is up if the camera is level.
    pub fn up(self) -> Vec3 {
        match self {
            Self::YDown => Vec3::NEG_Y,
            Self::YUp => Vec3::Y,
        }
    }
}

#[cfg(test)]
mod tests {
    //! A narrow beam of points.

    use super::*;
    use crate::math::Random;

    #[test]
    fn points_beside_the_view_of_a_depth_camera_do_not_widen_it() {
        let mut random = Random::new(6, 0);
        let mut next = || random.next_f32();
        let mut points = |width: f32| -> Vec<Vec3> {
            let point = |_| {
                let depth = 1.0 + 2.0 * next();
                let [x, y] = [next(), next()].map(|at| width * depth * (at - 0.5));
                Vec3::new(x, y, depth)
            };
            (0..5000).map(point).collect()
        };
        assert_eq!(CameraAxes::of_points(&points(1.0)), Some(CameraAxes::YDown));
        let mut beam = points(0.1);
        beam.extend([Vec3::new(-9.0, -9.0, 1.0), Vec3::new(9.0, 9.0, 1.0)]);
        assert_eq!(CameraAxes::of_points(&beam), None);
    }
}
