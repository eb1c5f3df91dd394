//! Spinning laser scanners on a vehicle: rings of rays about the vertical axis, driven along a path.

use super::instrument::{Instrument, check_not_negative, check_positive, check_size};
use super::returns::{Return, into_cloud};
use crate::sdf::{DRay, SdfScene};
use rayon::prelude::*;
use std::f64::consts::TAU;
use surfel_core::Result;
use surfel_core::math::DVec3;
use surfel_core::math::Random;
use surfel_core::points::{PointCloud, Scalar, ScanStation, Values};
use surfel_core::progress::Progress;

/// A spinning laser scanner and the path that it is driven along, or the place where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct SpinningLidar {
    /// Corners of the path, at the height of the scanner; the only one where it stands.
    pub path: Vec<DVec3>,
    /// Speed in metres per second.
    pub speed: f64,
    /// Revolutions per second.
    pub rotation_hz: f64,
    /// Number of rings.
    pub n_rings: u16,
    /// Lowest and highest elevation of the rings in radians above the horizon.
    pub elevation_rad: (f64, f64),
    /// Number of azimuths per revolution.
    pub n_azimuths: u32,
    /// Standard deviation of the measured range in metres.
    pub range_noise: f64,
    /// Maximum range in metres.
    pub max_range: f64,
    /// Seed of the range noise.
    pub seed: u64,
}

impl Default for SpinningLidar {
    /// Returns a scanner of 64 rings without a path.
    fn default() -> Self {
        Self {
            path: Vec::new(),
            speed: 8.0,
            rotation_hz: 10.0,
            n_rings: 64,
            elevation_rad: ((-24.8f64).to_radians(), 15f64.to_radians()),
            n_azimuths: 1024,
            range_noise: 0.01,
            max_range: 100.0,
            seed: 1,
        }
    }
}

impl SpinningLidar {
    fn path_length(&self) -> f64 {
        self.path.windows(2).map(|ends| ends[0].distance(ends[1])).sum()
    }

    /// Returns the position after `distance` metres of the path.
    fn position(&self, distance: f64) -> DVec3 {
        let mut left = distance;
        for ends in self.path.windows(2) {
            let length = ends[0].distance(ends[1]);
            if left < length {
                return ends[0].lerp(ends[1], left / length);
            }
            left -= length;
        }
        self.path.last().copied().unwrap_or_default()
    }

    fn n_revolutions(&self) -> usize {
        ((self.path_length() / self.speed * self.rotation_hz).round() as usize).max(1)
    }

    fn ray(&self, column: usize, ring: u16) -> DRay {
        let revolutions = column as f64 / f64::from(self.n_azimuths);
        let origin = self.position(revolutions / self.rotation_hz * self.speed);
        let (sin, cos) = (-TAU * revolutions).sin_cos();
        let (lowest, highest) = self.elevation_rad;
        let fraction = f64::from(ring) / f64::from(self.n_rings.max(2) - 1);
        let (rise, run) = (lowest + fraction * (highest - lowest)).sin_cos();
        DRay { origin, direction: DVec3::new(run * cos, run * sin, rise) }
    }

    fn scan_column(&self, scene: &SdfScene, column: usize) -> Vec<(u16, f64, Return)> {
        let time = column as f64 / f64::from(self.n_azimuths) / self.rotation_hz;
        let scan_ring = |ring: u16| {
            let ray = self.ray(column, ring);
            let hit = scene.first_hit(&ray, self.max_range)?;
            let mut random = Random::new(self.seed, ((column as u64) << 32) | u64::from(ring));
            let range = hit.distance + self.range_noise * random.next_gaussian();
            Some((ring, time, Return::new(scene, &ray, hit, range, 1)))
        };
        (0..self.n_rings).filter_map(scan_ring).collect()
    }
}

impl Instrument for SpinningLidar {
    /// Returns points ordered by time, then ring, with the columns `ring` and `gps_time`. A scanner that stands gives one
    /// revolution, with its station.
    fn scan(&self, scene: &SdfScene, progress: &dyn Progress) -> Result<PointCloud> {
        check_positive("speed", self.speed)?;
        check_positive("rotation_hz", self.rotation_hz)?;
        check_not_negative("range_noise", self.range_noise)?;
        check_positive("max_range", self.max_range)?;
        let n_revolutions = self.path_length() / self.speed * self.rotation_hz;
        let n_rays = n_revolutions.max(1.0) * f64::from(self.n_azimuths) * f64::from(self.n_rings);
        check_size(self.path.len().min(1), n_rays)?;
        let n_columns = self.n_revolutions() * self.n_azimuths as usize;
        progress.begin("scan", n_columns as u64);
        let scan_column = |column| {
            progress.check()?;
            progress.advance(1);
            Ok(self.scan_column(scene, column))
        };
        let columns: Vec<_> =
            (0..n_columns).into_par_iter().map(scan_column).collect::<Result<_>>()?;
        let (mut rings, mut times, mut returns) = (Vec::new(), Vec::new(), Vec::new());
        for (ring, time, found) in columns.into_iter().flatten() {
            rings.push(ring);
            times.push(time);
            returns.push(found);
        }
        let mut cloud = into_cloud(&returns, DVec3::ZERO);
        cloud.scalars.push(Scalar { name: "ring".to_owned(), values: Values::U16(rings) });
        cloud.scalars.push(Scalar { name: "gps_time".to_owned(), values: Values::F64(times) });
        if let [position] = self.path[..] {
            let position = Some(position);
            cloud.stations = vec![ScanStation { position, ..ScanStation::default() }];
        }
        Ok(cloud)
    }

    fn viewpoints(&self, point: DVec3) -> Vec<DVec3> {
        // Positions of a few revolutions stand for all.
        const N_POSITIONS: usize = 6;
        let length = self.path_length();
        let positions =
            (0..N_POSITIONS).map(|i| self.position(length * (i as f64 + 0.5) / N_POSITIONS as f64));
        let is_aimed_at = |position: &DVec3| {
            let offset = point - position;
            let elevation = offset.z.atan2(offset.truncate().length());
            let (lowest, highest) = self.elevation_rad;
            (lowest..=highest).contains(&elevation) && offset.length() < self.max_range
        };
        positions.filter(is_aimed_at).collect()
    }
}

#[cfg(test)]
mod tests {
    //! Rings on a plane.

    use super::*;
    use crate::parts::primitives::Plane;
    use surfel_core::math::Vec3;
    use surfel_core::progress::NoProgress;

    fn lidar() -> SpinningLidar {
        let path = vec![DVec3::new(0.0, 0.0, 2.0), DVec3::new(4.0, 0.0, 2.0)];
        SpinningLidar { path, n_azimuths: 64, range_noise: 0.0, ..SpinningLidar::default() }
    }

    #[test]
    fn each_ring_meets_level_ground_at_its_distance_from_the_path() {
        let ground = Plane { normal: DVec3::Z, offset: 0.0, color: Vec3::ONE };
        let lidar = lidar();
        let cloud = lidar.scan(&SdfScene::default().with(ground), &NoProgress).unwrap();
        let Some(Values::U16(rings)) = cloud.scalar("ring") else { unreachable!() };
        let Some(Values::F64(times)) = cloud.scalar("gps_time") else { unreachable!() };
        assert!(1000 < cloud.len());
        for ((position, ring), time) in cloud.positions.iter().zip(rings).zip(times) {
            let origin = DVec3::new(8.0 * time, 0.0, 2.0);
            let (lowest, highest) = lidar.elevation_rad;
            let elevation = lowest + f64::from(*ring) / 63.0 * (highest - lowest);
            let expected = 2.0 / (-elevation).tan();
            let found = (position.as_dvec3() - origin).truncate().length();
            assert!((found / expected - 1.0).abs() < 1e-2, "ring {ring}: {found}, {expected}");
        }
    }

    #[test]
    fn many_rings_have_numbers_of_their_own() {
        let ground = Plane { normal: DVec3::Z, offset: 0.0, color: Vec3::ONE };
        let elevation_rad = (-0.5, -0.1);
        let lidar = SpinningLidar { n_rings: 300, n_azimuths: 8, elevation_rad, ..lidar() };
        let cloud = lidar.scan(&SdfScene::default().with(ground), &NoProgress).unwrap();
        let Some(Values::U16(rings)) = cloud.scalar("ring") else { unreachable!() };
        assert_eq!(rings.iter().max(), Some(&299));
    }

    #[test]
    fn scans_of_very_many_rays_are_refused() {
        let lidar = SpinningLidar { n_azimuths: u32::MAX, ..lidar() };
        let error = lidar.scan(&SdfScene::default(), &NoProgress).unwrap_err().to_string();
        assert!(error.contains("number of rays"), "{error}");
    }

    #[test]
    fn only_directions_of_the_rings_are_covered() {
        let lidar = lidar();
        assert!(!lidar.viewpoints(DVec3::new(2.0, 10.0, 0.0)).is_empty());
        assert!(lidar.viewpoints(DVec3::new(2.0, 10.0, 9.0)).is_empty());
    }
}
