//! Sorting up to 64 primitives into blocks by an exact sweep along all three axes.

use super::primitive::{Primitive, WideBox};
use super::split::FULL_NODE;
use crate::math::LANES;

/// Steps that fit in 16 bits beside a position.
const KEY_STEPS: f32 = 1023.0;

/// Positions of primitives, in the order of their centres along an axis.
type Order = [u8; FULL_NODE];

/// Reorders up to `FULL_NODE` primitives so that each eight from the front on make a good block.
///
/// All splits fall on multiples of eight, so that all blocks but the last are full.
pub(super) fn sort_into_blocks(primitives: &mut [Primitive]) {
    let n = primitives.len();
    let mut original = [primitives[0]; FULL_NODE];
    original[..n].copy_from_slice(primitives);
    let mut orders = [0, 1, 2].map(|axis| order_along(axis, primitives));
    let [x, y, z] = &mut orders;
    divide(&original, [&mut x[..n], &mut y[..n], &mut z[..n]]);
    for (primitive, &position) in primitives.iter_mut().zip(&orders[0]) {
        *primitive = original[usize::from(position)];
    }
}

/// Ranks by counting what is lower: without branches, for so few faster than sorting.
fn order_along(axis: usize, primitives: &[Primitive]) -> Order {
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

/// Numbers in the order of `centers` to a thousandth of their range, equal ones told apart by their
/// position: 16 bits, so that one instruction compares eight.
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

/// Splits where area times blocks is least, until eight or fewer are left.
fn divide(primitives: &[Primitive; FULL_NODE], orders: [&mut [u8]; 3]) {
    let n = orders[0].len();
    if n <= LANES {
        return;
    }
    let cuts = [0, 1, 2].map(|axis| best_cut(primitives, orders[axis]));
    let axis =
        (1..3).fold(0, |best, axis| if cuts[axis].cost < cuts[best].cost { axis } else { best });
    let n_left = cuts[axis].n_left;
    let left_set = orders[axis][..n_left].iter().fold(0u64, |set, &i| set | 1 << i);
    let [x, y, z] = orders.map(|order| {
        separate(order, left_set);
        order.split_at_mut(n_left)
    });
    divide(primitives, [x.0, y.0, z.0]);
    divide(primitives, [x.1, y.1, z.1]);
}

struct Cut {
    n_left: usize,
    cost: f32,
}

fn best_cut(primitives: &[Primitive; FULL_NODE], order: &[u8]) -> Cut {
    let n_runs = order.len().div_ceil(LANES);
    let mut runs = [WideBox::EMPTY; LANES];
    for (run, positions) in runs.iter_mut().zip(order.chunks(LANES)) {
        let boxes = positions.iter().map(|&i| primitives[usize::from(i) % FULL_NODE].wide());
        *run = boxes.fold(WideBox::EMPTY, WideBox::union);
    }
    let mut right_costs = [0.0; LANES];
    let mut bounds = WideBox::EMPTY;
    for i in (1..n_runs).rev() {
        bounds = bounds.union(runs[i]);
        right_costs[i] = bounds.half_area() * (n_runs - i) as f32;
    }
    let mut bounds = WideBox::EMPTY;
    let mut best = Cut { n_left: LANES, cost: f32::INFINITY };
    for i in 1..n_runs {
        bounds = bounds.union(runs[i - 1]);
        let cost = bounds.half_area() * i as f32 + right_costs[i];
        if cost < best.cost {
            best = Cut { n_left: i * LANES, cost };
        }
    }
    best
}

/// Moves the members of `left_set` to the front; both sides keep their order.
fn separate(order: &mut [u8], left_set: u64) {
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
