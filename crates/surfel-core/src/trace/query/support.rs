//! The support of hits: how many measured points stand behind a hit, and how near the nearest one is.

use crate::flat::{FlatCloud, FlatPoints};
use crate::math::{Aabb, LaneMask, Lanes, Ray, Vec3, Vec3Lanes};
use crate::surface::{FIT_REACH, GaussianLanes, SurfaceKind};
use crate::trace::query::hit::Hit;
use crate::trace::traversal::region::{BoxVisitor, query_box};

/// The measured points behind a hit. It tells apart what is measured and what is bridged between points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Number of points within one radius of the hit: 1 on a ball, a capsule, a cluster of leaves, a Gaussian or a
    /// rasterised point, each of which is one point, and 0 on triangles and where nothing was hit.
    pub n_points: u32,
    /// Distance from the hit to the nearest point, in radii of the point that was hit: 0 at a point, and about 1 as far
    /// from all points as a surface reaches. Infinite on triangles and where nothing was hit.
    ///
    /// Balls, capsules and leaves are hit beside their point; there it is the distance from the point to the ray. That of a
    /// Gaussian is in its standard deviations.
    pub distance: f32,
}

impl Support {
    /// The support of triangles, and of rays that hit nothing.
    pub const NONE: Self = Self { n_points: 0, distance: f32::INFINITY };
    /// The support of a point that is seen itself.
    pub const POINT: Self = Self { n_points: 1, distance: 0.0 };
}

/// Finds the support of a ray's hit on a surface of this kind.
#[inline(always)]
pub fn support<L: Lanes>(cloud: &FlatCloud, ray: &Ray, hit: &Hit, surface: SurfaceKind) -> Support {
    if surface == SurfaceKind::Gaussian {
        return gaussian_support(cloud, ray, hit);
    }
    let points = cloud.points_of(surface);
    let position = ray.at(hit.distance);
    let to_center = points.center(hit.slot) - position;
    // The flat form stores the radii of the discs, which may be larger than the points'.
    let reach = points.radius(hit.slot);
    let factor = if surface == cloud.surface { cloud.radius_factor() } else { 1.0 };
    let radius = reach / factor;
    if !surface.is_continuous() {
        let across = to_center - to_center.dot(ray.direction) * ray.direction;
        return Support { n_points: 1, distance: across.length() / radius };
    }
    let reach = Vec3::splat(FIT_REACH * reach.max(radius));
    let region = Aabb { min: position - reach, max: position + reach };
    let nearest = L::splat(to_center.length_squared());
    let mut found = NearbyPoints { position, max_squared: radius * radius, n_points: 0, nearest };
    query_box::<L>(points, &region, &mut found);
    let NearbyPoints { n_points, nearest, .. } = found;
    Support { n_points, distance: nearest.reduce_min().sqrt() / radius }
}

/// Returns the support of a hit on Gaussians: one point, at its distance from the ray in deviations.
fn gaussian_support(cloud: &FlatCloud, ray: &Ray, hit: &Hit) -> Support {
    let gaussian = cloud.gaussians.gaussian(hit.slot);
    let lanes = GaussianLanes::<f32> {
        center: Vec3Lanes::splat(gaussian.center - ray.origin),
        rows: gaussian.rows.map(Vec3Lanes::splat),
    };
    let (_, squared) = lanes.intersect(Vec3Lanes::splat(ray.direction));
    Support { n_points: 1, distance: squared.sqrt() }
}

/// The points around a position: their number within a distance, and the nearest one.
struct NearbyPoints<L> {
    position: Vec3,
    /// Square of the distance.
    max_squared: f32,
    n_points: u32,
    /// Square of the distance to the nearest point, in each lane.
    nearest: L,
}

impl<L: Lanes> BoxVisitor for NearbyPoints<L> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let block = &points.blocks[block_idx as usize];
        let offset = block.centers::<L>(self.position);
        let squared = offset.dot(offset);
        let is_used = L::splat(0.0).lt(block.radii());
        let is_near = is_used & squared.le(L::splat(self.max_squared));
        self.n_points += is_near.bits().count_ones();
        self.nearest = L::select(is_used, squared.min(self.nearest), self.nearest);
    }
}
