//! The continuous surface of a cloud: blended discs without the hits that the edge test rejects, or spheres; and its lines
//! and scattered points.

use crate::flat::{FlatCloud, FlatPoints};
use crate::math::{Lanes, Ray, Vec3};
use crate::surface::capsule;
use crate::surface::leaves;
use crate::surface::{Capsule, Disc, EdgeTest, Leaves, Sphere, SurfaceKind, Surfel};
use crate::trace::query::any::{AcceptAll, any_accepted_hit, any_hits_kernel};
use crate::trace::query::closest::closest_shapes;
use crate::trace::query::edge_filter::EdgeFilter;
use crate::trace::query::field_query::field_hits;
use crate::trace::query::gaussian_hits::{gaussian_hits, gaussian_occlusions};
use crate::trace::query::hit::{Hit, MAX_REJECTED_HITS};
use crate::trace::query::leaf::LeafGeometry;
use crate::trace::query::mls_surface::{MlsHit, mls_hits};
use crate::trace::query::octree_query::{CellHit, cell_color, octree_hits};
use crate::trace::query::ray_field::FieldHit;
use crate::trace::query::smooth_filter::SmoothFilter;
use crate::trace::query::smooth_hits::trace_smooth;
use crate::trace::query::splat_query::{Splat, SplatTracer};
use crate::trace::query::support::support;
use crate::trace::query::surface_hit::SurfaceHit;
use crate::trace::simd::{Simd, dispatch_simd};
use crate::trace::traversal::octree_walk::PixelSize;

/// Finds the closest hit of each ray on the continuous surface.
pub fn surface_hits(cloud: &FlatCloud, simd: Simd, rays: &[Ray], hits: &mut [SurfaceHit]) {
    surface_hits_at(cloud, simd, PixelSize::ZERO, rays, hits);
}

/// Finds the closest hit of each ray on the continuous surface, where nothing smaller than a pixel counts: the cells of
/// octrees are as large as it.
pub fn surface_hits_at(
    cloud: &FlatCloud,
    simd: Simd,
    pixel: PixelSize,
    rays: &[Ray],
    hits: &mut [SurfaceHit],
) {
    if cloud.surface == SurfaceKind::Gaussian {
        return gaussian_hits(cloud, simd, rays, hits);
    }
    dispatch_simd!(
        simd,
        surface_hits_kernel(
            cloud: &FlatCloud,
            pixel: PixelSize,
            rays: &[Ray],
            hits: &mut [SurfaceHit]
        )
    );
}

#[inline(always)]
fn surface_hits_kernel<L: Lanes>(
    cloud: &FlatCloud,
    pixel: PixelSize,
    rays: &[Ray],
    hits: &mut [SurfaceHit],
) {
    hits.fill(SurfaceHit::MISS);
    if !cloud.points.nodes.is_empty() {
        match cloud.surface {
            SurfaceKind::Smooth => trace_smooth::<L>(cloud, rays, hits),
            SurfaceKind::Implicit => trace_field::<L>(cloud, rays, hits),
            SurfaceKind::Octree => trace_octree::<L, true>(cloud, pixel, rays, hits),
            SurfaceKind::OctreeSplat => trace_octree::<L, false>(cloud, pixel, rays, hits),
            SurfaceKind::Mls => trace_mls::<L>(cloud, rays, hits),
            kind if kind.uses_discs() => splat_hits::<L>(cloud, rays, hits),
            _ => merge_solids::<L, Sphere>(&cloud.points, SurfaceKind::Sphere, rays, hits),
        }
    }
    merge_solids::<L, Capsule>(&cloud.lines, SurfaceKind::Capsule, rays, hits);
    match cloud.has_leaves {
        true => merge_solids::<L, Leaves>(&cloud.scatter, SurfaceKind::Leaves, rays, hits),
        false => merge_solids::<L, Sphere>(&cloud.scatter, SurfaceKind::Sphere, rays, hits),
    }
    if let Some(colors) = &cloud.support_colors {
        for (ray, hit) in rays.iter().zip(hits).filter(|(_, hit)| !hit.is_miss()) {
            let nearest = Hit { distance: hit.distance, slot: hit.slot };
            hit.color = colors.color(support::<L>(cloud, ray, &nearest, hit.surface).distance);
        }
    }
}

#[inline(always)]
fn trace_field<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    let mut found = vec![FieldHit::MISS; rays.len()];
    field_hits::<L, true>(cloud, rays, &mut found);
    for ((ray, FieldHit { hit, normal, color }), result) in rays.iter().zip(found).zip(hits) {
        if !hit.is_miss() {
            let radius = cloud.points.radius(hit.slot);
            *result = surface_hit(cloud, ray, &hit, radius, (normal, color));
        }
    }
}

#[inline(always)]
fn trace_octree<L: Lanes, const HAS_CORNERS: bool>(
    cloud: &FlatCloud,
    pixel: PixelSize,
    rays: &[Ray],
    hits: &mut [SurfaceHit],
) {
    let mut found = vec![CellHit::MISS; rays.len()];
    octree_hits::<L, HAS_CORNERS>(cloud, pixel, rays, &mut found);
    for ((ray, CellHit { hit, normal, size }), result) in rays.iter().zip(found).zip(hits) {
        if !hit.is_miss() {
            // New rays keep their distance from cells that are larger than the discs.
            let radius = cloud.points.radius(hit.slot).max(size);
            *result = surface_hit(cloud, ray, &hit, radius, (normal, cell_color(cloud, hit.slot)));
        }
    }
}

#[inline(always)]
fn octree_occlusions<L: Lanes, const HAS_CORNERS: bool>(
    cloud: &FlatCloud,
    rays: &[Ray],
    occluded: &mut [bool],
) {
    let mut hits = vec![CellHit::MISS; rays.len()];
    octree_hits::<L, HAS_CORNERS>(cloud, PixelSize::ZERO, rays, &mut hits);
    occluded.iter_mut().zip(&hits).for_each(|(found, hit)| *found = !hit.hit.is_miss());
}

/// Finds out for each ray whether the continuous surface lies in its range.
pub fn occlusions(cloud: &FlatCloud, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    if cloud.surface == SurfaceKind::Gaussian {
        return gaussian_occlusions(cloud, simd, rays, occluded);
    }
    dispatch_simd!(simd, occlusions_kernel(cloud: &FlatCloud, rays: &[Ray], occluded: &mut [bool]));
}

#[inline(always)]
fn occlusions_kernel<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], occluded: &mut [bool]) {
    if cloud.points.nodes.is_empty() {
        occluded.fill(false);
    } else {
        surface_occlusions::<L>(cloud, rays, occluded);
    }
    merge_occlusions::<L, Capsule>(&cloud.lines, rays, occluded);
    match cloud.has_leaves {
        true => merge_occlusions::<L, Leaves>(&cloud.scatter, rays, occluded),
        false => merge_occlusions::<L, Sphere>(&cloud.scatter, rays, occluded),
    }
}

/// Finds out for each ray whether the surface of a cloud that has one lies in its range.
#[inline(always)]
fn surface_occlusions<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], occluded: &mut [bool]) {
    match cloud.surface {
        SurfaceKind::Smooth => {
            any_accepted_hit::<L, Disc, _>(&cloud.points, rays, SmoothFilter(cloud), occluded);
        }
        SurfaceKind::Implicit => {
            let mut hits = vec![FieldHit::MISS; rays.len()];
            field_hits::<L, false>(cloud, rays, &mut hits);
            occluded.iter_mut().zip(&hits).for_each(|(found, hit)| *found = !hit.hit.is_miss());
        }
        SurfaceKind::Octree => octree_occlusions::<L, true>(cloud, rays, occluded),
        SurfaceKind::OctreeSplat => octree_occlusions::<L, false>(cloud, rays, occluded),
        SurfaceKind::Mls => {
            let mut hits = vec![MlsHit::MISS; rays.len()];
            mls_hits::<L, false>(cloud, rays, &mut hits);
            occluded.iter_mut().zip(&hits).for_each(|(found, hit)| *found = !hit.hit.is_miss());
        }
        SurfaceKind::Cylinder | SurfaceKind::SplatFit if cloud.goes_through_holes() => {
            nearest_occlusions(rays, occluded, |hits| splat_hits::<L>(cloud, rays, hits));
        }
        kind if kind.uses_discs() && cloud.edge_test != EdgeTest::Off && cloud.is_crowded => {
            nearest_occlusions(rays, occluded, |hits| splat_hits::<L>(cloud, rays, hits));
        }
        kind if kind.uses_discs() && cloud.edge_test != EdgeTest::Off => {
            any_accepted_hit::<L, Disc, _>(&cloud.points, rays, EdgeFilter(cloud), occluded);
        }
        _ => any_hits_kernel::<L>(cloud, rays, occluded),
    }
}

/// Marks the rays whose search for the nearest hit finds one.
#[inline(always)]
fn nearest_occlusions(rays: &[Ray], occluded: &mut [bool], trace: impl FnOnce(&mut [SurfaceHit])) {
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    trace(&mut hits);
    occluded.iter_mut().zip(&hits).for_each(|(found, hit)| *found = !hit.is_miss());
}

/// Replaces hits by nearer ones on the spheres, capsules or leaves of `points`.
#[inline(always)]
fn merge_solids<L: Lanes, S: LeafGeometry<Tree = FlatPoints>>(
    points: &FlatPoints,
    surface: SurfaceKind,
    rays: &[Ray],
    hits: &mut [SurfaceHit],
) {
    if points.nodes.is_empty() {
        return;
    }
    let limited =
        |(ray, hit): (&Ray, &SurfaceHit)| Ray { t_max: ray.t_max.min(hit.distance), ..*ray };
    let limited: Vec<Ray> = rays.iter().zip(&*hits).map(limited).collect();
    let mut nearest = vec![Hit::MISS; rays.len()];
    closest_shapes::<L, S>(points, &limited, &mut nearest);
    for ((ray, nearest), hit) in rays.iter().zip(nearest).zip(hits) {
        if nearest.is_miss() {
            continue;
        }
        let Surfel { center, normal, radius, color } = points.surfel(nearest.slot);
        let position = ray.at(nearest.distance);
        let outward = match surface {
            SurfaceKind::Capsule => capsule::normal(position, center, normal, radius),
            SurfaceKind::Leaves => leaves::normal(position, center, normal, radius),
            _ => position - center,
        };
        let outward = outward.normalize_or(-ray.direction);
        *hit = SurfaceHit {
            distance: nearest.distance,
            id: points.id(nearest.slot),
            slot: nearest.slot,
            radius,
            normal: if outward.dot(ray.direction) < 0.0 { outward } else { -outward },
            color,
            surface,
            is_backface: surface != SurfaceKind::Leaves && 0.0 < outward.dot(ray.direction),
        };
    }
}

/// Marks the rays that the spheres, capsules or leaves of `points` occlude.
#[inline(always)]
fn merge_occlusions<L: Lanes, S: LeafGeometry<Tree = FlatPoints>>(
    points: &FlatPoints,
    rays: &[Ray],
    occluded: &mut [bool],
) {
    if points.nodes.is_empty() {
        return;
    }
    let open: Vec<usize> = (0..rays.len()).filter(|i| !occluded[*i]).collect();
    let rays: Vec<Ray> = open.iter().map(|i| rays[*i]).collect();
    let mut by_solids = vec![false; rays.len()];
    any_accepted_hit::<L, S, _>(points, &rays, AcceptAll, &mut by_solids);
    for (i, is_occluded) in open.into_iter().zip(by_solids) {
        occluded[i] = is_occluded;
    }
}

/// Traces the surface of moving least squares.
#[inline(always)]
fn trace_mls<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    let mut found = vec![MlsHit::MISS; rays.len()];
    mls_hits::<L, true>(cloud, rays, &mut found);
    for ((hit, ray), MlsHit { hit: nearest, radius, normal, color }) in
        hits.iter_mut().zip(rays).zip(found)
    {
        if !nearest.is_miss() {
            let radius = radius / cloud.radius_factor();
            *hit = surface_hit(cloud, ray, &nearest, radius, (normal, color));
        }
    }
}

/// Traces all rays together until each has a hit within the edge of the surface, or hits nothing more.
#[inline(always)]
fn splat_hits<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    hits.fill(SurfaceHit::MISS);
    let tests_edge = cloud.edge_test != EdgeTest::Off;
    if !tests_edge && !cloud.goes_through_holes() {
        let mut splats = vec![Splat::MISS; rays.len()];
        SplatTracer::new(cloud, cloud.surface, EdgeTest::Off).trace::<L>(rays, &mut splats);
        for ((hit, ray), splat) in hits.iter_mut().zip(rays).zip(&splats) {
            *hit = splat_hit(cloud, ray, splat);
        }
        return;
    }
    let mut searching: Vec<u32> = (0..rays.len() as u32).collect();
    let mut rays = rays.to_vec();
    let mut splats = vec![Splat::MISS; rays.len()];
    let mut tracer = SplatTracer::new(cloud, cloud.surface, cloud.edge_test);
    for _ in 0..MAX_REJECTED_HITS {
        let splats = &mut splats[..rays.len()];
        tracer.trace::<L>(&rays, splats);
        let mut n_left = 0;
        for i in 0..splats.len() {
            let (splat, ray, ray_idx) = (&splats[i], rays[i], searching[i]);
            if splat.hit.is_miss() {
                continue;
            }
            let found = splat_hit(cloud, &ray, splat);
            if splat.is_dense && (splat.is_enclosed || !tests_edge) {
                hits[ray_idx as usize] = found;
                continue;
            }
            let t_min = splat.restart.max(splat.hit.distance * (1.0 + 2.0 * f32::EPSILON));
            (rays[n_left], searching[n_left]) = (Ray { t_min, ..ray }, ray_idx);
            n_left += 1;
        }
        rays.truncate(n_left);
        if rays.is_empty() {
            return;
        }
    }
}

#[inline(always)]
fn splat_hit(cloud: &FlatCloud, ray: &Ray, splat: &Splat) -> SurfaceHit {
    if splat.hit.is_miss() {
        return SurfaceHit::MISS;
    }
    let hit = Hit { distance: splat.distance, slot: splat.hit.slot };
    let radius = splat.radius / cloud.radius_factor();
    surface_hit(cloud, ray, &hit, radius, (splat.normal, splat.color))
}

/// Returns the hit of a ray on the surface of a cloud, near the point of `hit`.
#[inline(always)]
fn surface_hit(
    cloud: &FlatCloud,
    ray: &Ray,
    hit: &Hit,
    radius: f32,
    (normal, color): (Vec3, Vec3),
) -> SurfaceHit {
    SurfaceHit {
        distance: hit.distance,
        id: cloud.points.id(hit.slot),
        slot: hit.slot,
        radius,
        normal,
        color,
        surface: cloud.surface,
        is_backface: 0.0 < cloud.points.normal(hit.slot).dot(ray.direction),
    }
}

#[cfg(test)]
mod tests {
    //! Planes fitted to points without normals lie on a sphere.

    use super::*;
    use crate::points::{PointCloud, Preparation, StructureChoice, prepare};
    use crate::progress::NoProgress;
    use crate::scene::CloudGeometry;

    fn evenly_spaced_sphere(n: usize) -> PointCloud {
        let position = |i: usize| {
            let height = 1.0 - (2 * i + 1) as f32 / n as f32;
            let (sin, cos) = (2.399_963_2 * i as f64).sin_cos();
            let across = (1.0 - height * height).sqrt();
            Vec3::new(across * cos as f32, across * sin as f32, height)
        };
        PointCloud::from_positions((0..n).map(position).collect())
    }

    #[test]
    fn planes_are_fitted_to_points_without_normals() {
        let (structure, estimates_normals) = (StructureChoice::Surface, false);
        let preparation = Preparation { structure, estimates_normals, ..Preparation::default() };
        let cloud = prepare(evenly_spaced_sphere(20_000), &preparation, &NoProgress).unwrap().0;
        let mut points = CloudGeometry::with_uniform_color(cloud, [188; 3]);
        points.surface = SurfaceKind::SplatFit;
        let flat = FlatCloud::new(&points, &NoProgress).unwrap();
        let coordinate = |i: usize| (i as f32 - 29.5) / 42.5;
        let origins = (0..3600).map(|i| Vec3::new(coordinate(i % 60), coordinate(i / 60), 5.0));
        // Up to 45 degrees from the normal.
        let origins = origins.filter(|origin| origin.truncate().length() < 0.7);
        let rays: Vec<Ray> = origins.map(|origin| Ray::new(origin, Vec3::NEG_Z)).collect();
        let mut hits = vec![SurfaceHit::MISS; rays.len()];
        surface_hits(&flat, Simd::detect(), &rays, &mut hits);
        let (mut depth, mut angle) = (0f32, 0f32);
        for (ray, hit) in rays.iter().zip(&hits) {
            let height = (1.0 - ray.origin.truncate().length_squared()).sqrt();
            depth = depth.max((hit.distance - (5.0 - height)).abs());
            angle = angle.max(hit.normal.angle_between(ray.origin.with_z(height)).to_degrees());
        }
        // The radius of a point is 0.05, over which the sphere bends by 3 degrees and 0.05^2 / 2.
        assert!(depth < 0.05 * 0.05 && angle < 4.0, "{depth} {angle}");
    }
}
