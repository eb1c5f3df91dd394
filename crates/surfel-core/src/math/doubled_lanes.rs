//! Sixteen lanes made of two times eight.

use super::{Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Sixteen lanes: two halves of eight.
#[derive(Clone, Copy)]
pub struct DoubledLanes<L>(L, L);

impl<L: Lanes> PacketLanes for DoubledLanes<L> {
    #[inline(always)]
    fn load(values: &[f32; PACKET_WIDTH]) -> Self {
        let ([low, high], []) = values.as_chunks() else { unreachable!("16 are twice 8") };
        Self(L::load(low), L::load(high))
    }

    #[inline(always)]
    fn store(self) -> [f32; PACKET_WIDTH] {
        let (low, high) = (self.0.store(), self.1.store());
        let mut values = [0.0; PACKET_WIDTH];
        values[..LANES].copy_from_slice(&low);
        values[LANES..].copy_from_slice(&high);
        values
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        self.0.max(self.1).reduce_max()
    }
}

impl<L: Lanes> Floats for DoubledLanes<L> {
    type Mask = DoubledLanes<L::Mask>;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(L::splat(value), L::splat(value))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0), self.1.min(other.1))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0), self.1.max(other.1))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt(), self.1.sqrt())
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        DoubledLanes(self.0.lt(other.0), self.1.lt(other.1))
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        DoubledLanes(self.0.le(other.0), self.1.le(other.1))
    }

    #[inline(always)]
    fn lt_u32(self, other: Self) -> Self::Mask {
        DoubledLanes(self.0.lt_u32(other.0), self.1.lt_u32(other.1))
    }

    #[inline(always)]
    fn select(mask: Self::Mask, if_true: Self, if_false: Self) -> Self {
        Self(L::select(mask.0, if_true.0, if_false.0), L::select(mask.1, if_true.1, if_false.1))
    }
}

impl<M: LaneMask> LaneMask for DoubledLanes<M> {
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.bits() | self.1.bits() << LANES
    }
}

macro_rules! pair_operator {
    ($trait:ident, $method:ident) => {
        impl<T: $trait<Output = T>> $trait for DoubledLanes<T> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0), self.1.$method(other.1))
            }
        }
    };
}

pair_operator!(Add, add);
pair_operator!(Sub, sub);
pair_operator!(Mul, mul);
pair_operator!(Div, div);
pair_operator!(BitAnd, bitand);
pair_operator!(BitOr, bitor);
