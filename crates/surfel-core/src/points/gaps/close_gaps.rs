//! Gaps between samplings of one surface, as between the dense rings around a scanner and the sparse points that other
//! scanners see among them.
//!
//! The nearest neighbours of a point by a gap lie on one side of it, so that its disc ends before the gap. Where points of
//! the same surface lie beyond, on all sides, the discs are widened until both sides reach each other. Around an open
//! border no points lie beyond. Land under trees has wide gaps where crowns hide it, which are closed as well.

use super::free_space::FreeSpace;
use crate::error::Result;
use crate::math::{Basis, Vec3};
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::structure::octants::{Octants, octant_around};
use crate::points::structure::point_shape::{PointShape, Structure};
use crate::progress::Progress;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Number of neighbours whose directions tell whether a point lies by a gap.
pub const N_AROUND: usize = 16;
/// Minimum number of successive octants without a neighbour at a gap.
const MIN_EMPTY: usize = 3;
/// Minimum number of them where all points beyond the gap lie as densely: the border of a random sampling is ragged, and each
/// of its points sees others of it.
const MIN_EMPTY_OF_EVEN: usize = 2;
/// Minimum ratio between the radii of points that do not lie as densely.
const MIN_UNEVEN_RATIO: f32 = 1.5;
/// Number of points by gaps, of those with radii in one octave, among which the other side is sought. Among all, those of
/// a dense sampling would leave no room for others.
const N_CANDIDATES: usize = 16;
/// Maximum width of a gap, in radii of the disc from which it is seen.
const MAX_WIDTH: f32 = 1.5;
/// Number of points among which the other side is sought on land under trees, where gaps are wide.
const N_CANDIDATES_UNDER_TREES: usize = 64;
/// Maximum width of a gap in land under trees, in radii of the disc from which it is seen.
const MAX_WIDTH_UNDER_TREES: f32 = 3.0;
/// Minimum cosine between the normal of such land and that of a disc on it.
const MIN_LAND_COSINE: f32 = 0.8;
/// Minimum cosine between the normals of the two sides of a gap.
const MIN_COSINE: f32 = 0.9;
/// Maximum height of one side above the plane of the other, by their distance.
const MAX_SLOPE: f32 = 0.15;
/// Ratio of the radius of a widened disc to the width of the gap.
const OVERLAP: f32 = 1.25;
/// Ratio of the radius of a widened disc to its radius before from which its plane must be that of the other side more
/// exactly: its rim would stand out otherwise.
const FAR_WIDENING: f32 = 3.0;
/// Minimum cosine and maximum slope of such discs.
const MIN_FAR_COSINE: f32 = 0.985;
const MAX_FAR_SLOPE: f32 = 0.08;

/// Returns the octants around a normal in which the neighbours lie.
fn octants_of(positions: &[Vec3], point: usize, neighbors: &[Neighbor], basis: &Basis) -> Octants {
    let nearest = neighbors.iter().take(N_AROUND);
    Octants::of(basis, nearest.map(|other| positions[other.index as usize] - positions[point]))
}

/// True if the nearest neighbours of a point leave a gap around it.
pub fn is_by_gap(positions: &[Vec3], point: usize, neighbors: &[Neighbor], normal: Vec3) -> bool {
    normal == Vec3::ZERO
        || octants_of(positions, point, neighbors, &Basis::around(normal)).has_gap(MIN_EMPTY)
}

/// Widens the discs on both sides of gaps until they reach each other, as far as no scanner saw through the gap. `radii`
/// are the distances to the nearest neighbours, and `is_by_gap` has an entry for each point. `land` is the normal, of either
/// sign, of land under trees.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn close_gaps(
    tree: &KdTree,
    radii: &[f32],
    is_by_gap: &[bool],
    free_space: &FreeSpace,
    land: Option<Vec3>,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let sides = sides(tree, radii, is_by_gap, shapes, progress)?;
    let octaves = Octaves::new(tree.positions(), &sides, shapes);
    let trees = octaves.positions.iter().map(|positions| KdTree::new(positions, progress));
    let trees = trees.collect::<Result<Vec<_>>>()?;
    let links = |index: usize| {
        progress.check()?;
        let own = &sides[index];
        let point = own.point as usize;
        let is_on_land = |land: Vec3| MIN_LAND_COSINE < land.dot(shapes[point].normal).abs();
        let (max_width, n_candidates) = match land.is_some_and(is_on_land) {
            true => (MAX_WIDTH_UNDER_TREES, N_CANDIDATES_UNDER_TREES),
            false => (MAX_WIDTH, N_CANDIDATES),
        };
        let max_distance = max_width * shapes[point].radius;
        let others = octaves.nearest(&trees, tree.positions()[point], n_candidates, max_distance);
        Ok(widened(own, others, &sides, tree.positions(), shapes))
    };
    let links = (0..sides.len()).into_par_iter().map(links);
    let mut widened: Vec<(u32, f32)> = links.collect::<Result<Vec<_>>>()?.concat();
    widened.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
    widened.dedup_by_key(|(point, _)| *point);
    let limited = |(point, radius): (u32, f32)| {
        let shape = shapes[point as usize];
        let wide = PointShape { radius, ..shape };
        let free = free_space.free_radius(tree.positions()[point as usize], &wide);
        (point, free.max(shape.radius))
    };
    let widened: Vec<(u32, f32)> = widened.into_par_iter().map(limited).collect();
    for (point, radius) in widened {
        shapes[point as usize].radius = radius;
    }
    Ok(())
}

/// A surface point on the side of a gap.
struct Side {
    point: u32,
    /// Octants in which it has neighbours within its disc.
    octants: Octants,
}

impl Side {
    /// True if the side has a gap at an octant, and no other gap: beyond a corner no points lie.
    fn is_closed_by(&self, octant: usize) -> bool {
        let mut octants = self.octants;
        octants.insert(octant);
        !self.octants.contains(octant) && !octants.has_gap(MIN_EMPTY)
    }
}

/// Returns the points whose neighbours leave a gap, and those whose discs were widened to reach neighbours all around.
fn sides(
    tree: &KdTree,
    radii: &[f32],
    is_by_gap: &[bool],
    shapes: &[PointShape],
    progress: &dyn Progress,
) -> Result<Vec<Side>> {
    let positions = tree.positions();
    let side = |point: usize| {
        progress.check()?;
        let shape = &shapes[point];
        if shape.structure != Structure::Surface || shape.normal == Vec3::ZERO {
            return Ok(None);
        }
        if radii[point] < shape.radius {
            return Ok(Some(Side { point: point as u32, octants: Octants::ALL }));
        }
        if !is_by_gap[point] {
            return Ok(None);
        }
        let neighbors = tree.nearest(positions[point], N_AROUND, Some(point as u32));
        let octants = octants_of(positions, point, &neighbors, &Basis::around(shape.normal));
        Ok(Some(Side { point: point as u32, octants }))
    };
    let sides = (0..shapes.len()).into_par_iter().map(side).collect::<Result<Vec<_>>>()?;
    Ok(sides.into_iter().flatten().collect())
}

/// Sides by octaves of their radii.
#[derive(Default)]
struct Octaves {
    sides: Vec<Vec<u32>>,
    positions: Vec<Vec<Vec3>>,
}

impl Octaves {
    fn new(positions: &[Vec3], sides: &[Side], shapes: &[PointShape]) -> Self {
        let mut of_octave: BTreeMap<i32, Vec<u32>> = BTreeMap::new();
        for (index, side) in sides.iter().enumerate() {
            let octave = shapes[side.point as usize].radius.log2().floor() as i32;
            of_octave.entry(octave).or_default().push(index as u32);
        }
        let position = |index: &u32| positions[sides[*index as usize].point as usize];
        let sides: Vec<Vec<u32>> = of_octave.into_values().collect();
        let positions = sides.iter().map(|sides| sides.iter().map(position).collect()).collect();
        Self { sides, positions }
    }

    /// Returns the sides near a position, up to `n_candidates` of each octave, nearest first; the one at the position is among
    /// them. The index of each is its index among all sides.
    fn nearest(
        &self,
        trees: &[KdTree],
        position: Vec3,
        n_candidates: usize,
        max_distance: f32,
    ) -> Vec<Neighbor> {
        let of_tree = |(tree, sides): (&KdTree, &Vec<u32>)| {
            let mut neighbors = tree.nearest_within(position, n_candidates, max_distance);
            neighbors.iter_mut().for_each(|found| found.index = sides[found.index as usize]);
            neighbors
        };
        let mut neighbors: Vec<Neighbor> =
            trees.iter().zip(&self.sides).flat_map(of_tree).collect();
        let key = |neighbor: &Neighbor| (neighbor.distance_squared, neighbor.index);
        neighbors.sort_unstable_by(|a, b| {
            let ((a, a_index), (b, b_index)) = (key(a), key(b));
            a.total_cmp(&b).then(a_index.cmp(&b_index))
        });
        neighbors
    }
}

/// Returns the radii with which a side and those that it sees across gaps reach each other, if they surround it. `others`
/// come nearest first.
fn widened(
    own: &Side,
    others: Vec<Neighbor>,
    sides: &[Side],
    positions: &[Vec3],
    shapes: &[PointShape],
) -> Vec<(u32, f32)> {
    let (shape, position) = (shapes[own.point as usize], positions[own.point as usize]);
    let basis = Basis::around(shape.normal);
    let mut seen = Octants::default();
    let mut widened = Vec::new();
    let mut radius = shape.radius;
    let mut min_empty = MIN_EMPTY_OF_EVEN;
    for neighbor in others {
        let distance = neighbor.distance_squared.sqrt();
        let other = &sides[neighbor.index as usize];
        let offset = positions[other.point as usize] - position;
        let octant_of_other = octant_around(&basis, offset);
        let other_shape = &shapes[other.point as usize];

        if distance == 0.0
            || seen.contains(octant_of_other)
            || !is_one_surface(&shape, other_shape, offset, MIN_COSINE, MAX_SLOPE)
        {
            continue;
        }
        seen.insert(octant_of_other);
        let ratio = shape.radius / other_shape.radius;
        if MIN_UNEVEN_RATIO < ratio.max(1.0 / ratio) {
            min_empty = MIN_EMPTY;
        }
        let reach = OVERLAP * distance;
        if !own.octants.contains(octant_of_other) {
            radius = radius.max(reach);
        }
        let octant_of_own = octant_around(&Basis::around(other_shape.normal), -offset);
        if other_shape.radius < reach
            && other.is_closed_by(octant_of_own)
            && can_reach(other_shape, &shape, offset, reach)
        {
            widened.push((other.point, reach));
        }
    }
    if seen.union(own.octants).has_gap(min_empty) {
        return Vec::new();
    }
    if shape.radius < radius {
        widened.push((own.point, radius));
    }
    widened
}

/// True if a disc can be widened to `reach` so that it lies on the surface of another disc.
fn can_reach(disc: &PointShape, other: &PointShape, offset: Vec3, reach: f32) -> bool {
    reach < FAR_WIDENING * disc.radius
        || is_one_surface(disc, other, offset, MIN_FAR_COSINE, MAX_FAR_SLOPE)
}

/// True if two discs lie in one plane, up to an angle and a slope. `offset` leads from one to the other.
fn is_one_surface(
    a: &PointShape,
    b: &PointShape,
    offset: Vec3,
    min_cosine: f32,
    max_slope: f32,
) -> bool {
    let height = a.normal.dot(offset).abs().max(b.normal.dot(offset).abs());
    min_cosine < a.normal.dot(b.normal).abs() && height < max_slope * offset.length()
}

#[cfg(test)]
mod tests {
    //! Planes whose density jumps, and land under a tree.

    use super::*;
    use crate::math::Random;
    use crate::points::{PointCloud, Preparation, prepare};
    use crate::progress::NoProgress;

    /// Returns the prepared radii of points on a plane: dense ones, 0.01 apart, outside of the circle of radius 1, and
    /// sparse ones, 0.1 apart, inside of the circle of radius `inner`.
    fn radii(inner: f32) -> Vec<(Vec3, f32)> {
        let mut random = Random::new(7, 0);
        let mut jitter = |size: f32| size * (random.next_f32() - 0.5);
        let mut positions = Vec::new();
        for (spacing, from, to) in [(0.01, 1.0, 1.5), (0.1, 0.0, inner)] {
            let n = (1.5 / spacing) as i32;
            for (x, y) in (-n..=n).flat_map(|x| (-n..=n).map(move |y| (x as f32, y as f32))) {
                let at =
                    Vec3::new(x * spacing + jitter(spacing), y * spacing + jitter(spacing), 0.0);
                if (from..to).contains(&at.length()) {
                    positions.push(at);
                }
            }
        }
        let cloud = PointCloud::from_positions(positions);
        let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        cloud.positions.iter().copied().zip(cloud.radii().iter().copied()).collect()
    }

    #[test]
    fn dense_points_reach_sparse_ones_across_a_gap() {
        let is_wide = |(at, radius): &(Vec3, f32)| 1.0 <= at.length() && 0.12 < *radius;
        let at_gap = radii(0.9).into_iter().filter(is_wide).collect::<Vec<_>>();
        assert!((20..400).contains(&at_gap.len()), "{}", at_gap.len());
        let n_inside = at_gap.iter().filter(|(at, _)| 1.05 < at.length()).count();
        assert!(5 * n_inside < at_gap.len(), "{n_inside} of {}", at_gap.len());
        let around_nothing = radii(0.0);
        assert!(!around_nothing.iter().any(is_wide), "an open border stays as it is");
    }

    #[test]
    fn land_is_closed_under_trees() {
        let mut random = Random::new(3, 0);
        let mut within = |size: f32| size * (random.next_f32() - 0.5);
        // The gap is 9 wide, the points of the land are 1 apart.
        let land = (0..1600).map(|i| [i % 40, i / 40].map(|at| at as f32 - 19.5));
        let land = land.map(|[x, y]| Vec3::new(x + within(0.6), y + within(0.6), within(0.1)));
        let land: Vec<Vec3> = land.filter(|at| 4.5 < at.truncate().length()).collect();
        let crown: Vec<Vec3> =
            (0..800).map(|_| Vec3::new(within(8.0), within(8.0), 9.0 + within(8.0))).collect();
        let covers_middle = |points: &[Vec3]| {
            let cloud = PointCloud::from_positions(points.to_vec());
            let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
            let on_land = cloud.positions.iter().zip(cloud.radii()).take(land.len());
            on_land.filter(|(at, radius)| at.length() < **radius).count()
        };
        let n_covering = covers_middle(&[&land[..], &crown].concat());
        assert!(3 < n_covering, "{n_covering}");
        assert_eq!(covers_middle(&land), 0, "without trees the gap may be a pond");
    }

    #[test]
    fn discs_are_widened_far_only_in_the_plane_of_the_other_side() {
        let disc = |tilt_deg: f32, radius: f32| {
            let (sin, cos) = tilt_deg.to_radians().sin_cos();
            let structure = Structure::Surface;
            PointShape { structure, normal: Vec3::new(sin, 0.0, cos), radius }
        };
        let level = disc(0.0, 2.0);
        let can_reach = |tilt_deg: f32, radius: f32| {
            can_reach(&disc(tilt_deg, radius), &level, 3.0 * Vec3::Y, 3.75)
        };
        assert!(can_reach(20.0, 1.5) && can_reach(3.0, 0.5));
        assert!(!can_reach(12.0, 0.5));
    }

    #[test]
    fn a_side_at_a_corner_has_another_gap() {
        let side = |octants: &[usize]| {
            let mut found = Octants::default();
            octants.iter().for_each(|octant| found.insert(*octant));
            Side { point: 0, octants: found }
        };
        let border = side(&[0, 1, 2, 3]);
        assert!(border.is_closed_by(5) && !border.is_closed_by(2));
        assert!(!side(&[0, 1]).is_closed_by(5));
    }
}
