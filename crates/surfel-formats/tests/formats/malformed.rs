//! Malformed point files: an error with a location, without a panic or excessive memory.

use surfel_core::points::{PointCloud, STATION};
use surfel_core::progress::NoProgress;
use surfel_formats::{
    ColumnChoice, Error, ImageOptions, LoadOptions, MovieOptions, check_cloud_output, check_movie,
    check_output_path, load, load_bytes,
};

use crate::common::{Folder, Listener, encode_cloud, full_cloud, read};
use crate::{e57_writer, esri_grid, pcd, ptx};

fn message(name: &str, bytes: impl AsRef<[u8]>) -> String {
    read(name, bytes).unwrap_err().to_string()
}

/// Returns small files of every format, each with several points.
pub fn small_files() -> Vec<(&'static str, Vec<u8>)> {
    let cloud = full_cloud(5);
    let lists = "ply\nformat binary_big_endian 1.0\nelement face 1\nproperty list uchar int i\n\
        element vertex 2\nproperty float x\nproperty float y\nproperty list uchar char l\n\
        property float z\nend_header\n";
    let ascii = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
        property float z\nproperty list uchar char l\nend_header\n0 1 2 1 5\n3 4 5 0\n";
    vec![
        ("a.ply", encode_cloud(&cloud, "ply")),
        ("lists.ply", [lists.as_bytes(), &[1, 0, 0, 0, 9], &[0; 26]].concat()),
        ("ascii.ply", ascii.into()),
        ("a.las", encode_cloud(&cloud, "las")),
        ("a.laz", encode_cloud(&cloud, "laz")),
        ("a.csv", "x,y,z,r,g,b,time\n1,2,3,4,5,6,7.5\n-1,2e3,nan,4,5,6,\n".into()),
        ("a.pts", "2\n1 2 3 -4 5 6 7\n1 2 3 -4 5 6 7\n".into()),
        ("ascii.pcd", pcd::ascii_file().into()),
        ("binary.pcd", pcd::binary_file()),
        ("compressed.pcd", pcd::compressed_file()),
        ("a.ptx", ptx::two_scans().into()),
        ("a.e57", e57_writer::small_file()),
        ("a.obj", "o cube\nv 1 2 3\nv 1 2 3\nf 1 2 1\n".into()),
        ("a.bin", [1.0f32; 7 * 3].map(f32::to_le_bytes).concat()),
        ("a.off", "CNOFF\n2 0 0\n1 2 3 0 0 1 255 0 0 255\n4 5 6 0 0 1 0 255 0 255\n".into()),
        ("a.asc", format!("{}NODATA_value -1\n5 6 7\n8 -1 9.5\n", esri_grid::HEADER).into()),
    ]
}

#[test]
fn truncated_files_do_not_panic() {
    for (name, bytes) in small_files() {
        let whole = read(name, &bytes).unwrap().cloud.len();
        for length in 0..bytes.len() {
            // Truncated text may still be valid, but has at most as many points.
            if let Ok(loaded) = read(name, &bytes[..length]) {
                assert!(loaded.cloud.len() <= whole, "{name} {length}");
                assert!(!name.ends_with(".las") || loaded.cloud.len() == whole, "{name} {length}");
            }
        }
    }
}

#[test]
fn positions_can_be_loaded_alone() {
    let bare = LoadOptions { columns: ColumnChoice::Only(vec![]), ..LoadOptions::default() };
    for (name, bytes) in small_files() {
        let cloud = load_bytes(name, &bytes, &bare, &NoProgress).unwrap().cloud;
        let whole = read(name, &bytes).unwrap().cloud;
        assert_eq!(cloud.len(), whole.len(), "{name}");
        let has_scalars = cloud.scalars.iter().any(|scalar| scalar.name != STATION);
        assert!(cloud.normals.is_none() && !has_scalars, "{name}");
    }
}

#[test]
fn files_with_any_changed_byte_do_not_panic() {
    for (name, mut bytes) in small_files() {
        for at in 0..bytes.len() {
            for value in [0, 1, 0x7f, 0x80, 0xff, bytes[at] ^ 0x10] {
                let old = std::mem::replace(&mut bytes[at], value);
                if let Ok(loaded) = read(name, &bytes) {
                    assert!(loaded.cloud.len() <= bytes.len() * 100, "{name} {at} {value}");
                }
                bytes[at] = old;
            }
        }
    }
}

#[test]
fn empty_misnamed_and_missing_files_are_rejected() {
    assert!(message("a.ply", "").contains("found an empty file"));
    assert!(message("a.ply", "plx\n").contains("found `plx\\n`, expected `ply`"));
    assert!(message("a.laz", "PK").contains("the extension does not fit"));
    assert!(message("a.what", "some words").contains("the extension `.what`"));
    assert!(message("what", "some words").contains("without extension"));
    let folder = Folder::new("absent");
    let failed = |name: &str| {
        load(&folder.path(name), &LoadOptions::default(), &NoProgress).unwrap_err().to_string()
    };
    assert!(failed("a.ply").contains("check the name and the folder"));
    assert!(failed("").contains("found a folder"));
    std::fs::write(folder.path("empty.las"), "").unwrap();
    assert!(failed("empty.las").contains("an empty file"));
}

#[test]
fn unsupported_formats_are_named() {
    let files: [(&str, &[u8], &str); 3] = [
        ("a.bin", b"CCB2\x00\x00\x00\x00", "a BIN file of CloudCompare"),
        ("a.h5", b"\x89HDF", "an HDF5 file"),
        ("a.xyz.gz", b"\x1f\x8b", "a gzip archive"),
    ];
    for (name, bytes, words) in files {
        let message = message(name, bytes);
        assert!(message.contains(words) && message.contains(".laz"), "{message}");
    }
}

#[test]
fn errors_contain_the_system_message_once() {
    let folder = Folder::new("once");
    let error = load(&folder.path("a.ply"), &LoadOptions::default(), &NoProgress).unwrap_err();
    assert!(std::error::Error::source(&error).is_none());
    assert_eq!(error.to_string().matches("os error").count(), 1, "{error}");

    let out = folder.path("none/out.ply");
    let error = check_cloud_output(&out).unwrap_err().to_string();
    let missing = folder.path("none").display().to_string();
    assert!(error.contains(&format!("no folder `{missing}`; create it first")), "{error}");
}

#[test]
fn invalid_ply_headers_are_rejected() {
    let file = |lines: &str| format!("ply\nformat binary_little_endian 1.0\n{lines}\nend_header\n");
    let xyz = "property float x\nproperty float y\nproperty float z";
    let billions = file(&format!("element vertex 4000000000\n{xyz}")) + "0123456789ab";
    assert!(matches!(
        read("a.ply", &billions),
        Err(Error::Truncated { readable: 1, claimed: 4_000_000_000, .. })
    ));
    let skipped = format!("element a 9999999999999\nproperty double b\nelement vertex 1\n{xyz}");
    assert!(message("a.ply", file(&skipped)).contains("elements `a`"));
    let listed =
        format!("element a 9999999999999\nproperty list int int b\nelement vertex 1\n{xyz}");
    assert!(message("a.ply", file(&listed)).contains("elements `a`"));
    let without = file("element vertex 1\nproperty float x\nproperty float y");
    assert!(message("a.ply", without).contains("expected vertex properties x, y and z"));
    assert!(message("a.ply", file("element face 1")).contains("expected an element `vertex`"));
    let bad = [
        "element vertex many",
        "property float x",
        "element vertex 1\nproperty quad x",
        "element vertex 1\nproperty list float int x",
        "element vertex 1\nproperty list uchar x",
        "format binary_middle_endian 1.0",
        "rubbish",
    ];
    for lines in bad {
        let message = message("a.ply", file(lines));
        assert!(message.contains("line ") && message.contains("the header is broken"), "{message}");
    }
    assert!(message("a.ply", "ply\nend_header\n").contains("a `format` line"));
    let ascii =
        format!("ply\nformat ascii 1.0\nelement vertex 3000000000\n{xyz}\nend_header\n1 2 3\n");
    assert!(matches!(read("a.ply", ascii), Err(Error::Truncated { readable: 1, .. })));
    let fields =
        format!("ply\nformat ascii 1.0\nelement vertex 2\n{xyz}\nend_header\n1 2 3\n1 x 3\n");
    assert!(message("a.ply", fields).contains("line 9: found `x`"));
}

#[test]
fn overlong_lines_are_rejected() {
    let wide = "1 ".repeat(500_000);
    let long = "1 ".repeat(600_000);
    assert!(message("a.xyz", &wide).contains("line 1: found more than 1000 fields"));
    assert!(message("a.xyz", &long).contains("line 1: found a longer line"));
    assert!(message("a.xyz", format!("1 2 3\n{wide}\n")).contains("found 500000 fields"));
    assert!(message("a.xyz", format!("1 2 3\n{long}\n")).contains("a line of 1199999 bytes"));
    assert!(message("a.xyz", format!("x y z {wide}\n1 2 3\n")).contains("1000 fields"));
    let remark = format!("# {wide}\n1 2 3\n");
    assert_eq!(read("a.xyz", remark).unwrap().cloud.len(), 1);
    let thousand = "-7 ".repeat(1000) + "\n";
    assert_eq!(read("a.xyz", thousand).unwrap().cloud.scalars.len(), 997);
    assert!(message("a.obj", format!("v 1 2 3\nv {long}\n")).contains("bytes"));

    let properties = "property float a\n".repeat(1001);
    let ply = format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n");
    assert!(message("a.ply", ply).contains("at most 1000 properties"));
    assert!(message("a.ply", format!("ply\ncomment {long}\n")).contains("at most 1048576 bytes"));
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_rejected_without_blocking() {
    let folder = Folder::new("pipe");
    let pipe = folder.path("pipe.ply");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for path in [pipe.as_path(), std::path::Path::new("/dev/null")] {
        let error = load(path, &LoadOptions::default(), &NoProgress).unwrap_err().to_string();
        assert!(error.contains("not a regular file"), "{error}");
        assert!(error.contains("write it to a file first"), "{error}");
    }
    let options = MovieOptions {
        width: 8,
        height: 8,
        fps: 25.0,
        n_frames: 1,
        image: ImageOptions::default(),
        fingerprint: String::new(),
    };
    let movie = folder.path("movie.gif");
    std::fs::rename(&pipe, &movie).unwrap();
    for refused in [
        check_output_path(&movie),
        check_output_path(std::path::Path::new("/dev/null")),
        check_movie(&movie, &options),
    ] {
        let error = refused.unwrap_err().to_string();
        assert!(error.contains("not a regular file") && error.contains("name a file"), "{error}");
    }
    assert_eq!(folder.names(), ["movie.gif"]);
}

/// Returns the file with some bytes replaced.
fn with(mut bytes: Vec<u8>, at: usize, new: &[u8]) -> Vec<u8> {
    bytes[at..at + new.len()].copy_from_slice(new);
    bytes
}

#[test]
fn invalid_las_headers_are_rejected() {
    let las = || encode_cloud(&full_cloud(5), "las");
    let laz = || encode_cloud(&full_cloud(5), "laz");
    let billions = 4_000_000_000_u64.to_le_bytes();
    let truncated = read("a.las", with(las(), 247, &billions));
    assert!(matches!(truncated, Err(Error::Truncated { readable: 5, .. })));
    assert!(message("a.laz", with(laz(), 247, &billions)).contains("4000000000"));
    // More points than the bytes can hold, in a single chunk.
    let n_points = 40_000_u64.to_le_bytes();
    assert!(read("a.laz", with(laz(), 247, &n_points)).is_err());
    for file in [las(), laz()] {
        let changed = |at, new: &[u8]| message("a.las", with(file.clone(), at, new));
        assert!(changed(96, &u32::MAX.to_le_bytes()).contains("points at byte 4294967295"));
        assert!(changed(105, &[0, 0]).contains("records of 0 bytes"));
        assert!(changed(104, &[11]).contains("point format 11"));
        assert!(changed(24, &[2, 0]).contains("LAS version 2.0"));
        assert!(changed(131, &0.0_f64.to_le_bytes()).contains("scales other than 0"));
        assert!(changed(155, &f64::NAN.to_le_bytes()).contains("finite"));
        let huge = [1e300_f64.to_le_bytes(), 0.0_f64.to_le_bytes()].concat();
        assert!(changed(131, &huge).contains("scale [1e300, 0,"));
        assert!(changed(100, &u32::MAX.to_le_bytes()).contains("variable length record"));
        // Length of the first variable length record.
        assert!(changed(395, &[0xff, 0xff]).contains("variable length record"));
    }
}

#[test]
fn clouds_of_zero_and_one_points_are_read() {
    for n in [0, 1] {
        for extension in ["ply", "las", "laz"] {
            let cloud = PointCloud { origin: Default::default(), ..full_cloud(n) };
            let name = format!("a.{extension}");
            assert_eq!(read(&name, encode_cloud(&cloud, extension)).unwrap().cloud.len(), n);
        }
    }
}

#[test]
fn cancellation_stops_reading() {
    let listener = Listener::default();
    listener.cancelled.store(true, std::sync::atomic::Ordering::Relaxed);
    for (name, bytes) in small_files() {
        let cancelled = load_bytes(name, &bytes, &LoadOptions::default(), &listener);
        assert!(matches!(cancelled, Err(Error::Core(surfel_core::Error::Cancelled))), "{name}");
    }
}

/// Inputs that once caused a crash or hang; their names state the cause.
#[test]
fn fuzz_regressions_stay_harmless() {
    let regressions =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz_regressions");
    for entry in std::fs::read_dir(regressions).unwrap() {
        let path = entry.unwrap().path();
        if let Ok(loaded) = load(&path, &LoadOptions::default(), &NoProgress) {
            let n_bytes = std::fs::metadata(&path).unwrap().len() as usize;
            assert!(loaded.cloud.len() <= 100 * n_bytes, "{}", path.display());
        }
    }
}
