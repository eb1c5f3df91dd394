//! Direct light: sun, sky, surroundings and lamps with their shadows, and the headlight.

use super::RayCounts;
use super::media::{Media, Way};
use super::shading::Shading;
use super::specular::gloss;
use super::through::light_through;
use crate::error::Result;
use crate::flat::FlatLamp;
use crate::math::{Frame, Ray, Vec3, cosine_hemisphere, disk, hash, scrambled_pair, uniform_cone};
use crate::scene::{Environment, LampKind, Light, Sky, Sun};
use crate::trace::Tracer;
use std::f32::consts::PI;

/// A place that light falls on.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    pub shading: Shading,
    /// On the viewer's side.
    pub media: Media,
    /// Unit, to the viewer.
    pub to_viewer: Vec3,
    /// Share of light thrown back to all sides, and to one side with the blur of the roughness; with what
    /// is left of it on the way to the camera.
    pub diffuse: Vec3,
    pub glossy: Vec3,
    /// Index of the result that it adds to.
    pub slot: u32,
    /// Random key, and number among those that share it.
    pub key: u64,
    pub index: u32,
}

/// The light of a scene.
#[derive(Clone, Copy)]
pub struct DirectLight<'a> {
    pub tracer: &'a Tracer<'a>,
    /// Rays toward each extended light from each receiver.
    pub n_light: u32,
}

/// Random dimensions, so that no two uses share numbers.
const SKY_DIRECTION: u64 = 1;
const SKY_REACH: u64 = 2;
const SUN_DIRECTION: u64 = 3;
const ENVIRONMENT_DIRECTION: u64 = 4;
const LAMP_PLACE: u64 = 5;
/// Light rays traced at once, about: bounds their memory however many a hit asks for.
const LIGHT_RAYS_AT_ONCE: u32 = 1 << 14;

/// A ray toward a light: direction, range, and what it brings to the viewer if it arrives.
struct LightRay {
    direction: Vec3,
    reach: f32,
    brings: Vec3,
}

impl DirectLight<'_> {
    /// Adds what falls on `receivers` and goes to the viewer to `light`.
    pub fn add(&self, receivers: &[Receiver], light: &mut [Vec3]) -> Result<RayCounts> {
        let mut counts = RayCounts::default();
        for source in &self.tracer.scene.lights {
            match source {
                Light::Sun(sun) => counts.shadow += self.add_sun(sun, receivers, light)?,
                Light::Sky(sky) => counts.sky += self.add_sky(sky, receivers, light)?,
                Light::Environment(environment) => {
                    counts.sky += self.add_environment(environment, receivers, light)?;
                }
                Light::Headlight(strength) => {
                    for receiver in receivers {
                        let back = receiver.throws_back(receiver.to_viewer, Vec3::splat(*strength));
                        light[receiver.slot as usize] += back.unwrap_or(Vec3::ZERO);
                    }
                }
            }
        }
        for (lamp_idx, lamp) in self.tracer.scene.lamps.iter().enumerate() {
            counts.shadow += self.add_lamp(lamp_idx as u64, lamp, receivers, light)?;
        }
        Ok(counts)
    }

    fn add_sun(&self, sun: &Sun, receivers: &[Receiver], light: &mut [Vec3]) -> Result<u64> {
        let frame = Frame::around(sun.direction);
        let cos_max = (sun.angular_diameter_deg.to_radians() / 2.0).cos();
        let is_point = sun.angular_diameter_deg <= 0.0;
        let n_light = if is_point { 1 } else { self.n_light };
        let sample = |receiver: &Receiver, index: u32| {
            let direction = if is_point {
                sun.direction
            } else {
                let uv = scrambled_pair(index, hash(receiver.key ^ SUN_DIRECTION));
                frame.to_world(uniform_cone(uv, cos_max))
            };
            let brings = receiver.throws_back(direction, sun.color)?;
            Some(LightRay { direction, reach: f32::INFINITY, brings })
        };
        self.add_light(n_light, sample, receivers, light)
    }

    fn add_sky(&self, sky: &Sky, receivers: &[Receiver], light: &mut [Vec3]) -> Result<u64> {
        let sample = |receiver: &Receiver, index: u32| {
            let key = receiver.key;
            let local = cosine_hemisphere(scrambled_pair(index, hash(key ^ SKY_DIRECTION)));
            let direction = Frame::around(receiver.shading.normal).to_world(local);
            // A reach drawn evenly up to the farthest makes an occluder count linearly with its nearness.
            let reach = sky.reach * (1.0 - scrambled_pair(index, hash(key ^ SKY_REACH)).0);
            Some(LightRay { direction, reach, brings: sky.radiance(direction) * receiver.diffuse })
        };
        self.add_light(self.n_light, sample, receivers, light)
    }

    /// Half of the directions are those of the picture's light, half those that the surface favours; each
    /// is weighed by how likely either half finds it (balance heuristic, Veach and Guibas 1995).
    fn add_environment(
        &self,
        environment: &Environment,
        receivers: &[Receiver],
        light: &mut [Vec3],
    ) -> Result<u64> {
        let sample = |receiver: &Receiver, index: u32| {
            let normal = receiver.shading.normal;
            let (u, v) = scrambled_pair(index, hash(receiver.key ^ ENVIRONMENT_DIRECTION));
            let direction = if u < 0.5 {
                environment.sample((2.0 * u, v))
            } else {
                Frame::around(normal).to_world(cosine_hemisphere((2.0 * u - 1.0, v)))
            };
            let cos = normal.dot(direction);
            if cos <= 0.0 {
                return None;
            }
            let (radiance, density) = environment.radiance_and_density(direction);
            let density = 0.5 * density + 0.5 * cos / PI;
            let brings = radiance * (cos / PI / density) * receiver.diffuse;
            Some(LightRay { direction, reach: f32::INFINITY, brings })
        };
        self.add_light(self.n_light, sample, receivers, light)
    }

    fn add_lamp(
        &self,
        lamp_idx: u64,
        lamp: &FlatLamp,
        receivers: &[Receiver],
        light: &mut [Vec3],
    ) -> Result<u64> {
        let is_point = lamp.radius <= 0.0 || lamp.kind == LampKind::Directional;
        let n_light = if is_point { 1 } else { self.n_light };
        let sample = |receiver: &Receiver, index: u32| {
            let position = receiver.shading.position;
            if lamp.kind == LampKind::Directional {
                let direction = -lamp.direction;
                let brings = receiver.throws_back(direction, lamp.color)?;
                return Some(LightRay { direction, reach: f32::INFINITY, brings });
            }
            let mut place = lamp.position;
            if 0.0 < lamp.radius {
                // The half of the ball that the receiver sees, as it sees it: a disc.
                let uv =
                    scrambled_pair(index, hash(receiver.key ^ hash(LAMP_PLACE ^ lamp_idx << 8)));
                let frame = Frame::around((position - place).normalize_or(Vec3::Z));
                let (x, y) = disk(uv);
                place += lamp.radius * (x * frame.tangent + y * frame.bitangent);
            }
            let way = place - position;
            let distance = way.length();
            let direction = way.try_normalize()?;
            let strength = lamp.falloff(-direction, distance);
            if strength <= 0.0 {
                return None;
            }
            let brings = receiver.throws_back(direction, strength * lamp.color)?;
            Some(LightRay { direction, reach: distance - lamp.radius.min(0.5 * distance), brings })
        };
        self.add_light(n_light, sample, receivers, light)
    }

    /// Asks `sample(receiver, sample index)` for `n_light` rays from each receiver and adds what arrives to
    /// `light`; returns how many were traced.
    fn add_light(
        &self,
        n_light: u32,
        sample: impl Fn(&Receiver, u32) -> Option<LightRay>,
        receivers: &[Receiver],
        light: &mut [Vec3],
    ) -> Result<u64> {
        let mut n_rays = 0;
        let share = 1.0 / n_light as f32;
        let receivers_at_once = (LIGHT_RAYS_AT_ONCE / n_light).max(1) as usize;
        let most = receivers.len().min(receivers_at_once) * n_light as usize;
        let (mut rays, mut brings) = (Vec::with_capacity(most), Vec::with_capacity(most));
        let mut shares = Vec::with_capacity(most);
        for receivers in receivers.chunks(receivers_at_once) {
            rays.clear();
            brings.clear();
            for (i, receiver) in receivers.iter().enumerate() {
                for n in 0..n_light {
                    let index = receiver.index * n_light + n;
                    let Some(sampled) = sample(receiver, index) else { continue };
                    // A bent normal may ask for light from behind the plane.
                    let is_behind = receiver.shading.facet.dot(sampled.direction) <= 0.0;
                    if is_behind || sampled.brings == Vec3::ZERO {
                        continue;
                    }
                    let ray = receiver.shading.spawn(sampled.direction);
                    rays.push(Ray { t_max: sampled.reach, ..ray });
                    brings.push((i, share * sampled.brings));
                }
            }
            shares.clear();
            shares.resize(rays.len(), Vec3::ZERO);
            let way = |ray: usize| {
                let Receiver { shading, media, .. } = &receivers[brings[ray].0];
                Way::from_surface(shading, rays[ray], *media)
            };
            light_through(self.tracer, &rays, way, &mut shares)?;
            for ((receiver, brings), share) in brings.iter().zip(&shares) {
                light[receivers[*receiver].slot as usize] += *share * *brings;
            }
            n_rays += rays.len() as u64;
        }
        Ok(n_rays)
    }
}

impl Receiver {
    /// What goes to the viewer of light of this strength from a direction; none from behind.
    #[inline]
    fn throws_back(&self, direction: Vec3, strength: Vec3) -> Option<Vec3> {
        let normal = self.shading.normal;
        let cos = normal.dot(direction);
        if cos <= 0.0 {
            return None;
        }
        let mut share = self.diffuse;
        if self.glossy != Vec3::ZERO {
            let half = (direction + self.to_viewer).normalize_or(normal);
            let cos_view = normal.dot(self.to_viewer).max(1e-3);
            // A light of strength 1 brings pi to a surface that faces it.
            share +=
                PI * gloss(cos_view, cos, normal.dot(half), self.shading.roughness) * self.glossy;
        }
        Some(cos * share * strength)
    }
}
