//! The axis along which an object is its own mirror image: vehicles, animals and people are, from left to right.

use crate::math::{Aabb, Vec3};

/// Number of cells along the longest side of the bounds.
const N_CELLS: usize = 64;

/// Minimum fraction of the points of a symmetric object whose mirror image lies in or next to an occupied cell.
const MIN_SYMMETRIC: f64 = 0.98;

/// Maximum such fraction along the other two axes: a box or a ball has no left and right.
const MAX_OTHER: f64 = 0.9;

/// Minimum size along the mirror axis in cells: what is thinner fills the cells of its mirror image by itself.
const MIN_CELLS_ALONG_AXIS: f32 = 8.0;

/// Minimum number of points: a few are symmetric by chance.
const MIN_POINTS: usize = 1000;

/// Returns the one axis along which the points are their own mirror image, as far as a grid of cells tells; none if
/// they are so along no axis or along several, or are thin along it.
pub fn mirror_axis(points: &[Vec3]) -> Option<usize> {
    if points.len() < MIN_POINTS {
        return None;
    }
    let occupancy = Occupancy::of(points);
    let fractions = occupancy.mirrored_fractions(points);
    let axis = (0..3).find(|&axis| MIN_SYMMETRIC <= fractions[axis])?;
    let is_only = (0..3).all(|other| other == axis || fractions[other] <= MAX_OTHER);
    let n_cells = occupancy.bounds.size()[axis] * occupancy.cells_per_unit;
    (is_only && MIN_CELLS_ALONG_AXIS <= n_cells).then_some(axis)
}

/// The cells of a grid that hold points or are next to one that does.
struct Occupancy {
    bounds: Aabb,
    cells_per_unit: f32,
    is_occupied: Vec<bool>,
}

impl Occupancy {
    fn of(points: &[Vec3]) -> Self {
        let bounds = Aabb::of_points(points.iter().copied());
        let cells_per_unit = N_CELLS as f32 / bounds.size().max_element().max(f32::MIN_POSITIVE);
        let mut found =
            Self { bounds, cells_per_unit, is_occupied: vec![false; N_CELLS * N_CELLS * N_CELLS] };
        for point in points {
            let cell = found.cell(*point);
            let [x, y, z] = cell.map(|i| i.saturating_sub(1)..=(i + 1).min(N_CELLS - 1));
            for z in z {
                for y in y.clone() {
                    for x in x.clone() {
                        found.is_occupied[index([x, y, z])] = true;
                    }
                }
            }
        }
        found
    }

    /// Returns, for each axis, the fraction of the points whose mirror image lies in one of the cells.
    fn mirrored_fractions(&self, points: &[Vec3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| {
            let ends = self.bounds.min[axis] + self.bounds.max[axis];
            let is_mirrored = |point: &&Vec3| {
                let mut image = **point;
                image[axis] = ends - image[axis];
                self.is_occupied[index(self.cell(image))]
            };
            points.iter().filter(is_mirrored).count() as f64 / points.len() as f64
        })
    }

    fn cell(&self, point: Vec3) -> [usize; 3] {
        let cell = (point - self.bounds.min) * self.cells_per_unit;
        cell.to_array().map(|along| (along as usize).min(N_CELLS - 1))
    }
}

fn index([x, y, z]: [usize; 3]) -> usize {
    (z * N_CELLS + y) * N_CELLS + x
}

#[cfg(test)]
mod tests {
    //! Objects with no, one and several mirror axes.

    use super::*;
    use crate::math::Random;

    /// Points on an animal: a body with a head at one end of X and legs under it, left and right along Y.
    fn animal() -> Vec<Vec3> {
        let mut random = Random::new(1, 0);
        let mut on_ball = || {
            let gaussian: [f32; 3] = std::array::from_fn(|_| random.next_gaussian() as f32);
            Vec3::from_array(gaussian).normalize_or(Vec3::X)
        };
        let mut points = Vec::new();
        for _ in 0..20_000 {
            points.push(on_ball() * Vec3::new(1.0, 0.4, 0.4));
            points.push(on_ball() * 0.3 + Vec3::new(1.2, 0.0, 0.5));
            for (x, y) in [(-0.7, -0.3), (-0.7, 0.3), (0.7, -0.3), (0.7, 0.3)] {
                points.push(on_ball() * Vec3::new(0.1, 0.1, 0.5) + Vec3::new(x, y, -0.6));
            }
        }
        points
    }

    #[test]
    fn an_animal_is_its_mirror_image_from_left_to_right() {
        let animal = animal();
        assert_eq!(mirror_axis(&animal), Some(1));
        let turned: Vec<Vec3> = animal.iter().map(|p| Vec3::new(p.x, p.z, -p.y)).collect();
        assert_eq!(mirror_axis(&turned), Some(2));
        let moved: Vec<Vec3> = animal.iter().map(|p| 1e-3 * *p + Vec3::splat(4.0)).collect();
        assert_eq!(mirror_axis(&moved), Some(1));
    }

    #[test]
    fn half_of_an_animal_has_no_mirror_axis() {
        let half: Vec<Vec3> = animal().into_iter().filter(|p| p.y < 0.1).collect();
        assert_eq!(mirror_axis(&half), None);
    }

    #[test]
    fn boxes_and_balls_have_several_mirror_axes() {
        let mut random = Random::new(2, 0);
        let cube: Vec<Vec3> = (0..9000)
            .map(|i| {
                let mut p = Vec3::from_array(std::array::from_fn(|_| random.next_f32()));
                p[i % 3] = p[i % 3].round();
                p
            })
            .collect();
        assert_eq!(mirror_axis(&cube), None);
        let slab: Vec<Vec3> = cube.iter().map(|p| *p * Vec3::new(1.0, 0.01, 2.0)).collect();
        assert_eq!(mirror_axis(&slab), None);
    }

    #[test]
    fn thin_points_are_no_mirror_image_along_their_thickness() {
        // The floor of a trench with one bend.
        let mut random = Random::new(3, 0);
        let mut next = || random.next_f32();
        let trench: Vec<Vec3> = (0..20_000)
            .map(|i| {
                let [x, y] = if i % 2 == 0 { [12.0, 2.0] } else { [2.0, 9.0] };
                Vec3::new(x * next(), y * next(), 0.2 * next())
            })
            .collect();
        assert_eq!(mirror_axis(&trench), None);
    }

    #[test]
    fn degenerate_points_have_no_mirror_axis() {
        for points in [vec![], vec![Vec3::ONE; 5], vec![Vec3::ONE; 5000]] {
            assert_eq!(mirror_axis(&points), None);
        }
    }
}
