//! Brute force: searches as loops over all decoded points, and the comparison of batches of rays with them.

use surfel_core::flat::FlatCloud;
use surfel_core::math::{LANES, LaneMask, Lanes, PortableLanes, Ray};
use surfel_core::surface::{Disc, MAX_GATHERED, RayLanes, Shape, Sphere, gather_limit};
use surfel_core::trace::{self, Gather, Hit, Simd};

/// Rays of one scene with the hits that brute force finds along them.
pub struct BruteForce<'s> {
    scene: &'s FlatCloud,
    /// The rays.
    pub rays: Vec<Ray>,
    /// The closest hit of each ray.
    pub closest: Vec<Hit>,
    /// The hits that each ray gathers, nearest first.
    gathers: Vec<Vec<Hit>>,
}

impl<'s> BruteForce<'s> {
    /// Searches all points along all rays.
    pub fn new(scene: &'s FlatCloud, rays: Vec<Ray>) -> Self {
        let hits: Vec<Vec<HitWithRadius>> = rays.iter().map(|ray| all_hits(scene, ray)).collect();
        let closest = hits.iter().map(|hits| hits.first().map_or(Hit::MISS, |(hit, _)| *hit));
        let (closest, gathers) =
            (closest.collect(), hits.iter().map(|hits| gather(hits)).collect());
        Self { scene, rays, closest, gathers }
    }

    /// Panics unless all searches find the same bits at every SIMD level when the rays are taken in this
    /// order and cut into batches of these lengths, which repeat.
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

    /// Panics unless all searches find the same when all rays are one batch.
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
        if self.scene.surface.uses_discs() {
            trace::gathers(self.scene, simd, &rays, &mut gathers);
        }
        for (position, &i) in batch.iter().enumerate() {
            let context = || {
                let (simd, kind) = (simd.name(), self.scene.surface);
                format!("{name}, {kind:?}, {simd}, {position} of {n}: {i}, {:?}", rays[position])
            };
            let (found, expected) = (closest[position], self.closest[i]);
            assert_eq!(bits(&found), bits(&expected), "{found:?} {expected:?} {}", context());
            assert_eq!(any[position], !expected.is_miss(), "{}", context());
            if self.scene.surface.uses_discs() {
                let (found, expected) = (gathers[position].hits(), &self.gathers[i]);
                let is_same = found.iter().map(bits).eq(expected.iter().map(bits));
                assert!(is_same, "{found:?} {expected:?} {}", context());
            }
        }
    }
}

fn bits(hit: &Hit) -> (u32, u32) {
    (hit.distance.to_bits(), hit.slot)
}

/// A hit with the radius of the point that was hit.
pub type HitWithRadius = (Hit, f32);

/// Returns all hits in the ray's range, nearest first.
pub fn all_hits(scene: &FlatCloud, ray: &Ray) -> Vec<HitWithRadius> {
    let ray_lanes = RayLanes::new(ray);
    let mut found = Vec::new();
    for (block_idx, block) in scene.points.blocks.iter().enumerate() {
        let points = block.points::<PortableLanes>(ray.origin);
        let (distances, mask) = if scene.surface.uses_discs() {
            Disc::intersect(&points, &ray_lanes)
        } else {
            Sphere::intersect(&points, &ray_lanes)
        };
        let lanes = mask.bits() & u32::from(block.occupied_lanes());
        for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
            // Negative zero becomes positive zero.
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

/// Returns the hits that a splat blends: those within the gather limit of the nearest.
fn gather(hits: &[HitWithRadius]) -> Vec<Hit> {
    within_limit(hits).map(|(hit, _)| *hit).take(MAX_GATHERED).collect()
}

/// Returns the hits within the gather limit.
pub fn within_limit(hits: &[HitWithRadius]) -> impl Iterator<Item = &HitWithRadius> {
    let limit =
        hits.iter().fold(f32::INFINITY, |all, (hit, r)| all.min(gather_limit(hit.distance, *r)));
    hits.iter().filter(move |(hit, _)| hit.distance <= limit)
}
