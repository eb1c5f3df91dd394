//! Image files, read back by the crates for their formats.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
use surfel_core::image::{Image, NO_ID, decode_srgb};
use surfel_core::math::{DVec3, Vec3};
use surfel_formats::{
    Alpha, BitDepth, EpsgCodes, Georeference, HeightMap, ImageOptions, encode_png, save_height_map,
    save_image,
};
use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;

use crate::common::Folder;

fn decode_png(path: &Path) -> (png::ColorType, png::BitDepth, Vec<u8>) {
    let file = BufReader::new(File::open(path).unwrap());
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
    let error = encode_png(&Image::new(0, 3), &ImageOptions::default()).unwrap_err().to_string();
    assert!(error.contains("its encoder refuses") && !error.contains("disk"), "{error}");
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
fn pictures_that_are_too_large_for_their_format_are_refused_before_the_work() {
    use surfel_formats::check_image_size;
    for (name, largest, too_large, limit) in [
        ("a.webp", (16_384, 16_384), (16_385, 1), "WebP holds at most 16384x16384"),
        ("a.WEBP", (16_384, 1), (1, 16_385), "WebP holds at most 16384x16384"),
        ("a.jpg", (65_535, 65_535), (65_536, 1), "JPEG holds at most 65535x65535"),
        ("a.jpeg", (1, 65_535), (1, 65_536), "JPEG holds at most 65535x65535"),
        ("a.exr", (1_766_022, 20), (1_766_023, 20), "EXR holds at most 1766022x1073741822"),
        ("a.tif", (1 << 28, 1), (1 << 15, 1 << 14), "TIFF holds less than 4 GiB"),
        ("a.png", (1 << 28, 1), (1 << 31, 1), "PNG holds at most 2147483647"),
        ("-", (1, 1), (1, 0), "choose at least 1x1"),
        ("a.webp", (1, 1), (0, 1), "choose at least 1x1"),
    ] {
        check_image_size(Path::new(name), largest.0, largest.1).unwrap();
        let error = check_image_size(Path::new(name), too_large.0, too_large.1).unwrap_err();
        let found = format!("{name}: found a picture of {}x{} pixels", too_large.0, too_large.1);
        let message = error.to_string();
        assert!(message.starts_with(&found) && message.contains(limit), "{message}");
    }
}

/// Returns the sides of a lossless WebP or a JPEG. The crate `image` reads WebP's greatest side as 0.
fn sides_of(path: &Path) -> (u32, u32) {
    let bytes = std::fs::read(path).unwrap();
    if !bytes.starts_with(b"RIFF") {
        return image::image_dimensions(path).unwrap();
    }
    // 14 bits each behind the signature of the lossless format, less one.
    let bits = u32::from_le_bytes(*bytes[21..].first_chunk().unwrap());
    (1 + (bits & 0x3fff), 1 + (bits >> 14 & 0x3fff))
}

#[test]
fn encoders_take_the_largest_sides_that_the_check_allows() {
    let folder = Folder::new("largest");
    for (name, sides) in [("a.webp", 16_384), ("a.jpg", 65_535)] {
        for (width, height) in [(sides, 1), (1, sides)] {
            let path = folder.path(name);
            save_image(&path, &Image::new(width, height), &ImageOptions::default()).unwrap();
            assert_eq!(sides_of(&path), (width, height));
        }
        let too_wide = Image::new(sides + 1, 1);
        let error = save_image(&folder.path(name), &too_wide, &ImageOptions::default());
        let message = error.unwrap_err().to_string();
        assert!(message.contains("choose a smaller size"), "{message}");
        assert!(!message.contains("disk"), "{message}");
    }
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

/// Opens a TIFF file with the decoder of its crate.
fn tiff_decoder(path: &Path) -> Decoder<BufReader<File>> {
    Decoder::new(BufReader::new(File::open(path).unwrap())).unwrap()
}

#[test]
fn height_maps_hold_their_elevations_and_their_place() {
    let folder = Folder::new("heights");
    let path = folder.path("a.tif");
    let north_up = Georeference {
        corner: [691_600.0, 5_334_800.0],
        right: [0.5, 0.0],
        down: [0.0, -0.25],
        epsg: Some(EpsgCodes { horizontal: 25832, vertical: Some(7837) }),
        is_geographic: false,
    };
    let saved = |georeference: Georeference| {
        let elevations = vec![512.25, -3.5, f32::NAN, 0.0, 1e6, 8848.86];
        save_height_map(&path, &HeightMap { width: 3, height: 2, elevations, georeference })
            .unwrap();
        tiff_decoder(&path)
    };
    let mut file = saved(north_up);
    assert_eq!(file.dimensions().unwrap(), (3, 2));
    let DecodingResult::F32(elevations) = file.read_image().unwrap() else { panic!("no floats") };
    assert_eq!(elevations, [512.25, -3.5, -9999.0, 0.0, 1e6, 8848.86]);
    assert_eq!(file.get_tag_ascii_string(Tag::GdalNodata).unwrap(), "-9999");
    let scale = file.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap();
    assert_eq!(scale, [0.5, 0.25, 0.0]);
    let tie_point = file.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap();
    assert_eq!(tie_point, [0.0, 0.0, 0.0, 691_600.0, 5_334_800.0, 0.0]);
    assert!(file.find_tag(Tag::ModelTransformationTag).unwrap().is_none());
    // Version 1.1.1 and four keys: a projected system, areas, and the codes of both systems.
    let keys =
        [[1, 1, 1, 4], [1024, 0, 1, 1], [1025, 0, 1, 1], [3072, 0, 1, 25832], [4096, 0, 1, 7837]];
    let found = file.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap();
    assert_eq!(found, keys.as_flattened());

    // Rows that do not go east need a matrix.
    let turned = Georeference { right: [0.0, 0.5], down: [0.25, 0.0], epsg: None, ..north_up };
    let mut file = saved(turned);
    let matrix =
        [[0.0, 0.25, 0.0, 691_600.0], [0.5, 0.0, 0.0, 5_334_800.0], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
    let found = file.get_tag_f64_vec(Tag::ModelTransformationTag).unwrap();
    assert_eq!(found, matrix.as_flattened());
    assert!(file.find_tag(Tag::ModelPixelScaleTag).unwrap().is_none());
    let keys = file.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap();
    assert_eq!(keys, [1, 1, 1, 1, 1025, 0, 1, 1]);

    let degrees = EpsgCodes { horizontal: 4326, vertical: None };
    let degrees = Georeference { epsg: Some(degrees), is_geographic: true, ..north_up };
    let keys = saved(degrees).get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap();
    assert_eq!(keys[4..], [1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326]);
}

#[test]
fn the_place_of_a_plan_does_not_change_its_picture() {
    let folder = Folder::new("plan");
    let mut image = Image::new(9, 4);
    for (i, pixel) in image.color.iter_mut().enumerate() {
        *pixel = [i as f32 / 40.0, 0.25, 0.5, 1.0];
    }
    let georeference = Georeference {
        corner: [10.0, 20.0],
        right: [2.0, 0.0],
        down: [0.0, -2.0],
        epsg: None,
        is_geographic: false,
    };
    let plan = ImageOptions { georeference: Some(georeference), ..ImageOptions::default() };
    let (plain, placed) = (folder.path("plain.tif"), folder.path("plan.tif"));
    save_image(&plain, &image, &ImageOptions::default()).unwrap();
    save_image(&placed, &image, &plan).unwrap();
    assert_eq!(image::open(&placed).unwrap(), image::open(&plain).unwrap());
    let scale = tiff_decoder(&placed).get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap();
    assert_eq!(scale, [2.0, 2.0, 0.0]);
    assert!(tiff_decoder(&plain).find_tag(Tag::GeoKeyDirectoryTag).unwrap().is_none());
}

#[test]
fn the_resolution_of_a_print_is_in_files_that_have_one() {
    let folder = Folder::new("dpi");
    let options = ImageOptions { dpi: Some(299.5), ..ImageOptions::default() };
    let image = Image::new(4, 3);
    let path = |name: &str| {
        let path = folder.path(name);
        save_image(&path, &image, &options).unwrap();
        path
    };
    let mut tiff = tiff_decoder(&path("a.tif"));
    for tag in [Tag::XResolution, Tag::YResolution] {
        let Value::Rational(n, d) = tiff.get_tag(tag).unwrap() else { panic!("no fraction") };
        assert_eq!(f64::from(n) / f64::from(d), 299.5, "{tag:?}");
    }
    // 2 stands for pixels per inch.
    assert_eq!(tiff.get_tag_u32(Tag::ResolutionUnit).unwrap(), 2);
    // The segment JFIF: a name, a version, the unit 1 (pixels per inch), and whole numbers of pixels.
    let jpeg = std::fs::read(path("a.jpg")).unwrap();
    assert_eq!((&jpeg[..4], &jpeg[6..11]), (&[0xff, 0xd8, 0xff, 0xe0][..], &b"JFIF\0"[..]));
    assert_eq!(jpeg[13..18], [1, 1, 44, 1, 44]);
    let file = BufReader::new(File::open(path("a.png")).unwrap());
    let png = png::Decoder::new(file).read_info().unwrap();
    let density = png.info().pixel_dims.unwrap();
    assert_eq!((density.xppu, density.yppu), (11_791, 11_791));
    // Without a resolution there is none.
    save_image(&folder.path("b.tif"), &image, &ImageOptions::default()).unwrap();
    let unit = tiff_decoder(&folder.path("b.tif")).find_tag(Tag::ResolutionUnit).unwrap();
    assert!(unit.is_none_or(|unit| unit.into_u32().unwrap() != 2));
}
