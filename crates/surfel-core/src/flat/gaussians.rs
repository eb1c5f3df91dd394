//! Trained Gaussians in the form that kernels read: tree nodes, leaf blocks, and the coefficients of their colours.

use super::block_tree::{BlockTree, Slot};
use crate::bvh::{self, BvhNode, BvhPrimitive, NO_PRIMITIVE};
use crate::error::{Error, Result};
use crate::math::{Aabb, LANES, Lanes, Vec3, Vec3Lanes};
use crate::points::{Gaussian, GaussianColumns, HARMONIC_0, MAX_HARMONICS};
use crate::progress::Progress;
use crate::scene::CloudGeometry;
use crate::surface::gaussian::bounds;
use crate::surface::{GaussianLanes, WhitenedGaussian};
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

/// Bytes of a Gaussian of degree 3: its block, index, coefficients and tree.
pub const MAX_GAUSSIAN_BYTES: usize = size_of::<GaussianBlock>() / LANES
    + size_of::<u32>()
    + 3 * MAX_HARMONICS * size_of::<f16>()
    + 10;

/// Eight Gaussians, lane by lane.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct GaussianBlock {
    /// Centres, axis by axis.
    center: [[f32; LANES]; 3],
    /// Rows of the matrices to coordinates in which all deviations are 1.
    rows: [[[f32; LANES]; 3]; 3],
    /// Squares of the distances at which the Gaussians end, in deviations; below 0 in unused lanes.
    max_squared: [f32; LANES],
}

/// Trained Gaussians and the tree over them.
#[derive(Clone, Debug, Default)]
pub struct FlatGaussians {
    nodes: Vec<BvhNode>,
    blocks: Vec<GaussianBlock>,
    /// Index in the cloud of the Gaussian at each slot, or `NO_PRIMITIVE` in unused slots.
    ids: Vec<u32>,
    /// Number of spherical harmonics of each channel: 1, 4, 9 or 16.
    n_harmonics: usize,
    /// Coefficients at each slot, one channel after the other.
    coefficients: Vec<f16>,
}

impl BlockTree for FlatGaussians {
    type Block = GaussianBlock;

    #[inline(always)]
    fn nodes(&self) -> &[BvhNode] {
        &self.nodes
    }

    #[inline(always)]
    fn blocks(&self) -> &[GaussianBlock] {
        &self.blocks
    }
}

impl GaussianBlock {
    fn new(gaussians: &[Option<WhitenedGaussian>; LANES]) -> Self {
        let mut block = Self { max_squared: [-1.0; LANES], ..bytemuck::Zeroable::zeroed() };
        for (lane, gaussian) in gaussians.iter().enumerate() {
            let Some(WhitenedGaussian { center, rows, max_squared }) = gaussian else { continue };
            for axis in 0..3 {
                block.center[axis][lane] = center[axis];
                (0..3).for_each(|row| block.rows[row][axis][lane] = rows[row][axis]);
            }
            block.max_squared[lane] = *max_squared;
        }
        block
    }

    /// Returns the Gaussians relative to the origin of a ray, and the squares of the distances at which they end.
    #[inline(always)]
    pub fn decode_relative_to<L: Lanes>(&self, origin: Vec3) -> (GaussianLanes<L>, L) {
        let [a, b, c] = &self.rows;
        let center = load(&self.center).minus(Vec3Lanes::splat(origin));
        let rows = [load(a), load(b), load(c)];
        (GaussianLanes { center, rows }, L::load(&self.max_squared))
    }

    /// Returns the Gaussian in a lane, which must be used.
    pub fn gaussian(&self, lane: usize) -> WhitenedGaussian {
        let vector = |columns: &[[f32; LANES]; 3]| Vec3::from_array(columns.map(|axis| axis[lane]));
        WhitenedGaussian {
            center: vector(&self.center),
            rows: [0, 1, 2].map(|row| vector(&self.rows[row])),
            max_squared: self.max_squared[lane],
        }
    }
}

#[inline(always)]
fn load<L: Lanes>([x, y, z]: &[[f32; LANES]; 3]) -> Vec3Lanes<L> {
    Vec3Lanes { x: L::load(x), y: L::load(y), z: L::load(z) }
}

impl FlatGaussians {
    /// Sorts the Gaussians of a cloud, at these positions, into a tree. The tree leaves out those that are broken, and those
    /// that are too faint to be seen.
    ///
    /// # Errors
    ///
    /// Fails if the cloud lacks the columns of trained Gaussians, or if `progress` is cancelled.
    pub(super) fn new(
        geometry: &CloudGeometry,
        positions: &[Vec3],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let columns = GaussianColumns::new(geometry.cloud())
            .ok_or(Error::MissingColumn { column: "columns of trained Gaussians" })?;
        let at = |id: u32| {
            let gaussian = columns.gaussian(id as usize)?;
            Some(Gaussian { center: positions[id as usize], ..gaussian })
        };
        let primitive = |id: u32| {
            let visible = at(id).filter(|gaussian| WhitenedGaussian::new(gaussian).is_some());
            let bounds = visible.map_or(Aabb::EMPTY, |gaussian| bounds(&gaussian));
            BvhPrimitive::new(bounds, id, 0.0)
        };
        let ids = (0..positions.len() as u32).into_par_iter();
        let tree = bvh::build(ids.map(primitive).collect(), |_| true, progress)?;
        let encode = |ids: &[u32; LANES]| {
            let whitened = |id: u32| WhitenedGaussian::new(&at(id)?);
            GaussianBlock::new(&ids.map(|id| (id != NO_PRIMITIVE).then(|| whitened(id)).flatten()))
        };
        let blocks = tree.blocks.par_iter().map(encode).collect();
        let mut nodes = tree.nodes;
        bvh::refit_boxes(&mut nodes, |block| {
            let ids = tree.blocks[block as usize].iter().filter(|id| **id != NO_PRIMITIVE);
            ids.filter_map(|id| at(*id)).map(|own| bounds(&own)).fold(Aabb::EMPTY, Aabb::union)
        });
        let ids = tree.blocks.into_flattened();
        let shows_trained = geometry.shows_trained_colors;
        let n_harmonics = if shows_trained { columns.n_harmonics() } else { 1 };
        let mut coefficients = vec![f16::ZERO; 3 * n_harmonics * ids.len()];
        coefficients.par_chunks_mut(3 * n_harmonics).zip(&ids).for_each(|(own, id)| {
            let mut values = [0.0; 3 * MAX_HARMONICS];
            let values = &mut values[..own.len()];
            match *id {
                NO_PRIMITIVE => return,
                id if shows_trained => columns.coefficients(id as usize, values),
                id => values.copy_from_slice(&uniform(geometry.colors()[id as usize])),
            }
            own.convert_from_f32_slice(values);
        });
        Ok(Self { nodes, blocks, ids, n_harmonics, coefficients })
    }

    /// Returns the index in the cloud of the Gaussian at `slot`, or `NO_PRIMITIVE` if the slot is unused.
    pub fn id(&self, slot: Slot) -> u32 {
        self.ids[slot as usize]
    }

    /// Returns the index in the cloud of the Gaussian at each slot, `NO_PRIMITIVE` in unused ones.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Returns the Gaussian at `slot`, which must be used.
    pub fn gaussian(&self, slot: Slot) -> WhitenedGaussian {
        self.blocks[slot as usize / LANES].gaussian(slot as usize % LANES)
    }

    /// Returns the square of the distance from its centre, in deviations, at which the Gaussian at `slot` ends.
    #[inline]
    pub fn max_squared(&self, slot: Slot) -> f32 {
        self.blocks[slot as usize / LANES].max_squared[slot as usize % LANES]
    }

    /// Returns the sRGB-encoded colour of the Gaussian at `slot`, whatever the direction.
    pub fn color(&self, slot: Slot) -> [u8; 3] {
        let first = 3 * self.n_harmonics * slot as usize;
        [0, 1, 2].map(|channel| {
            let coefficient = self.coefficients[first + channel * self.n_harmonics].to_f32();
            (255.0 * (0.5 + HARMONIC_0 as f32 * coefficient) + 0.5) as u8
        })
    }

    /// Returns the sRGB-encoded colour, 0 or more, that the Gaussian at `slot` shows where the spherical harmonics of the
    /// direction are these.
    #[inline]
    pub fn color_along(&self, slot: Slot, harmonics: &[f32; MAX_HARMONICS]) -> Vec3 {
        let n = self.n_harmonics;
        let coefficients = &self.coefficients[3 * n * slot as usize..][..3 * n];
        let mut values = [0.0; 3 * MAX_HARMONICS];
        let values = &mut values[..3 * n];
        coefficients.convert_to_f32_slice(values);
        // The sums of three channels at once do not wait for each other.
        let mut color = Vec3::splat(0.5);
        let (red, others) = values.split_at(n);
        let (green, blue) = others.split_at(n);
        for (((red, green), blue), harmonic) in red.iter().zip(green).zip(blue).zip(harmonics) {
            color += *harmonic * Vec3::new(*red, *green, *blue);
        }
        color.max(Vec3::ZERO)
    }

    /// Returns the number of spherical harmonics of each channel: 1, 4, 9 or 16.
    pub fn n_harmonics(&self) -> usize {
        self.n_harmonics
    }

    /// Returns the bits of the coefficients at each slot as 16-bit floats: `n_harmonics` of each channel, one channel after
    /// the other.
    pub fn coefficient_bits(&self) -> &[u16] {
        self.coefficients.reinterpret_cast()
    }

    /// Returns the sizes of the tree and of the Gaussians in bytes.
    pub fn bytes(&self) -> (usize, usize) {
        let gaussians = size_of_val(self.blocks.as_slice())
            + size_of_val(self.ids.as_slice())
            + size_of_val(self.coefficients.as_slice());
        (size_of_val(self.nodes.as_slice()), gaussians)
    }
}

/// Returns the coefficients of a colour that is the same in all directions.
fn uniform(color: [u8; 3]) -> [f32; 3] {
    color.map(|channel| (f32::from(channel) / 255.0 - 0.5) / HARMONIC_0 as f32)
}
