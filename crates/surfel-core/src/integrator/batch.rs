//! The trait of all integrators, the batch of camera rays that it takes, and the counts of rays traced.

use crate::error::Result;
use crate::math::{Ray, Vec4};
use crate::trace::{SceneHit, Tracer};

/// A method that computes the radiance along camera rays.
pub trait Integrator: Sync {
    /// Returns the radiance along each camera ray of `batch`, and the number of rays traced.
    ///
    /// Colours are linear and premultiplied by alpha, the part of the background that the scene hides.
    ///
    /// # Errors
    ///
    /// Fails with [`Error::Cancelled`](crate::Error::Cancelled) once the work is cancelled.
    fn radiance(&self, batch: &CameraRayBatch) -> Result<(Vec<Vec4>, RayCounts)>;
}

/// A batch of camera rays and their nearest hits.
#[derive(Clone, Copy)]
pub struct CameraRayBatch<'a> {
    /// Traces all further rays.
    pub tracer: &'a Tracer<'a>,
    /// The camera rays, relative to the scene's origin.
    pub rays: &'a [Ray],
    /// The nearest hit of each ray.
    pub hits: &'a [SceneHit],
    /// The pixel sample that each ray stands for.
    pub samples: PixelSamples<'a>,
}

impl CameraRayBatch<'_> {
    /// Splits the batch into parts of `n_rays` rays, the last of which may have fewer.
    pub(super) fn parts(&self, n_rays: usize) -> impl Iterator<Item = Self> {
        let Self { tracer, rays, hits, samples } = *self;
        (0..rays.len()).step_by(n_rays).map(move |first| {
            let part = first..rays.len().min(first + n_rays);
            let samples = PixelSamples {
                keys: &samples.keys[part.clone()],
                indices: &samples.indices[part.clone()],
                background: &samples.background[part.clone()],
                ..samples
            };
            Self { tracer, rays: &rays[part.clone()], hits: &hits[part], samples }
        })
    }
}

/// The pixel samples that the rays of a batch stand for.
#[derive(Clone, Copy, Debug)]
pub struct PixelSamples<'a> {
    /// Random key of each ray's pixel.
    pub keys: &'a [u64],
    /// Index of each ray among the samples of its pixel.
    pub indices: &'a [u32],
    /// Background in each ray's pixel: linear colour and alpha.
    pub background: &'a [Vec4],
    /// Number of rays toward each extended light from each hit.
    pub n_light_samples: u32,
}

/// Numbers of rays traced, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// Camera rays.
    pub primary: u64,
    /// Rays toward suns and punctual lights.
    pub shadow: u64,
    /// Rays toward the sky and environments.
    pub sky: u64,
    /// Reflected and refracted rays, and rays that continue behind an alpha-blended layer.
    pub secondary: u64,
}

impl RayCounts {
    /// Returns the number of rays of all kinds.
    pub fn total(&self) -> u64 {
        self.primary + self.shadow + self.sky + self.secondary
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.shadow += other.shadow;
        self.sky += other.sky;
        self.secondary += other.secondary;
    }
}
