//! Eight floats at once: the arithmetic that kernels are written in, and its portable form.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Lanes of a kernel step, of a leaf block and of a tree node.
pub const LANES: usize = 8;

/// Eight f32, each operation rounded on its own (IEEE 754, nothing fused), so that every
/// implementation gives the same bits.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    type Mask: LaneMask;

    fn splat(value: f32) -> Self;
    fn load(values: &[f32; LANES]) -> Self;
    fn from_u8(values: &[u8; LANES]) -> Self;
    fn from_u16(values: &[u16; LANES]) -> Self;
    /// The 10 bits above the `SHIFT` lowest of each word, as signed integers.
    fn from_signed_bits<const SHIFT: i32>(words: &[u32; LANES]) -> Self;
    /// The 2 highest bits of each word.
    fn from_top_bits(words: &[u32; LANES]) -> Self;
    fn store(self) -> [f32; LANES];
    /// `other` where either is NaN, as on x86.
    fn min(self, other: Self) -> Self;
    /// `other` where either is NaN, as on x86.
    fn max(self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    /// Magnitude of `self`, sign of `sign`.
    fn copysign(self, sign: Self) -> Self;
    fn less(self, other: Self) -> Self::Mask;
    fn less_equal(self, other: Self) -> Self::Mask;
    fn select(mask: Self::Mask, if_true: Self, if_false: Self) -> Self;
}

/// One truth value a lane.
pub trait LaneMask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> {
    /// Bit i is lane i.
    fn bits(self) -> u8;
}

/// Eight floats in an array: the reference that other implementations are tested against.
#[derive(Clone, Copy, Debug)]
pub struct PortableLanes([f32; LANES]);

#[derive(Clone, Copy, Debug)]
pub struct PortableMask([bool; LANES]);

impl PortableLanes {
    #[inline(always)]
    fn map(self, other: Self, operation: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| operation(self.0[i], other.0[i])))
    }
}

impl Lanes for PortableLanes {
    type Mask = PortableMask;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

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
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.map(sign, f32::copysign)
    }

    #[inline(always)]
    fn less(self, other: Self) -> PortableMask {
        PortableMask(std::array::from_fn(|i| self.0[i] < other.0[i]))
    }

    #[inline(always)]
    fn less_equal(self, other: Self) -> PortableMask {
        PortableMask(std::array::from_fn(|i| self.0[i] <= other.0[i]))
    }

    #[inline(always)]
    fn select(mask: PortableMask, if_true: Self, if_false: Self) -> Self {
        Self(std::array::from_fn(|i| if mask.0[i] { if_true.0[i] } else { if_false.0[i] }))
    }
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
    fn bits(self) -> u8 {
        self.0.iter().enumerate().fold(0, |bits, (i, &set)| bits | (u8::from(set) << i))
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

/// Three coordinates in lanes.
#[derive(Clone, Copy)]
pub struct Vec3Lanes<L> {
    pub x: L,
    pub y: L,
    pub z: L,
}

impl<L: Lanes> Vec3Lanes<L> {
    #[inline(always)]
    pub fn splat(vector: super::Vec3) -> Self {
        Self { x: L::splat(vector.x), y: L::splat(vector.y), z: L::splat(vector.z) }
    }

    #[inline(always)]
    pub fn store(self) -> [super::Vec3; LANES] {
        let (x, y, z) = (self.x.store(), self.y.store(), self.z.store());
        let mut vectors = [super::Vec3::ZERO; LANES];
        for lane in 0..LANES {
            vectors[lane] = super::Vec3::new(x[lane], y[lane], z[lane]);
        }
        vectors
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> L {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub fn scaled(self, factor: L) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}
