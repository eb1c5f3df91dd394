//! The field of weighted planes along a part of a ray, where each point's distance is linear and its weight a polynomial.

use crate::flat::{FieldLeaf, FlatCloud, FlatPoints};
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, Vec3, Vec3Lanes, set_bits};
use crate::surface::{FIELD_SUPPORT, FieldSums, PointLanes, support_weight};
use crate::trace::counts::{Counted, count};
use crate::trace::query::hit::{Hit, NearestHits};
use crate::trace::query::smooth_query::unit;

/// Distance between samples of the field, in supports, between which its zero is found linearly.
pub const LINEAR_STEP: f32 = 0.1;
/// Margin of the interval between the first and the last plane that a ray crosses, in supports.
pub const BRACKET_MARGIN: f32 = 0.01;
/// Number of places of an interval at which the field is evaluated.
pub const N_SAMPLES: usize = LANES;
/// Minimum weight of a point whose colour is blended.
pub const MIN_COLOR_WEIGHT: f32 = 0.05;

/// The field along a part of a ray. Its memory is reused from part to part.
#[derive(Default)]
pub struct RayField {
    /// Number of points whose weight is not zero all along the part.
    n_points: usize,
    /// For each point the square of its distance from the part's start.
    squared: Vec<f32>,
    /// For each point twice the distance along the ray at which it is nearest.
    twice_along: Vec<f32>,
    /// For each point the height of the part's start above its plane, and the slope along the ray.
    height: Vec<f32>,
    slope: Vec<f32>,
    inverse_support_squared: Vec<f32>,
    /// For each entry of the leaf the lanes of these points.
    near: Vec<u8>,
}

/// A segment of a ray.
#[derive(Clone, Copy)]
pub struct RaySegment {
    /// Distance along the ray at which the part starts.
    pub start: f32,
    /// Length of the part.
    pub length: f32,
}

/// A zero of the field on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldHit {
    /// Distance along the ray and the slot of the nearest point.
    pub hit: Hit,
    /// Unit normal, facing the ray's origin.
    pub normal: Vec3,
    /// Linear colour.
    pub color: Vec3,
}

impl FieldHit {
    /// The result of a ray that hits nothing.
    pub const MISS: Self = Self { hit: Hit::MISS, normal: Vec3::ZERO, color: Vec3::ZERO };

    /// Returns a hit with the direction of a sum of normals, and the mean of a sum of colours and its weight.
    #[inline(always)]
    pub fn new<const HAS_COLORS: bool>(
        cloud: &FlatCloud,
        ray: &Ray,
        hit: Hit,
        normal: Vec3,
        (color, weight): (Vec3, f32),
    ) -> Self {
        let normal = normal.try_normalize().unwrap_or_else(|| cloud.points.normal(hit.slot));
        let normal = if 0.0 < normal.dot(ray.direction) { -normal } else { normal };
        let color = match (HAS_COLORS, 0.0 < weight) {
            (false, _) => Vec3::ZERO,
            (true, true) => color / weight,
            (true, false) => cloud.points.surfel(hit.slot).color,
        };
        Self { hit, normal, color }
    }
}

/// Eight ones and zeros for each mask of eight lanes.
static LANE_BITS: [[f32; LANES]; 256] = lane_bits();

const fn lane_bits() -> [[f32; LANES]; 256] {
    let mut table = [[0.0; LANES]; 256];
    let mut i = 0;
    while i < 256 * LANES {
        table[i / LANES][i % LANES] = ((i / LANES) >> (i % LANES) & 1) as f32;
        i += 1;
    }
    table
}

impl RayField {
    /// Finds the first zero in a part of a ray at which the ray crosses the surface.
    #[inline(always)]
    pub fn first_hit<L: Lanes, const HAS_COLORS: bool>(
        &mut self,
        cloud: &FlatCloud,
        leaf: &FieldLeaf,
        ray: &Ray,
        part: RaySegment,
    ) -> Option<FieldHit> {
        let (from, to) = self.collect::<L>(&cloud.points, leaf, ray, part)?;
        let support = 1.0 / self.inverse_support_squared[0].sqrt();
        let margin = BRACKET_MARGIN * support;
        let bracket = (from - margin, to + margin);
        let samples = self.sample::<L>(bracket);
        for crossing in set_bits::<LANES>(samples.crossings) {
            let mut root = samples.root(crossing);
            if LINEAR_STEP * support < samples.step {
                let finer = self.sample::<L>(samples.interval(crossing));
                let first = finer.crossings.trailing_zeros() as usize;
                if first < LANES {
                    root = finer.root(first);
                }
            }
            let distance = part.start + root;
            if distance < ray.t_min || ray.t_max < distance {
                continue;
            }
            let slope = samples.values[crossing + 1] - samples.values[crossing];
            let found = self.hit::<L, HAS_COLORS>(cloud, leaf, ray, distance, slope);
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// Collects the points with weight on a part of a ray. Returns the interval between the planes that the ray crosses
    /// first and last, where the field may be zero: it is a mean of the distances from the planes.
    #[inline(always)]
    fn collect<L: Lanes>(
        &mut self,
        points: &FlatPoints,
        leaf: &FieldLeaf,
        ray: &Ray,
        part: RaySegment,
    ) -> Option<(f32, f32)> {
        self.reset(leaf.blocks.len());
        let (zero, one, length) = (L::splat(0.0), L::splat(1.0), L::splat(part.length));
        let (infinite, minus_infinite) = (L::splat(f32::INFINITY), L::splat(f32::NEG_INFINITY));
        let direction = Vec3Lanes::splat(ray.direction);
        let origin = ray.at(part.start);
        let (mut min, mut max) = ([infinite; 2], [minus_infinite; 2]);
        let (mut first, mut last) = (infinite, minus_infinite);
        for (entry, block_idx) in leaf.blocks.iter().enumerate() {
            let block = &points.blocks[*block_idx as usize];
            let PointLanes { center, normal, radius } = block.points::<L>(origin);
            let support = L::splat(FIELD_SUPPORT) * radius;
            let inverse = one / (support * support);
            let (along, squared) = (center.dot(direction), center.dot(center));
            let nearest = along.max(zero).min(length);
            let least = squared - nearest * (along + along - nearest);
            let counts = zero.lt(L::load(&LANE_BITS[leaf.lanes[entry] as usize]));
            let near = counts & (least * inverse).lt(one);
            self.near.push(near.bits() as u8);
            if near.bits() == 0 {
                continue;
            }
            let normal = unit(normal).scaled(signs::<L>(leaf.flips[entry]));
            let (height, slope) = (zero - normal.dot(center), normal.dot(direction));
            let crossing = (zero - height) / slope;
            for (i, height) in [height, height + length * slope].into_iter().enumerate() {
                min[i] = L::select(near, height, infinite).min(min[i]);
                max[i] = L::select(near, height, minus_infinite).max(max[i]);
            }
            let is_ahead = near & zero.le(crossing);
            let is_before_end = near & crossing.le(length);
            first = L::select(is_ahead, crossing, infinite).min(first);
            last = L::select(is_before_end, crossing, minus_infinite).max(last);
            self.add(near, [squared, along + along, height, slope, inverse]);
        }
        let has_both_signs = [
            min[0].reduce_min() <= 0.0 && 0.0 <= max[0].reduce_max(),
            min[1].reduce_min() <= 0.0 && 0.0 <= max[1].reduce_max(),
        ];
        let from = if has_both_signs[0] { 0.0 } else { first.reduce_min() };
        let to = if has_both_signs[1] { part.length } else { last.reduce_max() };
        (self.n_points != 0 && from <= to).then_some((from, to))
    }

    fn reset(&mut self, n_blocks: usize) {
        let capacity = LANES * (n_blocks + 1);
        self.n_points = 0;
        self.near.clear();
        if self.squared.len() < capacity {
            let Self { squared, twice_along, height, slope, inverse_support_squared, .. } = self;
            for column in [squared, twice_along, height, slope, inverse_support_squared] {
                column.resize(capacity, 0.0);
            }
        }
    }

    #[inline(always)]
    fn add<L: Lanes>(&mut self, lanes: L::Mask, values: [L; 5]) {
        let Self { n_points, squared, twice_along, height, slope, inverse_support_squared, .. } =
            self;
        let columns = [squared, twice_along, height, slope, inverse_support_squared];
        for (column, values) in columns.into_iter().zip(values) {
            let end = *n_points + LANES;
            column[*n_points..end].copy_from_slice(&values.compress(lanes).store());
        }
        *n_points += lanes.bits().count_ones() as usize;
    }

    /// Returns the field at eight equidistant positions of an interval.
    #[inline(always)]
    fn sample<L: Lanes>(&self, (from, to): (f32, f32)) -> Samples {
        const STEPS: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let step = (to - from) / (LANES - 1) as f32;
        let t = L::splat(from) + L::splat(step) * L::load(&STEPS);
        let mut sums = FieldSums::new();
        let n = self.n_points;
        count(Counted::Terms, LANES * n);
        let (squared, twice_along) = (&self.squared[..n], &self.twice_along[..n]);
        let (height, slope) = (&self.height[..n], &self.slope[..n]);
        let inverse = &self.inverse_support_squared[..n];
        for i in 0..n {
            let distance = L::splat(squared[i]) - t * (L::splat(twice_along[i]) - t);
            let weight = support_weight(distance, L::splat(inverse[i]));
            sums.add(weight, L::splat(height[i]) + t * L::splat(slope[i]));
        }
        let (values, is_valid) = sums.value();
        let is_above = L::splat(0.0).lt(values).bits();
        let pairs = (is_above ^ is_above >> 1) & is_valid.bits() & is_valid.bits() >> 1;
        Samples { from, step, values: values.store(), crossings: pairs & 0x7f }
    }

    /// Returns the hit at a zero of the field, unless the field grows against the normals there: between two sheets that
    /// face the same way it changes its sign without a surface.
    #[inline(always)]
    fn hit<L: Lanes, const HAS_COLORS: bool>(
        &self,
        cloud: &FlatCloud,
        leaf: &FieldLeaf,
        ray: &Ray,
        distance: f32,
        slope: f32,
    ) -> Option<FieldHit> {
        let position = Vec3Lanes::splat(ray.at(distance));
        let mut sums = ShadingSums::<f32>::new();
        let entries = self.near.iter().enumerate().filter(|(_, near)| **near != 0);
        for (entry, near) in entries {
            let block_idx = leaf.blocks[entry];
            let block = &cloud.points.blocks[block_idx as usize];
            let support = L::splat(FIELD_SUPPORT) * block.radii::<L>();
            let inverses = (L::splat(1.0) / (support * support)).store();
            let normals = unit(block.normals::<L>()).scaled(signs::<L>(leaf.flips[entry])).store();
            let offsets = block.offsets::<L>().store();
            for lane in set_bits::<LANES>(u32::from(*near)) {
                let point = ShadedPoint {
                    corner: block.corner(),
                    offset: Vec3::new(offsets[0][lane], offsets[1][lane], offsets[2][lane]),
                    normal: Vec3::new(normals[0][lane], normals[1][lane], normals[2][lane]),
                    inverse_support_squared: inverses[lane],
                    slot: block_idx * LANES as u32 + lane as u32,
                };
                sums.add::<HAS_COLORS>(cloud, &point, &position, true);
            }
        }
        let Vec3Lanes { x, y, z } = sums.normal;
        let normal = Vec3::new(x, y, z);
        if normal.dot(ray.direction) * slope < 0.0 {
            return None;
        }
        let Vec3Lanes { x, y, z } = sums.color;
        let slot = sums.nearest.slots.to_bits();
        let color = (Vec3::new(x, y, z), sums.color_weight);
        Some(FieldHit::new::<HAS_COLORS>(cloud, ray, Hit { distance, slot }, normal, color))
    }
}

/// A point near a zero of the field.
#[derive(Clone, Copy)]
pub struct ShadedPoint {
    /// Corner of the point's block.
    pub corner: Vec3,
    /// Centre relative to the corner.
    pub offset: Vec3,
    /// Unit normal, turned to the side of the leaf's other normals.
    pub normal: Vec3,
    /// Reciprocal of the square of the support.
    pub inverse_support_squared: f32,
    /// Slot in the points' tree.
    pub slot: u32,
}

/// Sums over the points near zeros of the field, one zero per lane.
#[derive(Clone, Copy)]
pub struct ShadingSums<F> {
    /// Weighted sum of the normals.
    pub normal: Vec3Lanes<F>,
    /// The nearest points.
    pub nearest: NearestHits<F>,
    /// Weighted sum of the colours.
    pub color: Vec3Lanes<F>,
    /// Sum of the weights of the colours.
    pub color_weight: F,
}

impl<F: Floats> ShadingSums<F> {
    /// Returns the sums over no points.
    #[inline(always)]
    pub fn new() -> Self {
        let (zero, none) = (F::splat(0.0), F::splat(f32::from_bits(Hit::MISS.slot)));
        let vector = Vec3Lanes::splat(Vec3::ZERO);
        let nearest = NearestHits { distances: F::splat(f32::INFINITY), slots: none };
        Self { normal: vector, nearest, color: vector, color_weight: zero }
    }

    /// Adds a point to the sums at positions where it is near.
    #[inline(always)]
    pub fn add<const HAS_COLORS: bool>(
        &mut self,
        cloud: &FlatCloud,
        point: &ShadedPoint,
        position: &Vec3Lanes<F>,
        near: F::Mask,
    ) {
        let corner = Vec3Lanes::splat(point.corner).minus(*position);
        let center = corner.plus(Vec3Lanes::splat(point.offset));
        let squared = center.dot(center);
        let weight = support_weight(squared, F::splat(point.inverse_support_squared));
        let weight = F::select(near, weight, F::splat(0.0));
        self.normal = self.normal.plus(Vec3Lanes::splat(point.normal).scaled(weight));
        self.nearest.merge(near, squared, F::splat(f32::from_bits(point.slot)));
        let is_heavy = F::splat(MIN_COLOR_WEIGHT).le(weight);
        if HAS_COLORS && cloud.blends_colors && is_heavy.bits() != 0 {
            let weight = F::select(is_heavy, weight * weight * weight, F::splat(0.0));
            let color = Vec3Lanes::splat(cloud.points.surfel(point.slot).color);
            self.color = self.color.plus(color.scaled(weight));
            self.color_weight = self.color_weight + weight;
        }
    }
}

/// The field at eight places of an interval.
struct Samples {
    from: f32,
    step: f32,
    values: [f32; LANES],
    /// The places between which and the next ones the field changes its sign, one bit each.
    crossings: u32,
}

impl Samples {
    #[inline(always)]
    fn interval(&self, crossing: usize) -> (f32, f32) {
        let at = |i: usize| self.from + i as f32 * self.step;
        (at(crossing), at(crossing + 1))
    }

    /// Returns the zero of the line through the field at both ends.
    #[inline(always)]
    fn root(&self, crossing: usize) -> f32 {
        let (from, to) = self.interval(crossing);
        let (a, b) = (self.values[crossing], self.values[crossing + 1]);
        from + (to - from) * (a / (a - b))
    }
}

/// Returns -1 in the lanes of a mask, 1 elsewhere.
#[inline(always)]
pub fn signs<L: Lanes>(flips: u8) -> L {
    L::splat(1.0) - L::splat(2.0) * L::load(&LANE_BITS[flips as usize])
}
