//! Patches of surface in crowns: by chance some leaves lie in a plane.

use super::connected_parts::connected_parts;
use super::point_shape::{PointShape, Structure};
use super::solids::apply_structure;
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::radii::radius::kth_distance;
use crate::progress::Progress;
use rayon::prelude::*;

/// Minimum cosine between the normals of connected points.
const MIN_LINK_COSINE: f32 = 0.7;
/// Maximum number of points of a patch that is less than one neighbourhood.
const MAX_LONE: usize = 16;
/// Maximum number of points of a patch.
const MAX_POINTS: usize = 128;
/// Maximum cosine between the normals of a steep patch and of the land.
const MAX_STEEP_COSINE: f32 = 0.87;
/// Number of neighbours among which scattered points are counted.
const N_NEIGHBORS: usize = 64;
/// Number of nearest ones, whose radius heights are relative to.
const N_NEAREST: usize = 12;
/// Height of points beside a patch, in radii.
const MIN_HEIGHT: f32 = 0.25;
/// Minimum fraction of the neighbours of a patch in a crown that are scattered points beside it.
const MIN_SCATTERED: f32 = 0.12;
/// Minimum fraction of them on each side of the patch.
const MIN_ON_EACH_SIDE: f32 = 0.03;

/// Makes scattered points of the patches of surface in crowns: small ones that lie amid scattered points. Level ones have more
/// of these below than above. In a cloud with much vegetation, which `is_wooded`, steep patches of at most as many points as a
/// neighbourhood has are scattered, too. `up` is the normal of the land, and `radii` are those of points of surfaces.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn scatter_crown_patches(
    tree: &KdTree,
    radii: &[f32],
    up: Vec3,
    is_wooded: bool,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let patches = small_patches(tree, shapes, progress)?;
    let in_crown = |patch: &Vec<u32>| {
        progress.check()?;
        let is_lone = is_wooded && patch.len() <= MAX_LONE;
        let is_steep = is_steep(shapes, up, patch);
        Ok(is_lone && is_steep || is_amid_scattered(tree, shapes, up, is_steep, patch))
    };
    let in_crown: Vec<bool> = patches.par_iter().map(in_crown).collect::<Result<_>>()?;
    let patches = patches.into_iter().zip(in_crown).filter(|(_, in_crown)| *in_crown);
    for point in patches.flat_map(|(patch, _)| patch) {
        let point = point as usize;
        apply_structure(tree, point, radii[point], Structure::Scatter, &mut shapes[point]);
    }
    Ok(())
}

/// Returns the points of the patches of surface that have at most `MAX_POINTS` of them.
fn small_patches(
    tree: &KdTree,
    shapes: &[PointShape],
    progress: &dyn Progress,
) -> Result<Vec<Vec<u32>>> {
    let is_surface = |point: usize| shapes[point].structure == Structure::Surface;
    let is_linked = |point: usize, other: usize| {
        MIN_LINK_COSINE < shapes[point].normal.dot(shapes[other].normal).abs()
    };
    let mut patches = connected_parts(tree, is_surface, is_linked, progress)?;
    patches.retain(|patch| patch.len() <= MAX_POINTS);
    Ok(patches)
}

/// True if most of the points of a patch are steep.
fn is_steep(shapes: &[PointShape], up: Vec3, patch: &[u32]) -> bool {
    let n_steep = patch
        .iter()
        .filter(|point| shapes[**point as usize].normal.dot(up).abs() < MAX_STEEP_COSINE)
        .count();
    patch.len() < 2 * n_steep
}

/// True if a patch has scattered points on both sides, and below rather than above if it is not steep.
fn is_amid_scattered(
    tree: &KdTree,
    shapes: &[PointShape],
    up: Vec3,
    is_steep: bool,
    patch: &[u32],
) -> bool {
    let (mut n_above, mut n_below) = (0, 0);
    for point in patch {
        let position = tree.positions()[*point as usize];
        let neighbors = tree.nearest(position, N_NEIGHBORS, Some(*point));
        let min_height = MIN_HEIGHT * kth_distance(&neighbors, N_NEAREST);
        let normal = shapes[*point as usize].normal;
        let upward = if normal.dot(up) < 0.0 { -normal } else { normal };
        let height =
            |neighbor: &Neighbor| upward.dot(tree.positions()[neighbor.index as usize] - position);
        let is_scattered =
            |neighbor: &&Neighbor| shapes[neighbor.index as usize].structure == Structure::Scatter;
        for height in neighbors.iter().filter(is_scattered).map(height) {
            n_above += usize::from(min_height < height);
            n_below += usize::from(height < -min_height);
        }
    }
    let n_neighbors = (N_NEIGHBORS * patch.len()) as f32;
    let [above, below] = [n_above, n_below].map(|n| n as f32 / n_neighbors);
    MIN_SCATTERED <= above + below
        && MIN_ON_EACH_SIDE <= above.min(below)
        && (is_steep || above < below)
}

#[cfg(test)]
mod tests {
    //! Level and steep patches on land, in a crown and on their own.

    use super::*;
    use crate::math::Random;
    use crate::points::test_clouds::prepared;
    use crate::progress::NoProgress;

    /// Makes points of a kind with a normal, in a box about a position.
    struct Wood {
        random: Random,
        positions: Vec<Vec3>,
        shapes: Vec<PointShape>,
    }

    impl Wood {
        fn add(&mut self, n: usize, center: Vec3, size: Vec3, structure: Structure, normal: Vec3) {
            for _ in 0..n {
                let offset = Vec3::from_array([0; 3].map(|_| self.random.next_f32() - 0.5));
                self.positions.push(center + size * offset);
                self.shapes.push(PointShape { structure, normal, radius: 1.0 });
            }
        }
    }

    #[test]
    fn small_patches_amid_leaves_are_scattered_and_others_stay() {
        let mut wood =
            Wood { random: Random::new(3, 0), positions: Vec::new(), shapes: Vec::new() };
        let level = Vec3::new(4.0, 4.0, 0.01);
        let upright = Vec3::new(4.0, 0.01, 4.0);
        let crown = Vec3::new(0.0, 0.0, 15.0);
        let clearing = Vec3::new(70.0, 0.0, 0.5);
        let mut ends = Vec::new();
        for (n, center, size, structure, normal) in [
            (8000, Vec3::ZERO, Vec3::new(90.0, 90.0, 0.01), Structure::Surface, Vec3::Z),
            (3000, crown, Vec3::splat(14.0), Structure::Scatter, Vec3::X),
            // Amid the crown.
            (60, crown, upright, Structure::Surface, Vec3::Y),
            (60, crown - 3.0 * Vec3::Z, level, Structure::Surface, Vec3::Z),
            // Too few for a neighbourhood.
            (10, Vec3::new(30.0, 0.0, 6.0), upright, Structure::Surface, Vec3::Y),
            // A wall without leaves, and a clearing under bushes.
            (100, Vec3::new(-30.0, 0.0, 3.0), upright, Structure::Surface, Vec3::Y),
            (100, clearing, level, Structure::Surface, Vec3::Z),
            (300, clearing + Vec3::Z, Vec3::new(6.0, 6.0, 1.0), Structure::Scatter, Vec3::X),
        ] {
            wood.add(n, center, size, structure, normal);
            ends.push(wood.positions.len());
        }
        let tree = KdTree::new(&wood.positions, &NoProgress).unwrap();
        let scattered = |is_wooded: bool| {
            let (radii, mut shapes) = (vec![1.0; wood.shapes.len()], wood.shapes.clone());
            scatter_crown_patches(&tree, &radii, Vec3::Z, is_wooded, &mut shapes, &NoProgress)
                .unwrap();
            let fraction = |of: usize| {
                let part = &shapes[of.checked_sub(1).map_or(0, |before| ends[before])..ends[of]];
                let is_scattered = |shape: &&PointShape| shape.structure == Structure::Scatter;
                part.iter().filter(is_scattered).count() as f32 / part.len() as f32
            };
            [0, 1, 2, 3, 4, 5, 6, 7].map(fraction)
        };
        assert_eq!(scattered(true), [0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0]);
        // On land with few plants a small steep patch may be of a wall.
        assert_eq!(scattered(false), [0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn patches_in_the_crown_of_a_lone_tree_are_leaves_and_those_of_a_wall_are_not() {
        let mut random = Random::new(4, 0);
        let mut within =
            |size: Vec3| size * Vec3::from_array([0; 3].map(|_| random.next_f32() - 0.5));
        let mut points: Vec<Vec3> =
            (0..20_000).map(|_| within(Vec3::new(60.0, 60.0, 0.01))).collect();
        let (tree, wall) = (Vec3::new(0.0, 0.0, 14.0), Vec3::new(20.0, 0.0, 6.0));
        let patch = Vec3::new(4.0, 0.01, 4.0);
        points.extend((0..100).map(|_| tree + within(patch)));
        points.extend((0..100).map(|_| wall + within(patch)));
        points.extend((0..3000).map(|_| tree + within(Vec3::splat(10.0))));
        let (_, structures) = prepared(points);
        let n_scattered = |points: std::ops::Range<usize>| {
            let structures = structures[points].iter();
            structures.filter(|structure| **structure == Structure::Scatter).count()
        };
        let [of_tree, of_wall] = [20_000..20_100, 20_100..20_200].map(n_scattered);
        assert!(90 < of_tree && of_wall < 10, "{of_tree} {of_wall}");
    }
}
