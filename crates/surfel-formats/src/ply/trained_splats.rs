//! Trained splats: the Gaussians of 3D Gaussian splatting (Kerbl et al. 2023). They keep the columns of the file, and get
//! those of the discs as which other surfaces show them.

use surfel_core::math::Vec3;
use surfel_core::points::{
    GAUSSIAN_COLUMNS, Gaussian, GaussianColumns, MAX_REST_COLUMNS, MIN_DISC_OPACITY, PointCloud,
    n_harmonics,
};

use super::header::{Element, Property};
use crate::error::Result;
use crate::file::Input;
use crate::options::LoadOptions;

/// Advice about compressed files of trained splats.
pub(crate) const SPLAT_ADVICE: &str = "export the splats as PLY (uncompressed, as training writes it), for instance with \
     SuperSplat";
/// Radius of a disc in standard deviations of its Gaussian: at 1.5, neighbours of a trained surface close.
const RADIUS_IN_DEVIATIONS: f32 = 1.5;

/// Returns true if vertices have the properties of trained splats.
pub(super) fn are_trained_splats(vertex: &Element) -> bool {
    GAUSSIAN_COLUMNS.into_iter().all(|name| has_property(vertex, name))
}

/// Returns what is wrong with vertices that have some properties of trained splats only, in words.
pub(super) fn incomplete_splats(vertex: &Element) -> Option<String> {
    let is_meant =
        ["f_dc_0", "scale_0", "rot_0"].into_iter().filter(|name| has_property(vertex, name));
    let missing: Vec<&str> =
        GAUSSIAN_COLUMNS.into_iter().filter(|name| !has_property(vertex, name)).collect();
    (2 <= is_meant.count() && !missing.is_empty()).then(|| {
        let missing = missing.join(" ");
        format!("read as plain points: trained splats also need the properties {missing}")
    })
}

/// Fails for the vertices of a compressed PLY, which have packed numbers in place of x, y and z.
pub(super) fn refuse_compressed(input: &Input, vertex: &Element) -> Result<()> {
    match has_property(vertex, "packed_position") {
        true => Err(input.unsupported("a compressed PLY of trained splats", SPLAT_ADVICE)),
        false => Ok(()),
    }
}

fn has_property(vertex: &Element, name: &str) -> bool {
    vertex.properties.iter().any(|property| property.name == name)
}

/// Returns true if all columns of Gaussians are to be kept.
pub(super) fn keeps_gaussians(options: &LoadOptions) -> bool {
    GAUSSIAN_COLUMNS.into_iter().all(|name| options.columns.keeps(name))
}

/// Gives trained splats the colour of all directions, a normal along the thinnest axis of their Gaussian and a radius by
/// the other two. Drops broken ones, and faint ones unless all Gaussians are kept. Returns a line about it.
pub(super) fn add_discs(cloud: &mut PointCloud, keeps_gaussians: bool) -> Option<String> {
    let columns = GaussianColumns::new(cloud)?;
    let n_splats = cloud.len();
    let is_kept = |gaussian: &Gaussian| keeps_gaussians || MIN_DISC_OPACITY <= gaussian.opacity;
    let mut n_broken = 0;
    let mut kept = Vec::with_capacity(n_splats);
    let (mut colors, mut normals, mut radii) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..n_splats {
        let gaussian = columns.gaussian(i);
        n_broken += usize::from(gaussian.is_none());
        let gaussian = gaussian.filter(is_kept);
        kept.push(gaussian.is_some());
        let Some(gaussian) = gaussian else { continue };
        colors.push(columns.color(i).map(|channel| (channel * 65535.0 + 0.5) as u16));
        normals.push(gaussian.thinnest_axis());
        radii.push(disc_radius(gaussian.deviations));
    }
    cloud.retain_from(0, &kept);
    let n_faint = n_splats - n_broken - cloud.len();
    let mut line = match keeps_gaussians {
        true => format!("{} trained splats", cloud.len()),
        false => format!(
            "trained splats are read as discs of one colour each; {n_faint} faint ones skipped"
        ),
    };
    if 0 < n_broken {
        line += &format!(
            "; {n_broken} broken ones skipped: numbers that are not finite, sizes beyond 1e15 or rotations of length 0"
        );
    }
    (cloud.colors, cloud.normals, cloud.radii) = (Some(colors), Some(normals), Some(radii));
    Some(line)
}

/// Returns words about the colours of trained splats.
pub(super) fn describe_colors(vertex: &Element) -> String {
    match harmonics_degree(vertex) {
        Some(0) => "colours are the same in all directions".into(),
        Some(degree) => format!("colours by spherical harmonics of degree {degree}"),
        None => format!(
            "colours are the same in all directions: {} properties f_rest, 9, 24 or {MAX_REST_COLUMNS} expected",
            n_rest(vertex)
        ),
    }
}

/// Returns the degree of the spherical harmonics of trained splats; `None` if their number is that of no degree.
pub(super) fn harmonics_degree(vertex: &Element) -> Option<u32> {
    n_harmonics(n_rest(vertex)).map(|n| n.isqrt() as u32 - 1)
}

fn n_rest(vertex: &Element) -> usize {
    let is_rest = |property: &&Property| property.name.starts_with("f_rest_");
    vertex.properties.iter().filter(is_rest).count()
}

fn disc_radius(deviations: Vec3) -> f32 {
    let mut sorted = deviations.to_array();
    sorted.sort_by(f32::total_cmp);
    RADIUS_IN_DEVIATIONS * (sorted[1] * sorted[2]).sqrt()
}

#[cfg(test)]
mod tests {
    //! The disc of a Gaussian.

    use super::*;

    #[test]
    fn a_disc_is_as_wide_as_the_two_larger_deviations() {
        assert_eq!(disc_radius(Vec3::new(2.0, 0.1, 8.0)), 6.0);
        assert_eq!(disc_radius(Vec3::new(2.0, 2.0, 1.0)), 3.0);
    }
}
