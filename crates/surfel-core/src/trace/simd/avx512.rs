//! Sixteen floats in one AVX-512 register.

use crate::math::{Floats, LANES, LaneMask, PACKET_WIDTH, PacketLanes, SimdTask};
use crate::trace::simd::avx2::F32x8Ops;
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

macro_rules! avx512 {
    ($wrap:ident($($call:tt)*)) => {
        // SAFETY: see `F32x16`; loads and stores go through references to arrays of the full width.
        $wrap(unsafe { $($call)* })
    };
}

/// The level with AVX-512.
#[derive(Clone, Copy)]
pub struct Avx512;

impl F32x8Ops for Avx512 {
    type PacketLanes = F32x16;
    type Mask = KMask8;

    #[inline(always)]
    fn lt(left: __m256, right: __m256) -> KMask8 {
        avx512!(KMask8(_mm256_cmp_ps_mask::<_CMP_LT_OQ>(left, right)))
    }

    #[inline(always)]
    fn le(left: __m256, right: __m256) -> KMask8 {
        avx512!(KMask8(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(left, right)))
    }

    #[inline(always)]
    fn lt_u32(left: __m256, right: __m256) -> KMask8 {
        avx512!(KMask8(_mm256_cmplt_epu32_mask(
            _mm256_castps_si256(left),
            _mm256_castps_si256(right)
        )))
    }

    #[inline(always)]
    fn first_lanes<const SHIFT: i32>(word: u32) -> KMask8 {
        avx512!(KMask8({
            let top =
                _mm256_sll_epi32(_mm256_set1_epi32(word as i32), _mm_cvtsi32_si128(28 - SHIFT));
            _mm256_cmple_epu32_mask(_mm256_loadu_si256(FIRST_WORD_INCLUDING.as_ptr().cast()), top)
        }))
    }

    #[inline(always)]
    fn select(mask: KMask8, if_true: __m256, if_false: __m256) -> __m256 {
        // SAFETY: see `F32x16`.
        unsafe { _mm256_mask_blend_ps(mask.0, if_false, if_true) }
    }

    #[inline(always)]
    fn compress(values: __m256, mask: KMask8) -> __m256 {
        // SAFETY: see `F32x16`.
        unsafe { _mm256_maskz_compress_ps(mask.0, values) }
    }

    #[inline(always)]
    fn dispatch<T: SimdTask>(task: T) -> T::Output {
        // SAFETY: see `F32x16`.
        unsafe { dispatch(task) }
    }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
#[inline(never)]
fn dispatch<T: SimdTask>(task: T) -> T::Output {
    task.run()
}

/// The lowest word of each lane whose highest four bits, a number of lanes, include that lane.
static FIRST_WORD_INCLUDING: [u32; LANES] =
    [1 << 28, 2 << 28, 3 << 28, 4 << 28, 5 << 28, 6 << 28, 7 << 28, 8 << 28];

/// Eight truth values.
#[derive(Clone, Copy)]
pub struct KMask8(__mmask8);

/// Sixteen floats. They are used only inside kernels that `dispatch_simd` enters where AVX-512 is present,
/// which makes each `unsafe` block of this file sound.
#[derive(Clone, Copy)]
pub struct F32x16(__m512);

/// Sixteen truth values.
#[derive(Clone, Copy)]
pub struct KMask16(__mmask16);

impl Floats for F32x16 {
    type Mask = KMask16;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        avx512!(Self(_mm512_set1_ps(value)))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        avx512!(Self(_mm512_min_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        avx512!(Self(_mm512_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        avx512!(Self(_mm512_sqrt_ps(self.0)))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> KMask16 {
        avx512!(KMask16(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn le(self, other: Self) -> KMask16 {
        avx512!(KMask16(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn lt_u32(self, other: Self) -> KMask16 {
        avx512!(KMask16(_mm512_cmplt_epu32_mask(
            _mm512_castps_si512(self.0),
            _mm512_castps_si512(other.0)
        )))
    }

    #[inline(always)]
    fn select(mask: KMask16, if_true: Self, if_false: Self) -> Self {
        avx512!(Self(_mm512_mask_blend_ps(mask.0, if_false.0, if_true.0)))
    }
}

impl PacketLanes for F32x16 {
    #[inline(always)]
    fn load(values: &[f32; PACKET_WIDTH]) -> Self {
        avx512!(Self(_mm512_loadu_ps(values.as_ptr())))
    }

    #[inline(always)]
    fn columns(rows: &[[f32; 8]; PACKET_WIDTH]) -> [Self; 8] {
        let [a, b, c, d] = four_columns(rows, 0);
        let [e, f, g, h] = four_columns(rows, 4);
        [a, b, c, d, e, f, g, h]
    }

    #[inline(always)]
    fn store(self) -> [f32; PACKET_WIDTH] {
        let mut values = [0.0; PACKET_WIDTH];
        // SAFETY: as for `avx512!`.
        unsafe { _mm512_storeu_ps(values.as_mut_ptr(), self.0) };
        values
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        // SAFETY: as for `avx512!`.
        unsafe { _mm512_reduce_max_ps(self.0) }
    }
}

/// Transposes four columns from `first`, with a third of the instructions of loading value by value.
#[inline(always)]
fn four_columns(rows: &[[f32; 8]; PACKET_WIDTH], first: usize) -> [F32x16; 4] {
    let [p, q] = [every_fourth(rows, 0, first), every_fourth(rows, 1, first)];
    let [r, s] = [every_fourth(rows, 2, first), every_fourth(rows, 3, first)];
    // SAFETY: see `F32x16`.
    unsafe {
        let (low_pq, high_pq) = (_mm512_unpacklo_ps(p, q), _mm512_unpackhi_ps(p, q));
        let (low_rs, high_rs) = (_mm512_unpacklo_ps(r, s), _mm512_unpackhi_ps(r, s));
        let (low_pq, high_pq) = (_mm512_castps_pd(low_pq), _mm512_castps_pd(high_pq));
        let (low_rs, high_rs) = (_mm512_castps_pd(low_rs), _mm512_castps_pd(high_rs));
        [
            F32x16(_mm512_castpd_ps(_mm512_unpacklo_pd(low_pq, low_rs))),
            F32x16(_mm512_castpd_ps(_mm512_unpackhi_pd(low_pq, low_rs))),
            F32x16(_mm512_castpd_ps(_mm512_unpacklo_pd(high_pq, high_rs))),
            F32x16(_mm512_castpd_ps(_mm512_unpackhi_pd(high_pq, high_rs))),
        ]
    }
}

/// Loads the four values from `first` of every fourth row from `row`.
#[inline(always)]
fn every_fourth(rows: &[[f32; 8]; PACKET_WIDTH], row: usize, first: usize) -> __m512 {
    let [a, b] = [&rows[row][first..first + 4], &rows[row + 4][first..first + 4]];
    let [c, d] = [&rows[row + 8][first..first + 4], &rows[row + 12][first..first + 4]];
    // SAFETY: see `F32x16`; each slice has four values.
    unsafe {
        let quarter = _mm512_castps128_ps512(_mm_loadu_ps(a.as_ptr()));
        let half = _mm512_insertf32x4::<1>(quarter, _mm_loadu_ps(b.as_ptr()));
        let three_quarters = _mm512_insertf32x4::<2>(half, _mm_loadu_ps(c.as_ptr()));
        _mm512_insertf32x4::<3>(three_quarters, _mm_loadu_ps(d.as_ptr()))
    }
}

impl LaneMask for KMask8 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}

impl LaneMask for KMask16 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}

macro_rules! operator {
    ($type:ident: $trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for $type {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                avx512!(Self($intrinsic(self.0, other.0)))
            }
        }
    };
}

operator!(F32x16: Add, add, _mm512_add_ps);
operator!(F32x16: Sub, sub, _mm512_sub_ps);
operator!(F32x16: Mul, mul, _mm512_mul_ps);
operator!(F32x16: Div, div, _mm512_div_ps);
operator!(KMask8: BitAnd, bitand, _kand_mask8);
operator!(KMask8: BitOr, bitor, _kor_mask8);
operator!(KMask16: BitAnd, bitand, _kand_mask16);
operator!(KMask16: BitOr, bitor, _kor_mask16);
