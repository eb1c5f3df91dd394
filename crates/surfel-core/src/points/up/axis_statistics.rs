//! Evidence of the up axis in the points near the ends of each axis: floors, flat bases, pedestals, terrain.

use super::inferred_up::InferredUp;
use crate::math::{Aabb, Vec3};

/// Thickness of the slab at each end of an axis, as a fraction of the longest side.
const SLAB_THICKNESS: f64 = 0.01;

/// Minimum fraction of the points that lie on a floor.
const MIN_FLOOR_FRACTION: f64 = 0.02;

/// Minimum ratio of the points on the floor to those at any other end: 5 for the Stanford bunny, 3.6 for the
/// armadillo. A room whose walls are scanned as well as its floor has a lower ratio.
const MIN_FLOOR_RATIO: f64 = 2.5;

/// Minimum ratio of the points on a floor to those at the opposite end, if the other four ends are alike.
const MIN_PEDESTAL_RATIO: f64 = 10.0;

/// Minimum fraction of the points at each of these four ends: the sides of a pedestal, or the walls of a room.
const MIN_SIDE_FRACTION: f64 = 0.01;

/// Maximum ratio of the points at two opposite ones of these ends.
const MAX_SIDES_RATIO: f64 = 1.5;

/// Minimum ratio of the height of an upright object to its other two sides.
const MIN_UPRIGHT_RATIO: f64 = 1.3;

/// Thickness of the slabs at the foot and at the head of a figure, as a fraction of its height.
const FOOT_THICKNESS: f64 = 0.05;

/// Minimum ratio of the footprint of a figure's pedestal to that of its head.
const MIN_FOOT_RATIO: f64 = 3.0;

/// Minimum ratio of the footprint of a figure's pedestal to that of the whole.
const MIN_FOOTPRINT: f64 = 0.5;

/// Minimum ratio of each horizontal side to the height of a cloud that counts as flat, as terrain and cities do.
const MIN_FLAT_RATIO: f64 = 4.0;

/// Minimum side of terrain in the unit of the file: reliefs and paintings are as flat, but smaller.
const MIN_TERRAIN_SIDE: f64 = 50.0;

/// Fraction of the points near each end of an axis.
#[derive(Clone, Copy, Default)]
struct Ends {
    low: f64,
    high: f64,
}

/// Sides of a cloud along the axes without outliers, and the points near their ends.
pub struct AxisStatistics {
    sides: [f64; 3],
    ends: [Ends; 3],
    /// Areas in X and Z of the points near both ends of Y.
    footprints: Ends,
}

impl AxisStatistics {
    /// Statistics of a sample of a cloud.
    pub fn of(sample: &[Vec3]) -> Self {
        if sample.is_empty() {
            return Self {
                sides: [0.0; 3],
                ends: [Ends::default(); 3],
                footprints: Ends::default(),
            };
        }
        let sorted = [0, 1, 2].map(|axis| {
            let mut values: Vec<f64> = sample.iter().map(|p| f64::from(p[axis])).collect();
            values.sort_unstable_by(f64::total_cmp);
            values
        });
        // A few outliers may lie below the floor.
        let n_outliers = sample.len() / 1000;
        let range = |values: &[f64]| (values[n_outliers], values[values.len() - 1 - n_outliers]);
        let sides = sorted.each_ref().map(|values| range(values).1 - range(values).0);
        let slab = SLAB_THICKNESS * sides.into_iter().fold(0.0, f64::max);
        let ends = sorted.each_ref().map(|values| {
            let (low, high) = range(values);
            let n_low = values.partition_point(|&value| value <= low + slab);
            let n_below_high = values.partition_point(|&value| value < high - slab);
            let fraction = |count: usize| count as f64 / values.len() as f64;
            Ends { low: fraction(n_low), high: fraction(values.len() - n_below_high) }
        });
        let (low, high) = range(&sorted[1]);
        let thickness = FOOT_THICKNESS * sides[1];
        let footprints = Ends {
            low: footprint(sample, |y| low <= y && y <= low + thickness),
            high: footprint(sample, |y| high - thickness <= y && y <= high),
        };
        Self { sides, ends, footprints }
    }

    /// Returns the axis whose one end has far more points than any other end: a floor or a flat base. The sides of a
    /// pedestal and the walls of a room without a ceiling may have as many, if they are alike, and so may those of the
    /// foot of an object that is higher than wide.
    pub fn flat_base(&self) -> Option<InferredUp> {
        let [x, y, z] = self.ends;
        let is_upright = |axis: usize| {
            let height = self.sides[axis];
            (0..3).all(|other| other == axis || MIN_UPRIGHT_RATIO * self.sides[other] <= height)
        };
        let are_alike = |low: f64, high: f64| low.max(high) <= MAX_SIDES_RATIO * low.min(high);
        let are_sides =
            |low: f64, high: f64| MIN_SIDE_FRACTION <= low.min(high) && are_alike(low, high);
        // The last of the others is opposite.
        let stands_on = |base: f64, axis: usize, others: [f64; 5]| {
            let [a, b, c, d, opposite] = others;
            let is_between_sides = are_sides(a, b) && are_sides(c, d);
            let is_pedestal = is_between_sides && MIN_PEDESTAL_RATIO * opposite < base;
            let is_floor = others.into_iter().all(|other| MIN_FLOOR_RATIO * other < base);
            let is_foot = is_upright(axis)
                && are_alike(a, b)
                && are_alike(c, d)
                && [a, b, c, d].into_iter().all(|side| side < base)
                && MIN_FLOOR_RATIO * opposite < base;
            MIN_FLOOR_FRACTION <= base && (is_floor || is_pedestal || is_foot)
        };
        let (up, name, end, base) = if stands_on(y.low, 1, [x.low, x.high, z.low, z.high, y.high]) {
            (Vec3::Y, "+Y", "low end of Y", y.low)
        } else if stands_on(z.low, 2, [x.low, x.high, y.low, y.high, z.high]) {
            (Vec3::Z, "+Z", "low end of Z", z.low)
        } else if stands_on(y.high, 1, [x.low, x.high, z.low, z.high, y.low]) {
            (Vec3::NEG_Y, "-Y", "high end of Y", y.high)
        } else {
            return None;
        };
        let percent = 100.0 * base;
        let reason =
            format!("up is {name}: {percent:.1} % of the points lie on a flat base at the {end}");
        Some(InferredUp { up, reason })
    }

    /// Returns +Y for a figure that is highest along Y, with a wide foot and a narrow head, as a statue on its pedestal.
    pub fn figure(&self) -> Option<InferredUp> {
        let [x, y, z] = self.sides;
        let Ends { low, high } = self.footprints;
        let is_figure = 0.0 < low
            && MIN_UPRIGHT_RATIO * x.max(z) <= y
            && MIN_FOOT_RATIO * high <= low
            && MIN_FOOTPRINT * x * z <= low;
        let reason = "up is +Y: the points form a figure with a wide foot at the low end of Y";
        is_figure.then(|| InferredUp { up: Vec3::Y, reason: reason.to_owned() })
    }

    /// Returns +Z if the cloud is large, wide and flat in X and Y, as terrain and cities are.
    ///
    /// There is no such rule for Y: a wall in the plane of X and Z is as flat.
    pub fn terrain(&self) -> Option<InferredUp> {
        let reason = "up is +Z: the points spread wide over X and Y, as terrain does".to_owned();
        is_wide_and_flat(self.sides).then_some(InferredUp { up: Vec3::Z, reason })
    }
}

/// Returns the area in X and Z of the points at some heights along Y.
fn footprint(positions: &[Vec3], is_at: impl Fn(f64) -> bool) -> f64 {
    let at = positions.iter().filter(|position| is_at(f64::from(position.y)));
    let size = Aabb::of_points(at.copied()).size();
    f64::from(size.x) * f64::from(size.z)
}

/// Returns true for sides along X, Y and Z of terrain.
pub fn is_wide_and_flat([x, y, z]: [f64; 3]) -> bool {
    let side = x.min(y);
    MIN_TERRAIN_SIDE <= side && MIN_FLAT_RATIO * z < side
}
