//! The discs near each ray's first one, blended: sixteen rays at a time.

use super::boundary::{WideHits, enclosed, enclosed_by_blocks};
use super::closest::closest_hits;
use super::flight::Flight;
use super::gather::gather;
use super::group::{GROUP, Group};
use super::hit::Hit;
use super::packet::{PacketStack, WideRays};
use super::sightings::{Sighting, settle};
use crate::flat::FlatCloud;
use crate::math::{Floats, LaneMask, Lanes, Ray, Task, Vec3, Vec3Lanes, WIDE, Wide};
use crate::surface::{
    Blend, Boundary, Candidate, Gathered, MAX_GATHERED, SurfaceKind, plane_normal,
};
use std::marker::PhantomData;

/// The blended discs of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// The nearest.
    pub hit: Hit,
    pub n_discs: u32,
    /// Of the nearest disc.
    pub radius: f32,
    /// Unit, facing the ray's origin.
    pub normal: Vec3,
    /// Linear.
    pub color: Vec3,
    /// Whether the points around the hit are known to enclose it; told only where it is asked for.
    pub(super) is_enclosed: bool,
}

impl Splat {
    pub const MISS: Self = Self {
        hit: Hit::MISS,
        n_discs: 0,
        radius: 0.0,
        normal: Vec3::ZERO,
        color: Vec3::ZERO,
        is_enclosed: false,
    };
}

#[inline(always)]
pub(super) fn splats<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], splats: &mut [Splat]) {
    let kind = cloud.surface;
    let kind = if kind.is_gathered() { kind } else { SurfaceKind::Splat };
    Finder::new(cloud, kind, Boundary::Off).find::<L>(rays, splats);
}

/// Finds splats, and keeps the room it needs from search to search.
pub(super) struct Finder<'s> {
    stack: PacketStack,
    flight: Flight,
    mixer: Mixer<'s>,
    /// Splats that are still in question, and their hits.
    open: Vec<u32>,
    open_hits: Vec<(Vec3, Candidate)>,
}

impl<'s> Finder<'s> {
    /// Finds out whether hits are enclosed if `boundary` asks for that.
    pub fn new(cloud: &'s FlatCloud, kind: SurfaceKind, boundary: Boundary) -> Self {
        let (sightings, discs) = (Vec::new(), Vec::new());
        let mixer = Mixer { cloud, kind, judges: boundary == Boundary::Gap, sightings, discs };
        let (stack, flight) = (PacketStack::new(), Flight::default());
        Self { stack, flight, mixer, open: Vec::new(), open_hits: Vec::new() }
    }

    /// Finds the splats of `rays`, in a function of its own.
    #[inline(always)]
    pub fn find<L: Lanes>(&mut self, rays: &[Ray], splats: &mut [Splat]) {
        L::call(Find { finder: self, rays, splats, lanes: PhantomData::<L> });
    }

    #[inline(always)]
    fn blend<L: Lanes>(&mut self, rays: &[Ray], splats: &mut [Splat]) {
        let Self { stack, flight, mixer, .. } = self;
        let (points, mut group) = (&mixer.cloud.points, Group::new(false));
        let (is_gathered, mut hits) = (mixer.kind.is_gathered(), [Hit::MISS; GROUP]);
        for (rays, splats) in rays.chunks(GROUP).zip(splats.chunks_mut(GROUP)) {
            if is_gathered {
                group.take::<L, _>(points, rays);
            } else {
                closest_hits::<L>(mixer.cloud, rays, &mut hits[..rays.len()]);
            }
            let packets = rays.chunks(WIDE).zip(splats.chunks_mut(WIDE)).zip(hits.chunks(WIDE));
            for (place, ((rays, splats), hits)) in packets.enumerate() {
                let limits = if is_gathered {
                    gather::<L>(points, &group, place, rays, stack, flight, &mut mixer.sightings)
                } else {
                    mixer.take(&hits[..rays.len()])
                };
                mixer.mix::<L>(&WideRays::new(rays), &limits, splats);
            }
        }
    }

    /// Judges the hits not known to be enclosed, those of many packets together.
    #[inline(always)]
    fn judge<L: Lanes>(&mut self, rays: &[Ray], splats: &mut [Splat]) {
        let Self { mixer, open, open_hits, .. } = self;
        open.clear();
        open_hits.clear();
        for (splat_idx, (splat, ray)) in splats.iter().zip(rays).enumerate() {
            if splat.hit.is_miss() || splat.is_enclosed {
                continue;
            }
            let radius = splat.radius / mixer.cloud.surface.radius_factor();
            let candidate = Candidate { normal: splat.normal, direction: ray.direction, radius };
            open.push(splat_idx as u32);
            open_hits.push((ray.at(splat.hit.distance), candidate));
        }
        for (open, hits) in open.chunks(WIDE).zip(open_hits.chunks(WIDE)) {
            let lanes = (1 << open.len()) - 1;
            let enclosed = enclosed::<L>(&mixer.cloud.points, lanes, &WideHits::new(hits));
            for (lane, splat_idx) in open.iter().enumerate() {
                splats[*splat_idx as usize].is_enclosed = enclosed >> lane & 1 == 1;
            }
        }
    }
}

struct Find<'f, 's, L> {
    finder: &'f mut Finder<'s>,
    rays: &'f [Ray],
    splats: &'f mut [Splat],
    lanes: PhantomData<L>,
}

impl<L: Lanes> Task for Find<'_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { finder, rays, splats, .. } = self;
        finder.blend::<L>(rays, splats);
        if finder.mixer.judges {
            finder.judge::<L>(rays, splats);
        }
    }
}

/// Blends sightings into splats.
struct Mixer<'s> {
    cloud: &'s FlatCloud,
    kind: SurfaceKind,
    judges: bool,
    sightings: Vec<Sighting>,
    discs: Vec<Gathered>,
}

/// The nearest disc of each ray.
struct Nearest<W> {
    distances: W,
    /// As the bits of floats, which is how lanes hold them.
    slots: W,
    normals: Vec3Lanes<W>,
    radii: W,
    n_discs: W,
}

impl Mixer<'_> {
    /// Takes each ray's nearest disc alone.
    fn take(&mut self, hits: &[Hit]) -> [f32; WIDE] {
        for (lane, hit) in hits.iter().enumerate().filter(|(_, hit)| !hit.is_miss()) {
            self.sightings.push(Sighting::by_one(lane, *hit));
        }
        [f32::MAX; WIDE]
    }

    /// Blends what was seen by one to sixteen rays up to their limits, and forgets it.
    #[inline(always)]
    fn mix<L: Lanes>(
        &mut self,
        rays: &WideRays<L::Wide>,
        limits: &[f32; WIDE],
        splats: &mut [Splat],
    ) {
        settle::<L::Wide>(&mut self.sightings, limits);
        if self.sightings.is_empty() {
            splats.fill(Splat::MISS);
            return;
        }
        let nearest = self.find_nearest::<L::Wide>();
        let (origin, direction) = (rays.origin(), rays.direction());
        let mut blend = Blend::new(self.kind, nearest.normals, direction);
        for (disc, sighting) in self.discs.iter().zip(&self.sightings) {
            let distances = L::Wide::load(&sighting.distances);
            let position = origin.plus(direction.scaled(distances));
            blend.add(
                disc,
                position.minus(Vec3Lanes::splat(disc.center)),
                sighting.is_seen::<L::Wide>(),
            );
        }
        let (mut normals, colors) = blend.finish();
        if self.kind == SurfaceKind::SplatFit {
            normals = self.fit_planes(normals, splats.len());
        }
        let n_discs = nearest.n_discs.store();
        let mut is_enclosed = 0;
        if self.judges {
            let hits = WideHits {
                position: origin.plus(direction.scaled(nearest.distances)),
                normal: normals,
                direction,
                radius: nearest.radii / L::Wide::splat(self.cloud.surface.radius_factor()),
            };
            let is_hit = L::Wide::splat(0.0).less(nearest.n_discs).bits();
            let lanes = is_hit & ((1 << splats.len()) - 1);
            is_enclosed =
                enclosed_by_blocks::<L>(&self.cloud.points, &self.sightings, lanes, &hits);
        }
        self.sightings.clear();
        let (distances, slots) = (nearest.distances.store(), nearest.slots.store());
        let radii = nearest.radii.store();
        let (normals, colors) = (normals.store_wide(), colors.store_wide());
        for lane in 0..splats.len() {
            splats[lane] = Splat::MISS;
            if 0.0 < n_discs[lane] {
                let vector = |rows: &[[f32; WIDE]; 3]| {
                    Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane])
                };
                splats[lane] = Splat {
                    hit: Hit { distance: distances[lane], slot: slots[lane].to_bits() },
                    n_discs: n_discs[lane] as u32,
                    radius: radii[lane],
                    normal: vector(&normals),
                    color: vector(&colors),
                    is_enclosed: is_enclosed >> lane & 1 == 1,
                };
            }
        }
    }

    /// Fills `discs` with the discs seen.
    #[inline(always)]
    fn find_nearest<W: Wide>(&mut self) -> Nearest<W> {
        let zero = W::splat(0.0);
        let mut nearest = Nearest {
            distances: W::splat(f32::INFINITY),
            slots: W::splat(f32::from_bits(Hit::MISS.slot)),
            normals: Vec3Lanes::splat(Vec3::Z),
            radii: zero,
            n_discs: zero,
        };
        self.discs.clear();
        for sighting in &self.sightings {
            let disc = self.cloud.points.gathered(sighting.slot);
            let distances = W::load(&sighting.distances);
            // They come by slot, so of equal ones the first counts.
            let is_nearer = distances.less(nearest.distances);
            let slot = W::splat(f32::from_bits(sighting.slot));
            let normal = Vec3Lanes::splat(disc.normal);
            nearest.distances = W::select(is_nearer, distances, nearest.distances);
            nearest.slots = W::select(is_nearer, slot, nearest.slots);
            nearest.normals = Vec3Lanes::select(is_nearer, normal, nearest.normals);
            nearest.radii = W::select(is_nearer, W::splat(disc.radius), nearest.radii);
            nearest.n_discs =
                nearest.n_discs + W::select(sighting.is_seen::<W>(), W::splat(1.0), zero);
            self.discs.push(disc);
        }
        nearest
    }

    /// Replaces normals by those of planes through the discs' centres, where these span one.
    fn fit_planes<W: Wide>(&self, normals: Vec3Lanes<W>, n_rays: usize) -> Vec3Lanes<W> {
        let [mut x, mut y, mut z] = normals.store_wide();
        for lane in 0..n_rays {
            let mut centers = [Vec3::ZERO; MAX_GATHERED];
            let mut n = 0;
            for (disc, sighting) in self.discs.iter().zip(&self.sightings) {
                if !sighting.distances[lane].is_nan() {
                    centers[n] = disc.center;
                    n += 1;
                }
            }
            let facing = Vec3::new(x[lane], y[lane], z[lane]);
            if let Some(normal) = (0 < n).then(|| plane_normal(&centers[..n])).flatten() {
                let normal = if normal.dot(facing) < 0.0 { -normal } else { normal };
                [x[lane], y[lane], z[lane]] = normal.to_array();
            }
        }
        Vec3Lanes::load_wide(&[x, y, z])
    }
}
