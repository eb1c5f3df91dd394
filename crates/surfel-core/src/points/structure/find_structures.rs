//! The search for the structure of each point.
//!
//! Most points are decided by the plane through their nearest neighbours. Where these lie on a line, as along the
//! rings of a spinning scanner, the neighbours that decide are found among fewer and fewer points, until they
//! surround the point. Where they lie in no plane, a plane through at least half of them still makes a surface: an
//! edge (after Demantké et al., Dimensionality Based Scale Selection in 3D Lidar Point Clouds, 2011).

use super::above_land::is_above_land;
use super::crown_patches::scatter_crown_patches;
use super::edge_planes::{MIN_PLANE_FRACTION, plane_of_side};
use super::junctions::join_to_surfaces;
use super::neighborhood_stats::Typical;
use super::point_shape::{PointShape, Structure, is_line, is_surface};
use super::ring_surfaces::close_ring_gaps;
use super::scan_lines::widen_lines;
use super::see_through::open_see_through_discs;
use super::solids::{
    apply_structure, ball_radius, clamp_balls_by_range, clamp_solids, second_distance,
};
use super::stated_normals::join_by_stated_normals;
use super::stray_points::limit_stray_points;
use super::structure_votes::{Voters, smoothed};
use super::vegetation::{count_rough, has_leaves, is_vegetated, land_normal};
use super::wall_faces::join_faces;
use super::wide_discs::{limit_crowded_discs, narrow_lone_discs};
use crate::error::Result;
use crate::math::{Aabb, Vec3};
use crate::points::PointCloud;
use crate::points::neighbors::{KdTree, Neighbor, Neighborhood};
use crate::points::normals::planes::{PlaneFit, fit_plane};
use crate::points::scan::scan_rings::Ring;
use crate::points::up::is_mostly_land;
use crate::progress::Progress;
use rayon::prelude::*;

/// Maximum width of the neighbourhood of a line.
const MAX_LINE_WIDTH: f32 = 0.04;
/// Number of neighbours of a point whose neighbourhood spans no plane.
const N_REFIT_NEIGHBORS: usize = 16;
/// Number of neighbours for a second look at points that lie in no plane.
const N_MANY_NEIGHBORS: usize = 48;
/// Number of neighbours for a third look: a surface whose noise is as large as its spacing shows only from afar.
const N_WIDEST_NEIGHBORS: usize = 144;
/// Maximum surface variation of so many neighbours of a surface. Crowns have more.
const MAX_WIDEST_VARIATION: f32 = 0.03;

/// The knowledge about a cloud.
pub struct Evidence<'a> {
    /// The cloud with its normals, zero where it has none, and its classes.
    pub cloud: &'a PointCloud,
    /// Rings of a spinning scanner with its place, relative to the origin of the cloud.
    pub rings: Option<(&'a [Ring], Vec3)>,
    /// True if the cloud had one point for each cell of a horizontal grid. All its points are of a surface.
    pub is_elevation_grid: bool,
}

/// Finds the structure of each point from the planes through its neighbours and the distances to the most distant
/// of them, and whether scattered points are leaves. `voters` are those of each point; if it is empty, they are searched
/// where they are needed.
///
/// # Errors
///
/// Returns [`Error::Cancelled`] if `progress` is cancelled.
pub fn find_structures(
    tree: &KdTree,
    fits: &[PlaneFit],
    radii: &[f32],
    voters: Vec<Voters>,
    evidence: &Evidence,
    progress: &dyn Progress,
) -> Result<(Vec<PointShape>, bool)> {
    let Evidence { cloud, rings, is_elevation_grid } = *evidence;
    let positions = tree.positions();
    progress.begin("structure", positions.len() as u64);
    let typical = Typical::of(fits, radii);
    let is_land = is_mostly_land(positions);
    let decide = |point: usize| {
        if point.is_multiple_of(4096) {
            progress.check()?;
            progress.advance(4096.min(positions.len() - point) as u64);
        }
        Ok(decide(tree, point, &fits[point], radii[point], &typical, is_land))
    };
    let decided: Vec<Decision> =
        (0..positions.len()).into_par_iter().map(decide).collect::<Result<_>>()?;
    let above_land: Vec<usize> =
        (0..decided.len()).filter(|point| decided[*point].is_above_land).collect();
    let mut shapes: Vec<PointShape> = decided.into_iter().map(|decision| decision.shape).collect();
    join_faces(tree, &mut shapes, progress)?;
    join_to_surfaces(tree, typical.noise(), &mut shapes, progress)?;
    let n_rough = count_rough(fits);
    let land = is_vegetated(&shapes, n_rough).then(|| land_normal(positions, &shapes));
    let widened = match rings {
        Some((rings, scanner)) => {
            close_ring_gaps(tree, rings, scanner, &mut shapes, progress)?;
            Vec::new()
        }
        None => widen_lines(positions, land, &mut shapes, progress)?,
    };
    for (shape, fit) in shapes.iter_mut().zip(fits) {
        if shape.structure == Structure::Line && MAX_LINE_WIDTH < fit.width {
            shape.structure = Structure::Scatter;
        }
    }
    let structures = if is_elevation_grid {
        vec![Structure::Surface; positions.len()]
    } else {
        let mut structures = smoothed(tree, &shapes, voters, n_rough, typical.radius, progress)?;
        above_land.iter().for_each(|point| structures[*point] = Structure::Scatter);
        if let Some(normals) = &cloud.normals {
            join_by_stated_normals(tree, normals, &mut structures, &mut shapes, progress)?;
        }
        structures
    };
    let finish = |(point, (shape, structure)): (usize, (&mut PointShape, &Structure))| {
        if point.is_multiple_of(4096) {
            progress.check()?;
        }
        apply_structure(tree, point, radii[point], *structure, shape);
        Ok(())
    };
    shapes.par_iter_mut().zip(&structures).enumerate().try_for_each(finish)?;
    let have_leaves = |shapes: &[PointShape]| {
        let structures: Vec<Structure> = shapes.iter().map(|shape| shape.structure).collect();
        let shown: Vec<f32> = shapes.iter().map(|shape| shape.radius).collect();
        has_leaves(cloud, &structures, &shown, || rings.is_some())
    };
    let is_wooded = land.is_some();
    if !is_elevation_grid && (is_wooded || have_leaves(&shapes)) {
        let up = land.unwrap_or_else(|| match is_land {
            true => Vec3::Z,
            false => land_normal(positions, &shapes),
        });
        scatter_crown_patches(tree, radii, up, is_wooded, &mut shapes, progress)?;
    }
    limit_crowded_discs(tree, radii, &mut shapes, progress)?;
    narrow_lone_discs(tree, radii, typical.radius, widened, &mut shapes, progress)?;
    if is_land && !is_elevation_grid {
        open_see_through_discs(tree, radii, typical.radius, &mut shapes, progress)?;
    }
    let size = Aabb::of_points(positions.iter().copied()).diagonal();
    clamp_solids(&mut shapes, Structure::Line, typical.radius, size);
    match rings {
        Some((_, scanner)) => {
            clamp_balls_by_range(&mut shapes, positions, scanner, typical.radius, size)
        }
        None => clamp_solids(&mut shapes, Structure::Scatter, typical.radius, size),
    }
    limit_stray_points(tree, &mut shapes, progress)?;
    let has_leaves = have_leaves(&shapes);
    Ok((shapes, has_leaves))
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
) -> Result<Vec<PointShape>> {
    let distance = |point: usize, neighbors: &[Neighbor]| second_distance(tree, point, neighbors);
    let distances = tree.map(Neighborhood::Nearest(2), progress, distance)?;
    let shape = |(distance, radius): (&f32, &f32)| PointShape {
        structure: Structure::Scatter,
        normal: Vec3::Z,
        radius: ball_radius(*distance, *radius),
    };
    let mut shapes: Vec<PointShape> = distances.iter().zip(radii).map(shape).collect();
    let size = Aabb::of_points(tree.positions().iter().copied()).diagonal();
    clamp_solids(&mut shapes, Structure::Scatter, f32::INFINITY, size);
    Ok(shapes)
}

/// The shape of a point by its nearest neighbours alone.
struct Decision {
    shape: PointShape,
    /// True for a point above land, as of a low plant. Around it the ground has most of the points, whose vote would make
    /// a surface of it.
    is_above_land: bool,
}

/// Decides about a point by its nearest neighbours alone.
fn decide(
    tree: &KdTree,
    point: usize,
    fit: &PlaneFit,
    radius: f32,
    typical: &Typical,
    is_land: bool,
) -> Decision {
    /// Below this variation the mean plane is as good as that of an edge's side.
    const MIN_EDGE_VARIATION: f32 = 0.012;
    let shape = |structure, normal| Decision {
        shape: PointShape { structure, normal, radius },
        is_above_land: false,
    };
    let positions = tree.positions();
    // Few points within a distance of another span no plane, and nor do those of a line.
    let fit = &match fit.normal {
        Vec3::ZERO => {
            let nearest = tree.nearest(positions[point], N_REFIT_NEIGHBORS, Some(point as u32));
            fit_plane(positions, point, &nearest)
        }
        _ => *fit,
    };
    if is_line(fit) {
        return shape(Structure::Line, fit.normal);
    }
    let is_surface = typical.is_surface(fit, radius);
    let is_even = fit.variation < MIN_EDGE_VARIATION.max(2.5 * typical.variation);
    if is_surface && (is_even || fit.is_smooth) {
        return shape(Structure::Surface, fit.normal);
    }
    let neighbors = tree.nearest(positions[point], N_MANY_NEIGHBORS, Some(point as u32));
    let nearest = &neighbors[..neighbors.len().min(N_MANY_NEIGHBORS / 2)];
    let side = if typical.has_edges() {
        plane_of_side(positions, point, nearest, fit.normal)
    } else {
        None
    };
    if let Some((normal, fraction)) = side
        && MIN_PLANE_FRACTION <= fraction
    {
        return shape(Structure::Surface, normal);
    }
    let is_above = |around: &[Neighbor]| is_above_land(positions, point, around, typical.noise());
    // High plants have many neighbours on others.
    if is_land && (is_above(nearest) || is_above(&neighbors)) {
        return Decision { is_above_land: true, ..shape(Structure::Scatter, fit.normal) };
    }
    let normal = side.map_or(fit.normal, |(normal, _)| normal);
    if is_surface {
        return shape(Structure::Surface, normal);
    }
    let wide = fit_plane(positions, point, &neighbors);
    if is_line(&wide) {
        return shape(Structure::Line, wide.normal);
    }
    if typical.is_surface(&wide, radius) {
        return shape(Structure::Surface, wide.normal);
    }
    let neighbors = tree.nearest(positions[point], N_WIDEST_NEIGHBORS, Some(point as u32));
    let widest = fit_plane(positions, point, &neighbors);
    if self::is_surface(&widest) && widest.variation < MAX_WIDEST_VARIATION {
        return shape(Structure::Surface, widest.normal);
    }
    shape(Structure::Scatter, normal)
}

#[cfg(test)]
mod tests {
    //! Structures of sampled shapes.

    use super::*;
    use crate::math::Random;
    use crate::points::test_clouds::prepared;
    use crate::points::{Denoise, PointCloud, Preparation, StructureChoice, prepare};
    use crate::progress::NoProgress;

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
    fn the_corners_of_a_triangle_stand_for_themselves() {
        let (_, structures) = prepared(vec![Vec3::ZERO, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)]);
        assert_eq!(structures, [Structure::Scatter; 3]);
        let (_, structures) = prepared(vec![Vec3::ZERO, Vec3::Y, 2.0 * Vec3::Y]);
        assert_eq!(structures, [Structure::Line; 3]);
    }

    #[test]
    fn noise_of_a_surface_is_not_foliage() {
        for noise in [0.3, 0.6] {
            let mut random = Random::new(5, 0);
            // The spacing is 0.01.
            let mut point = |_| {
                let height = 0.01 * noise * random.next_gaussian() as f32;
                Vec3::new(random.next_f32(), random.next_f32(), height)
            };
            let cloud = PointCloud::from_positions((0..10_000).map(&mut point).collect());
            let preparation = Preparation { denoise: Denoise::Off, ..Preparation::default() };
            let (cloud, _) = prepare(cloud, &preparation, &NoProgress).unwrap();
            let n_scatter = fraction(&cloud.structures().unwrap(), Structure::Scatter);
            assert!(n_scatter < 0.01, "{noise}: {n_scatter}");
        }
    }

    #[test]
    fn points_without_neighbors_within_a_distance_are_no_lines() {
        let plane = random_points(5000, 6, |[x, y, z]| Vec3::new(x, y, 0.001 * z));
        let preparation =
            Preparation { normals: Neighborhood::Within(0.005), ..Preparation::default() };
        let cloud = PointCloud::from_positions(plane);
        let (cloud, _) = prepare(cloud, &preparation, &NoProgress).unwrap();
        let n_lines = fraction(&cloud.structures().unwrap(), Structure::Line);
        assert!(n_lines < 0.01, "{n_lines}");
        let n_level = cloud.normals().iter().filter(|normal| 0.9 < normal.z.abs()).count();
        assert!(4950 < n_level, "{n_level}");
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
    fn stems_side_by_side_in_a_wood_are_no_sheet_and_scan_lines_on_its_land_are_one() {
        let mut random = Random::new(12, 0);
        let mut noise = |size: f32| size * (random.next_f32() - 0.5);
        // A thin stem of points that are 0.05 apart between two thick ones.
        let mut points: Vec<Vec3> =
            (0..200).map(|i| Vec3::new(noise(0.04), noise(0.04), 0.05 * i as f32)).collect();
        points.extend((0..3000).map(|i| {
            let x = if i % 2 == 0 { -1.3 } else { 1.3 };
            Vec3::new(x + noise(0.4), noise(0.02), 5.0 + noise(10.0))
        }));
        // Fifteen scan lines, 0.4 apart, of points that are 0.02 apart.
        points.extend((0..4500).map(|i| {
            Vec3::new(0.02 * (i % 300) as f32, 30.0 + 0.4 * (i / 300) as f32, noise(0.002))
        }));
        points.extend((0..6000).map(|_| Vec3::new(noise(10.0), -20.0 + noise(10.0), 0.0)));
        let crown = Vec3::new(0.0, 80.0, 20.0);
        points.extend((0..6000).map(|_| crown + Vec3::new(noise(9.0), noise(9.0), noise(9.0))));
        // The vertical may be any axis.
        for turn in [|p: Vec3| p, |p: Vec3| Vec3::new(p.x, p.z, -p.y)] {
            let (cloud, _) = prepared(points.iter().copied().map(turn).collect());
            let widest = cloud.radii()[..200].iter().copied().fold(0.0, f32::max);
            assert!(widest < 0.7, "{widest}");
            let of_lines = &cloud.radii()[3200..7700];
            let n_wide = of_lines.iter().filter(|radius| 0.4 < **radius).count();
            assert!(200 < n_wide, "{n_wide}");
        }
    }

    #[test]
    fn an_elevation_model_is_a_surface_however_steep() {
        // Denoising takes some points off the grid.
        for denoise in [Denoise::Off, Denoise::Auto] {
            let n_scatter = |moved: f32| {
                let point = |i: i32| {
                    let [x, y] = [i % 50, i / 50].map(|line| line as f32);
                    let height = 6.0 * (1.1 * x).sin() * (0.9 * y).cos();
                    Vec3::new(x + moved * (0.37 * i as f32).sin(), y, height)
                };
                let cloud = PointCloud::from_positions((0..2500).map(point).collect());
                let preparation = Preparation { denoise, ..Preparation::default() };
                let (cloud, _) = prepare(cloud, &preparation, &NoProgress).unwrap();
                let structures = cloud.structures().unwrap();
                structures.iter().filter(|kind| **kind == Structure::Scatter).count()
            };
            assert_eq!(n_scatter(0.0), 0);
            let beside_a_grid = n_scatter(1.0);
            assert!(denoise == Denoise::Auto || 1000 < beside_a_grid, "{beside_a_grid}");
        }
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
}
