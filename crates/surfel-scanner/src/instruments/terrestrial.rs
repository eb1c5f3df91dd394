//! Terrestrial laser scanners: rays from stations, each of which gives at most one point.

use super::instrument::{Instrument, check, check_not_negative, check_positive, check_size};
use super::returns::{Return, add_grid, into_cloud};
use super::station::Station;
use crate::sdf::{DRay, SdfScene};
use rayon::prelude::*;
use surfel_core::Result;
use surfel_core::math::DVec3;
use surfel_core::math::Random;
use surfel_core::math::hash;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;

/// The properties of a scanner, the same at every station.
#[derive(Clone, Debug, PartialEq)]
pub struct Scanner {
    /// Angle between neighbouring rays in radians.
    pub step_rad: f64,
    /// Standard deviation of the measured range in metres.
    pub range_noise: f64,
    /// Maximum range in metres.
    pub max_range: f64,
    /// Seed of the range noise.
    pub seed: u64,
    /// World coordinates of the scene's origin.
    pub origin: DVec3,
    /// True to add the stations, and the columns of the station, row and column of each point.
    pub with_grid: bool,
}

impl Default for Scanner {
    fn default() -> Self {
        Self {
            step_rad: 0.1f64.to_radians(),
            range_noise: 0.002,
            max_range: 120.0,
            seed: 1,
            origin: DVec3::ZERO,
            with_grid: false,
        }
    }
}

impl Scanner {
    /// Scans `scene` from all `stations`. Points are ordered by station, then azimuth, then ascending elevation.
    ///
    /// Points have colours, intensities, classes and `point_source_id`, the number of their station from 1.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Setting`] for a property out of range and [`Error::Cancelled`] if `progress` is cancelled.
    pub fn scan(
        &self,
        scene: &SdfScene,
        stations: &[Station],
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        self.validate()?;
        let n_rays = |station: &Station| {
            station.n_columns(self.step_rad) as f64 * station.n_rows(self.step_rad) as f64
        };
        check_size(stations.len(), stations.iter().map(n_rays).sum())?;
        let n_columns: usize =
            stations.iter().map(|station| station.n_columns(self.step_rad)).sum();
        progress.begin("scan", n_columns as u64);
        let mut returns = Vec::new();
        for (station_idx, station) in stations.iter().enumerate() {
            let columns: Vec<Vec<Return>> = (0..station.n_columns(self.step_rad))
                .into_par_iter()
                .map(|column| {
                    progress.check()?;
                    let points = self.scan_column(scene, station, station_idx, column);
                    progress.advance(1);
                    Ok(points)
                })
                .collect::<Result<_>>()?;
            returns.extend(columns.into_iter().flatten());
        }
        let mut cloud = into_cloud(&returns, self.origin);
        if self.with_grid {
            let positions: Vec<DVec3> = stations.iter().map(|station| station.position).collect();
            add_grid(&mut cloud, &returns, &positions);
        }
        Ok(cloud)
    }

    fn validate(&self) -> Result<()> {
        let is_valid_step = (1e-5..=1.0).contains(&self.step_rad);
        check(is_valid_step, "step_rad", self.step_rad, "between 0.00001 and 1")?;
        check_not_negative("range_noise", self.range_noise)?;
        check_positive("max_range", self.max_range)
    }

    /// Scans the rays of one azimuth.
    fn scan_column(
        &self,
        scene: &SdfScene,
        station: &Station,
        station_idx: usize,
        column: usize,
    ) -> Vec<Return> {
        let scan_ray = |row: usize| {
            let ray = station.ray(column, row, self.step_rad);
            let seed = self.seed ^ hash(station_idx as u64);
            let mut random = Random::new(seed, ((column as u64) << 32) | row as u64);
            Some(self.measure(scene, &ray, station_idx, &mut random)?.in_cell(row, column))
        };
        (0..station.n_rows(self.step_rad)).filter_map(scan_ray).collect()
    }

    fn measure(
        &self,
        scene: &SdfScene,
        ray: &DRay,
        station_idx: usize,
        random: &mut Random,
    ) -> Option<Return> {
        let hit = scene.first_hit(ray, self.max_range)?;
        let range = hit.distance + self.range_noise * random.next_gaussian();
        Some(Return::new(scene, ray, hit, range, station_idx as u16 + 1))
    }
}

/// A scanner with the stations that it scans from.
#[derive(Clone, Debug, PartialEq)]
pub struct TerrestrialSurvey {
    /// The scanner.
    pub scanner: Scanner,
    /// The stations.
    pub stations: Vec<Station>,
}

impl Instrument for TerrestrialSurvey {
    fn scan(&self, scene: &SdfScene, progress: &dyn Progress) -> Result<PointCloud> {
        self.scanner.scan(scene, &self.stations, progress)
    }

    fn viewpoints(&self, point: DVec3) -> Vec<DVec3> {
        let max_range = self.scanner.max_range;
        let is_in_range = |station: &&Station| {
            point.distance(station.position) < max_range && station.covers(point)
        };
        self.stations.iter().filter(is_in_range).map(|station| station.position).collect()
    }
}

#[cfg(test)]
mod tests {
    //! Scans of known shapes.

    use super::*;
    use crate::parts::primitives::{Plane, SphereSdf};
    use surfel_core::Error;
    use surfel_core::math::DVec2;
    use surfel_core::math::Vec3;
    use surfel_core::points::Values;
    use surfel_core::progress::NoProgress;

    const WHITE: Vec3 = Vec3::ONE;

    fn scanner(step_deg: f64) -> Scanner {
        Scanner { step_rad: step_deg.to_radians(), ..Scanner::default() }
    }

    fn ball(center: DVec3) -> SphereSdf {
        SphereSdf { center, radius: 0.5, color: WHITE }
    }

    #[test]
    fn points_lie_on_the_near_side_of_a_sphere() {
        let sphere = ball(DVec3::new(4.0, 1.0, 0.5));
        let scanner = scanner(0.2);
        let station = Station::full_dome(DVec3::ZERO);
        let cloud =
            scanner.scan(&SdfScene::default().with(sphere), &[station], &NoProgress).unwrap();
        assert!(3000 < cloud.len(), "{}", cloud.len());
        for position in &cloud.positions {
            let offset = position.as_dvec3() - sphere.center;
            let slack = 5.0 * scanner.range_noise + 1e-4;
            assert!((offset.length() - sphere.radius).abs() < slack);
            assert!(offset.normalize().dot(-position.as_dvec3().normalize()) > -0.2);
        }
    }

    #[test]
    fn range_noise_has_the_given_deviation() {
        let wall = Plane { normal: DVec3::NEG_X, offset: -10.0, color: WHITE };
        let window = Station::toward(DVec3::ZERO, DVec3::X, 0.2, (-0.1, 0.1));
        let cloud =
            scanner(0.05).scan(&SdfScene::default().with(wall), &[window], &NoProgress).unwrap();
        let error =
            |p: &Vec3| (p.as_dvec3().length() * (10.0 - p.as_dvec3().x) / p.as_dvec3().x).powi(2);
        let variance = cloud.positions.iter().map(error).sum::<f64>() / cloud.len() as f64;
        // About 52,000 points: the deviation's own standard error is 0.3 %.
        assert!((variance.sqrt() / 0.002 - 1.0).abs() < 0.016, "{}", variance.sqrt());
    }

    #[test]
    fn density_falls_with_the_square_of_the_distance() {
        let scene = SdfScene::default().with(ball(DVec3::X * 5.0)).with(ball(DVec3::Y * 10.0));
        let station = Station::full_dome(DVec3::ZERO);
        let cloud = scanner(0.1).scan(&scene, &[station], &NoProgress).unwrap();
        let near = cloud.positions.iter().filter(|p| p.y < p.x).count() as f64;
        let far = cloud.len() as f64 - near;
        assert!((near / far - 4.0).abs() < 0.1, "{near} {far}");
    }

    #[test]
    fn near_surfaces_hide_far_ones() {
        let wall = Plane { normal: DVec3::NEG_X, offset: -6.0, color: WHITE };
        let scene = SdfScene::default().with(wall).with(ball(DVec3::X * 3.0));
        let station = Station::toward(DVec3::ZERO, DVec3::X, 0.6, (-0.3, 0.3));
        let cloud = scanner(0.2).scan(&scene, &[station], &NoProgress).unwrap();
        let behind = |p: &&Vec3| 5.0 < p.x && DVec2::new(p.y.into(), p.z.into()).length() < 1.0;
        assert_eq!(cloud.positions.iter().filter(behind).count(), 0);
        assert!(500 < cloud.positions.iter().filter(|p| 5.0 < p.x).count());
    }

    #[test]
    fn output_is_independent_of_thread_count() {
        let scene = SdfScene::default().with(ball(DVec3::X * 3.0));
        let stations = [DVec3::ZERO, DVec3::X * 6.0].map(Station::full_dome);
        let scan_on = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| scanner(0.5).scan(&scene, &stations, &NoProgress).unwrap())
        };
        let cloud = scan_on(1);
        assert_eq!(cloud, scan_on(2));
        let Some(Values::U16(ids)) = cloud.scalar("point_source_id") else { unreachable!() };
        assert_eq!((ids.first(), ids.last()), (Some(&1), Some(&2)));
    }

    #[test]
    fn properties_out_of_range_are_errors() {
        for scanner in [
            Scanner { step_rad: 0.0, ..Scanner::default() },
            Scanner { step_rad: f64::NAN, ..Scanner::default() },
            Scanner { range_noise: -1.0, ..Scanner::default() },
            Scanner { max_range: f64::INFINITY, ..Scanner::default() },
        ] {
            let result = scanner.scan(&SdfScene::default(), &[], &NoProgress);
            assert!(matches!(result, Err(Error::Setting { .. })));
        }
    }

    #[test]
    fn cancellation_is_an_error() {
        struct Cancelled;
        impl Progress for Cancelled {
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        let stations = [Station::full_dome(DVec3::ZERO)];
        let result = Scanner::default().scan(&SdfScene::default(), &stations, &Cancelled);
        assert_eq!(result, Err(Error::Cancelled));
    }
}
