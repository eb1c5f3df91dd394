//! Direct lighting: sun, sky, environments and punctual lights with their shadows, and the headlight.

use super::batch::RayCounts;
use super::dimensions::{
    ENVIRONMENT_DIRECTION, PUNCTUAL_LIGHT_POSITION, SKY_DIRECTION, SKY_DISTANCE, SUN_DIRECTION,
};
use super::media::{MediumRay, MediumStack};
use super::shading::Shading;
use super::specular::{MIN_GGX_COS, ggx_specular};
use super::transmittance::shadow_transmittance;
use crate::error::Result;
use crate::flat::FlatPunctualLight;
use crate::math::{Basis, Ray, Vec3, cosine_hemisphere, disk, hash, owen_sobol_2d, uniform_cone};
use crate::scene::{Environment, Light, PunctualLightKind, Sky, Sun};
use crate::trace::Tracer;
use std::f32::consts::PI;

/// A point at which direct light is computed.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint {
    /// Material and normals at the point.
    pub shading: Shading,
    /// The media on the viewer's side of the surface.
    pub media: MediumStack,
    /// Unit direction toward the viewer.
    pub to_viewer: Vec3,
    /// Diffuse albedo times the throughput of the path to the camera.
    pub diffuse: Vec3,
    /// Specular reflectance of a rough surface times the throughput of the path to the camera.
    pub glossy: Vec3,
    /// Index of the camera ray that the light is added to.
    pub ray_idx: u32,
    /// Random key of the path.
    pub key: u64,
    /// Index of the path among those with the same random key.
    pub index: u32,
    /// Number of rays toward each extended light.
    pub n_light_samples: u32,
}

/// Computes direct light from all lights of a scene.
#[derive(Clone, Copy)]
pub struct DirectLight<'a> {
    /// Traces the shadow rays.
    pub tracer: &'a Tracer<'a>,
    /// Largest number of rays toward each extended light from a shading point.
    pub max_light_samples: u32,
}

/// Approximate number of shadow rays traced at once: it bounds their memory, whatever the number of light
/// samples.
const SHADOW_RAY_CHUNK_SIZE: u32 = 1 << 14;

/// A sampled ray toward a light.
struct ShadowRay {
    /// Unit direction.
    direction: Vec3,
    /// Distance at which the ray ends.
    t_max: f32,
    /// Radiance that reaches the viewer if nothing blocks the ray.
    contribution: Vec3,
}

impl DirectLight<'_> {
    /// Adds the direct light reflected at `points` toward the viewer to `radiance`.
    ///
    /// # Errors
    ///
    /// Fails once the work is cancelled.
    pub fn add(&self, points: &[ShadingPoint], radiance: &mut [Vec3]) -> Result<RayCounts> {
        let mut counts = RayCounts::default();
        for light in &self.tracer.scene.lights {
            match light {
                Light::Sun(sun) => counts.shadow += self.add_sun(sun, points, radiance)?,
                Light::Sky(sky) => counts.sky += self.add_sky(sky, points, radiance)?,
                Light::Environment(environment) => {
                    counts.sky += self.add_environment(environment, points, radiance)?;
                }
                Light::Headlight(strength) => {
                    for point in points {
                        let strength = Vec3::splat(*strength);
                        let reflected = point.reflected_radiance(point.to_viewer, strength);
                        radiance[point.ray_idx as usize] += reflected.unwrap_or(Vec3::ZERO);
                    }
                }
            }
        }
        for (light_idx, light) in self.tracer.scene.punctual_lights.iter().enumerate() {
            counts.shadow += self.add_punctual_light(light_idx as u64, light, points, radiance)?;
        }
        Ok(counts)
    }

    fn add_sun(&self, sun: &Sun, points: &[ShadingPoint], radiance: &mut [Vec3]) -> Result<u64> {
        let basis = Basis::around(sun.direction);
        let cos_max = (sun.angular_diameter_deg.to_radians() / 2.0).cos();
        let is_point = sun.angular_diameter_deg <= 0.0;
        let max_samples = if is_point { 1 } else { self.max_light_samples };
        let sample = |point: &ShadingPoint, index: u32| {
            let direction = if is_point {
                sun.direction
            } else {
                let uv = owen_sobol_2d(index, hash(point.key ^ SUN_DIRECTION));
                basis.to_world(uniform_cone(uv, cos_max))
            };
            let contribution = point.reflected_radiance(direction, sun.color)?;
            Some(ShadowRay { direction, t_max: f32::INFINITY, contribution })
        };
        self.add_light(max_samples, sample, points, radiance)
    }

    fn add_sky(&self, sky: &Sky, points: &[ShadingPoint], radiance: &mut [Vec3]) -> Result<u64> {
        let sample = |point: &ShadingPoint, index: u32| {
            let key = point.key;
            let local = cosine_hemisphere(owen_sobol_2d(index, hash(key ^ SKY_DIRECTION)));
            let direction = Basis::around(point.shading.normal).to_world(local);
            // A uniform end of the ray makes occlusion fall off linearly with an occluder's distance.
            let t_max = sky.ao_distance * (1.0 - owen_sobol_2d(index, hash(key ^ SKY_DISTANCE)).0);
            let contribution = sky.radiance(direction) * point.diffuse;
            Some(ShadowRay { direction, t_max, contribution })
        };
        self.add_light(self.max_light_samples, sample, points, radiance)
    }

    /// Adds the light of an environment by multiple importance sampling: half of the directions follow the
    /// environment's luminance, half the cosine, weighted by the balance heuristic (Veach and Guibas 1995).
    fn add_environment(
        &self,
        environment: &Environment,
        points: &[ShadingPoint],
        radiance: &mut [Vec3],
    ) -> Result<u64> {
        let sample = |point: &ShadingPoint, index: u32| {
            let normal = point.shading.normal;
            let (u, v) = owen_sobol_2d(index, hash(point.key ^ ENVIRONMENT_DIRECTION));
            let direction = if u < 0.5 {
                environment.sample((2.0 * u, v))
            } else {
                Basis::around(normal).to_world(cosine_hemisphere((2.0 * u - 1.0, v)))
            };
            let cos = normal.dot(direction);
            if cos <= 0.0 {
                return None;
            }
            let (incident, density) = environment.radiance_and_density(direction);
            let density = 0.5 * density + 0.5 * cos / PI;
            let contribution = incident * (cos / PI / density) * point.diffuse;
            Some(ShadowRay { direction, t_max: f32::INFINITY, contribution })
        };
        self.add_light(self.max_light_samples, sample, points, radiance)
    }

    fn add_punctual_light(
        &self,
        light_idx: u64,
        light: &FlatPunctualLight,
        points: &[ShadingPoint],
        radiance: &mut [Vec3],
    ) -> Result<u64> {
        let is_point = light.radius <= 0.0 || light.kind == PunctualLightKind::Directional;
        let max_samples = if is_point { 1 } else { self.max_light_samples };
        let sample = |point: &ShadingPoint, index: u32| {
            let position = point.shading.position;
            if light.kind == PunctualLightKind::Directional {
                let direction = -light.direction;
                let contribution = point.reflected_radiance(direction, light.color)?;
                return Some(ShadowRay { direction, t_max: f32::INFINITY, contribution });
            }
            let dimension = hash(PUNCTUAL_LIGHT_POSITION ^ light_idx << 8);
            let uv = || owen_sobol_2d(index, hash(point.key ^ dimension));
            let LampRay { direction, t_max, falloff } = lamp_ray(light, position, uv)?;
            if falloff <= 0.0 {
                return None;
            }
            let contribution = point.reflected_radiance(direction, falloff * light.color)?;
            Some(ShadowRay { direction, t_max, contribution })
        };
        self.add_light(max_samples, sample, points, radiance)
    }

    /// Traces the rays that `sample(point, sample index)` returns, at most `max_samples` for each point, and adds
    /// their contributions to `radiance`. Returns the number of rays traced.
    fn add_light(
        &self,
        max_samples: u32,
        sample: impl Fn(&ShadingPoint, u32) -> Option<ShadowRay>,
        points: &[ShadingPoint],
        radiance: &mut [Vec3],
    ) -> Result<u64> {
        let mut n_rays = 0;
        let chunk_size = (SHADOW_RAY_CHUNK_SIZE / max_samples).max(1) as usize;
        let max_rays = points.len().min(chunk_size) * max_samples as usize;
        let mut rays = Vec::with_capacity(max_rays);
        let mut contributions = Vec::with_capacity(max_rays);
        let mut transmittances = Vec::with_capacity(max_rays);
        for points in points.chunks(chunk_size) {
            rays.clear();
            contributions.clear();
            for (point_idx, point) in points.iter().enumerate() {
                let n_samples = point.n_light_samples.min(max_samples);
                let weight = 1.0 / n_samples as f32;
                for sample_idx in 0..n_samples {
                    let index = point.index.wrapping_mul(n_samples).wrapping_add(sample_idx);
                    let Some(sampled) = sample(point, index) else { continue };
                    // A shading normal can let light in from behind the geometric surface.
                    let is_behind = point.shading.geometric_normal.dot(sampled.direction) <= 0.0;
                    if is_behind || sampled.contribution == Vec3::ZERO {
                        continue;
                    }
                    let ray = point.shading.spawn_to_light(sampled.direction);
                    rays.push(Ray { t_max: sampled.t_max, ..ray });
                    contributions.push((point_idx, weight * sampled.contribution));
                }
            }
            transmittances.clear();
            transmittances.resize(rays.len(), Vec3::ZERO);
            let medium_ray = |ray: usize| {
                let ShadingPoint { shading, media, .. } = &points[contributions[ray].0];
                MediumRay::from_surface(shading, rays[ray], *media)
            };
            shadow_transmittance(self.tracer, &rays, medium_ray, &mut transmittances)?;
            for ((point_idx, contribution), transmittance) in
                contributions.iter().zip(&transmittances)
            {
                radiance[points[*point_idx].ray_idx as usize] += *transmittance * *contribution;
            }
            n_rays += rays.len() as u64;
        }
        Ok(n_rays)
    }
}

/// A ray from a position to a lamp.
struct LampRay {
    /// Unit direction.
    direction: Vec3,
    /// Distance of the lamp's surface.
    t_max: f32,
    /// Factor on the lamp's intensity.
    falloff: f32,
}

/// Returns a ray to a lamp, whose ball a sample chooses. The mean of the rays gives a surface that faces the ball the
/// irradiance of a lamp in its centre. There is none from the centre.
fn lamp_ray(
    light: &FlatPunctualLight,
    position: Vec3,
    uv: impl Fn() -> (f32, f32),
) -> Option<LampRay> {
    let offset = light.position - position;
    let (distance, toward) = (offset.length(), offset.try_normalize()?);
    if light.radius <= 0.0 {
        let falloff = light.falloff(-toward, distance);
        return Some(LampRay { direction: toward, t_max: distance, falloff });
    }
    if distance <= light.radius {
        // Within the ball, light comes from the disc through its centre.
        let basis = Basis::around(toward);
        let (x, y) = disk(uv());
        let offset = offset + light.radius * (x * basis.tangent + y * basis.bitangent);
        let (distance, direction) = (offset.length(), offset.try_normalize()?);
        let falloff = light.falloff(-direction, distance);
        return Some(LampRay { direction, t_max: 0.5 * distance, falloff });
    }
    let sine = light.radius / distance;
    let cos_max = (1.0 - sine * sine).sqrt();
    let local = uniform_cone(uv(), cos_max);
    let direction = Basis::around(toward).to_world(local);
    // Over the cone, the cosine at the surface has the mean (1 + cos_max) / 2.
    let falloff = 2.0 / (1.0 + cos_max) * light.falloff(-direction, distance);
    let aside = distance * local.truncate().length();
    let depth = (light.radius * light.radius - aside * aside).max(0.0).sqrt();
    Some(LampRay { direction, t_max: distance * local.z - depth, falloff })
}

impl ShadingPoint {
    /// Returns the radiance reflected toward the viewer for a light of this strength from `direction`
    /// (unit), or `None` if the light is behind the surface.
    #[inline]
    fn reflected_radiance(&self, direction: Vec3, strength: Vec3) -> Option<Vec3> {
        let normal = self.shading.normal;
        let cos = normal.dot(direction);
        if cos <= 0.0 {
            return None;
        }
        let mut reflectance = self.diffuse;
        if self.glossy != Vec3::ZERO {
            let half = (direction + self.to_viewer).normalize_or(normal);
            let cos_view = normal.dot(self.to_viewer).max(MIN_GGX_COS);
            let roughness = self.shading.roughness;
            // Unit strength means an irradiance of pi at normal incidence.
            reflectance +=
                PI * ggx_specular(cos_view, cos, normal.dot(half), roughness) * self.glossy;
        }
        Some(cos * reflectance * strength)
    }
}
