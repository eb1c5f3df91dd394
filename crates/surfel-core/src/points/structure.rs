//! Structure: which points form a surface, which a line, and which neither, as leaves do.
//!
//! Most points are decided by the plane through their nearest neighbours. Where these lie on a line, as along the
//! rings of a spinning scanner, the neighbours that decide are found among fewer and fewer points, until they
//! surround the point. Where they lie in no plane, a plane through at least half of them still makes a surface: an
//! edge (after Demantké et al., Dimensionality Based Scale Selection in 3D Lidar Point Clouds, 2011).

use super::neighbors::{KdTree, Neighbor, Neighborhood};
use super::normals::{PlaneFit, fit_plane};
use super::radius::kth_distance;
use super::subsample::indices_by_spacing;
use super::{PointCloud, Scalar, Values};
use crate::error::{Error, Result};
use crate::math::{DVec3, SymmetricMatrix, Vec3, hash, smallest_eigenvector};
use crate::progress::Progress;
use rayon::prelude::*;
use std::str::FromStr;

/// Name of the scalar column of structures: 0 surface, 1 line, 2 scatter, 3 redundant.
pub const STRUCTURE: &str = "structure";

/// Maximum surface variation of a surface's neighbourhood.
const MAX_SURFACE_VARIATION: f32 = 0.06;
/// Minimum width of a surface's neighbourhood, as the ratio of its eigenvalues. Below it, it is a line.
const MIN_SURFACE_WIDTH: f32 = 0.25;
/// Maximum ratio of the radius of a point on a scan line to the reach of its neighbours on the line. Gaps between scan
/// lines that are wider are not closed.
const MAX_WIDENING: f32 = 12.0;
/// Maximum width of the neighbourhood of a line.
const MAX_LINE_WIDTH: f32 = 0.04;
/// Radius of a ball in distances to the second neighbour: balls of neighbours overlap a little.
const BALL_REACH: f32 = 0.6;
/// Maximum ratio of the radius of a ball or capsule to the median of its structure.
const MAX_SOLID_RATIO: f32 = 1.5;
/// Number of neighbours for a second look at points that lie in no plane.
const N_MANY_NEIGHBORS: usize = 48;
/// Number of neighbours among thinned points.
const N_THINNED_NEIGHBORS: usize = 12;
/// Ratio of the spacings of successive sets of thinned points.
const THINNING: f32 = 2.0;
/// Minimum number of thinned points; fewer say nothing about structure.
const MIN_THINNED: usize = 256;
/// Maximum number of surface points within a disc that was widened to close the gaps between scan lines.
const MAX_POINTS_OF_DISC: usize = 64;
/// Number of neighbours that vote on the structure of a point.
const N_VOTERS: usize = 8;
/// Number of rounds in which points take over half of their neighbours' mean.
const N_ROUNDS: usize = 12;
/// Share of scattered points around a point, after all rounds, that makes it a scattered one.
const MIN_SCATTERED: f32 = 0.5;
/// Ratio of a radius to the typical one from which the neighbourhood is sparse.
const SPARSE: f32 = 2.0;
/// Minimum share of scattered points in a cloud with much vegetation.
const MIN_VEGETATION: f32 = 0.2;
/// Maximum number of rounds in which islands of a surface shrink.
const N_ISLAND_ROUNDS: usize = 8;
/// Share of scattered points from which a surface point is looked at again: small islands of a surface among scattered
/// points, as where branches happen to lie in a plane, are scattered too.
const MIN_SHARE_NEAR_SCATTER: f32 = 0.02;
/// Number of planes tried at a point that lies near an edge.
const N_PLANES: u64 = 24;
/// Distance from a plane of the points on it, in radii of the neighbourhood.
const PLANE_THICKNESS: f32 = 0.04;
/// Minimum fraction of the neighbours on the plane of an edge's side.
const MIN_PLANE_FRACTION: f32 = 0.5;
/// Minimum fraction of the neighbours on the plane of one side of a sharp edge or corner.
const MIN_SIDE_FRACTION: f32 = 0.25;

/// The shape that a point is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Structure {
    /// The point is part of a surface.
    #[default]
    Surface = 0,
    /// The point is part of a line: a wire, a pole, a rail.
    Line = 1,
    /// The point stands for itself: a leaf, a stray point.
    Scatter = 2,
    /// The point lies on a densely sampled scan line of a surface that fewer of its points describe as well.
    Redundant = 3,
}

/// The choice of structures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum StructureChoice {
    /// Each point's structure is found from its neighbours.
    #[default]
    Auto,
    /// All points form a surface.
    Surface,
    /// All points stand for themselves.
    Scatter,
}

impl FromStr for StructureChoice {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "auto" => Ok(Self::Auto),
            "surface" => Ok(Self::Surface),
            "scatter" => Ok(Self::Scatter),
            _ => Err(Error::Setting {
                name: "structure",
                found: text.to_owned(),
                expected: "auto, surface or scatter",
            }),
        }
    }
}

impl std::fmt::Display for StructureChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Surface => "surface",
            Self::Scatter => "scatter",
        })
    }
}

/// Numbers of points by their structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StructureReport {
    /// Number of points of surfaces.
    pub n_surface: usize,
    /// Number of points of lines.
    pub n_lines: usize,
    /// Number of points that stand for themselves.
    pub n_scatter: usize,
    /// Number of points of surfaces that are left out, as others on their scan line suffice.
    pub n_redundant: usize,
}

impl StructureReport {
    fn of(structures: &[Structure]) -> Self {
        let count = |kind| structures.par_iter().filter(|s| **s == kind).count();
        Self {
            n_surface: count(Structure::Surface),
            n_lines: count(Structure::Line),
            n_scatter: count(Structure::Scatter),
            n_redundant: count(Structure::Redundant),
        }
    }

    /// Returns a line about the structures for the user.
    pub fn line(&self) -> String {
        let Self { n_surface, n_lines, n_scatter, n_redundant } = *self;
        let n_points = (n_surface + n_lines + n_scatter + n_redundant).max(1);
        let percent = |count: usize| 100.0 * count as f64 / n_points as f64;
        let line = format!(
            "structure: {:.1} % surface, {:.1} % lines, {:.1} % scattered points",
            percent(n_surface + n_redundant),
            percent(n_lines),
            percent(n_scatter)
        );
        match n_redundant {
            0 => line,
            _ => format!("{line}; {n_redundant} points of dense scan lines are left out"),
        }
    }
}

/// The shape of a point: the normal of a surface or the direction of a line, and the reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointShape {
    /// The structure.
    pub structure: Structure,
    /// Unit normal of a surface, unit direction of a line; zero if unknown.
    pub normal: Vec3,
    /// Radius of a disc, half the length of a capsule, or radius of a ball.
    pub radius: f32,
}

impl PointCloud {
    /// Returns the structure of a point, as far as the cloud has a column of structures.
    pub fn structures(&self) -> Option<Vec<Structure>> {
        let of_code = |code: &u8| match code {
            1 => Structure::Line,
            2 => Structure::Scatter,
            3 => Structure::Redundant,
            _ => Structure::Surface,
        };
        match self.scalar(STRUCTURE)? {
            Values::U8(codes) => Some(codes.iter().map(of_code).collect()),
            _ => None,
        }
    }

    /// Adds or replaces the column of structures.
    pub fn set_structures(&mut self, structures: &[Structure]) {
        let values = Values::U8(structures.iter().map(|structure| *structure as u8).collect());
        self.scalars.retain(|scalar| !scalar.name.eq_ignore_ascii_case(STRUCTURE));
        self.scalars.push(Scalar { name: STRUCTURE.to_owned(), values });
    }
}

/// Finds the structure of each point from the planes through its neighbours and the distances to the most distant
/// of them.
///
/// # Errors
///
/// Returns [`Error::Cancelled`] if `progress` is cancelled.
pub fn find_structures(
    tree: &KdTree,
    fits: &[PlaneFit],
    radii: &[f32],
    progress: &dyn Progress,
) -> Result<(Vec<PointShape>, StructureReport)> {
    let positions = tree.positions();
    progress.begin("structure", positions.len() as u64);
    let typical = Typical { variation: median_variation(fits), radius: median_radius(radii) };
    let decide = |point: usize| {
        if point.is_multiple_of(4096) {
            progress.check()?;
            progress.advance(4096.min(positions.len() - point) as u64);
        }
        Ok(decide(tree, point, &fits[point], radii[point], &typical))
    };
    let mut shapes: Vec<PointShape> =
        (0..positions.len()).into_par_iter().map(decide).collect::<Result<_>>()?;
    widen_lines(positions, &mut shapes, progress)?;
    for (shape, fit) in shapes.iter_mut().zip(fits) {
        if shape.structure == Structure::Line && MAX_LINE_WIDTH < fit.width {
            shape.structure = Structure::Scatter;
        }
    }
    let structures = smoothed(tree, &shapes, typical.radius, progress)?;
    let finish = |(point, (shape, structure)): (usize, (&mut PointShape, &Structure))| {
        settle(tree, point, &fits[point], radii[point], *structure, shape);
    };
    shapes.par_iter_mut().zip(&structures).enumerate().for_each(finish);
    limit_wide_discs(positions, radii, &mut shapes, progress)?;
    clamp_solids(&mut shapes, Structure::Line);
    clamp_solids(&mut shapes, Structure::Scatter);
    Ok((shapes, StructureReport::of(&structures)))
}

/// Makes each point stand for itself.
///
/// # Errors
///
/// Returns [`Error::Cancelled`] if `progress` is cancelled.
pub fn all_scattered(
    tree: &KdTree,
    radii: &[f32],
    progress: &dyn Progress,
) -> Result<(Vec<PointShape>, StructureReport)> {
    let distance = |_: usize, neighbors: &[Neighbor]| kth_distance(neighbors, 2);
    let distances = tree.map(Neighborhood::Nearest(2), progress, distance)?;
    let shape = |(distance, radius): (&f32, &f32)| PointShape {
        structure: Structure::Scatter,
        normal: Vec3::Z,
        radius: ball_radius(*distance, *radius),
    };
    let mut shapes: Vec<PointShape> = distances.iter().zip(radii).map(shape).collect();
    clamp_solids(&mut shapes, Structure::Scatter);
    let report = StructureReport { n_scatter: shapes.len(), ..StructureReport::default() };
    Ok((shapes, report))
}

/// Returns the radius of a ball by the distance to the second neighbour; `radius` is that of a disc, which a stray
/// point's ball does not exceed.
fn ball_radius(distance: f32, radius: f32) -> f32 {
    let reach = BALL_REACH * distance;
    if 0.0 < reach { reach.min(radius) } else { radius }
}

/// Narrows the widened discs that reach over densely sampled surfaces, where the points at hand describe the surface
/// better than a wide disc does.
fn limit_wide_discs(
    positions: &[Vec3],
    radii: &[f32],
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let is_surface = |point: &usize| shapes[*point].structure == Structure::Surface;
    let is_wide = |point: &usize| is_surface(point) && radii[*point] < shapes[*point].radius;
    let wide: Vec<usize> = (0..shapes.len()).filter(is_wide).collect();
    if wide.is_empty() {
        return Ok(());
    }
    let surface: Vec<Vec3> =
        (0..shapes.len()).filter(is_surface).map(|point| positions[point]).collect();
    let tree = KdTree::new(&surface, progress)?;
    let limited = |point: &usize| -> Result<f32> {
        progress.check()?;
        let neighbors = tree.nearest(positions[*point], MAX_POINTS_OF_DISC, None);
        let reach = kth_distance(&neighbors, MAX_POINTS_OF_DISC);
        let is_crowded = neighbors.len() == MAX_POINTS_OF_DISC && reach < shapes[*point].radius;
        Ok(if is_crowded { reach.max(radii[*point]) } else { shapes[*point].radius })
    };
    let limits = wide.par_iter().map(limited).collect::<Result<Vec<_>>>()?;
    for (point, radius) in wide.into_iter().zip(limits) {
        shapes[point].radius = radius;
    }
    Ok(())
}

/// Clamps the radii of stray points, which would be as large as the empty space around them.
fn clamp_solids(shapes: &mut [PointShape], structure: Structure) {
    let solids = shapes.iter().filter(|shape| shape.structure == structure);
    let mut radii: Vec<f32> = solids.map(|shape| shape.radius).collect();
    if radii.is_empty() {
        return;
    }
    let middle = radii.len() / 2;
    let (_, median, _) = radii.select_nth_unstable_by(middle, f32::total_cmp);
    let limit = MAX_SOLID_RATIO * *median;
    for shape in shapes.iter_mut().filter(|shape| shape.structure == structure) {
        shape.radius = shape.radius.min(limit);
    }
}

fn median_variation(fits: &[PlaneFit]) -> f32 {
    let mut sample: Vec<f32> =
        fits.iter().step_by(fits.len() / 10_000 + 1).map(|fit| fit.variation).collect();
    sample.sort_unstable_by(f32::total_cmp);
    sample.get(sample.len() / 2).copied().unwrap_or(0.0)
}

fn median_radius(radii: &[f32]) -> f32 {
    let mut sample: Vec<f32> = radii.iter().step_by(radii.len() / 10_000 + 1).copied().collect();
    sample.sort_unstable_by(f32::total_cmp);
    sample.get(sample.len() / 2).copied().unwrap_or(0.0)
}

/// Properties of the point in the middle of a cloud.
struct Typical {
    /// Surface variation of its neighbourhood.
    variation: f32,
    /// Radius of its neighbourhood.
    radius: f32,
}

impl Typical {
    /// True if a plane fits the neighbourhood of a radius. The variation that noise causes falls with the square of the
    /// radius: where points are sparse, as between the branches of a crown, a plane has to fit better.
    fn is_surface(&self, fit: &PlaneFit, radius: f32) -> bool {
        let sparseness = (radius / (SPARSE * self.radius)).max(1.0);
        is_surface(fit) && fit.variation * sparseness * sparseness < MAX_SURFACE_VARIATION
    }
}

fn is_surface(fit: &PlaneFit) -> bool {
    fit.normal != Vec3::ZERO
        && fit.variation < MAX_SURFACE_VARIATION
        && MIN_SURFACE_WIDTH < fit.width
}

/// Decides about a point by its nearest neighbours alone.
fn decide(
    tree: &KdTree,
    point: usize,
    fit: &PlaneFit,
    radius: f32,
    typical: &Typical,
) -> PointShape {
    /// Below this variation the mean plane is as good as that of an edge's side.
    const MIN_EDGE_VARIATION: f32 = 0.012;
    let shape = |structure, normal| PointShape { structure, normal, radius };
    if fit.width <= MIN_SURFACE_WIDTH {
        return shape(Structure::Line, fit.normal);
    }
    let is_surface = typical.is_surface(fit, radius);
    if is_surface && fit.variation < MIN_EDGE_VARIATION.max(2.5 * typical.variation) {
        return shape(Structure::Surface, fit.normal);
    }
    let positions = tree.positions();
    let neighbors = tree.nearest(positions[point], N_MANY_NEIGHBORS, Some(point as u32));
    let nearest = &neighbors[..neighbors.len().min(N_MANY_NEIGHBORS / 2)];
    let side = plane_of_side(positions, point, nearest, fit.normal);
    if let Some((normal, fraction)) = side
        && MIN_PLANE_FRACTION <= fraction
    {
        return shape(Structure::Surface, normal);
    }
    let normal = side.map_or(fit.normal, |(normal, _)| normal);
    if is_surface {
        return shape(Structure::Surface, normal);
    }
    let wide = fit_plane(positions, point, &neighbors);
    if wide.width <= MIN_SURFACE_WIDTH {
        return shape(Structure::Line, wide.normal);
    }
    if typical.is_surface(&wide, radius) {
        return shape(Structure::Surface, wide.normal);
    }
    shape(Structure::Scatter, normal)
}

/// Returns the normal of the plane through the point on which the most neighbours lie, and their fraction: near an edge
/// that is the plane of the point's own side. `mean` is the normal of the plane through all of them, which another
/// plane has to excel. Returns none if too few lie on the plane.
fn plane_of_side(
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

/// Looks at points on lines again, among fewer and fewer points: on a surface that is sampled densely along lines
/// only, their neighbours come to surround them.
fn widen_lines(
    positions: &[Vec3],
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let lines = shapes.iter().enumerate().filter(|(_, shape)| shape.structure == Structure::Line);
    let mut open: Vec<u32> = lines.map(|(point, _)| point as u32).collect();
    let mut radii: Vec<f32> = open.iter().map(|point| shapes[*point as usize].radius).collect();
    if open.is_empty() {
        return Ok(());
    }
    let middle = radii.len() / 4;
    let (_, typical, _) = radii.select_nth_unstable_by(middle, f32::total_cmp);
    let mut spacing = 0.5 * *typical;
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
        let found = |point: &u32| -> Result<Option<PointShape>> {
            progress.check()?;
            let position = positions[*point as usize];
            // A point that is among the thinned ones is not its own neighbour.
            let mut neighbors = tree.nearest(position, N_THINNED_NEIGHBORS + 1, None);
            neighbors.retain(|neighbor| 0.0 < neighbor.distance_squared);
            neighbors.truncate(N_THINNED_NEIGHBORS);
            let fit = fit_around(&thinned, position, &neighbors);
            let radius = kth_distance(&neighbors, N_THINNED_NEIGHBORS);
            if fit.width <= MIN_SURFACE_WIDTH {
                return Ok(None);
            }
            let own = shapes[*point as usize];
            let is_close = radius <= MAX_WIDENING * own.radius;
            let structure = match is_surface(&fit) && is_close {
                true if kept.binary_search(point).is_ok() => Structure::Surface,
                true => Structure::Redundant,
                false => return Ok(Some(own)),
            };
            Ok(Some(PointShape { structure, normal: fit.normal, radius }))
        };
        let decided = open.par_iter().map(found).collect::<Result<Vec<_>>>()?;
        let mut left = Vec::new();
        for (point, shape) in open.into_iter().zip(decided) {
            match shape {
                Some(shape) => shapes[point as usize] = shape,
                None => left.push(point),
            }
        }
        open = left;
        spacing *= THINNING;
    }
    Ok(())
}

/// Fits a plane to a position and points around it.
fn fit_around(positions: &[Vec3], position: Vec3, neighbors: &[Neighbor]) -> PlaneFit {
    let mut around: Vec<Vec3> = vec![position];
    around.extend(neighbors.iter().map(|neighbor| positions[neighbor.index as usize]));
    let of_others = |index: usize| Neighbor { index: index as u32, distance_squared: 0.0 };
    let others: Vec<Neighbor> = (1..around.len()).map(of_others).collect();
    fit_plane(&around, 0, &others)
}

/// Lets the region around a point decide whether it is scattered, so that structures do not flicker: a rough point of a
/// surface stays on the surface, and a flat spot of a crown becomes leaves.
///
/// Where much is scattered, as in a forest, a sparse scattered point by a surface stays one, for its disc would be wide.
fn smoothed(
    tree: &KdTree,
    shapes: &[PointShape],
    typical_radius: f32,
    progress: &dyn Progress,
) -> Result<Vec<Structure>> {
    let own = shapes.par_iter().map(|shape| shape.structure);
    if own.clone().all(|structure| structure != Structure::Scatter) {
        return Ok(own.collect());
    }
    let n_scattered = own.clone().filter(|structure| *structure == Structure::Scatter).count();
    let is_vegetated = MIN_VEGETATION * shapes.len() as f32 <= n_scattered as f32;
    let max_radius = if is_vegetated { SPARSE * typical_radius } else { f32::INFINITY };
    let voters = |_: usize, neighbors: &[Neighbor]| {
        let mut indices = [u32::MAX; N_VOTERS];
        for (index, neighbor) in indices.iter_mut().zip(neighbors) {
            *index = neighbor.index;
        }
        indices
    };
    let voters = tree.map(Neighborhood::Nearest(N_VOTERS), progress, voters)?;
    let mut shares: Vec<f32> =
        own.clone().map(|structure| f32::from(u8::from(structure == Structure::Scatter))).collect();
    for _ in 0..N_ROUNDS {
        let mixed = |(own, voters): (&f32, &[u32; N_VOTERS])| {
            let of_voters = voters.iter().filter(|voter| **voter != u32::MAX);
            let n_voters = of_voters.clone().count().max(1) as f32;
            let sum: f32 = of_voters.map(|voter| shares[*voter as usize]).sum();
            0.5 * (own + sum / n_voters)
        };
        shares = shares.par_iter().zip(&voters).map(mixed).collect();
    }
    let decided = |((own, shape), share): ((Structure, &PointShape), &f32)| match own {
        Structure::Line => Structure::Line,
        _ if MIN_SCATTERED <= *share => Structure::Scatter,
        Structure::Scatter if shape.radius <= max_radius => Structure::Surface,
        own => own,
    };
    let mut structures: Vec<Structure> = own.zip(shapes).zip(&shares).map(decided).collect();
    for _ in 0..N_ISLAND_ROUNDS {
        let (next, n_changed) = without_islands(tree, &structures, &shares);
        structures = next;
        if n_changed == 0 {
            break;
        }
    }
    Ok(structures)
}

/// Scatters the surface points most of whose neighbours are scattered, and returns their number too.
fn without_islands(
    tree: &KdTree,
    structures: &[Structure],
    shares: &[f32],
) -> (Vec<Structure>, usize) {
    let is_island = |(point, (structure, share)): (usize, (&Structure, &f32))| {
        if *structure != Structure::Surface || *share < MIN_SHARE_NEAR_SCATTER {
            return false;
        }
        let around = tree.nearest(tree.positions()[point], N_MANY_NEIGHBORS, Some(point as u32));
        let of_neighbor = |neighbor: &Neighbor| structures[neighbor.index as usize];
        let is_scattered = |neighbor: &&Neighbor| of_neighbor(neighbor) == Structure::Scatter;
        around.len() <= 2 * around.iter().filter(is_scattered).count()
    };
    let is_island: Vec<bool> =
        structures.par_iter().zip(shares).enumerate().map(is_island).collect();
    let next = structures.iter().zip(&is_island);
    let next = next.map(|(own, is_island)| if *is_island { Structure::Scatter } else { *own });
    (next.collect(), is_island.iter().filter(|is_island| **is_island).count())
}

/// Gives a point the normal and the radius of its final structure.
fn settle(
    tree: &KdTree,
    point: usize,
    fit: &PlaneFit,
    radius: f32,
    structure: Structure,
    shape: &mut PointShape,
) {
    let position = tree.positions()[point];
    match structure {
        Structure::Surface | Structure::Redundant => {
            if shape.structure == Structure::Line {
                (shape.normal, shape.radius) = (fit.normal, radius);
            }
        }
        Structure::Line => {
            let neighbors = tree.nearest(position, N_VOTERS, Some(point as u32));
            shape.normal = line_direction(tree.positions(), point, &neighbors);
            let reach = kth_distance(&neighbors, 2);
            shape.radius = if 0.0 < reach { reach } else { radius };
        }
        Structure::Scatter => {
            let neighbors = tree.nearest(position, 2, Some(point as u32));
            shape.radius = ball_radius(kth_distance(&neighbors, 2), radius);
        }
    }
    shape.structure = structure;
}

/// Returns the direction in which the neighbours extend most.
fn line_direction(positions: &[Vec3], point: usize, neighbors: &[Neighbor]) -> Vec3 {
    let center = positions[point].as_dvec3();
    let mut scatter = SymmetricMatrix::default();
    for neighbor in neighbors {
        let offset: DVec3 = positions[neighbor.index as usize].as_dvec3() - center;
        scatter.add_outer(offset, 1.0);
    }
    let (_, vectors) = scatter.eigen();
    vectors[2].as_vec3().normalize_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    //! Structures of sampled shapes.

    use super::*;
    use crate::math::Random;
    use crate::points::{Preparation, PreparedCloud, prepare};
    use crate::progress::NoProgress;

    fn prepared(positions: Vec<Vec3>) -> (PreparedCloud, Vec<Structure>) {
        let cloud = PointCloud::from_positions(positions);
        let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let structures = cloud.structures().unwrap();
        (cloud, structures)
    }

    fn fraction(structures: &[Structure], kind: Structure) -> f64 {
        let n = structures.iter().filter(|structure| **structure == kind).count();
        n as f64 / structures.len() as f64
    }

    fn random_points(n: usize, seed: u64, point: impl Fn([f32; 3]) -> Vec3) -> Vec<Vec3> {
        let mut random = Random::new(seed, 0);
        (0..n).map(|_| point(std::array::from_fn(|_| random.next_f32()))).collect()
    }

    #[test]
    fn points_of_a_plane_form_a_surface() {
        for noise in [0.0, 0.3] {
            // The spacing is 0.01.
            let height = |z: f32| noise * 0.01 * (z - 0.5) * 12f32.sqrt();
            let plane = random_points(10_000, 1, |[x, y, z]| Vec3::new(x, y, height(z)));
            let (_, structures) = prepared(plane);
            let n_surface = fraction(&structures, Structure::Surface)
                + fraction(&structures, Structure::Redundant);
            assert!(0.995 < n_surface, "noise {noise}: {n_surface}");
        }
    }

    #[test]
    fn sides_of_an_edge_keep_their_normals() {
        let mut points = random_points(5000, 2, |[x, y, _]| Vec3::new(x, y, 0.0));
        points.extend(random_points(5000, 3, |[x, _, z]| Vec3::new(x, 0.0, z)));
        let (cloud, structures) = prepared(points);
        assert!(0.98 < fraction(&structures, Structure::Surface));
        let tilt = |normal: &Vec3| normal.y.abs().max(normal.z.abs()).min(1.0).acos().to_degrees();
        let mut tilts: Vec<f32> = cloud.normals().iter().map(tilt).collect();
        tilts.sort_unstable_by(f32::total_cmp);
        assert!(tilts[tilts.len() * 95 / 100] < 5.0, "{}", tilts[tilts.len() * 95 / 100]);
    }

    #[test]
    fn points_that_fill_a_volume_are_scattered_with_balls_that_do_not_overlap_much() {
        let crown = random_points(5000, 4, Vec3::from_array);
        let (cloud, structures) = prepared(crown);
        let n_scatter = fraction(&structures, Structure::Scatter);
        assert!(0.85 < n_scatter, "{n_scatter}");
        let spacing = 1.0 / (5000f32).cbrt();
        let balls = cloud.radii().iter().zip(&structures);
        let balls = balls.filter(|(_, structure)| **structure == Structure::Scatter);
        assert!(balls.into_iter().all(|(radius, _)| *radius < spacing));
    }

    #[test]
    fn points_of_a_wire_form_a_line_along_it() {
        let direction = Vec3::new(1.0, 2.0, 0.5).normalize();
        let wire = (0..1000).map(|i| 0.01 * i as f32 * direction).collect();
        let (cloud, structures) = prepared(wire);
        assert_eq!(fraction(&structures, Structure::Line), 1.0);
        assert!(cloud.normals().iter().all(|axis| 0.999 < axis.dot(direction).abs()));
    }

    #[test]
    fn rings_on_the_ground_form_a_surface_across_their_gaps() {
        // Twenty rings, 0.4 apart, of points that are 0.02 apart.
        let ring = |ring: usize| {
            let radius = 3.0 + 0.4 * ring as f32;
            let n = (std::f32::consts::TAU * radius / 0.02) as usize;
            (0..n).map(move |i| {
                let (sin, cos) = (std::f32::consts::TAU * i as f32 / n as f32).sin_cos();
                Vec3::new(radius * cos, radius * sin, 0.0)
            })
        };
        let (cloud, structures) = prepared((0..20).flat_map(ring).collect());
        let n_lines = fraction(&structures, Structure::Line);
        assert!(n_lines < 0.01, "{n_lines}");
        let discs = cloud.radii().iter().zip(cloud.normals()).zip(&structures);
        let discs = discs.filter(|(_, structure)| **structure == Structure::Surface);
        let mut n_wide = 0;
        for ((radius, normal), _) in discs {
            n_wide += usize::from(0.4 < *radius);
            assert!(0.999 < normal.z.abs());
        }
        assert!(1000 < n_wide, "{n_wide}");
        assert!(0.5 < fraction(&structures, Structure::Redundant));
    }

    #[test]
    fn a_choice_takes_all_points_for_one_structure() {
        let points = random_points(500, 5, |[x, y, _]| Vec3::new(x, y, 0.0));
        for (choice, expected) in [
            (StructureChoice::Surface, None),
            (StructureChoice::Scatter, Some(vec![Structure::Scatter; 500])),
        ] {
            let cloud = PointCloud::from_positions(points.clone());
            let preparation = Preparation { structure: choice, ..Preparation::default() };
            let (cloud, _) = prepare(cloud, &preparation, &NoProgress).unwrap();
            assert_eq!(cloud.structures(), expected);
        }
    }

    #[test]
    fn choices_are_parsed() {
        for choice in [StructureChoice::Auto, StructureChoice::Surface, StructureChoice::Scatter] {
            assert_eq!(choice.to_string().parse::<StructureChoice>().unwrap(), choice);
        }
        assert!("line".parse::<StructureChoice>().is_err());
    }
}
