//! Eight floats in one AVX register.
//!
//! Only bounds use fused multiply-add: results must equal the portable ones bit for bit.

use crate::math::{DoubledLanes, Floats, LANES, LaneMask, Lanes, PacketLanes, SimdTask};
use std::arch::x86_64::*;
use std::marker::PhantomData;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

macro_rules! avx2 {
    ($wrap:ident($($call:tt)*)) => {
        // SAFETY: see `F32x8`; loads and stores go through references to arrays of the full width.
        $wrap(unsafe { $($call)* }, PhantomData)
    };
}

macro_rules! mask {
    (($($call:tt)*)) => {
        // SAFETY: see `F32x8`.
        Mask8(unsafe { $($call)* })
    };
}

/// The operations in which the SIMD levels that have registers of eight floats differ. `Floats` and `Lanes`
/// describe them.
pub trait F32x8Ops: Copy + 'static {
    /// Sixteen lanes at this level.
    type PacketLanes: PacketLanes;
    type Mask: LaneMask;

    fn lt(left: __m256, right: __m256) -> Self::Mask;
    fn le(left: __m256, right: __m256) -> Self::Mask;
    fn lt_u32(left: __m256, right: __m256) -> Self::Mask;
    fn first_lanes<const SHIFT: i32>(word: u32) -> Self::Mask;
    fn select(mask: Self::Mask, if_true: __m256, if_false: __m256) -> __m256;
    fn compress(values: __m256, mask: Self::Mask) -> __m256;
    fn dispatch<T: SimdTask>(task: T) -> T::Output;
}

/// The level with AVX2.
#[derive(Clone, Copy)]
pub struct Avx2;

impl F32x8Ops for Avx2 {
    type PacketLanes = DoubledLanes<F32x8<Self>>;
    type Mask = Mask8;

    #[inline(always)]
    fn lt(left: __m256, right: __m256) -> Mask8 {
        mask!((_mm256_cmp_ps::<_CMP_LT_OQ>(left, right)))
    }

    #[inline(always)]
    fn le(left: __m256, right: __m256) -> Mask8 {
        mask!((_mm256_cmp_ps::<_CMP_LE_OQ>(left, right)))
    }

    #[inline(always)]
    fn lt_u32(left: __m256, right: __m256) -> Mask8 {
        mask!(
            (_mm256_castsi256_ps(_mm256_cmpgt_epi32(
                _mm256_xor_si256(_mm256_castps_si256(right), _mm256_set1_epi32(i32::MIN)),
                _mm256_xor_si256(_mm256_castps_si256(left), _mm256_set1_epi32(i32::MIN))
            )))
        )
    }

    #[inline(always)]
    fn first_lanes<const SHIFT: i32>(word: u32) -> Mask8 {
        mask!(
            ({
                let top =
                    _mm256_sll_epi32(_mm256_set1_epi32(word as i32), _mm_cvtsi32_si128(28 - SHIFT));
                _mm256_castsi256_ps(_mm256_cmpgt_epi32(
                    _mm256_srli_epi32::<28>(top),
                    lane_indices(),
                ))
            })
        )
    }

    #[inline(always)]
    fn select(mask: Mask8, if_true: __m256, if_false: __m256) -> __m256 {
        // SAFETY: see `F32x8`.
        unsafe { _mm256_blendv_ps(if_false, if_true, mask.0) }
    }

    #[inline(always)]
    fn compress(values: __m256, mask: Mask8) -> __m256 {
        let order = &COMPRESSED[mask.bits() as usize & 0xff];
        // SAFETY: as for `avx2!`.
        unsafe {
            let order = _mm_loadl_epi64(order.as_ptr().cast());
            _mm256_permutevar8x32_ps(values, _mm256_cvtepu8_epi32(order))
        }
    }

    #[inline(always)]
    fn dispatch<T: SimdTask>(task: T) -> T::Output {
        // SAFETY: see `F32x8`.
        unsafe { dispatch(task) }
    }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline(never)]
fn dispatch<T: SimdTask>(task: T) -> T::Output {
    task.run()
}

/// Eight floats. They are used only inside kernels that `dispatch_simd` enters where AVX2 is present, which
/// makes each `unsafe` block of this file sound.
#[derive(Clone, Copy)]
pub struct F32x8<L>(__m256, PhantomData<L>);

/// Eight truth values, each all bits of a lane.
#[derive(Clone, Copy)]
pub struct Mask8(__m256);

impl<L: F32x8Ops> Floats for F32x8<L> {
    type Mask = L::Mask;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        avx2!(Self(_mm256_set1_ps(value)))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        avx2!(Self(_mm256_min_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        avx2!(Self(_mm256_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        avx2!(Self(_mm256_sqrt_ps(self.0)))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> L::Mask {
        L::lt(self.0, other.0)
    }

    #[inline(always)]
    fn le(self, other: Self) -> L::Mask {
        L::le(self.0, other.0)
    }

    #[inline(always)]
    fn lt_u32(self, other: Self) -> L::Mask {
        L::lt_u32(self.0, other.0)
    }

    #[inline(always)]
    fn select(mask: L::Mask, if_true: Self, if_false: Self) -> Self {
        Self(L::select(mask, if_true.0, if_false.0), PhantomData)
    }
}

impl<L: F32x8Ops> Lanes for F32x8<L> {
    type PacketLanes = L::PacketLanes;

    #[inline(always)]
    fn load(values: &[f32; LANES]) -> Self {
        avx2!(Self(_mm256_loadu_ps(values.as_ptr())))
    }

    #[inline(always)]
    fn from_u8(values: &[u8; LANES]) -> Self {
        avx2!(Self(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(
            values.as_ptr().cast()
        )))))
    }

    #[inline(always)]
    fn from_u16(values: &[u16; LANES]) -> Self {
        avx2!(Self(_mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128(
            values.as_ptr().cast()
        )))))
    }

    #[inline(always)]
    fn from_signed_bits<const SHIFT: i32>(words: &[u32; LANES]) -> Self {
        avx2!(Self(_mm256_cvtepi32_ps(_mm256_srai_epi32::<22>(_mm256_sll_epi32(
            _mm256_loadu_si256(words.as_ptr().cast()),
            _mm_cvtsi32_si128(22 - SHIFT)
        )))))
    }

    #[inline(always)]
    fn from_top_bits(words: &[u32; LANES]) -> Self {
        avx2!(Self(_mm256_cvtepi32_ps(_mm256_srli_epi32::<30>(_mm256_loadu_si256(
            words.as_ptr().cast()
        )))))
    }

    #[inline(always)]
    fn store(self) -> [f32; LANES] {
        let mut values = [0.0; LANES];
        // SAFETY: as for `avx2!`.
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) };
        values
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        // SAFETY: as for `avx2!`.
        unsafe {
            let half =
                _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let pair = _mm_max_ps(half, _mm_movehl_ps(half, half));
            _mm_cvtss_f32(_mm_max_ss(pair, _mm_movehdup_ps(pair)))
        }
    }

    #[inline(always)]
    fn packed_indices(lanes: L::Mask, first: u32, other: u32) -> Self {
        // SAFETY: as for `avx2!`.
        let (first, other) = unsafe {
            (
                _mm256_castsi256_ps(_mm256_set1_epi32(first as i32)),
                _mm256_castsi256_ps(_mm256_set1_epi32(other as i32)),
            )
        };
        let base = L::select(lanes, first, other);
        avx2!(Self(_mm256_castsi256_ps(_mm256_add_epi32(
            _mm256_castps_si256(base),
            lane_indices()
        ))))
    }

    #[inline(always)]
    fn compress(self, lanes: L::Mask) -> Self {
        Self(L::compress(self.0, lanes), PhantomData)
    }

    #[inline(always)]
    fn rotate_lanes<const BY: usize>(self) -> Self {
        let order: [i32; LANES] = const { rotation(BY) };
        avx2!(Self(_mm256_permutevar8x32_ps(self.0, _mm256_loadu_si256(order.as_ptr().cast()))))
    }

    /// Sorts keys bitonically: a key has the bits of a value and, in its lowest three bits, its lane.
    #[inline(always)]
    fn sort_descending(self, lanes: L::Mask, others: Self) -> (Self, Self) {
        // SAFETY: as for `avx2!`.
        unsafe {
            let low_bits = _mm256_set1_epi32(7);
            // Values of chosen lanes become positive, as zero marks the other lanes.
            let value = _mm256_max_epi32(_mm256_castps_si256(self.0), _mm256_set1_epi32(8));
            let key = _mm256_or_si256(_mm256_andnot_si256(low_bits, value), lane_indices());
            let key = L::select(lanes, _mm256_castsi256_ps(key), _mm256_setzero_ps());
            let key = _mm256_castps_si256(key);
            let key = exchange::<0b10_11_00_01, 0b0110_0110>(key);
            let key = exchange::<0b01_00_11_10, 0b0011_1100>(key);
            let key = exchange::<0b10_11_00_01, 0b0101_1010>(key);
            let key = exchange_halves(key);
            let key = exchange::<0b01_00_11_10, 0b1100_1100>(key);
            let key = exchange::<0b10_11_00_01, 0b1010_1010>(key);
            let others = _mm256_permutevar8x32_ps(others.0, key);
            // Clears the bit that distinguished zero from an empty lane, too.
            let low_bits = _mm256_set1_epi32(15);
            (
                Self(_mm256_castsi256_ps(_mm256_andnot_si256(low_bits, key)), PhantomData),
                Self(others, PhantomData),
            )
        }
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        avx2!(Self(_mm256_fmadd_ps(self.0, factor.0, summand.0)))
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        avx2!(Self(_mm256_fmsub_ps(self.0, factor.0, subtrahend.0)))
    }

    #[inline(always)]
    fn first_lanes<const SHIFT: i32>(word: u32) -> L::Mask {
        L::first_lanes::<SHIFT>(word)
    }

    #[inline(always)]
    fn exp2_byte<const BYTE: usize>(exponents: u32) -> Self {
        avx2!(Self({
            let shift = _mm_cvtsi32_si128(23 - 8 * BYTE as i32);
            let moved = _mm256_sll_epi32(_mm256_set1_epi32(exponents as i32), shift);
            _mm256_castsi256_ps(_mm256_and_si256(moved, _mm256_set1_epi32(0xff << 23)))
        }))
    }

    #[inline(always)]
    fn dispatch<T: SimdTask>(task: T) -> T::Output {
        L::dispatch(task)
    }

    #[inline(always)]
    fn prefetch<T>(data: *const T) {
        for line in 0..size_of::<T>().div_ceil(64) {
            // SAFETY: a prefetch is a hint, for which every address is valid.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(data.cast::<i8>().wrapping_add(64 * line)) };
        }
    }
}

#[inline(always)]
unsafe fn lane_indices() -> __m256i {
    // SAFETY: as for `avx2!`.
    unsafe { _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7) }
}

/// Does a step of the sort: each lane is compared with its partner by `ORDER` within the same half, and takes
/// the lesser of the two where `LESSER` has a bit, else the greater.
#[inline(always)]
unsafe fn exchange<const ORDER: i32, const LESSER: i32>(key: __m256i) -> __m256i {
    // SAFETY: as for `avx2!`.
    unsafe {
        let other = _mm256_shuffle_epi32::<ORDER>(key);
        let (lesser, greater) = (_mm256_min_epi32(key, other), _mm256_max_epi32(key, other));
        _mm256_blend_epi32::<LESSER>(greater, lesser)
    }
}

/// Does the step of the sort that compares the halves: the greater values go to the first half.
#[inline(always)]
unsafe fn exchange_halves(key: __m256i) -> __m256i {
    // SAFETY: as for `avx2!`.
    unsafe {
        let other = _mm256_permute2x128_si256::<1>(key, key);
        let (lesser, greater) = (_mm256_min_epi32(key, other), _mm256_max_epi32(key, other));
        _mm256_blend_epi32::<0b1111_0000>(greater, lesser)
    }
}

/// Returns for each lane the index of the lane `by` further on.
const fn rotation(by: usize) -> [i32; LANES] {
    let (mut order, mut lane) = ([0; LANES], 0);
    while lane < LANES {
        order[lane] = ((lane + by) % LANES) as i32;
        lane += 1;
    }
    order
}

/// The indices of the set bits of each byte, in order.
static COMPRESSED: [[u8; LANES]; 256] = {
    let mut table = [[0; LANES]; 256];
    let mut lanes = 0;
    while lanes < 256 {
        let (mut lane, mut i) = (0, 0);
        while lane < LANES {
            if lanes >> lane & 1 == 1 {
                table[lanes][i] = lane as u8;
                i += 1;
            }
            lane += 1;
        }
        lanes += 1;
    }
    table
};

impl LaneMask for Mask8 {
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: as for `avx2!`.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $intrinsic:ident) => {
        impl<L: F32x8Ops> $trait for F32x8<L> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                avx2!(Self($intrinsic(self.0, other.0)))
            }
        }
    };
}

operator!(Add, add, _mm256_add_ps);
operator!(Sub, sub, _mm256_sub_ps);
operator!(Mul, mul, _mm256_mul_ps);
operator!(Div, div, _mm256_div_ps);

impl BitAnd for Mask8 {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        mask!((_mm256_and_ps(self.0, other.0)))
    }
}

impl BitOr for Mask8 {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        mask!((_mm256_or_ps(self.0, other.0)))
    }
}
