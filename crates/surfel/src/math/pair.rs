//! Sixteen lanes made of eight.

use super::{Floats, LANES, LaneMask, Lanes, WIDE, Wide};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Two of eight lanes as sixteen.
#[derive(Clone, Copy)]
pub struct Pair<L>(L, L);

impl<L: Lanes> Wide for Pair<L> {
    #[inline(always)]
    fn load(values: &[f32; WIDE]) -> Self {
        let ([low, high], []) = values.as_chunks() else { unreachable!("16 are twice 8") };
        Self(L::load(low), L::load(high))
    }

    #[inline(always)]
    fn store(self) -> [f32; WIDE] {
        let (low, high) = (self.0.store(), self.1.store());
        let mut values = [0.0; WIDE];
        values[..LANES].copy_from_slice(&low);
        values[LANES..].copy_from_slice(&high);
        values
    }

    #[inline(always)]
    fn max_lane(self) -> f32 {
        self.0.max(self.1).max_lane()
    }
}

impl<L: Lanes> Floats for Pair<L> {
    type Mask = Pair<L::Mask>;

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
    fn less(self, other: Self) -> Self::Mask {
        Pair(self.0.less(other.0), self.1.less(other.1))
    }

    #[inline(always)]
    fn less_equal(self, other: Self) -> Self::Mask {
        Pair(self.0.less_equal(other.0), self.1.less_equal(other.1))
    }

    #[inline(always)]
    fn less_bits(self, other: Self) -> Self::Mask {
        Pair(self.0.less_bits(other.0), self.1.less_bits(other.1))
    }

    #[inline(always)]
    fn select(mask: Self::Mask, if_true: Self, if_false: Self) -> Self {
        Self(L::select(mask.0, if_true.0, if_false.0), L::select(mask.1, if_true.1, if_false.1))
    }
}

impl<M: LaneMask> LaneMask for Pair<M> {
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.bits() | self.1.bits() << LANES
    }
}

macro_rules! pair_operator {
    ($trait:ident, $method:ident) => {
        impl<T: $trait<Output = T>> $trait for Pair<T> {
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
