//! Rays against a scene, traced in chunks between which the job can be cancelled.

use crate::error::Result;
use crate::flat::FlatScene;
use crate::math::{PACKET_WIDTH, Ray};
use crate::progress::Progress;
use crate::trace::query::gaussian_light::GaussianLight;
use crate::trace::query::support::Support;
use crate::trace::scene::instance_filter::InstanceFilter;
use crate::trace::scene::scene_gaussians::scene_gaussians;
use crate::trace::scene::scene_hit::SceneHit;
use crate::trace::scene::scene_query::{scene_hits_at, scene_occlusions};
use crate::trace::scene::scene_support::scene_supports;
use crate::trace::simd::Simd;
use crate::trace::traversal::octree_walk::PixelSize;
use std::ops::Range;
use std::time::{Duration, Instant};

/// Traces the rays of a job in chunks, between which it checks for cancellation: a ray among points that lie
/// thousands over each other takes milliseconds.
pub struct Tracer<'a> {
    /// The scene.
    pub scene: &'a FlatScene,
    /// The SIMD level of all kernels.
    pub simd: Simd,
    /// Cancels the job.
    pub progress: &'a dyn Progress,
    /// The size of a pixel along rays from the camera.
    pub pixel: PixelSize,
}

/// Number of rays in the first chunk of a batch.
const FIRST_CHUNK_SIZE: usize = 1 << 9;
/// Maximum number of rays in a chunk: those behind fast ones may be slow. Half as many make pictures 2 % slower.
const MAX_CHUNK_SIZE: usize = 1 << 11;
/// Time of a chunk from which on the next one is smaller.
const MAX_CHUNK_TIME: Duration = Duration::from_millis(5);

impl<'a> Tracer<'a> {
    /// Returns the tracer of a job.
    pub fn new(
        scene: &'a FlatScene,
        simd: Simd,
        pixel: PixelSize,
        progress: &'a dyn Progress,
    ) -> Self {
        Self { scene, simd, progress, pixel }
    }

    /// Runs [`scene_hits`](super::scene_hits) at the size of a pixel.
    ///
    /// # Errors
    ///
    /// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` cancels the job.
    pub fn hits(&self, filter: InstanceFilter, rays: &[Ray], hits: &mut [SceneHit]) -> Result<()> {
        self.in_chunks(rays.len(), |chunk| {
            let (rays, hits) = (&rays[chunk.clone()], &mut hits[chunk]);
            scene_hits_at(self.scene, self.simd, filter, self.pixel, rays, hits);
        })
    }

    /// Runs [`scene_supports`] for hits that [`Tracer::hits`] found.
    ///
    /// # Errors
    ///
    /// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` cancels the job.
    pub fn supports(&self, rays: &[Ray], hits: &[SceneHit]) -> Result<Vec<Support>> {
        let mut supports = vec![Support::NONE; rays.len()];
        self.in_chunks(rays.len(), |chunk| {
            let (rays, hits) = (&rays[chunk.clone()], &hits[chunk.clone()]);
            scene_supports(self.scene, self.simd, rays, hits, &mut supports[chunk]);
        })?;
        Ok(supports)
    }

    /// Runs [`scene_gaussians`](super::scene_gaussians) for rays up to their hits on surfaces.
    ///
    /// # Errors
    ///
    /// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` cancels the job.
    pub fn gaussians(&self, rays: &[Ray], hits: &[SceneHit]) -> Result<Vec<GaussianLight>> {
        let up_to_hit =
            |(ray, hit): (&Ray, &SceneHit)| Ray { t_max: ray.t_max.min(hit.distance), ..*ray };
        let rays: Vec<Ray> = rays.iter().zip(hits).map(up_to_hit).collect();
        self.gaussians_along(&rays)
    }

    /// Runs [`scene_gaussians`](super::scene_gaussians) for rays up to their ends.
    ///
    /// # Errors
    ///
    /// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` cancels the job.
    pub fn gaussians_along(&self, rays: &[Ray]) -> Result<Vec<GaussianLight>> {
        let mut lights = vec![GaussianLight::NONE; rays.len()];
        self.in_chunks(rays.len(), |chunk| {
            scene_gaussians(self.scene, self.simd, &rays[chunk.clone()], &mut lights[chunk]);
        })?;
        Ok(lights)
    }

    /// Runs [`scene_occlusions`].
    ///
    /// # Errors
    ///
    /// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` cancels the job.
    pub fn occlusions(
        &self,
        filter: InstanceFilter,
        rays: &[Ray],
        occluded: &mut [bool],
    ) -> Result<()> {
        self.in_chunks(rays.len(), |chunk| {
            let occluded = &mut occluded[chunk.clone()];
            scene_occlusions(self.scene, self.simd, filter, &rays[chunk], occluded);
        })
    }

    /// Calls `trace` for consecutive ranges of rays.
    fn in_chunks(&self, n_rays: usize, mut trace: impl FnMut(Range<usize>)) -> Result<()> {
        let (mut first, mut size) = (0, FIRST_CHUNK_SIZE);
        while first < n_rays {
            self.progress.check()?;
            let end = n_rays.min(first + size);
            let start = Instant::now();
            trace(first..end);
            size = next_size(end - first, start.elapsed());
            first = end;
        }
        Ok(())
    }
}

/// Returns the size of the chunk behind one of `n_rays` that took a time, in whole packets.
fn next_size(n_rays: usize, time: Duration) -> usize {
    let n_affordable = n_rays as f64 * MAX_CHUNK_TIME.as_secs_f64() / time.as_secs_f64().max(1e-9);
    (n_affordable as usize).min(2 * n_rays).clamp(1, MAX_CHUNK_SIZE).next_multiple_of(PACKET_WIDTH)
}

#[cfg(test)]
mod tests {
    //! Chunks adapt to the speed of rays, and cancelled jobs stop.

    use super::*;
    use crate::error::Error;
    use crate::math::DVec3;
    use crate::progress::NoProgress;
    use crate::scene::{Background, Camera, Graph, Projection, Scene};

    fn empty() -> FlatScene {
        let camera = Camera {
            position: DVec3::ZERO,
            focal_point: DVec3::Y,
            view_up: DVec3::Z,
            projection: Projection::Panorama,
        };
        let (graph, background) = (Graph::default(), Background::Transparent);
        FlatScene::new(&Scene { graph, lights: Vec::new(), background, camera }, &NoProgress)
            .unwrap()
    }

    #[test]
    fn chunks_grow_while_rays_are_fast_and_shrink_while_they_are_slow() {
        let size = |n_rays, per_ray_us| {
            next_size(n_rays, Duration::from_micros(per_ray_us) * n_rays as u32)
        };
        assert_eq!([512, 1024, 2048].map(|n_rays| size(n_rays, 0)), [1024, 2048, 2048]);
        assert_eq!([512, 2048].map(|n_rays| size(n_rays, 5)), [1008, 1008]);
        assert_eq!(size(512, 1000), PACKET_WIDTH);
    }

    #[test]
    fn chunks_cover_all_rays() {
        let scene = empty();
        let tracer = Tracer::new(&scene, Simd::detect(), PixelSize::ZERO, &NoProgress);
        let mut end = 0;
        let work = |chunk: Range<usize>| {
            assert!(chunk.start == end && chunk.len() <= MAX_CHUNK_SIZE);
            end = chunk.end;
        };
        tracer.in_chunks(4000, work).unwrap();
        assert_eq!(end, 4000);
    }

    #[test]
    fn cancelled_jobs_trace_no_rays() {
        struct CancelledJob;
        impl Progress for CancelledJob {
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        let scene = empty();
        let tracer = Tracer::new(&scene, Simd::detect(), PixelSize::ZERO, &CancelledJob);
        let stopped = tracer.in_chunks(100, |_| panic!("the job is cancelled"));
        assert!(matches!(stopped, Err(Error::Cancelled)));
    }
}
