//! The time to draw a legend, a scale bar, a north arrow and a caption onto a finished picture.
//!
//! `cargo bench -p surfel --bench overlay`

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use surfel::crs::Unit;
use surfel::description::PictureSettings;
use surfel::overlay::Overlay;
use surfel::surfel_core::image::Image;
use surfel::surfel_core::math::{DVec3, Vec3};
use surfel::surfel_core::scene::color::{Legend, LegendClass};
use surfel::surfel_core::scene::{Camera, Projection};

criterion_group!(benches, draw);
criterion_main!(benches);

fn draw(criterion: &mut Criterion) {
    let camera = Camera {
        position: DVec3::new(0.0, 0.0, 10.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Y,
        projection: Projection::Orthographic { height: 50.0 },
    };
    let map = Legend::Map {
        title: "elevation".to_owned(),
        low: 3.7,
        high: 1250.0,
        colors: vec![[0; 3], [255; 3]],
    };
    let classes = Legend::Classes((1..=12).map(|class| LegendClass::new(class, 1)).collect());
    for (width, height) in [(1920, 1080), (3840, 2160)] {
        let mut group = criterion.benchmark_group(format!("{width} x {height}"));
        let image = Image::new(width, height);
        for (name, legend) in [("colour bar", map.clone()), ("12 classes", classes.clone())] {
            let legend_alone = PictureSettings { legend: Some(true), ..PictureSettings::default() };
            let all = PictureSettings {
                scale_bar: Some(true),
                north: Some(true),
                caption: Some("A caption of a line".to_owned()),
                ..legend_alone.clone()
            };
            for (with, picture) in [("", legend_alone), (", scale bar, north, caption", all)] {
                let up = (Vec3::Z, Unit::Metres(1.0));
                let overlay = Overlay::of(&picture, legend.clone(), up);
                assert!(!overlay.is_empty());
                group.bench_function(format!("{name}{with}"), |bencher| {
                    let draw = |image: &mut Image| overlay.draw(image, &camera);
                    bencher.iter_batched_ref(|| image.clone(), draw, BatchSize::LargeInput);
                });
            }
        }
    }
}
