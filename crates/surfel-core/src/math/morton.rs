//! Morton order of the cells of a square, in which most neighbours lie close to each other (Morton 1966).

/// Returns the column and the row of the cell with this Morton code.
pub fn morton_decode(code: u32) -> (u32, u32) {
    (even_bits(code), even_bits(code >> 1))
}

/// Packs bits 0, 2, 4 and so on side by side.
fn even_bits(bits: u32) -> u32 {
    let bits = bits & 0x5555_5555;
    let bits = (bits | bits >> 1) & 0x3333_3333;
    let bits = (bits | bits >> 2) & 0x0f0f_0f0f;
    let bits = (bits | bits >> 4) & 0x00ff_00ff;
    (bits | bits >> 8) & 0x0000_ffff
}

#[cfg(test)]
mod tests {
    //! Morton codes decode to the cells of a square, quarter by quarter.

    use super::*;

    #[test]
    fn each_quarter_of_a_square_comes_before_the_next() {
        let first = [0, 1, 2, 3, 4, 8, 12, 16].map(morton_decode);
        assert_eq!(first, [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (2, 2), (4, 0)]);
        assert_eq!(morton_decode(u32::MAX), (0xffff, 0xffff));
        let mut cells: Vec<_> = (0..4096).map(morton_decode).collect();
        cells.sort_by_key(|&(x, y)| (y, x));
        assert!(cells.into_iter().eq((0..64).flat_map(|y| (0..64).map(move |x| (x, y)))));
    }
}
