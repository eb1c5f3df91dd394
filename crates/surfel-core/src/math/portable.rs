//! Lanes in the registers that every processor of the target has: SSE2, NEON or those of WebAssembly.

use super::{DoubledLanes, Floats, LANES, LaneMask, Lanes, SimdTask, set_bits};
use bytemuck::cast;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};
use wide::{f32x8, i32x8, u32x8};

/// Eight floats, four to a register.
#[derive(Clone, Copy, Debug)]
pub struct PortableLanes(f32x8);

/// The mask of `PortableLanes`: all bits of a lane are set, or none.
#[derive(Clone, Copy, Debug)]
pub struct PortableMask(f32x8);

const LANE_INDICES: u32x8 = u32x8::new([0, 1, 2, 3, 4, 5, 6, 7]);

impl Floats for PortableLanes {
    type Mask = PortableMask;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(f32x8::splat(value))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(self.lt(other), self, other)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(other.lt(self), self, other)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }

    #[inline(always)]
    fn lt(self, other: Self) -> PortableMask {
        PortableMask(self.0.simd_lt(other.0))
    }

    #[inline(always)]
    fn le(self, other: Self) -> PortableMask {
        PortableMask(self.0.simd_le(other.0))
    }

    #[inline(always)]
    fn lt_u32(self, other: Self) -> PortableMask {
        PortableMask(cast(cast::<_, u32x8>(self.0).simd_lt(cast::<_, u32x8>(other.0))))
    }

    #[inline(always)]
    fn select(mask: PortableMask, if_true: Self, if_false: Self) -> Self {
        Self(mask.0.bitselect(if_true.0, if_false.0))
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
        Self(f32x8::new(*values))
    }

    #[inline(always)]
    fn from_u8(values: &[u8; LANES]) -> Self {
        Self(i32x8::new(values.map(i32::from)).round_float())
    }

    #[inline(always)]
    fn from_u16(values: &[u16; LANES]) -> Self {
        Self(i32x8::new(values.map(i32::from)).round_float())
    }

    #[inline(always)]
    fn from_signed_bits<const SHIFT: i32>(words: &[u32; LANES]) -> Self {
        let top = u32x8::new(*words) << (22 - SHIFT) as u32;
        Self((cast::<_, i32x8>(top) >> 22_u32).round_float())
    }

    #[inline(always)]
    fn from_top_bits(words: &[u32; LANES]) -> Self {
        Self(cast::<_, i32x8>(u32x8::new(*words) >> 30_u32).round_float())
    }

    #[inline(always)]
    fn store(self) -> [f32; LANES] {
        self.0.to_array()
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        self.store().into_iter().fold(f32::NEG_INFINITY, f32::max)
    }

    #[inline(always)]
    fn packed_indices(lanes: PortableMask, first: u32, other: u32) -> Self {
        let [first, other] = [first, other].map(|word| Self::splat(f32::from_bits(word)));
        Self(cast(cast::<_, u32x8>(Self::select(lanes, first, other).0) + LANE_INDICES))
    }

    #[inline(always)]
    fn rotate_lanes<const BY: usize>(self) -> Self {
        let mut values = self.store();
        values.rotate_left(BY);
        Self::load(&values)
    }

    #[inline(always)]
    fn compress(self, lanes: PortableMask) -> Self {
        let (from, mut values) = (self.store(), [0.0; LANES]);
        for (value, lane) in values.iter_mut().zip(set_bits::<LANES>(lanes.bits())) {
            *value = from[lane];
        }
        Self::load(&values)
    }

    #[inline(always)]
    fn sort_descending(self, lanes: PortableMask, others: Self) -> (Self, Self) {
        let (keys, others) = (self.store(), others.store());
        let order = descending_order(keys, lanes.bits());
        (Self::load(&order.map(|lane| keys[lane])), Self::load(&order.map(|lane| others[lane])))
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
        PortableMask(cast(LANE_INDICES.simd_lt(u32x8::splat(word >> SHIFT & 0xf))))
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
                Self(self.0 $operator other.0)
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
        self.0.to_bitmask()
    }
}

impl BitAnd for PortableMask {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl BitOr for PortableMask {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}
