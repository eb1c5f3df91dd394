//! Surfaces that are sampled densely along scan lines only, as by the rings of a spinning scanner.

use super::point_shape::{PointShape, Structure, is_line, is_surface};
use super::wide_discs::WideDisc;
use crate::error::Result;
use crate::math::{Vec3, quantile};
use crate::points::cleaning::subsample::indices_by_spacing;
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::normals::planes::{PlaneFit, fit_plane};
use crate::points::radii::radius::kth_distance;
use crate::progress::Progress;
use rayon::prelude::*;

/// Maximum ratio of the radius of a point on a scan line to the reach of its neighbours on the line. Gaps between scan
/// lines that are wider are not closed.
const MAX_WIDENING: f32 = 12.0;
/// Number of neighbours among thinned points.
const N_THINNED_NEIGHBORS: usize = 12;
/// Ratio of the spacings of successive sets of thinned points.
const THINNING: f32 = 2.0;
/// Maximum surface variation of thinned points that form a surface. Leaves along scan lines, and two stems side by side, are
/// flat by chance.
const MAX_VARIATION: f32 = 0.03;
/// Minimum cosine between the normal of a surface and that of the land where surfaces amid vegetation are land.
const MIN_LAND_COSINE: f32 = 0.5;
/// Minimum number of thinned points; fewer say nothing about structure.
const MIN_THINNED: usize = 256;

/// Looks at points on lines again, among fewer and fewer points: on a surface that is sampled densely along lines
/// only, their neighbours come to surround them. Returns the discs of those points.
///
/// `land` is the normal of the land of a cloud with much vegetation. There, lines in other planes stay lines: stems side by
/// side lie in a plane by chance.
pub fn widen_lines(
    positions: &[Vec3],
    land: Option<Vec3>,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<Vec<WideDisc>> {
    let mut widened = Vec::new();
    let lines = shapes.iter().enumerate().filter(|(_, shape)| shape.structure == Structure::Line);
    let mut open: Vec<u32> = lines.map(|(point, _)| point as u32).collect();
    let radii = open.iter().map(|point| shapes[*point as usize].radius);
    let Some(first_quartile) = quantile(radii, 0.25) else { return Ok(widened) };
    let mut spacing = 0.5 * first_quartile;
    let mut kept: Vec<u32> = (0..positions.len() as u32).collect();
    let mut thinned = positions.to_vec();
    while !open.is_empty() && 0.0 < spacing && spacing.is_finite() {
        let indices = indices_by_spacing(&thinned, spacing, progress)?;
        kept = indices.iter().map(|index| kept[*index as usize]).collect();
        thinned = kept.iter().map(|index| positions[*index as usize]).collect();
        if thinned.len() < MIN_THINNED {
            break;
        }
        let tree = KdTree::new(&thinned, progress)?;
        let found = |point: &u32| -> Result<Option<(PointShape, Vec<u32>)>> {
            progress.check()?;
            let position = positions[*point as usize];
            // A point that is among the thinned ones is not its own neighbour.
            let mut neighbors = tree.nearest(position, N_THINNED_NEIGHBORS + 1, None);
            neighbors.retain(|neighbor| 0.0 < neighbor.distance_squared);
            neighbors.truncate(N_THINNED_NEIGHBORS);
            let own = shapes[*point as usize];
            let radius = kth_distance(&neighbors, N_THINNED_NEIGHBORS);
            if MAX_WIDENING * own.radius < radius {
                return Ok(Some((own, Vec::new())));
            }
            let fit = fit_around(&thinned, position, &neighbors);
            if is_line(&fit) {
                return Ok(None);
            }
            let is_stem = land.is_some_and(|land| fit.normal.dot(land).abs() < MIN_LAND_COSINE);
            let is_surface = is_surface(&fit) && fit.variation < MAX_VARIATION && !is_stem;
            let structure = match is_surface {
                true if kept.binary_search(point).is_ok() => Structure::Surface,
                true => Structure::Redundant,
                false => return Ok(Some((own, Vec::new()))),
            };
            let shape = PointShape { structure, normal: fit.normal, radius };
            let index = |neighbor: &Neighbor| kept[neighbor.index as usize];
            Ok(Some((shape, neighbors.iter().map(index).collect())))
        };
        let decided = open.par_iter().map(found).collect::<Result<Vec<_>>>()?;
        let mut left = Vec::new();
        for (point, shape) in open.into_iter().zip(decided) {
            match shape {
                Some((shape, neighbors)) => {
                    shapes[point as usize] = shape;
                    if shape.is_disc() {
                        widened.push(WideDisc::new(point, neighbors, Structure::Line));
                    }
                }
                None => left.push(point),
            }
        }
        open = left;
        spacing *= THINNING;
    }
    Ok(widened)
}

/// Fits a plane to a position and points around it.
fn fit_around(positions: &[Vec3], position: Vec3, neighbors: &[Neighbor]) -> PlaneFit {
    let mut around: Vec<Vec3> = vec![position];
    around.extend(neighbors.iter().map(|neighbor| positions[neighbor.index as usize]));
    let of_others = |index: usize| Neighbor { index: index as u32, distance_squared: 0.0 };
    let others: Vec<Neighbor> = (1..around.len()).map(of_others).collect();
    fit_plane(&around, 0, &others)
}
