//! The distance between a surface of points and the mesh that the points were taken from.

use crate::ground_truth::{GroundTruth, GroundTruthHit};
use crate::scenes;
use rayon::prelude::*;
use surfel_core::flat::FlatCloud;
use surfel_core::math::{DVec3, Ray, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::scene::{Camera, Projection};
use surfel_core::surface::{EdgeTest, SurfaceKind};
use surfel_core::trace::{self, Simd, SurfaceHit};

/// Means over all pixels of several views.
#[derive(Clone, Copy, Debug, Default)]
pub struct Deviation {
    /// Pixels that show the points but not the mesh, as a fraction of those that show the mesh.
    pub false_hits: f64,
    /// Pixels that show the mesh but not the points, as a fraction of those that show the mesh.
    pub misses: f64,
    /// The mean angle between the normals where both are seen, in degrees.
    pub normal_deg: f64,
    /// The root mean square of the difference in depth where both are seen, in mean point spacings.
    pub depth_rms: f64,
}

/// The width and height of each view in pixels.
pub const RESOLUTION: u32 = 256;

/// Compares `cloud` with `mesh` in six views along the axes; `spacing` is the mean distance between points.
pub fn compare(
    cloud: &PointCloud,
    mesh: &GroundTruth,
    kind: SurfaceKind,
    edge_test: EdgeTest,
    spacing: f32,
) -> Deviation {
    let flat = FlatCloud { edge_test, ..scenes::flat(cloud.clone(), kind) };
    let mut counts = Counts::default();
    for camera in cameras(cloud) {
        let rays = pixel_rays(&camera, cloud.origin);
        let mut hits = vec![SurfaceHit::MISS; rays.len()];
        let chunks = rays.par_chunks(4096).zip(hits.par_chunks_mut(4096));
        chunks.for_each(|(rays, hits)| trace::surface_hits(&flat, Simd::detect(), rays, hits));
        let truths: Vec<_> = rays.par_iter().map(|ray| mesh.closest_hit(ray)).collect();
        for (hit, truth) in hits.iter().zip(&truths) {
            counts.add(hit, truth.as_ref());
        }
    }
    counts.deviation(spacing)
}

#[derive(Default)]
struct Counts {
    n_shape: f64,
    n_false: f64,
    n_missed: f64,
    n_both: f64,
    angles: f64,
    squares: f64,
}

impl Counts {
    fn add(&mut self, hit: &SurfaceHit, truth: Option<&GroundTruthHit>) {
        match (hit.is_miss(), truth) {
            (true, None) => {}
            (false, None) => self.n_false += 1.0,
            (true, Some(_)) => {
                self.n_shape += 1.0;
                self.n_missed += 1.0;
            }
            (false, Some(truth)) => {
                self.n_shape += 1.0;
                self.n_both += 1.0;
                self.angles += f64::from(hit.normal.angle_between(truth.normal));
                self.squares += f64::from(hit.distance - truth.distance).powi(2);
            }
        }
    }

    fn deviation(&self, spacing: f32) -> Deviation {
        Deviation {
            false_hits: self.n_false / self.n_shape,
            misses: self.n_missed / self.n_shape,
            normal_deg: (self.angles / self.n_both).to_degrees(),
            depth_rms: (self.squares / self.n_both).sqrt() / f64::from(spacing),
        }
    }
}

/// Returns cameras on the six axes that see the whole cloud.
fn cameras(cloud: &PointCloud) -> Vec<Camera> {
    let bounds = cloud.bounds();
    let center = cloud.origin + bounds.center().as_dvec3();
    let directions = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    directions
        .map(|direction| Camera {
            position: center + 2.0 * f64::from(bounds.diagonal()) * direction.as_dvec3(),
            focal_point: center,
            view_up: if direction.y == 0.0 { DVec3::Y } else { DVec3::Z },
            projection: Projection::Perspective { view_angle_deg: 25.0 },
        })
        .to_vec()
}

fn pixel_rays(camera: &Camera, origin: DVec3) -> Vec<Ray> {
    let view = camera.view(origin, RESOLUTION, RESOLUTION);
    let pixels = (0..RESOLUTION * RESOLUTION).map(|i| (i % RESOLUTION, i / RESOLUTION));
    pixels.map(|(x, y)| view.ray(x as f32 + 0.5, y as f32 + 0.5)).collect()
}
