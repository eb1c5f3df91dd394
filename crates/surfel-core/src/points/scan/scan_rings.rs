//! Rings of a spinning scanner: each of its lasers sweeps a cone about the vertical axis of the scanner.
//!
//! The laser of each point follows from a column, from the order of the points in the file, one turn of a laser after the
//! other, or from elevations that repeat.

use crate::error::Result;
use crate::math::{DVec3, Vec3, sample_indices, sampled_quantile};
use crate::points::{PointCloud, ROW_INDEX, Values, is_valid_position};
use crate::progress::Progress;
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// Numbers of lasers of a scanner.
const MIN_RINGS: usize = 8;
const MAX_RINGS: usize = 256;
/// Minimum number of points: fewer may lie on cones by chance.
const MIN_POINTS: usize = 2048;
/// Number of points that tell whether a cloud may have rings.
const N_SAMPLES: usize = 65_536;
/// Names of the columns that tell the laser of each point.
const RING_COLUMNS: [&str; 6] = ["ring", "laser_id", "laser", "channel", "beam", ROW_INDEX];
/// Minimum fraction of the points whose laser is known.
const MIN_KNOWN: f32 = 0.95;
/// Differences of successive elevations in degrees, from which they are those of different lasers. They are tried in turn.
const MIN_STEPS_DEG: [f32; 4] = [0.005, 0.02, 0.05, 0.1];
/// Maximum width of the elevations of a laser, as a fraction of the step to those of the next.
const MAX_RING_WIDTH: f32 = 0.2;
/// Maximum distance between the quartiles of the elevations of a laser, in steps to those of the next. It is wide for a
/// laser beside the middle of the scanner, and wider where the scanner moved.
const MAX_SPREAD: f32 = 1.5;
/// Minimum fraction of the points on a ring.
const MIN_FRACTION: f32 = 0.0005;
/// Minimum number of points with elevations that lie close together: the elevations of few random points do so by chance.
const MIN_RING_POINTS: usize = 16;
/// Minimum fraction of successive points in one sense about the axis, where lasers follow each other in the file.
const MIN_IN_ORDER: f32 = 0.98;
/// Maximum turn between successive points of a laser, in radians: larger ones have no sense.
const MAX_TURN: f32 = 0.75 * PI;
/// Minimum turn back, in radians, at which the points of the next laser begin.
const MIN_TURN_BACK: f32 = 0.2;
/// Minimum jump of the range between successive points of a laser, as a fraction of the range, and minimum ratio to its
/// changes before and after. Spheres, vases and ellipsoids about the zero have rings of points, too, but no jumps.
const MIN_JUMP: f32 = 0.05;
const MIN_JUMP_RATIO: f32 = 4.0;
/// Minimum turn, in median turns of a laser, over rays that measured nothing.
const MIN_GAP: f32 = 4.0;
/// Minimum fraction of the lasers with jumps or gaps.
const MIN_WITH_JUMPS: f32 = 0.05;
/// Minimum median step between the elevations of successive lasers, in radians.
const MIN_STEP_RAD: f32 = 5e-4;
/// Marks a point without a ring.
const NO_RING: u16 = u16::MAX;

/// The points of a cloud by the laser that measured them.
pub struct ScanRings {
    /// World position of the scanner.
    pub scanner: DVec3,
    /// Rings by ascending elevation.
    pub rings: Vec<Ring>,
}

/// The points that one laser measured, by ascending azimuth.
pub struct Ring {
    /// Median elevation in radians.
    pub elevation_rad: f32,
    /// Azimuths in radians, from -pi to pi.
    pub azimuths: Vec<f32>,
    /// Indices of the points.
    pub points: Vec<u32>,
}

/// A point as the scanner sees it.
#[derive(Clone, Copy)]
struct Direction {
    azimuth: f32,
    elevation_deg: f32,
    range: f32,
}

impl ScanRings {
    /// Returns the rings of a scan from one place: that of its station, or else the zero of the world coordinates. Returns
    /// none for other clouds.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn find(cloud: &PointCloud, progress: &dyn Progress) -> Result<Option<Self>> {
        let is_animated = !cloud.morphs.is_empty() || cloud.skin.is_some();
        if cloud.len() < MIN_POINTS || 1 < cloud.stations.len() || is_animated {
            return Ok(None);
        }
        let station = cloud.stations.first().cloned().unwrap_or_default();
        let scanner = station.position.unwrap_or_default();
        let (from_scanner, offset) =
            (station.rotation.inverse(), (scanner - cloud.origin).as_vec3());
        let direction = |position: &Vec3| {
            let measured = (from_scanner * (*position - offset).as_dvec3()).as_vec3();
            let is_measured = is_valid_position(*position) && measured != Vec3::ZERO;
            is_measured.then(|| Direction {
                azimuth: measured.y.atan2(measured.x),
                elevation_deg: measured.z.atan2(measured.truncate().length()).to_degrees(),
                range: measured.length(),
            })
        };
        // Most clouds have none, which some points tell.
        let spread: Vec<usize> = sample_indices(cloud.len(), N_SAMPLES).collect();
        let spread_sample: Vec<_> =
            spread.iter().map(|i| direction(&cloud.positions[*i])).collect();
        let first_sample: Vec<_> = cloud.positions.iter().take(N_SAMPLES).map(direction).collect();
        let mut columns = RING_COLUMNS.into_iter().filter_map(|name| cloud.scalar(name));
        let is_of_rings = |values: &&Values| {
            rings(&spread_sample, &by_column(values, spread.iter().copied())).is_some()
        };
        let column = columns.find(is_of_rings);
        let mut samples = [&spread_sample, &first_sample].into_iter();
        if column.is_none()
            && samples.all(|sample| by_elevation(sample).is_none())
            && sense(&first_sample).is_none()
        {
            return Ok(None);
        }
        progress.check()?;
        let directions: Vec<_> = cloud.positions.par_iter().map(direction).collect();
        progress.check()?;
        let of_column =
            column.and_then(|values| rings(&directions, &by_column(values, 0..values.len())));
        if let Some(rings) = of_column {
            return Ok(Some(Self { scanner, rings }));
        }
        let is_stated = !cloud.stations.is_empty();
        for find in [by_order, by_elevation] {
            progress.check()?;
            let found =
                find(&directions).and_then(|rings_of_points| rings(&directions, &rings_of_points));
            if let Some(rings) = found.filter(|rings| is_stated || have_jumps(rings, &directions)) {
                return Ok(Some(Self { scanner, rings }));
            }
        }
        Ok(None)
    }
}

impl Ring {
    /// Returns the index of the point nearest to an azimuth, if there is one within `tolerance` radians.
    pub fn nearest(&self, azimuth: f32, tolerance: f32) -> Option<usize> {
        let n = self.azimuths.len();
        if n == 0 {
            return None;
        }
        // Azimuths beyond the seam count from its other side.
        let azimuth = (azimuth + PI).rem_euclid(TAU) - PI;
        let after = self.azimuths.partition_point(|other| *other < azimuth);
        let turn = |index: usize| {
            let turn = (self.azimuths[index] - azimuth).abs();
            turn.min(TAU - turn)
        };
        let nearest = [(after + n - 1) % n, after % n]
            .into_iter()
            .min_by(|a, b| turn(*a).total_cmp(&turn(*b)))?;
        (turn(nearest) <= tolerance).then_some(nearest)
    }
}

/// Sorts the points into rings; returns none if the rings are too few or many or are not above each other, or too few points
/// have one.
fn rings(directions: &[Option<Direction>], ring_of_point: &[u16]) -> Option<Vec<Ring>> {
    let mut of_ring: Vec<Vec<u32>> = Vec::new();
    let mut n_points = 0;
    for (point, (ring, direction)) in ring_of_point.iter().zip(directions).enumerate() {
        n_points += usize::from(direction.is_some());
        if *ring == NO_RING || direction.is_none() {
            continue;
        }
        let ring = usize::from(*ring);
        if of_ring.len() <= ring {
            of_ring.resize_with(ring + 1, Vec::new);
        }
        of_ring[ring].push(point as u32);
    }
    of_ring
        .retain(|points| MIN_FRACTION * n_points as f32 <= points.len() as f32 && 1 < points.len());
    let n_known: usize = of_ring.iter().map(Vec::len).sum();
    let is_known = MIN_KNOWN * n_points as f32 <= n_known as f32;
    if !is_known || !(MIN_RINGS..=MAX_RINGS).contains(&of_ring.len()) {
        return None;
    }
    let direction = |point: &u32| directions[*point as usize];
    let ring = |mut points: Vec<u32>| {
        let elevations = points.iter().filter_map(direction).map(|one| one.elevation_deg);
        let elevations: Vec<f32> = elevations.collect();
        let [low, elevation_deg, high] =
            [0.25, 0.5, 0.75].map(|part| sampled_quantile(&elevations, part));
        let azimuth = |point: &u32| direction(point).map_or(0.0, |one| one.azimuth);
        points.sort_by(|a, b| azimuth(a).total_cmp(&azimuth(b)));
        let azimuths = points.iter().map(azimuth).collect();
        let ring = Ring { elevation_rad: elevation_deg.to_radians(), azimuths, points };
        (ring, (high - low).to_radians())
    };
    let (mut rings, widths): (Vec<Ring>, Vec<f32>) = of_ring.into_par_iter().map(ring).unzip();
    rings.sort_by(|a, b| a.elevation_rad.total_cmp(&b.elevation_rad));
    let steps = rings.windows(2).map(|pair| pair[1].elevation_rad - pair[0].elevation_rad);
    let [step, width] =
        [steps.collect(), widths].map(|values: Vec<f32>| sampled_quantile(&values, 0.5));
    (MIN_STEP_RAD < step && width < MAX_SPREAD * step).then_some(rings)
}

/// Returns true if the ranges of some rings jump, or lack some rays, as those of things around a scanner do.
fn have_jumps(rings: &[Ring], directions: &[Option<Direction>]) -> bool {
    let has_jump = |ring: &&Ring| {
        let seen = ring.points.iter().filter_map(|point| directions[*point as usize]);
        let ranges: Vec<f32> = seen.map(|direction| direction.range).collect();
        let is_jump = |four: &[f32]| {
            let [before, jump, after] = [0, 1, 2].map(|i| (four[i + 1] - four[i]).abs());
            MIN_JUMP * four[1].min(four[2]) < jump && MIN_JUMP_RATIO * before.max(after) < jump
        };
        let turns = ring.azimuths.windows(2).map(|pair| pair[1] - pair[0]);
        let max_turn = MIN_GAP * sampled_quantile(&turns.clone().collect::<Vec<_>>(), 0.5);
        ranges.windows(4).any(is_jump) || turns.into_iter().any(|turn| max_turn < turn)
    };
    MIN_WITH_JUMPS * rings.len() as f32 <= rings.iter().filter(has_jump).count() as f32
}

/// Returns the rings of points by a column of the file.
fn by_column(values: &Values, points: impl IntoIterator<Item = usize>) -> Vec<u16> {
    let ring = |point: usize| {
        let value = values.get(point);
        let is_index = value.fract() == 0.0 && (0.0..MAX_RINGS as f64).contains(&value);
        if is_index { value as u16 } else { NO_RING }
    };
    points.into_iter().map(ring).collect()
}

/// Returns the rings of the points by their elevations, if these repeat.
fn by_elevation(directions: &[Option<Direction>]) -> Option<Vec<u16>> {
    let elevations = directions.iter().flatten().map(|direction| direction.elevation_deg);
    let mut sorted: Vec<f32> = elevations.collect();
    sorted.par_sort_unstable_by(f32::total_cmp);
    let bounds = MIN_STEPS_DEG.into_iter().find_map(|step| bounds_of_rings(&sorted, step))?;
    let ring = |direction: &Option<Direction>| {
        let Some(Direction { elevation_deg, .. }) = *direction else { return NO_RING };
        let ring = bounds.partition_point(|[_, last]| *last < elevation_deg);
        let is_within = bounds.get(ring).is_some_and(|[first, _]| *first <= elevation_deg);
        if is_within { ring as u16 } else { NO_RING }
    };
    Some(directions.par_iter().map(ring).collect())
}

/// Returns the first and the last elevation of each ring; none if the elevations do not form rings when they are parted
/// where they are more than `min_step` degrees apart.
fn bounds_of_rings(sorted: &[f32], min_step: f32) -> Option<Vec<[f32; 2]>> {
    let min_count = (MIN_FRACTION * sorted.len() as f32) as usize;
    let min_count = min_count.max(MIN_RING_POINTS);
    let mut bounds: Vec<[f32; 2]> = Vec::new();
    let mut n_known = 0;
    for ring in sorted.chunk_by(|a, b| b - a <= min_step).filter(|ring| min_count <= ring.len()) {
        n_known += ring.len();
        bounds.push([ring[0], ring[ring.len() - 1]]);
    }
    if !(MIN_RINGS..=MAX_RINGS).contains(&bounds.len())
        || (n_known as f32) < MIN_KNOWN * sorted.len() as f32
    {
        return None;
    }
    let widths = bounds.iter().map(|[first, last]| last - first).collect();
    let steps = bounds.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    let [width, step] = [widths, steps].map(|values: Vec<f32>| sampled_quantile(&values, 0.5));
    (width < MAX_RING_WIDTH * step).then_some(bounds)
}

/// Returns the turns from each point to the next, in radians; zero for those that have no sense.
fn turns(directions: &[Option<Direction>]) -> impl Iterator<Item = f32> + Clone {
    let azimuths = directions.iter().flatten().map(|direction| direction.azimuth);
    azimuths.clone().zip(azimuths.skip(1)).map(|(from, to)| {
        let turn = (to - from + PI).rem_euclid(TAU) - PI;
        if turn.abs() < MAX_TURN { turn } else { 0.0 }
    })
}

/// Returns the sense in which the points follow each other about the axis, 1 counterclockwise and -1 clockwise; none if many
/// do not.
fn sense(directions: &[Option<Direction>]) -> Option<f32> {
    let n_left = turns(directions).filter(|turn| 0.0 < *turn).count();
    let n_right = turns(directions).filter(|turn| *turn < 0.0).count();
    let (n_turns, n_in_order) = (n_left + n_right, n_left.max(n_right));
    let is_in_order = 0 < n_turns && MIN_IN_ORDER * n_turns as f32 <= n_in_order as f32;
    is_in_order.then_some(if n_right < n_left { 1.0 } else { -1.0 })
}

/// Returns the rings of the points by their order, if they go round and round the scanner, a laser at a turn. A laser may
/// have points in a part of the turn only.
fn by_order(directions: &[Option<Direction>]) -> Option<Vec<u16>> {
    let sense = sense(directions)?;
    let first = directions.iter().flatten().next()?.azimuth;
    let (mut ring, mut last) = (0usize, 0.0f32);
    let rings = directions.iter().map(|direction| {
        let Some(Direction { azimuth, .. }) = *direction else { return NO_RING };
        let turned = (sense * (azimuth - first)).rem_euclid(TAU);
        if turned < last - MIN_TURN_BACK {
            ring += 1;
        }
        last = turned;
        if ring < MAX_RINGS { ring as u16 } else { NO_RING }
    });
    Some(rings.collect())
}

#[cfg(test)]
mod tests {
    //! Rings that are found in three ways, and clouds without any.

    use super::*;
    use crate::math::Random;
    use crate::points::{Scalar, ScanStation};
    use crate::progress::NoProgress;

    const N_RINGS: usize = 16;
    const N_COLUMNS: usize = 400;

    /// The points of a scanner 2 above the ground inside walls 5 to 25 away, before which a pillar stands, laser by laser.
    /// Each laser is `lift` times its number above the middle of the scanner.
    fn scan(lift: f32) -> PointCloud {
        let point = |i: usize| {
            let (ring, column) = (i / N_COLUMNS, i % N_COLUMNS);
            let (sin, cos) = (TAU * column as f32 / N_COLUMNS as f32).sin_cos();
            let elevation = (2.0 * ring as f32 - 20.3).to_radians();
            let slope = elevation.tan();
            let to_wall = if (40..50).contains(&column) { 4.0 } else { 15.0 + 10.0 * sin };
            let level = if slope < 0.0 { (2.0 / -slope).min(to_wall) } else { to_wall };
            Vec3::new(level * cos, level * sin, level * slope + lift * ring as f32)
        };
        PointCloud::from_positions((0..N_RINGS * N_COLUMNS).map(point).collect())
    }

    fn find(cloud: &PointCloud) -> Option<ScanRings> {
        ScanRings::find(cloud, &NoProgress).unwrap()
    }

    fn assert_rings(cloud: &PointCloud, ring_of: impl Fn(u32) -> usize) {
        let found = find(cloud).unwrap();
        assert_eq!(found.rings.len(), N_RINGS);
        for (index, ring) in found.rings.iter().enumerate() {
            // The first point of a turn may count to the last one.
            let n_others = ring.points.iter().filter(|point| ring_of(**point) != index).count();
            assert!(n_others <= 1, "{index}: {n_others}");
            assert!(ring.azimuths.is_sorted());
        }
        let n_points: usize = found.rings.iter().map(|ring| ring.points.len()).sum();
        assert!(cloud.len() - n_points < N_RINGS, "{n_points}");
    }

    #[test]
    fn elevations_tell_rings_in_any_order() {
        let mut cloud = scan(0.0);
        assert_rings(&cloud, |point| point as usize / N_COLUMNS);
        cloud.positions.reverse();
        assert_rings(&cloud, |point| N_RINGS - 1 - point as usize / N_COLUMNS);
    }

    #[test]
    fn order_or_a_column_tell_rings_of_lasers_beside_the_middle() {
        let mut cloud = scan(0.08);
        assert!(by_elevation_of(&cloud).is_none());
        assert_rings(&cloud, |point| point as usize / N_COLUMNS);
        let turned = |i: usize| cloud.positions[i % N_RINGS * N_COLUMNS + i / N_RINGS];
        cloud.positions = (0..cloud.len()).map(turned).collect();
        assert!(find(&cloud).is_none());
        let rings = (0..cloud.len()).map(|i| (i % N_RINGS) as f32).collect();
        cloud.scalars = vec![Scalar { name: "ring".into(), values: Values::F32(rings) }];
        assert_rings(&cloud, |point| point as usize % N_RINGS);
    }

    #[test]
    fn lasers_may_see_a_part_of_the_turn() {
        let mut cloud = scan(0.08);
        let n_seen = |ring: usize| N_COLUMNS / [1, 2, 3, 6][ring % 4];
        let is_seen = |i: usize| i % N_COLUMNS < n_seen(i / N_COLUMNS);
        let seen: Vec<usize> = (0..cloud.len()).filter(|i| is_seen(*i)).collect();
        cloud.positions = seen.iter().map(|i| cloud.positions[*i]).collect();
        assert_rings(&cloud, |point| seen[point as usize] / N_COLUMNS);
    }

    fn by_elevation_of(cloud: &PointCloud) -> Option<Vec<u16>> {
        let direction = |p: &Vec3| {
            Some(Direction {
                azimuth: p.y.atan2(p.x),
                elevation_deg: p.z.atan2(p.truncate().length()).to_degrees(),
                range: p.length(),
            })
        };
        by_elevation(&cloud.positions.iter().map(direction).collect::<Vec<_>>())
    }

    #[test]
    fn a_stated_station_is_the_scanner() {
        let mut cloud = scan(0.0);
        let position = DVec3::new(5e5, 4e6, 100.0);
        cloud.origin = position + DVec3::Z;
        cloud.positions.iter_mut().for_each(|p| p.z -= 1.0);
        assert!(find(&cloud).is_none());
        cloud.stations = vec![ScanStation { position: Some(position), ..ScanStation::default() }];
        assert_eq!(find(&cloud).unwrap().scanner, position);
        assert_rings(&cloud, |point| point as usize / N_COLUMNS);
    }

    #[test]
    fn other_clouds_have_no_rings() {
        let mut random = Random::new(1, 0);
        let mut next = || random.next_f32() - 0.5;
        let filled = (0..9000).map(|_| Vec3::new(next(), next(), next())).collect();
        let grid = (0..9000).map(|i| Vec3::new((i % 90) as f32, (i / 90) as f32, -2.0)).collect();
        // A scanner that moved on, with a column of its lasers.
        let mut moved = scan(0.0);
        let shift = |i: usize| Vec3::X * (i % N_COLUMNS) as f32;
        moved.positions.iter_mut().enumerate().for_each(|(i, p)| *p += shift(i));
        let lasers = (0..moved.len()).map(|i| (i / N_COLUMNS) as u8).collect();
        moved.scalars = vec![Scalar { name: "ring".into(), values: Values::U8(lasers) }];
        assert!(find(&moved).is_none());
        // A column of points about the zero, and a sphere of circles of latitude.
        let around = |i: usize| {
            let (sin, cos) = (TAU * (i % 100) as f32 / 100.0).sin_cos();
            Vec3::new(cos, sin, 0.1 * (i / 100) as f32 - 4.5)
        };
        let pillar: Vec<Vec3> = (0..9000).map(around).collect();
        let sphere: Vec<Vec3> = pillar.iter().map(|point| point.normalize()).collect();
        let ellipsoid = sphere.iter().map(|point| *point * Vec3::new(1.2, 1.0, 1.0)).collect();
        for solid in [pillar, sphere, ellipsoid] {
            assert!(find(&PointCloud::from_positions(solid)).is_none());
        }
        let circle =
            (0..9000).map(|i| Vec3::new((i as f32).cos(), (i as f32).sin(), 0.1)).collect();
        for positions in [filled, grid, circle, vec![Vec3::ZERO; 9000], vec![Vec3::NAN; 9000]] {
            assert!(find(&PointCloud::from_positions(positions)).is_none());
        }
        assert!(find(&PointCloud::default()).is_none());
    }

    #[test]
    fn random_points_of_a_hill_beside_the_zero_have_no_rings() {
        for n_points in (2100..4000).step_by(100) {
            let mut random = Random::new(n_points, 0);
            let mut point = |_| {
                let (x, y) = (20.0 * random.next_f32(), 16.0 * random.next_f32());
                Vec3::new(x, y, 1.5 + (0.4 * x).sin() + 0.5 * (0.5 * y).cos())
            };
            let hill = PointCloud::from_positions((0..n_points).map(&mut point).collect());
            assert!(find(&hill).is_none(), "{n_points} points");
        }
    }

    #[test]
    fn the_nearest_point_of_a_ring_may_lie_across_the_seam() {
        let azimuths = vec![-3.1, -1.0, 0.5, 3.0];
        let ring = Ring { elevation_rad: 0.0, azimuths, points: vec![0, 1, 2, 3] };
        assert_eq!(ring.nearest(3.13, 0.1), Some(0));
        assert_eq!(ring.nearest(-3.13, 0.1), Some(0));
        assert_eq!(ring.nearest(0.45, 0.1), Some(2));
        assert_eq!(ring.nearest(0.3, 0.1), None);
    }
}
