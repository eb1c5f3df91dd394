//! Eight or sixteen floats at once: the arithmetic that kernels are written in.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Lanes of a kernel step, of a leaf block and of a tree node.
pub const LANES: usize = 8;

/// Rays of a packet.
pub const WIDE: usize = 2 * LANES;

/// Added to a number below 2^22 and taken away again it leaves the nearest integer, which also stands in the
/// low bits of the sum, in two's complement: here, at 1.5 * 2^23, neighbouring floats are 1 apart.
pub const TO_INTEGER: f32 = 12_582_912.0;

/// Floats in lanes, each operation rounded on its own (IEEE 754, nothing fused), so that every
/// implementation gives the same bits.
pub trait Floats:
    Copy + 'static + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    type Mask: LaneMask;

    fn splat(value: f32) -> Self;
    /// `other` where either is NaN, as on x86.
    fn min(self, other: Self) -> Self;
    /// `other` where either is NaN, as on x86.
    fn max(self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    fn less(self, other: Self) -> Self::Mask;
    fn less_equal(self, other: Self) -> Self::Mask;
    /// Compares the lanes' bits as unsigned numbers: lanes may hold those as well.
    fn less_bits(self, other: Self) -> Self::Mask;
    fn select(mask: Self::Mask, if_true: Self, if_false: Self) -> Self;

    #[inline(always)]
    fn abs(self) -> Self {
        self.max(Self::splat(0.0) - self)
    }
}

/// One truth value a lane.
pub trait LaneMask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> {
    /// Bit i is lane i.
    fn bits(self) -> u32;
}

/// Work that is compiled once for each SIMD level, where all else is compiled into each place that uses it.
pub trait Task {
    type Output;

    fn run(self) -> Self::Output;
}

/// Eight floats: the children of a node, or the points of a block.
pub trait Lanes: Floats {
    /// Twice as many at the same SIMD level.
    type Wide: Wide;

    fn load(values: &[f32; LANES]) -> Self;
    fn from_u8(values: &[u8; LANES]) -> Self;
    fn from_u16(values: &[u16; LANES]) -> Self;
    /// The 10 bits above the `SHIFT` lowest of each word, as signed integers.
    fn from_signed_bits<const SHIFT: i32>(words: &[u32; LANES]) -> Self;
    /// The 2 highest bits of each word.
    fn from_top_bits(words: &[u32; LANES]) -> Self;
    /// Bits: each lane's number from `first` where chosen, from `other` elsewhere.
    fn numbered(lanes: Self::Mask, first: u32, other: u32) -> Self;
    fn store(self) -> [f32; LANES];
    /// Moves the chosen lanes to the front, in their order.
    fn compress(self, lanes: Self::Mask) -> Self;
    /// Lane i gets the value of lane (i + `BY`) mod `LANES`.
    fn rotated<const BY: usize>(self) -> Self;
    /// Sorts the chosen lanes, none of them negative, by falling value to the front, and `others` with
    /// them. Values may come out smaller by some 2^-20 of themselves.
    fn sort_from_far(self, lanes: Self::Mask, others: Self) -> (Self, Self);
    /// `self * factor + summand`, perhaps rounded only once: for bounds, never for results.
    fn times_plus(self, factor: Self, summand: Self) -> Self;
    /// `self * factor - subtrahend`, in the same way.
    fn times_minus(self, factor: Self, subtrahend: Self) -> Self;
    /// True in so many lanes from the first as the four bits of `word` from `SHIFT` on say.
    fn below<const SHIFT: i32>(word: u32) -> Self::Mask;
    /// All lanes 2^(e - 127), where e is this byte of `exponents` from the lowest.
    fn power_of_two<const BYTE: usize>(exponents: u32) -> Self;
    /// The greatest of the lanes, none of which may be NaN.
    fn max_lane(self) -> f32;
    /// The least of the lanes, none of which may be NaN.
    #[inline(always)]
    fn min_lane(self) -> f32 {
        -(Self::splat(0.0) - self).max_lane()
    }

    /// Runs `task` as a function of its own.
    fn call<T: Task>(task: T) -> T::Output;

    /// Asks for the memory of `data` to be near soon. It need not be anyone's.
    fn prefetch<T>(data: *const T);
}

/// Sixteen floats: the rays of a packet.
pub trait Wide: Floats {
    fn load(values: &[f32; WIDE]) -> Self;
    /// A lane from each row, of all rows their first value, their second and so on.
    #[inline(always)]
    fn columns(rows: &[[f32; 8]; WIDE]) -> [Self; 8] {
        let mut columns = [[0.0; WIDE]; 8];
        for (i, column) in columns.iter_mut().enumerate() {
            for lane in 0..WIDE {
                column[lane] = rows[lane][i];
            }
        }
        let [a, b, c, d, e, f, g, h] = &columns;
        let [a, b, c, d] = [Self::load(a), Self::load(b), Self::load(c), Self::load(d)];
        [a, b, c, d, Self::load(e), Self::load(f), Self::load(g), Self::load(h)]
    }
    fn store(self) -> [f32; WIDE];
    /// The greatest of the lanes, none of which may be NaN.
    fn max_lane(self) -> f32;

    /// The least of the lanes, none of which may be NaN.
    #[inline(always)]
    fn min_lane(self) -> f32 {
        -(Self::splat(0.0) - self).max_lane()
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
    pub fn store(self) -> [[f32; LANES]; 3] {
        [self.x.store(), self.y.store(), self.z.store()]
    }
}

impl<W: Wide> Vec3Lanes<W> {
    #[inline(always)]
    pub fn load_wide([x, y, z]: &[[f32; WIDE]; 3]) -> Self {
        Self { x: W::load(x), y: W::load(y), z: W::load(z) }
    }

    #[inline(always)]
    pub fn store_wide(self) -> [[f32; WIDE]; 3] {
        [self.x.store(), self.y.store(), self.z.store()]
    }
}

impl<F: Floats> Vec3Lanes<F> {
    #[inline(always)]
    pub fn splat(vector: super::Vec3) -> Self {
        Self { x: F::splat(vector.x), y: F::splat(vector.y), z: F::splat(vector.z) }
    }

    /// What was stored from `lane`, in all lanes.
    #[inline(always)]
    pub fn splat_lane([x, y, z]: &[[f32; LANES]; 3], lane: usize) -> Self {
        Self { x: F::splat(x[lane]), y: F::splat(y[lane]), z: F::splat(z[lane]) }
    }

    #[inline(always)]
    pub fn select(mask: F::Mask, if_true: Self, if_false: Self) -> Self {
        Self {
            x: F::select(mask, if_true.x, if_false.x),
            y: F::select(mask, if_true.y, if_false.y),
            z: F::select(mask, if_true.z, if_false.z),
        }
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> F {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Rounded so that swapping both vectors changes nothing but the sign.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    #[inline(always)]
    pub fn scaled(self, factor: F) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    #[inline(always)]
    pub fn plus(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }

    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}
