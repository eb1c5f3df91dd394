//! The light of Gaussians along rays: the nearest are composited front to back, then the next, until hardly any light
//! would pass (Moenne-Loccoz et al., 3D Gaussian Ray Tracing, 2024).

use crate::flat::{FlatGaussians, Instance};
use crate::image::decode_srgb;
use crate::math::{Ray, Vec3};
use crate::points::MAX_HARMONICS;
use crate::surface::gaussian::{MIN_GAUSSIAN_TRANSMITTANCE, alpha, spherical_harmonics};
use crate::trace::query::gaussian_buffer::{GaussianBuffer, GaussianHit};
use crate::trace::query::gaussian_query::{GaussianSearch, search_gaussians};
use crate::trace::simd::Simd;
use crate::trace::traversal::interleaved::RayPool;

/// The light that Gaussians add along a ray, and what they let pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianLight {
    /// Colour in the sRGB encoding in which Gaussians are trained and composited, premultiplied by alpha.
    encoded: Vec3,
    /// Fraction of the light from behind that passes.
    pub transmittance: f32,
    /// The Gaussian at which half of the light or less passes for the first time, if there is one.
    pub median: Option<GaussianHit>,
    /// The first Gaussian that the ray passes.
    first: Option<GaussianHit>,
}

impl GaussianLight {
    /// The light of a ray that passes no Gaussian.
    pub const NONE: Self =
        Self { encoded: Vec3::ZERO, transmittance: 1.0, median: None, first: None };

    /// Returns the colour without the part of the light that passes, linear.
    pub fn color(&self) -> Vec3 {
        let alpha = 1.0 - self.transmittance;
        if alpha <= 0.0 { Vec3::ZERO } else { (self.encoded / alpha).map(decode_srgb) }
    }

    /// Returns the radiance, linear. It is the colour times alpha: in front of a black background a viewer that
    /// composites encoded values shows the same wherever the Gaussians are opaque.
    pub fn radiance(&self) -> Vec3 {
        (1.0 - self.transmittance) * self.color()
    }

    /// Returns the distance at which half of the light or less passes, or that of the first Gaussian if more passes all of
    /// them; none if the ray passes none.
    pub fn distance(&self) -> Option<f32> {
        self.median.or(self.first).map(|hit| hit.distance)
    }

    /// Takes the layers that are there for all: no light passes, and the color stays.
    fn close(&mut self) {
        self.encoded /= 1.0 - self.transmittance;
        self.transmittance = 0.0;
    }

    /// Adds a layer behind those that are there.
    #[inline]
    fn add(&mut self, alpha: f32, encoded: Vec3, hit: &GaussianHit) {
        self.first.get_or_insert(*hit);
        self.encoded += self.transmittance * alpha * encoded;
        self.transmittance *= 1.0 - alpha;
        if self.median.is_none() && self.transmittance <= 0.5 {
            self.median = Some(*hit);
        }
    }
}

/// A cloud of Gaussians at its place in the scene.
#[derive(Clone, Copy)]
pub struct PlacedGaussians<'s> {
    /// The Gaussians.
    pub gaussians: &'s FlatGaussians,
    /// Their instance; none if world space is the space of the cloud.
    pub instance: Option<&'s Instance>,
}

impl PlacedGaussians<'_> {
    /// Returns a ray in the coordinates of the cloud, and the factor by which distances along it grow.
    #[inline]
    fn object_ray(&self, ray: &Ray) -> (Ray, f32) {
        self.instance.map_or((*ray, 1.0), |instance| instance.object_ray(ray))
    }
}

/// Number of rays whose buffers stay in the cache.
const CHUNK_SIZE: usize = 256;

/// Computes the light of all Gaussians along each ray, up to its `t_max`. `enters` returns true if a ray enters the box of
/// a cloud before a distance.
pub fn gaussian_light(
    clouds: &[PlacedGaussians],
    simd: Simd,
    enters: impl Fn(usize, &Ray, f32) -> bool,
    rays: &[Ray],
    lights: &mut [GaussianLight],
) {
    lights.fill(GaussianLight::NONE);
    let mut pool = RayPool::default();
    for (rays, lights) in rays.chunks(CHUNK_SIZE).zip(lights.chunks_mut(CHUNK_SIZE)) {
        let mut searches: Vec<GaussianSearch> =
            rays.iter().enumerate().map(|(i, ray)| GaussianSearch::new(i, ray)).collect();
        while !searches.is_empty() {
            for (cloud_idx, cloud) in clouds.iter().enumerate() {
                for search in &mut searches {
                    let ray = &rays[search.ray_idx];
                    let enters = enters(cloud_idx, ray, search.buffer.bound());
                    let (ray, scale) = cloud.object_ray(ray);
                    search.enter(cloud_idx as u32, enters, ray, scale);
                }
                search_gaussians(cloud.gaussians, simd, &mut pool, &mut searches);
            }
            searches.retain_mut(|search| {
                let (ray, light) = (&rays[search.ray_idx], &mut lights[search.ray_idx]);
                composite(search, clouds, ray, light)
            });
        }
    }
}

/// Composites the hits that a search has found and empties its buffer. Returns true if more may follow.
fn composite(
    search: &mut GaussianSearch,
    clouds: &[PlacedGaussians],
    ray: &Ray,
    light: &mut GaussianLight,
) -> bool {
    let mut harmonics: Option<(u32, [f32; MAX_HARMONICS])> = None;
    for hit in search.buffer.hits() {
        let cloud = &clouds[hit.cloud_idx as usize];
        let known = harmonics.filter(|(cloud_idx, _)| *cloud_idx == hit.cloud_idx);
        let (_, along) = *harmonics.insert(known.unwrap_or_else(|| {
            (hit.cloud_idx, spherical_harmonics(cloud.object_ray(ray).0.direction))
        }));
        let max_squared = cloud.gaussians.max_squared(hit.slot);
        let color = cloud.gaussians.color_along(hit.slot, &along);
        light.add(alpha(max_squared, hit.squared), color, hit);
        if light.transmittance < MIN_GAUSSIAN_TRANSMITTANCE {
            light.close();
            return false;
        }
    }
    let is_full = search.buffer.is_full();
    if let Some(last) = search.buffer.hits().last() {
        search.after = *last;
    }
    search.buffer = GaussianBuffer::EMPTY;
    is_full
}
