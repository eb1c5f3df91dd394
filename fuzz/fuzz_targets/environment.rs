//! Any bytes as a picture of light: HDR or EXR, by their first bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel::math::Vec3;
use surfel::progress::Silent;
use surfel::scene::Environment;
use surfel_formats::load_environment_picture_bytes;

fuzz_target!(init: let_the_decoder_panic(), |bytes: &[u8]| {
    if let Ok(picture) = load_environment_picture_bytes("fuzz.hdr", bytes, &Silent) {
        let n_pixels = picture.pixels.len();
        assert_eq!(n_pixels, picture.width as usize * picture.height as usize);
        assert!(12 * n_pixels <= (64 << 20).max(2048 * bytes.len()));
        // Larger ones take the fuzzer's time and have nothing new.
        if n_pixels < 10_000 {
            let (width, height) = (picture.width, picture.height);
            if let Ok(light) = Environment::new(width, height, picture.pixels, Vec3::Z, 0.0) {
                let (direction, pdf) = light.sample((0.3, 0.7));
                assert!(direction.is_finite() && 0.0 < pdf && light.average().is_finite());
            }
        }
    }
});

/// The reader catches the panics of the decoder for EXR; all others end the fuzzer as they should.
fn let_the_decoder_panic() {
    let end = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let is_decoder = panic.location().is_some_and(|place| place.file().contains("/exr-"));
        if !is_decoder {
            end(panic);
        }
    }));
}
