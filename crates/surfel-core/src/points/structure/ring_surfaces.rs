//! Surfaces between the rings of a spinning scanner, which are far denser along a ring than across.
//!
//! The gaps are closed between rings whose points lie on a line, as on the ground, a wall or the side of a car. A jump of
//! the range leaves a gap open.

use super::point_shape::{PointShape, Structure};
use crate::error::Result;
use crate::math::{Vec3, sampled_quantile};
use crate::points::neighbors::KdTree;
use crate::points::scan::scan_rings::Ring;
use crate::progress::Progress;
use rayon::prelude::*;

/// Maximum difference between the range of a point and that of the line through the two rings beside it, in distances to the
/// nearer of them.
const MAX_DIFFERENCE: f32 = 0.4;
/// Maximum width of a gap, as a fraction of the range. Wider ones say little about what lies between.
const MAX_GAP: f32 = 0.4;
/// Maximum cosine of the angle between a ray and the line to the next ring at which the range does not jump.
const MAX_RAY_COSINE: f32 = 0.7;
/// Cosine of the angle between a ray and a normal below which the plane through a point may be one along the ring and the
/// noise of the ranges.
const MIN_RAY_COSINE: f32 = 0.1;
/// Maximum ratio of successive gaps on one surface. On even ground the last one before the horizon is three times as wide as
/// the one before.
const MAX_GAP_RATIO: f32 = 4.0;
/// Maximum azimuth between points of successive rings, in steps along a ring.
const MAX_STEPS: f32 = 3.0;
/// Ratio of the radius of a disc to the gap that it closes.
const OVERLAP: f32 = 1.25;
/// Half the length of the stretches of rings that a disc is fitted to, as a fraction of the gap between them.
const WIDTH: f32 = 0.5;
/// Maximum number of points of half a stretch.
const MAX_STRETCH_POINTS: usize = 16;
/// Minimum distance, in radii, from a disc that a ray passed through to what it measured.
const MIN_DEPTH: f32 = 0.5;
/// Number of rays of a ring on each side of a disc's centre that may have passed through it.
const N_SAMPLES: i32 = 8;
/// Number of such rays of the ring of the disc's centre.
const N_OWN_SAMPLES: i32 = 24;
/// Minimum cosine of the elevation of a ring around which these are sought as wide as the disc.
const MIN_LEVEL: f32 = 0.1;
/// Maximum number of rings of such rays.
const MAX_RINGS_OF_RAYS: usize = 33;
/// Minimum ratio of the radius of a disc, up to the nearest ray that passed through it, to the gap that it is to close.
const MIN_FREE: f32 = 0.6;
/// Distance between the discs that are kept along a ring, in radii, and minimum cosine between the normals of a disc that is
/// kept and one that is not.
const SPACING: f32 = 0.3;
const MIN_COSINE: f32 = 0.95;

/// Makes discs of the points on lines that lie on a surface between rings, as wide as the gaps. Discs that others on their
/// ring describe as well become redundant. `scanner` is relative to the origin of the points.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn close_ring_gaps(
    tree: &KdTree,
    rings: &[Ring],
    scanner: Vec3,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let Some(fullest) = rings.iter().max_by_key(|ring| ring.points.len()) else { return Ok(()) };
    let max_turn = MAX_STEPS * median_step(fullest);
    let surfaces = RingSurfaces { positions: tree.positions(), rings, scanner, max_turn };
    surfaces.narrow_wide_discs(shapes, |structure| structure != Structure::Line, progress)?;
    for (ring, Ring { points, .. }) in rings.iter().enumerate() {
        let disc = |(index, point): (usize, &u32)| {
            if index.is_multiple_of(4096) {
                progress.check()?;
            }
            Ok(surfaces.closing_disc(&shapes[*point as usize], RingPoint { ring, index }))
        };
        let discs = points.par_iter().enumerate().map(disc).collect::<Result<Vec<_>>>()?;
        let mut last_kept: Option<(Vec3, PointShape)> = None;
        for (i, (point, disc)) in points.iter().zip(&discs).enumerate() {
            let Some(mut disc) = *disc else {
                last_kept = None;
                continue;
            };
            let position = surfaces.positions[*point as usize];
            let is_alike = |(at, kept): (Vec3, PointShape)| {
                at.distance(position) < SPACING * disc.radius.min(kept.radius)
                    && MIN_COSINE < kept.normal.dot(disc.normal).abs()
            };
            let is_last = discs.get(i + 1).is_none_or(Option::is_none);
            if !is_last && last_kept.is_some_and(is_alike) {
                disc.structure = Structure::Redundant;
            } else {
                last_kept = Some((position, disc));
            }
            shapes[*point as usize] = disc;
        }
    }
    // Points on wide lines, as of a pole that is two points wide, may become points of a surface later.
    surfaces.narrow_wide_discs(shapes, |structure| structure == Structure::Line, progress)
}

/// Returns the median step between successive azimuths of a ring, in radians, without those of several turns that repeat.
fn median_step(ring: &Ring) -> f32 {
    let steps = ring.azimuths.windows(2).map(|pair| pair[1] - pair[0]);
    let steps: Vec<f32> = steps.filter(|step| 0.0 < *step).collect();
    sampled_quantile(&steps, 0.5)
}

/// A part of a ring.
struct Stretch {
    mean: Vec3,
    /// Direction of the ring, of any length.
    direction: Vec3,
}

struct RingSurfaces<'a> {
    positions: &'a [Vec3],
    rings: &'a [Ring],
    scanner: Vec3,
    /// Maximum azimuth in radians between points of successive rings.
    max_turn: f32,
}

/// A point by its ring and its index there.
#[derive(Clone, Copy)]
struct RingPoint {
    ring: usize,
    index: usize,
}

impl RingSurfaces<'_> {
    /// Narrows the discs of nearest neighbours, of the structures asked for, that reach beyond the next ring above, for the
    /// highest ring below, up to the nearest rays that passed through them.
    fn narrow_wide_discs(
        &self,
        shapes: &mut [PointShape],
        is_narrowed: impl Fn(Structure) -> bool + Sync,
        progress: &dyn Progress,
    ) -> Result<()> {
        for (ring, Ring { points, elevation_rad, .. }) in self.rings.iter().enumerate() {
            progress.check()?;
            let next =
                self.rings.get(ring + 1).or(ring.checked_sub(1).map(|below| &self.rings[below]));
            let Some(next) = next else { continue };
            let step_rad = (next.elevation_rad - elevation_rad).abs();
            let radius = |(index, point): (usize, &u32)| {
                let (shape, point) = (&shapes[*point as usize], RingPoint { ring, index });
                let gap = step_rad * self.position(point).distance(self.scanner);
                let is_wide = gap < shape.radius && is_narrowed(shape.structure);
                is_wide.then(|| self.free_radius(point, shape.normal, shape.radius).max(gap))
            };
            let radii: Vec<Option<f32>> = points.par_iter().enumerate().map(radius).collect();
            for (point, radius) in points.iter().zip(radii) {
                let shape = &mut shapes[*point as usize];
                shape.radius = radius.unwrap_or(shape.radius);
            }
        }
        Ok(())
    }

    /// Returns the disc that closes the gaps beside a point on a line, or on a plane that may be noise along its ring.
    fn closing_disc(&self, shape: &PointShape, point: RingPoint) -> Option<PointShape> {
        let ray = self.position(point) - self.scanner;
        let contains_ray = || shape.normal.dot(ray).abs() < MIN_RAY_COSINE * ray.length();
        match shape.structure {
            Structure::Line => self.disc(point),
            Structure::Surface if contains_ray() => self.disc(point),
            _ => None,
        }
    }

    /// Returns the disc of a point that reaches the rings below and above on the same surface, if there is one.
    fn disc(&self, point: RingPoint) -> Option<PointShape> {
        let position = self.position(point);
        let across = [-1, 1].map(|side| self.next_on_surface(point, side));
        let distance = |other: &RingPoint| self.position(*other).distance(position);
        let gap = across.iter().flatten().map(distance).reduce(f32::min)?;
        let means = across.map(|other| self.stretch(other.unwrap_or(point), WIDTH * gap).mean);
        let along = self.stretch(point, WIDTH * gap).direction;
        let normal = (means[1] - means[0]).cross(along).try_normalize()?;
        let free = self.free_radius(point, normal, OVERLAP * gap);
        let is_between = across.iter().all(Option::is_some);
        let radius = if is_between { free.max(MIN_FREE * gap) } else { free };
        let shape = PointShape { structure: Structure::Surface, normal, radius };
        (MIN_FREE * gap <= radius).then_some(shape)
    }

    /// Returns the radius of a disc up to the nearest ray that passed through it, or that its own ring lacks: it measured
    /// nothing.
    fn free_radius(&self, point: RingPoint, normal: Vec3, radius: f32) -> f32 {
        let center = self.position(point) - self.scanner;
        let elevation_rad = self.rings[point.ring].elevation_rad;
        let angle = (radius / center.length()).min(1.0).asin();
        let level = elevation_rad.cos().max(MIN_LEVEL);
        let turn = angle / level;
        let turns = |n: i32| (-n..=n).map(move |step| turn * step as f32 / n as f32);
        let at = |ring: usize, turn: f32| self.nearest(ring, self.azimuth(point) + turn);
        let distance = |ray: RingPoint| {
            let ray = self.position(ray) - self.scanner;
            let range = ray.length();
            let along = range * center.dot(normal) / ray.dot(normal);
            let is_passed = 0.0 < along && along + MIN_DEPTH * radius < range;
            is_passed.then(|| (along / range * ray).distance(center))
        };
        let of_own_ring = turns(N_OWN_SAMPLES).filter_map(|turn| match at(point.ring, turn) {
            Some(ray) => distance(ray),
            None => Some(turn.abs() * level * center.length()),
        });
        let below = |limit: f32| self.rings.partition_point(|ring| ring.elevation_rad < limit);
        let near = below(elevation_rad - angle)..below(elevation_rad + angle).max(point.ring + 1);
        let step = near.len().div_ceil(MAX_RINGS_OF_RAYS).max(1);
        let rays = near
            .step_by(step)
            .flat_map(|ring| turns(N_SAMPLES).filter_map(move |turn| at(ring, turn)));
        rays.filter_map(distance).chain(of_own_ring).fold(radius, f32::min)
    }

    /// Returns the point of the next ring on a side of a point, if both are on one surface: if the line between them is steep
    /// to the ray, goes on straight to the ring beyond, or comes straight from the ring on the other side.
    fn next_on_surface(&self, point: RingPoint, side: isize) -> Option<RingPoint> {
        let position = self.position(point);
        let step = |step: isize| {
            let ring = point.ring.checked_add_signed(step)?;
            self.nearest(ring, self.azimuth(point))
        };
        let position_at = |steps: isize| step(steps).map(|other| self.position(other));
        let next = step(side)?;
        let (gap, ray) = (self.position(next) - position, position - self.scanner);
        if MAX_GAP * ray.length() < gap.length() {
            return None;
        }
        let is_steep = gap.dot(ray).abs() < MAX_RAY_COSINE * gap.length() * ray.length();
        let goes_on = || {
            let beyond = position_at(2 * side);
            beyond.is_some_and(|beyond| self.is_straight(beyond, self.position(next), position))
        };
        let comes = || {
            let before = position_at(-side);
            before.is_some_and(|before| self.is_straight(before, position, self.position(next)))
        };
        (is_steep || goes_on() || comes()).then_some(next)
    }

    /// Returns the point of a ring at an azimuth.
    fn nearest(&self, ring: usize, azimuth: f32) -> Option<RingPoint> {
        let index = self.rings.get(ring)?.nearest(azimuth, self.max_turn)?;
        Some(RingPoint { ring, index })
    }

    fn position(&self, point: RingPoint) -> Vec3 {
        self.positions[self.rings[point.ring].points[point.index] as usize]
    }

    fn azimuth(&self, point: RingPoint) -> f32 {
        self.rings[point.ring].azimuths[point.index]
    }

    /// Returns the stretch of a ring within a distance from one of its points.
    fn stretch(&self, point: RingPoint, reach: f32) -> Stretch {
        let RingPoint { ring, index } = point;
        let position = self.position(point);
        let n_points = self.rings[ring].points.len();
        let mut count = 1;
        let mut sum_of_side = |sense: isize| {
            let indices = (1..=MAX_STRETCH_POINTS.min(n_points / 2)).map(|step| {
                (index as isize + sense * step as isize).rem_euclid(n_points as isize) as usize
            });
            let offsets = indices.map(|index| self.position(RingPoint { ring, index }) - position);
            let near = offsets.take_while(|offset| offset.length() < reach);
            near.inspect(|_| count += 1).sum::<Vec3>()
        };
        let [before, after] = [-1, 1].map(&mut sum_of_side);
        Stretch { mean: position + (before + after) / count as f32, direction: after - before }
    }

    /// True if the line through two points of successive rings goes on to a point of the next ring.
    fn is_straight(&self, first: Vec3, second: Vec3, third: Vec3) -> bool {
        let [before, gap] = [first.distance(second), second.distance(third)];
        if MAX_GAP_RATIO * before < gap || MAX_GAP_RATIO * gap < before {
            return false;
        }
        let measured = third - self.scanner;
        let range = measured.length();
        let expected = range_of_line(first - self.scanner, second - first, measured / range);
        expected.is_some_and(|expected| (expected - range).abs() <= MAX_DIFFERENCE * gap)
    }
}

/// Returns the range along a ray of unit direction `ray` from the zero at which it comes nearest to the line through `start`
/// along `line`; none if they are parallel.
fn range_of_line(start: Vec3, line: Vec3, ray: Vec3) -> Option<f32> {
    let across = line - line.dot(ray) * ray;
    let squared = across.length_squared();
    if squared <= 1e-9 * line.length_squared() {
        return None;
    }
    let along = start - start.dot(across) / squared * line;
    Some(along.dot(ray))
}

#[cfg(test)]
mod tests {
    //! Ground between rings, and a box that stands on it.

    use super::*;
    use crate::math::Random;
    use crate::points::{PointCloud, Preparation, prepare};
    use crate::progress::NoProgress;

    /// A scan of 32 rings, 1.2 degrees apart, from 1.8 above the ground. A box 1.3 high stands 8 to 10 away along X.
    fn scan() -> PointCloud {
        let ray = |i: usize| {
            let (ring, column) = (i / 1800, i % 1800);
            let (sin, cos) = (0.2 * column as f32).to_radians().sin_cos();
            let elevation = (1.2 * ring as f32 - 25.0).to_radians();
            Vec3::new(elevation.cos() * cos, elevation.cos() * sin, elevation.sin())
        };
        let point = |ray: Vec3| {
            let to_front = 8.0 / ray.x;
            let front = to_front * ray;
            let to_top = -0.5 / ray.z;
            let top = to_top * ray;
            let is_wide = |p: Vec3| p.y.abs() < 1.0;
            let range = if 0.0 < ray.x && is_wide(front) && (-1.8..-0.5).contains(&front.z) {
                to_front
            } else if 0.0 < ray.x && is_wide(top) && (8.0..10.0).contains(&top.x) {
                to_top
            } else {
                -1.8 / ray.z
            };
            (ray.z < 0.0 && range < 60.0).then_some(range * ray)
        };
        PointCloud::from_positions((0..32 * 1800).map(ray).filter_map(point).collect())
    }

    #[test]
    fn the_ground_is_closed_between_rings() {
        let (cloud, _) = prepare(scan(), &Preparation::default(), &NoProgress).unwrap();
        let structures = cloud.structures().unwrap();
        let discs: Vec<(Vec3, f32)> = (0..cloud.len())
            .filter(|point| structures[*point] == Structure::Surface)
            .map(|point| (cloud.positions()[point], cloud.radii()[point]))
            .collect();
        let is_ground = |point: &usize| {
            let position = cloud.positions()[*point];
            position.z < -1.79 && !(7.0 < position.x && position.y.abs() < 2.0)
        };
        let ground: Vec<usize> = (0..cloud.len()).filter(is_ground).collect();
        let is_level = |point: &&usize| 0.999 < cloud.normals()[**point].z;
        let n_level = ground.iter().filter(is_level).count();
        assert!(0.99 * ground.len() as f32 <= n_level as f32, "{n_level} of {}", ground.len());
        // Places between the rings, away from the box.
        for i in 0..200 {
            let (distance, azimuth) = (5.0 + 0.04 * i as f32, 1.0 + 0.02 * i as f32);
            let position = Vec3::new(distance * azimuth.cos(), distance * azimuth.sin(), -1.8);
            let covers = |(center, radius): &&(Vec3, f32)| center.distance(position) < *radius;
            let n_covering = discs.iter().filter(covers).count();
            assert!((3..100).contains(&n_covering), "{position}: {n_covering}");
        }
    }

    #[test]
    fn noise_along_rings_tilts_little_of_the_ground() {
        let mut random = Random::new(4, 0);
        let mut scan = scan();
        for position in &mut scan.positions {
            *position *= 1.0 + 0.05 * random.next_gaussian() as f32 / position.length();
        }
        let (cloud, _) = prepare(scan, &Preparation::default(), &NoProgress).unwrap();
        let structures = cloud.structures().unwrap();
        let is_near = |point: &usize| {
            let position = cloud.positions()[*point];
            let is_low = position.x < 6.0 && position.z < -1.7 && position.length() < 5.0;
            is_low && structures[*point] == Structure::Surface
        };
        let near: Vec<usize> = (0..cloud.len()).filter(is_near).collect();
        let n_level = near.iter().filter(|point| 0.98 < cloud.normals()[**point].z).count();
        assert!(100 < near.len(), "{}", near.len());
        // Planes through neighbours on one ring alone would leave 0.16 of them level.
        assert!(0.4 * near.len() as f32 <= n_level as f32, "{n_level} of {}", near.len());
    }

    #[test]
    fn discs_of_the_highest_ring_end_where_its_rays_passed() {
        // A pillar before a wall, both seen by two rings.
        let azimuths: Vec<f32> = (-100..=100).map(|i| 0.01 * i as f32).collect();
        let range = |azimuth: f32| if azimuth.abs() < 0.1 { 5.0 } else { 20.0 };
        let mut positions = Vec::new();
        let rings = [-0.09f32, 0.0].map(|elevation_rad| {
            let points = azimuths.iter().map(|azimuth| {
                let level = range(*azimuth) * elevation_rad.cos();
                let up = range(*azimuth) * elevation_rad.sin();
                positions.push(Vec3::new(level * azimuth.cos(), level * azimuth.sin(), up));
                positions.len() as u32 - 1
            });
            Ring { elevation_rad, points: points.collect(), azimuths: azimuths.clone() }
        });
        let surfaces = RingSurfaces {
            positions: &positions,
            rings: &rings,
            scanner: Vec3::ZERO,
            max_turn: 0.03,
        };
        for structure in [Structure::Surface, Structure::Line] {
            let wide = PointShape { structure, normal: Vec3::X, radius: 2.0 };
            let narrowed = |asked: Structure| {
                let mut shapes = vec![wide; positions.len()];
                surfaces.narrow_wide_discs(&mut shapes, |own| own == asked, &NoProgress).unwrap();
                rings.each_ref().map(|ring| shapes[ring.points[100] as usize].radius)
            };
            let radii = narrowed(structure);
            assert!(radii.iter().all(|radius| (0.4..1.0).contains(radius)), "{radii:?}");
            assert_eq!(narrowed(Structure::Scatter), [2.0; 2]);
        }
    }

    #[test]
    fn no_disc_bridges_a_jump_of_the_range() {
        let (cloud, _) = prepare(scan(), &Preparation::default(), &NoProgress).unwrap();
        for (position, radius) in cloud.positions().iter().zip(cloud.radii()) {
            if -1.7 < position.z {
                assert!(*radius < 1.2, "{position}: {radius}");
            }
        }
    }
}
