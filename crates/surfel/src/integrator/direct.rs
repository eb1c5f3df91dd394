//! Direct light: sun with shadows, sky with occlusion, headlight, on matte surfaces.

use crate::flat::FlatScene;
use crate::math::{Frame, Ray, Vec3, cosine_hemisphere, hash, scrambled_pair, uniform_cone};
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

/// What one ray brings back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Radiance {
    /// Linear; zero where nothing was hit.
    pub color: Vec3,
    pub hit: SurfaceHit,
}

/// Rays traced, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    pub primary: u64,
    pub shadow: u64,
    pub sky: u64,
}

/// Shades the hits of `rays`, one result a ray; the hits are traced by the caller.
pub fn radiance(
    scene: &FlatScene,
    simd: Simd,
    rays: &[Ray],
    hits: &[SurfaceHit],
    samples: Samples,
) -> (Vec<Radiance>, RayCounts) {
    let mut counts = RayCounts { primary: rays.len() as u64, ..RayCounts::default() };
    let mut light = vec![Vec3::ZERO; rays.len()];
    for source in &scene.lights {
        match source {
            Light::Sun(sun) => {
                counts.shadow += add_sun(scene, simd, sun, rays, hits, samples, &mut light)
            }
            Light::Sky(sky) => {
                counts.sky += add_sky(scene, simd, sky, rays, hits, samples, &mut light)
            }
            Light::Headlight(strength) => {
                for ((light, hit), ray) in light.iter_mut().zip(hits).zip(rays) {
                    *light += strength * hit.normal.dot(-ray.direction).max(0.0);
                }
            }
        }
    }
    let shade = |(hit, light): (&SurfaceHit, Vec3)| {
        let lit = if scene.material == Material::Unlit { Vec3::ONE } else { light };
        Radiance { color: hit.color * lit, hit: *hit }
    };
    (hits.iter().zip(light).map(shade).collect(), counts)
}

/// Random dimensions, so that no two uses share numbers.
const SKY_DIRECTION: u64 = 1;
const SKY_REACH: u64 = 2;
const SUN_DIRECTION: u64 = 3;

fn add_sun(
    scene: &FlatScene,
    simd: Simd,
    sun: &Sun,
    rays: &[Ray],
    hits: &[SurfaceHit],
    samples: Samples,
    light: &mut [Vec3],
) -> u64 {
    let frame = Frame::around(sun.direction);
    let cos_max = (sun.angular_diameter_deg.to_radians() / 2.0).cos();
    let is_point = sun.angular_diameter_deg <= 0.0;
    let samples = if is_point { Samples { n_light: 1, ..samples } } else { samples };
    let mut shadows = LightRays::default();
    shadows.collect(scene, rays, hits, samples, |key, index, normal| {
        let direction = if is_point {
            sun.direction
        } else {
            frame.to_world(uniform_cone(scrambled_pair(index, hash(key ^ SUN_DIRECTION)), cos_max))
        };
        let cos = normal.dot(direction);
        (0.0 < cos).then_some((direction, f32::INFINITY, cos * sun.color))
    });
    shadows.deliver(scene, simd, samples.n_light, light)
}

fn add_sky(
    scene: &FlatScene,
    simd: Simd,
    sky: &Sky,
    rays: &[Ray],
    hits: &[SurfaceHit],
    samples: Samples,
    light: &mut [Vec3],
) -> u64 {
    let mut shadows = LightRays::default();
    shadows.collect(scene, rays, hits, samples, |key, index, normal| {
        let local = cosine_hemisphere(scrambled_pair(index, hash(key ^ SKY_DIRECTION)));
        let direction = Frame::around(normal).to_world(local);
        // A reach drawn evenly up to the farthest makes an occluder count linearly with its nearness.
        let reach = sky.reach * (1.0 - scrambled_pair(index, hash(key ^ SKY_REACH)).0);
        Some((direction, reach, sky.radiance(direction)))
    });
    shadows.deliver(scene, simd, samples.n_light, light)
}

/// A batch of rays toward a light, with what each brings if it arrives.
#[derive(Default)]
struct LightRays {
    rays: Vec<Ray>,
    brings: Vec<(u32, Vec3)>,
}

impl LightRays {
    /// Asks `sample(pixel key, sample index, normal)` for direction, range and light of each ray.
    fn collect(
        &mut self,
        scene: &FlatScene,
        rays: &[Ray],
        hits: &[SurfaceHit],
        samples: Samples,
        sample: impl Fn(u64, u32, Vec3) -> Option<(Vec3, f32, Vec3)>,
    ) {
        if scene.material == Material::Unlit {
            return;
        }
        for (i, hit) in hits.iter().enumerate().filter(|(_, hit)| !hit.is_miss()) {
            let position = rays[i].at(hit.distance);
            for n in 0..samples.n_light {
                let index = samples.indices[i] * samples.n_light + n;
                if let Some((direction, reach, light)) = sample(samples.keys[i], index, hit.normal)
                {
                    let ray = scene.surface.spawn_ray(position, hit.normal, hit.radius, direction);
                    self.rays.push(Ray { t_max: reach, ..ray });
                    self.brings.push((i as u32, light));
                }
            }
        }
    }

    /// Adds the light of the rays that arrive; returns how many were traced.
    fn deliver(self, scene: &FlatScene, simd: Simd, n_light: u32, light: &mut [Vec3]) -> u64 {
        let mut occluded = vec![false; self.rays.len()];
        trace::occlusions(scene, simd, &self.rays, &mut occluded);
        let share = 1.0 / n_light as f32;
        for ((i, brings), _) in self.brings.iter().zip(occluded).filter(|(_, occluded)| !occluded) {
            light[*i as usize] += share * *brings;
        }
        self.rays.len() as u64
    }
}
