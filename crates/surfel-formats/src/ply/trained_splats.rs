//! Trained splats: the Gaussians of 3D Gaussian splatting (Kerbl et al. 2023), which become discs.

use surfel_core::math::{Quat, Vec3};
use surfel_core::points::PointCloud;

use super::header::Element;

/// Properties that a disc is made of, besides its position.
pub(super) const PROPERTIES: [&str; 11] = [
    "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
    "rot_2", "rot_3",
];

/// Constant of the spherical harmonics of degree 0, which the colours are factors of.
const SH_DEGREE_0: f64 = 0.282_094_791_773_878_14;
/// Minimum opacity of a splat that is shown: fainter ones are haze between surfaces.
const MIN_OPACITY: f64 = 0.1;
/// Radius of a disc in standard deviations of its Gaussian: at 1.5, neighbours of a trained surface close.
const RADIUS_IN_DEVIATIONS: f32 = 1.5;

/// Returns true if vertices have the properties of trained splats.
pub(super) fn are_trained_splats(vertex: &Element) -> bool {
    let has = |name: &str| vertex.properties.iter().any(|property| property.name == name);
    PROPERTIES.into_iter().all(has)
}

/// Gives points with the properties of trained splats a colour, a normal along the thinnest axis of their Gaussian and
/// a radius by the other two. Drops the faint ones, and returns how many these are.
///
/// The colour is that of all directions, without the part that depends on the view.
pub(super) fn into_discs(cloud: &mut PointCloud) -> usize {
    let [color_0, color_1, color_2, opacity, scales @ .., rot_0, rot_1, rot_2, rot_3] =
        PROPERTIES.map(|name| cloud.scalar(name));
    let (Some(red), Some(green), Some(blue), Some(opacity)) = (color_0, color_1, color_2, opacity)
    else {
        return 0;
    };
    let [Some(scale_x), Some(scale_y), Some(scale_z)] = scales else { return 0 };
    let (Some(w), Some(x), Some(y), Some(z)) = (rot_0, rot_1, rot_2, rot_3) else { return 0 };
    let indices = 0..cloud.len();
    let channel = |value: f64| ((0.5 + SH_DEGREE_0 * value) * 65535.0 + 0.5) as u16;
    let colors = indices.clone().map(|i| [red, green, blue].map(|column| channel(column.get(i))));
    let discs = indices.clone().map(|i| {
        let deviations = [scale_x, scale_y, scale_z].map(|column| column.get(i).exp() as f32);
        let [w, x, y, z] = [w, x, y, z].map(|column| column.get(i) as f32);
        disc(deviations, Quat::from_xyzw(x, y, z, w))
    });
    let (normals, radii): (Vec<Vec3>, Vec<f32>) = discs.unzip();
    let is_shown = |i: usize| MIN_OPACITY <= 1.0 / (1.0 + (-opacity.get(i)).exp());
    let shown: Vec<bool> = indices.map(is_shown).collect();
    (cloud.colors, cloud.normals, cloud.radii) =
        (Some(colors.collect()), Some(normals), Some(radii));
    cloud.retain_from(0, &shown);
    shown.len() - cloud.len()
}

/// Returns normal and radius of the disc of a Gaussian with these standard deviations along its axes.
fn disc(deviations: [f32; 3], rotation: Quat) -> (Vec3, f32) {
    let mut axes = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().zip(deviations).collect::<Vec<_>>();
    axes.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    let length = rotation.length();
    let rotation =
        if 0.0 < length && length.is_finite() { rotation.normalize() } else { Quat::IDENTITY };
    (rotation * axes[0].0, RADIUS_IN_DEVIATIONS * (axes[1].1 * axes[2].1).sqrt())
}

#[cfg(test)]
mod tests {
    //! The disc of a Gaussian.

    use super::*;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn a_disc_lies_across_the_thinnest_axis() {
        let (normal, radius) = disc([2.0, 0.1, 8.0], Quat::from_rotation_z(2.0 * FRAC_PI_2 / 2.0));
        // The y axis is turned to -x.
        assert!(normal.distance(-Vec3::X) < 1e-6, "{normal}");
        assert_eq!(radius, 6.0);
        assert_eq!(disc([1.0, 2.0, 2.0], Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)).0, Vec3::X);
    }
}
