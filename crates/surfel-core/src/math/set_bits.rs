//! Iteration over the set bits of a mask of lanes.

/// Returns the indices of the set bits of `mask`, lowest first.
///
/// All of them must be below `N`. They are reduced modulo `N`, which costs nothing and spares the bounds
/// check of an array of `N` lanes.
#[inline(always)]
pub fn set_bits<const N: usize>(mask: u32) -> SetBits<N> {
    SetBits { mask }
}

/// The iterator that [`set_bits`] returns.
#[derive(Clone, Copy, Debug)]
pub struct SetBits<const N: usize> {
    mask: u32,
}

impl<const N: usize> SetBits<N> {
    /// Returns the bits that are still to come.
    #[inline(always)]
    pub fn remaining(self) -> u32 {
        self.mask
    }
}

impl<const N: usize> Iterator for SetBits<N> {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.mask == 0 {
            return None;
        }
        let idx = self.mask.trailing_zeros() as usize % N;
        self.mask &= self.mask - 1;
        Some(idx)
    }
}

#[cfg(test)]
mod tests {
    //! Set bits are found in order.

    use super::*;

    #[test]
    fn set_bits_come_lowest_first() {
        assert_eq!(set_bits::<8>(0b1010_0001).collect::<Vec<_>>(), [0, 5, 7]);
        assert_eq!(set_bits::<32>(1 << 31).collect::<Vec<_>>(), [31]);
        assert_eq!(set_bits::<16>(0).next(), None);
        let mut bits = set_bits::<8>(0b110);
        bits.next();
        assert_eq!(bits.remaining(), 0b100);
    }
}
