//! The SIMD level, which is chosen once and passed down.

/// A SIMD level that this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Simd(Level);

/// Private to tracing, so that nothing can name a level that the processor lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::trace) enum Level {
    /// No SIMD instructions beyond those that the compiler may assume.
    Portable,
    #[cfg(target_arch = "x86_64")]
    /// AVX2, FMA, BMI1, BMI2, LZCNT and POPCNT.
    Avx2,
    #[cfg(target_arch = "x86_64")]
    /// All of `Avx2`, and AVX-512 F, VL, DQ and BW.
    Avx512,
}

impl Simd {
    /// The level that every processor has.
    pub const PORTABLE: Self = Self(Level::Portable);

    /// Returns the fastest level of this processor.
    pub fn detect() -> Self {
        *Self::available().last().unwrap_or(&Self::PORTABLE)
    }

    /// Returns all levels of this processor, slowest first.
    pub fn available() -> Vec<Self> {
        #[cfg_attr(
            not(target_arch = "x86_64"),
            expect(unused_mut, reason = "only x86-64 has more levels")
        )]
        let mut levels = vec![Self::PORTABLE];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt")
        {
            levels.push(Self(Level::Avx2));
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512bw")
            {
                levels.push(Self(Level::Avx512));
            }
        }
        levels
    }

    /// Returns the name of the level, for reports.
    pub fn name(self) -> &'static str {
        match self.0 {
            Level::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => "avx512",
        }
    }

    /// Returns the level.
    pub(in crate::trace) fn level(self) -> Level {
        self.0
    }
}
