//! Rays against a scene for as long as somebody waits for them.

use super::Simd;
use super::world::{SceneHit, Which, scene_hits, scene_occlusions};
use crate::error::Result;
use crate::flat::FlatScene;
use crate::math::{Ray, WIDE};
use crate::progress::Progress;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Traces a job's rays in pieces, between which it asks whether to go on: a ray among points that lie
/// thousands over each other takes milliseconds. All threads of the job share one.
pub struct Tracer<'a> {
    pub scene: &'a FlatScene,
    pub simd: Simd,
    pub progress: &'a dyn Progress,
    /// Rays so far, by all threads.
    n_traced: AtomicUsize,
    /// As many rays as take a `MOMENT`, judged by the last piece of any thread.
    n_affordable: AtomicUsize,
}

/// Most rays of a piece: more would win nothing.
const MOST: usize = 1 << 14;
/// A piece is at most such a share of all that was traced before: first rays may see nothing but the sky.
const SHARE: usize = 16;
/// Work may go on for so long without asking.
const MOMENT: Duration = Duration::from_millis(5);

impl<'a> Tracer<'a> {
    pub fn new(scene: &'a FlatScene, simd: Simd, progress: &'a dyn Progress) -> Self {
        let (n_traced, n_affordable) = (AtomicUsize::new(0), AtomicUsize::new(MOST));
        Self { scene, simd, progress, n_traced, n_affordable }
    }

    /// As [`scene_hits`].
    pub fn hits(&self, which: Which, rays: &[Ray], hits: &mut [SceneHit]) -> Result<()> {
        self.in_pieces(rays.len(), |piece| {
            scene_hits(self.scene, self.simd, which, &rays[piece.clone()], &mut hits[piece]);
        })
    }

    /// As [`scene_occlusions`].
    pub fn occlusions(&self, which: Which, rays: &[Ray], occluded: &mut [bool]) -> Result<()> {
        self.in_pieces(rays.len(), |piece| {
            let occluded = &mut occluded[piece.clone()];
            scene_occlusions(self.scene, self.simd, which, &rays[piece], occluded);
        })
    }

    fn in_pieces(&self, n_rays: usize, mut trace: impl FnMut(Range<usize>)) -> Result<()> {
        let mut first = 0;
        while first < n_rays {
            self.progress.check()?;
            let end = n_rays.min(first + self.n_at_once());
            let start = Instant::now();
            trace(first..end);
            self.learn(end - first, start.elapsed());
            first = end;
        }
        Ok(())
    }

    /// Whole packets of rays for the next piece.
    fn n_at_once(&self) -> usize {
        let n_bold = WIDE.max(self.n_traced.load(Ordering::Relaxed) / SHARE);
        let n_affordable = self.n_affordable.load(Ordering::Relaxed);
        n_bold.min(n_affordable).next_multiple_of(WIDE)
    }

    fn learn(&self, n_rays: usize, time: Duration) {
        let n_affordable = n_rays as f64 * MOMENT.as_secs_f64() / time.as_secs_f64().max(1e-9);
        self.n_affordable.store((n_affordable as usize).clamp(1, MOST), Ordering::Relaxed);
        self.n_traced.fetch_add(n_rays, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::math::DVec3;
    use crate::progress::Silent;
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
        FlatScene::new(&Scene { graph, lights: Vec::new(), background, camera }, &Silent).unwrap()
    }

    /// Pieces of so many rays, each ray of which takes so long.
    fn pieces(tracer: &Tracer, n_rays: usize, per_ray: Duration) -> Vec<usize> {
        let sizes = RefCell::new(Vec::new());
        let work = |piece: Range<usize>| {
            std::thread::sleep(per_ray * piece.len() as u32);
            sizes.borrow_mut().push(piece.len());
        };
        tracer.in_pieces(n_rays, work).unwrap();
        sizes.into_inner()
    }

    #[test]
    fn pieces_grow_while_rays_are_quick_and_shrink_when_they_are_slow() {
        let scene = empty();
        let tracer = Tracer::new(&scene, Simd::detect(), &Silent);
        let quick = pieces(&tracer, 400_000, Duration::ZERO);
        assert_eq!((quick[0], quick.iter().sum()), (WIDE, 400_000));
        assert!(quick.iter().all(|n| *n <= MOST) && 4096 <= *quick.iter().max().unwrap());
        pieces(&tracer, 100, Duration::from_millis(2));
        assert_eq!(pieces(&tracer, 56, Duration::from_millis(2)), [WIDE, WIDE, WIDE, 8]);
    }

    #[test]
    fn rays_that_nobody_waits_for_are_not_traced() {
        struct Gone;
        impl Progress for Gone {
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        let scene = empty();
        let tracer = Tracer::new(&scene, Simd::detect(), &Gone);
        let stopped = tracer.in_pieces(100, |_| panic!("nobody waits"));
        assert!(matches!(stopped, Err(Error::Cancelled)));
    }
}
