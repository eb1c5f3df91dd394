//! Counter-based random numbers: a key and a counter give the same number on every thread.

/// Hashes `value` by mixing all its bits (the finaliser of SplitMix64, Steele et al. 2014).
pub fn hash(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

/// A stream of random numbers that a key selects; streams of different keys are independent.
#[derive(Clone, Debug)]
pub struct Random {
    key: u64,
    counter: u64,
}

impl Random {
    /// Returns the stream of this number under this seed.
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { key: hash(seed ^ hash(stream)), counter: 0 }
    }

    /// Returns 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.counter += 1;
        hash(self.key ^ hash(self.counter))
    }

    /// Returns a number uniform in [0, 1).
    pub fn next_f32(&mut self) -> f32 {
        (self.next_u64() >> 40) as f32 * (1.0 / (1u64 << 24) as f32)
    }

    /// Returns a number uniform in [0, 1).
    pub fn next_f64(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Returns an integer uniform in 0..bound (multiply-shift, Lemire 2019; the bias is below bound / 2^64).
    pub fn below(&mut self, bound: u64) -> u64 {
        ((u128::from(self.next_u64()) * u128::from(bound)) >> 64) as u64
    }

    /// Returns a normally distributed number of mean 0 and standard deviation 1 (Box and Muller 1958).
    pub fn next_gaussian(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.next_f64()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.next_f64()).cos()
    }
}

#[cfg(test)]
mod tests {
    //! Streams repeat by key and have the moments of their distributions.

    use super::*;

    #[test]
    fn equal_keys_give_equal_streams() {
        let draw = |seed, stream| {
            let mut random = Random::new(seed, stream);
            (0..8).map(|_| random.next_u64()).collect::<Vec<_>>()
        };
        assert_eq!(draw(1, 2), draw(1, 2));
        assert_ne!(draw(1, 2), draw(1, 3));
        assert_ne!(draw(1, 2), draw(2, 2));
    }

    #[test]
    fn uniform_numbers_have_mean_and_variance_of_the_unit_interval() {
        let mut random = Random::new(7, 0);
        let values: Vec<f64> = (0..100_000).map(|_| f64::from(random.next_f32())).collect();
        let mean = values.iter().sum::<f64>() / 1e5;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 1e5;
        // Five standard errors: sqrt(1/12/1e5) = 0.0009; for the variance sqrt(1/180/1e5) = 0.00024.
        assert!((mean - 0.5).abs() < 0.0045, "{mean}");
        assert!((variance - 1.0 / 12.0).abs() < 0.0012, "{variance}");
        assert!(values.iter().all(|v| (0.0..1.0).contains(v)));
    }

    #[test]
    fn gaussian_numbers_have_unit_variance() {
        let mut random = Random::new(7, 1);
        let values: Vec<f64> = (0..100_000).map(|_| random.next_gaussian()).collect();
        let mean = values.iter().sum::<f64>() / 1e5;
        let variance = values.iter().map(|v| v * v).sum::<f64>() / 1e5;
        assert!(mean.abs() < 0.016, "{mean}");
        assert!((variance - 1.0).abs() < 0.023, "{variance}");
    }
}
