//! Damaged files: what is whole of them is read if that is asked for, and a note says how much that is.

use las::point::Format;
use surfel_core::math::Vec3;
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::scene::Geometry;
use surfel_formats::{Error, LoadOptions, Loaded, load_bytes, load_graph_bytes};

use crate::common::{Listener, encode_cloud, full_cloud, read, shared};
use crate::las_point_formats::{N_POINTS, file};
use crate::malformed::small_files;
use crate::{pcd, ptx};

const ADVICE: &str = "; what is whole can be read [salvage]";

pub fn options() -> LoadOptions {
    LoadOptions { salvage: true, ..LoadOptions::default() }
}

pub fn salvage(name: &str, bytes: &[u8]) -> Result<Loaded, Error> {
    load_bytes(name, bytes, &options(), &NoProgress)
}

/// Returns the cloud of a damaged file; checks that a note begins with `words`, and that the file is refused otherwise.
pub fn salvaged(name: &str, bytes: &[u8], words: &str) -> PointCloud {
    let refused = read(name, bytes).unwrap_err().to_string();
    assert!(refused.ends_with(ADVICE), "{name}: {refused}");
    let listener = Listener::default();
    let loaded = load_bytes(name, bytes, &options(), &listener).unwrap();
    let words = format!("{name}: salvaged {words}");
    assert!(listener.has_note(&words), "{words}: {:?}", listener.notes.lock());
    loaded.cloud
}

/// Checks that a cloud has the first points of another, about an origin of its own.
fn assert_is_prefix(name: &str, part: &PointCloud, whole: &PointCloud) {
    assert!(part.len() <= whole.len(), "{name}");
    let intensity = |cloud: &PointCloud, i: usize| cloud.intensity.as_ref().map(|column| column[i]);
    for i in 0..part.len() {
        let (a, b) = (part.world_position(i), whole.world_position(i));
        let is_same = (0..3)
            .all(|axis| (a[axis] - b[axis]).abs() < 1e-3 || a[axis].is_nan() && b[axis].is_nan());
        assert!(is_same, "{name}: point {i} is at {a}, not {b}");
        assert_eq!(intensity(part, i), intensity(whole, i), "{name}: point {i}");
    }
}

#[test]
fn whole_files_are_read_without_a_note() {
    for (name, bytes) in small_files() {
        let listener = Listener::default();
        let loaded = load_bytes(name, &bytes, &options(), &listener).unwrap();
        let whole = read(name, &bytes).unwrap().cloud;
        assert_eq!(loaded.cloud.len(), whole.len(), "{name}");
        assert_is_prefix(name, &loaded.cloud, &whole);
        assert!(!listener.has_note("salvaged"), "{name}");
    }
}

#[test]
fn files_cut_anywhere_give_their_first_points() {
    for (name, bytes) in small_files() {
        let whole = read(name, &bytes).unwrap().cloud;
        let mut is_salvaged = false;
        for length in 0..bytes.len() {
            let part = &bytes[..length];
            let Ok(loaded) = salvage(name, part) else {
                // A longer file is refused only for a number of which there is the sign alone; BIN has no header to tell
                // a cut record from another format.
                let may_fail = !is_salvaged || part.ends_with(b"-") || name == "a.bin";
                assert!(may_fail, "{name}: {length} bytes are refused, and fewer are not");
                continue;
            };
            is_salvaged = true;
            // Text may end within a number.
            if ["a.csv", "a.pts", "a.obj", "a.off", "a.asc"].contains(&name) {
                assert!(loaded.cloud.len() <= whole.len(), "{name} {length}");
            } else {
                assert_is_prefix(name, &loaded.cloud, &whole);
            }
        }
        assert!(is_salvaged, "{name}");
    }
}

#[test]
fn damaged_files_do_not_panic() {
    for (name, mut bytes) in small_files() {
        for at in 0..bytes.len() {
            for value in [0, 0x7f, 0xff] {
                let old = std::mem::replace(&mut bytes[at], value);
                if let Ok(loaded) = salvage(name, &bytes) {
                    assert!(loaded.cloud.len() <= bytes.len() * 100, "{name} {at} {value}");
                }
                bytes[at] = old;
            }
        }
    }
}

#[test]
fn records_before_the_end_of_the_file_are_read() {
    let cloud = full_cloud(9);
    for name in ["a.las", "a.ply"] {
        let bytes = encode_cloud(&cloud, &name[2..]);
        let whole = read(name, &bytes).unwrap().cloud;
        let record = bytes.len() - encode_cloud(&full_cloud(8), &name[2..]).len();
        let cut = &bytes[..bytes.len() - 2 * record - record / 2];
        let words = format!("6 of 9 points; the file ends at byte {}", cut.len());
        assert_is_prefix(name, &salvaged(name, cut, &words), &whole);
    }
    let cut = &pcd::binary_file()[..pcd::binary_file().len() - 1];
    assert_eq!(salvaged("a.pcd", cut, "1 of 2 points").len(), 1);
}

#[test]
fn fields_before_the_end_of_a_compressed_file_are_read() {
    let n_points = 500;
    let bytes = pcd::compressed_grid(n_points);
    let whole = read("a.pcd", &bytes).unwrap().cloud;
    assert!(whole.len() == n_points && whole.colors.is_some());
    let mut found = Vec::new();
    for length in 0..bytes.len() {
        let listener = Listener::default();
        let loaded = load_bytes("a.pcd", &bytes[..length], &options(), &listener);
        let Ok(Loaded { cloud, .. }) = loaded else {
            let refused = loaded.unwrap_err().to_string();
            assert!(!refused.contains("[salvage]"), "{refused}");
            assert!(found.is_empty(), "{length} of {} {refused}", bytes.len());
            continue;
        };
        let n_read = cloud.len();
        let kept: Vec<u32> = (0..n_read as u32).collect();
        assert!(cloud.positions == whole.subset(&kept).positions, "{length}");
        let words = format!("a.pcd: salvaged {n_read} of {n_points} points; found the end");
        assert!(listener.has_note(&words), "{words}");
        assert_eq!(cloud.intensity.is_none(), listener.has_note("a.pcd: values of intensity"));
        assert!(cloud.intensity.as_ref().is_none_or(|it| Some(it) == whole.intensity.as_ref()));
        assert!(cloud.colors.is_none(), "the last field is never whole");
        found.push((n_read, cloud.intensity.is_some()));
    }
    assert!(found.is_sorted());
    // Runs of eight numbers are whole or lost.
    for state in [(8, false), (n_points, false), (n_points, true)] {
        assert!(found.contains(&state), "{state:?}");
    }
    let refused = read("a.pcd", &bytes[..bytes.len() - 9]).unwrap_err().to_string();
    assert!(
        refused.contains("the end of the file after all positions, but within the other values"),
        "{refused}"
    );
    assert!(refused.ends_with("; what is whole can be read [salvage]"), "{refused}");
}

#[test]
fn a_cut_picture_of_a_depth_camera_keeps_its_points() {
    let Some(path) = shared("clouds/region_growing_rgb_tutorial.pcd") else { return };
    let bytes = std::fs::read(path).unwrap();
    let whole = read("a.pcd", &bytes).unwrap().cloud;
    // Colours begin in the middle of the file.
    let cloud = salvaged("a.pcd", &bytes[..1_300_000], "307200 of 307200 points; found the end");
    let bits = |cloud: &PointCloud| -> Vec<[u32; 3]> {
        cloud.positions.iter().map(|position| position.to_array().map(f32::to_bits)).collect()
    };
    assert!(bits(&cloud) == bits(&whole) && cloud.colors.is_none());
    let early = salvaged("a.pcd", &bytes[..1_100_000], "");
    assert!(100_000 < early.len() && early.len() < whole.len(), "{}", early.len());
    assert!(bits(&early) == bits(&whole)[..early.len()]);
    assert!(salvage("a.pcd", &bytes[..900_000]).is_err());
}

/// Returns the byte at which the points of a LAZ file begin, and that of its chunk table.
fn points_and_table(bytes: &[u8]) -> (usize, usize) {
    let number = |at: usize, n: usize| {
        bytes[at..at + n].iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte))
    };
    let start = number(96, 4);
    (start, number(start, 8))
}

#[test]
fn chunks_are_found_without_their_table() {
    for (number, minor_version) in [(1, 2), (3, 2), (6, 4), (7, 4)] {
        let format = Format { is_compressed: true, ..Format::new(number).unwrap() };
        let bytes = file(minor_version, format);
        let whole = read("a.laz", &bytes).unwrap().cloud;
        let (start, table) = points_and_table(&bytes);
        let words = format!("{N_POINTS} of {N_POINTS} points; found offset");
        let cloud = salvaged("a.laz", &bytes[..table], &words);
        assert!(cloud == whole, "{number}");
        let mut unfinished = bytes.clone();
        unfinished[start..start + 8].fill(0);
        assert!(salvage("a.laz", &unfinished).unwrap().cloud == whole, "{number}");
        // The last bytes of the second chunk are missing.
        let listener = Listener::default();
        let cut = load_bytes("a.laz", &bytes[..table - 20], &options(), &listener).unwrap().cloud;
        assert!(listener.has_note("of 50300 points; the file ends inside chunk 1"));
        assert_is_prefix("a.laz", &cut, &whole);
        if number < 6 {
            assert!(50_200 < cut.len() && cut.len() < N_POINTS, "{number}: {}", cut.len());
            let half = salvage("a.laz", &bytes[..start + (table - start) / 2]).unwrap().cloud;
            assert!(20_000 < half.len() && half.len() < 30_000, "{number}: {}", half.len());
            assert_is_prefix("a.laz", &half, &whole);
        } else {
            // A layered chunk is read whole or not at all.
            assert_eq!(cut.len(), 50_000, "{number}");
            let half = salvage("a.laz", &bytes[..start + (table - start) / 2]);
            assert!(half.unwrap_err().to_string().contains("0 of 50300 points are complete"));
        }
    }
}

#[test]
fn whole_chunks_after_a_damaged_one_are_read() {
    let format = Format { is_compressed: true, ..Format::new(7).unwrap() };
    let mut bytes = file(4, format);
    let whole = read("a.laz", &bytes).unwrap().cloud;
    let (start, _) = points_and_table(&bytes);
    // The sizes of the layers stand after the offset, the first record and the number of points.
    bytes[start + 8 + 36 + 4..][..8].fill(0xff);
    let cloud = salvaged("a.laz", &bytes, &format!("300 of {N_POINTS} points; found"));
    let last: Vec<u32> = (50_000..N_POINTS as u32).collect();
    assert_eq!(cloud.positions.len(), 300);
    let expected = whole.subset(&last);
    assert_eq!(cloud.world_position(299), expected.world_position(299));
    assert_eq!(cloud.intensity, expected.intensity);
}

#[test]
fn an_ascii_row_that_may_be_cut_is_left_out() {
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nend_header\n";
    let cut = format!("{header}1 2 3\n4 5 6.25\n7 8 9.");
    assert_eq!(read("a.ply", &cut).unwrap().cloud.len(), 3);
    let cut = format!("{header}1 2 3\n4 5 6.");
    assert_eq!(salvaged("a.ply", cut.as_bytes(), "1 of 3 points").len(), 1);
    let broken = format!("{header}1 2 3\n4 x 6\n7 8 9\n");
    let words = "1 of 3 points; found `x` at line 9, expected a number";
    assert_eq!(salvaged("a.ply", broken.as_bytes(), words).len(), 1);
    assert_eq!(salvaged("a.xyz", b"1 2 3\n4 5 6\n7 8", "2 points; found 2 fields").len(), 2);
}

#[test]
fn broken_lines_of_text_are_left_out() {
    let text = "1 2 3\n4 five 6\n7 8 9\n\n10 11\n12 13 14\n";
    let cloud = salvaged("a.xyz", text.as_bytes(), "3 points; found `five` at line 2");
    assert_eq!(cloud.positions, [1.0, 7.0, 12.0].map(|x| Vec3::new(x, x + 1.0, x + 2.0)));
    let long = format!("{}{}", "1 2 3\n4 5 6\nx\n".repeat(100_000), "7 8 9\n");
    let listener = Listener::default();
    let loaded = load_bytes("a.xyz", long.as_bytes(), &options(), &listener).unwrap();
    assert_eq!(loaded.cloud.len(), 200_001);
    assert!(listener.has_note("a.xyz: 100000 broken lines left out"), "{:?}", listener.notes);
    assert!(listener.has_note("found `x` at line 3"), "{:?}", listener.notes);
}

#[test]
fn cut_scans_keep_their_whole_cells() {
    let whole = ptx::two_scans();
    let cut = &whole[..whole.len() - 2];
    let cloud = salvaged("a.ptx", cut.as_bytes(), "3 of 4 grid cells");
    assert_eq!((cloud.len(), cloud.stations.len()), (2, 2));
    // The second scan ends within its header.
    let header = whole.find("500010").unwrap();
    let cloud = salvaged("a.ptx", &whole.as_bytes()[..header + 3], "2 of 2 grid cells");
    assert_eq!((cloud.len(), cloud.stations.len()), (1, 1));
}

#[test]
fn meshes_keep_the_faces_that_are_there() {
    let header = "element vertex 4\nproperty char x\nproperty char y\nproperty char z\n\
        element face 3\nproperty list uchar uchar vertex_index\nend_header\n";
    let binary = |body: &[u8]| {
        let start = format!("ply\nformat binary_little_endian 1.0\n{header}");
        [start.as_bytes(), &[0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0], body].concat()
    };
    let ascii = |body: &str| {
        let start = format!("ply\nformat ascii 1.0\n{header}");
        format!("{start}0 0 0\n1 0 0\n0 1 0\n1 1 0\n{body}").into_bytes()
    };
    let n_triangles = |bytes: &[u8], words: &str| {
        let refused = load_graph_bytes("a.ply", bytes, &LoadOptions::default(), &NoProgress);
        assert!(refused.unwrap_err().to_string().ends_with(ADVICE));
        let listener = Listener::default();
        let (graph, _) = load_graph_bytes("a.ply", bytes, &options(), &listener).unwrap();
        assert!(listener.has_note(words), "{words}: {:?}", listener.notes.lock());
        match &graph.geometries[0] {
            Geometry::Triangles(mesh) => mesh.triangles.len(),
            Geometry::Points(_) => 0,
        }
    };
    let words = "a.ply: salvaged 2 of 3 faces";
    assert_eq!(n_triangles(&binary(&[3, 0, 1, 2, 3, 1, 2, 3, 3, 0]), words), 2);
    assert_eq!(n_triangles(&binary(&[3, 0, 1, 2, 3, 1, 2, 3, 3, 0, 1, 9]), words), 2);
    assert_eq!(n_triangles(&ascii("3 0 1 2\n3 1 2 3\n3 0 1"), words), 2);
    assert_eq!(n_triangles(&ascii("3 0 1 2\n3 1 2 3\n3 0 1 9\n"), words), 2);
    // Without all vertices there are no faces; points are left.
    let cut = binary(&[]);
    assert_eq!(n_triangles(&cut[..cut.len() - 2], "a.ply: salvaged 3 of 4 points"), 0);
}
