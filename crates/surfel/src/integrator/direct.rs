//! Direct light: sun with shadows, sky with occlusion, headlight, on matte surfaces.

use crate::error::Result;
use crate::flat::FlatScene;
use crate::math::{Frame, Ray, Vec3, cosine_hemisphere, hash, scrambled_pair, uniform_cone};
use crate::progress::Progress;
use crate::scene::{Light, Material, Sky, Sun};
use crate::trace::{self, Simd, SurfaceHit};

/// Which of its pixel's samples each ray of a batch is.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// Random key of each ray's pixel.
    pub keys: &'a [u64],
    /// Number of each ray among its pixel's.
    pub indices: &'a [u32],
    /// Rays toward each extended light from each hit.
    pub n_light: u32,
}

/// Rays traced, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    pub primary: u64,
    pub shadow: u64,
    pub sky: u64,
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.shadow += other.shadow;
        self.sky += other.sky;
    }
}

/// A batch of camera rays and what they hit.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    pub scene: &'a FlatScene,
    pub simd: Simd,
    pub rays: &'a [Ray],
    pub hits: &'a [SurfaceHit],
    pub samples: Samples<'a>,
}

/// Shades the hits of a batch: linear colours, one a ray, black where nothing was hit.
pub fn radiance(batch: &Batch, progress: &dyn Progress) -> Result<(Vec<Vec3>, RayCounts)> {
    let Batch { scene, rays, hits, .. } = *batch;
    let mut counts = RayCounts { primary: rays.len() as u64, ..RayCounts::default() };
    if scene.material == Material::UNLIT {
        return Ok((hits.iter().map(|hit| hit.color).collect(), counts));
    }
    let mut light = vec![Vec3::ZERO; rays.len()];
    for source in &scene.lights {
        match source {
            Light::Sun(sun) => counts.shadow += batch.add_sun(sun, &mut light, progress)?,
            Light::Sky(sky) => counts.sky += batch.add_sky(sky, &mut light, progress)?,
            Light::Headlight(strength) => {
                for ((light, hit), ray) in light.iter_mut().zip(hits).zip(rays) {
                    *light += strength * hit.normal.dot(-ray.direction).max(0.0);
                }
            }
        }
    }
    Ok((hits.iter().zip(light).map(|(hit, light)| hit.color * light).collect(), counts))
}

/// Random dimensions, so that no two uses share numbers.
const SKY_DIRECTION: u64 = 1;
const SKY_REACH: u64 = 2;
const SUN_DIRECTION: u64 = 3;
/// Light rays traced at once, about: bounds their memory however many a hit asks for.
const LIGHT_RAYS_AT_ONCE: u32 = 1 << 14;

/// A ray toward a light: direction, range, and what it brings if it arrives.
struct LightRay {
    direction: Vec3,
    reach: f32,
    brings: Vec3,
}

impl Batch<'_> {
    fn add_sun(&self, sun: &Sun, light: &mut [Vec3], progress: &dyn Progress) -> Result<u64> {
        let frame = Frame::around(sun.direction);
        let cos_max = (sun.angular_diameter_deg.to_radians() / 2.0).cos();
        let is_point = sun.angular_diameter_deg <= 0.0;
        let n_light = if is_point { 1 } else { self.samples.n_light };
        let sample = |key: u64, index: u32, normal: Vec3| {
            let direction = if is_point {
                sun.direction
            } else {
                let uv = scrambled_pair(index, hash(key ^ SUN_DIRECTION));
                frame.to_world(uniform_cone(uv, cos_max))
            };
            let cos = normal.dot(direction);
            let ray = LightRay { direction, reach: f32::INFINITY, brings: cos * sun.color };
            (0.0 < cos).then_some(ray)
        };
        self.add_light(n_light, sample, light, progress)
    }

    fn add_sky(&self, sky: &Sky, light: &mut [Vec3], progress: &dyn Progress) -> Result<u64> {
        let sample = |key: u64, index: u32, normal: Vec3| {
            let local = cosine_hemisphere(scrambled_pair(index, hash(key ^ SKY_DIRECTION)));
            let direction = Frame::around(normal).to_world(local);
            // A reach drawn evenly up to the farthest makes an occluder count linearly with its nearness.
            let reach = sky.reach * (1.0 - scrambled_pair(index, hash(key ^ SKY_REACH)).0);
            Some(LightRay { direction, reach, brings: sky.radiance(direction) })
        };
        self.add_light(self.samples.n_light, sample, light, progress)
    }

    /// Asks `sample(pixel key, sample index, normal)` for `n_light` rays from each hit and adds what
    /// arrives to `light`; returns how many were traced.
    fn add_light(
        &self,
        n_light: u32,
        sample: impl Fn(u64, u32, Vec3) -> Option<LightRay>,
        light: &mut [Vec3],
        progress: &dyn Progress,
    ) -> Result<u64> {
        let mut n_rays = 0;
        let share = 1.0 / n_light as f32;
        let hits_at_once = (LIGHT_RAYS_AT_ONCE / n_light).max(1) as usize;
        let most = self.hits.len().min(hits_at_once) * n_light as usize;
        let (mut rays, mut brings) = (Vec::with_capacity(most), Vec::with_capacity(most));
        let mut occluded = Vec::with_capacity(most);
        for first in (0..self.hits.len()).step_by(hits_at_once) {
            progress.check()?;
            rays.clear();
            brings.clear();
            for i in first..self.hits.len().min(first + hits_at_once) {
                let (ray, hit) = (&self.rays[i], &self.hits[i]);
                if hit.is_miss() {
                    continue;
                }
                let position = ray.at(hit.distance);
                for n in 0..n_light {
                    let index = self.samples.indices[i] * n_light + n;
                    let sampled = sample(self.samples.keys[i], index, hit.normal);
                    let Some(LightRay { direction, reach, brings: light }) = sampled else {
                        continue;
                    };
                    let surface = self.scene.surface;
                    let ray = surface.spawn_ray(position, hit.normal, hit.radius, direction);
                    rays.push(Ray { t_max: reach, ..ray });
                    brings.push((i, share * light));
                }
            }
            occluded.clear();
            occluded.resize(rays.len(), false);
            trace::occlusions(self.scene, self.simd, &rays, &mut occluded);
            for ((i, brings), _) in brings.iter().zip(&occluded).filter(|(_, occluded)| !**occluded)
            {
                light[*i] += *brings;
            }
            n_rays += rays.len() as u64;
        }
        Ok(n_rays)
    }
}
