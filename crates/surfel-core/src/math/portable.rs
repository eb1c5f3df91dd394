//! Lanes without SIMD instructions.

use super::{DoubledLanes, Floats, LANES, LaneMask, Lanes, SimdTask, set_bits};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Eight floats in an array: the reference against which other implementations are tested.
#[derive(Clone, Copy, Debug)]
pub struct PortableLanes([f32; LANES]);

/// The mask of `PortableLanes`.
#[derive(Clone, Copy, Debug)]
pub struct PortableMask([bool; LANES]);

impl PortableLanes {
    #[inline(always)]
    fn map(self, other: Self, operation: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| operation(self.0[i], other.0[i])))
    }
}

impl Floats for PortableLanes {
    type Mask = PortableMask;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.map(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.map(other, |a, b| if b < a { a } else { b })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> PortableMask {
        PortableMask(std::array::from_fn(|i| self.0[i] < other.0[i]))
    }

    #[inline(always)]
    fn le(self, other: Self) -> PortableMask {
        PortableMask(std::array::from_fn(|i| self.0[i] <= other.0[i]))
    }

    #[inline(always)]
    fn lt_u32(self, other: Self) -> PortableMask {
        PortableMask(std::array::from_fn(|i| self.0[i].to_bits() < other.0[i].to_bits()))
    }

    #[inline(always)]
    fn select(mask: PortableMask, if_true: Self, if_false: Self) -> Self {
        Self(std::array::from_fn(|i| if mask.0[i] { if_true.0[i] } else { if_false.0[i] }))
    }
}

/// Returns the set lanes in the order of falling `keys`.
fn descending_order(keys: [f32; LANES], lanes: u32) -> [usize; LANES] {
    let (mut order, mut n) = ([0; LANES], 0);
    for lane in set_bits::<LANES>(lanes) {
        let mut i = n;
        while 0 < i && keys[order[i - 1]] <= keys[lane] {
            order[i] = order[i - 1];
            i -= 1;
        }
        order[i] = lane;
        n += 1;
    }
    order
}

impl Lanes for PortableLanes {
    type PacketLanes = DoubledLanes<Self>;

    #[inline(always)]
    fn load(values: &[f32; LANES]) -> Self {
        Self(*values)
    }

    #[inline(always)]
    fn from_u8(values: &[u8; LANES]) -> Self {
        Self(values.map(f32::from))
    }

    #[inline(always)]
    fn from_u16(values: &[u16; LANES]) -> Self {
        Self(values.map(f32::from))
    }

    #[inline(always)]
    fn from_signed_bits<const SHIFT: i32>(words: &[u32; LANES]) -> Self {
        Self(words.map(|word| ((word << (22 - SHIFT)) as i32 >> 22) as f32))
    }

    #[inline(always)]
    fn from_top_bits(words: &[u32; LANES]) -> Self {
        Self(words.map(|word| (word >> 30) as f32))
    }

    #[inline(always)]
    fn store(self) -> [f32; LANES] {
        self.0
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, f32::max)
    }

    #[inline(always)]
    fn packed_indices(lanes: PortableMask, first: u32, other: u32) -> Self {
        let word = |i: usize| if lanes.0[i] { first } else { other }.wrapping_add(i as u32);
        Self(std::array::from_fn(|i| f32::from_bits(word(i))))
    }

    #[inline(always)]
    fn rotate_lanes<const BY: usize>(mut self) -> Self {
        self.0.rotate_left(BY);
        self
    }

    #[inline(always)]
    fn compress(self, lanes: PortableMask) -> Self {
        let mut values = [0.0; LANES];
        for (value, lane) in values.iter_mut().zip(set_bits::<LANES>(lanes.bits())) {
            *value = self.0[lane];
        }
        Self(values)
    }

    #[inline(always)]
    fn sort_descending(self, lanes: PortableMask, others: Self) -> (Self, Self) {
        let order = descending_order(self.0, lanes.bits());
        (Self(order.map(|lane| self.0[lane])), Self(order.map(|lane| others.0[lane])))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        self * factor + summand
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        self * factor - subtrahend
    }

    #[inline(always)]
    fn first_lanes<const SHIFT: i32>(word: u32) -> PortableMask {
        let n = (word >> SHIFT & 0xf) as usize;
        PortableMask(std::array::from_fn(|lane| lane < n))
    }

    #[inline(always)]
    fn exp2_byte<const BYTE: usize>(exponents: u32) -> Self {
        Self::splat(f32::from_bits((exponents >> (8 * BYTE) & 0xff) << 23))
    }

    #[inline(never)]
    fn dispatch<T: SimdTask>(task: T) -> T::Output {
        task.run()
    }

    #[inline(always)]
    fn prefetch<T>(_: *const T) {}
}

macro_rules! portable_operator {
    ($trait:ident, $method:ident, $operator:tt) => {
        impl $trait for PortableLanes {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.map(other, |a, b| a $operator b)
            }
        }
    };
}

portable_operator!(Add, add, +);
portable_operator!(Sub, sub, -);
portable_operator!(Mul, mul, *);
portable_operator!(Div, div, /);

impl LaneMask for PortableMask {
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.iter().enumerate().fold(0, |bits, (i, &set)| bits | u32::from(set) << i)
    }
}

impl BitAnd for PortableMask {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] & other.0[i]))
    }
}

impl BitOr for PortableMask {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] | other.0[i]))
    }
}
