//! Offsets of the estimated normals and radii in morph targets.

use super::estimate::{Missing, estimate};
use super::preparation::Preparation;
use super::radii::curvature::radii_by_curvature;
use super::radii::radius::Radius;
use super::{Morph, PointCloud};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::normals::planes::PlaneFit;
use crate::progress::Progress;

/// Adds offsets of the estimated normals and radii to each morph target: the estimates from the positions of the
/// target minus those at rest. In between both change linearly, as positions do.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn add_morph_offsets(
    cloud: &mut PointCloud,
    estimated: &Missing,
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<()> {
    let PointCloud { positions, normals, radii, morphs, .. } = cloud;
    if !(estimated.normals || estimated.radii) {
        return Ok(());
    }
    let progress = WithoutNotes(progress);
    for morph in morphs {
        let moved: Vec<Vec3> = positions.iter().zip(&morph.positions).map(|(a, b)| a + b).collect();
        if !moved.iter().all(|position| position.is_finite()) {
            continue;
        }
        let estimates = estimate(&moved, None, preparation, estimated, &progress)?;
        if let (Some((fits, _)), Some(normals)) = (estimates.fits, &*normals) {
            let added = |(fit, normal): (&PlaneFit, &Vec3)| match fit.normal {
                // Without a plane at the target, the normal stays; otherwise it keeps its side.
                Vec3::ZERO => Vec3::ZERO,
                found if found.dot(*normal) < 0.0 => -found - normal,
                found => found - normal,
            };
            morph.normals = Some(fits.iter().zip(normals).map(added).collect());
        }
        if let (Some((moved_radii, _)), Some(radii)) = (estimates.radii, &*radii) {
            let moved_radii = match (preparation.radius, &*normals) {
                (Radius::Curvature { k }, Some(normals)) => {
                    let moved_normals = moved_normals(normals, morph);
                    radii_by_curvature(&moved, &moved_normals, &moved_radii, k, &progress)?
                }
                _ => moved_radii,
            };
            let added = moved_radii.iter().zip(radii).map(|(moved, radius)| moved - radius);
            morph.radii = Some(added.collect());
        }
    }
    Ok(())
}

/// Returns the unit normals at a morph target, zero where they are not known.
fn moved_normals(normals: &[Vec3], morph: &Morph) -> Vec<Vec3> {
    let Some(offsets) = &morph.normals else { return normals.to_vec() };
    let moved = normals.iter().zip(offsets).map(|(normal, offset)| normal + offset);
    moved.map(Vec3::normalize_or_zero).collect()
}

/// Drops the notes about points of morph targets.
struct WithoutNotes<'a>(&'a dyn Progress);

impl Progress for WithoutNotes<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.0.begin(stage, total);
    }

    fn advance(&self, units: u64) {
        self.0.advance(units);
    }

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    //! Radii of a target that is known.

    use super::*;
    use crate::math::Random;
    use crate::points::prepare;
    use crate::progress::NoProgress;

    #[test]
    fn radii_by_curvature_grow_with_the_cloud_in_its_morph_targets() {
        let mut random = Random::new(5, 0);
        let mut direction =
            || Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32));
        let ball: Vec<Vec3> = (0..200).map(|_| direction().normalize()).collect();
        let mut cloud = PointCloud::from_positions(ball.clone());
        // The target is twice as large.
        cloud.morphs = vec![Morph { positions: ball, ..Morph::default() }];
        let radius = Radius::Curvature { k: 12 };
        let preparation = Preparation { radius, ..Preparation::default() };
        let cloud = prepare(cloud, &preparation, &NoProgress).unwrap().0;
        let added = cloud.morphs[0].radii.as_ref().unwrap();
        for (added, radius) in added.iter().zip(cloud.radii()) {
            assert!((added / radius - 1.0).abs() < 1e-4, "{added} {radius}");
        }
    }
}
