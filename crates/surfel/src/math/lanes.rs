//! Eight or sixteen floats at once: the arithmetic that kernels are written in, and its portable form.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Lanes of a kernel step, of a leaf block and of a tree node.
pub const LANES: usize = 8;

/// Rays of a packet.
pub const WIDE: usize = 2 * LANES;

/// Floats in lanes, each operation rounded on its own (IEEE 754, nothing fused), so that every
/// implementation gives the same bits.
pub trait Floats:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
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
    fn select(mask: Self::Mask, if_true: Self, if_false: Self) -> Self;
    /// Of each lane, truncated to an integer below 32, the word in which only this bit is set.
    fn to_single_bit(self) -> Self;
    fn or_bits(self, other: Self) -> Self;

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
    /// Compares the lanes' bits as unsigned numbers: lanes may hold those as well.
    fn less_bits(self, other: Self) -> Self::Mask;
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
    fn store(self) -> [f32; WIDE];
    /// The greatest of the lanes, none of which may be NaN.
    fn max_lane(self) -> f32;
    /// Compares the lanes' bits as unsigned numbers: lanes may hold those as well.
    fn less_bits(self, other: Self) -> Self::Mask;

    /// The least of the lanes, none of which may be NaN.
    #[inline(always)]
    fn min_lane(self) -> f32 {
        -(Self::splat(0.0) - self).max_lane()
    }
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
    fn less(self, other: Self) -> PortableMask {
        PortableMask(std::array::from_fn(|i| self.0[i] < other.0[i]))
    }

    #[inline(always)]
    fn less_equal(self, other: Self) -> PortableMask {
        PortableMask(std::array::from_fn(|i| self.0[i] <= other.0[i]))
    }

    #[inline(always)]
    fn to_single_bit(self) -> Self {
        Self(self.0.map(|bit| f32::from_bits(1u32.checked_shl(bit as i32 as u32).unwrap_or(0))))
    }

    #[inline(always)]
    fn or_bits(self, other: Self) -> Self {
        self.map(other, |a, b| f32::from_bits(a.to_bits() | b.to_bits()))
    }

    #[inline(always)]
    fn select(mask: PortableMask, if_true: Self, if_false: Self) -> Self {
        Self(std::array::from_fn(|i| if mask.0[i] { if_true.0[i] } else { if_false.0[i] }))
    }
}

/// The chosen lanes in the order of `keys`' falling values.
fn order_from_far(keys: [f32; LANES], mut lanes: u32) -> [usize; LANES] {
    let (mut order, mut n) = ([0; LANES], 0);
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        let mut place = n;
        while 0 < place && keys[order[place - 1]] <= keys[lane] {
            order[place] = order[place - 1];
            place -= 1;
        }
        order[place] = lane;
        n += 1;
    }
    order
}

impl Lanes for PortableLanes {
    type Wide = Pair<Self>;

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
    fn max_lane(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, f32::max)
    }

    #[inline(always)]
    fn numbered(lanes: PortableMask, first: u32, other: u32) -> Self {
        let word = |i: usize| if lanes.0[i] { first } else { other }.wrapping_add(i as u32);
        Self(std::array::from_fn(|i| f32::from_bits(word(i))))
    }

    #[inline(always)]
    fn compress(self, lanes: PortableMask) -> Self {
        let (mut lanes, mut values) = (lanes.bits(), [0.0; LANES]);
        for value in &mut values[..lanes.count_ones() as usize] {
            *value = self.0[lanes.trailing_zeros() as usize];
            lanes &= lanes - 1;
        }
        Self(values)
    }

    #[inline(always)]
    fn sort_from_far(self, lanes: PortableMask, others: Self) -> (Self, Self) {
        let order = order_from_far(self.0, lanes.bits());
        (Self(order.map(|lane| self.0[lane])), Self(order.map(|lane| others.0[lane])))
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, summand: Self) -> Self {
        self * factor + summand
    }

    #[inline(always)]
    fn times_minus(self, factor: Self, subtrahend: Self) -> Self {
        self * factor - subtrahend
    }

    #[inline(always)]
    fn below<const SHIFT: i32>(word: u32) -> PortableMask {
        let n = (word >> SHIFT & 0xf) as usize;
        PortableMask(std::array::from_fn(|lane| lane < n))
    }

    #[inline(always)]
    fn power_of_two<const BYTE: usize>(exponents: u32) -> Self {
        Self::splat(f32::from_bits((exponents >> (8 * BYTE) & 0xff) << 23))
    }

    #[inline(always)]
    fn less_bits(self, other: Self) -> PortableMask {
        PortableMask(std::array::from_fn(|i| self.0[i].to_bits() < other.0[i].to_bits()))
    }

    #[inline(never)]
    fn call<T: Task>(task: T) -> T::Output {
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

    #[inline(always)]
    fn less_bits(self, other: Self) -> Self::Mask {
        Pair(self.0.less_bits(other.0), self.1.less_bits(other.1))
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
    fn to_single_bit(self) -> Self {
        Self(self.0.to_single_bit(), self.1.to_single_bit())
    }

    #[inline(always)]
    fn or_bits(self, other: Self) -> Self {
        Self(self.0.or_bits(other.0), self.1.or_bits(other.1))
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
