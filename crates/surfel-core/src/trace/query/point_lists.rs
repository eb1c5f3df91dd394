//! The points around positions, listed for each of sixteen positions: sums over them need no test of each point again.

use crate::flat::FlatPoints;
use crate::math::{
    Aabb, Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Vec3Lanes, set_bits,
};
use crate::trace::query::edge_test::{PacketCandidates, lane_mask};
use crate::trace::traversal::region::{BoxVisitor, query_box};
use std::marker::PhantomData;

/// Offset of missing points, which is beyond every support.
const MISSING_POINT_OFFSET: f32 = 1e3;

/// One point of each position.
#[derive(Clone, Copy)]
pub struct PointRow {
    offset: [[f32; PACKET_WIDTH]; 3],
    inverse_support_squared: [f32; PACKET_WIDTH],
    /// Slots as the bits of floats.
    pub slot: [f32; PACKET_WIDTH],
}

impl PointRow {
    const NONE: Self = Self {
        offset: [[MISSING_POINT_OFFSET; PACKET_WIDTH]; 3],
        inverse_support_squared: [1.0; PACKET_WIDTH],
        slot: [0.0; PACKET_WIDTH],
    };

    /// Returns the offsets from the positions, in radii of the positions.
    #[inline(always)]
    pub fn offset<W: PacketLanes>(&self) -> Vec3Lanes<W> {
        Vec3Lanes::load_packet(&self.offset)
    }

    /// Returns the reciprocals of the squared radii of the points' weight functions, in radii of the positions.
    #[inline(always)]
    pub fn inverse_support_squared<W: PacketLanes>(&self) -> W {
        W::load(&self.inverse_support_squared)
    }
}

/// The points around sixteen positions, those of each position in the order of their slots. Positions close to each other
/// share rows, in which a point is missing for those that it is not near to.
#[derive(Default)]
pub struct PointLists {
    rows: Vec<PointRow>,
    blocks: Vec<u32>,
}

impl PointLists {
    /// Returns the rows: the first one has the first point of each position.
    #[inline(always)]
    pub fn rows(&self) -> &[PointRow] {
        &self.rows
    }

    /// Removes all points.
    pub fn clear(&mut self) {
        self.rows.clear();
    }

    /// Lists the points within `reach` radii of the positions in `lanes`, instead of what was listed for these. The weight of
    /// a point reaches `support_factor` of its radii far.
    #[inline(always)]
    pub fn collect<L: Lanes>(
        &mut self,
        points: &FlatPoints,
        positions: &PacketCandidates<L::PacketLanes>,
        lanes: u32,
        reach: f32,
        support_factor: f32,
    ) {
        let mask = lane_mask::<L::PacketLanes>(lanes);
        for row in &mut self.rows {
            let x = L::PacketLanes::load(&row.offset[0]);
            row.offset[0] =
                L::PacketLanes::select(mask, L::PacketLanes::splat(MISSING_POINT_OFFSET), x)
                    .store();
        }
        let mut left = lanes;
        while left != 0 {
            let group = positions.group_of_first(left);
            left &= !group;
            let region = positions.region(group, reach);
            self.blocks.clear();
            let mut visitor =
                BlockIndices { region: &region, blocks: &mut self.blocks, lanes: PhantomData::<L> };
            query_box::<L>(points, &region, &mut visitor);
            self.blocks.sort_unstable();
            self.add_group::<L>(points, positions, &region, group, (reach, support_factor));
        }
    }

    /// Adds the points of the blocks that are near to a position of a group to the lists of the group.
    #[inline(always)]
    fn add_group<L: Lanes>(
        &mut self,
        points: &FlatPoints,
        positions: &PacketCandidates<L::PacketLanes>,
        region: &Aabb,
        group: u32,
        (reach, support_factor): (f32, f32),
    ) {
        let splat = <L::PacketLanes as Floats>::splat;
        let mask = lane_mask::<L::PacketLanes>(group);
        let per_radius = splat(1.0) / positions.radius;
        let per_support = positions.radius * splat(1.0 / support_factor);
        let max_squared = splat(reach * reach);
        let (n_before, mut n_listed) = (self.rows.len(), 0);
        for block_idx in &self.blocks {
            let block = &points.blocks[*block_idx as usize];
            let corner = Vec3Lanes::splat(block.corner()).minus(positions.position);
            let offsets = block.offsets::<L>().store();
            let radii = block.radii::<L>().store();
            if self.rows.len() < n_listed + LANES {
                self.rows.resize(n_listed + LANES, PointRow::NONE);
            }
            for point in set_bits::<LANES>(block.lanes_within::<L>(region)) {
                let offset = corner.plus(Vec3Lanes::splat_lane(&offsets, point)).scaled(per_radius);
                let near = mask & offset.dot(offset).lt(max_squared);
                let inverse = per_support * splat(1.0 / radii[point]);
                let slot = splat(f32::from_bits(block_idx * LANES as u32 + point as u32));
                // There is no branch: whether a point is near is unpredictable. The next one takes the row of one that is not.
                let row = &mut self.rows[n_listed];
                n_listed += usize::from(near.bits() != 0);
                row.offset = Vec3Lanes::select(near, offset, row.offset()).store_packet();
                let (inverse_support_squared, slots) =
                    (row.inverse_support_squared(), L::PacketLanes::load(&row.slot));
                let inverse_support_squared =
                    L::PacketLanes::select(near, inverse * inverse, inverse_support_squared);
                row.inverse_support_squared = inverse_support_squared.store();
                row.slot = L::PacketLanes::select(near, slot, slots).store();
            }
        }
        self.rows.truncate(n_before.max(n_listed));
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
