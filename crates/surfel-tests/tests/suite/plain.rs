//! The searches as a plain loop over the decoded points, and batches of rays compared with it.

use surfel::flat::FlatCloud;
use surfel::math::{LANES, LaneMask, Lanes, PortableLanes, Ray};
use surfel::surface::{Disc, MAX_GATHERED, RayLanes, Shape, Sphere, gather_limit};
use surfel::trace::{self, Gather, Hit, Simd};

/// Rays with what each of them finds.
pub struct Plain<'s> {
    scene: &'s FlatCloud,
    pub rays: Vec<Ray>,
    pub closest: Vec<Hit>,
    gathers: Vec<Vec<Hit>>,
}

impl<'s> Plain<'s> {
    pub fn new(scene: &'s FlatCloud, rays: Vec<Ray>) -> Self {
        let hits: Vec<Vec<Found>> = rays.iter().map(|ray| all_hits(scene, ray)).collect();
        let closest = hits.iter().map(|hits| hits.first().map_or(Hit::MISS, |(hit, _)| *hit));
        let (closest, gathers) =
            (closest.collect(), hits.iter().map(|hits| gather(hits)).collect());
        Self { scene, rays, closest, gathers }
    }

    /// Panics unless all searches find the same at every SIMD level, bit for bit, when the rays are
    /// taken in this order and cut into batches of these lengths, over and over.
    pub fn check(&self, name: &str, order: &[usize], batch_lens: &[usize]) {
        for simd in Simd::available() {
            let (mut rest, mut lens) = (order, batch_lens.iter().cycle());
            while !rest.is_empty() {
                let (batch, later) = rest.split_at(*lens.next().unwrap().min(&rest.len()));
                self.check_batch(name, simd, batch);
                rest = later;
            }
        }
    }

    pub fn check_in_order(&self, name: &str) {
        let order: Vec<usize> = (0..self.rays.len()).collect();
        self.check(name, &order, &[order.len()]);
    }

    fn check_batch(&self, name: &str, simd: Simd, batch: &[usize]) {
        let rays: Vec<Ray> = batch.iter().map(|&i| self.rays[i]).collect();
        let n = rays.len();
        let mut closest = vec![Hit::MISS; n];
        let mut any = vec![false; n];
        let mut gathers = vec![Gather::EMPTY; n];
        trace::closest_hits(self.scene, simd, &rays, &mut closest);
        trace::any_hits(self.scene, simd, &rays, &mut any);
        if self.scene.surface.is_oriented() {
            trace::gathers(self.scene, simd, &rays, &mut gathers);
        }
        for (place, &i) in batch.iter().enumerate() {
            let context = || {
                let (simd, kind) = (simd.name(), self.scene.surface);
                format!("{name}, {kind:?}, {simd}, {place} of {n}: {i}, {:?}", rays[place])
            };
            let (found, expected) = (closest[place], self.closest[i]);
            assert_eq!(bits(&found), bits(&expected), "{found:?} {expected:?} {}", context());
            assert_eq!(any[place], !expected.is_miss(), "{}", context());
            if self.scene.surface.is_oriented() {
                let (found, expected) = (gathers[place].hits(), &self.gathers[i]);
                let is_same = found.iter().map(bits).eq(expected.iter().map(bits));
                assert!(is_same, "{found:?} {expected:?} {}", context());
            }
        }
    }
}

fn bits(hit: &Hit) -> (u32, u32) {
    (hit.distance.to_bits(), hit.slot)
}

/// One hit with the radius of what was hit.
type Found = (Hit, f32);

/// All hits in the ray's range, in order.
fn all_hits(scene: &FlatCloud, ray: &Ray) -> Vec<Found> {
    let ray_lanes = RayLanes::new(ray);
    let mut found = Vec::new();
    for (block_idx, block) in scene.points.blocks.iter().enumerate() {
        let points = block.points::<PortableLanes>(ray.origin);
        let (distances, mask) = if scene.surface.is_oriented() {
            Disc::intersect(&points, &ray_lanes)
        } else {
            Sphere::intersect(&points, &ray_lanes)
        };
        let lanes = mask.bits() & u32::from(block.occupied());
        for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
            // Of the two zeros the positive one.
            let distance = distances.store()[lane] + 0.0;
            if distance <= ray.t_max {
                let slot = (block_idx * LANES + lane) as u32;
                found.push((Hit { distance, slot }, points.radius.store()[lane]));
            }
        }
    }
    found.sort_by(|(a, _), (b, _)| a.distance.total_cmp(&b.distance).then(a.slot.cmp(&b.slot)));
    found
}

fn gather(hits: &[Found]) -> Vec<Hit> {
    let limit =
        hits.iter().fold(f32::INFINITY, |all, (hit, r)| all.min(gather_limit(hit.distance, *r)));
    let near = hits.iter().map(|(hit, _)| *hit).filter(|hit| hit.distance <= limit);
    near.take(MAX_GATHERED).collect()
}
