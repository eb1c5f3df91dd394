//! Light along rays that mirrors send on and glass splits (Whitted 1980), a wave of rays a bounce.

use super::direct::{DirectLight, Receiver};
use super::media::{Boundary, Way};
use super::shading::Shading;
use super::specular::{
    LEAST_ROUGHNESS, energy, fresnel, masking_of_light, metal_fresnel, pane_fresnel, reflect,
    refract, visible_normal,
};
use super::surroundings::surroundings;
use super::{Batch, Integrator, RayCounts};
use crate::error::Result;
use crate::math::{Frame, Ray, Vec3, Vec4, hash, scrambled_pair};
use crate::scene::Background;
use crate::trace::{SceneHit, Which};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Whitted {
    /// Bounces of a ray, at most.
    pub max_depth: u32,
}

/// Surfaces that are not quite there which a ray goes on through, at most.
const MOST_PASSED: u32 = 64;
/// Rays that count for less are traced as seldom as they do: fewer rays of the same mean.
const LEAST_WEIGHT: f32 = 0.01;

/// Random dimensions beside those of direct light.
const LOBE_DIRECTION: u64 = 11;
const ROULETTE: u64 = 12;
const REFLECTED: u64 = 13;
const REFRACTED: u64 = 14;
const PASSED: u64 = 15;

/// A ray on its way from the camera.
#[derive(Clone, Copy)]
struct Path {
    way: Way,
    /// What share of the light that it finds reaches the camera.
    weight: Vec3,
    /// Of the camera ray.
    slot: u32,
    /// Random key of this branch, and number among those that share it.
    key: u64,
    index: u32,
    depth: u32,
    n_passed: u32,
    sees: Sees,
}

/// What a ray that leaves the scene finds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sees {
    /// What is behind the pixel: it never turned.
    Behind,
    /// The same, or the sky where that is transparent: it went through glass.
    BehindGlass,
    Sky {
        with_sun: bool,
    },
}

impl Integrator for Whitted {
    fn radiance(&self, batch: &Batch) -> Result<(Vec<Vec4>, RayCounts)> {
        let mut search = Search {
            batch,
            max_depth: self.max_depth,
            light: vec![Vec3::ZERO; batch.rays.len()],
            alpha: vec![0.0; batch.rays.len()],
            receivers: Vec::with_capacity(batch.rays.len()),
            next: Vec::new(),
        };
        let direct = DirectLight { tracer: batch.tracer, n_light: batch.samples.n_light };
        let mut counts = RayCounts { primary: batch.rays.len() as u64, ..RayCounts::default() };
        for (path, hit) in search.camera_paths().zip(batch.hits) {
            search.follow(path, hit);
        }
        let (mut wave, mut hits) = (Vec::new(), Vec::new());
        loop {
            counts += direct.add(&search.receivers, &mut search.light)?;
            search.receivers.clear();
            wave.clear();
            std::mem::swap(&mut wave, &mut search.next);
            if wave.is_empty() {
                break;
            }
            let rays: Vec<Ray> = wave.iter().map(|path| path.way.ray).collect();
            hits.resize(rays.len(), SceneHit::MISS);
            batch.tracer.hits(Which::All, &rays, &mut hits)?;
            counts.secondary += rays.len() as u64;
            for (path, hit) in wave.iter().zip(&hits) {
                search.follow(*path, hit);
            }
        }
        let colors = search.light.iter().zip(&search.alpha);
        Ok((colors.map(|(light, alpha)| light.extend(*alpha)).collect(), counts))
    }
}

/// The light found so far, and the rays still to be traced.
struct Search<'a> {
    batch: &'a Batch<'a>,
    max_depth: u32,
    light: Vec<Vec3>,
    alpha: Vec<f32>,
    receivers: Vec<Receiver>,
    next: Vec<Path>,
}

/// Shares of light that a surface sends to the viewer from the mirror direction, from beyond, and from all
/// sides.
struct Lobes {
    reflected: Vec3,
    refracted: Vec3,
    diffuse: Vec3,
}

impl<'a> Search<'a> {
    fn camera_paths(&self) -> impl Iterator<Item = Path> + use<'a> {
        let Batch { rays, samples, .. } = self.batch;
        let path = move |(i, ray): (usize, &Ray)| Path {
            way: Way::from_camera(*ray),
            weight: Vec3::ONE,
            slot: i as u32,
            key: samples.keys[i],
            index: samples.indices[i],
            depth: 0,
            n_passed: 0,
            sees: Sees::Behind,
        };
        rays.iter().enumerate().map(path)
    }

    /// Adds what a ray brings from where it ends, and sends on what it becomes there.
    #[inline]
    fn follow(&mut self, mut path: Path, hit: &SceneHit) {
        let slot = path.slot as usize;
        if hit.is_miss() {
            return self.leave(&path);
        }
        let scene = self.batch.tracer.scene;
        let shading = Shading::new(scene, &path.way.ray, hit);
        let boundary = path.way.boundary(scene, &shading, hit);
        let coverage = shading.alpha * path.weight.max_element();
        path.weight *= boundary.transmittance;
        if shading.alpha < 1.0 {
            self.pass(&path, &shading);
            path.weight *= shading.alpha;
            if shading.alpha <= 0.0 {
                return;
            }
        }
        if path.sees == Sees::Behind {
            self.alpha[slot] += coverage;
        }
        if shading.is_unlit {
            self.light[slot] += path.weight * shading.base_color;
            return;
        }
        self.light[slot] += path.weight * shading.emission;
        let direction = path.way.ray.direction;
        let lobes = Lobes::new(&shading, direction, boundary.eta);
        let is_rough = LEAST_ROUGHNESS <= shading.roughness;
        let glossy = if is_rough { lobes.reflected } else { Vec3::ZERO };
        if lobes.diffuse != Vec3::ZERO || glossy != Vec3::ZERO {
            self.receivers.push(Receiver {
                shading,
                media: boundary.here,
                to_viewer: -direction,
                diffuse: path.weight * lobes.diffuse,
                glossy: path.weight * glossy,
                slot: path.slot,
                key: path.key,
                index: path.index,
            });
        }
        if path.depth < self.max_depth {
            self.reflect(&path, &shading, &lobes, &boundary);
            self.refract(&path, &shading, &lobes, &boundary);
        }
    }

    fn leave(&mut self, path: &Path) {
        let slot = path.slot as usize;
        let behind = self.batch.samples.behind[slot];
        let direction = path.way.ray.direction;
        let weight = path.weight * path.way.transmittance_to_end(self.batch.tracer.scene);
        let with_sun = path.sees == (Sees::Sky { with_sun: true });
        match path.sees {
            Sees::Behind if self.batch.tracer.scene.background == Background::Surroundings => {
                let radiance = surroundings(self.batch.tracer.scene, direction, false);
                self.light[slot] += weight * radiance;
                self.alpha[slot] += path.weight.max_element();
            }
            // The renderer puts what is behind there.
            Sees::Behind => {}
            Sees::BehindGlass if 0.0 < behind.w => {
                self.light[slot] += weight * behind.truncate();
            }
            Sees::BehindGlass | Sees::Sky { .. } => {
                let radiance = surroundings(self.batch.tracer.scene, direction, with_sun);
                self.light[slot] += weight * radiance;
            }
        }
    }

    /// Goes on where the surface is not quite there.
    fn pass(&mut self, path: &Path, shading: &Shading) {
        if MOST_PASSED <= path.n_passed {
            return;
        }
        let ray = shading.spawn(path.way.ray.direction);
        self.send(Path {
            way: Way::from_surface(shading, ray, path.way.media),
            weight: path.weight * (1.0 - shading.alpha),
            key: hash(path.key ^ PASSED),
            n_passed: path.n_passed + 1,
            ..*path
        });
    }

    fn reflect(&mut self, path: &Path, shading: &Shading, lobes: &Lobes, boundary: &Boundary) {
        if lobes.reflected == Vec3::ZERO {
            return;
        }
        let direction = path.way.ray.direction;
        let (normal, share) = bent_normal(path, shading);
        let mut reflected = reflect(direction, normal);
        if reflected.dot(shading.facet) <= 0.0 {
            // Below the surface: a bent normal's reflection is turned back at the plane, a rough one is lost.
            if share.is_some() {
                return;
            }
            reflected = reflect(reflected, shading.facet);
        }
        let share = share.map_or(1.0, |cos_view| {
            let cos_light = shading.normal.dot(reflected).max(1e-3);
            masking_of_light(cos_view, cos_light, shading.roughness)
                / energy(cos_view, shading.roughness)
        });
        let is_sharp = shading.roughness < LEAST_ROUGHNESS;
        self.send(Path {
            way: Way::from_surface(shading, shading.spawn(reflected), boundary.here),
            weight: path.weight * lobes.reflected * share,
            key: hash(path.key ^ REFLECTED),
            depth: path.depth + 1,
            sees: Sees::Sky { with_sun: is_sharp },
            ..*path
        });
    }

    fn refract(&mut self, path: &Path, shading: &Shading, lobes: &Lobes, boundary: &Boundary) {
        if lobes.refracted == Vec3::ZERO {
            return;
        }
        let direction = path.way.ray.direction;
        let (normal, _) = bent_normal(path, shading);
        let refracted = if shading.is_thin {
            // Through a pane light goes straight on, blurred as what it mirrors.
            let mirrored = reflect(direction, normal);
            Some(mirrored - 2.0 * mirrored.dot(shading.normal) * shading.normal)
        } else {
            // A rough boundary's own normal may reflect totally where the mean one does not.
            refract(direction, normal, boundary.eta)
                .or_else(|| refract(direction, shading.normal, boundary.eta))
        };
        let Some(refracted) = refracted else { return };
        let refracted = if refracted.dot(shading.facet) < 0.0 { refracted } else { direction };
        self.send(Path {
            way: Way::from_surface(shading, shading.spawn(refracted), boundary.beyond),
            weight: path.weight * lobes.refracted,
            key: hash(path.key ^ REFRACTED),
            depth: path.depth + 1,
            sees: match path.sees {
                Sees::Behind => Sees::BehindGlass,
                seen => seen,
            },
            ..*path
        });
    }

    /// Lets a ray be traced, or not, as its weight says.
    fn send(&mut self, mut path: Path) {
        let chance = path.weight.max_element() / LEAST_WEIGHT;
        if chance < 1.0 {
            let drawn = scrambled_pair(path.index, hash(path.key ^ ROULETTE)).0;
            if chance <= drawn {
                return;
            }
            path.weight /= chance;
        }
        self.next.push(path);
    }
}

impl Lobes {
    /// `eta` is the index of refraction on the viewer's side over that beyond.
    fn new(shading: &Shading, direction: Vec3, eta: f32) -> Self {
        let Shading { metallic, transmission, base_color, is_thin, .. } = *shading;
        let cos = -shading.normal.dot(direction);
        if metallic == 0.0 && eta == 1.0 {
            // Matte: all that the rest would come to.
            let (refracted, diffuse) =
                (transmission * base_color, (1.0 - transmission) * base_color);
            return Self { reflected: Vec3::ZERO, refracted, diffuse };
        }
        let at_boundary = if is_thin { pane_fresnel(cos, eta) } else { fresnel(cos, eta) };
        let entering = (1.0 - metallic) * (1.0 - at_boundary);
        Self {
            reflected: (1.0 - metallic) * Vec3::splat(at_boundary)
                + metallic * metal_fresnel(cos, base_color),
            refracted: entering * transmission * base_color,
            diffuse: entering * (1.0 - transmission) * base_color,
        }
    }
}

/// The normal at which a ray meets a surface: of a rough one some normal that the viewer sees, and the
/// cosine of the view to the mean one.
fn bent_normal(path: &Path, shading: &Shading) -> (Vec3, Option<f32>) {
    if shading.roughness < LEAST_ROUGHNESS {
        return (shading.normal, None);
    }
    let frame = Frame::around(shading.normal);
    let to_viewer = -path.way.ray.direction;
    let view = Vec3::new(
        to_viewer.dot(frame.tangent),
        to_viewer.dot(frame.bitangent),
        to_viewer.dot(frame.normal).max(1e-3),
    );
    let uv = scrambled_pair(path.index, hash(path.key ^ LOBE_DIRECTION));
    let normal = frame.to_world(visible_normal(view.normalize(), shading.roughness, uv));
    (normal, Some(view.z))
}
