//! Pictures of light: every encoding by hand, EXR by its crate, and broken ones.

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as ExrImage, Layer,
    LayerAttributes, LineOrder, SmallVec, WritableImage, f16,
};
use surfel::image::Image;
use surfel::math::Vec3;
use surfel::progress::Silent;
use surfel_formats::{
    Error, ImageOptions, LinearPicture, load_environment_picture, load_environment_picture_bytes,
    save_image,
};

use crate::common::{Folder, Listener};

fn read(bytes: impl AsRef<[u8]>) -> Result<LinearPicture, Error> {
    load_environment_picture_bytes("light.hdr", bytes.as_ref(), &Silent)
}

fn message(bytes: impl AsRef<[u8]>) -> String {
    let message = read(bytes).unwrap_err().to_string();
    assert!(message.starts_with("light.hdr: "), "{message}");
    message
}

fn hdr(header: &str, size: &str, pixels: &[u8]) -> Vec<u8> {
    [format!("#?RADIANCE\n{header}\n\n{size}\n").as_bytes(), pixels].concat()
}

/// A file in the encoding of new files: 9 x 2 pixels, each channel in runs and bytes as they are.
fn by_channel() -> Vec<u8> {
    let line = |red: u8| {
        let head = [2, 2, 0, 9];
        let reds = [128 + 9, red];
        let greens = [3, 1, 2, 3, 128 + 4, 7, 2, 8, 9];
        let blues = [9, 0, 1, 2, 3, 4, 5, 6, 7, 8];
        let exponents = [128 + 8, 136, 1, 0];
        [&head[..], &reds, &greens, &blues, &exponents].concat()
    };
    hdr("FORMAT=32-bit_rle_rgbe", "-Y 2 +X 9", &[line(50), line(60)].concat())
}

/// Six pixels with red 0 to 5, as two lines or three columns.
fn flat(size: &str) -> Vec<u8> {
    let pixels: Vec<u8> = (0..6).flat_map(|red| [red, 20, 30, 136]).collect();
    hdr("FORMAT=32-bit_rle_rgbe", size, &pixels)
}

fn reds(picture: &LinearPicture) -> Vec<f32> {
    picture.pixels.iter().map(|pixel| pixel.x).collect()
}

#[test]
fn lines_by_channel_are_read() {
    let picture = read(by_channel()).unwrap();
    assert_eq!((picture.width, picture.height), (9, 2));
    let greens = [1.0, 2.0, 3.0, 7.0, 7.0, 7.0, 7.0, 8.0, 9.0];
    for (i, pixel) in picture.pixels.iter().enumerate() {
        let (x, y) = (i % 9, i / 9);
        // The last has exponent 0: black.
        let light = if x == 8 { 0.0 } else { 1.0 };
        let expected = Vec3::new([50.0, 60.0][y], greens[x], x as f32);
        assert_eq!(*pixel, light * expected, "{i}");
    }
}

#[test]
fn flat_pixels_are_read_in_all_eight_orientations() {
    let orientations = [
        ("-Y 2 +X 3", 3, [0, 1, 2, 3, 4, 5]),
        ("-Y 2 -X 3", 3, [2, 1, 0, 5, 4, 3]),
        ("+Y 2 +X 3", 3, [3, 4, 5, 0, 1, 2]),
        ("+Y 2 -X 3", 3, [5, 4, 3, 2, 1, 0]),
        ("+X 2 -Y 3", 2, [0, 3, 1, 4, 2, 5]),
        ("-X 2 -Y 3", 2, [3, 0, 4, 1, 5, 2]),
        ("+X 2 +Y 3", 2, [2, 5, 1, 4, 0, 3]),
        ("-X 2 +Y 3", 2, [5, 2, 4, 1, 3, 0]),
    ];
    for (size, width, expected) in orientations {
        let picture = read(flat(size)).unwrap();
        assert_eq!((picture.width, picture.height), (width, 6 / width), "{size}");
        assert_eq!(reds(&picture), expected.map(|red: u8| f32::from(red)), "{size}");
        assert_eq!((picture.pixels[0].y, picture.pixels[0].z), (20.0, 30.0));
    }
}

#[test]
fn repeated_pixels_of_old_files_are_read() {
    // 300 pixels: one and 299 = 1 * 256 + 43 more; then a line of 299 others, the last one twice.
    let repeated = [&[9, 0, 0, 136][..], &[1, 1, 1, 43], &[1, 1, 1, 1]].concat();
    let others: Vec<u8> = (0..299).flat_map(|i| [(i % 200) as u8, 5, 0, 136]).collect();
    let pixels = [repeated, others, vec![1, 1, 1, 1]].concat();
    let picture = read(hdr("#", "-Y 2 +X 300", &pixels)).unwrap();
    assert!(reds(&picture)[..300].iter().all(|red| *red == 9.0));
    let others = &reds(&picture)[300..];
    assert_eq!((others[0], others[198], others[298], others[299]), (0.0, 198.0, 98.0, 98.0));
}

#[test]
fn exposures_are_divided_out_and_exponents_scale() {
    let pixel = [128, 64, 1, 129];
    let header = "# made by hand\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 4.0e0\nCOLORCORR=1 2 4\nVIEW=-vf a";
    let picture = read(hdr(header, "-Y 1 +X 1", &pixel)).unwrap();
    assert_eq!(picture.pixels, [Vec3::new(1.0 / 8.0, 0.5 / 16.0, 1.0 / 128.0 / 32.0)]);
    let brightest = read(hdr("EXPOSURE=1e-30", "-Y 1 +X 1", &[255; 4])).unwrap();
    assert!(brightest.pixels[0].is_finite());

    for (primaries, is_other) in [
        ("0.64 0.33 0.29 0.60 0.15 0.06 0.3333 0.3333", false),
        ("0.64 0.33 0.21 0.71 0.15 0.06 0.3127 0.3290", true),
    ] {
        let listener = Listener::default();
        let file = hdr(&format!("PRIMARIES= {primaries}"), "-Y 1 +X 1", &pixel);
        load_environment_picture_bytes("light.hdr", &file, &listener).unwrap();
        assert_eq!(listener.heard("taken as those of Rec.709"), is_other);
    }
}

#[test]
fn broken_headers_of_hdr_are_refused() {
    let pixel = [1, 2, 3, 136];
    let says = |header: &str, size: &str, words: &str| {
        let message = message(hdr(header, size, &pixel));
        assert!(message.contains(words), "{message}");
    };
    says("FORMAT=32-bit_rle_xyze", "-Y 1 +X 1", "CIE XYZ");
    says("FORMAT=8-bit", "-Y 1 +X 1", "line 2: found `FORMAT=8-bit`, expected `FORMAT=32");
    for exposure in ["EXPOSURE=0", "EXPOSURE=-1", "EXPOSURE=", "EXPOSURE=nan", "EXPOSURE=1 2"] {
        says(exposure, "-Y 1 +X 1", "line 2");
    }
    says("EXPOSURE=1e300\nEXPOSURE=1e300", "-Y 1 +X 1", "line 3: found `EXPOSURE=1e300`");
    says("COLORCORR=1 2", "-Y 1 +X 1", "three numbers");
    for size in ["", "-Y 1", "-Y 1 +X", "-Y 1 -Y 1", "Y 1 X 1", "-Y -1 +X 1", "-Y 1 +X 99999999999"]
    {
        says("#", size, "line 4: found");
    }
    says("#", "-Y 0 +X 4", "a size of 4 x 0 pixels");
    says("#", "-Y 4294967295 +X 4294967295", "a picture of 4294967295 x 4294967295");
    says("#", "-Y 10000 +X 20000", "20000 x 10000 pixels in ");
    assert!(message("#?").contains("line 1: found the end of the file"));
    assert!(message([b"#?", &[b'a'; 5000][..]].concat()).contains("a longer line"));
}

#[test]
fn broken_lines_of_hdr_name_their_place() {
    let cases = [
        (&[2, 2, 0, 8][..], "found in scanline 0 8 pixels, expected 9"),
        (&[2, 2, 0, 9, 0], "a run of no bytes"),
        (&[2, 2, 0, 9, 128 + 10, 5], "a run past its end"),
        (&[2, 2, 0, 9, 128 + 9], "the end of the file"),
        (&[2, 2, 0, 9, 9, 1, 2], "the end of the file"),
        (&[1, 1, 1, 5], "a repetition first"),
        (&[1, 2, 3, 4, 1, 1, 1, 9], "a run past its end"),
        (&[1, 2, 3, 4, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0], "past its end"),
        (&[1, 2, 3], "the end of the file"),
        (&[], "the end of the file"),
    ];
    for (pixels, words) in cases {
        let message = message(hdr("#", "-Y 1 +X 9", pixels));
        assert!(message.contains(words) && message.contains("byte "), "{pixels:?}: {message}");
    }
}

/// R, G and B as half or single floats, and Z, which is not looked at.
fn exr_file(compression: Compression, blocks: Blocks, halves: bool) -> Vec<u8> {
    let (width, height) = (37, 35);
    let channel = |name: &str, scale: f32| {
        let values = (0..width * height).map(|i| scale * (i % 64) as f32);
        let samples = if halves {
            FlatSamples::F16(values.map(f16::from_f32).collect())
        } else {
            FlatSamples::F32(values.collect())
        };
        AnyChannel::new(name, samples)
    };
    let depth = AnyChannel::new("Z", FlatSamples::U32(vec![7; width * height]));
    let channels = [channel("R", 1.0), channel("G", 0.5), channel("B", 100.0), depth];
    let channels = AnyChannels::sort(SmallVec::from_vec(channels.into_iter().collect()));
    let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn exr_files() -> Vec<(Compression, Vec<u8>)> {
    let tiles = Blocks::Tiles((16, 8).into());
    let all = [
        (Compression::Uncompressed, Blocks::ScanLines, false),
        (Compression::RLE, tiles, true),
        (Compression::ZIP1, Blocks::ScanLines, true),
        (Compression::ZIP16, tiles, false),
        (Compression::PIZ, Blocks::ScanLines, true),
        (Compression::PXR24, Blocks::ScanLines, true),
        (Compression::B44, Blocks::ScanLines, true),
        (Compression::DWAA(None), Blocks::ScanLines, true),
    ];
    all.map(|(compression, blocks, halves)| (compression, exr_file(compression, blocks, halves)))
        .into()
}

#[test]
fn exr_of_many_kinds_is_read() {
    for (compression, bytes) in exr_files() {
        let picture = read(&bytes).unwrap();
        assert_eq!((picture.width, picture.height), (37, 35));
        for (i, pixel) in picture.pixels.iter().enumerate() {
            let value = (i % 64) as f32;
            let expected = Vec3::new(value, 0.5 * value, 100.0 * value);
            // Both lose what the eye might not see in a picture less jagged.
            let is_lossy = matches!(compression, Compression::B44 | Compression::DWAA(_));
            let share = if is_lossy { 0.25 } else { 0.0 };
            let error = (*pixel - expected).abs();
            let is_near = error.cmple(share * Vec3::new(63.0, 31.5, 6300.0)).all();
            assert!(is_near, "{compression:?} {i}: {pixel}");
        }
    }
}

#[test]
fn our_own_exr_is_read_from_its_path() {
    let folder = Folder::new("light");
    let path = folder.path("a.exr");
    let mut image = Image::with_layers(5, 3);
    for (i, pixel) in image.color.iter_mut().enumerate() {
        *pixel = [i as f32, 1e6, f32::INFINITY, 1.0];
    }
    save_image(&path, &image, &ImageOptions::default()).unwrap();
    let picture = load_environment_picture(&path, &Silent).unwrap();
    assert_eq!((picture.width, picture.height), (5, 3));
    assert_eq!(picture.pixels[7], Vec3::new(7.0, 1e6, f32::INFINITY));
}

/// One channel or several of one pixel, by name.
fn tiny_exr(names: &[&str], samples: &FlatSamples) -> Vec<u8> {
    let channels = names.iter().map(|name| AnyChannel::new(*name, samples.clone())).collect();
    let channels = AnyChannels::sort(channels);
    let layer = Layer::new((1, 1), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn other_channels_of_exr_are_read_or_named() {
    let value = FlatSamples::F32(vec![2.5]);
    assert_eq!(read(tiny_exr(&["Y"], &value)).unwrap().pixels, [Vec3::splat(2.5)]);
    for names in [&["R", "G"][..], &["Y", "RY", "BY"], &["view.R", "view.G", "view.B"]] {
        let message = message(tiny_exr(names, &value));
        assert!(message.contains("channels ") && message.contains(names[0]), "{message}");
    }
    let whole = tiny_exr(&["R", "G", "B"], &FlatSamples::U32(vec![1]));
    assert!(message(whole).contains("whole numbers"));
}

#[test]
fn exr_that_claims_too_much_is_refused_at_once() {
    let bytes = exr_file(Compression::ZIP16, Blocks::ScanLines, true);
    let at = bytes.windows(11).position(|window| window == b"dataWindow\0").unwrap();
    // Name, type `box2i`, length; then the four sides.
    let sides = at + 11 + 6 + 4;
    let changed = |right: i32, bottom: i32| {
        let mut bytes = bytes.clone();
        bytes[sides + 8..][..4].copy_from_slice(&right.to_le_bytes());
        bytes[sides + 12..][..4].copy_from_slice(&bottom.to_le_bytes());
        message(bytes)
    };
    for (right, bottom) in [(36, 1 << 24), (1 << 24, 34), (1 << 20, 1 << 20), (-(1 << 28), 34)] {
        changed(right, bottom);
    }
    assert!(changed(i32::MAX, i32::MAX).contains("byte "));
    // Blocks of a row of tiles that nobody could hold.
    let tiled = exr_file(Compression::ZIP16, Blocks::Tiles((16, 8).into()), true);
    let at = tiled.windows(6).position(|window| window == b"tiles\0").unwrap() + 6 + 9 + 4;
    for size in [0, 1 << 20, u32::MAX] {
        let mut bytes = tiled.clone();
        bytes[at..][..4].copy_from_slice(&size.to_le_bytes());
        bytes[at + 4..][..4].copy_from_slice(&size.to_le_bytes());
        message(bytes);
    }
}

/// A fuzzer found that the decoder takes the memory that the counters of a block ask for.
#[test]
fn blocks_of_dwa_that_claim_too_much_are_refused() {
    let bytes = exr_file(Compression::DWAA(None), Blocks::ScanLines, true);
    let u64_at =
        |at: usize| bytes.get(at..at + 8).map(|b| u64::from_le_bytes(b.try_into().unwrap()));
    // The table of places ends the header: the first leads to line 0 and, 8 bytes on, to version 2.
    let chunk = (300..bytes.len()).find_map(|at| {
        let chunk = usize::try_from(u64_at(at)?).ok().filter(|chunk| *chunk == at + 16)?;
        (u64_at(chunk + 8) == Some(2)).then_some(chunk)
    });
    for counter in [1, 6, 7, 8, 9] {
        let mut bytes = bytes.clone();
        let at = chunk.unwrap() + 8 + 8 * counter;
        bytes[at..][..8].copy_from_slice(&(1u64 << 40).to_le_bytes());
        assert!(message(bytes).contains("unpacks to 1099511627776"));
    }
}

fn small_files() -> Vec<Vec<u8>> {
    let exr = exr_files().into_iter().map(|(_, bytes)| bytes);
    exr.chain([by_channel(), flat("-Y 2 +X 3")]).collect()
}

#[test]
fn pictures_cut_off_anywhere_are_refused() {
    for bytes in small_files() {
        // Each length of the header, and some of the rest.
        for length in (0..bytes.len()).filter(|length| *length < 400 || length % 37 == 0) {
            let message = message(&bytes[..length]);
            let has_place = message.contains("byte ") || message.contains("line ");
            assert!(has_place || message.contains("unknown content"), "{length}: {message}");
        }
    }
}

#[test]
fn pictures_with_any_byte_changed_do_not_panic() {
    for mut bytes in small_files() {
        for at in (0..bytes.len()).filter(|at| *at < 400 || at % 11 == 0) {
            for value in [0, 1, 0x7f, 0xff, bytes[at] ^ 0x10] {
                let old = std::mem::replace(&mut bytes[at], value);
                if let Ok(picture) = read(&bytes) {
                    let n_pixels = picture.width as usize * picture.height as usize;
                    assert_eq!(picture.pixels.len(), n_pixels, "{at} {value}");
                }
                bytes[at] = old;
            }
        }
    }
}

#[test]
fn other_pictures_and_absent_ones_are_named() {
    assert!(message("").contains("an empty file"));
    assert!(message(b"\x89PNG\r\n\x1a\n").contains("a PNG picture"));
    assert!(message(b"\xff\xd8\xff\xe0").contains("a JPEG picture"));
    assert!(message("P6 1 1").contains("expected `#?RADIANCE`"));
    let other = |name: &str, bytes: &[u8]| {
        load_environment_picture_bytes(name, bytes, &Silent).unwrap_err().to_string()
    };
    assert!(other("a.exr", b"v/1").contains("the extension does not fit"));
    assert!(other("a.tga", b"\0\0").contains("unknown content"));
    let folder = Folder::new("no-light");
    let error = load_environment_picture(&folder.path("a.hdr"), &Silent).unwrap_err().to_string();
    assert!(error.contains("check the name and the folder"), "{error}");
}

#[test]
fn reading_light_stops_when_it_is_cancelled() {
    let listener = Listener::default();
    listener.cancelled.store(true, std::sync::atomic::Ordering::Relaxed);
    for bytes in small_files() {
        let cancelled = load_environment_picture_bytes("light.hdr", &bytes, &listener);
        assert!(matches!(cancelled, Err(Error::Surfel(surfel::Error::Cancelled))));
    }
}
