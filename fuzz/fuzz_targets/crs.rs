//! Fuzzes coordinate reference systems: codes, WKT, and the places and directions that follow from them.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel::crs::CoordinateSystem;
use surfel_core::math::DVec3;

fuzz_target!(|text: &str| {
    let Some(system) = CoordinateSystem::parse(text) else { return };
    assert!(system.unit().metres().is_none_or(|metres| !metres.is_nan()));
    let munich = DVec3::new(691_607.0, 5_334_760.0, 520.0);
    let odd = [DVec3::ZERO, DVec3::splat(1e9), DVec3::splat(-1e300), DVec3::splat(f64::NAN)];
    for position in odd.into_iter().chain([munich]) {
        if let Some(compass) = system.compass(position) {
            assert!(compass.north.is_finite() && compass.up.is_finite(), "{position}");
        }
    }
});
