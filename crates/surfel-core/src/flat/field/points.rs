//! The points of a field, decoded as kernels see them, and questions about the points of a cell.

use crate::flat::points::FlatPoints;
use crate::math::{Aabb, LANES, Vec3, Vec3Lanes, hash};
use crate::surface::{
    CandidateHit, CandidateHitLanes, FIELD_SUPPORT, FieldPoint, FieldSums, NeighborhoodStats,
    support_weight,
};
use rayon::prelude::*;

/// Points by their slots.
pub(super) struct FieldPoints {
    pub(super) points: Vec<FieldPoint>,
    /// True if all normals point to the same side of the surface.
    pub(super) has_sides: bool,
}

/// The field at a position.
pub(super) struct FieldValue {
    pub value: f32,
    /// Mean of the normals, of unit length.
    pub normal: Vec3,
    /// Slot of the nearest point.
    pub slot: u32,
}

/// The points that have weight in a cell.
pub(super) struct CellPoints {
    /// Slots in rising order.
    pub slots: Vec<u32>,
    /// Sum of the supports.
    pub support_sum: f64,
    /// Bounding box of the supports.
    pub bounds: Aabb,
    n_blocks: usize,
}

impl FieldPoints {
    pub fn new(points: &FlatPoints, has_sides: bool) -> Self {
        let slots = 0..points.ids.len();
        let decode = |slot: usize| {
            let (block, lane) = (&points.blocks[slot / LANES], slot % LANES);
            let support = FIELD_SUPPORT * block.radius(lane);
            let squared = support * support;
            if !(squared.is_normal() && (1.0 / squared).is_normal()) {
                return FieldPoint::default();
            }
            FieldPoint { center: block.position(lane), normal: block.normal(lane), support }
        };
        Self { points: slots.into_par_iter().map(decode).collect(), has_sides }
    }

    /// Widens supports to a minimum, and keeps about as few of the points as then have weight at a position as before.
    pub fn widened(&self, min_support: f32) -> Self {
        let widen = |(slot, point): (usize, &FieldPoint)| {
            let support = point.support.max(min_support);
            let kept = (point.support / support).powi(2);
            let is_kept = hash(slot as u64) as u32 as f32 <= kept * u32::MAX as f32;
            if is_kept { FieldPoint { support, ..*point } } else { FieldPoint::default() }
        };
        let points = self.points.par_iter().enumerate().map(widen).collect();
        Self { points, has_sides: self.has_sides }
    }

    /// Returns the field at a position, if some of the points have weight there.
    pub fn value(&self, points: &CellPoints, flips: &[bool], position: Vec3) -> Option<FieldValue> {
        let (mut sums, mut normal) = (FieldSums::new(), Vec3::ZERO);
        let mut nearest = (f32::INFINITY, 0);
        for (slot, is_flipped) in points.slots.iter().zip(flips) {
            let point = &self.points[*slot as usize];
            let offset = position - point.center;
            let squared = offset.length_squared();
            let weight = support_weight(squared, 1.0 / (point.support * point.support));
            let side = if *is_flipped { -point.normal } else { point.normal };
            sums.add(weight, side.dot(offset));
            normal += weight * side;
            if squared < nearest.0 {
                nearest = (squared, *slot);
            }
        }
        let normal = normal.try_normalize()?;
        let is_valid = MIN_CELL_WEIGHT <= sums.weight;
        is_valid.then_some(FieldValue { value: sums.value().0, normal, slot: nearest.1 })
    }

    /// Returns the field at the corners of a cube, in the order of the cubes in it, if some of the points have weight at each.
    /// Slots are not looked for.
    pub fn corner_values(
        &self,
        points: &CellPoints,
        flips: &[bool],
        cube: &Aabb,
    ) -> Option<[(f32, Vec3); LANES]> {
        let of_axis = |axis: usize| {
            let ends = [cube.min[axis], cube.max[axis]];
            [0, 1, 2, 3, 4, 5, 6, 7].map(|i: usize| ends[i >> axis & 1])
        };
        let (x, y, z) = (of_axis(0), of_axis(1), of_axis(2));
        let [mut weights, mut heights] = [[0.0; LANES]; 2];
        let mut normals = [[0.0; LANES]; 3];
        for (slot, is_flipped) in points.slots.iter().zip(flips) {
            let FieldPoint { center, normal, support } = self.points[*slot as usize];
            let side = if *is_flipped { -normal } else { normal };
            let inverse = 1.0 / (support * support);
            // The compiler makes SIMD instructions of this loop.
            for i in 0..LANES {
                let offset = [x[i] - center.x, y[i] - center.y, z[i] - center.z];
                let squared = offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2];
                let weight = support_weight(squared, inverse);
                let height = side.x * offset[0] + side.y * offset[1] + side.z * offset[2];
                weights[i] += weight;
                heights[i] += weight * height;
                normals[0][i] += weight * side.x;
                normals[1][i] += weight * side.y;
                normals[2][i] += weight * side.z;
            }
        }
        let mut corners = [(0.0, Vec3::ZERO); LANES];
        for (i, corner) in corners.iter_mut().enumerate() {
            if weights[i] < MIN_CELL_WEIGHT {
                return None;
            }
            let normal = Vec3::new(normals[0][i], normals[1][i], normals[2][i]);
            *corner = (heights[i] / weights[i], normal.try_normalize()?);
        }
        Some(corners)
    }

    /// True if points enclose a position on the surface.
    pub fn enclose(&self, points: &CellPoints, position: Vec3, normal: Vec3) -> bool {
        let radius = points.mean_support() / FIELD_SUPPORT;
        let hit = CandidateHit { normal, direction: -normal, radius };
        let mut stats = NeighborhoodStats::<f32, false>::new(CandidateHitLanes::splat(&hit));
        for slot in &points.slots {
            let point = &self.points[*slot as usize];
            let offset = Vec3Lanes::splat(point.center - position);
            let is_neighbor = stats.is_neighbor(offset);
            stats.add(offset, Vec3Lanes::splat(point.normal), is_neighbor);
        }
        stats.evaluate().enclosed != 0
    }

    /// Returns all points that have weight anywhere.
    pub fn all(&self) -> CellPoints {
        let mut all = CellPoints::with_capacity(0);
        for (slot, point) in self.points.iter().enumerate() {
            if 0.0 < point.support {
                all.push_with_bounds(slot as u32, point);
            }
        }
        all
    }

    /// Returns those of some points that have weight in a cell, which is widened a little.
    pub fn within(&self, points: &CellPoints, cell: &Aabb) -> CellPoints {
        let margin = points.margin();
        let cell = Aabb { min: cell.min - margin, max: cell.max + margin };
        let mut within = CellPoints::with_capacity(0);
        for slot in &points.slots {
            let point = &self.points[*slot as usize];
            if point.overlaps(&cell) {
                within.push_with_bounds(*slot, point);
            }
        }
        within
    }

    /// Returns for each point whether its normal is turned to the side of the point nearest to the middle of the cell.
    pub fn flips(&self, points: &CellPoints, cell: &Aabb) -> Vec<bool> {
        if self.has_sides {
            return vec![false; points.slots.len()];
        }
        let middle = cell.center();
        let of = |slot: &u32| &self.points[*slot as usize];
        let distance = |slot: &&u32| of(slot).center.distance_squared(middle);
        let nearest = points.slots.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let Some(guide) = nearest.map(of) else { return Vec::new() };
        points.slots.iter().map(|slot| of(slot).is_flipped(guide)).collect()
    }

    /// Returns the least and greatest value that the field may have in a cell: it is a mean of distances from planes.
    pub fn range(&self, points: &CellPoints, flips: &[bool], cell: &Aabb) -> (f32, f32) {
        let margin = points.margin();
        let mut range = (f32::INFINITY, f32::NEG_INFINITY);
        for (slot, is_flipped) in points.slots.iter().zip(flips) {
            let (low, high) = self.points[*slot as usize].heights(cell);
            let (low, high) = if *is_flipped { (-high, -low) } else { (low, high) };
            range = (range.0.min(low - margin), range.1.max(high + margin));
        }
        range
    }

    /// True if the sides of all points are known without doubt, so that those of parts of the cell are the same.
    pub fn agree(&self, points: &CellPoints) -> bool {
        let of = |slot: &u32| self.points[*slot as usize].normal;
        let Some(first) = points.slots.first().map(of) else { return true };
        self.has_sides
            || points.slots.iter().all(|slot| MIN_AGREEING_COSINE < of(slot).dot(first).abs())
    }
}

/// Minimum weight of all points at a corner or the middle of an octree's cell.
const MIN_CELL_WEIGHT: f32 = 1e-3;
/// Margin of cells in mean supports.
const MARGIN: f32 = 2e-3;
/// Minimum cosine between the normals of a cell whose parts are sure to take the same sides: half of 60 degrees.
pub(super) const MIN_AGREEING_COSINE: f32 = 0.87;

impl CellPoints {
    /// Returns no points, with memory for some.
    pub fn with_capacity(capacity: usize) -> Self {
        let slots = Vec::with_capacity(capacity);
        Self { slots, support_sum: 0.0, bounds: Aabb::EMPTY, n_blocks: 0 }
    }

    /// Adds a point whose support does not count for the bounds.
    #[inline]
    pub fn push(&mut self, slot: u32, support: f32) {
        let is_in_last_block = self.slots.last().is_some_and(|last| same_block(*last, slot));
        self.n_blocks += usize::from(!is_in_last_block);
        self.slots.push(slot);
        self.support_sum += f64::from(support);
    }

    fn push_with_bounds(&mut self, slot: u32, point: &FieldPoint) {
        self.push(slot, point.support);
        let ball = Aabb { min: point.center - point.support, max: point.center + point.support };
        self.bounds = self.bounds.union(ball);
    }

    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Returns the number of blocks that hold the points.
    pub fn n_blocks(&self) -> usize {
        self.n_blocks
    }

    /// Returns the mean support.
    pub fn mean_support(&self) -> f32 {
        (self.support_sum / self.slots.len().max(1) as f64) as f32
    }

    /// Returns the distance by which cells are widened for the rounding of distances along rays.
    pub fn margin(&self) -> f32 {
        MARGIN * self.mean_support()
    }
}

fn same_block(a: u32, b: u32) -> bool {
    a / LANES as u32 == b / LANES as u32
}
