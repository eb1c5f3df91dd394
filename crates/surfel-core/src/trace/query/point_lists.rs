//! The points around positions, listed for each of sixteen positions: sums over them need no test of each point again.

use crate::flat::FlatPoints;
use crate::math::{
    Aabb, Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Vec3Lanes, set_bits,
};
use crate::trace::query::edge_test::PacketCandidates;
use crate::trace::traversal::region::{BoxVisitor, query_box};
use std::marker::PhantomData;

/// Maximum distance of positions that share a traversal of the tree from the first one along any axis, in radii.
const MAX_GROUP_SPREAD: f32 = 2.0;
/// Offset of missing points, which is beyond every support.
const FAR: f32 = 1e3;

/// One point of each position.
#[derive(Clone, Copy)]
pub struct PointRow {
    offset: [[f32; PACKET_WIDTH]; 3],
    radius: [f32; PACKET_WIDTH],
    /// Slots as the bits of floats.
    pub slot: [f32; PACKET_WIDTH],
}

impl PointRow {
    const NONE: Self = Self {
        offset: [[FAR; PACKET_WIDTH]; 3],
        radius: [1.0; PACKET_WIDTH],
        slot: [0.0; PACKET_WIDTH],
    };

    /// Returns the offsets from the positions, in radii of the positions.
    #[inline(always)]
    pub fn offset<W: PacketLanes>(&self) -> Vec3Lanes<W> {
        Vec3Lanes::load_packet(&self.offset)
    }

    /// Returns the radii of the points, in radii of the positions.
    #[inline(always)]
    pub fn radius<W: PacketLanes>(&self) -> W {
        W::load(&self.radius)
    }
}

/// The points around sixteen positions, those of each position in the order of their slots.
#[derive(Default)]
pub struct PointLists {
    rows: Vec<PointRow>,
    n_rows: usize,
    n_points: [usize; PACKET_WIDTH],
    blocks: Vec<u32>,
}

impl PointLists {
    /// Returns the rows: the first one has the first point of each position.
    #[inline(always)]
    pub fn rows(&self) -> &[PointRow] {
        &self.rows[..self.n_rows]
    }

    /// Lists the points within `reach` radii of the positions in `lanes`, instead of what was listed for these.
    #[inline(always)]
    pub fn collect<L: Lanes>(
        &mut self,
        points: &FlatPoints,
        positions: &PacketCandidates<L::PacketLanes>,
        lanes: u32,
        reach: f32,
    ) {
        for lane in set_bits::<PACKET_WIDTH>(lanes) {
            for row in &mut self.rows[..self.n_points[lane]] {
                row.offset[0][lane] = FAR;
            }
            self.n_points[lane] = 0;
        }
        let mut left = lanes;
        while left != 0 {
            let group = positions.group_of_first(left, MAX_GROUP_SPREAD);
            left &= !group;
            let region = positions.region(group, reach);
            self.blocks.clear();
            let mut visitor =
                BlockIndices { region: &region, blocks: &mut self.blocks, lanes: PhantomData::<L> };
            query_box::<L>(points, &region, &mut visitor);
            self.blocks.sort_unstable();
            self.add_group::<L>(points, positions, &region, group, reach);
        }
        self.n_rows = self.n_points.into_iter().max().unwrap_or(0);
    }

    /// Adds the points of the blocks to the lists of a group.
    #[inline(always)]
    fn add_group<L: Lanes>(
        &mut self,
        points: &FlatPoints,
        positions: &PacketCandidates<L::PacketLanes>,
        region: &Aabb,
        group: u32,
        reach: f32,
    ) {
        let per_radius = L::PacketLanes::splat(1.0) / positions.radius;
        let max_squared = L::PacketLanes::splat(reach * reach);
        for block_idx in &self.blocks {
            let block = &points.blocks[*block_idx as usize];
            let corner = Vec3Lanes::splat(block.corner()).minus(positions.position);
            let offsets = block.offsets::<L>().store();
            let radii = block.radii::<L>().store();
            for point in set_bits::<LANES>(block.lanes_within::<L>(region)) {
                let offset = corner.plus(Vec3Lanes::splat_lane(&offsets, point)).scaled(per_radius);
                let near = group & offset.dot(offset).lt(max_squared).bits();
                if near == 0 {
                    continue;
                }
                let offset = offset.store_packet();
                let radius = (L::PacketLanes::splat(radii[point]) * per_radius).store();
                let slot = f32::from_bits(block_idx * LANES as u32 + point as u32);
                for lane in set_bits::<PACKET_WIDTH>(near) {
                    let row = self.n_points[lane];
                    if row == self.rows.len() {
                        self.rows.push(PointRow::NONE);
                    }
                    let row = &mut self.rows[row];
                    for (own, found) in row.offset.iter_mut().zip(&offset) {
                        own[lane] = found[lane];
                    }
                    (row.radius[lane], row.slot[lane]) = (radius[lane], slot);
                    self.n_points[lane] += 1;
                }
            }
        }
    }
}

struct BlockIndices<'a, L> {
    region: &'a Aabb,
    blocks: &'a mut Vec<u32>,
    lanes: PhantomData<L>,
}

impl<L: Lanes> BoxVisitor for BlockIndices<'_, L> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        if points.blocks[block_idx as usize].lanes_within::<L>(self.region) != 0 {
            self.blocks.push(block_idx);
        }
    }
}
