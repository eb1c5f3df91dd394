//! Maps from the unit square to directions, and the stratified points for them.

use super::Vec3;
use std::f32::consts::TAU;

/// Maps the unit square to the unit disk and preserves areas (concentric map, Shirley and Chiu 1997).
pub fn disk((u, v): (f32, f32)) -> (f32, f32) {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if a == 0.0 && b == 0.0 {
        return (0.0, 0.0);
    }
    let (radius, angle) = if b.abs() < a.abs() {
        (a, TAU / 8.0 * (b / a))
    } else {
        (b, TAU / 4.0 - TAU / 8.0 * (a / b))
    };
    (radius * angle.cos(), radius * angle.sin())
}

/// Maps the unit square to directions around +Z with density cos / pi (Malley's method).
pub fn cosine_hemisphere(uv: (f32, f32)) -> Vec3 {
    let (x, y) = disk(uv);
    Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// Maps the unit square to directions around +Z, uniform within the cone of half angle acos(`cos_max`).
pub fn uniform_cone(uv: (f32, f32), cos_max: f32) -> Vec3 {
    let (x, y) = disk(uv);
    let height = 1.0 - cos_max;
    let squared = x * x + y * y;
    // A disk point at squared radius s goes to height 1 - s*(1 - cos_max), so that equal areas stay equal
    // (Archimedes).
    let z = 1.0 - squared * height;
    let stretch = (height * (1.0 + z)).max(0.0).sqrt();
    Vec3::new(x * stretch, y * stretch, z)
}

/// Returns point `index` of a (0,2)-sequence (Sobol' 1967), Owen-scrambled by `seed` (hash of Laine and
/// Karras 2011, corrected by Vegdahl 2021). Any 2^k successive points from a multiple of 2^k are stratified.
pub fn owen_sobol_2d(index: u32, seed: u64) -> (f32, f32) {
    let index = owen_scramble(index, (seed >> 40) as u32);
    let x = owen_scramble(index.reverse_bits(), seed as u32);
    let y = owen_scramble(sobol_second_dimension(index), (seed >> 32) as u32 ^ 0x68bc_21eb);
    (unit_interval(x), unit_interval(y))
}

fn sobol_second_dimension(mut index: u32) -> u32 {
    let mut direction = 1u32 << 31;
    let mut result = 0;
    while index != 0 {
        if index & 1 == 1 {
            result ^= direction;
        }
        index >>= 1;
        direction ^= direction >> 1;
    }
    result
}

fn owen_scramble(value: u32, seed: u32) -> u32 {
    let mut x = value.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

fn unit_interval(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
}

#[cfg(test)]
mod tests {
    //! Directions have their densities, and Sobol' points are stratified.

    use super::*;

    #[test]
    fn cosine_hemisphere_has_its_mean_height() {
        let n = 1 << 14;
        let directions = (0..n).map(|i| cosine_hemisphere(owen_sobol_2d(i, 5)));
        let mean = directions.map(|d| f64::from(d.z)).sum::<f64>() / f64::from(n);
        // The mean of z under density z / pi is 2/3.
        assert!((mean - 2.0 / 3.0).abs() < 1e-3, "{mean}");
    }

    #[test]
    fn uniform_cone_is_uniform_in_height() {
        let (n, cos_max) = (1 << 12, 0.9);
        for i in 0..n {
            let d = uniform_cone(owen_sobol_2d(i, 9), cos_max);
            assert!((d.length() - 1.0).abs() < 1e-5 && d.z >= cos_max - 1e-6);
        }
        let mean =
            (0..n).map(|i| f64::from(uniform_cone(owen_sobol_2d(i, 9), cos_max).z)).sum::<f64>();
        assert!((mean / f64::from(n) - 0.95).abs() < 1e-3);
    }

    #[test]
    fn owen_sobol_points_are_stratified() {
        for seed in 0..20u64 {
            let seed = crate::math::hash(seed);
            for (columns, rows) in [(16, 1), (8, 2), (4, 4), (2, 8), (1, 16)] {
                for start in [0, 16, 48] {
                    let mut cells = [0; 16];
                    for i in start..start + 16 {
                        let (x, y) = owen_sobol_2d(i, seed);
                        cells[(x * columns as f32) as usize * rows + (y * rows as f32) as usize] +=
                            1;
                    }
                    assert_eq!(cells, [1; 16], "seed {seed} {columns}x{rows} from {start}");
                }
            }
        }
    }
}
