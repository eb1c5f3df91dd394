//! Airborne laser scanners: pulses across flight lines, each with several returns.

use super::instrument::{Instrument, check, check_not_negative, check_positive, check_size};
use super::returns::{Return, into_cloud};
use crate::sdf::{DRay, SdfHit, SdfScene};
use rayon::prelude::*;
use std::f64::consts::TAU;
use surfel_core::Result;
use surfel_core::math::DVec3;
use surfel_core::math::Random;
use surfel_core::points::{PointCloud, Scalar, Values};
use surfel_core::progress::Progress;

/// A straight and level flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightLine {
    /// Begin of the line.
    pub from: DVec3,
    /// End of the line.
    pub to: DVec3,
}

/// An airborne laser scanner and its flight lines.
#[derive(Clone, Debug, PartialEq)]
pub struct AirborneLidar {
    /// The flight lines.
    pub lines: Vec<FlightLine>,
    /// Distance between scan lines in metres.
    pub line_step: f64,
    /// Angle between pulses in radians.
    pub pulse_step_rad: f64,
    /// Maximum angle of pulses from the vertical in radians.
    pub max_scan_angle_rad: f64,
    /// Half the angle of a pulse's cone in radians.
    pub divergence_rad: f64,
    /// Minimum distance in metres between two returns of a pulse.
    pub return_separation: f64,
    /// Maximum number of returns of a pulse.
    pub max_returns: usize,
    /// Standard deviation of the measured range in metres.
    pub range_noise: f64,
    /// Maximum range in metres.
    pub max_range: f64,
    /// Seed of the range noise.
    pub seed: u64,
}

impl Default for AirborneLidar {
    /// Returns a scanner for flights at about 300 metres, without flight lines.
    fn default() -> Self {
        Self {
            lines: Vec::new(),
            line_step: 0.3,
            pulse_step_rad: 0.001,
            max_scan_angle_rad: 20f64.to_radians(),
            divergence_rad: 0.000_25,
            return_separation: 0.6,
            max_returns: 5,
            range_noise: 0.02,
            max_range: 1000.0,
            seed: 1,
        }
    }
}

/// One return of a pulse.
struct PulseReturn {
    found: Return,
    return_number: u8,
    n_returns: u8,
    scan_angle_deg: f32,
}

impl FlightLine {
    fn length(&self) -> f64 {
        self.from.distance(self.to)
    }

    fn direction(&self) -> DVec3 {
        (self.to - self.from) / self.length()
    }

    /// Returns the horizontal unit vector to the right of the flight.
    fn right(&self) -> DVec3 {
        self.direction().cross(DVec3::Z).normalize()
    }
}

impl AirborneLidar {
    fn n_pulses(&self) -> usize {
        (2.0 * self.max_scan_angle_rad / self.pulse_step_rad).round() as usize
    }

    fn scan_row(&self, scene: &SdfScene, line_idx: usize, row: usize) -> Vec<PulseReturn> {
        let line = &self.lines[line_idx];
        let (origin, right) =
            (line.from + (row as f64 + 0.5) * self.line_step * line.direction(), line.right());
        let mut returns = Vec::new();
        for pulse in 0..self.n_pulses() {
            let angle = (pulse as f64 + 0.5) * self.pulse_step_rad - self.max_scan_angle_rad;
            let direction = angle.sin() * right - angle.cos() * DVec3::Z;
            let axis = DRay { origin, direction };
            let clusters = self.clusters(scene, &axis, line.direction());
            let stream = ((line_idx * 1_000_003 + row) as u64) << 32 | pulse as u64;
            let mut random = Random::new(self.seed, stream);
            let n_returns = clusters.len() as u8;
            for (return_number, (ray, hit)) in (1..).zip(clusters) {
                let range = hit.distance + self.range_noise * random.next_gaussian();
                let mut found = Return::new(scene, &ray, hit, range, line_idx as u16 + 1);
                // The instrument knows only the axis of the pulse.
                found.position = (origin + range * direction).as_vec3();
                let scan_angle_deg = angle.to_degrees() as f32;
                returns.push(PulseReturn { found, return_number, n_returns, scan_angle_deg });
            }
        }
        returns
    }

    /// Returns the first ray and hit of each return. Seven rays stand for the cone of a pulse: its axis and six at two
    /// thirds of its radius.
    fn clusters(&self, scene: &SdfScene, axis: &DRay, ahead: DVec3) -> Vec<(DRay, SdfHit)> {
        let side = axis.direction.cross(ahead);
        let rim = (0..6).map(|i| {
            let (sin, cos) = (TAU * f64::from(i) / 6.0).sin_cos();
            let offset = 0.67 * self.divergence_rad.tan() * (cos * ahead + sin * side);
            DRay { direction: (axis.direction + offset).normalize(), ..*axis }
        });
        let rays = [*axis].into_iter().chain(rim);
        let mut hits: Vec<(DRay, SdfHit)> =
            rays.filter_map(|ray| Some((ray, scene.first_hit(&ray, self.max_range)?))).collect();
        hits.sort_by(|(_, a), (_, b)| a.distance.total_cmp(&b.distance));
        hits.dedup_by(|(_, later), (_, earlier)| {
            later.distance < earlier.distance + self.return_separation
        });
        hits.truncate(self.max_returns);
        hits
    }
}

impl Instrument for AirborneLidar {
    /// Returns points ordered by flight line, scan line, pulse and return, with the columns `return_number`,
    /// `number_of_returns` and `scan_angle` (degrees, positive to the right).
    fn scan(&self, scene: &SdfScene, progress: &dyn Progress) -> Result<PointCloud> {
        check_positive("line_step", self.line_step)?;
        check_positive("pulse_step_rad", self.pulse_step_rad)?;
        check_positive("max_range", self.max_range)?;
        check_not_negative("range_noise", self.range_noise)?;
        for line in &self.lines {
            check_positive("length of a flight line", line.length())?;
            let height = line.to.z - line.from.z;
            check(height == 0.0, "height of a flight line", height, "no rise, as lines are level")?;
        }
        let n_rows = |line: &FlightLine| (line.length() / self.line_step) as usize;
        let n_pulses = 2.0 * self.max_scan_angle_rad / self.pulse_step_rad;
        let length: f64 = self.lines.iter().map(FlightLine::length).sum();
        check_size(self.lines.len(), n_pulses * (length / self.line_step).max(1.0))?;
        let rows: Vec<(usize, usize)> = (0..self.lines.len())
            .flat_map(|line_idx| (0..n_rows(&self.lines[line_idx])).map(move |row| (line_idx, row)))
            .collect();
        progress.begin("scan", rows.len() as u64);
        let scan_row = |&(line_idx, row): &(usize, usize)| {
            progress.check()?;
            progress.advance(1);
            Ok(self.scan_row(scene, line_idx, row))
        };
        let rows: Vec<Vec<PulseReturn>> = rows.par_iter().map(scan_row).collect::<Result<_>>()?;
        let mut returns = Vec::new();
        let (mut numbers, mut counts, mut angles) = (Vec::new(), Vec::new(), Vec::new());
        for pulse_return in rows.into_iter().flatten() {
            returns.push(pulse_return.found);
            numbers.push(pulse_return.return_number);
            counts.push(pulse_return.n_returns);
            angles.push(pulse_return.scan_angle_deg);
        }
        let mut cloud = into_cloud(&returns, DVec3::ZERO);
        let scalars = [
            ("return_number", Values::U8(numbers)),
            ("number_of_returns", Values::U8(counts)),
            ("scan_angle", Values::F32(angles)),
        ];
        let named = scalars.map(|(name, values)| Scalar { name: name.to_owned(), values });
        cloud.scalars.extend(named);
        Ok(cloud)
    }

    fn viewpoints(&self, point: DVec3) -> Vec<DVec3> {
        let nearest = |line: &FlightLine| {
            let along = (point - line.from).dot(line.direction());
            let position = line.from + along * line.direction();
            let offset = point - position;
            let angle = offset.dot(line.right()).atan2(-offset.z);
            let is_covered = angle.abs() < self.max_scan_angle_rad
                && (0.0..line.length()).contains(&along)
                && offset.length() < self.max_range;
            is_covered.then_some(position)
        };
        self.lines.iter().filter_map(nearest).collect()
    }
}

#[cfg(test)]
mod tests {
    //! Returns of pulses over an edge and over level ground.

    use super::*;
    use crate::parts::assembly::{Assembly, Solid};
    use crate::parts::primitives::Plane;
    use surfel_core::math::Vec3;
    use surfel_core::progress::NoProgress;

    fn lidar() -> AirborneLidar {
        let [from, to] = [-5.0, 5.0].map(|x| DVec3::new(x, 0.0, 100.0));
        let lines = vec![FlightLine { from, to }];
        AirborneLidar { lines, divergence_rad: 0.002, range_noise: 0.0, ..AirborneLidar::default() }
    }

    fn scan(with_table: bool) -> PointCloud {
        let mut scene = SdfScene::default();
        if with_table {
            let solids = vec![Solid::block([0.0, 0.0, 9.0], [2.0, 2.0, 1.0])];
            scene.add(Assembly { solids, blend: 0.0, color: Vec3::ONE, class: 6 });
        }
        scene.add(Plane { normal: DVec3::Z, offset: 0.0, color: Vec3::ONE });
        lidar().scan(&scene, &NoProgress).unwrap()
    }

    fn n_returns(cloud: &PointCloud) -> &[u8] {
        let Some(Values::U8(counts)) = cloud.scalar("number_of_returns") else { unreachable!() };
        counts
    }

    #[test]
    fn level_ground_gives_one_return_of_each_pulse() {
        let cloud = scan(false);
        assert_eq!(cloud.len(), lidar().n_pulses() * 33);
        assert!(n_returns(&cloud).iter().all(|count| *count == 1));
        // The near rim of an oblique pulse's cone returns first.
        assert!(cloud.positions.iter().all(|p| -0.01 < p.z && p.z < 0.1));
    }

    #[test]
    fn pulses_over_an_edge_give_two_returns() {
        let cloud = scan(true);
        let doubles = n_returns(&cloud).iter().zip(&cloud.positions);
        let doubles: Vec<f32> =
            doubles.filter(|(count, _)| **count == 2).map(|(_, p)| p.z).collect();
        assert!(20 < doubles.len(), "{}", doubles.len());
        assert_eq!(doubles.len() % 2, 0);
        assert!(doubles.chunks(2).all(|pair| 7.5 < pair[0] && pair[1].abs() < 0.1));
    }

    #[test]
    fn a_point_is_covered_from_the_nearest_position_of_each_line() {
        let lidar = lidar();
        assert_eq!(lidar.viewpoints(DVec3::new(1.0, 20.0, 0.0)), [DVec3::new(1.0, 0.0, 100.0)]);
        assert!(lidar.viewpoints(DVec3::new(1.0, 50.0, 0.0)).is_empty());
    }
}
