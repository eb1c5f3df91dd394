//! Eight floats in one AVX register, and the batch kernels compiled for AVX2.
//!
//! Without fused multiply-add: results must equal the portable ones bit for bit.

use super::kernel::{self, Gather, Hit};
use super::surface::{self, SurfaceHit};
use crate::flat::FlatScene;
use crate::math::{LANES, LaneMask, Lanes, Ray};
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

macro_rules! kernel {
    ($module:ident::$name:ident($result:ty)) => {
        /// The batch kernel of the same name.
        #[target_feature(enable = "avx2")]
        pub(super) fn $name(scene: &FlatScene, rays: &[Ray], results: &mut [$result]) {
            $module::$name::<Avx2Lanes>(scene, rays, results);
        }
    };
}

kernel!(kernel::closest_hits(Hit));
kernel!(kernel::any_hits(bool));
kernel!(kernel::gathers(Gather));
kernel!(surface::surface_hits(SurfaceHit));
kernel!(surface::occlusions(bool));

/// Used only inside the kernels above, which are entered only where AVX2 is present: that is what
/// makes each `unsafe` of this file sound.
#[derive(Clone, Copy)]
struct Avx2Lanes(__m256);

#[derive(Clone, Copy)]
struct Avx2Mask(__m256);

macro_rules! avx2 {
    ($wrap:ident($($call:tt)*)) => {
        // SAFETY: see `Avx2Lanes`; loads and stores go through references to arrays of the full width.
        $wrap(unsafe { $($call)* })
    };
}

impl Lanes for Avx2Lanes {
    type Mask = Avx2Mask;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        avx2!(Self(_mm256_set1_ps(value)))
    }

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
    fn abs(self) -> Self {
        avx2!(Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)))
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        avx2!(Self(_mm256_or_ps(
            _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0),
            _mm256_and_ps(_mm256_set1_ps(-0.0), sign.0)
        )))
    }

    #[inline(always)]
    fn less(self, other: Self) -> Avx2Mask {
        avx2!(Avx2Mask(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn less_equal(self, other: Self) -> Avx2Mask {
        avx2!(Avx2Mask(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn select(mask: Avx2Mask, if_true: Self, if_false: Self) -> Self {
        avx2!(Self(_mm256_blendv_ps(if_false.0, if_true.0, mask.0)))
    }
}

impl LaneMask for Avx2Mask {
    #[inline(always)]
    fn bits(self) -> u8 {
        // SAFETY: as for `avx2!`.
        unsafe { _mm256_movemask_ps(self.0) as u8 }
    }
}

macro_rules! operator {
    ($type:ident: $trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for $type {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                avx2!(Self($intrinsic(self.0, other.0)))
            }
        }
    };
}

operator!(Avx2Lanes: Add, add, _mm256_add_ps);
operator!(Avx2Lanes: Sub, sub, _mm256_sub_ps);
operator!(Avx2Lanes: Mul, mul, _mm256_mul_ps);
operator!(Avx2Lanes: Div, div, _mm256_div_ps);
operator!(Avx2Mask: BitAnd, bitand, _mm256_and_ps);
operator!(Avx2Mask: BitOr, bitor, _mm256_or_ps);
