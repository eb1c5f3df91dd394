//! The plane of a point's own side of an edge.

use crate::math::{SymmetricMatrix, Vec3, hash, smallest_eigenvector};
use crate::points::neighbors::Neighbor;

/// Number of planes tried at a point that lies near an edge.
const N_PLANES: u64 = 24;
/// Distance from a plane of the points on it, in radii of the neighbourhood.
pub const PLANE_THICKNESS: f32 = 0.04;
/// Minimum fraction of the neighbours on the plane of an edge's side.
pub const MIN_PLANE_FRACTION: f32 = 0.5;
/// Minimum fraction of the neighbours on the plane of one side of a sharp edge or corner.
const MIN_SIDE_FRACTION: f32 = 0.4;

/// Returns the normal of the plane through the point on which the most neighbours lie, and their fraction: near an edge
/// that is the plane of the point's own side. `mean` is the normal of the plane through all of them, which another
/// plane has to excel. Returns none if too few lie on the plane.
pub fn plane_of_side(
    positions: &[Vec3],
    point: usize,
    neighbors: &[Neighbor],
    mean: Vec3,
) -> Option<(Vec3, f32)> {
    /// Ratio by which the plane of a side has to be better than the mean plane.
    const MIN_GAIN: f32 = 1.2;
    /// Ratio by which the plane of one side of a sharp edge is better than the mean plane. With 2, rough surfaces
    /// broke into facets.
    const MIN_SHARP_GAIN: f32 = 4.0;
    let center = positions[point];
    let offsets: Vec<Vec3> =
        neighbors.iter().map(|neighbor| positions[neighbor.index as usize] - center).collect();
    let reach = offsets.last()?.length();
    let thickness = PLANE_THICKNESS * reach;
    let score = |normal: Vec3| -> f32 {
        let closeness = |offset: &Vec3| {
            let height = normal.dot(*offset) / thickness;
            (1.0 - height * height).max(0.0)
        };
        offsets.iter().map(closeness).sum()
    };
    let n_neighbors = offsets.len() as u64;
    let candidates = (0..N_PLANES).filter_map(|plane| {
        let bits = hash((point as u64) << 8 | plane);
        let (a, b) = (bits % n_neighbors, (bits >> 32) % n_neighbors);
        let cross = offsets[a as usize].cross(offsets[b as usize]);
        // Nearly parallel offsets give a plane of any tilt.
        (0.05 * reach * reach < cross.length()).then(|| cross.normalize())
    });
    let scored = candidates.map(|normal| (score(normal), normal));
    let scored = scored.chain([(MIN_GAIN * score(mean), mean)]);
    let (best_score, normal) = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let on_plane = offsets.iter().filter(|offset| normal.dot(**offset).abs() < thickness);
    let (mut covariance, mut n_on_plane) = (SymmetricMatrix::default(), 0);
    for offset in on_plane {
        covariance.add_outer(offset.as_dvec3(), 1.0);
        n_on_plane += 1;
    }
    let fraction = n_on_plane as f32 / offsets.len() as f32;
    let is_sharp = MIN_SHARP_GAIN * score(mean) < best_score;
    let min_fraction = if is_sharp { MIN_SIDE_FRACTION } else { MIN_PLANE_FRACTION };
    if fraction < min_fraction {
        return None;
    }
    if normal == mean {
        return Some((mean, fraction));
    }
    let (refined, [_, middle, largest]) = smallest_eigenvector(&covariance);
    (0.1 * largest < middle).then(|| (refined.as_vec3().normalize(), fraction))
}
