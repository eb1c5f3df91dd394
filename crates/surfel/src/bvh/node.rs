//! One node: the boxes of eight children in 72 bytes.

use crate::math::{Aabb, LANES, Lanes, Vec3, Vec3A};

/// Children's boxes as multiples of a power of two from a common corner, after Ylitie et al. 2017.
///
/// As stored in `FlatScene`. Decoded boxes contain the boxes that were encoded.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Node {
    /// Lower corner of all children.
    pub origin: [f32; 3],
    /// Biased exponents of the step an axis, a byte each from the lowest: step = 2^(exponent - 127).
    /// Above them the number of children, and at `N_NODES` how many of these are nodes.
    exponents_and_counts: u32,
    /// Index of the first child that is a node; the others follow it in the next lanes.
    pub first_node: u32,
    /// What lane 0 would be as a packed block: blocks stand behind the nodes, in lanes as in memory.
    lane_zero_as_block: u32,
    /// Lower bounds in steps, an axis a row.
    pub lower: [[u8; LANES]; 3],
    /// Upper bounds in steps, an axis a row.
    pub upper: [[u8; LANES]; 3],
}

/// What a child of a node is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Child {
    Node(u32),
    Block(u32),
}

impl Child {
    /// Set in a packed block.
    pub const BLOCK_BIT: u32 = 1 << 31;

    /// In one word, for the stacks of traversals: there are less than 2^31 of either kind.
    #[inline(always)]
    pub fn pack(self) -> u32 {
        match self {
            Self::Node(node_idx) => node_idx,
            Self::Block(block_idx) => block_idx | Self::BLOCK_BIT,
        }
    }

    #[inline(always)]
    pub fn unpack(word: u32) -> Self {
        match word & Self::BLOCK_BIT {
            0 => Self::Node(word),
            _ => Self::Block(word & !Self::BLOCK_BIT),
        }
    }
}

/// Lowest of the four bits that hold the number of children.
const N_CHILDREN: i32 = 24;
/// Of those that hold how many are nodes.
const N_NODES: i32 = 28;

impl Node {
    /// A node over up to eight children, first nodes and then blocks; `set_boxes` adds their boxes.
    pub fn new(n_nodes: usize, n_blocks: usize, first_node: u32, first_block: u32) -> Self {
        let (n_nodes, n_children) = (n_nodes as u32, (n_nodes + n_blocks) as u32);
        Self {
            exponents_and_counts: n_children << N_CHILDREN | n_nodes << N_NODES,
            first_node,
            lane_zero_as_block: (first_block | Child::BLOCK_BIT) - n_nodes,
            ..Self::default()
        }
    }

    /// Encodes the box of the child in each lane; those of lanes without a child must be empty.
    pub fn set_boxes(&mut self, boxes: &[Aabb; LANES]) {
        let bounds = boxes.iter().copied().reduce(Aabb::union).unwrap_or(Aabb::EMPTY);
        self.origin = bounds.min.to_array();
        for axis in 0..3 {
            let exponent = step_exponent(bounds.min[axis], bounds.max[axis]);
            self.exponents_and_counts &= !(0xff << (8 * axis));
            self.exponents_and_counts |= u32::from(exponent) << (8 * axis);
            self.set_bounds_along(axis, boxes);
        }
    }

    #[inline(always)]
    pub(super) fn n_child_nodes(&self) -> usize {
        (self.exponents_and_counts >> N_NODES) as usize
    }

    #[inline(always)]
    fn n_children(&self) -> usize {
        (self.exponents_and_counts >> N_CHILDREN & 0xf) as usize
    }

    #[inline(always)]
    pub fn has_only_blocks(&self) -> bool {
        self.n_child_nodes() == 0
    }

    /// What stands in `lane`, if anything.
    #[inline(always)]
    pub fn child(&self, lane: usize) -> Option<Child> {
        if self.n_children() <= lane {
            return None;
        }
        let is_node = lane < self.n_child_nodes();
        let first = if is_node { self.first_node } else { self.lane_zero_as_block };
        Some(Child::unpack(first + lane as u32))
    }

    /// The children of all lanes as `Child::pack` has them, which lanes hold as bits.
    #[inline(always)]
    pub fn packed_children<L: Lanes>(&self) -> L {
        L::numbered(self.child_nodes::<L>(), self.first_node, self.lane_zero_as_block)
    }

    /// The lanes that hold nodes: the first ones.
    #[inline(always)]
    pub fn child_nodes<L: Lanes>(&self) -> L::Mask {
        L::below::<N_NODES>(self.exponents_and_counts)
    }

    /// The lanes that hold blocks, and those after them.
    #[inline(always)]
    pub fn child_blocks<L: Lanes>(&self) -> L::Mask {
        L::splat(f32::from_bits(Child::BLOCK_BIT - 1)).less_bits(self.packed_children::<L>())
    }

    /// The lanes that hold a child: the first ones too.
    #[inline(always)]
    pub fn filled<L: Lanes>(&self) -> L::Mask {
        L::below::<N_CHILDREN>(self.exponents_and_counts)
    }

    /// Lower and upper bounds of all children along an axis.
    #[inline(always)]
    pub fn sides<L: Lanes, const AXIS: usize>(&self) -> (L, L) {
        let step = L::power_of_two::<AXIS>(self.exponents_and_counts);
        let corner = L::splat(self.origin[AXIS]);
        (
            L::from_u8(&self.lower[AXIS]).times_plus(step, corner),
            L::from_u8(&self.upper[AXIS]).times_plus(step, corner),
        )
    }

    /// Bit i is set if lane i holds a child.
    #[inline(always)]
    pub fn occupied(&self) -> u32 {
        (1 << self.n_children()) - 1
    }

    /// Length of a step along each axis.
    #[inline(always)]
    pub fn step(&self) -> Vec3A {
        const EXPONENT: u32 = 0xff << 23;
        let exponents = self.exponents_and_counts;
        Vec3A::new(
            f32::from_bits(exponents << 23 & EXPONENT),
            f32::from_bits(exponents << 15 & EXPONENT),
            f32::from_bits(exponents << 7 & EXPONENT),
        )
    }

    /// The same along one of them.
    #[inline(always)]
    pub fn step_along(&self, axis: usize) -> f32 {
        f32::from_bits((self.exponents_and_counts >> (8 * axis) & 0xff) << 23)
    }

    /// Upper bound of the size of the box around all children.
    #[inline(always)]
    pub fn size(&self) -> f32 {
        256.0 * self.step().max_element()
    }

    /// The decoded box of the child in `lane`.
    pub fn bounds(&self, lane: usize) -> Aabb {
        let corner = |steps: &[[u8; LANES]; 3]| {
            let steps = Vec3::from_array([0, 1, 2].map(|axis| f32::from(steps[axis][lane])));
            Vec3::from_array(self.origin) + steps * Vec3::from(self.step())
        };
        Aabb { min: corner(&self.lower), max: corner(&self.upper) }
    }

    fn set_bounds_along(&mut self, axis: usize, boxes: &[Aabb; LANES]) {
        let (origin, step) = (self.origin[axis], self.step()[axis]);
        let decode = |steps: u8| origin + f32::from(steps) * step;
        // Exact: the step is a power of two.
        let per_step = 1.0 / step;
        for (lane, bounds) in boxes[..self.n_children()].iter().enumerate() {
            let (min, max) = (bounds.min[axis], bounds.max[axis]);
            // The difference may round past a step; a wrong side would lose hits, so it is checked.
            let mut low = ((min - origin) * per_step) as u8;
            while 0 < low && min < decode(low) {
                low -= 1;
            }
            let mut high = ((max - origin) * per_step) as u8;
            while high < 255 && decode(high) < max {
                high += 1;
            }
            self.lower[axis][lane] = low;
            self.upper[axis][lane] = high;
        }
    }
}

/// Smallest biased exponent whose step reaches from `min` to `max` within 255 steps.
fn step_exponent(min: f32, max: f32) -> u8 {
    let mut exponent = 1u8;
    let wanted = (max - min) / 255.0;
    if wanted > 0.0 {
        exponent = ((wanted.to_bits() >> 23) as u8).clamp(1, 253);
    }
    while exponent < 254 && min + 255.0 * f32::from_bits(u32::from(exponent) << 23) < max {
        exponent += 1;
    }
    exponent
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{LaneMask, PortableLanes, Random};

    #[test]
    fn decoded_boxes_contain_what_was_encoded() {
        let mut random = Random::new(3, 0);
        for case in 0..2000 {
            let scale = 10f32.powi(case % 15 - 7);
            let offset = if case % 2 == 0 { 0.0 } else { 1e5 * random.next_f32() };
            let mut vector = || {
                Vec3::new(random.next_f32(), random.next_f32(), random.next_f32()) * scale
                    + Vec3::splat(offset)
            };
            let n = 1 + case as usize % LANES;
            let mut boxes = [Aabb::EMPTY; LANES];
            boxes[..n].fill_with(|| Aabb::of_points([vector(), vector()]));
            let mut node = Node::new(n / 3, n - n / 3, 100, 200);
            node.set_boxes(&boxes);
            assert_eq!(node.occupied(), (1u32 << n) - 1);
            for (lane, bounds) in boxes[..n].iter().enumerate() {
                assert!(node.bounds(lane).contains(*bounds), "{:?} {bounds:?}", node.bounds(lane));
                let excess = node.bounds(lane).size() - bounds.size();
                assert!(excess.cmple(2.01 * Vec3::from(node.step()) + 1e-6 * offset).all());
            }
        }
    }

    #[test]
    fn nodes_stand_before_blocks() {
        let node = Node::new(1, 2, 10, 20);
        let children: Vec<_> = (0..4).map(|lane| node.child(lane)).collect();
        let expected =
            [Some(Child::Node(10)), Some(Child::Block(20)), Some(Child::Block(21)), None];
        assert_eq!(children, expected);
        assert_eq!(node.occupied(), 0b0111);
        let only_nodes = Node::new(LANES, 0, 1, 0);
        assert_eq!(only_nodes.child(LANES - 1), Some(Child::Node(LANES as u32)));
    }

    #[test]
    fn lanes_hold_the_packed_children() {
        for (n_nodes, n_blocks) in [(0, 8), (1, 2), (3, 5), (7, 1), (8, 0)] {
            let node = Node::new(n_nodes, n_blocks, 10, 3);
            let packed = node.packed_children::<PortableLanes>().store();
            for (lane, packed) in packed[..n_nodes + n_blocks].iter().enumerate() {
                assert_eq!(Some(Child::unpack(packed.to_bits())), node.child(lane));
            }
            assert_eq!(node.filled::<PortableLanes>().bits(), node.occupied());
        }
    }

    #[test]
    fn a_node_is_seventy_two_bytes() {
        assert_eq!(size_of::<Node>(), 72);
    }
}
