//! The search for the nearest Gaussians of rays that have not been composited yet.

use crate::flat::{BlockTree, FlatGaussians};
use crate::math::{LANES, LaneMask, Lanes, Ray, Vec3Lanes, set_bits};
use crate::trace::query::gaussian_buffer::{GaussianBuffer, GaussianHit};
use crate::trace::simd::{Simd, dispatch_simd};
use crate::trace::traversal::interleaved::{RayPool, RayVisitor, trace_interleaved};
use std::ops::ControlFlow;

/// The search along one ray.
pub struct GaussianSearch {
    /// Index of the ray among those whose light is computed.
    pub ray_idx: usize,
    /// The ray in the coordinates of the cloud.
    pub ray: Ray,
    /// Length in the cloud's coordinates of a unit length in world space along the ray.
    pub scale: f32,
    /// Index of the cloud among those that are traced.
    pub cloud_idx: u32,
    /// The last hit that has been composited.
    pub after: GaussianHit,
    /// The nearest hits behind it.
    pub buffer: GaussianBuffer,
}

/// Adds the nearest Gaussians to the buffer of each search.
pub fn search_gaussians(
    gaussians: &FlatGaussians,
    simd: Simd,
    pool: &mut RayPool,
    searches: &mut [GaussianSearch],
) {
    if gaussians.nodes().is_empty() {
        return;
    }
    dispatch_simd!(
        simd,
        search_kernel(
            gaussians: &FlatGaussians,
            pool: &mut RayPool,
            searches: &mut [GaussianSearch]
        )
    );
}

#[inline(always)]
fn search_kernel<L: Lanes>(
    gaussians: &FlatGaussians,
    pool: &mut RayPool,
    searches: &mut [GaussianSearch],
) {
    trace_interleaved::<L, _>(pool, gaussians, searches);
}

impl GaussianSearch {
    /// Returns the search along a ray in world space.
    pub fn new(ray_idx: usize, ray: &Ray) -> Self {
        let (after, buffer) = (GaussianHit::BEFORE_ALL, GaussianBuffer::EMPTY);
        Self { ray_idx, ray: *ray, scale: 1.0, cloud_idx: 0, after, buffer }
    }

    /// Goes on in another cloud, in whose coordinates `ray` is, unless the ray does not enter its box.
    pub fn enter(&mut self, cloud_idx: u32, enters: bool, ray: Ray, scale: f32) {
        // World distances are rounded: `after` tells the hits at the same distance apart.
        let behind = self.after.distance * scale * (1.0 - 4.0 * f32::EPSILON);
        let t_max = if enters { ray.t_max } else { f32::NEG_INFINITY };
        self.ray = Ray { t_min: ray.t_min.max(behind), t_max, ..ray };
        (self.cloud_idx, self.scale) = (cloud_idx, scale);
    }
}

impl RayVisitor for GaussianSearch {
    type Tree = FlatGaussians;
    const IS_ORDERED: bool = true;

    #[inline(always)]
    fn ray(&self) -> &Ray {
        &self.ray
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        // World distances are rounded.
        let bound = self.buffer.bound() * self.scale * (1.0 + 4.0 * f32::EPSILON);
        self.ray.t_max.min(bound)
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, tree: &FlatGaussians, block_idx: u32) -> ControlFlow<()> {
        let block = &tree.blocks()[block_idx as usize];
        let (lanes, max_squared) = block.decode_relative_to::<L>(self.ray.origin);
        let (distances, squares) = lanes.intersect(Vec3Lanes::splat(self.ray.direction));
        let is_within =
            L::splat(self.ray.t_min).le(distances) & distances.le(L::splat(self.limit()));
        let is_hit = squares.le(max_squared) & is_within;
        let bits = is_hit.bits();
        if bits == 0 {
            return ControlFlow::Continue(());
        }
        let (distances, squares) = (distances.store(), squares.store());
        for lane in set_bits::<LANES>(bits) {
            let hit = GaussianHit {
                // The sum turns a negative zero into a positive one.
                distance: distances[lane] / self.scale + 0.0,
                cloud_idx: self.cloud_idx,
                slot: block_idx * LANES as u32 + lane as u32,
                squared: squares[lane],
            };
            if self.after.is_before(&hit) {
                self.buffer.insert(hit);
            }
        }
        ControlFlow::Continue(())
    }
}
