//! The distance between a surface of points and the mesh that the points were taken from.

use crate::ground_truth::{GroundTruth, GroundTruthHit};
use rayon::prelude::*;
use surfel_core::flat::FlatCloud;
use surfel_core::math::{DVec3, Ray};
use surfel_core::scene::{Camera, Projection};
use surfel_core::trace::{self, Simd, SurfaceHit};

/// Views of a mesh: the rays of their pixels and what these hit.
pub struct TrueViews {
    rays: Vec<Ray>,
    hits: Vec<Option<GroundTruthHit>>,
}

/// Figures over all pixels of all views.
#[derive(Clone, Copy, Debug, Default)]
pub struct Deviation {
    /// Pixels that show the points but not the mesh, as a fraction of those that do not show the mesh.
    pub false_hits: f64,
    /// Pixels that show the mesh but not the points, as a fraction of those that show the mesh.
    pub misses: f64,
    /// The root mean square of the difference in distance along the ray where both are seen, in mean point spacings,
    /// without pixels that are far off.
    pub depth_rms: f64,
    /// Pixels whose distances differ by more than [`MAX_DEPTH_SPACINGS`] spacings, as a fraction of those that show both.
    pub far_off: f64,
    /// The mean angle between the normals where both are seen, in degrees.
    pub normal_deg: f64,
    /// The angle between the normals that 95 % of the pixels which show both stay below, in degrees.
    pub normal_p95_deg: f64,
}

/// Mean point spacings beyond which a pixel shows another part of the surface.
pub const MAX_DEPTH_SPACINGS: f64 = 5.0;

impl TrueViews {
    /// Traces four views of a mesh, each `resolution` pixels wide and high.
    pub fn new(mesh: &GroundTruth, resolution: u32) -> Self {
        let rays: Vec<Ray> =
            cameras(mesh).iter().flat_map(|camera| pixel_rays(camera, resolution)).collect();
        let hits = rays.par_iter().map(|ray| mesh.closest_hit(ray)).collect();
        Self { rays, hits }
    }

    /// Traces a cloud in the same views. Positions of the cloud are relative to the origin of the mesh.
    pub fn trace(&self, cloud: &FlatCloud) -> Vec<SurfaceHit> {
        let mut hits = vec![SurfaceHit::MISS; self.rays.len()];
        let chunks = self.rays.par_chunks(4096).zip(hits.par_chunks_mut(4096));
        chunks.for_each(|(rays, hits)| trace::surface_hits(cloud, Simd::detect(), rays, hits));
        hits
    }

    /// Traces another mesh in the same views.
    pub fn trace_mesh(&self, mesh: &GroundTruth) -> Vec<SurfaceHit> {
        let hit = |ray: &Ray| surface_hit(mesh.closest_hit(ray));
        self.rays.par_iter().map(hit).collect()
    }

    /// Compares the hits of a cloud with those of the mesh; `spacing` is the mean distance between points.
    pub fn compare(&self, hits: &[SurfaceHit], spacing: f32) -> Deviation {
        let (mut n_shape, mut n_false) = (0, 0);
        let mut errors = Vec::new();
        for (hit, truth) in hits.iter().zip(&self.hits) {
            n_shape += usize::from(truth.is_some());
            n_false += usize::from(truth.is_none() && !hit.is_miss());
            if let Some(truth) = truth.filter(|_| !hit.is_miss()) {
                let depth = f64::from(hit.distance - truth.distance) / f64::from(spacing);
                errors.push((depth, hit.normal.angle_between(truth.normal)));
            }
        }
        let fraction = |count: usize, total: usize| count as f64 / total as f64;
        let is_near = |depth: &f64| depth.abs() <= MAX_DEPTH_SPACINGS;
        let near = || errors.iter().map(|(depth, _)| *depth).filter(is_near);
        let n_near = near().count();
        let squares: f64 = near().map(|depth| depth * depth).sum();
        let mut angles: Vec<f32> = errors.iter().map(|(_, angle)| *angle).collect();
        let sum: f64 = angles.iter().copied().map(f64::from).sum();
        Deviation {
            false_hits: fraction(n_false, hits.len() - n_shape),
            misses: fraction(n_shape - errors.len(), n_shape),
            depth_rms: (squares / n_near as f64).sqrt(),
            far_off: fraction(errors.len() - n_near, errors.len()),
            normal_deg: (sum / errors.len() as f64).to_degrees(),
            normal_p95_deg: percentile_95(&mut angles).to_degrees(),
        }
    }
}

/// Returns the hit of a triangle as that of a surface of points.
fn surface_hit(hit: Option<GroundTruthHit>) -> SurfaceHit {
    hit.map_or(SurfaceHit::MISS, |GroundTruthHit { distance, normal }| SurfaceHit {
        distance,
        normal,
        id: 0,
        ..SurfaceHit::MISS
    })
}

fn percentile_95(values: &mut [f32]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let index = 95 * (values.len() - 1) / 100;
    f64::from(*values.select_nth_unstable_by(index, f32::total_cmp).1)
}

/// Returns cameras around the mesh that see all of it, one from each quarter at heights of their own.
pub(crate) fn cameras(mesh: &GroundTruth) -> [Camera; 4] {
    let bounds = mesh.bounds();
    let center = bounds.center().as_dvec3();
    let distance = 2.4 * f64::from(bounds.diagonal());
    let directions = [(-70.0, 12.0), (20.0, 38.0), (110.0, -8.0), (200.0, 20.0)];
    directions.map(|(azimuth, elevation): (f64, f64)| {
        let (sin, cos) = azimuth.to_radians().sin_cos();
        let (rise, run) = elevation.to_radians().sin_cos();
        Camera {
            position: center + distance * DVec3::new(run * cos, run * sin, rise),
            focal_point: center,
            view_up: DVec3::Z,
            projection: Projection::Perspective { view_angle_deg: 24.0 },
        }
    })
}

fn pixel_rays(camera: &Camera, resolution: u32) -> Vec<Ray> {
    let view = camera.view(DVec3::ZERO, resolution, resolution);
    let pixels = (0..resolution * resolution).map(|i| (i % resolution, i / resolution));
    pixels.map(|(x, y)| view.ray(x as f32 + 0.5, y as f32 + 0.5)).collect()
}

#[cfg(test)]
mod tests {
    //! Figures of hits that differ from the mesh by known amounts.

    use super::*;
    use crate::shapes;
    use surfel_core::math::Vec3;

    fn views() -> TrueViews {
        TrueViews::new(&GroundTruth::from_mesh(&shapes::cube()), 32)
    }

    fn true_hits(views: &TrueViews) -> Vec<SurfaceHit> {
        views.hits.iter().copied().map(surface_hit).collect()
    }

    #[test]
    fn the_mesh_deviates_nowhere_from_itself() {
        let views = views();
        let figures = views.compare(&true_hits(&views), 0.1);
        let Deviation { false_hits, misses, depth_rms, far_off, .. } = figures;
        assert_eq!([false_hits, misses, depth_rms, far_off], [0.0; 4]);
        assert!(figures.normal_p95_deg < 0.1, "{figures:?}");
    }

    #[test]
    fn a_smooth_mesh_differs_from_the_flat_one_in_its_normals_alone() {
        let mut mesh = shapes::low_poly_blob();
        let views = TrueViews::new(&GroundTruth::from_mesh(&mesh), 32);
        mesh.smooth_normals();
        let hits = views.trace_mesh(&GroundTruth::from_smooth_mesh(&mesh));
        let figures = views.compare(&hits, 0.1);
        let Deviation { false_hits, misses, depth_rms, normal_deg, .. } = figures;
        assert_eq!([false_hits, misses, depth_rms], [0.0; 3]);
        assert!((1.0..10.0).contains(&normal_deg), "{figures:?}");
    }

    #[test]
    fn depths_are_measured_in_spacings_and_far_ones_are_counted() {
        let views = views();
        let mut hits = true_hits(&views);
        let n_hits = hits.iter().filter(|hit| !hit.is_miss()).count();
        hits.iter_mut().for_each(|hit| hit.distance += 0.2);
        let first = hits.iter_mut().find(|hit| !hit.is_miss()).unwrap();
        first.distance += 1.0;
        let figures = views.compare(&hits, 0.1);
        assert!((figures.depth_rms - 2.0).abs() < 1e-3, "{figures:?}");
        assert_eq!(figures.far_off, 1.0 / n_hits as f64);
    }

    #[test]
    fn false_hits_are_a_fraction_of_the_background_and_misses_of_the_shape() {
        let views = views();
        let mut hits = true_hits(&views);
        let n_hits = hits.iter().filter(|hit| !hit.is_miss()).count() as f64;
        let n_background = hits.len() as f64 - n_hits;
        hits.iter_mut()
            .filter(|hit| !hit.is_miss())
            .take(2)
            .for_each(|hit| *hit = SurfaceHit::MISS);
        let false_hit = SurfaceHit { distance: 1.0, normal: Vec3::Z, id: 0, ..SurfaceHit::MISS };
        // The first pixel of a view shows the background.
        hits[0] = false_hit;
        let figures = views.compare(&hits, 0.1);
        assert_eq!((figures.false_hits, figures.misses), (1.0 / n_background, 2.0 / n_hits));
    }
}
