//! Image files, read back by the crates for their formats.

use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
use surfel_core::image::{Image, NO_ID, decode_srgb};
use surfel_core::math::{DVec3, Vec3};
use surfel_formats::{Alpha, BitDepth, ImageOptions, encode_png, save_image};

use crate::common::Folder;

fn decode_png(path: &std::path::Path) -> (png::ColorType, png::BitDepth, Vec<u8>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert!(reader.info().srgb.is_some());
    (info.color_type, info.bit_depth, bytes)
}

#[test]
fn png_keeps_eight_bit_colours_and_stores_straight_alpha() {
    let folder = Folder::new("png");
    let path = folder.path("a.png");
    let mut image = Image::new(256, 1);
    for (value, pixel) in image.color.iter_mut().enumerate() {
        let linear = decode_srgb(value as f32 / 255.0);
        *pixel = [linear * 0.5, linear * 0.5, f32::NAN, 0.5];
    }
    save_image(&path, &image, &ImageOptions::default()).unwrap();
    let (color, depth, bytes) = decode_png(&path);
    assert_eq!((color, depth), (png::ColorType::Rgba, png::BitDepth::Eight));
    for (value, pixel) in bytes.chunks_exact(4).enumerate() {
        assert_eq!(pixel, [value as u8, value as u8, 0, 128]);
    }

    let options =
        ImageOptions { depth: BitDepth::Sixteen, alpha: Alpha::Drop, ..Default::default() };
    image.color[0] = [2.0, 1.0, -1.0, 1.0];
    save_image(&path, &image, &options).unwrap();
    let (color, depth, bytes) = decode_png(&path);
    assert_eq!((color, depth), (png::ColorType::Rgb, png::BitDepth::Sixteen));
    assert_eq!(bytes[..6], [255, 255, 255, 255, 0, 0]);
}

#[test]
fn encode_png_returns_the_bytes_of_the_file() {
    let folder = Folder::new("bytes");
    let path = folder.path("a.png");
    let mut image = Image::new(5, 3);
    for (i, pixel) in image.color.iter_mut().enumerate() {
        *pixel = [i as f32 / 20.0, 0.25, 0.5, 0.75];
    }
    for depth in [BitDepth::Eight, BitDepth::Sixteen] {
        let options = ImageOptions { depth, ..ImageOptions::default() };
        save_image(&path, &image, &options).unwrap();
        assert_eq!(encode_png(&image, &options).unwrap(), std::fs::read(&path).unwrap());
    }
    assert!(encode_png(&Image::new(0, 3), &ImageOptions::default()).is_err());
}

#[test]
fn exr_keeps_every_layer_and_the_origin() {
    let folder = Folder::new("exr");
    let path = folder.path("a.exr");
    let mut image = Image::with_aovs(3, 2);
    image.color[4] = [0.25, 0.5, 2.0, 1.0];
    image.coverage[4] = 0.75;
    let aovs = image.aovs.as_mut().unwrap();
    aovs.depth[4] = 12.5;
    aovs.normal[4] = Vec3::Z;
    aovs.position[4] = Vec3::new(1.0, 2.0, 3.0);
    aovs.point_id[4] = 0xfeed_beef;
    aovs.instance_id[4] = 7;
    aovs.albedo[4] = Vec3::splat(0.5);
    aovs.support_count[4] = 9;
    aovs.support_distance[4] = 0.25;
    let origin = DVec3::new(484_800.123_456, 6_632_800.0, 100.0);
    save_image(&path, &image, &ImageOptions { origin, ..Default::default() }).unwrap();

    let picture = read_first_flat_layer_from_file(&path).unwrap();
    let layer = &picture.layer_data;
    let names: Vec<String> =
        layer.channel_data.list.iter().map(|channel| channel.name.to_string()).collect();
    let sample = |name: &str| {
        let at = names.iter().position(|other| other == name).unwrap_or_else(|| panic!("{name}"));
        match &layer.channel_data.list[at].sample_data {
            FlatSamples::F32(values) => (f64::from(values[4]), f64::from(values[0])),
            FlatSamples::U32(values) => (f64::from(values[4]), f64::from(values[0])),
            FlatSamples::F16(_) => panic!("{name} has half precision"),
        }
    };
    assert_eq!(names.len(), 19);
    assert_eq!(sample("B").0, 2.0);
    assert_eq!(sample("Z"), (12.5, f64::INFINITY));
    assert_eq!(sample("N.Z").0, 1.0);
    assert_eq!(sample("P.Y").0, 2.0);
    assert_eq!(sample("id"), (f64::from(0xfeed_beef_u32), f64::from(NO_ID)));
    assert_eq!(sample("instance").0, 7.0);
    assert_eq!(sample("albedo.G").0, 0.5);
    assert_eq!(sample("coverage").0, 0.75);
    assert_eq!(sample("support.count"), (9.0, 0.0));
    assert_eq!(sample("support.distance"), (0.25, f64::INFINITY));
    let text = exr::meta::attribute::AttributeValue::Text("484800.123456 6632800 100".into());
    let origin = layer.attributes.other.iter().find(|(name, _)| **name == *"origin");
    assert_eq!(origin.map(|(_, value)| value), Some(&text));
}

#[test]
fn check_image_output_rejects_unwritable_paths() {
    let folder = Folder::new("outputs");
    let message = |name: &str| {
        surfel_formats::check_image_output(&folder.path(name)).unwrap_err().to_string()
    };
    assert!(message("none/a.png").contains("create it first"));
    assert!(message("a.gif").contains("the extension `.gif`"));
    assert!(message("a").contains("a name without extension"));
    std::fs::create_dir(folder.path("b.png")).unwrap();
    assert!(message("b.png").contains("name a file, not a folder"));
    surfel_formats::check_image_output(&folder.path("a.exr")).unwrap();
}

#[test]
fn pictures_for_display_hold_the_colours_of_the_png() {
    let folder = Folder::new("display");
    let mut image = Image::new(48, 32);
    for (i, pixel) in image.color.iter_mut().enumerate() {
        let alpha = if i % 48 < 24 { 1.0 } else { 0.0 };
        *pixel = [i as f32 / 1600.0, 0.25, 0.5, 1.0].map(|channel| channel * alpha);
    }
    for alpha in [Alpha::Keep, Alpha::Drop] {
        let options = ImageOptions { alpha, ..ImageOptions::default() };
        let png = image::load_from_memory(&encode_png(&image, &options).unwrap()).unwrap();
        for name in ["a.webp", "a.tif", "a.tiff"] {
            save_image(&folder.path(name), &image, &options).unwrap();
            assert_eq!(image::open(folder.path(name)).unwrap(), png, "{name}");
        }
    }
    let sixteen = ImageOptions { depth: BitDepth::Sixteen, ..ImageOptions::default() };
    save_image(&folder.path("deep.tif"), &image, &sixteen).unwrap();
    let png = image::load_from_memory(&encode_png(&image, &sixteen).unwrap()).unwrap();
    assert_eq!(image::open(folder.path("deep.tif")).unwrap(), png);

    save_image(&folder.path("a.jpg"), &image, &sixteen).unwrap();
    let jpeg = image::open(folder.path("a.jpg")).unwrap().into_rgb8();
    let [left, right] = [jpeg.get_pixel(4, 16).0, jpeg.get_pixel(40, 16).0];
    let expected = png.to_rgb8().get_pixel(4, 16).0;
    assert!(left.iter().zip(expected).all(|(a, b)| a.abs_diff(b) < 6), "{left:?} {expected:?}");
    assert!(right.iter().all(|channel| 250 < *channel), "transparent is white: {right:?}");
    let error = save_image(&folder.path("a.jpeg"), &Image::new(70_000, 1), &sixteen).unwrap_err();
    assert!(error.to_string().contains("a.jpeg"), "{error}");
    assert!(!folder.path("a.jpeg").exists());
}
