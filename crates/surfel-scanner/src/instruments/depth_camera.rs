//! Depth cameras: grids of depths whose noise grows with the square of the depth.

use super::instrument::{Instrument, check, check_not_negative, check_positive, check_size};
use super::returns::{Return, into_cloud};
use crate::sdf::{DRay, SdfScene};
use rayon::prelude::*;
use std::f64::consts::PI;
use surfel_core::Result;
use surfel_core::math::Random;
use surfel_core::math::{DMat3, DQuat, DVec3};
use surfel_core::points::{PointCloud, ScanStation};
use surfel_core::progress::Progress;

/// A depth camera and the poses that it is held in.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthCamera {
    /// Positions, each with the position that it looks at.
    pub poses: Vec<(DVec3, DVec3)>,
    /// Width of a picture in pixels.
    pub width: usize,
    /// Height of a picture in pixels.
    pub height: usize,
    /// Vertical field of view in radians.
    pub view_angle_rad: f64,
    /// Standard deviation of a depth of one metre, in metres.
    pub noise_at_1_m: f64,
    /// Width in pixels of the windows by which disparities are measured; noise in pixels nearer than that is alike.
    pub window: usize,
    /// Step between depths at one metre, in metres; it grows with the square of the depth, as that of disparities.
    pub step_at_1_m: f64,
    /// Maximum depth in metres.
    pub max_depth: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for DepthCamera {
    /// Returns a camera of 320 x 240 pixels without poses.
    fn default() -> Self {
        Self {
            poses: Vec::new(),
            width: 320,
            height: 240,
            view_angle_rad: 48f64.to_radians(),
            noise_at_1_m: 0.0012,
            window: 1,
            step_at_1_m: 0.0008,
            max_depth: 8.0,
            seed: 1,
        }
    }
}

/// Maximum width of the windows by which disparities are measured.
const MAX_WINDOW: usize = 64;

/// The axes of a pose: right, up, ahead.
fn axes((position, target): (DVec3, DVec3)) -> [DVec3; 3] {
    let ahead = (target - position).normalize();
    let right = ahead.cross(DVec3::Z).normalize();
    [right, right.cross(ahead), ahead]
}

/// Returns the station of a pose, whose axes are those of computer vision: X to the right, Y down, Z ahead.
fn station(pose: (DVec3, DVec3)) -> ScanStation {
    let [right, up, ahead] = axes(pose);
    let rotation = DQuat::from_mat3(&DMat3::from_cols(right, -up, ahead));
    ScanStation { position: Some(pose.0), rotation, ..ScanStation::default() }
}

impl DepthCamera {
    fn scan_row(&self, scene: &SdfScene, pose_idx: usize, y: usize) -> Vec<Return> {
        let pose = self.poses[pose_idx];
        let [right, up, ahead] = axes(pose);
        let scale = 2.0 * (0.5 * self.view_angle_rad).tan() / self.height as f64;
        let scan_pixel = |x: usize| {
            let across = scale * (x as f64 + 0.5 - 0.5 * self.width as f64);
            let rise = scale * (0.5 * self.height as f64 - y as f64 - 0.5);
            let direction = (ahead + across * right + rise * up).normalize();
            let ray = DRay { origin: pose.0, direction };
            let cosine = direction.dot(ahead);
            let hit = scene.first_hit(&ray, self.max_depth / cosine)?;
            let noise = self.noise(pose_idx, x, y);
            let range = self.measured(hit.distance * cosine, noise) / cosine;
            Some(Return::new(scene, &ray, hit, range, pose_idx as u16 + 1))
        };
        (0..self.width).filter_map(scan_pixel).collect()
    }

    /// Returns noise of a standard deviation of 1.
    fn noise(&self, pose_idx: usize, x: usize, y: usize) -> f64 {
        let of_pixel = |x: usize, y: usize| {
            let pixel = y * (self.width + self.window - 1) + x;
            Random::new(self.seed, ((pose_idx as u64) << 40) | pixel as u64).next_gaussian()
        };
        let rows = y..y + self.window;
        let sum: f64 =
            rows.map(|y| (x..x + self.window).map(|x| of_pixel(x, y)).sum::<f64>()).sum();
        sum / self.window as f64
    }

    /// Adds noise to a depth and rounds its reciprocal.
    fn measured(&self, depth: f64, noise: f64) -> f64 {
        let noisy = depth + self.noise_at_1_m * depth * depth * noise;
        let disparity = 1.0 / noisy.max(1e-3);
        if self.step_at_1_m == 0.0 {
            return noisy;
        }
        1.0 / ((disparity / self.step_at_1_m).round().max(1.0) * self.step_at_1_m)
    }
}

impl Instrument for DepthCamera {
    /// Returns points ordered by picture, row and column. Those of one pose know their station.
    fn scan(&self, scene: &SdfScene, progress: &dyn Progress) -> Result<PointCloud> {
        let is_angle = 0.0 < self.view_angle_rad && self.view_angle_rad < PI;
        check(is_angle, "view_angle_rad", self.view_angle_rad, "between 0 and pi")?;
        check_not_negative("noise_at_1_m", self.noise_at_1_m)?;
        check_not_negative("step_at_1_m", self.step_at_1_m)?;
        let is_window = (1..=MAX_WINDOW).contains(&self.window);
        check(is_window, "window", self.window as f64, "between 1 and 64")?;
        for (position, target) in &self.poses {
            let level = (target - position).truncate().length();
            check(0.0 < level, "direction of a pose", level, "one that is not vertical")?;
        }
        check_positive("max_depth", self.max_depth)?;
        check_size(
            self.poses.len(),
            [self.poses.len(), self.height, self.width].map(|n| n as f64).iter().product(),
        )?;
        let n_rows = self.poses.len() * self.height;
        progress.begin("scan", n_rows as u64);
        let scan_row = |row: usize| {
            progress.check()?;
            progress.advance(1);
            Ok(self.scan_row(scene, row / self.height, row % self.height))
        };
        let rows: Vec<Vec<Return>> =
            (0..n_rows).into_par_iter().map(scan_row).collect::<Result<_>>()?;
        let returns: Vec<Return> = rows.into_iter().flatten().collect();
        let mut cloud = into_cloud(&returns, DVec3::ZERO);
        if let [pose] = self.poses[..] {
            cloud.stations = vec![station(pose)];
        }
        Ok(cloud)
    }

    fn viewpoints(&self, point: DVec3) -> Vec<DVec3> {
        let half_height = (0.5 * self.view_angle_rad).tan();
        let half_width = half_height * self.width as f64 / self.height as f64;
        let is_in_picture = |pose: &&(DVec3, DVec3)| {
            let [right, up, ahead] = axes(**pose);
            let offset = point - pose.0;
            let depth = offset.dot(ahead);
            (0.0..self.max_depth).contains(&depth)
                && offset.dot(right).abs() < half_width * depth
                && offset.dot(up).abs() < half_height * depth
        };
        self.poses.iter().filter(is_in_picture).map(|(position, _)| *position).collect()
    }
}

#[cfg(test)]
mod tests {
    //! Pictures of a wall.

    use super::*;
    use crate::parts::primitives::Plane;
    use surfel_core::math::Vec3;
    use surfel_core::progress::NoProgress;

    fn depths(distance: f64) -> Vec<f64> {
        let wall = Plane { normal: DVec3::NEG_X, offset: -distance, color: Vec3::ONE };
        let camera = DepthCamera { poses: vec![(DVec3::ZERO, DVec3::X)], ..DepthCamera::default() };
        let cloud = camera.scan(&SdfScene::default().with(wall), &NoProgress).unwrap();
        assert_eq!(cloud.len(), camera.width * camera.height);
        cloud.positions.iter().map(|p| f64::from(p.x)).collect()
    }

    #[test]
    fn noise_grows_with_the_square_of_the_depth() {
        let deviation = |distance: f64| {
            let depths = depths(distance);
            let squares = depths.iter().map(|depth| (depth - distance).powi(2)).sum::<f64>();
            (squares / depths.len() as f64).sqrt()
        };
        let ratio = deviation(4.0) / deviation(1.0);
        assert!((14.0..18.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn noise_is_alike_within_a_window() {
        let camera = DepthCamera { window: 8, width: 64, height: 64, ..DepthCamera::default() };
        let noise = |x: usize, y: usize| camera.noise(0, x, y);
        let pixels = (0..56 * 64).map(|i| (i % 56, i / 56));
        let product = |step: usize| {
            pixels.clone().map(|(x, y)| noise(x, y) * noise(x + step, y)).sum::<f64>()
        };
        let variance = product(0) / (56.0 * 64.0);
        assert!((0.7..1.3).contains(&variance), "{variance}");
        let [near, far] = [product(2), product(8)].map(|sum| sum / product(0));
        assert!((0.65..0.85).contains(&near) && far.abs() < 0.2, "{near} {far}");
    }

    #[test]
    fn windows_are_limited() {
        for window in [0, 65, usize::MAX] {
            let camera = DepthCamera { window, ..DepthCamera::default() };
            let error = camera.scan(&SdfScene::default(), &NoProgress).unwrap_err().to_string();
            assert!(error.contains("window"), "{error}");
        }
    }

    #[test]
    fn the_corners_of_a_picture_are_covered() {
        let camera = DepthCamera { poses: vec![(DVec3::ZERO, DVec3::X)], ..DepthCamera::default() };
        let rise = 0.999 * (0.5 * camera.view_angle_rad).tan();
        let corner = DVec3::new(1.0, 4.0 / 3.0 * rise, -rise);
        assert_eq!(camera.viewpoints(corner).len(), 1);
        assert!(camera.viewpoints(1.01 * corner + DVec3::Y * 0.02).is_empty());
        assert!(camera.viewpoints(-corner).is_empty());
    }
}
