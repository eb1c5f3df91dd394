//! Samples at about equal steps.

/// Returns the indices of at most about `max` of `n_points` points at about equal steps; all of them if there are no more. The
/// steps vary a little, so that they do not follow the rings or columns in which scanners order their points.
pub fn sample_indices(n_points: usize, max: usize) -> impl Iterator<Item = usize> {
    let step = n_points.div_ceil(max).max(1);
    let starts = (0..n_points).step_by(step).enumerate();
    let jittered = starts.map(move |(i, start)| {
        let golden = (i as u32).wrapping_mul(0x9e37_79b9);
        start + ((u64::from(golden) * step as u64) >> 32) as usize
    });
    jittered.filter(move |i| *i < n_points)
}

#[cfg(test)]
mod tests {
    //! Samples are spread over all points.

    use super::*;

    #[test]
    fn samples_are_spread_over_all_points_in_no_step_with_them() {
        assert!(sample_indices(7, 7).eq(0..7));
        assert_eq!(sample_indices(0, 7).count(), 0);
        let sampled: Vec<usize> = sample_indices(64_000, 1000).collect();
        assert!((990..=1000).contains(&sampled.len()), "{}", sampled.len());
        assert!(sampled.windows(2).all(|pair| pair[0] < pair[1]));
        let n_of_ring = |ring: usize| sampled.iter().filter(|i| *i % 64 == ring).count();
        assert!((0..64).all(|ring| (5..30).contains(&n_of_ring(ring))));
    }
}
