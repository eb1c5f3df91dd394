//! Eight or sixteen floats at once: the arithmetic in which kernels are written.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Number of lanes of a kernel step, of a leaf block and of a tree node.
pub const LANES: usize = 8;

/// Number of rays in a packet.
pub const PACKET_WIDTH: usize = 2 * LANES;

/// Rounds to the nearest integer: a number below 2^22 to which this is added, and from which it is subtracted
/// again, is rounded. The integer also stands in the low bits of the sum, in two's complement, as
/// neighbouring floats are 1 apart at 1.5 * 2^23.
pub const ROUND_TO_INTEGER: f32 = 12_582_912.0;

/// Floats in lanes. Each operation is rounded on its own (IEEE 754, nothing fused), so that every
/// implementation gives the same bits.
pub trait Floats:
    Copy + 'static + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// One truth value per lane.
    type Mask: LaneMask;

    /// Returns `value` in all lanes.
    fn splat(value: f32) -> Self;
    /// Returns the lesser value, or `other` where either is NaN, like x86.
    fn min(self, other: Self) -> Self;
    /// Returns the greater value, or `other` where either is NaN, like x86.
    fn max(self, other: Self) -> Self;
    /// Returns the square root.
    fn sqrt(self) -> Self;
    /// True where `self < other`.
    fn lt(self, other: Self) -> Self::Mask;
    /// True where `self <= other`.
    fn le(self, other: Self) -> Self::Mask;
    /// True where the bits of `self`, read as an unsigned integer, are below those of `other`: lanes may hold
    /// integers, too.
    fn lt_u32(self, other: Self) -> Self::Mask;
    /// Returns `if_true` where `mask` is true, `if_false` elsewhere.
    fn select(mask: Self::Mask, if_true: Self, if_false: Self) -> Self;

    /// Returns the absolute value.
    #[inline(always)]
    fn abs(self) -> Self {
        self.max(Self::splat(0.0) - self)
    }
}

/// One truth value per lane.
pub trait LaneMask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> {
    /// Returns the mask as an integer: bit i is lane i.
    fn bits(self) -> u32;
}

/// Work that is compiled into one function per SIMD level. All other code is compiled into each place that
/// uses it.
pub trait SimdTask {
    /// The result.
    type Output;

    /// Does the work.
    fn run(self) -> Self::Output;
}

/// Eight floats: the children of a node, or the points of a block.
pub trait Lanes: Floats {
    /// Sixteen floats at the same SIMD level.
    type PacketLanes: PacketLanes;

    /// Reads all lanes.
    fn load(values: &[f32; LANES]) -> Self;
    /// Converts integers to floats.
    fn from_u8(values: &[u8; LANES]) -> Self;
    /// Converts integers to floats.
    fn from_u16(values: &[u16; LANES]) -> Self;
    /// Converts the 10 bits above the `SHIFT` lowest of each word, which are a signed integer, to floats.
    fn from_signed_bits<const SHIFT: i32>(words: &[u32; LANES]) -> Self;
    /// Converts the 2 highest bits of each word to floats.
    fn from_top_bits(words: &[u32; LANES]) -> Self;
    /// Returns integers, as bits: the index of each lane plus `first` where `lanes` is true, plus `other`
    /// elsewhere.
    fn packed_indices(lanes: Self::Mask, first: u32, other: u32) -> Self;
    /// Writes all lanes.
    fn store(self) -> [f32; LANES];
    /// Moves the lanes where `lanes` is true to the front, in their order.
    fn compress(self, lanes: Self::Mask) -> Self;
    /// Returns in lane i the value of lane (i + `BY`) mod `LANES`.
    fn rotate_lanes<const BY: usize>(self) -> Self;
    /// Sorts the values where `lanes` is true by falling value to the front, and `others` with them.
    ///
    /// None of the values may be negative. They may come out smaller by some 2^-20 of themselves.
    fn sort_descending(self, lanes: Self::Mask, others: Self) -> (Self, Self);
    /// Returns `self * factor + summand`, perhaps rounded only once: it serves bounds, never results.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// Returns `self * factor - subtrahend`, perhaps rounded only once.
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self;
    /// Returns a mask of the first n lanes, where n is the four bits of `word` from bit `SHIFT`.
    fn first_lanes<const SHIFT: i32>(word: u32) -> Self::Mask;
    /// Returns 2^(e - 127) in all lanes, where e is byte `BYTE` of `exponents`, counted from the lowest.
    fn exp2_byte<const BYTE: usize>(exponents: u32) -> Self;
    /// Returns the greatest of the lanes, none of which may be NaN.
    fn reduce_max(self) -> f32;
    /// Returns the least of the lanes, none of which may be NaN.
    #[inline(always)]
    fn reduce_min(self) -> f32 {
        -(Self::splat(0.0) - self).reduce_max()
    }

    /// Runs `task` in a function of its own, compiled for this SIMD level.
    fn dispatch<T: SimdTask>(task: T) -> T::Output;

    /// Prefetches the memory of `data` into the first cache. The address need not be valid.
    fn prefetch<T>(data: *const T);
}

/// Sixteen floats: the rays of a packet.
pub trait PacketLanes: Floats {
    /// Reads all lanes.
    fn load(values: &[f32; PACKET_WIDTH]) -> Self;
    /// Transposes rows: the first result holds the first value of each row, the second one the second values,
    /// and so on.
    #[inline(always)]
    fn columns(rows: &[[f32; 8]; PACKET_WIDTH]) -> [Self; 8] {
        let mut columns = [[0.0; PACKET_WIDTH]; 8];
        for (i, column) in columns.iter_mut().enumerate() {
            for lane in 0..PACKET_WIDTH {
                column[lane] = rows[lane][i];
            }
        }
        let [a, b, c, d, e, f, g, h] = &columns;
        let [a, b, c, d] = [Self::load(a), Self::load(b), Self::load(c), Self::load(d)];
        [a, b, c, d, Self::load(e), Self::load(f), Self::load(g), Self::load(h)]
    }
    /// Writes all lanes.
    fn store(self) -> [f32; PACKET_WIDTH];
    /// Returns the greatest of the lanes, none of which may be NaN.
    fn reduce_max(self) -> f32;

    /// Returns the least of the lanes, none of which may be NaN.
    #[inline(always)]
    fn reduce_min(self) -> f32 {
        -(Self::splat(0.0) - self).reduce_max()
    }
}

/// A single float is one lane: scalar code shares what is written for lanes.
impl Floats for f32 {
    type Mask = bool;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if other < self { self } else { other }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self <= other
    }

    #[inline(always)]
    fn lt_u32(self, other: Self) -> bool {
        self.to_bits() < other.to_bits()
    }

    #[inline(always)]
    fn select(mask: bool, if_true: Self, if_false: Self) -> Self {
        if mask { if_true } else { if_false }
    }
}

impl LaneMask for bool {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

/// Vectors of three coordinates in lanes.
#[derive(Clone, Copy)]
pub struct Vec3Lanes<L> {
    /// First coordinates.
    pub x: L,
    /// Second coordinates.
    pub y: L,
    /// Third coordinates.
    pub z: L,
}

impl<L: Lanes> Vec3Lanes<L> {
    /// Writes eight vectors, axis by axis.
    #[inline(always)]
    pub fn store(self) -> [[f32; LANES]; 3] {
        [self.x.store(), self.y.store(), self.z.store()]
    }
}

impl<W: PacketLanes> Vec3Lanes<W> {
    /// Reads sixteen vectors, axis by axis.
    #[inline(always)]
    pub fn load_packet([x, y, z]: &[[f32; PACKET_WIDTH]; 3]) -> Self {
        Self { x: W::load(x), y: W::load(y), z: W::load(z) }
    }

    /// Writes sixteen vectors, axis by axis.
    #[inline(always)]
    pub fn store_packet(self) -> [[f32; PACKET_WIDTH]; 3] {
        [self.x.store(), self.y.store(), self.z.store()]
    }
}

impl<F: Floats> Vec3Lanes<F> {
    /// Returns `vector` in all lanes.
    #[inline(always)]
    pub fn splat(vector: super::Vec3) -> Self {
        Self { x: F::splat(vector.x), y: F::splat(vector.y), z: F::splat(vector.z) }
    }

    /// Returns one of eight stored vectors in all lanes.
    #[inline(always)]
    pub fn splat_lane([x, y, z]: &[[f32; LANES]; 3], lane: usize) -> Self {
        Self { x: F::splat(x[lane]), y: F::splat(y[lane]), z: F::splat(z[lane]) }
    }

    /// Returns `if_true` where `mask` is true, `if_false` elsewhere.
    #[inline(always)]
    pub fn select(mask: F::Mask, if_true: Self, if_false: Self) -> Self {
        Self {
            x: F::select(mask, if_true.x, if_false.x),
            y: F::select(mask, if_true.y, if_false.y),
            z: F::select(mask, if_true.z, if_false.z),
        }
    }

    /// Returns the dot product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Returns the cross product, rounded such that swapping both vectors changes only the sign.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// Returns the vector times a factor.
    #[inline(always)]
    pub fn scaled(self, factor: F) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    /// Returns the sum of both vectors.
    #[inline(always)]
    pub fn plus(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }

    /// Returns the difference of both vectors.
    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}
