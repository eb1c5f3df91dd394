//! Smooth value noise on a lattice of hashed numbers.

use surfel_core::math::DVec3;
use surfel_core::math::hash;

/// Returns value noise in [-1, 1] with features one unit wide. It is C1, with a slope below 5.2.
pub fn noise(point: DVec3) -> f64 {
    let cell = point.floor();
    let f = point - cell;
    let blend = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let at =
        |x: i64, y: i64, z: i64| lattice(cell.x as i64 + x, cell.y as i64 + y, cell.z as i64 + z);
    let row = |y, z| mix(at(0, y, z), at(1, y, z), blend.x);
    let plane = |z| mix(row(0, z), row(1, z), blend.y);
    mix(plane(0), plane(1), blend.z)
}

/// Returns fractal noise in [-1, 1]: a sum of octaves, each half as high and twice as fine as the previous one.
pub fn fbm(point: DVec3, octaves: u32) -> f64 {
    let (mut sum, mut weight, mut total, mut point) = (0.0, 1.0, 0.0, point);
    for _ in 0..octaves {
        sum += weight * noise(point);
        total += weight;
        weight *= 0.5;
        // The shift keeps the lattices of the octaves from coinciding at the origin.
        point = 2.0 * point + DVec3::new(17.3, 31.7, 5.1);
    }
    sum / total
}

/// Hashes a key to a number in [0, 1).
pub fn unit(key: u64) -> f64 {
    (hash(key) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Interpolates smoothly from 0 at `low` to 1 at `high`.
pub fn smoothstep(low: f64, high: f64, value: f64) -> f64 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Interpolates linearly from `a` to `b`.
pub fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + t * (b - a)
}

fn lattice(x: i64, y: i64, z: i64) -> f64 {
    let key = (x as u64).wrapping_mul(0x9e37_79b1_85eb_ca87)
        ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
        ^ (z as u64).wrapping_mul(0x1656_67b1_9e37_79f9);
    2.0 * unit(key) - 1.0
}

#[cfg(test)]
mod tests {
    //! Bounds of the noise.

    use super::*;
    use surfel_core::math::Random;

    #[test]
    fn noise_stays_within_its_range_and_slope() {
        let mut random = Random::new(3, 0);
        for _ in 0..20_000 {
            let point = 40.0 * DVec3::new(random.next_f64(), random.next_f64(), random.next_f64());
            let step = 1e-4 * DVec3::new(random.next_gaussian(), 0.5, random.next_gaussian());
            assert!(noise(point).abs() <= 1.0 && fbm(point, 4).abs() <= 1.0);
            // The slope along an axis is at most 3: that of the blend, 1.5, times the largest difference, 2.
            assert!((noise(point + step) - noise(point)).abs() <= 3.0 * step.abs().element_sum());
        }
    }

    #[test]
    fn smoothstep_is_0_and_1_at_its_ends() {
        assert_eq!([0.0, 0.2, 0.8, 1.0].map(|t| smoothstep(0.2, 0.8, t)), [0.0, 0.0, 1.0, 1.0]);
        assert!((smoothstep(0.2, 0.8, 0.5) - 0.5).abs() < 1e-15);
    }
}
