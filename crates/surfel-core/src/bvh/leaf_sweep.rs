//! Sorts up to 64 primitives into blocks by an exact sweep along all three axes.

use super::primitive::{BvhPrimitive, SimdAabb};
use super::split::FULL_NODE;
use crate::math::LANES;

/// Number of steps of a centre that fit into 16 bits together with a position.
const KEY_STEPS: f32 = 1023.0;

/// Positions of primitives, sorted by their centres along an axis.
type Order = [u8; FULL_NODE];

/// Reorders up to `FULL_NODE` primitives so that each eight from the front on form a good block.
///
/// All splits are at multiples of eight, so that all blocks but the last are full.
pub(super) fn sort_into_blocks(primitives: &mut [BvhPrimitive]) {
    let n = primitives.len();
    let mut original = [primitives[0]; FULL_NODE];
    original[..n].copy_from_slice(primitives);
    let mut orders = [0, 1, 2].map(|axis| order_along(axis, primitives));
    let [x, y, z] = &mut orders;
    split_recursively(&original, [&mut x[..n], &mut y[..n], &mut z[..n]]);
    for (primitive, &position) in primitives.iter_mut().zip(&orders[0]) {
        *primitive = original[usize::from(position)];
    }
}

/// Returns the positions of primitives sorted by their centres along `axis`. The rank of each is the number of
/// lower ones, which needs no branches and is faster than sorting for so few.
fn order_along(axis: usize, primitives: &[BvhPrimitive]) -> Order {
    let mut centers = [f32::INFINITY; FULL_NODE];
    for (center, primitive) in centers.iter_mut().zip(primitives) {
        *center = primitive.doubled_center_along(axis);
    }
    let keys = unique_keys(&centers[..primitives.len()]);
    let mut order = [0; FULL_NODE];
    for i in 0..primitives.len() {
        let rank: i16 = keys.iter().map(|&key| i16::from(key < keys[i])).sum();
        order[rank as usize] = i as u8;
    }
    order
}

/// Returns keys in the order of `centers`, rounded to a thousandth of their range and then ordered by position.
/// They have 16 bits, so that one instruction compares eight.
fn unique_keys(centers: &[f32]) -> [i16; FULL_NODE] {
    let (min, max) = centers
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(min, max), &c| (c.min(min), c.max(max)));
    let steps = KEY_STEPS / (max - min);
    let steps = if steps.is_finite() { steps } else { 0.0 };
    let mut keys = [i16::MAX; FULL_NODE];
    for (i, (key, center)) in keys.iter_mut().zip(centers).enumerate() {
        let step = ((center - min) * steps) as i32;
        *key = (step * FULL_NODE as i32 + i as i32 + i32::from(i16::MIN)) as i16;
    }
    keys
}

/// Splits at the minimum of area times blocks, until eight or fewer primitives are left.
fn split_recursively(primitives: &[BvhPrimitive; FULL_NODE], orders: [&mut [u8]; 3]) {
    let n = orders[0].len();
    if n <= LANES {
        return;
    }
    let splits = [0, 1, 2].map(|axis| best_split(primitives, orders[axis]));
    let axis = (1..3)
        .fold(0, |best, axis| if splits[axis].cost < splits[best].cost { axis } else { best });
    let n_left = splits[axis].n_left;
    let left_set = orders[axis][..n_left].iter().fold(0u64, |set, &i| set | 1 << i);
    let [x, y, z] = orders.map(|order| {
        stable_partition(order, left_set);
        order.split_at_mut(n_left)
    });
    split_recursively(primitives, [x.0, y.0, z.0]);
    split_recursively(primitives, [x.1, y.1, z.1]);
}

/// A split of an order.
struct SweepSplit {
    n_left: usize,
    cost: f32,
}

/// Returns the split of `order`, at a multiple of eight, with the minimum of area times blocks.
fn best_split(primitives: &[BvhPrimitive; FULL_NODE], order: &[u8]) -> SweepSplit {
    let n_runs = order.len().div_ceil(LANES);
    let mut runs = [SimdAabb::EMPTY; LANES];
    for (run, positions) in runs.iter_mut().zip(order.chunks(LANES)) {
        let boxes = positions.iter().map(|&i| primitives[usize::from(i) % FULL_NODE].simd_bounds());
        *run = boxes.fold(SimdAabb::EMPTY, SimdAabb::union);
    }
    let mut right_costs = [0.0; LANES];
    let mut bounds = SimdAabb::EMPTY;
    for i in (1..n_runs).rev() {
        bounds = bounds.union(runs[i]);
        right_costs[i] = bounds.half_area() * (n_runs - i) as f32;
    }
    let mut bounds = SimdAabb::EMPTY;
    let mut best = SweepSplit { n_left: LANES, cost: f32::INFINITY };
    for i in 1..n_runs {
        bounds = bounds.union(runs[i - 1]);
        let cost = bounds.half_area() * i as f32 + right_costs[i];
        if cost < best.cost {
            best = SweepSplit { n_left: i * LANES, cost };
        }
    }
    best
}

/// Moves the positions in `left_set` to the front. Both sides keep their order.
fn stable_partition(order: &mut [u8], left_set: u64) {
    let mut right = [0; FULL_NODE];
    let (mut n_left, mut n_right) = (0, 0);
    for i in 0..order.len() {
        let position = order[i];
        order[n_left] = position;
        right[n_right] = position;
        let is_left = (left_set >> position & 1) as usize;
        n_left += is_left;
        n_right += 1 - is_left;
    }
    order[n_left..].copy_from_slice(&right[..n_right]);
}
