//! Environment maps: every encoding of Radiance HDR and OpenEXR, and malformed files.

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as ExrImage, Layer,
    LayerAttributes, LineOrder, SmallVec, WritableImage, f16,
};
use surfel_core::image::Image;
use surfel_core::math::Vec3;
use surfel_core::progress::NoProgress;
use surfel_formats::{
    Error, HdrImage, ImageOptions, load_environment_map, load_environment_map_bytes, save_image,
};

use crate::common::{Folder, Listener};

fn read(bytes: impl AsRef<[u8]>) -> Result<HdrImage, Error> {
    load_environment_map_bytes("light.hdr", bytes.as_ref(), &NoProgress)
}

fn message(bytes: impl AsRef<[u8]>) -> String {
    let message = read(bytes).unwrap_err().to_string();
    assert!(message.starts_with("light.hdr: "), "{message}");
    message
}

fn hdr(header: &str, size: &str, pixels: &[u8]) -> Vec<u8> {
    [format!("#?RADIANCE\n{header}\n\n{size}\n").as_bytes(), pixels].concat()
}

/// Returns a file of 9 x 2 pixels in the new encoding: each channel as runs and literals.
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

/// Returns a file of six unencoded pixels with red 0 to 5.
fn flat(size: &str) -> Vec<u8> {
    let pixels: Vec<u8> = (0..6).flat_map(|red| [red, 20, 30, 136]).collect();
    hdr("FORMAT=32-bit_rle_rgbe", size, &pixels)
}

fn reds(picture: &HdrImage) -> Vec<f32> {
    picture.pixels.iter().map(|pixel| pixel.x).collect()
}

#[test]
fn channel_runs_are_decoded() {
    let picture = read(by_channel()).unwrap();
    assert_eq!((picture.width, picture.height), (9, 2));
    let greens = [1.0, 2.0, 3.0, 7.0, 7.0, 7.0, 7.0, 8.0, 9.0];
    for (i, pixel) in picture.pixels.iter().enumerate() {
        let (x, y) = (i % 9, i / 9);
        // The last pixel has exponent 0, which means black.
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
fn old_style_pixel_repetitions_are_decoded() {
    // A line of one pixel and 299 = 1 * 256 + 43 repetitions, then a line of 299 pixels with the last one repeated.
    let repeated = [&[9, 0, 0, 136][..], &[1, 1, 1, 43], &[1, 1, 1, 1]].concat();
    let others: Vec<u8> = (0..299).flat_map(|i| [(i % 200) as u8, 5, 0, 136]).collect();
    let pixels = [repeated, others, vec![1, 1, 1, 1]].concat();
    let picture = read(hdr("#", "-Y 2 +X 300", &pixels)).unwrap();
    assert!(reds(&picture)[..300].iter().all(|red| *red == 9.0));
    let others = &reds(&picture)[300..];
    assert_eq!((others[0], others[198], others[298], others[299]), (0.0, 198.0, 98.0, 98.0));
}

#[test]
fn exposures_are_divided_out() {
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
        load_environment_map_bytes("light.hdr", &file, &listener).unwrap();
        assert_eq!(listener.has_note("taken as those of Rec.709"), is_other);
    }
}

#[test]
fn invalid_hdr_headers_are_rejected() {
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
    says("#", "-Y 4294967295 +X 4294967295", "an image of 4294967295 x 4294967295");
    says("#", "-Y 10000 +X 20000", "20000 x 10000 pixels in ");
    assert!(message("#?").contains("line 1: found the end of the file"));
    assert!(message([b"#?", &[b'a'; 5000][..]].concat()).contains("a longer line"));
}

#[test]
fn invalid_hdr_scanlines_are_errors_with_a_byte_offset() {
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

/// Returns a file with R, G and B as half or single floats, and Z, which the reader ignores.
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
fn exr_compressions_and_block_types_are_decoded() {
    for (compression, bytes) in exr_files() {
        let picture = read(&bytes).unwrap();
        assert_eq!((picture.width, picture.height), (37, 35));
        for (i, pixel) in picture.pixels.iter().enumerate() {
            let value = (i % 64) as f32;
            let expected = Vec3::new(value, 0.5 * value, 100.0 * value);
            // Both compressions are lossy, and this image has hard edges.
            let is_lossy = matches!(compression, Compression::B44 | Compression::DWAA(_));
            let allowed = if is_lossy { 0.25 } else { 0.0 };
            let error = (*pixel - expected).abs();
            let is_near = error.cmple(allowed * Vec3::new(63.0, 31.5, 6300.0)).all();
            assert!(is_near, "{compression:?} {i}: {pixel}");
        }
    }
}

#[test]
fn written_exr_files_are_read_back() {
    let folder = Folder::new("light");
    let path = folder.path("a.exr");
    let mut image = Image::with_aovs(5, 3);
    for (i, pixel) in image.color.iter_mut().enumerate() {
        *pixel = [i as f32, 1e6, f32::INFINITY, 1.0];
    }
    save_image(&path, &image, &ImageOptions::default()).unwrap();
    let picture = load_environment_map(&path, &NoProgress).unwrap();
    assert_eq!((picture.width, picture.height), (5, 3));
    assert_eq!(picture.pixels[7], Vec3::new(7.0, 1e6, f32::INFINITY));
}

/// Returns an image of one pixel with these channels.
fn tiny_exr(names: &[&str], samples: &FlatSamples) -> Vec<u8> {
    let channels = names.iter().map(|name| AnyChannel::new(*name, samples.clone())).collect();
    let channels = AnyChannels::sort(channels);
    let layer = Layer::new((1, 1), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn luminance_exr_is_read_and_other_channels_are_rejected() {
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
fn exr_with_excessive_sizes_is_rejected() {
    let bytes = exr_file(Compression::ZIP16, Blocks::ScanLines, true);
    let at = bytes.windows(11).position(|window| window == b"dataWindow\0").unwrap();
    // The name is followed by the type `box2i`, the length and the four sides.
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
    // Tiles that would not fit in memory.
    let tiled = exr_file(Compression::ZIP16, Blocks::Tiles((16, 8).into()), true);
    let at = tiled.windows(6).position(|window| window == b"tiles\0").unwrap() + 6 + 9 + 4;
    for size in [0, 1 << 20, u32::MAX] {
        let mut bytes = tiled.clone();
        bytes[at..][..4].copy_from_slice(&size.to_le_bytes());
        bytes[at + 4..][..4].copy_from_slice(&size.to_le_bytes());
        message(bytes);
    }
}

/// The decoder allocates what the counters of a block claim (found by fuzzing).
#[test]
fn dwa_blocks_with_excessive_sizes_are_rejected() {
    let bytes = exr_file(Compression::DWAA(None), Blocks::ScanLines, true);
    let u64_at =
        |at: usize| bytes.get(at..at + 8).map(|b| u64::from_le_bytes(b.try_into().unwrap()));
    // The offset table follows the header; its first entry points to a block with line 0 and, 8 bytes later, version 2.
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
fn truncated_files_are_rejected() {
    for bytes in small_files() {
        // Every length within the header, and some beyond.
        for length in (0..bytes.len()).filter(|length| *length < 400 || length % 37 == 0) {
            let message = message(&bytes[..length]);
            let has_place = message.contains("byte ") || message.contains("line ");
            assert!(has_place || message.contains("unknown content"), "{length}: {message}");
        }
    }
}

#[test]
fn files_with_any_changed_byte_do_not_panic() {
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
fn other_formats_and_missing_files_are_rejected() {
    assert!(message("").contains("an empty file"));
    assert!(message(b"\x89PNG\r\n\x1a\n").contains("a PNG image"));
    assert!(message(b"\xff\xd8\xff\xe0").contains("a JPEG image"));
    assert!(message("P6 1 1").contains("expected `#?RADIANCE`"));
    let other = |name: &str, bytes: &[u8]| {
        load_environment_map_bytes(name, bytes, &NoProgress).unwrap_err().to_string()
    };
    assert!(other("a.exr", b"v/1").contains("the extension does not fit"));
    assert!(other("a.tga", b"\0\0").contains("unknown content"));
    let folder = Folder::new("no-light");
    let error = load_environment_map(&folder.path("a.hdr"), &NoProgress).unwrap_err().to_string();
    assert!(error.contains("check the name and the folder"), "{error}");
}

#[test]
fn cancellation_stops_reading() {
    let listener = Listener::default();
    listener.cancelled.store(true, std::sync::atomic::Ordering::Relaxed);
    for bytes in small_files() {
        let cancelled = load_environment_map_bytes("light.hdr", &bytes, &listener);
        assert!(matches!(cancelled, Err(Error::Core(surfel_core::Error::Cancelled))));
    }
}
