//! The columns that preparation adds to a cloud or completes: normals, radii, structures and the surface variation.

use super::normals::orient::{Orientation, has_stations, orient};
use super::normals::planes::{NormalReport, PlaneFit, fill_missing};
use super::preparation::{Preparation, SURFACE_VARIATION};
use super::scan::scan_rings::ScanRings;
use super::structure::point_shape::{PointShape, STRUCTURE, Structure};
use super::{PointCloud, Scalar, Values};
use crate::error::Result;
use crate::math::Vec3;
use crate::progress::Progress;
use crate::words::counted;

/// Drops structures that lack the normals or the radii that they were found with, and then also these radii.
pub fn drop_parted_structures(cloud: &mut PointCloud, preparation: &Preparation) {
    let lacks_normals = cloud.normals.is_none() && preparation.estimates_normals;
    if (lacks_normals || cloud.radii.is_none()) && cloud.structures().is_some() {
        cloud.scalars.retain(|scalar| !scalar.name.eq_ignore_ascii_case(STRUCTURE));
        cloud.radii = None;
    }
}

/// Adds the column of structures, and gives the points of lines the direction of the line in place of a normal.
pub fn add_structures(cloud: &mut PointCloud, shapes: &[PointShape]) {
    let structures: Vec<Structure> = shapes.iter().map(|shape| shape.structure).collect();
    if let Some(normals) = &mut cloud.normals {
        for (normal, shape) in normals.iter_mut().zip(shapes) {
            if shape.structure == Structure::Line {
                *normal = shape.normal;
            }
        }
    }
    cloud.set_structures(&structures);
}

pub fn add_variation(cloud: &mut PointCloud, fits: &[PlaneFit]) {
    let values = Values::F32(fits.iter().map(|fit| fit.variation).collect());
    cloud.scalars.retain(|scalar| scalar.name != SURFACE_VARIATION);
    cloud.scalars.push(Scalar { name: SURFACE_VARIATION.to_owned(), values });
}

/// Returns the orientation of the preparation, or that toward the scanner if normals are missing altogether and rings show
/// where it stood.
pub fn orientation_by_rings(
    cloud: &PointCloud,
    preparation: &Preparation,
    rings: Option<&ScanRings>,
    progress: &dyn Progress,
) -> Orientation {
    match (preparation.orientation, rings) {
        (Orientation::Auto, Some(rings)) if cloud.normals.is_none() => {
            let [x, y, z] = rings.scanner.to_array();
            progress.choice(&format!("front sides toward the scanner at {x},{y},{z}"), &["orient"]);
            Orientation::Viewpoint(rings.scanner)
        }
        (orientation, _) => orientation,
    }
}

pub fn add_normals(
    cloud: &mut PointCloud,
    fits: &[PlaneFit],
    orientation: Orientation,
    progress: &dyn Progress,
) -> Result<NormalReport> {
    let Some(given) = cloud.normals.take() else {
        let mut normals = fits.iter().map(|fit| fit.normal).collect::<Vec<_>>();
        let report = fill_missing(&cloud.positions, &mut normals, progress)?;
        cloud.normals = Some(orient(cloud, normals, orientation, progress)?);
        return Ok(report);
    };
    // Each takes its sign from the nearest normal of the file; `select_points` leaves at least one.
    let mut normals = given.clone();
    fill_missing(&cloud.positions, &mut normals, progress)?;
    let mut report = NormalReport::default();
    for ((normal, given), fit) in normals.iter_mut().zip(&given).zip(fits) {
        if *given != Vec3::ZERO {
            continue;
        }
        if fit.normal == Vec3::ZERO {
            report.n_from_nearest += 1;
        } else {
            *normal = if normal.dot(fit.normal) < 0.0 { -fit.normal } else { fit.normal };
            report.n_estimated += 1;
        }
    }
    cloud.normals = Some(normals);
    Ok(report)
}

impl NormalReport {
    /// Leaves out the points of straight lines, which span no plane, and get the line's direction in place of a normal.
    pub(super) fn leave_out_lines(&mut self, fits: &[PlaneFit], shapes: &[PointShape]) {
        let is_straight = |(fit, shape): &(&PlaneFit, &PointShape)| {
            shape.structure == Structure::Line && fit.normal == Vec3::ZERO
        };
        let n_lines = fits.iter().zip(shapes).filter(is_straight).count();
        self.n_from_nearest = self.n_from_nearest.saturating_sub(n_lines);
        self.n_up = self.n_up.saturating_sub(n_lines);
    }
}

/// Orients the normals of the file by a rule that was chosen, and turns them to the stations, if these are known, by one
/// that is a default.
pub fn orient_given_normals(
    cloud: &mut PointCloud,
    orientation: Orientation,
    progress: &dyn Progress,
) -> Result<()> {
    let orientation = match orientation {
        Orientation::Auto | Orientation::Station if has_stations(cloud) => Orientation::Station,
        Orientation::Auto | Orientation::Station | Orientation::None => return Ok(()),
        chosen => chosen,
    };
    let Some(given) = cloud.normals.take() else { return Ok(()) };
    let oriented = orient(cloud, given.clone(), orientation, progress)?;
    let is_turned = |point: &usize| given[*point] != oriented[*point];
    let turned: Vec<usize> = (0..given.len()).filter(is_turned).collect();
    for offsets in cloud.morphs.iter_mut().filter_map(|morph| morph.normals.as_mut()) {
        turned.iter().for_each(|point| offsets[*point] = -offsets[*point]);
    }
    if !turned.is_empty() {
        let rule = match orientation {
            Orientation::Station => "toward the station of each scan",
            _ => "by the chosen rule",
        };
        let normals = counted(turned.len(), "normal");
        progress.choice(&format!("{normals} of the file turned {rule}"), &["orient"]);
    }
    cloud.normals = Some(oriented);
    Ok(())
}

pub fn add_radii(cloud: &mut PointCloud, estimated: Vec<f32>) {
    match &mut cloud.radii {
        None => cloud.radii = Some(estimated),
        Some(radii) => {
            let missing = radii.iter_mut().zip(estimated).filter(|(radius, _)| **radius == 0.0);
            missing.for_each(|(radius, estimated)| *radius = estimated);
        }
    }
}
