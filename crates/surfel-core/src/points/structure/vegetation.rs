//! Vegetation in clouds, and the land under it.

use super::point_shape::{PointShape, Structure, is_line, is_surface};
use crate::math::{DVec3, SymmetricMatrix, Vec3, median, smallest_eigenvector};
use crate::points::PointCloud;
use crate::points::normals::planes::PlaneFit;
use crate::points::up::is_mostly_land;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, Ordering};

/// Minimum fraction of scattered points in a cloud with much vegetation.
pub const MIN_VEGETATION: f32 = 0.2;
/// Minimum fraction of scattered points among the rough ones of a cloud that is leafy, not noisy.
const MIN_SCATTERED_ROUGH: f32 = 0.5;
/// Minimum number of scattered points of a scanned plant: sparse points of a thin object are scattered, too.
const MIN_LEAVES: usize = 10_000;
/// Size of the cells in which crowns are looked for, in median radii of the scattered points: far wider than a noisy edge.
const CROWN_CELL: f32 = 32.0;
/// Minimum number of scattered points in a cell that counts.
const MIN_IN_CELL: u32 = 12;
/// Minimum fraction of scattered points in a cell within a crown.
const MIN_SCATTERED_CROWN: f32 = 0.7;
/// Minimum number of scattered points within crowns.
const MIN_CROWN: u32 = 2000;
/// Minimum number and fraction of scattered points in the scan of a street. Corridors have a fraction of 0.02.
const MIN_IN_STREET: usize = 500;
const MIN_FRACTION_IN_STREET: f32 = 0.05;
/// ASPRS classes of low, medium and high vegetation.
const VEGETATION_CLASSES: std::ops::RangeInclusive<u8> = 3..=5;

/// Returns true if the scattered points of a cloud are leaves rather than parts of sparse or noisy objects: those that the
/// file calls vegetation, those on land, those in crowns, those of a spinning scanner, and those of clouds with much of
/// them. Without such classes the points of a cloud that are all scattered stand for themselves.
/// `radii` are those of the points, and `has_rings` tells whether the points are on the rings of a spinning scanner.
pub fn has_leaves(
    cloud: &PointCloud,
    structures: &[Structure],
    radii: &[f32],
    has_rings: impl FnOnce() -> bool,
) -> bool {
    let is_scattered = |structure: &Structure| *structure == Structure::Scatter;
    let n_scattered = structures.iter().filter(|structure| is_scattered(structure)).count();
    let n_plants = cloud.classification.as_deref().map_or(0, |classes| {
        let classes = classes.iter().zip(structures).filter(|(_, own)| is_scattered(own));
        classes.filter(|(class, _)| VEGETATION_CLASSES.contains(class)).count()
    });
    if 0 < n_plants && is_much(n_plants, n_scattered) {
        return true;
    }
    let are_plants = || match is_much(n_scattered, structures.len()) {
        true => MIN_LEAVES <= n_scattered,
        false => {
            MIN_CROWN as usize <= n_scattered && has_crowns(&cloud.positions, structures, radii)
        }
    };
    // A spinning scanner, as on vehicles, has so few rings in the trees of a street that they make no crowns.
    let is_street_scan = || {
        MIN_IN_STREET <= n_scattered
            && MIN_FRACTION_IN_STREET * cloud.len() as f32 <= n_scattered as f32
            && has_rings()
    };
    let some_are_scattered = 0 < n_scattered && n_scattered < structures.len();
    some_are_scattered && (is_mostly_land(&cloud.positions) || are_plants() || is_street_scan())
}

/// Returns true if most of the scattered points, without those that lie alone, are in crowns: at least seven of ten points
/// around them are scattered.
fn has_crowns(positions: &[Vec3], structures: &[Structure], radii: &[f32]) -> bool {
    let is_scattered = |point: &usize| structures[*point] == Structure::Scatter;
    let Some(radius) = median((0..radii.len()).filter(is_scattered).map(|point| radii[point]))
    else {
        return false;
    };
    let cells_per_unit = 1.0 / f64::from(CROWN_CELL * radius);
    let cell = |point: usize| {
        let cell = positions[point].as_dvec3() * cells_per_unit;
        cell.floor().to_array().map(|index| index as i64)
    };
    let mut cells: HashMap<[i64; 3], CrownCell> = HashMap::new();
    for point in (0..structures.len()).filter(is_scattered) {
        cells.entry(cell(point)).or_default().n_scattered += 1;
    }
    cells.retain(|_, cell| MIN_IN_CELL <= cell.n_scattered);
    (0..structures.len()).into_par_iter().for_each(|point| {
        if let Some(cell) = cells.get(&cell(point)) {
            cell.n_points.fetch_add(1, Ordering::Relaxed);
        }
    });
    let n_scattered: u32 = cells.values().map(|cell| cell.n_scattered).sum();
    let n_in_crowns = cells.values().filter(|cell| cell.is_in_crown()).map(|cell| cell.n_scattered);
    let n_in_crowns: u32 = n_in_crowns.sum();
    MIN_CROWN <= n_in_crowns && n_scattered - n_in_crowns <= n_in_crowns
}

/// A cell of space with scattered points.
#[derive(Default)]
struct CrownCell {
    n_scattered: u32,
    n_points: AtomicU32,
}

impl CrownCell {
    /// True if at least seven of ten points are scattered.
    fn is_in_crown(&self) -> bool {
        let n_points = self.n_points.load(Ordering::Relaxed);
        MIN_SCATTERED_CROWN * n_points as f32 <= self.n_scattered as f32
    }
}

/// Returns the number of points whose nearest neighbours lie in no plane and on no line.
pub fn count_rough(fits: &[PlaneFit]) -> usize {
    fits.par_iter().filter(|fit| !is_line(fit) && !is_surface(fit)).count()
}

/// True if a number of points is much of a cloud.
fn is_much(n_plants: usize, n_points: usize) -> bool {
    MIN_VEGETATION * n_points as f32 <= n_plants as f32
}

/// Returns true if much of the cloud is vegetation: many points are scattered, and not by noise.
pub fn is_vegetated(shapes: &[PointShape], n_rough: usize) -> bool {
    let n_scattered = count_scattered(shapes);
    !is_noisy(n_scattered, n_rough) && is_much(n_scattered, shapes.len())
}

/// Returns true if most of the points whose nearest neighbours lie in no plane are not scattered: the cloud is noisy rather
/// than leafy.
pub fn is_noisy(n_scattered: usize, n_rough: usize) -> bool {
    (n_scattered as f32) < MIN_SCATTERED_ROUGH * n_rough as f32
}

/// Returns the number of scattered points.
pub fn count_scattered(shapes: &[PointShape]) -> usize {
    shapes.iter().filter(|shape| shape.structure == Structure::Scatter).count()
}

/// Returns the direction to which the normals of the surface points are nearest, amid vegetation that of the land, on the
/// side of the scattered points.
pub fn land_normal(positions: &[Vec3], shapes: &[PointShape]) -> Vec3 {
    let of = |structure: Structure| {
        let points = positions.iter().zip(shapes);
        points.filter(move |(_, shape)| shape.structure == structure)
    };
    let mut scatter = SymmetricMatrix::default();
    for (_, shape) in of(Structure::Surface) {
        // The eigenvector of the least eigenvalue of the negative matrix.
        scatter.add_outer(shape.normal.as_dvec3(), -1.0);
    }
    let normal = smallest_eigenvector(&scatter).0;
    let mean = |structure| {
        let sum: DVec3 = of(structure).map(|(position, _)| position.as_dvec3()).sum();
        sum / of(structure).count().max(1) as f64
    };
    let is_up = 0.0 <= normal.dot(mean(Structure::Scatter) - mean(Structure::Surface));
    if is_up { normal.as_vec3() } else { -normal.as_vec3() }
}

#[cfg(test)]
mod tests {
    //! Scattered points of objects, of land and of plants.

    use super::*;
    use crate::math::Random;

    /// Returns points in a box, of which the first are scattered.
    fn cloud(n_points: usize, n_scattered: usize, size: Vec3) -> (PointCloud, Vec<Structure>) {
        let mut random = Random::new(2, 0);
        let mut within = || Vec3::from_array(std::array::from_fn(|_| random.next_f32()));
        let positions = (0..n_points).map(|_| size * within()).collect();
        let mut structures = vec![Structure::Surface; n_points];
        structures[..n_scattered].fill(Structure::Scatter);
        let cloud = PointCloud {
            radii: Some(vec![0.02; n_points]),
            ..PointCloud::from_positions(positions)
        };
        (cloud, structures)
    }

    fn radii(cloud: &PointCloud) -> &[f32] {
        cloud.radii.as_deref().unwrap_or_default()
    }

    #[test]
    fn scattered_points_of_objects_are_no_leaves() {
        let cube = Vec3::ONE;
        for (n_points, n_scattered, size, expected) in [
            (2000, 1500, cube, false),
            (4000, 3500, cube, false),
            (100_000, 12_000, cube, false),
            (50_000, 12_000, cube, true),
            (12_000, 12_000, cube, false),
            (2000, 20, Vec3::new(200.0, 200.0, 8.0), true),
        ] {
            let (cloud, structures) = cloud(n_points, n_scattered, size);
            assert_eq!(
                has_leaves(&cloud, &structures, radii(&cloud), || false),
                expected,
                "{n_scattered} of {n_points}"
            );
        }
    }

    #[test]
    fn what_a_file_calls_vegetation_is_leaves() {
        for n_scattered in [50, 100] {
            let (mut cloud, structures) = cloud(100, n_scattered, Vec3::ONE);
            for (class, expected) in [(2, false), (3, true), (5, true), (6, false)] {
                cloud.classification = Some([vec![class; 20], vec![1; 80]].concat());
                assert_eq!(
                    has_leaves(&cloud, &structures, radii(&cloud), || false),
                    expected,
                    "{class}"
                );
            }
        }
    }

    #[test]
    fn vegetation_elsewhere_makes_no_leaves() {
        let (mut cloud, structures) = cloud(100, 50, Vec3::ONE);
        cloud.classification = Some([vec![6; 49], vec![5; 51]].concat());
        assert!(!has_leaves(&cloud, &structures, radii(&cloud), || false));
    }

    #[test]
    fn crowns_before_a_building_are_leaves() {
        // A wall, of which scattered points either fill a ball before it or lie along its edges.
        let mut random = Random::new(5, 0);
        let mut within = || Vec3::from_array(std::array::from_fn(|_| random.next_f32()));
        let wall: Vec<Vec3> = (0..97_000).map(|_| Vec3::new(40.0, 0.0, 20.0) * within()).collect();
        let crown: Vec<Vec3> = (0..3000).map(|_| 4.0 * within() - 8.0 * Vec3::Y).collect();
        let edges: Vec<Vec3> = wall.iter().step_by(33).map(|p| Vec3::new(p.x, 0.0, 3.0)).collect();
        for (n_scattered, scattered, expected) in
            [(3000, &crown, true), (1500, &crown, false), (2900, &edges, false)]
        {
            let mut cloud = PointCloud::from_positions([&wall, &scattered[..n_scattered]].concat());
            cloud.radii = Some(vec![0.08; cloud.len()]);
            let mut structures = vec![Structure::Surface; cloud.len()];
            structures[wall.len()..].fill(Structure::Scatter);
            assert_eq!(
                has_leaves(&cloud, &structures, radii(&cloud), || false),
                expected,
                "{n_scattered}"
            );
        }
    }

    #[test]
    fn scattered_points_of_a_spinning_scanner_are_leaves() {
        let cloud = PointCloud::from_positions(vec![Vec3::ZERO; 16_000]);
        for (has_rings, n_scattered, expected) in
            [(true, 900, true), (true, 700, false), (false, 900, false)]
        {
            let mut structures = vec![Structure::Surface; 16_000];
            structures[..n_scattered].fill(Structure::Scatter);
            let found = has_leaves(&cloud, &structures, radii(&cloud), || has_rings);
            assert_eq!(found, expected, "{has_rings} {n_scattered}");
        }
    }

    #[test]
    fn the_normal_of_land_points_to_what_grows_on_it() {
        let shape = |structure| PointShape { structure, normal: Vec3::Y, radius: 1.0 };
        let shapes = [shape(Structure::Surface), shape(Structure::Scatter)];
        for up in [Vec3::Y, -Vec3::Y] {
            let positions = [Vec3::new(3.0, 9.0, 4.0), Vec3::new(0.0, 9.0, 7.0) + 0.5 * up];
            assert_eq!(land_normal(&positions, &shapes), up);
        }
    }
}
