//! What a search has found so far: the nearest k, or all within a distance.

use super::{Neighbor, key, neighbor};

/// Collects neighbours by their keys.
pub(super) trait Found {
    /// Only lower keys are still sought.
    fn worst(&self) -> u64;

    /// Only squared distances up to this are still sought.
    #[inline]
    fn limit(&self) -> f32 {
        f32::from_bits((self.worst() >> 32) as u32)
    }

    /// Takes a key lower than `worst`.
    fn offer(&mut self, key: u64);

    /// Hands out what was found, nearest first, and starts anew.
    fn finish(&mut self, neighbors: &mut Vec<Neighbor>);
}

/// Infinitely far, of an index that no point has.
const UNFILLED: u64 = ((f32::INFINITY.to_bits() as u64) << 32) | u32::MAX as u64;

/// The k lowest keys.
pub(super) struct Nearest {
    k: usize,
    /// A pair of zeros, then the k lowest keys, and one more if k is odd, all rising. They are kept as
    /// floating-point numbers, which sort as their bits do and which every processor can compare in pairs.
    keys: Vec<[f64; 2]>,
}

impl Nearest {
    pub fn new(k: usize) -> Self {
        let mut keys = vec![[f64::from_bits(UNFILLED); 2]; 1 + k.div_ceil(2)];
        keys[0] = [0.0; 2];
        Self { k, keys }
    }

    /// Nothing farther than this squared distance is sought: at least k points must be as near.
    pub fn bound(&mut self, distance_squared: f32) {
        self.keys[1..].fill([f64::from_bits(key(distance_squared, u32::MAX)); 2]);
    }
}

impl Found for Nearest {
    #[inline]
    fn worst(&self) -> u64 {
        let last = 1 + self.k;
        self.keys[last / 2][last % 2].to_bits()
    }

    /// Every key becomes the middle one of itself, its predecessor and the new key. That inserts without a
    /// branch; with a loop that shifts up to the place, which cannot be predicted, all normals of a cloud
    /// took 1.4 times as many cycles. Each pair is read just as it was written: a read across two pairs
    /// waits until both have left the store buffer.
    #[inline]
    fn offer(&mut self, key: u64) {
        let key = f64::from_bits(key);
        let mut pair = self.keys[self.keys.len() - 1];
        for i in (1..self.keys.len()).rev() {
            let before = self.keys[i - 1];
            let later = [higher(before[1], key), higher(pair[0], key)];
            self.keys[i] = [lower(pair[0], later[0]), lower(pair[1], later[1])];
            pair = before;
        }
    }

    fn finish(&mut self, neighbors: &mut Vec<Neighbor>) {
        neighbors.clear();
        let keys = self.keys[1..].as_flattened().iter().take(self.k).map(|key| key.to_bits());
        neighbors.extend(keys.filter(|&key| key < UNFILLED).map(neighbor));
        self.keys[1..].fill([f64::from_bits(UNFILLED); 2]);
    }
}

/// One instruction, which `f64::min` with its care for NaN is not.
fn lower(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

fn higher(a: f64, b: f64) -> f64 {
    if b < a { a } else { b }
}

/// All keys below a fixed one.
pub(super) struct Within {
    limit: u64,
    keys: Vec<u64>,
}

impl Within {
    pub fn new(distance_squared: f32) -> Self {
        Self { limit: key(distance_squared, u32::MAX), keys: Vec::new() }
    }
}

impl Found for Within {
    #[inline]
    fn worst(&self) -> u64 {
        self.limit
    }

    #[inline]
    fn offer(&mut self, key: u64) {
        self.keys.push(key);
    }

    fn finish(&mut self, neighbors: &mut Vec<Neighbor>) {
        self.keys.sort_unstable();
        neighbors.clear();
        neighbors.extend(self.keys.drain(..).map(neighbor));
    }
}
