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
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Traces the rays of a job in chunks, between which it checks for cancellation: a ray among points that lie
/// thousands over each other takes milliseconds. All threads of the job share one tracer.
pub struct Tracer<'a> {
    /// The scene.
    pub scene: &'a FlatScene,
    /// The SIMD level of all kernels.
    pub simd: Simd,
    /// Cancels the job.
    pub progress: &'a dyn Progress,
    /// The size of a pixel along rays from the camera.
    pub pixel: PixelSize,
    /// Number of rays traced so far by all threads.
    n_traced: AtomicUsize,
    /// Number of rays that take `MAX_CHUNK_TIME`, estimated from the last chunk of any thread.
    n_affordable: AtomicUsize,
}

/// Maximum number of rays in a chunk: more are not faster.
const MAX_CHUNK_SIZE: usize = 1 << 14;
/// A chunk holds at most the rays traced before, divided by this: the first rays may see nothing but the sky.
const RAMP_UP_DIVISOR: usize = 16;
/// Maximum time between two checks for cancellation.
const MAX_CHUNK_TIME: Duration = Duration::from_millis(5);

impl<'a> Tracer<'a> {
    /// Returns the tracer of a job.
    pub fn new(
        scene: &'a FlatScene,
        simd: Simd,
        pixel: PixelSize,
        progress: &'a dyn Progress,
    ) -> Self {
        let (n_traced, n_affordable) = (AtomicUsize::new(0), AtomicUsize::new(MAX_CHUNK_SIZE));
        Self { scene, simd, progress, pixel, n_traced, n_affordable }
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
        let mut first = 0;
        while first < n_rays {
            self.progress.check()?;
            let end = n_rays.min(first + self.chunk_size());
            let start = Instant::now();
            trace(first..end);
            self.update_rate(end - first, start.elapsed());
            first = end;
        }
        Ok(())
    }

    /// Returns the size of the next chunk, in whole packets.
    fn chunk_size(&self) -> usize {
        let ramp_up_limit =
            PACKET_WIDTH.max(self.n_traced.load(Ordering::Relaxed) / RAMP_UP_DIVISOR);
        let n_affordable = self.n_affordable.load(Ordering::Relaxed);
        ramp_up_limit.min(n_affordable).next_multiple_of(PACKET_WIDTH)
    }

    /// Updates the number of rays that a chunk can afford.
    fn update_rate(&self, n_rays: usize, time: Duration) {
        let n_affordable =
            n_rays as f64 * MAX_CHUNK_TIME.as_secs_f64() / time.as_secs_f64().max(1e-9);
        self.n_affordable
            .store((n_affordable as usize).clamp(1, MAX_CHUNK_SIZE), Ordering::Relaxed);
        self.n_traced.fetch_add(n_rays, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    //! Chunks adapt to the speed of rays, and cancelled jobs stop.

    use super::*;
    use crate::error::Error;
    use crate::math::DVec3;
    use crate::progress::NoProgress;
    use crate::scene::{Background, Camera, Graph, Projection, Scene};
    use std::cell::RefCell;

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

    /// Returns the sizes of the chunks of `n_rays` that take `per_ray` each.
    fn chunk_sizes(tracer: &Tracer, n_rays: usize, per_ray: Duration) -> Vec<usize> {
        let sizes = RefCell::new(Vec::new());
        let work = |chunk: Range<usize>| {
            std::thread::sleep(per_ray * chunk.len() as u32);
            sizes.borrow_mut().push(chunk.len());
        };
        tracer.in_chunks(n_rays, work).unwrap();
        sizes.into_inner()
    }

    #[test]
    fn chunks_grow_while_rays_are_fast_and_shrink_while_they_are_slow() {
        let scene = empty();
        let tracer = Tracer::new(&scene, Simd::detect(), PixelSize::ZERO, &NoProgress);
        let fast = chunk_sizes(&tracer, 400_000, Duration::ZERO);
        assert_eq!((fast[0], fast.iter().sum()), (PACKET_WIDTH, 400_000));
        assert!(fast.iter().all(|n| *n <= MAX_CHUNK_SIZE) && 4096 <= *fast.iter().max().unwrap());
        chunk_sizes(&tracer, 100, Duration::from_millis(2));
        assert_eq!(
            chunk_sizes(&tracer, 56, Duration::from_millis(2)),
            [PACKET_WIDTH, PACKET_WIDTH, PACKET_WIDTH, 8]
        );
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
