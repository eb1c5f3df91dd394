//! One node: the boxes of eight children in 80 bytes.

use crate::math::{Aabb, LANES, Lanes, Vec3, Vec3A};

/// Children's boxes as multiples of a power of two from a common corner, after Ylitie et al. 2017.
///
/// As stored in `FlatScene`. Decoded boxes contain the boxes that were encoded.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Node {
    /// Lower corner of all children.
    pub origin: [f32; 3],
    /// Biased exponents of the step an axis: step = 2^(exponent - 127).
    exponents: [u8; 3],
    n_children: u8,
    /// Index of the first child that is a node; the others follow it.
    pub first_node: u32,
    /// Index of the first child that is a block; the others follow it.
    pub first_block: u32,
    /// For the first `n_children`: kind (`IS_NODE` or `IS_BLOCK`) and number among the children of that kind.
    pub children: [u8; LANES],
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

const IS_NODE: u8 = 0x40;
const IS_BLOCK: u8 = 0x80;
const RANK: u8 = 0x07;

impl Node {
    /// A node over up to eight children, each a node or else a block; `set_boxes` adds their boxes.
    pub fn new(are_nodes: impl Iterator<Item = bool>, first_node: u32, first_block: u32) -> Self {
        let mut node = Self { first_node, first_block, ..Self::default() };
        let (mut n_nodes, mut n_blocks) = (0, 0);
        for (child, is_node) in node.children.iter_mut().zip(are_nodes) {
            let (kind, rank) =
                if is_node { (IS_NODE, &mut n_nodes) } else { (IS_BLOCK, &mut n_blocks) };
            *child = kind | *rank;
            *rank += 1;
        }
        node.n_children = n_nodes + n_blocks;
        node
    }

    /// Encodes the box of the child in each lane; those of lanes without a child must be empty.
    pub fn set_boxes(&mut self, boxes: &[Aabb; LANES]) {
        let bounds = boxes.iter().copied().reduce(Aabb::union).unwrap_or(Aabb::EMPTY);
        self.origin = bounds.min.to_array();
        for axis in 0..3 {
            self.exponents[axis] = step_exponent(bounds.min[axis], bounds.max[axis]);
            self.set_bounds_along(axis, boxes);
        }
    }

    pub(super) fn n_child_nodes(&self) -> usize {
        self.children.iter().filter(|child| **child & IS_NODE != 0).count()
    }

    /// What stands in `lane`, if anything.
    #[inline(always)]
    pub fn child(&self, lane: usize) -> Option<Child> {
        let child = self.children[lane];
        let rank = u32::from(child & RANK);
        match child & !RANK {
            0 => None,
            IS_NODE => Some(Child::Node(self.first_node + rank)),
            _ => Some(Child::Block(self.first_block + rank)),
        }
    }

    /// The children of all lanes as `Child::pack` has them, which lanes hold as bits.
    #[inline(always)]
    pub fn packed_children<L: Lanes>(&self) -> L {
        L::from_tagged(&self.children, self.first_node, self.first_block | Child::BLOCK_BIT)
    }

    /// The lanes that hold a child: the first ones.
    #[inline(always)]
    pub fn filled<L: Lanes>(&self) -> L::Mask {
        L::below(self.n_children)
    }

    /// Lower and upper bounds of all children along an axis.
    #[inline(always)]
    pub fn sides<L: Lanes, const AXIS: usize>(&self) -> (L, L) {
        let [x, y, z] = self.exponents;
        let step = L::power_of_two::<AXIS>(u32::from_le_bytes([x, y, z, self.n_children]));
        let corner = L::splat(self.origin[AXIS]);
        (
            L::from_u8(&self.lower[AXIS]).times_plus(step, corner),
            L::from_u8(&self.upper[AXIS]).times_plus(step, corner),
        )
    }

    /// Bit i is set if lane i holds a child.
    #[inline(always)]
    pub fn occupied(&self) -> u32 {
        (1 << self.n_children) - 1
    }

    /// Length of a step along each axis.
    #[inline(always)]
    pub fn step(&self) -> Vec3A {
        let [x, y, z] = self.exponents.map(|exponent| f32::from_bits(u32::from(exponent) << 23));
        Vec3A::new(x, y, z)
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
        for lane in (0..LANES).filter(|lane| self.children[*lane] != 0) {
            let (min, max) = (boxes[lane].min[axis], boxes[lane].max[axis]);
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
    use crate::math::Random;

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
            let mut node = Node::new((0..n).map(|i| i % 3 == 0), 100, 200);
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
    fn children_are_numbered_by_kind() {
        let node = Node::new([false, true, false].into_iter(), 10, 20);
        let children: Vec<_> = (0..4).map(|lane| node.child(lane)).collect();
        let expected =
            [Some(Child::Block(20)), Some(Child::Node(10)), Some(Child::Block(21)), None];
        assert_eq!(children, expected);
        assert_eq!(node.occupied(), 0b0111);
    }

    #[test]
    fn a_node_is_eighty_bytes() {
        assert_eq!(size_of::<Node>(), 80);
    }
}
