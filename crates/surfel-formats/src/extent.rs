//! How far a cloud's points lie from an origin, and what f32 about it keeps of them.

use surfel::math::{DVec3, Vec3};
use surfel::points::PointCloud;

use crate::number::{number, numbers};
use crate::options::Source;

/// What has to be known of a cloud before it is merged, to tell what was lost.
pub(crate) struct Extent {
    /// Corners in the world; the lower is beyond the upper if there is no finite point.
    lower: DVec3,
    upper: DVec3,
    /// Smallest distance on each axis that the cloud itself can be relied on to tell apart.
    resolution: DVec3,
}

impl Extent {
    pub fn of(cloud: &PointCloud, source: &Source) -> Self {
        let finite = || cloud.positions.iter().filter(|position| position.is_finite());
        let lower = finite().copied().fold(Vec3::INFINITY, Vec3::min).as_dvec3() + cloud.origin;
        let upper = finite().copied().fold(Vec3::NEG_INFINITY, Vec3::max).as_dvec3() + cloud.origin;
        // Where none is stated: no scanner measures finer than a tenth of a millimetre, and few
        // pictures show less than a ten-thousandth of a small object.
        let size = Some((upper - lower).max_element()).filter(|size| 0.0 < *size && *size < 1.0);
        let resolution = source.resolution.unwrap_or(DVec3::splat(1e-4 * size.unwrap_or(1.0)));
        let own_step = step_about(cloud.origin, lower, upper);
        Self { lower, upper, resolution: resolution.max(own_step) }
    }

    /// In words, the resolution that is lost by positions in f32 about `origin`.
    pub fn loss_about(&self, origin: DVec3) -> Option<String> {
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
            numbers(origin),
            ["x", "y", "z"][axis],
            number(step[axis]),
            number(self.resolution[axis])
        ))
    }
}

/// The distance between neighbouring f32 at the corner farthest from `origin`.
fn step_about(origin: DVec3, lower: DVec3, upper: DVec3) -> DVec3 {
    let reach = (lower - origin).abs().max((upper - origin).abs()).as_vec3();
    let step = |reach: f32| f64::from(reach.next_up()) - f64::from(reach);
    DVec3::new(step(reach.x), step(reach.y), step(reach.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(origin: f64) -> PointCloud {
        let positions = vec![Vec3::ZERO, Vec3::splat(10.0), Vec3::NAN];
        PointCloud { origin: DVec3::splat(origin), ..PointCloud::from_positions(positions) }
    }

    #[test]
    fn a_far_origin_loses_resolution_and_a_near_one_none() {
        let extent = Extent::of(&cloud(0.0), &Source::default());
        assert_eq!(extent.loss_about(DVec3::splat(100.0)), None);
        let loss = extent.loss_about(DVec3::new(500_000.0, 4_900_000.0, 0.0)).unwrap();
        assert!(loss.contains("its y is rounded to steps of 0.5"), "{loss}");
        assert!(loss.contains("resolution of 0.0001"), "{loss}");
    }

    #[test]
    fn a_stated_resolution_is_what_has_to_be_kept() {
        let source = Source { resolution: Some(DVec3::ONE), ..Source::default() };
        let far = DVec3::splat(4_900_000.0);
        assert_eq!(Extent::of(&cloud(0.0), &source).loss_about(far), None);
        let empty = Extent::of(&PointCloud::default(), &source);
        assert_eq!(empty.loss_about(DVec3::splat(1e9)), None);
    }
}
