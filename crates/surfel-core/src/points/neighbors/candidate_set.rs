//! Sets of the neighbours found so far: the nearest k, few or many, or all within a distance.

use super::neighbor::{Neighbor, key, neighbor};

/// A set of candidates for the neighbours of a point, by their keys.
pub(super) trait CandidateSet {
    /// Returns the key below which points are still candidates.
    fn bound(&self) -> u64;

    /// Returns the squared distance up to which points are still candidates.
    #[inline]
    fn max_distance_squared(&self) -> f32 {
        f32::from_bits((self.bound() >> 32) as u32)
    }

    /// Inserts a key lower than `bound`.
    fn insert(&mut self, key: u64);

    /// Moves the neighbours to `neighbors`, nearest first, and empties the set.
    fn drain_sorted(&mut self, neighbors: &mut Vec<Neighbor>);
}

/// A set of the k nearest candidates.
pub(super) trait NearestSet: CandidateSet {
    /// Limits the candidates of an empty set to a squared distance within which there are at least k points.
    fn limit_to(&mut self, distance_squared: f32);
}

/// The number of neighbours from which [`KNearest`], which inserts each in its place, takes longer than [`ManyNearest`].
pub(super) const MANY: usize = 48;

/// The key of an unused entry: at infinite distance, with an index that no point has.
const UNUSED: u64 = ((f32::INFINITY.to_bits() as u64) << 32) | u32::MAX as u64;

/// The k candidates with the lowest keys.
pub(super) struct KNearest {
    k: usize,
    /// A pair of zeros, then the k lowest keys, and one more if k is odd, in ascending order. They are kept as
    /// floating-point numbers, which sort as their bits do and which every processor can compare in pairs.
    keys: Vec<[f64; 2]>,
}

impl KNearest {
    /// Creates an empty set of at most `k` candidates.
    pub fn new(k: usize) -> Self {
        let mut keys = vec![[f64::from_bits(UNUSED); 2]; 1 + k.div_ceil(2)];
        keys[0] = [0.0; 2];
        Self { k, keys }
    }
}

impl NearestSet for KNearest {
    fn limit_to(&mut self, distance_squared: f32) {
        self.keys[1..].fill([f64::from_bits(key(distance_squared, u32::MAX)); 2]);
    }
}

impl CandidateSet for KNearest {
    #[inline]
    fn bound(&self) -> u64 {
        let last = 1 + self.k;
        self.keys[last / 2][last % 2].to_bits()
    }

    /// Replaces every key by the median of itself, its predecessor and the new key, which inserts without a branch.
    /// A loop that shifts up to the insertion point, which cannot be predicted, made all normals of a cloud take 1.4
    /// times as many cycles. Each pair is read as it was written: a read across two pairs would wait until both
    /// have left the store buffer.
    #[inline]
    fn insert(&mut self, key: u64) {
        let key = f64::from_bits(key);
        let mut pair = self.keys[self.keys.len() - 1];
        for i in (1..self.keys.len()).rev() {
            let previous = self.keys[i - 1];
            let later = [max(previous[1], key), max(pair[0], key)];
            self.keys[i] = [min(pair[0], later[0]), min(pair[1], later[1])];
            pair = previous;
        }
    }

    fn drain_sorted(&mut self, neighbors: &mut Vec<Neighbor>) {
        neighbors.clear();
        let keys = self.keys[1..].as_flattened().iter().take(self.k).map(|key| key.to_bits());
        neighbors.extend(keys.filter(|&key| key < UNUSED).map(neighbor));
        self.keys[1..].fill([f64::from_bits(UNUSED); 2]);
    }
}

/// Returns the minimum with one instruction, unlike `f64::min`, which handles NaN.
#[inline]
fn min(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Returns the maximum with one instruction.
#[inline]
fn max(a: f64, b: f64) -> f64 {
    if b < a { a } else { b }
}

/// The k candidates with the lowest keys, for large k: twice as many are collected, and then the higher half is dropped.
/// [`KNearest`] moves all of its keys for each new one.
pub(super) struct ManyNearest {
    k: usize,
    bound: u64,
    keys: Vec<u64>,
}

impl ManyNearest {
    /// Creates an empty set of at most `k` candidates, at least 1.
    pub fn new(k: usize) -> Self {
        Self { k, bound: UNUSED, keys: Vec::with_capacity(2 * k) }
    }
}

impl NearestSet for ManyNearest {
    fn limit_to(&mut self, distance_squared: f32) {
        self.bound = key(distance_squared, u32::MAX);
    }
}

impl CandidateSet for ManyNearest {
    #[inline]
    fn bound(&self) -> u64 {
        self.bound
    }

    #[inline]
    fn insert(&mut self, key: u64) {
        self.keys.push(key);
        if self.keys.len() == 2 * self.k {
            self.bound = *self.keys.select_nth_unstable(self.k - 1).1;
            self.keys.truncate(self.k);
        }
    }

    fn drain_sorted(&mut self, neighbors: &mut Vec<Neighbor>) {
        self.keys.sort_unstable();
        neighbors.clear();
        neighbors.extend(self.keys.drain(..).take(self.k).map(neighbor));
        self.bound = UNUSED;
    }
}

/// All candidates within a distance.
pub(super) struct WithinDistance {
    limit: u64,
    keys: Vec<u64>,
}

impl WithinDistance {
    /// Creates an empty set of candidates within a squared distance.
    pub fn new(distance_squared: f32) -> Self {
        Self { limit: key(distance_squared, u32::MAX), keys: Vec::new() }
    }
}

impl CandidateSet for WithinDistance {
    #[inline]
    fn bound(&self) -> u64 {
        self.limit
    }

    #[inline]
    fn insert(&mut self, key: u64) {
        self.keys.push(key);
    }

    fn drain_sorted(&mut self, neighbors: &mut Vec<Neighbor>) {
        self.keys.sort_unstable();
        neighbors.clear();
        neighbors.extend(self.keys.drain(..).map(neighbor));
    }
}
