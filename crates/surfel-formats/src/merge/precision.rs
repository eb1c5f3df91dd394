//! The precision that a cloud keeps when its positions are f32 relative to another origin.

use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::PointCloud;

use crate::number_text::{format_number, format_vector};
use crate::options::FileInfo;

/// Bounds and resolution of a cloud before it is merged, from which the precision lost by merging follows.
pub(crate) struct CloudPrecision {
    /// Bounds in world coordinates; `lower` is beyond `upper` if there is no finite point.
    lower: DVec3,
    upper: DVec3,
    /// Smallest distance on each axis that the cloud resolves.
    resolution: DVec3,
}

impl CloudPrecision {
    /// Finds the bounds and the resolution of a cloud; the file's stated resolution takes precedence.
    pub fn new(cloud: &PointCloud, info: &FileInfo) -> Self {
        let finite = || cloud.positions.iter().filter(|position| position.is_finite());
        let lower = finite().copied().fold(Vec3::INFINITY, Vec3::min).as_dvec3() + cloud.origin;
        let upper = finite().copied().fold(Vec3::NEG_INFINITY, Vec3::max).as_dvec3() + cloud.origin;
        // The default holds because no scanner measures finer than a tenth of a millimetre, and few
        // pictures show less than a ten-thousandth of a small object.
        let size = Some((upper - lower).max_element()).filter(|size| 0.0 < *size && *size < 1.0);
        let resolution = info.resolution.unwrap_or(DVec3::splat(1e-4 * size.unwrap_or(1.0)));
        let own_step = step_about(cloud.origin, lower, upper);
        Self { lower, upper, resolution: resolution.max(own_step) }
    }

    /// Describes the resolution that f32 positions relative to `origin` lose; `None` if they lose none.
    pub fn loss_about_origin(&self, origin: DVec3) -> Option<String> {
        if !self.lower.cmple(self.upper).all() {
            return None;
        }
        let step = step_about(origin, self.lower, self.upper);
        let axis = (0..3)
            .filter(|axis| self.resolution[*axis] < step[*axis])
            .max_by(|a, b| step[*a].total_cmp(&step[*b]))?;
        Some(format!(
            "far from the common origin {}: its {} is rounded to steps of {}, coarser than its \
             resolution of {}; load files that lie far apart one by one",
            format_vector(origin),
            ["x", "y", "z"][axis],
            format_number(step[axis]),
            format_number(self.resolution[axis])
        ))
    }
}

/// Returns the distance between neighbouring f32 at the corner farthest from `origin`, on each axis.
fn step_about(origin: DVec3, lower: DVec3, upper: DVec3) -> DVec3 {
    let largest = (lower - origin).abs().max((upper - origin).abs()).as_vec3();
    let step = |value: f32| f64::from(value.next_up()) - f64::from(value);
    DVec3::new(step(largest.x), step(largest.y), step(largest.z))
}

#[cfg(test)]
mod tests {
    //! The resolution that positions lose when clouds far from each other are merged.

    use super::*;

    fn cloud(origin: f64) -> PointCloud {
        let positions = vec![Vec3::ZERO, Vec3::splat(10.0), Vec3::NAN];
        PointCloud { origin: DVec3::splat(origin), ..PointCloud::from_positions(positions) }
    }

    #[test]
    fn only_a_far_origin_loses_resolution() {
        let precision = CloudPrecision::new(&cloud(0.0), &FileInfo::default());
        assert_eq!(precision.loss_about_origin(DVec3::splat(100.0)), None);
        let loss = precision.loss_about_origin(DVec3::new(500_000.0, 4_900_000.0, 0.0)).unwrap();
        assert!(loss.contains("its y is rounded to steps of 0.5"), "{loss}");
        assert!(loss.contains("resolution of 0.0001"), "{loss}");
    }

    #[test]
    fn stated_resolution_is_the_measure_of_loss() {
        let info = FileInfo { resolution: Some(DVec3::ONE), ..FileInfo::default() };
        let far = DVec3::splat(4_900_000.0);
        assert_eq!(CloudPrecision::new(&cloud(0.0), &info).loss_about_origin(far), None);
        let empty = CloudPrecision::new(&PointCloud::default(), &info);
        assert_eq!(empty.loss_about_origin(DVec3::splat(1e9)), None);
    }
}
