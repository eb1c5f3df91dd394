//! Fuzzes the environment map reader: HDR or EXR, depending on the first bytes.
#![no_main]

#[path = "../panic_hook.rs"]
mod panic_hook;

use libfuzzer_sys::fuzz_target;
use panic_hook::ignore_decoder_panics;
use surfel_core::math::Vec3;
use surfel_core::progress::NoProgress;
use surfel_core::scene::Environment;
use surfel_formats::load_environment_map_bytes;

fuzz_target!(init: ignore_decoder_panics("exr-"), |bytes: &[u8]| {
    if let Ok(image) = load_environment_map_bytes("fuzz.hdr", bytes, &NoProgress) {
        let n_pixels = image.pixels.len();
        assert_eq!(n_pixels, image.width as usize * image.height as usize);
        assert!(12 * n_pixels <= (64 << 20).max(2048 * bytes.len()));
        // Larger images slow the fuzzer down without new coverage.
        if n_pixels < 10_000 {
            let (width, height) = (image.width, image.height);
            if let Ok(environment) = Environment::new(width, height, image.pixels, Vec3::Z, 0.0) {
                let direction = environment.sample((0.3, 0.7));
                let (radiance, density) = environment.radiance_and_density(direction);
                assert!(direction.is_finite() && radiance.is_finite());
                assert!(density.is_finite() && 0.0 <= density);
            }
        }
    }
});
