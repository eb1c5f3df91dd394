//! Entry into a kernel at a chosen SIMD level.

/// Runs a kernel, a function that is generic over `Lanes`, at a SIMD level. Every level gives the same bytes.
///
/// The kernel is compiled once for each level, in a function of its own that has the level's instructions.
macro_rules! dispatch_simd {
    ($simd:expr, $kernel:ident($($argument:ident: $type:ty),*)) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn avx2($($argument: $type),*) {
            use $crate::trace::simd::avx2::{Avx2, F32x8};
            $kernel::<F32x8<Avx2>>($($argument),*);
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(
            enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw"
        )]
        fn avx512($($argument: $type),*) {
            use $crate::trace::simd::avx2::F32x8;
            use $crate::trace::simd::avx512::Avx512;
            $kernel::<F32x8<Avx512>>($($argument),*);
        }

        use $crate::trace::simd::level::Level;
        match $simd.level() {
            Level::Portable => $kernel::<$crate::math::PortableLanes>($($argument),*),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a `Simd` of this level exists only where the processor has it.
            Level::Avx2 => unsafe { avx2($($argument),*) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a `Simd` of this level exists only where the processor has it.
            Level::Avx512 => unsafe { avx512($($argument),*) },
        }
    }};
}

pub(in crate::trace) use dispatch_simd;
