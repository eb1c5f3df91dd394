//! Estimates of normals, radii and structures from the neighbours of each point, as far as a cloud lacks them.

use super::PointCloud;
use super::gaps::close_gaps::{close_gaps, is_by_gap};
use super::gaps::free_space::FreeSpace;
use super::neighbors::{KdTree, Neighbor, NeighborMethod, Neighborhood, map_neighborhoods};
use super::normals::jets::{JetFit, MIN_JET_NEIGHBORS, fit_nearest_jet, refine_normals};
use super::normals::planes::{PlaneFit, fit_plane};
use super::preparation::Preparation;
use super::radii::radius::{DistanceSample, RadiusReport, median_distance};
use super::radii::radius::{clamp_outlier_radii, estimate_radii, kth_distance};
use super::scan::scan_grid::ScanGrids;
use super::scan::scan_rings::ScanRings;
use super::structure::below_roofs::narrow_to_roofs;
use super::structure::find_structures::{Evidence, all_scattered, find_structures};
use super::structure::neighborhood_stats::Typical;
use super::structure::point_shape::{PointShape, StructureChoice, StructureReport};
use super::structure::sparse_walls::find_sparse_walls;
use super::structure::structure_votes::{Voters, voters_among};
use super::structure::thin_parts::join_thin_parts;
use super::structure::vegetation::{count_rough, is_vegetated, land_normal};
use super::up::is_mostly_land;
use crate::error::Result;
use crate::math::{Vec3, sampled_quantile};
use crate::progress::Progress;

/// The columns to estimate.
pub struct Missing {
    pub normals: bool,
    pub fits: bool,
    pub radii: bool,
    pub structure: bool,
}

impl Missing {
    /// Columns with missing entries.
    pub fn any(cloud: &PointCloud, preparation: &Preparation) -> Self {
        let normals = match &cloud.normals {
            Some(normals) => normals.contains(&Vec3::ZERO),
            None => preparation.estimates_normals,
        };
        let radii = cloud.radii.as_ref().is_none_or(|radii| radii.contains(&0.0));
        let structure = preparation.finds_structures(cloud);
        let is_searched = structure && preparation.structure == StructureChoice::Auto;
        let fits = normals || preparation.keep_variation || is_searched;
        Self { normals, fits, radii, structure }
    }

    /// Columns that the cloud lacks altogether.
    pub fn all(cloud: &PointCloud, preparation: &Preparation) -> Self {
        let normals = cloud.normals.is_none() && preparation.estimates_normals;
        let radii = cloud.radii.is_none();
        Self { normals, fits: normals, radii, structure: false }
    }
}

/// Estimates from neighbourhoods, none where nothing is missing.
#[derive(Default)]
pub struct Estimates<'a> {
    pub fits: Option<(Vec<PlaneFit>, Neighborhood)>,
    pub radii: Option<(Vec<f32>, RadiusReport)>,
    /// The tree of the points, if one was built.
    pub tree: Option<KdTree<'a>>,
    /// The voters on the structure of each point, if structures are missing and they were found.
    voters: Vec<Voters>,
    /// True for points by gaps; empty if they were not looked for.
    is_by_gap: Vec<bool>,
}

/// Fits planes and estimates radii as far as they are missing. `normals` are those that denoising has found, zero where
/// it has not. They replace the normals of planes through the nearest neighbours; planes through the neighbours of
/// [`NeighborMethod::Grid`], [`NeighborMethod::ScanLine`] and [`Neighborhood::Within`] keep their own.
pub fn estimate<'a>(
    positions: &'a [Vec3],
    normals: Option<&[Vec3]>,
    preparation: &Preparation,
    missing: &Missing,
    progress: &dyn Progress,
) -> Result<Estimates<'a>> {
    let Preparation { radius, seed, .. } = *preparation;
    let k_radius = radius.rank().filter(|_| missing.radii);
    let mut estimates = match (preparation.neighbors, preparation.normals) {
        (NeighborMethod::Knn, Neighborhood::Nearest(k)) if missing.fits => {
            let has_voters = missing.structure && preparation.structure == StructureChoice::Auto;
            let search = NearestSearch { k_normal: k, k_radius, has_voters };
            estimate_by_nearest(positions, normals, &search, progress)?
        }
        _ if missing.fits => {
            let fits = Some(fit_planes(positions, preparation, progress)?);
            Estimates { fits, ..Estimates::default() }
        }
        _ => Estimates::default(),
    };
    if missing.radii && estimates.radii.is_none() {
        estimates.radii = Some(estimate_radii(positions, radius, seed, progress)?);
    }
    Ok(estimates)
}

/// The results that one search for the nearest neighbours of each point is to give.
struct NearestSearch {
    /// Number of neighbours of a plane.
    k_normal: usize,
    /// Rank of the neighbour whose distance is the radius, if radii are missing.
    k_radius: Option<usize>,
    /// True if the voters on structures are wanted.
    has_voters: bool,
}

/// Fits planes and cubics to the nearest neighbours, and takes radii and voters from the same search.
fn estimate_by_nearest<'a>(
    positions: &'a [Vec3],
    normals: Option<&[Vec3]>,
    search: &NearestSearch,
    progress: &dyn Progress,
) -> Result<Estimates<'a>> {
    let NearestSearch { k_normal, k_radius, has_voters } = *search;
    let tree = KdTree::new(positions, progress)?;
    let n_points = positions.len();
    let mut fits = vec![PlaneFit::default(); n_points];
    let mut jets: Vec<Option<JetFit>> = vec![None; n_points];
    let mut distances = vec![0.0; if k_radius.is_some() { n_points } else { 0 }];
    let n_voters = if has_voters { n_points } else { 0 };
    let (mut voters, mut by_gap) = (vec![Voters::default(); n_voters], vec![false; n_voters]);
    let visit = |point: usize, neighbors: &[Neighbor]| {
        let fit = fit_plane(positions, point, &neighbors[..k_normal.min(neighbors.len())]);
        // Farther ones are for radii alone.
        let near = &neighbors[..k_normal.max(MIN_JET_NEIGHBORS).min(neighbors.len())];
        let jet = fit_nearest_jet(positions, point, near, &fit, k_normal);
        let distance = k_radius.map_or(0.0, |k| kth_distance(neighbors, k));
        let around = has_voters
            .then(|| (voters_among(neighbors), is_by_gap(positions, point, neighbors, fit.normal)));
        (fit, jet, distance, around)
    };
    let k = k_normal.max(k_radius.unwrap_or(0)).max(MIN_JET_NEIGHBORS);
    tree.visit_in_blocks(Neighborhood::Nearest(k), progress, visit, |visited| {
        visited.scatter(&mut fits, |(fit, ..)| *fit);
        visited.scatter(&mut jets, |(_, jet, ..)| *jet);
        visited.scatter(&mut distances, |(_, _, distance, _)| *distance);
        visited.scatter(&mut voters, |(.., around)| around.map_or_else(Voters::default, |it| it.0));
        visited.scatter(&mut by_gap, |(.., around)| around.is_some_and(|it| it.1));
    })?;
    refine_normals(&tree, &mut fits, &jets, normals, progress)?;
    drop(jets);
    let radii = k_radius.map(|k| clamp_outlier_radii(&tree, k, distances, progress)).transpose()?;
    let fits = Some((fits, Neighborhood::Nearest(k_normal)));
    Ok(Estimates { fits, radii, tree: Some(tree), voters, is_by_gap: by_gap })
}

/// Finds the structures of points, and replaces the estimates by those of their structure. `rings` are those of a spinning
/// scanner; `is_elevation_grid` tells that the cloud had one point for each cell of a horizontal grid.
pub fn find_shapes<'a>(
    cloud: &'a PointCloud,
    estimates: &mut Estimates<'a>,
    preparation: &Preparation,
    rings: Option<&ScanRings>,
    is_elevation_grid: bool,
    progress: &dyn Progress,
) -> Result<Option<(Vec<PointShape>, StructureReport)>> {
    let Estimates { fits, radii: Some((radii, report)), tree, voters, is_by_gap } = estimates
    else {
        return Ok(None);
    };
    let tree = match tree.take() {
        Some(tree) => tree,
        None => KdTree::new(&cloud.positions, progress)?,
    };
    let voters = std::mem::take(voters);
    let mut has_leaves = false;
    let mut shapes = match (preparation.structure, &mut *fits) {
        (StructureChoice::Auto, Some((fits, _))) if is_elevation_grid || has_structure(fits) => {
            let rings = rings.map(|ScanRings { rings, scanner }| {
                (&rings[..], (*scanner - cloud.origin).as_vec3())
            });
            let evidence = Evidence { cloud, rings, is_elevation_grid };
            let mut shapes;
            (shapes, has_leaves) =
                find_structures(&tree, fits, radii, voters, &evidence, progress)?;
            if !has_leaves {
                join_thin_parts(&tree, radii, &mut shapes, progress)?;
            }
            shapes
        }
        _ => all_scattered(&tree, radii, progress)?,
    };
    let grids = if preparation.free_space { ScanGrids::new(cloud, progress)? } else { None };
    let free_space = match &grids {
        Some(grids) => FreeSpace::new(grids, &cloud.positions, progress)?,
        None => FreeSpace::default(),
    };
    let fits_of_points = fits.as_ref().map_or(&[][..], |(fits, _)| fits);
    let narrowed = free_space.narrow(&tree, fits_of_points, &mut shapes, progress)?;
    narrowed.line().iter().for_each(|line| progress.choice(line, &["free_space"]));
    let is_land = is_mostly_land(&cloud.positions);
    if let (true, StructureChoice::Auto, Some((fits, _))) = (is_land, preparation.structure, &*fits)
    {
        let typical = Typical::of(fits, radii);
        // By default the planes have 16 neighbours and the radii reach to the 12th, so that this is 0.87 of the noise.
        // The thickness of walls is chosen for it.
        let noise = typical.noise() * typical.radius;
        find_sparse_walls(&cloud.positions, noise, typical.radius, &mut shapes, progress)?;
    }
    // Those between rings are closed already.
    if !is_by_gap.is_empty() && rings.is_none() {
        let is_wooded = is_vegetated(&shapes, count_rough(fits_of_points));
        let land = is_wooded.then(|| land_normal(&cloud.positions, &shapes));
        close_gaps(&tree, radii, is_by_gap, &free_space, land, &mut shapes, progress)?;
    }
    if is_land {
        narrow_to_roofs(&cloud.positions, sampled_quantile(radii, 0.5), &mut shapes, progress)?;
    }
    if let (StructureChoice::Auto, Some((fits, _))) = (preparation.structure, fits) {
        for (fit, shape) in fits.iter_mut().zip(&shapes) {
            if shape.is_disc() {
                fit.normal = shape.normal;
            }
        }
    }
    let changed: Vec<f32> = shapes.iter().map(|shape| shape.radius).collect();
    report.follows_structure = changed != *radii;
    *radii = changed;
    report.update(radii);
    estimates.tree = Some(tree);
    let found = StructureReport { has_leaves, ..StructureReport::of(&shapes) };
    Ok(Some((shapes, found)))
}

/// True unless all points stand for themselves: a single point, and the corners of a triangle, of which no more than two
/// lie around a hit.
fn has_structure(fits: &[PlaneFit]) -> bool {
    match fits {
        [] | [_] => false,
        [_, _, _] => fits.iter().all(|fit| fit.normal == Vec3::ZERO),
        _ => true,
    }
}

fn fit_planes(
    positions: &[Vec3],
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<(Vec<PlaneFit>, Neighborhood)> {
    let Preparation { neighbors: method, normals: mut neighborhood, seed, .. } = *preparation;
    if let (Neighborhood::Nearest(k), NeighborMethod::Grid | NeighborMethod::ScanLine) =
        (neighborhood, method)
    {
        // Half of the k nearest points lie within the median distance, all k within about sqrt(2) times it.
        let sample = DistanceSample { k: k.min(positions.len()), samples: 100, seed };
        let distance = std::f32::consts::SQRT_2 * median_distance(positions, &sample, progress)?;
        neighborhood = Neighborhood::Within(distance);
    }
    let fit = |point: usize, neighbors: &[Neighbor]| fit_plane(positions, point, neighbors);
    Ok((map_neighborhoods(positions, method, neighborhood, progress, fit)?, neighborhood))
}

#[cfg(test)]
mod tests {
    //! Normals of points whose structure is not that of their nearest neighbours.

    use crate::math::{Random, Vec3};
    use crate::points::Structure;
    use crate::points::test_clouds::prepared;
    use std::f32::consts::TAU;

    #[test]
    fn redundant_points_of_scan_lines_have_the_normal_of_the_surface() {
        // Twenty rings on rough ground, 0.4 apart, of points that are 0.02 apart.
        let mut random = Random::new(3, 0);
        let mut points = Vec::new();
        for ring in 0..20 {
            let radius = 3.0 + 0.4 * ring as f32;
            let n = (TAU * radius / 0.02) as usize;
            for i in 0..n {
                let (sin, cos) = (TAU * i as f32 / n as f32).sin_cos();
                let height = 0.004 * (random.next_f32() - 0.5);
                points.push(Vec3::new(radius * cos, radius * sin, height));
            }
        }
        let (cloud, structures) = prepared(points);
        let of_redundant = cloud
            .normals()
            .iter()
            .zip(&structures)
            .filter(|(_, kind)| **kind == Structure::Redundant);
        let n_redundant = of_redundant.clone().count();
        let n_level = of_redundant.filter(|(normal, _)| 0.99 < normal.z.abs()).count();
        assert!(cloud.len() < 4 * n_redundant, "{n_redundant} of {}", cloud.len());
        assert!(95 * n_redundant < 100 * n_level, "{n_level} of {n_redundant}");
    }
}
