//! Nodes: the boxes of eight children in 72 bytes.

use crate::math::{Aabb, LANES, Lanes, Vec3, Vec3A};

/// A node with the boxes of its children on a grid whose step is a power of two, after Ylitie et al. 2017.
///
/// Flat scenes store nodes in this form. Decoded boxes contain the boxes that were encoded.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct BvhNode {
    /// Lower corner of the boxes of all children.
    pub origin: [f32; 3],
    /// Biased exponents of the grid's step per axis, one byte each from the lowest: step = 2^(exponent - 127).
    /// Above them four bits have the number of children, and four bits the number of children that are nodes.
    exponents_and_counts: u32,
    /// Index of the first child that is a node. The other child nodes follow it in the next lanes.
    pub first_node: u32,
    /// The packed block that lane 0 would hold if it were a block. Blocks follow the nodes in the lanes and are
    /// consecutive in memory.
    lane_zero_as_block: u32,
    /// Lower bounds in steps from `origin`, one row per axis.
    pub lower: [[u8; LANES]; 3],
    /// Upper bounds in steps from `origin`, one row per axis.
    pub upper: [[u8; LANES]; 3],
}

/// A child of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Child {
    /// The node with this index.
    Node(u32),
    /// The block with this index.
    Block(u32),
}

impl Child {
    /// The bit that distinguishes a packed block from a packed node.
    pub const BLOCK_BIT: u32 = 1 << 31;

    /// Packs the child into one word for the stacks of traversals. Indices are below 2^31.
    #[inline(always)]
    pub fn pack(self) -> u32 {
        match self {
            Self::Node(node_idx) => node_idx,
            Self::Block(block_idx) => block_idx | Self::BLOCK_BIT,
        }
    }

    /// Returns the child that `pack` packed into `word`.
    #[inline(always)]
    pub fn unpack(word: u32) -> Self {
        match word & Self::BLOCK_BIT {
            0 => Self::Node(word),
            _ => Self::Block(word & !Self::BLOCK_BIT),
        }
    }
}

/// Index of the lowest of the four bits with the number of children.
const N_CHILDREN_SHIFT: i32 = 24;
/// Index of the lowest of the four bits with the number of children that are nodes.
const N_NODES_SHIFT: i32 = 28;

impl BvhNode {
    /// Returns a node over up to eight children, first nodes and then blocks. `set_boxes` sets their boxes.
    pub fn new(n_nodes: usize, n_blocks: usize, first_node: u32, first_block: u32) -> Self {
        let (n_nodes, n_children) = (n_nodes as u32, (n_nodes + n_blocks) as u32);
        Self {
            exponents_and_counts: n_children << N_CHILDREN_SHIFT | n_nodes << N_NODES_SHIFT,
            first_node,
            lane_zero_as_block: (first_block | Child::BLOCK_BIT) - n_nodes,
            ..Self::default()
        }
    }

    /// Encodes the box of the child in each lane. Boxes of lanes without a child must be empty.
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

    /// Returns the number of children that are nodes.
    #[inline(always)]
    pub(super) fn n_child_nodes(&self) -> usize {
        (self.exponents_and_counts >> N_NODES_SHIFT) as usize
    }

    #[inline(always)]
    fn n_children(&self) -> usize {
        (self.exponents_and_counts >> N_CHILDREN_SHIFT & 0xf) as usize
    }

    /// Returns true if no child is a node.
    #[inline(always)]
    pub fn has_only_blocks(&self) -> bool {
        self.n_child_nodes() == 0
    }

    /// Returns the child in `lane`, or none if the lane is unused.
    #[inline(always)]
    pub fn child(&self, lane: usize) -> Option<Child> {
        if self.n_children() <= lane {
            return None;
        }
        let is_node = lane < self.n_child_nodes();
        let first = if is_node { self.first_node } else { self.lane_zero_as_block };
        Some(Child::unpack(first + lane as u32))
    }

    /// Returns the packed children of all lanes as bits.
    #[inline(always)]
    pub fn packed_children<L: Lanes>(&self) -> L {
        L::packed_indices(self.node_mask::<L>(), self.first_node, self.lane_zero_as_block)
    }

    /// Returns the mask of the lanes that hold nodes, which are the first ones.
    #[inline(always)]
    pub fn node_mask<L: Lanes>(&self) -> L::Mask {
        L::first_lanes::<N_NODES_SHIFT>(self.exponents_and_counts)
    }

    /// Returns the mask of the lanes that hold blocks, and of all unused lanes.
    #[inline(always)]
    pub fn block_mask<L: Lanes>(&self) -> L::Mask {
        L::splat(f32::from_bits(Child::BLOCK_BIT - 1)).lt_u32(self.packed_children::<L>())
    }

    /// Returns the mask of the lanes that hold a child, which are the first ones.
    #[inline(always)]
    pub fn occupied_mask<L: Lanes>(&self) -> L::Mask {
        L::first_lanes::<N_CHILDREN_SHIFT>(self.exponents_and_counts)
    }

    /// Returns the lower and upper bounds of all children along an axis.
    #[inline(always)]
    pub fn bounds_along<L: Lanes, const AXIS: usize>(&self) -> (L, L) {
        let step = L::exp2_byte::<AXIS>(self.exponents_and_counts);
        let corner = L::splat(self.origin[AXIS]);
        (
            L::from_u8(&self.lower[AXIS]).mul_add(step, corner),
            L::from_u8(&self.upper[AXIS]).mul_add(step, corner),
        )
    }

    /// Returns the lanes that hold a child, one bit per lane.
    #[inline(always)]
    pub fn occupied_lanes(&self) -> u32 {
        (1 << self.n_children()) - 1
    }

    /// Returns the length of a step along each axis.
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

    /// Returns the length of a step along `axis`.
    #[inline(always)]
    pub fn step_along(&self, axis: usize) -> f32 {
        f32::from_bits((self.exponents_and_counts >> (8 * axis) & 0xff) << 23)
    }

    /// Returns an upper bound of the size of the box around all children.
    #[inline(always)]
    pub fn max_size(&self) -> f32 {
        256.0 * self.step().max_element()
    }

    /// Returns the decoded box of the child in `lane`.
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
        // The reciprocal is exact, because the step is a power of two.
        let per_step = 1.0 / step;
        for (lane, bounds) in boxes[..self.n_children()].iter().enumerate() {
            let (min, max) = (bounds.min[axis], bounds.max[axis]);
            // The quotient can round past a step, and too small a box would lose hits: the loops correct that.
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

/// Returns the smallest biased exponent whose grid covers `min` to `max` in 255 steps.
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
    //! Boxes that a node stores as bytes contain those that they were made from; the order of
    //! children; the size of a node.

    use super::*;
    use crate::math::{LaneMask, PortableLanes, Random};

    #[test]
    fn decoded_boxes_contain_the_encoded_boxes() {
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
            let mut node = BvhNode::new(n / 3, n - n / 3, 100, 200);
            node.set_boxes(&boxes);
            assert_eq!(node.occupied_lanes(), (1u32 << n) - 1);
            for (lane, bounds) in boxes[..n].iter().enumerate() {
                assert!(node.bounds(lane).contains(*bounds), "{:?} {bounds:?}", node.bounds(lane));
                let excess = node.bounds(lane).size() - bounds.size();
                assert!(excess.cmple(2.01 * Vec3::from(node.step()) + 1e-6 * offset).all());
            }
        }
    }

    #[test]
    fn child_nodes_come_before_child_blocks() {
        let node = BvhNode::new(1, 2, 10, 20);
        let children: Vec<_> = (0..4).map(|lane| node.child(lane)).collect();
        let expected =
            [Some(Child::Node(10)), Some(Child::Block(20)), Some(Child::Block(21)), None];
        assert_eq!(children, expected);
        assert_eq!(node.occupied_lanes(), 0b0111);
        let only_nodes = BvhNode::new(LANES, 0, 1, 0);
        assert_eq!(only_nodes.child(LANES - 1), Some(Child::Node(LANES as u32)));
    }

    #[test]
    fn lanes_contain_the_packed_children() {
        for (n_nodes, n_blocks) in [(0, 8), (1, 2), (3, 5), (7, 1), (8, 0)] {
            let node = BvhNode::new(n_nodes, n_blocks, 10, 3);
            let packed = node.packed_children::<PortableLanes>().store();
            for (lane, packed) in packed[..n_nodes + n_blocks].iter().enumerate() {
                assert_eq!(Some(Child::unpack(packed.to_bits())), node.child(lane));
            }
            assert_eq!(node.occupied_mask::<PortableLanes>().bits(), node.occupied_lanes());
        }
    }

    #[test]
    fn a_node_is_seventy_two_bytes() {
        assert_eq!(size_of::<BvhNode>(), 72);
    }
}
