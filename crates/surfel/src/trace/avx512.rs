//! Sixteen floats in one AVX-512 register, and the batch kernels compiled for AVX-512.

use super::avx2::{Eight, Registers};
use super::hit::{Gather, Hit};
use super::splat::{self, Splat};
use super::surface::{self, SurfaceHit};
use super::{any, boxes, closest, gather};
use crate::flat::{FlatCloud, FlatTriangles};
use crate::math::{Aabb, Floats, LANES, LaneMask, Ray, Task, WIDE, Wide};
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

macro_rules! kernel {
    ($module:ident::$name:ident($from:ty => $result:ty)) => {
        /// The batch kernel of the same name.
        #[target_feature(
            enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw"
        )]
        pub(super) fn $name(from: &$from, rays: &[Ray], results: &mut [$result]) {
            $module::$name::<Eight<Avx512>>(from, rays, results);
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

macro_rules! avx512 {
    ($wrap:ident($($call:tt)*)) => {
        // SAFETY: see `Sixteen`; loads and stores go through references to arrays of the full width.
        $wrap(unsafe { $($call)* })
    };
}

#[derive(Clone, Copy)]
struct Avx512;

impl Registers for Avx512 {
    type Wide = Sixteen;
    type Mask = EightMask;

    #[inline(always)]
    fn less(left: __m256, right: __m256) -> EightMask {
        avx512!(EightMask(_mm256_cmp_ps_mask::<_CMP_LT_OQ>(left, right)))
    }

    #[inline(always)]
    fn less_equal(left: __m256, right: __m256) -> EightMask {
        avx512!(EightMask(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(left, right)))
    }

    #[inline(always)]
    fn less_bits(left: __m256, right: __m256) -> EightMask {
        avx512!(EightMask(_mm256_cmplt_epu32_mask(
            _mm256_castps_si256(left),
            _mm256_castps_si256(right)
        )))
    }

    #[inline(always)]
    fn below<const SHIFT: i32>(word: u32) -> EightMask {
        avx512!(EightMask({
            let top =
                _mm256_sll_epi32(_mm256_set1_epi32(word as i32), _mm_cvtsi32_si128(28 - SHIFT));
            _mm256_cmple_epu32_mask(_mm256_loadu_si256(COUNTED_FROM.as_ptr().cast()), top)
        }))
    }

    #[inline(always)]
    fn select(mask: EightMask, if_true: __m256, if_false: __m256) -> __m256 {
        // SAFETY: see `Sixteen`.
        unsafe { _mm256_mask_blend_ps(mask.0, if_false, if_true) }
    }

    #[inline(always)]
    fn compress(values: __m256, mask: EightMask) -> __m256 {
        // SAFETY: see `Sixteen`.
        unsafe { _mm256_maskz_compress_ps(mask.0, values) }
    }

    #[inline(always)]
    fn call<T: Task>(task: T) -> T::Output {
        // SAFETY: see `Sixteen`.
        unsafe { call(task) }
    }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
#[inline(never)]
fn call<T: Task>(task: T) -> T::Output {
    task.run()
}

/// For each lane the lowest word whose highest four bits count it in.
static COUNTED_FROM: [u32; LANES] =
    [1 << 28, 2 << 28, 3 << 28, 4 << 28, 5 << 28, 6 << 28, 7 << 28, 8 << 28];

/// Of eight lanes.
#[derive(Clone, Copy)]
struct EightMask(__mmask8);

/// Used only inside the kernels above, which are entered only where AVX-512 is present: that is what
/// makes each `unsafe` of this file sound.
#[derive(Clone, Copy)]
struct Sixteen(__m512);

#[derive(Clone, Copy)]
struct SixteenMask(__mmask16);

impl Floats for Sixteen {
    type Mask = SixteenMask;

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
    fn less(self, other: Self) -> SixteenMask {
        avx512!(SixteenMask(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn less_equal(self, other: Self) -> SixteenMask {
        avx512!(SixteenMask(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn less_bits(self, other: Self) -> SixteenMask {
        avx512!(SixteenMask(_mm512_cmplt_epu32_mask(
            _mm512_castps_si512(self.0),
            _mm512_castps_si512(other.0)
        )))
    }

    #[inline(always)]
    fn select(mask: SixteenMask, if_true: Self, if_false: Self) -> Self {
        avx512!(Self(_mm512_mask_blend_ps(mask.0, if_false.0, if_true.0)))
    }
}

impl Wide for Sixteen {
    #[inline(always)]
    fn load(values: &[f32; WIDE]) -> Self {
        avx512!(Self(_mm512_loadu_ps(values.as_ptr())))
    }

    #[inline(always)]
    fn columns(rows: &[[f32; 8]; WIDE]) -> [Self; 8] {
        let [a, b, c, d] = four_columns(rows, 0);
        let [e, f, g, h] = four_columns(rows, 4);
        [a, b, c, d, e, f, g, h]
    }

    #[inline(always)]
    fn store(self) -> [f32; WIDE] {
        let mut values = [0.0; WIDE];
        // SAFETY: as for `avx512!`.
        unsafe { _mm512_storeu_ps(values.as_mut_ptr(), self.0) };
        values
    }

    #[inline(always)]
    fn max_lane(self) -> f32 {
        // SAFETY: as for `avx512!`.
        unsafe { _mm512_reduce_max_ps(self.0) }
    }
}

/// Four columns from `first` on. A third of the instructions that come of loading value by value.
#[inline(always)]
fn four_columns(rows: &[[f32; 8]; WIDE], first: usize) -> [Sixteen; 4] {
    let [p, q] = [every_fourth(rows, 0, first), every_fourth(rows, 1, first)];
    let [r, s] = [every_fourth(rows, 2, first), every_fourth(rows, 3, first)];
    // SAFETY: see `Sixteen`.
    unsafe {
        let (low_pq, high_pq) = (_mm512_unpacklo_ps(p, q), _mm512_unpackhi_ps(p, q));
        let (low_rs, high_rs) = (_mm512_unpacklo_ps(r, s), _mm512_unpackhi_ps(r, s));
        let (low_pq, high_pq) = (_mm512_castps_pd(low_pq), _mm512_castps_pd(high_pq));
        let (low_rs, high_rs) = (_mm512_castps_pd(low_rs), _mm512_castps_pd(high_rs));
        [
            Sixteen(_mm512_castpd_ps(_mm512_unpacklo_pd(low_pq, low_rs))),
            Sixteen(_mm512_castpd_ps(_mm512_unpackhi_pd(low_pq, low_rs))),
            Sixteen(_mm512_castpd_ps(_mm512_unpacklo_pd(high_pq, high_rs))),
            Sixteen(_mm512_castpd_ps(_mm512_unpackhi_pd(high_pq, high_rs))),
        ]
    }
}

/// Of each fourth row from `row` on the four values from `first` on.
#[inline(always)]
fn every_fourth(rows: &[[f32; 8]; WIDE], row: usize, first: usize) -> __m512 {
    let [a, b] = [&rows[row][first..first + 4], &rows[row + 4][first..first + 4]];
    let [c, d] = [&rows[row + 8][first..first + 4], &rows[row + 12][first..first + 4]];
    // SAFETY: see `Sixteen`; each slice has four values.
    unsafe {
        let quarter = _mm512_castps128_ps512(_mm_loadu_ps(a.as_ptr()));
        let half = _mm512_insertf32x4::<1>(quarter, _mm_loadu_ps(b.as_ptr()));
        let most = _mm512_insertf32x4::<2>(half, _mm_loadu_ps(c.as_ptr()));
        _mm512_insertf32x4::<3>(most, _mm_loadu_ps(d.as_ptr()))
    }
}

impl LaneMask for EightMask {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}

impl LaneMask for SixteenMask {
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

operator!(Sixteen: Add, add, _mm512_add_ps);
operator!(Sixteen: Sub, sub, _mm512_sub_ps);
operator!(Sixteen: Mul, mul, _mm512_mul_ps);
operator!(Sixteen: Div, div, _mm512_div_ps);
operator!(EightMask: BitAnd, bitand, _kand_mask8);
operator!(EightMask: BitOr, bitor, _kor_mask8);
operator!(SixteenMask: BitAnd, bitand, _kand_mask16);
operator!(SixteenMask: BitOr, bitor, _kor_mask16);
