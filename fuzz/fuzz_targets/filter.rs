//! Fuzzes conditions on columns: what is read is written, and keeps the same points when it is read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel_core::math::Vec3;
use surfel_core::points::{PointCloud, PointFilter, Scalar, Values};

fuzz_target!(|text: &str| {
    let Ok(filter) = text.parse::<PointFilter>() else { return };
    let written = filter.to_string();
    let again: PointFilter = written.parse().expect("what is written is read");
    assert_eq!(again.to_string(), written);
    let cloud = PointCloud {
        classification: Some(vec![2, 6]),
        intensity: Some(vec![f32::NAN, 40.0]),
        colors: Some(vec![[0, 7, 65535]; 2]),
        scalars: vec![Scalar { name: "return_number".into(), values: Values::U8(vec![1, 2]) }],
        ..PointCloud::from_positions(vec![Vec3::ZERO, Vec3::new(-1.0, f32::NAN, 1e30)])
    };
    match (filter.matches(&cloud, 0), again.matches(&cloud, 0)) {
        (Ok(kept), Ok(kept_again)) => assert_eq!(kept, kept_again),
        (first, second) => assert!(first.is_err() && second.is_err()),
    }
});
