//! Whitted ray tracing: mirrors reflect and glass splits rays (Whitted 1980), one wavefront of rays a bounce.

use super::background::background_radiance;
use super::batch::{CameraRayBatch, Integrator, RayCounts};
use super::dimensions::{ALPHA_LAYER, LOBE_DIRECTION, REFLECTED, REFRACTED, ROULETTE};
use super::direct::{DirectLight, ShadingPoint};
use super::media::{Interface, MediumRay};
use super::shading::Shading;
use super::specular::{
    MIN_GGX_COS, MIN_ROUGHNESS, directional_albedo, fresnel, reflect, refract, sample_ggx_vndf,
    schlick_fresnel, smith_g2_over_g1, thin_slab_fresnel,
};
use crate::error::Result;
use crate::math::{Basis, PACKET_WIDTH, Ray, Vec3, Vec4, hash, owen_sobol_2d};
use crate::scene::Background;
use crate::trace::{GaussianLight, InstanceFilter, SceneHit};

/// An integrator for direct light, mirrors and glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Whitted {
    /// Maximum number of reflections and refractions along a path.
    pub max_depth: u32,
}

/// Maximum number of alpha-blended layers along a path.
pub const MAX_ALPHA_LAYERS: u32 = 64;
/// Path weight below which Russian roulette ends paths, with the mean preserved.
pub const MIN_WEIGHT: f32 = 0.01;

/// Approximate maximum number of paths in a wavefront. A path takes about half a kilobyte with its ray, hit and shading.
const MAX_WAVE_SIZE: usize = 1 << 15;

/// A path from the camera up to its next ray.
#[derive(Clone, Copy)]
struct Path {
    /// The next ray.
    ray: MediumRay,
    /// Throughput from the ray's end to the camera.
    weight: Vec3,
    /// Index of the camera ray.
    ray_idx: u32,
    /// Random key of this branch.
    key: u64,
    /// Index of the path among those with the same random key.
    index: u32,
    /// Number of reflections and refractions so far.
    depth: u32,
    /// Number of alpha-blended layers passed so far.
    n_alpha_layers: u32,
    /// The radiance that the path finds if its ray leaves the scene.
    on_miss: MissBehavior,
}

/// The radiance that a ray finds when it leaves the scene.
#[derive(Clone, Copy, PartialEq, Eq)]
enum MissBehavior {
    /// The pixel's background: the path has never changed its direction.
    Background,
    /// The pixel's background, or the sky where it is transparent: the path went through glass.
    BackgroundThroughGlass,
    /// The environment or sky: the path was reflected.
    Sky { with_sun: bool },
}

impl Integrator for Whitted {
    fn radiance(&self, batch: &CameraRayBatch) -> Result<(Vec<Vec4>, RayCounts)> {
        let mut colors = Vec::with_capacity(batch.rays.len());
        let mut counts = RayCounts::default();
        for part in batch.parts(n_rays_at_once(batch.samples.n_light_samples)) {
            let (colors_of_part, counts_of_part) = self.radiance_of_part(&part)?;
            colors.extend(colors_of_part);
            counts += counts_of_part;
        }
        Ok((colors, counts))
    }
}

/// Returns the number of camera rays whose paths are followed at once. The branches of a ray in rough lobes share its
/// light samples, and Russian roulette leaves no more than those of minimum weight.
fn n_rays_at_once(n_light_samples: u32) -> usize {
    let max_branches = (1.0 / MIN_WEIGHT) as usize;
    let n_branches = (n_light_samples as usize).clamp(1, max_branches);
    (MAX_WAVE_SIZE / n_branches).next_multiple_of(PACKET_WIDTH)
}

impl Whitted {
    /// Returns the radiance of some rays of a batch, whose paths are followed at once.
    fn radiance_of_part(&self, batch: &CameraRayBatch) -> Result<(Vec<Vec4>, RayCounts)> {
        let mut state = WavefrontState {
            batch,
            max_depth: self.max_depth,
            radiance: vec![Vec3::ZERO; batch.rays.len()],
            alpha: vec![0.0; batch.rays.len()],
            shading_points: Vec::with_capacity(batch.rays.len()),
            queue: Vec::new(),
        };
        let max_light_samples = batch.samples.n_light_samples;
        let direct = DirectLight { tracer: batch.tracer, max_light_samples };
        let mut counts = RayCounts { primary: batch.rays.len() as u64, ..RayCounts::default() };
        let paths: Vec<Path> = state.camera_paths().collect();
        state.shade(&paths, batch.rays, batch.hits)?;
        let (mut wave, mut hits) = (Vec::new(), Vec::new());
        loop {
            counts += direct.add(&state.shading_points, &mut state.radiance)?;
            state.shading_points.clear();
            wave.clear();
            std::mem::swap(&mut wave, &mut state.queue);
            if wave.is_empty() {
                break;
            }
            let rays: Vec<Ray> = wave.iter().map(|path| path.ray.ray).collect();
            hits.resize(rays.len(), SceneHit::MISS);
            batch.tracer.hits(InstanceFilter::Surfaces, &rays, &mut hits)?;
            counts.secondary += rays.len() as u64;
            state.shade(&wave, &rays, &hits)?;
        }
        let colors = state.radiance.iter().zip(&state.alpha);
        Ok((colors.map(|(radiance, alpha)| radiance.extend(*alpha)).collect(), counts))
    }
}

/// The radiance found so far, and the rays of the next wavefront.
struct WavefrontState<'a> {
    batch: &'a CameraRayBatch<'a>,
    max_depth: u32,
    radiance: Vec<Vec3>,
    alpha: Vec<f32>,
    /// Hits of this wavefront that receive direct light.
    shading_points: Vec<ShadingPoint>,
    /// Paths of the next wavefront.
    queue: Vec<Path>,
}

/// Fractions of light that a surface reflects, refracts and scatters toward the viewer.
struct Lobes {
    reflected: Vec3,
    refracted: Vec3,
    diffuse: Vec3,
}

impl<'a> WavefrontState<'a> {
    fn camera_paths(&self) -> impl Iterator<Item = Path> + use<'a> {
        let CameraRayBatch { rays, samples, .. } = self.batch;
        let path = move |(i, ray): (usize, &Ray)| Path {
            ray: MediumRay::from_camera(*ray),
            weight: Vec3::ONE,
            ray_idx: i as u32,
            key: samples.keys[i],
            index: samples.indices[i],
            depth: 0,
            n_alpha_layers: 0,
            on_miss: MissBehavior::Background,
        };
        rays.iter().enumerate().map(path)
    }

    /// Shades the hits of paths on surfaces, behind the Gaussians that their rays pass.
    fn shade(&mut self, paths: &[Path], rays: &[Ray], hits: &[SceneHit]) -> Result<()> {
        if !self.batch.tracer.scene.has_gaussians {
            paths.iter().zip(hits).for_each(|(path, hit)| self.shade_hit(*path, hit));
            return Ok(());
        }
        let lights = self.batch.tracer.gaussians(rays, hits)?;
        for ((path, light), hit) in paths.iter().zip(&lights).zip(hits) {
            if let Some(path) = self.pass_gaussians(*path, light) {
                self.shade_hit(path, hit);
            }
        }
        Ok(())
    }

    /// Adds the light of the Gaussians before the end of a path's ray, and returns the path behind them if light passes.
    fn pass_gaussians(&mut self, mut path: Path, light: &GaussianLight) -> Option<Path> {
        let Some(distance) = light.distance() else { return Some(path) };
        let ray_idx = path.ray_idx as usize;
        let attenuation = path.ray.transmittance_to(self.batch.tracer.scene, distance);
        self.radiance[ray_idx] += path.weight * attenuation * light.radiance();
        if path.on_miss == MissBehavior::Background {
            self.alpha[ray_idx] += (1.0 - light.transmittance) * path.weight.max_element();
        }
        path.weight *= light.transmittance;
        (0.0 < light.transmittance).then_some(path)
    }

    /// Adds the radiance emitted at the end of a path's ray, records the point for direct light, and
    /// enqueues the rays that continue the path.
    #[inline]
    fn shade_hit(&mut self, mut path: Path, hit: &SceneHit) {
        let ray_idx = path.ray_idx as usize;
        if hit.is_miss() {
            return self.shade_miss(&path);
        }
        let scene = self.batch.tracer.scene;
        let shading = Shading::new(scene, &path.ray.ray, hit);
        let interface = path.ray.interface(scene, &shading, hit);
        let coverage = shading.alpha * path.weight.max_element();
        path.weight *= interface.transmittance;
        if shading.alpha < 1.0 {
            self.continue_through_alpha(&path, &shading);
            path.weight *= shading.alpha;
            if shading.alpha <= 0.0 {
                return;
            }
        }
        if path.on_miss == MissBehavior::Background {
            self.alpha[ray_idx] += coverage;
        }
        if shading.is_unlit {
            self.radiance[ray_idx] += path.weight * shading.base_color;
            return;
        }
        self.radiance[ray_idx] += path.weight * shading.emission;
        let direction = path.ray.ray.direction;
        let lobes = Lobes::new(&shading, direction, interface.eta);
        let is_rough = MIN_ROUGHNESS <= shading.roughness;
        let glossy = if is_rough { lobes.reflected } else { Vec3::ZERO };
        if lobes.diffuse != Vec3::ZERO || glossy != Vec3::ZERO {
            self.shading_points.push(ShadingPoint {
                shading,
                media: interface.near,
                to_viewer: -direction,
                diffuse: path.weight * lobes.diffuse,
                glossy: path.weight * glossy,
                ray_idx: path.ray_idx,
                key: path.key,
                index: path.index,
                n_light_samples: self.n_samples_of(path.weight),
            });
        }
        if path.depth < self.max_depth {
            for branch in self.branches(&path, lobes.reflected, REFLECTED, is_rough) {
                self.reflect(branch, &shading, &interface);
            }
            for branch in self.branches(&path, lobes.refracted, REFRACTED, is_rough) {
                self.refract(branch, &shading, &interface);
            }
        }
    }

    /// Returns the number of light samples of a path with this weight: all branches of a camera ray share its
    /// samples in proportion to their weights.
    fn n_samples_of(&self, weight: Vec3) -> u32 {
        let n_light_samples = self.batch.samples.n_light_samples;
        let n_samples = n_light_samples as f32 * weight.max_element();
        (n_samples.ceil() as u32).clamp(1, n_light_samples)
    }

    /// Returns the branches of a path into a lobe that receives `fraction` of its weight, without their new rays: one
    /// into a mirror's lobe, one for each light sample into a rough lobe.
    fn branches(
        &self,
        path: &Path,
        fraction: Vec3,
        lobe: u64,
        is_rough: bool,
    ) -> impl Iterator<Item = Path> + use<> {
        let weight = path.weight * fraction;
        let n_branches = match weight == Vec3::ZERO {
            true => 0,
            false if is_rough => self.n_samples_of(weight),
            false => 1,
        };
        let path = Path {
            weight: weight / n_branches.max(1) as f32,
            key: hash(path.key ^ lobe),
            depth: path.depth + 1,
            ..*path
        };
        (0..n_branches).map(move |i| Path {
            index: path.index.wrapping_mul(n_branches).wrapping_add(i),
            ..path
        })
    }

    /// Adds the radiance that a path finds where its ray leaves the scene.
    fn shade_miss(&mut self, path: &Path) {
        let ray_idx = path.ray_idx as usize;
        let background = self.batch.samples.background[ray_idx];
        let direction = path.ray.ray.direction;
        let weight = path.weight * path.ray.transmittance_to_end(self.batch.tracer.scene);
        let with_sun = path.on_miss == (MissBehavior::Sky { with_sun: true });
        match path.on_miss {
            MissBehavior::Background
                if self.batch.tracer.scene.background == Background::Environment =>
            {
                let radiance = background_radiance(self.batch.tracer.scene, direction, false);
                self.radiance[ray_idx] += weight * radiance;
            }
            // The renderer composites the background.
            MissBehavior::Background => {}
            MissBehavior::BackgroundThroughGlass if 0.0 < background.w => {
                self.radiance[ray_idx] += weight * background.truncate();
            }
            MissBehavior::BackgroundThroughGlass | MissBehavior::Sky { .. } => {
                let radiance = background_radiance(self.batch.tracer.scene, direction, with_sun);
                self.radiance[ray_idx] += weight * radiance;
            }
        }
    }

    /// Enqueues the part of a path that an alpha-blended surface lets pass.
    fn continue_through_alpha(&mut self, path: &Path, shading: &Shading) {
        if MAX_ALPHA_LAYERS <= path.n_alpha_layers {
            return;
        }
        let ray = shading.spawn(path.ray.ray.direction);
        self.enqueue(Path {
            ray: MediumRay::from_surface(shading, ray, path.ray.media),
            weight: path.weight * (1.0 - shading.alpha),
            key: hash(path.key ^ ALPHA_LAYER),
            n_alpha_layers: path.n_alpha_layers + 1,
            ..*path
        });
    }

    /// Enqueues a branch of a path in the direction of the reflection.
    fn reflect(&mut self, branch: Path, shading: &Shading, interface: &Interface) {
        let direction = branch.ray.ray.direction;
        let (normal, cos_view) = sample_microfacet_normal(&branch, shading);
        let mut reflected = reflect(direction, normal);
        if reflected.dot(shading.geometric_normal) <= 0.0 {
            // The reflection points into the surface: a rough one is lost, one about a shading normal is
            // reflected at the geometric surface.
            if cos_view.is_some() {
                return;
            }
            reflected = reflect(reflected, shading.geometric_normal);
        }
        let lobe_weight = cos_view.map_or(1.0, |cos_view| {
            let cos_light = shading.normal.dot(reflected).max(MIN_GGX_COS);
            smith_g2_over_g1(cos_view, cos_light, shading.roughness)
                / directional_albedo(cos_view, shading.roughness)
        });
        let is_sharp = shading.roughness < MIN_ROUGHNESS;
        self.enqueue(Path {
            ray: MediumRay::from_surface(shading, shading.spawn(reflected), interface.near),
            weight: branch.weight * lobe_weight,
            on_miss: MissBehavior::Sky { with_sun: is_sharp },
            ..branch
        });
    }

    /// Enqueues a branch of a path in the direction of the refraction.
    fn refract(&mut self, branch: Path, shading: &Shading, interface: &Interface) {
        let direction = branch.ray.ray.direction;
        let (normal, _) = sample_microfacet_normal(&branch, shading);
        let refracted = if shading.is_thin {
            // A thin slab transmits straight on, as blurred as its reflection.
            let mirrored = reflect(direction, normal);
            Some(mirrored - 2.0 * mirrored.dot(shading.normal) * shading.normal)
        } else {
            // A microfacet can reflect totally where the surface as a whole does not.
            refract(direction, normal, interface.eta)
                .or_else(|| refract(direction, shading.normal, interface.eta))
        };
        let Some(refracted) = refracted else { return };
        let is_behind = refracted.dot(shading.geometric_normal) < 0.0;
        let refracted = if is_behind { refracted } else { direction };
        self.enqueue(Path {
            ray: MediumRay::from_surface(shading, shading.spawn(refracted), interface.far),
            on_miss: match branch.on_miss {
                MissBehavior::Background => MissBehavior::BackgroundThroughGlass,
                other => other,
            },
            ..branch
        });
    }

    /// Adds a path to the next wavefront, subject to Russian roulette.
    fn enqueue(&mut self, mut path: Path) {
        let survival = path.weight.max_element() / MIN_WEIGHT;
        if survival < 1.0 {
            let random = owen_sobol_2d(path.index, hash(path.key ^ ROULETTE)).0;
            if survival <= random {
                return;
            }
            path.weight /= survival;
        }
        self.queue.push(path);
    }
}

impl Lobes {
    /// `eta` is the index of refraction on the viewer's side over that on the far side.
    fn new(shading: &Shading, direction: Vec3, eta: f32) -> Self {
        let Shading { metallic, transmission, base_color, is_thin, .. } = *shading;
        let cos = -shading.normal.dot(direction);
        if metallic == 0.0 && eta == 1.0 {
            // A matte surface reflects nothing specularly; the general case below gives the same.
            let (refracted, diffuse) =
                (transmission * base_color, (1.0 - transmission) * base_color);
            return Self { reflected: Vec3::ZERO, refracted, diffuse };
        }
        let dielectric = if is_thin { thin_slab_fresnel(cos, eta) } else { fresnel(cos, eta) };
        let entering = (1.0 - metallic) * (1.0 - dielectric);
        Self {
            reflected: (1.0 - metallic) * Vec3::splat(dielectric)
                + metallic * schlick_fresnel(cos, base_color),
            refracted: entering * transmission * base_color,
            diffuse: entering * (1.0 - transmission) * base_color,
        }
    }
}

/// Samples the normal that a ray is reflected about: a visible microfacet normal of a rough surface, with
/// the cosine between view and shading normal, or the shading normal of a smooth one.
fn sample_microfacet_normal(path: &Path, shading: &Shading) -> (Vec3, Option<f32>) {
    if shading.roughness < MIN_ROUGHNESS {
        return (shading.normal, None);
    }
    let basis = Basis::around(shading.normal);
    let to_viewer = -path.ray.ray.direction;
    let view = Vec3::new(
        to_viewer.dot(basis.tangent),
        to_viewer.dot(basis.bitangent),
        to_viewer.dot(basis.normal).max(MIN_GGX_COS),
    );
    let uv = owen_sobol_2d(path.index, hash(path.key ^ LOBE_DIRECTION));
    let normal = basis.to_world(sample_ggx_vndf(view.normalize(), shading.roughness, uv));
    (normal, Some(view.z))
}
