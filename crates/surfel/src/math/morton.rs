//! The order of a square's places in which neighbours mostly lie close to each other (Morton 1966).

/// Column and row of the place with this number in Morton order.
pub fn morton_place(number: u32) -> (u32, u32) {
    (even_bits(number), even_bits(number >> 1))
}

/// Bits 0, 2, 4 and so on side by side.
fn even_bits(bits: u32) -> u32 {
    let bits = bits & 0x5555_5555;
    let bits = (bits | bits >> 1) & 0x3333_3333;
    let bits = (bits | bits >> 2) & 0x0f0f_0f0f;
    let bits = (bits | bits >> 4) & 0x00ff_00ff;
    (bits | bits >> 8) & 0x0000_ffff
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_quarter_of_a_square_is_walked_before_the_next() {
        let first = [0, 1, 2, 3, 4, 8, 12, 16].map(morton_place);
        assert_eq!(first, [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (2, 2), (4, 0)]);
        assert_eq!(morton_place(u32::MAX), (0xffff, 0xffff));
        let mut places: Vec<_> = (0..4096).map(morton_place).collect();
        places.sort_by_key(|&(x, y)| (y, x));
        assert!(places.into_iter().eq((0..64).flat_map(|y| (0..64).map(move |x| (x, y)))));
    }
}
