//! Coordinates as their file has them: a cloud holds them as offsets from an origin, which f32 rounds.

use surfel_core::points::PointCloud;
use surfel_formats::FileInfo;

/// Greatest number of decimals that a file is taken to have.
const MAX_DECIMALS: usize = 9;

/// A coordinate of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coordinate {
    /// The coordinate as the file has it, as far as the cloud can tell.
    pub value: f64,
    /// Number of decimals, if the file states a step between coordinates.
    pub decimals: Option<usize>,
}

/// Returns the coordinates of a point in its file.
pub fn coordinates(cloud: &PointCloud, point_idx: usize, info: &FileInfo) -> [Coordinate; 3] {
    let offsets = cloud.positions[point_idx].to_array();
    let world = cloud.world_position(point_idx).to_array();
    let las_offset = info.las.as_ref().map(|las| las.offset);
    [0, 1, 2].map(|axis| {
        let certain = n_certain_decimals(offsets[axis]);
        if let Some(step) = info.resolution {
            let of_offset = las_offset.map_or(0, |offset| n_decimals(offset[axis]));
            let n = n_decimals(step[axis]).max(of_offset).min(certain);
            return Coordinate { value: rounded(world[axis], n), decimals: Some(n) };
        }
        let value = match cloud.origin[axis] == 0.0 {
            true => shortest(offsets[axis]),
            false => rounded(world[axis], certain),
        };
        Coordinate { value, decimals: None }
    })
}

/// Returns the value with the fewest digits that is still this f32.
pub fn shortest(value: f32) -> f64 {
    value.to_string().parse().expect("a written number is a number")
}

/// Returns the number of decimals with which a number is written.
fn n_decimals(value: f64) -> usize {
    let is_exact = |n: &usize| {
        let scaled = value * 10f64.powi(*n as i32);
        (scaled - scaled.round()).abs() < 1e-6
    };
    (0..MAX_DECIMALS).find(is_exact).unwrap_or(MAX_DECIMALS)
}

/// Returns the number of decimals that a value near this one keeps as f32.
fn n_certain_decimals(value: f32) -> usize {
    let gap = f64::from(value.abs().next_up() - value.abs());
    (-gap.log10()).floor().clamp(0.0, MAX_DECIMALS as f64) as usize
}

fn rounded(value: f64, n_decimals: usize) -> f64 {
    format!("{value:.n_decimals$}").parse().expect("a written number is a number")
}

#[cfg(test)]
mod tests {
    //! Coordinates of files with and without a step.

    use super::*;
    use surfel_core::math::{DVec3, Vec3};
    use surfel_formats::LasProfile;

    fn cloud(origin: DVec3, position: DVec3) -> PointCloud {
        let offset = (position - origin).as_vec3();
        PointCloud { origin, ..PointCloud::from_positions(vec![offset]) }
    }

    #[test]
    fn coordinates_of_a_survey_are_multiples_of_its_step() {
        let position = DVec3::new(484_913.10, 6_632_700.07, 107.254);
        let cloud = cloud(DVec3::new(484_800.0, 6_632_000.0, 0.0), position);
        let mut info = FileInfo {
            resolution: Some(DVec3::new(0.01, 0.01, 0.001)),
            las: Some(LasProfile::default()),
            ..FileInfo::default()
        };
        let expected = [(484_913.1, 2), (6_632_700.07, 2), (107.254, 3)];
        let expected = expected.map(|(value, n)| Coordinate { value, decimals: Some(n) });
        assert_eq!(coordinates(&cloud, 0, &info), expected);
        // An offset may have more decimals than the step, and the cloud fewer.
        info.resolution = Some(DVec3::splat(1.0));
        info.las = Some(LasProfile {
            offset: DVec3::new(0.1, 0.0, 0.123_456_789),
            ..LasProfile::default()
        });
        let found = coordinates(&cloud, 0, &info);
        assert_eq!(found.map(|coordinate| coordinate.decimals), [Some(1), Some(0), Some(5)]);
    }

    #[test]
    fn coordinates_without_a_step_have_the_digits_that_the_cloud_holds() {
        let text = DVec3::new(484_913.123, 2.5, -0.07);
        let shifted = cloud(DVec3::new(484_900.0, 0.0, 10.0), text);
        let values = |cloud| coordinates(cloud, 0, &FileInfo::default()).map(|c| c.value);
        assert_eq!(values(&shifted), [484_913.123, 2.5, -0.07]);
        let of_floats = PointCloud::from_positions(vec![Vec3::new(0.1, 123.456_79, 1e-7)]);
        assert_eq!(values(&of_floats), [0.1, 123.456_79, 1e-7]);
    }
}
