//! Planes of flat faces, as walls and floors. They follow from eight times as many neighbours as other surfaces, so that
//! less noise is left. Points beyond the edge where two of them meet move onto it.

use crate::error::Result;
use crate::math::{DVec3, SymmetricMatrix, Vec3, smallest_eigenvector};
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::normals::jets::cubic_residual;
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of planes that are fitted per neighbourhood: of `count` neighbours, every `count / 3`-th point gets one.
const SAMPLES_PER_NEIGHBORS: usize = 3;
/// Numbers of neighbours, in multiples of those of other surfaces, and the greatest root mean square height, in standard
/// deviations of the noise, of the cubic through them over their plane. Each plane starts from the one before; the first
/// one is not judged.
const SCALES: [(usize, f32); 3] = [(1, f32::INFINITY), (4, 0.55), (8, 0.29)];
/// Maximum number of neighbours around a point, and of those among them that take part.
const MAX_NEIGHBORS: usize = 2048;
const MAX_FITTED: usize = 512;
/// Number of times that a plane is fitted again to the points near it.
const N_REFITS: usize = 2;
/// Distance from a plane of the points on it, in standard deviations of the noise.
const MAX_HEIGHT: f32 = 3.0;
/// Minimum fraction of the neighbours on the plane: at an edge half of them are, without those beside the edge.
const MIN_FRACTION: f32 = 0.35;
/// Distance along the plane from points off it, in spacings, within which a point does not count. Points of two faces lie
/// near the plane of either where these meet.
const MARGIN: f32 = 1.5;
/// Minimum ratio of the middle to the largest eigenvalue: many planes pass through a narrow strip.
const MIN_WIDTH: f64 = 0.1;
/// Maximum ratio of the variance of the neighbours to that of the noise.
const MAX_VARIANCE_RATIO: f32 = 1.8;
/// Number of planes around a point among which that of its face is sought.
const N_NEAREST: usize = 48;
/// Minimum number of neighbours that decide on which planes a point may be.
const MIN_SUPPORT_POINTS: usize = 24;
/// Minimum fraction of them on a plane.
const MIN_ON_PLANE: f32 = 0.3;
/// Maximum number of points, for each plane of a face, around which the face bends.
const MAX_BENT: usize = 2;
/// Cosine of the angle between normals: those of one face have more, those of two faces that meet in an edge less.
const MIN_SAME_FACE: f32 = 0.985;
const MAX_EDGE: f32 = 0.94;
/// Distance from the plane of another face, in standard deviations, of the points that tell which side is inside, and the
/// ratio of their numbers on both sides.
const CLEARLY_BESIDE: f32 = 2.0;
const MIN_INSIDE_RATIO: usize = 2;

/// The plane of a flat face.
#[derive(Clone, Copy)]
struct Plane {
    /// Point on the plane.
    middle: Vec3,
    /// Unit normal of either sign.
    normal: Vec3,
    /// Distance from the middle to which the plane is known.
    reach: f32,
}

/// The surface around a point.
#[derive(Clone, Copy)]
enum LocalSurface {
    Flat(Plane),
    /// A surface that bends, with the point.
    Bent(Vec3),
}

/// The flat faces of a cloud.
pub struct FlatFaces {
    /// The surface around some of the points.
    samples: Vec<LocalSurface>,
    /// Positions of these.
    sample_positions: Vec<Vec3>,
}

impl FlatFaces {
    /// Finds the flat faces. `counts` are the numbers of neighbours of each point that take part on other surfaces, zero for
    /// points that stay, `noises` the noise in spacings, and `normal_of` gives a rough normal of a point.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn find(
        tree: &KdTree,
        counts: &[u32],
        noises: &[Option<f32>],
        normal_of: impl Fn(usize) -> Vec3 + Sync,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let positions = tree.positions();
        let (largest, _) = SCALES[SCALES.len() - 1];
        let is_sample = |point: &usize| {
            let step = (counts[*point] as usize / SAMPLES_PER_NEIGHBORS).max(1);
            counts[*point] != 0 && point.is_multiple_of(step)
        };
        let asked: Vec<usize> = (0..positions.len()).filter(is_sample).collect();
        progress.begin("flat faces", asked.len() as u64);
        let around = |(i, point): (usize, &usize)| {
            progress.check()?;
            if i.is_multiple_of(256) {
                progress.advance(256.min(asked.len() - i) as u64);
            }
            let (position, normal) = (positions[*point], normal_of(*point));
            let count = (counts[*point] as usize).min(MAX_NEIGHBORS / largest);
            let neighbors = tree.nearest(position, largest * count, Some(*point as u32));
            if neighbors.len() < largest * count || normal == Vec3::ZERO {
                return Ok(None);
            }
            let noise = noises[*point].unwrap_or_default() * spacing(&neighbors[..count]);
            let start = Plane { middle: position, normal, reach: 0.0 };
            Ok(LocalSurface::new(positions, start, &neighbors, count, noise))
        };
        let found = asked.par_iter().enumerate().map(around).collect::<Result<Vec<_>>>()?;
        let samples: Vec<LocalSurface> = found.into_iter().flatten().collect();
        let position = |sample: &LocalSurface| match sample {
            LocalSurface::Flat(plane) => plane.middle,
            LocalSurface::Bent(position) => *position,
        };
        let sample_positions = samples.iter().map(position).collect();
        Ok(Self { samples, sample_positions })
    }

    /// Returns the tree over the positions at which the surface is known.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn tree(&self, progress: &dyn Progress) -> Result<KdTree<'_>> {
        KdTree::new(&self.sample_positions, progress)
    }

    /// Projects a point onto the plane of its face, or onto the edge if it lies beyond, and returns it with the normal
    /// of the face, zero near an edge. Returns none if the point is on no flat face.
    ///
    /// `sample_positions` is [`Self::tree`]. The `support_points` around the point are collected only if a flat face is
    /// near.
    pub fn project(
        &self,
        sample_positions: &KdTree,
        position: Vec3,
        support_points: impl FnOnce() -> SupportPoints,
    ) -> Option<(Vec3, Vec3)> {
        let (planes, bent) = self.near(sample_positions, position);
        if planes.is_empty() {
            return None;
        }
        let support_points = support_points();
        let mut faces = support_points.faces(planes, &bent, position);
        faces.retain(|face| support_points.is_on(face, position));
        let height = |face: &Plane| face.height(position).abs();
        let own = *faces.iter().min_by(|a, b| height(a).total_cmp(&height(b)))?;
        faces.retain(|other| own.normal.dot(other.normal).abs() < MAX_EDGE);
        let mut projected = position - own.normal * own.height(position);
        for other in &faces {
            if support_points.is_beyond(&own, other, projected) {
                let along = other.normal.reject_from(own.normal).normalize();
                projected -= along * (other.height(projected) / along.dot(other.normal));
            }
        }
        Some((projected, if faces.is_empty() { own.normal } else { Vec3::ZERO }))
    }

    /// Returns the planes that are known at a position, each with its distance, and the positions around it where the
    /// surface bends.
    fn near(&self, sample_positions: &KdTree, position: Vec3) -> (Vec<(Plane, f32)>, Vec<Vec3>) {
        let (mut planes, mut bent) = (Vec::new(), Vec::new());
        for sample in sample_positions.nearest(position, N_NEAREST, None) {
            let distance = sample.distance_squared.sqrt();
            match self.samples[sample.index as usize] {
                LocalSurface::Flat(plane) if distance < plane.reach => {
                    planes.push((plane, distance));
                }
                LocalSurface::Flat(_) => {}
                LocalSurface::Bent(position) => bent.push(position),
            }
        }
        (planes, bent)
    }
}

impl LocalSurface {
    /// Returns the surface around a point from its neighbours, nearest first: flat if noise of the standard deviation `noise`
    /// explains their distances from a plane, bent if not, none if no plane passes through enough of them. `start` is a
    /// rough plane, and `count` the number of neighbours that take part on other surfaces.
    fn new(
        positions: &[Vec3],
        start: Plane,
        neighbors: &[Neighbor],
        count: usize,
        noise: f32,
    ) -> Option<Self> {
        let mut plane = start;
        let step = neighbors.len().div_ceil(MAX_FITTED);
        for (scale, max_bend) in SCALES {
            let nearest = &neighbors[..scale * count];
            let fitted = nearest.iter().step_by(step);
            let points: Vec<Vec3> =
                fitted.map(|neighbor| positions[neighbor.index as usize]).collect();
            plane.reach = nearest.last()?.distance_squared.sqrt();
            let is_judged = max_bend < f32::INFINITY;
            let spacing = spacing(nearest) * (step as f32).sqrt();
            let margin = if is_judged { MARGIN * spacing } else { 0.0 };
            let (mut on_plane, mut variance) = (Vec::new(), 0.0);
            for _ in 0..N_REFITS {
                on_plane = plane.inside_face(&points, MAX_HEIGHT * noise, margin);
                let is_enough = MIN_FRACTION * points.len() as f32 <= on_plane.len() as f32;
                variance = is_enough.then(|| plane.refit(&on_plane)).flatten()?;
            }
            let is_bent = || plane.bend(&on_plane).is_none_or(|bend| max_bend * noise < bend);
            if is_judged && (MAX_VARIANCE_RATIO * noise * noise < variance || is_bent()) {
                return Some(Self::Bent(start.middle));
            }
        }
        Some(Self::Flat(plane))
    }
}

impl Plane {
    fn height(&self, position: Vec3) -> f32 {
        self.normal.dot(position - self.middle)
    }

    /// Returns the points nearer to the plane than `max_height`, without those beside points that are farther.
    fn inside_face(&self, points: &[Vec3], max_height: f32, margin: f32) -> Vec<Vec3> {
        let is_near = |point: &Vec3| self.height(*point).abs() < max_height;
        let (mut near, mut far): (Vec<Vec3>, Vec<Vec3>) = points.iter().partition(|p| is_near(p));
        // Those high above are not of a face that meets this one here.
        far.retain(|other| self.height(*other).abs() < max_height + 2.0 * margin);
        let is_beside = |point: &Vec3, other: &Vec3| {
            (other - point).reject_from_normalized(self.normal).length_squared() < margin * margin
        };
        near.retain(|point| !far.iter().any(|other| is_beside(point, other)));
        near
    }

    /// Fits the plane to points and returns the variance of their distances from it; none if they are a narrow strip.
    fn refit(&mut self, points: &[Vec3]) -> Option<f32> {
        let (mut scatter, mut sum) = (SymmetricMatrix::default(), DVec3::ZERO);
        for point in points {
            let offset = (point - self.middle).as_dvec3();
            scatter.add_outer(offset, 1.0);
            sum += offset;
        }
        let n_points = points.len() as f64;
        scatter.add_outer(sum, -1.0 / n_points);
        let (normal, [smallest, middle, largest]) = smallest_eigenvector(&scatter);
        // NaN fails this test, too.
        let is_wide = MIN_WIDTH * largest < middle;
        if !is_wide {
            return None;
        }
        self.normal = normal.as_vec3().normalize();
        self.middle += (sum / n_points).as_vec3();
        // A plane takes three points.
        Some((smallest.max(0.0) / (n_points - 3.0).max(1.0)) as f32)
    }

    /// Returns the root mean square height over the plane of the cubic through the points that the plane is fitted to, or
    /// none if they do not determine a cubic.
    fn bend(&self, points: &[Vec3]) -> Option<f32> {
        let (u, v) = self.normal.any_orthonormal_pair();
        let coordinates = |point: &Vec3| {
            let offset = (point - self.middle) / self.reach;
            [u, v, self.normal].map(|axis| f64::from(axis.dot(offset)))
        };
        let points: Vec<[f64; 3]> = points.iter().map(coordinates).collect();
        let of_plane: f64 = points.iter().map(|[.., height]| height * height).sum();
        let explained = (of_plane - cubic_residual(&points)?).max(0.0);
        Some(self.reach * (explained / points.len() as f64).sqrt() as f32)
    }

    /// Returns the mean at a position of planes, each with its distance from there; the nearer ones have more weight.
    fn mean(planes: &[(Self, f32)], position: Vec3) -> Self {
        let (first, _) = planes[0];
        let (mut normal, mut height, mut weights) = (Vec3::ZERO, 0.0, 0.0);
        for (plane, distance) in planes {
            let inside = 1.0 - (distance / plane.reach).powi(2);
            let weight = (inside * inside).max(f32::EPSILON);
            let signed = weight * plane.normal.dot(first.normal).signum();
            normal += signed * plane.normal;
            height += signed * plane.height(position);
            weights += weight;
        }
        let normal = normal.normalize();
        Self { middle: position - normal * (height / weights), normal, reach: first.reach }
    }
}

/// The neighbours of a point, which decide on which faces it may be.
pub struct SupportPoints {
    positions: Vec<Vec3>,
    /// Standard deviation of the noise.
    noise: f32,
}

impl SupportPoints {
    /// Returns the neighbours of a point: as many as take part on other surfaces, or more. `noise` is in spacings.
    pub fn around(tree: &KdTree, point: usize, count: usize, noise: f32) -> Self {
        let positions = tree.positions();
        let n_neighbors = MIN_SUPPORT_POINTS.max(count);
        let neighbors = tree.nearest(positions[point], n_neighbors, Some(point as u32));
        let noise = noise * spacing(&neighbors);
        let position = |neighbor: &Neighbor| positions[neighbor.index as usize];
        Self { positions: neighbors.iter().map(position).collect(), noise }
    }

    /// Returns the mean plane of each face on which enough of the neighbours lie. `planes` are those near `position`, with
    /// their distances, and `bent` the positions where the surface bends.
    fn faces(&self, mut planes: Vec<(Plane, f32)>, bent: &[Vec3], position: Vec3) -> Vec<Plane> {
        planes.retain(|(plane, _)| self.are_on(plane));
        let mut faces = Vec::new();
        while let Some((first, _)) = planes.first().copied() {
            let is_same = |(plane, _): &(Plane, f32)| {
                let cosine = first.normal.dot(plane.normal);
                let height = plane.height(position) * cosine.signum();
                let step = (first.height(position) - height).abs();
                MIN_SAME_FACE < cosine.abs() && step < self.noise
            };
            let (same, others): (Vec<_>, Vec<_>) = planes.into_iter().partition(is_same);
            let face = Plane::mean(&same, position);
            let n_bent = bent.iter().filter(|position| self.is_on(&face, **position)).count();
            if n_bent <= MAX_BENT * same.len() {
                faces.push(face);
            }
            planes = others;
        }
        faces
    }

    fn is_on(&self, plane: &Plane, position: Vec3) -> bool {
        plane.height(position).abs() < MAX_HEIGHT * self.noise
    }

    /// True if enough of the neighbours are on a plane.
    fn are_on(&self, plane: &Plane) -> bool {
        let n_on = self.positions.iter().filter(|position| self.is_on(plane, **position)).count();
        MIN_ON_PLANE * self.positions.len() as f32 <= n_on as f32
    }

    /// True if a position on the face `own` lies on that side of another face where `own` has no points.
    fn is_beyond(&self, own: &Plane, other: &Plane, position: Vec3) -> bool {
        let clearly = CLEARLY_BESIDE * self.noise;
        let on_own = self.positions.iter().filter(|position| self.is_on(own, **position));
        let (mut n_above, mut n_below) = (0, 0);
        for height in on_own.map(|position| other.height(*position)) {
            n_above += usize::from(clearly < height);
            n_below += usize::from(height < -clearly);
        }
        match 0.0 < other.height(position) {
            true => MIN_INSIDE_RATIO * n_above < n_below,
            false => MIN_INSIDE_RATIO * n_below < n_above,
        }
    }
}

/// Returns the spacing of points on a surface that has these neighbours, nearest first.
fn spacing(neighbors: &[Neighbor]) -> f32 {
    let reach = neighbors.last().map_or(0.0, |last| last.distance_squared);
    (std::f32::consts::PI * reach / (neighbors.len() + 1) as f32).sqrt()
}

#[cfg(test)]
mod tests {
    //! Noisy clouds with known faces.

    use super::*;
    use crate::math::Random;
    use crate::points::{Denoise, PointCloud, denoise};
    use crate::progress::NoProgress;

    #[test]
    fn faces_of_a_noisy_box_are_flat_and_end_at_its_edges() {
        let (mut random, half) = (Random::new(4, 0), 30.0f32);
        let mut points = Vec::new();
        for axis in 0..3 {
            for (sign, i) in
                [-1.0, 1.0].into_iter().flat_map(|sign| (0..3600).map(move |i| (sign, i)))
            {
                let mut coordinates = [sign * half; 3];
                coordinates[(axis + 1) % 3] = (i % 60) as f32 + 0.5 - half;
                coordinates[(axis + 2) % 3] = (i / 60) as f32 + 0.5 - half;
                points.push(coordinates.map(|x| x + 0.3 * random.next_gaussian() as f32));
            }
        }
        let points = points.into_iter().map(Vec3::from_array).collect();
        let mut cloud = PointCloud::from_positions(points);
        denoise(&mut cloud, Denoise::Auto, &NoProgress).unwrap().unwrap();
        let outside = |point: &Vec3| point.abs().max_element() - half;
        let heights: Vec<f32> = cloud.positions.iter().map(outside).collect();
        let mean_square = heights.iter().map(|x| x * x).sum::<f32>() / heights.len() as f32;
        // The noise is 0.3.
        assert!(mean_square.sqrt() < 0.09, "{}", mean_square.sqrt());
        let n_outside = heights.iter().filter(|height| 0.3 < **height).count();
        assert!(n_outside < heights.len() / 100, "{n_outside}");
    }

    #[test]
    fn points_beyond_an_obtuse_edge_move_onto_it() {
        let mut random = Random::new(6, 0);
        // The faces go down from the edge, which is the Y axis, with an angle of 130 degrees in between.
        let (sin, cos) = 25f32.to_radians().sin_cos();
        let points = (0..7200).map(|i| {
            let (side, down) = ([-1.0, 1.0][i % 2], 60.0 * random.next_f32());
            let point = Vec3::new(side * cos * down, 60.0 * random.next_f32(), -sin * down);
            point + 0.6 * Vec3::from_array([(); 3].map(|()| random.next_gaussian() as f32))
        });
        let mut cloud = PointCloud::from_positions(points.collect());
        denoise(&mut cloud, Denoise::Auto, &NoProgress).unwrap().unwrap();
        let above = |p: &&Vec3| 0.3 < p.z + sin / cos * p.x.abs() && (5.0..55.0).contains(&p.y);
        let n_above = cloud.positions.iter().filter(above).count();
        assert!(n_above < 14, "{n_above}");
    }

    #[test]
    fn a_wall_goes_on_behind_a_shelf() {
        let mut random = Random::new(5, 0);
        let mut noise = || 0.3 * random.next_gaussian() as f32;
        let wall = (0..2500).map(|i| Vec3::new((i % 50) as f32, 0.0, (i / 50) as f32));
        let shelf = (0..1000).map(|i| Vec3::new((i % 50) as f32, 1.0 + (i / 50) as f32, 25.0));
        let points = wall.chain(shelf).map(|p| p + Vec3::new(noise(), noise(), noise()));
        let mut cloud = PointCloud::from_positions(points.collect());
        let before = cloud.positions.clone();
        denoise(&mut cloud, Denoise::On, &NoProgress).unwrap().unwrap();
        let moved = before[..2500].iter().zip(&cloud.positions).map(|(a, b)| (a.z - b.z).abs());
        assert!(moved.clone().fold(0.0, f32::max) < 1.0);
        assert!(moved.sum::<f32>() / 2500.0 < 0.05);
    }
}
