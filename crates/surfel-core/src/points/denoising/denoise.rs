//! Moves noisy points onto the surface that their neighbours describe.
//!
//! The more noise, the more neighbours take part. Points of flat faces move onto the plane of their face, others along
//! normals that keep edges.

use super::bilateral_normals::{BilateralNormals, NEIGHBORS_PER_NOISE};
use super::depth_image::{MovedPoints, smooth_depths};
use super::depth_sensor::DepthSensor;
use super::flat_faces::{FlatFaces, SupportPoints};
use super::noise::Noise;
use super::noise_at_point::{GROUP_SIZE, LocalFit};
use super::plants::{NoisyPoints, Plants};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::PointCloud;
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::normals::jets::fit_wide_jet;
use crate::points::structure::wall_faces::{Face, N_FACE_NEIGHBORS};
use crate::progress::Progress;
use crate::words::{counted, format_length};
use rayon::prelude::*;

/// Least noise of a depth image, in pixels, that is denoised unasked.
const MIN_PIXEL_NOISE: f32 = 0.15;
/// Numbers of neighbours that take part: the least and the most.
const MIN_NEIGHBORS: f32 = 12.0;
const MAX_NEIGHBORS: f32 = 2048.0;
/// Number of neighbours from which means of groups of points stand for them.
const MIN_GROUPED: u32 = 96;

/// The choice whether points are moved onto their surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Denoise {
    /// Clouds without radii are denoised where surfaces are noisy, and so are points on straight lines.
    #[default]
    Auto,
    /// Points are moved however little noise there is. Plants, points that fill space and animated clouds stay, and of clouds with
    /// many leaves all but clear surfaces. Those of a depth image move along their rays, by some steps of its disparities at most.
    On,
    /// All points stay where they are.
    Off,
}

/// Effect of denoising.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DenoiseReport {
    /// Median noise over the regions of surfaces that were denoised: the standard deviation of points from their surface, in
    /// spacings. In a depth image that of the depths, in pixels.
    pub noise: f32,
    /// Number of points that were moved.
    pub n_moved: usize,
    /// Mean distance by which these were moved.
    pub mean_distance: f32,
}

/// Results of denoising beside the moved points.
#[derive(Clone, Debug, PartialEq)]
pub struct Denoised {
    /// The effect.
    pub report: DenoiseReport,
    /// Unit normal of either sign of each point where a cubic follows the noisy points, zero elsewhere.
    pub normals: Vec<Vec3>,
}

impl DenoiseReport {
    /// Returns a line about the moved points for the user.
    pub fn line(&self) -> String {
        format!(
            "noise of {:.2} spacings: {} moved onto the surface, by {} on average",
            self.noise,
            counted(self.n_moved, "point"),
            format_length(self.mean_distance)
        )
    }
}

/// Moves the points of a cloud onto their surface; returns none if the points stay. Points that morph targets or joints
/// move stay where they are.
///
/// # Errors
///
/// Returns [`Error::TooManyPoints`](crate::Error::TooManyPoints) beyond 32-bit indices and
/// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn denoise(
    cloud: &mut PointCloud,
    choice: Denoise,
    progress: &dyn Progress,
) -> Result<Option<Denoised>> {
    let is_animated = !cloud.morphs.is_empty() || cloud.skin.is_some();
    let is_auto = choice == Denoise::Auto;
    // Radii are those of a cloud that was prepared before.
    if is_animated || choice == Denoise::Off || (is_auto && cloud.radii.is_some()) {
        return Ok(None);
    }
    let of_image = match DepthSensor::find(cloud) {
        Some(sensor) => smooth_depths(&cloud.positions, &sensor, progress)?,
        None => None,
    };
    // The points before the first move, with their noise.
    let mut measured = None;
    if let Some(moved) = of_image.filter(|moved| !is_auto || MIN_PIXEL_NOISE <= moved.noise) {
        let before = std::mem::replace(&mut cloud.positions, moved.positions);
        measured = Some((before, moved.noise));
    }
    let mut normals = Vec::new();
    if let Some((moved, normals_of_surfaces)) = denoise_surfaces(cloud, is_auto, progress)? {
        let before = std::mem::replace(&mut cloud.positions, moved.positions);
        measured.get_or_insert((before, moved.noise));
        normals = normals_of_surfaces;
    }
    let Some((measured, noise)) = measured else { return Ok(None) };
    normals.resize(measured.len(), Vec3::ZERO);
    let moves = measured.iter().zip(&cloud.positions);
    let sum: f64 = moves.clone().map(|(from, to)| f64::from(from.distance(*to))).sum();
    let n_moved = moves.filter(|(from, to)| from != to).count();
    let mean_distance = (sum / n_moved.max(1) as f64) as f32;
    Ok(Some(Denoised { report: DenoiseReport { noise, n_moved, mean_distance }, normals }))
}

/// Returns the points moved onto the surface of their neighbours, and the normals of [`Denoised`], or none if the points stay.
fn denoise_surfaces(
    cloud: &PointCloud,
    is_auto: bool,
    progress: &dyn Progress,
) -> Result<Option<(MovedPoints, Vec<Vec3>)>> {
    let positions = &cloud.positions;
    let tree = KdTree::new(positions, progress)?;
    let order = tree.order();
    let means = means_of_groups(positions, &order);
    let groups = KdTree::new(&means, progress)?;
    let noise = Noise::new(&tree, &groups, &order, is_auto, progress)?;
    if is_auto && !noise.is_noisy() {
        return Ok(None);
    }
    drop(tree);
    // Neighbours near each other in memory make the moves 1.6 times as fast in clouds of random order.
    let sorted: Vec<Vec3> = order.par_iter().map(|point| positions[*point as usize]).collect();
    let tree = KdTree::new(&sorted, progress)?;
    let fits = LocalFit::of_points(&tree, progress)?;
    let noises = noise.at_points(&tree, &groups, &fits, progress)?;
    let ground_noise = noise.of_ground();
    let noisy = NoisyPoints { tree: &tree, groups: &groups, fits: &fits, noises: &noises };
    let plants = Plants::find(noisy, ground_noise, cloud, progress)?;
    let count = |(point, noise): (usize, &Option<f32>)| {
        progress.check()?;
        let Some(noise) = *noise else { return Ok(0) };
        if plants.contains(point) {
            return Ok(0);
        }
        Ok((NEIGHBORS_PER_NOISE * noise).clamp(MIN_NEIGHBORS, MAX_NEIGHBORS) as u32)
    };
    let counts = noises.par_iter().enumerate().map(count).collect::<Result<Vec<u32>>>()?;
    drop(fits);
    let (mut moved_points, mut normals) = (positions.clone(), vec![Vec3::ZERO; positions.len()]);
    let results = project_points(&tree, &groups, &order, &counts, &noises, progress)?;
    for (point, (position, normal)) in order.iter().zip(results) {
        moved_points[*point as usize] = position;
        normals[*point as usize] = normal;
    }
    let moved = MovedPoints { positions: moved_points, noise: noise.median() };
    Ok(Some((moved, normals)))
}

/// Returns the means of groups of points that follow each other in `order`.
fn means_of_groups(positions: &[Vec3], order: &[u32]) -> Vec<Vec3> {
    let mean = |group: &[u32]| {
        let sum: Vec3 = group.iter().map(|point| positions[*point as usize]).sum();
        sum / group.len() as f32
    };
    order.par_chunks(GROUP_SIZE).map(mean).collect()
}

/// Projects points onto their surface, and returns them with their normals, zero where no cubic follows the points.
/// `groups` are the means of each [`GROUP_SIZE`] points in their order, `seeds` decide which faces of walls are tried,
/// `counts` are the numbers of neighbours that take part, zero for points that stay, and `noises` the noise in spacings
/// where it is known.
fn project_points(
    tree: &KdTree,
    groups: &KdTree,
    seeds: &[u32],
    counts: &[u32],
    noises: &[Option<f32>],
    progress: &dyn Progress,
) -> Result<Vec<(Vec3, Vec3)>> {
    let positions = tree.positions();
    // Points and groups beside those that are used take part in the normals of these.
    let of_group = |group: &[u32]| {
        let most = group.iter().copied().max().unwrap_or(0);
        if 2 * most < MIN_GROUPED { 0 } else { most.div_ceil(GROUP_SIZE as u32) }
    };
    let counts_of_groups = counts.par_chunks(GROUP_SIZE).map(of_group).collect();
    let of_point = |count: &u32| if 2 * MIN_GROUPED < *count { 0 } else { *count };
    let counts_of_points = counts.iter().map(of_point).collect();
    let points = BilateralNormals::new(tree, counts_of_points, progress)?;
    let groups = BilateralNormals::new(groups, counts_of_groups, progress)?;
    let normal_of = |point: usize| match points.normals[point] {
        Vec3::ZERO => groups.normal_near(positions[point]),
        normal => normal,
    };
    let faces = FlatFaces::find(tree, counts, noises, normal_of, progress)?;
    let face_tree = faces.tree(progress)?;
    progress.begin("denoise", positions.len() as u64);
    let project_point = |(point, position): (usize, &Vec3)| {
        if point.is_multiple_of(1024) {
            progress.check()?;
            progress.advance(1024.min(positions.len() - point) as u64);
        }
        let count = counts[point];
        if count == 0 {
            return Ok((*position, Vec3::ZERO));
        }
        let noise = noises[point].unwrap_or_default();
        let support_points = || SupportPoints::around(tree, point, count as usize, noise);
        if let Some(projected) = faces.project(&face_tree, *position, support_points) {
            return Ok(projected);
        }
        let is_grouped = MIN_GROUPED <= count;
        let is_uneven = match is_grouped {
            true => groups.is_uneven_at(*position),
            false => points.is_uneven[point],
        };
        if is_uneven && let Some(projected) = project_to_face(tree, point, seeds[point]) {
            return Ok((projected, Vec3::ZERO));
        }
        if is_grouped {
            let count = count.div_ceil(GROUP_SIZE as u32);
            return Ok((groups.project(*position, count, GROUP_SIZE as f32), Vec3::ZERO));
        }
        let jet = fit_wide_jet(tree, point, points.normals[point], noise);
        let normal = jet.map_or(Vec3::ZERO, |jet| jet.normal);
        Ok((points.project(*position, count, 1.0), normal))
    };
    positions.par_iter().enumerate().map(project_point).collect()
}

/// Projects a point of a thin wall onto its own face; returns `None` where its neighbours show none.
fn project_to_face(tree: &KdTree, point: usize, seed: u32) -> Option<Vec3> {
    let positions = tree.positions();
    let position = positions[point];
    let neighbors = tree.nearest(position, N_FACE_NEIGHBORS, Some(point as u32));
    let face = Face::of(positions, point, &neighbors, seed)?;
    let height = |other: &Neighbor| face.normal.dot(positions[other.index as usize] - position);
    let sum: f32 = face.points.iter().map(height).sum();
    // The point itself has no height.
    Some(position + sum / (face.points.len() + 1) as f32 * face.normal)
}

#[cfg(test)]
mod tests {
    //! Noise that is known, and points that must stay.

    use super::*;
    use crate::math::Random;
    use crate::points::Morph;
    use crate::progress::NoProgress;

    /// Returns points of a grid in the plane z = 0 with a spacing of 1, moved by noise along each axis.
    fn noisy_plane(noise: f64) -> PointCloud {
        PointCloud::from_positions(noisy_grid(100, 100, noise))
    }

    fn noisy_grid(n_columns: usize, n_rows: usize, noise: f64) -> Vec<Vec3> {
        let mut random = Random::new(1, 0);
        let mut offset = || (noise * random.next_gaussian()) as f32;
        let grid = (0..n_columns * n_rows)
            .map(|i| Vec3::new((i % n_columns) as f32, (i / n_columns) as f32, 0.0));
        grid.map(|point| point + Vec3::new(offset(), offset(), offset())).collect()
    }

    /// Returns the root mean square height over z = 0 of the points away from the border.
    fn roughness(points: &[Vec3]) -> f32 {
        let is_inside =
            |point: &&Vec3| (10.0..90.0).contains(&point.x) && (10.0..90.0).contains(&point.y);
        let inside: Vec<&Vec3> = points.iter().filter(is_inside).collect();
        (inside.iter().map(|point| point.z * point.z).sum::<f32>() / inside.len() as f32).sqrt()
    }

    #[test]
    fn noise_is_measured_and_most_of_it_removed() {
        for noise in [0.3, 1.0, 2.0] {
            let mut cloud = noisy_plane(noise);
            let report = denoise(&mut cloud, Denoise::Auto, &NoProgress).unwrap().unwrap().report;
            let measured = report.noise / noise as f32;
            assert!((0.7..1.3).contains(&measured), "{noise}: {report:?}");
            assert_eq!(report.n_moved, cloud.len());
            let left = roughness(&cloud.positions) / noise as f32;
            assert!(left < 0.4, "{noise}: {left} of it is left");
        }
    }

    #[test]
    fn a_sphere_keeps_its_radius() {
        let mut random = Random::new(2, 0);
        // A spacing of 1.
        let radius = (10_000.0 / (4.0 * std::f32::consts::PI)).sqrt();
        let mut gaussian = || random.next_gaussian() as f32;
        let points = (0..10_000)
            .map(|_| {
                let direction = Vec3::new(gaussian(), gaussian(), gaussian()).normalize();
                (radius + 0.3 * gaussian()) * direction
            })
            .collect();
        let mut cloud = PointCloud::from_positions(points);
        denoise(&mut cloud, Denoise::On, &NoProgress).unwrap().unwrap();
        let points = cloud.positions;
        let mean = points.iter().map(|point| point.length()).sum::<f32>() / points.len() as f32;
        assert!((mean - radius).abs() < 0.03, "{mean} instead of {radius}");
    }

    #[test]
    fn clean_surfaces_and_clouds_that_fill_space_stay() {
        let mut random = Random::new(3, 0);
        let mut coordinate = || random.next_f32();
        let filled = (0..20_000).map(|_| Vec3::new(coordinate(), coordinate(), coordinate()));
        for cloud in [noisy_plane(0.05), PointCloud::from_positions(filled.collect())] {
            let mut moved = cloud.clone();
            assert_eq!(denoise(&mut moved, Denoise::Auto, &NoProgress).unwrap(), None);
            assert_eq!(moved, cloud);
        }
    }

    #[test]
    fn noisy_parts_of_a_smooth_cloud_move_and_the_rest_stays() {
        let mut random = Random::new(4, 0);
        let mut between = |low: f32, high: f32| low + (high - low) * random.next_f32();
        // Smooth ground, a noisy wall upon it, a wire above, and a tree.
        let ground = noisy_grid(500, 500, 0.05);
        let mut wall = noisy_grid(300, 200, 0.4);
        wall.iter_mut().for_each(|p| *p = Vec3::new(p.x, 20.0 + p.z, 5.0 + p.y));
        let wire = (0..50).map(|i| Vec3::new(2.0 * i as f32, 60.0, 50.0));
        let tree = (0..1000)
            .map(|_| Vec3::new(between(60.0, 80.0), between(70.0, 90.0), between(10.0, 30.0)));
        let all: Vec<Vec3> = ground.iter().chain(&wall).copied().chain(wire).chain(tree).collect();
        let mut cloud = PointCloud::from_positions(all.clone());
        let report = denoise(&mut cloud, Denoise::Auto, &NoProgress).unwrap().unwrap().report;
        assert!((0.3..0.5).contains(&report.noise), "{report:?}");
        let has_moved = |i: &usize| all[*i] != cloud.positions[*i];
        let count = |points: std::ops::Range<usize>| points.filter(has_moved).count();
        let (n_ground, n_wall, n_wire) = (ground.len(), wall.len(), 50);
        assert!(10 * count(0..n_ground) < n_ground, "{}", count(0..n_ground));
        let of_wall = n_ground..n_ground + n_wall;
        assert!(2 * n_wall < 3 * count(of_wall.clone()), "{}", count(of_wall.clone()));
        assert_eq!(count(of_wall.end..of_wall.end + n_wire), 0);
        let n_of_tree = count(of_wall.end + n_wire..all.len());
        assert!(n_of_tree < 20, "{n_of_tree}");
        let height = |points: &[Vec3]| {
            let of_wall = &points[of_wall.clone()];
            of_wall.iter().map(|p| (p.y - 20.0).abs()).sum::<f32>() / n_wall as f32
        };
        assert!(height(&cloud.positions) < 0.5 * height(&all));
    }

    #[test]
    fn noisy_parts_amid_leaves_stay() {
        let mut random = Random::new(5, 0);
        let mut between = |low: f32, high: f32| low + (high - low) * random.next_f32();
        let ground = noisy_grid(400, 400, 0.05);
        let wall = noisy_grid(300, 300, 0.4);
        let wall = wall.into_iter().map(|p| Vec3::new(p.x, 20.0 + p.z, 5.0 + p.y));
        let crowns = (0..140_000)
            .map(|_| Vec3::new(between(0.0, 100.0), between(100.0, 200.0), between(9.0, 109.0)));
        let all: Vec<Vec3> = ground.into_iter().chain(wall).chain(crowns).collect();
        let mut cloud = PointCloud::from_positions(all);
        assert!(denoise(&mut cloud, Denoise::Auto, &NoProgress).unwrap().is_none());
    }

    #[test]
    fn few_equal_and_collinear_points_stay() {
        let line = (0..100).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect();
        let few = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        for points in [Vec::new(), vec![Vec3::ONE], vec![Vec3::ONE; 1000], line, few] {
            let cloud = PointCloud::from_positions(points);
            let mut moved = cloud.clone();
            let found = denoise(&mut moved, Denoise::On, &NoProgress).unwrap().unwrap();
            let report = found.report;
            assert_eq!((report.n_moved, &moved), (0, &cloud));
            assert_eq!(denoise(&mut moved, Denoise::Auto, &NoProgress).unwrap(), None);
        }
    }

    #[test]
    fn a_depth_image_with_fine_steps_moves_only_if_asked() {
        let image = |n_steps: f32| {
            let point = |pixel: usize| {
                let [x, y] = [pixel % 200, pixel / 200].map(|at| at as f32 / 200.0 - 0.5);
                let disparity = (n_steps * (0.3 + 0.1 * x - 0.13 * y)).round();
                n_steps / disparity * Vec3::new(x, y, 1.0)
            };
            PointCloud::from_positions((0..40_000).map(point).collect())
        };
        for (n_steps, choice, is_moved) in [
            (10_000.0, Denoise::Auto, false),
            (10_000.0, Denoise::On, true),
            (300.0, Denoise::Auto, true),
        ] {
            let (measured, mut cloud) = (image(n_steps), image(n_steps));
            let found = denoise(&mut cloud, choice, &NoProgress).unwrap();
            assert_eq!((found.is_some(), cloud != measured), (is_moved, is_moved), "{n_steps}");
            let n_moved = measured.positions.iter().zip(&cloud.positions).filter(|(a, b)| a != b);
            assert_eq!(found.map_or(0, |found| found.report.n_moved), n_moved.count());
        }
    }

    #[test]
    fn clouds_with_normals_are_moved_and_prepared_ones_only_if_asked() {
        let mut cloud = noisy_plane(0.5);
        cloud.normals = Some(vec![Vec3::Z; cloud.len()]);
        let mut prepared = PointCloud { radii: Some(vec![1.0; cloud.len()]), ..cloud.clone() };
        assert!(denoise(&mut cloud, Denoise::Auto, &NoProgress).unwrap().is_some());
        assert_eq!(denoise(&mut prepared, Denoise::Auto, &NoProgress).unwrap(), None);
        assert!(denoise(&mut prepared, Denoise::On, &NoProgress).unwrap().is_some());
        let mut animated = noisy_plane(0.5);
        animated.morphs =
            vec![Morph { positions: vec![Vec3::Z; animated.len()], ..Morph::default() }];
        assert_eq!(denoise(&mut animated, Denoise::On, &NoProgress).unwrap(), None);
    }
}
