//! The points of a cube and of the eight cubes in it, with bounds of the field there.

use super::points::{CellPoints, FieldPoints, MIN_AGREEING_COSINE};
use crate::math::{Aabb, Vec3};

/// The points that have weight in a cube, with what bounds the field in it.
pub(super) struct CubePoints {
    /// The points.
    pub points: CellPoints,
    /// The normal of the first point.
    first_normal: Vec3,
    /// True if the sides of all points are known without doubt.
    agrees: bool,
    /// The least and greatest distance from the points' planes, on the side of the first normal.
    range: (f32, f32),
}

impl CubePoints {
    /// Returns points about whose field nothing is known.
    pub fn new(points: CellPoints) -> Self {
        Self { points, agrees: false, ..Self::none(0) }
    }

    fn none(capacity: usize) -> Self {
        Self {
            points: CellPoints::with_capacity(capacity),
            first_normal: Vec3::ZERO,
            agrees: true,
            range: (f32::INFINITY, f32::NEG_INFINITY),
        }
    }

    /// Returns false if the field surely has no zero in the cube.
    pub fn may_have_zero(&self) -> bool {
        let margin = self.points.margin();
        !self.agrees || self.range.0 - margin <= 0.0 && 0.0 <= self.range.1 + margin
    }

    /// Adds a point, from whose plane the cube is between the distances of `range`.
    #[inline]
    fn push(&mut self, slot: u32, support: f32, normal: Vec3, has_sides: bool, range: (f32, f32)) {
        if self.points.is_empty() {
            self.first_normal = normal;
        }
        self.points.push(slot, support);
        let cosine = normal.dot(self.first_normal);
        self.agrees &= has_sides || MIN_AGREEING_COSINE < cosine.abs();
        let is_flipped = !has_sides && cosine < 0.0;
        let (low, high) = if is_flipped { (-range.1, -range.0) } else { range };
        self.range = (self.range.0.min(low), self.range.1.max(high));
    }
}

impl FieldPoints {
    /// Returns for each of the eight cubes in a cube those of its points that have weight there. The cubes are widened a
    /// little.
    pub fn split(&self, points: &CellPoints, cube: &Aabb) -> [CubePoints; 8] {
        let children = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| child_cube(cube, i));
        let margin = points.margin();
        // Per axis, the lower and the upper half: what is computed for each is that of four children.
        let halves = [&children[0], &children[7]];
        let lows = halves.map(|half| half.min - margin);
        let highs = halves.map(|half| half.max + margin);
        let centers = halves.map(|half| half.center());
        let extents = halves.map(|half| 0.5 * half.size());
        let mut parts = children.map(|_| CubePoints::none(points.slots.len() / 2));
        for slot in &points.slots {
            let point = &self.points[*slot as usize];
            let [mut squared, mut heights, mut reaches] = [[Vec3::ZERO; 2]; 3];
            for half in 0..2 {
                let nearest = point.center.clamp(lows[half], highs[half]);
                squared[half] = (nearest - point.center) * (nearest - point.center);
                heights[half] = point.normal * (centers[half] - point.center);
                reaches[half] = point.normal.abs() * extents[half];
            }
            let sum = |halves: &[Vec3; 2], i: usize| {
                halves[i & 1].x + halves[i >> 1 & 1].y + halves[i >> 2 & 1].z
            };
            let limit = point.support * point.support;
            for (i, part) in parts.iter_mut().enumerate() {
                if sum(&squared, i) < limit {
                    let (height, reach) = (sum(&heights, i), sum(&reaches, i));
                    let range = (height - reach, height + reach);
                    part.push(*slot, point.support, point.normal, self.has_sides, range);
                }
            }
        }
        parts
    }
}

/// Returns one of the eight cubes that a cube consists of.
pub(super) fn child_cube(cube: &Aabb, i: usize) -> Aabb {
    let middle = cube.center();
    let is_upper = |axis: usize| i >> axis & 1 == 1;
    let pick = |axis: usize, lower: Vec3, upper: Vec3| {
        if is_upper(axis) { upper[axis] } else { lower[axis] }
    };
    Aabb {
        min: Vec3::from_array([0, 1, 2].map(|axis| pick(axis, cube.min, middle))),
        max: Vec3::from_array([0, 1, 2].map(|axis| pick(axis, middle, cube.max))),
    }
}
