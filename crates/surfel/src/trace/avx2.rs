//! Eight floats in one AVX register, and the batch kernels compiled for AVX2.
//!
//! Without fused multiply-add but for bounds: results must equal the portable ones bit for bit.

use super::hit::{Gather, Hit};
use super::splat::{self, Splat};
use super::surface::{self, SurfaceHit};
use super::{any, boxes, closest, gather};
use crate::flat::{FlatCloud, FlatTriangles};
use crate::math::{Aabb, Floats, LANES, LaneMask, Lanes, Pair, Ray, Task, Wide};
use std::arch::x86_64::*;
use std::marker::PhantomData;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

macro_rules! kernel {
    ($module:ident::$name:ident($from:ty => $result:ty)) => {
        /// The batch kernel of the same name.
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        pub(super) fn $name(from: &$from, rays: &[Ray], results: &mut [$result]) {
            $module::$name::<Eight<Avx2>>(from, rays, results);
        }
    };
}

kernel!(closest::closest_hits(FlatCloud => Hit));
kernel!(any::any_hits(FlatCloud => bool));
kernel!(gather::gathers(FlatCloud => Gather));
kernel!(splat::splats(FlatCloud => Splat));
kernel!(surface::surface_hits(FlatCloud => SurfaceHit));
kernel!(surface::occlusions(FlatCloud => bool));
kernel!(closest::closest_triangles(FlatTriangles => Hit));
kernel!(any::any_triangles(FlatTriangles => bool));
kernel!(boxes::box_entries([Aabb] => boxes::Entries));

macro_rules! avx2 {
    ($wrap:ident($($call:tt)*)) => {
        // SAFETY: see `Eight`; loads and stores go through references to arrays of the full width.
        $wrap(unsafe { $($call)* }, PhantomData)
    };
}

macro_rules! mask {
    (($($call:tt)*)) => {
        // SAFETY: see `Eight`.
        EightMask(unsafe { $($call)* })
    };
}

/// What differs between levels that have registers of eight floats.
pub(super) trait Registers: Copy + 'static {
    /// Sixteen lanes.
    type Wide: Wide;
    type Mask: LaneMask;

    fn less(left: __m256, right: __m256) -> Self::Mask;
    fn less_equal(left: __m256, right: __m256) -> Self::Mask;
    fn less_bits(left: __m256, right: __m256) -> Self::Mask;
    fn below<const SHIFT: i32>(word: u32) -> Self::Mask;
    fn select(mask: Self::Mask, if_true: __m256, if_false: __m256) -> __m256;
    fn compress(values: __m256, mask: Self::Mask) -> __m256;
    fn call<T: Task>(task: T) -> T::Output;
}

#[derive(Clone, Copy)]
struct Avx2;

impl Registers for Avx2 {
    type Wide = Pair<Eight<Self>>;
    type Mask = EightMask;

    #[inline(always)]
    fn less(left: __m256, right: __m256) -> EightMask {
        mask!((_mm256_cmp_ps::<_CMP_LT_OQ>(left, right)))
    }

    #[inline(always)]
    fn less_equal(left: __m256, right: __m256) -> EightMask {
        mask!((_mm256_cmp_ps::<_CMP_LE_OQ>(left, right)))
    }

    #[inline(always)]
    fn less_bits(left: __m256, right: __m256) -> EightMask {
        mask!(
            (_mm256_castsi256_ps(_mm256_cmpgt_epi32(
                _mm256_xor_si256(_mm256_castps_si256(right), _mm256_set1_epi32(i32::MIN)),
                _mm256_xor_si256(_mm256_castps_si256(left), _mm256_set1_epi32(i32::MIN))
            )))
        )
    }

    #[inline(always)]
    fn below<const SHIFT: i32>(word: u32) -> EightMask {
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
    fn select(mask: EightMask, if_true: __m256, if_false: __m256) -> __m256 {
        // SAFETY: see `Eight`.
        unsafe { _mm256_blendv_ps(if_false, if_true, mask.0) }
    }

    #[inline(always)]
    fn compress(values: __m256, mask: EightMask) -> __m256 {
        let order = &COMPRESSED[mask.bits() as usize & 0xff];
        // SAFETY: as for `avx2!`.
        unsafe {
            let order = _mm_loadl_epi64(order.as_ptr().cast());
            _mm256_permutevar8x32_ps(values, _mm256_cvtepu8_epi32(order))
        }
    }

    #[inline(always)]
    fn call<T: Task>(task: T) -> T::Output {
        // SAFETY: see `Eight`.
        unsafe { call(task) }
    }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline(never)]
fn call<T: Task>(task: T) -> T::Output {
    task.run()
}

/// Used only inside the kernels of this file and of `avx512`, which are entered only where AVX2 is
/// present: that is what makes each `unsafe` of this file sound.
#[derive(Clone, Copy)]
pub(super) struct Eight<L>(__m256, PhantomData<L>);

#[derive(Clone, Copy)]
pub(super) struct EightMask(__m256);

impl<L: Registers> Floats for Eight<L> {
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
    fn less(self, other: Self) -> L::Mask {
        L::less(self.0, other.0)
    }

    #[inline(always)]
    fn less_equal(self, other: Self) -> L::Mask {
        L::less_equal(self.0, other.0)
    }

    #[inline(always)]
    fn less_bits(self, other: Self) -> L::Mask {
        L::less_bits(self.0, other.0)
    }

    #[inline(always)]
    fn select(mask: L::Mask, if_true: Self, if_false: Self) -> Self {
        Self(L::select(mask, if_true.0, if_false.0), PhantomData)
    }
}

impl<L: Registers> Lanes for Eight<L> {
    type Wide = L::Wide;

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
    fn max_lane(self) -> f32 {
        // SAFETY: as for `avx2!`.
        unsafe {
            let half =
                _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let pair = _mm_max_ps(half, _mm_movehl_ps(half, half));
            _mm_cvtss_f32(_mm_max_ss(pair, _mm_movehdup_ps(pair)))
        }
    }

    #[inline(always)]
    fn numbered(lanes: L::Mask, first: u32, other: u32) -> Self {
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
    fn rotated<const BY: usize>(self) -> Self {
        let order: [i32; LANES] = const { rotation(BY) };
        avx2!(Self(_mm256_permutevar8x32_ps(self.0, _mm256_loadu_si256(order.as_ptr().cast()))))
    }

    /// A bitonic sort of keys: the bits of a value, the lane it comes from in the lowest three.
    #[inline(always)]
    fn sort_from_far(self, lanes: L::Mask, others: Self) -> (Self, Self) {
        // SAFETY: as for `avx2!`.
        unsafe {
            let low_bits = _mm256_set1_epi32(7);
            // Not less than zero, and never what an empty lane has.
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
            // With the bit that tells zero from an empty lane.
            let low_bits = _mm256_set1_epi32(15);
            (
                Self(_mm256_castsi256_ps(_mm256_andnot_si256(low_bits, key)), PhantomData),
                Self(others, PhantomData),
            )
        }
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, summand: Self) -> Self {
        avx2!(Self(_mm256_fmadd_ps(self.0, factor.0, summand.0)))
    }

    #[inline(always)]
    fn times_minus(self, factor: Self, subtrahend: Self) -> Self {
        avx2!(Self(_mm256_fmsub_ps(self.0, factor.0, subtrahend.0)))
    }

    #[inline(always)]
    fn below<const SHIFT: i32>(word: u32) -> L::Mask {
        L::below::<SHIFT>(word)
    }

    #[inline(always)]
    fn power_of_two<const BYTE: usize>(exponents: u32) -> Self {
        avx2!(Self({
            let shift = _mm_cvtsi32_si128(23 - 8 * BYTE as i32);
            let moved = _mm256_sll_epi32(_mm256_set1_epi32(exponents as i32), shift);
            _mm256_castsi256_ps(_mm256_and_si256(moved, _mm256_set1_epi32(0xff << 23)))
        }))
    }

    #[inline(always)]
    fn call<T: Task>(task: T) -> T::Output {
        L::call(task)
    }

    #[inline(always)]
    fn prefetch<T>(data: *const T) {
        for line in 0..size_of::<T>().div_ceil(64) {
            // SAFETY: a hint: no address is an error.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(data.cast::<i8>().wrapping_add(64 * line)) };
        }
    }
}

#[inline(always)]
unsafe fn lane_indices() -> __m256i {
    // SAFETY: as for `avx2!`.
    unsafe { _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7) }
}

/// A step of the sort: lanes meet those that `ORDER` puts beside them within each half, and take the
/// lesser of the two where `LESSER` has a bit, else the greater.
#[inline(always)]
unsafe fn exchange<const ORDER: i32, const LESSER: i32>(key: __m256i) -> __m256i {
    // SAFETY: as for `avx2!`.
    unsafe {
        let other = _mm256_shuffle_epi32::<ORDER>(key);
        let (lesser, greater) = (_mm256_min_epi32(key, other), _mm256_max_epi32(key, other));
        _mm256_blend_epi32::<LESSER>(greater, lesser)
    }
}

/// The step of the sort in which the halves meet: the greater go first.
#[inline(always)]
unsafe fn exchange_halves(key: __m256i) -> __m256i {
    // SAFETY: as for `avx2!`.
    unsafe {
        let other = _mm256_permute2x128_si256::<1>(key, key);
        let (lesser, greater) = (_mm256_min_epi32(key, other), _mm256_max_epi32(key, other));
        _mm256_blend_epi32::<0b1111_0000>(greater, lesser)
    }
}

/// For each lane the one `by` lanes on.
const fn rotation(by: usize) -> [i32; LANES] {
    let (mut order, mut lane) = ([0; LANES], 0);
    while lane < LANES {
        order[lane] = ((lane + by) % LANES) as i32;
        lane += 1;
    }
    order
}

/// For each set of lanes, these lanes in order.
static COMPRESSED: [[u8; LANES]; 256] = {
    let mut table = [[0; LANES]; 256];
    let mut lanes = 0;
    while lanes < 256 {
        let (mut lane, mut place) = (0, 0);
        while lane < LANES {
            if lanes >> lane & 1 == 1 {
                table[lanes][place] = lane as u8;
                place += 1;
            }
            lane += 1;
        }
        lanes += 1;
    }
    table
};

impl LaneMask for EightMask {
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: as for `avx2!`.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $intrinsic:ident) => {
        impl<L: Registers> $trait for Eight<L> {
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

impl BitAnd for EightMask {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        mask!((_mm256_and_ps(self.0, other.0)))
    }
}

impl BitOr for EightMask {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        mask!((_mm256_or_ps(self.0, other.0)))
    }
}
