//! PLY: all types, byte orders and header variants.

use std::sync::Mutex;
use std::sync::atomic::Ordering;

use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::Values;
use surfel_core::progress::{NoProgress, Progress};
use surfel_formats::{
    Column, ColumnChoice, LoadOptions, SaveOptions, load_bytes, load_graph_bytes,
};

use crate::common::{Listener, read, round_trip};

fn binary(header: &str, body: &[u8]) -> Vec<u8> {
    [header.as_bytes(), body].concat()
}

#[test]
fn lists_comments_crlf_and_other_elements_are_skipped() {
    let text = "ply\r\nformat ascii 1.0\r\ncomment a\r\nobj_info b c\r\nelement camera 2\r\n\
        property float fov\r\nelement vertex 2\r\nproperty list uchar int near\r\nproperty float x\r\n\
        property float y\r\nproperty list uchar float far\r\nproperty double z\r\n\
        element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n\
        45\r\n46\r\n2 7 8 1 2 0 3\r\n0 4 5 1 9.5 6\r\n3 0 1 1";
    let cloud = read("a.ply", text).unwrap().cloud;
    assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
    assert!(cloud.scalars.is_empty());
}

#[test]
fn every_type_is_read_in_both_byte_orders_and_spellings() {
    for (order, is_big) in [("little", false), ("big", true)] {
        let header = format!(
            "ply\nformat binary_{order}_endian 1.0\nelement vertex 1\nproperty float32 x\n\
            property double y\nproperty float z\nproperty char a1\nproperty uint8 a2\n\
            property int16 a3\nproperty ushort a4\nproperty int32 a5\nproperty uint a6\n\
            property float64 a7\nend_header\n"
        );
        macro_rules! body {
            ($($value:expr),*) => {
                [$(if is_big { $value.to_be_bytes().to_vec() } else { $value.to_le_bytes().to_vec() }),*].concat()
            };
        }
        let body = body!(
            1.5f32,
            2.5f64,
            3.5f32,
            -1i8,
            200u8,
            -300i16,
            60_000u16,
            -70_000i32,
            3_000_000_000u32,
            0.1f64
        );
        let cloud = read("a.ply", binary(&header, &body)).unwrap().cloud;
        assert_eq!(cloud.positions, [Vec3::new(1.5, 2.5, 3.5)]);
        let values: Vec<&Values> = cloud.scalars.iter().map(|scalar| &scalar.values).collect();
        assert_eq!(
            values,
            [
                &Values::I32(vec![-1]),
                &Values::U8(vec![200]),
                &Values::I32(vec![-300]),
                &Values::U16(vec![60_000]),
                &Values::I32(vec![-70_000]),
                &Values::F64(vec![3e9]),
                &Values::F64(vec![0.1]),
            ]
        );
    }
}

#[test]
fn binary_lists_are_skipped() {
    let header = "ply\nformat binary_little_endian 1.0\nelement strip 2\n\
        property list uchar ushort i\nelement vertex 2\nproperty uchar x\n\
        property list ushort uchar l\nproperty uchar y\nproperty uchar z\nend_header\n";
    let body = [1, 9, 9, 0, /* points */ 1, 2, 0, 7, 7, 2, 3, 4, 0, 0, 5, 6];
    let cloud = read("a.ply", binary(header, &body)).unwrap().cloud;
    assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
}

#[test]
fn colours_of_any_type_become_16_bit() {
    let file = |kind: &str, values: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
            property float z\nproperty {kind} red\nproperty {kind} green\nproperty {kind} blue\n\
            property {kind} alpha\nend_header\n0 0 0 {values}\n"
        )
    };
    let color = |kind, values| read("a.ply", file(kind, values)).unwrap().cloud.colors.unwrap()[0];
    assert_eq!(color("uchar", "0 128 255 255"), [0, 128 * 257, 65535]);
    assert_eq!(color("ushort", "0 128 65535 1"), [0, 128, 65535]);
    assert_eq!(color("ushort", "0 128 255 255"), [0, 128 * 257, 65535]);
    assert_eq!(color("float", "0 0.5 1 1"), [0, 32768, 65535]);
    assert_eq!(color("float", "0 128 300 255"), [0, 128 * 257, 65535]);
}

#[test]
fn classifications_must_be_small_integers() {
    let file = |value: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
            property float z\nproperty float scalar_Classification\nproperty float radii\n\
            property float scalar_Intensity\nend_header\n0 0 0 {value} 0.5 7\n"
        )
    };
    let whole = read("a.ply", file("6")).unwrap().cloud;
    assert_eq!(whole.classification, Some(vec![6]));
    assert_eq!((whole.radii, whole.intensity), (Some(vec![0.5]), Some(vec![7.0])));
    let broken = read("a.ply", file("6.5")).unwrap().cloud;
    assert_eq!(broken.classification, None);
    assert_eq!(broken.scalar("scalar_classification").unwrap().get(0), 6.5);
}

#[test]
fn labels_above_255_after_the_first_records_are_not_clamped() {
    let n = 100_000;
    let header = |encoding: &str| {
        format!(
            "ply\nformat {encoding} 1.0\nelement vertex {n}\nproperty float x\nproperty float y\n\
            property float z\nproperty int classification\nend_header\n"
        )
    };
    let label = |i: usize| if i + 1 == n { 300 } else { i % 7 };
    let records =
        (0..n).flat_map(|i| [[0; 12].as_slice(), &(label(i) as i32).to_le_bytes()].concat());
    let records: Vec<u8> = records.collect();
    let lines: String = (0..n).map(|i| format!("0 0 0 {}\n", label(i))).collect();
    for (name, file) in [
        ("a.ply", binary(&header("binary_little_endian"), &records)),
        ("b.ply", binary(&header("ascii"), lines.as_bytes())),
        ("c.csv", format!("x y z classification\n{lines}").into_bytes()),
    ] {
        let cloud = read(name, file).unwrap().cloud;
        assert_eq!(cloud.classification, None, "{name}");
        let [labels] = &cloud.scalars[..] else { panic!("{name}: {:?}", cloud.scalars.len()) };
        assert!((0..n).all(|i| labels.values.get(i) == label(i) as f64), "{name}");
    }
}

#[test]
fn large_coordinates_keep_their_precision_despite_nan() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n\
        property double x\nproperty double y\nproperty double z\nend_header\n";
    let rows = [[589_500.01, 231_300.02, 500.03], [f64::NAN; 3], [589_501.01, 231_301.02, 501.03]];
    let body: Vec<u8> = rows.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
    let cloud = read("a.ply", binary(header, &body)).unwrap().cloud;
    assert!((cloud.world_position(0) - DVec3::from_array(rows[0])).abs().max_element() < 1e-6);
    assert!(cloud.positions[1].is_nan());
    assert!(cloud.origin.is_finite());
}

#[test]
fn only_requested_columns_are_loaded() {
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
        property float intensity\nproperty float time\nproperty float other\nend_header\n\
        0 0 0 1 2 3 4 5 6\n";
    let wanted = vec![Column::Colors, Column::Scalar("Time".into())];
    let options = LoadOptions { columns: ColumnChoice::Only(wanted), ..LoadOptions::default() };
    let cloud = load_bytes("a.ply", text.as_bytes(), &options, &NoProgress).unwrap().cloud;
    assert_eq!(cloud.colors, Some(vec![[257, 514, 771]]));
    assert_eq!(cloud.intensity, None);
    assert_eq!(cloud.scalars.len(), 1);
}

#[test]
fn trained_splats_become_discs() {
    let names = [
        "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "f_rest_0", "opacity",
        "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
    ];
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let (two, thin) = (2f32.ln(), 0.01f32.ln());
    // The second splat has an opacity of 0.05.
    let splats = format!(
        "1 2 3 0 0 0 1.7724539 -1.7724539 0 9 2 {two} {two} {thin} 1 0 0 0\n\
        4 5 6 0 0 0 0 0 0 9 -2.9444 {two} {two} {thin} 1 0 0 0\n"
    );
    let file = format!("ply\nformat ascii 1.0\nelement vertex 2\n{properties}end_header\n{splats}");
    let listener = Listener::default();
    let discs = ColumnChoice::Only(vec![Column::Colors, Column::Normals, Column::Radii]);
    let discs = LoadOptions { columns: discs, ..LoadOptions::default() };
    let loaded = load_bytes("a.ply", file.as_bytes(), &discs, &listener).unwrap();
    assert_eq!(loaded.cloud.positions, [Vec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(loaded.cloud.colors, Some(vec![[65535, 0, 32768]]));
    assert_eq!(loaded.cloud.normals, Some(vec![Vec3::Z]));
    assert!((loaded.cloud.radii.unwrap()[0] - 3.0).abs() < 1e-5);
    assert!(loaded.info.format.ends_with("trained splats"));
    assert_eq!(loaded.info.harmonics_degree, None, "one coefficient is no degree");
    assert!(listener.has_note("1 faint ones skipped"));
    let columns = ColumnChoice::Only(vec![Column::Colors]);
    let options = LoadOptions { columns, ..LoadOptions::default() };
    let cloud = load_bytes("a.ply", file.as_bytes(), &options, &NoProgress).unwrap().cloud;
    assert!(cloud.colors.is_some() && cloud.normals.is_none() && cloud.scalars.is_empty());
}

/// Returns an ascii file of splats that have these values behind x, y and z, and these names.
fn splat_file(names: &[&str], splats: &[&str]) -> String {
    let names = ["x", "y", "z"].iter().chain(names);
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    let splats: Vec<String> = splats.iter().map(|splat| format!("1 2 3 {splat}\n")).collect();
    format!(
        "ply\nformat ascii 1.0\nelement vertex {}\n{properties}end_header\n{}",
        splats.len(),
        splats.concat()
    )
}

const SPLAT: [&str; 11] = [
    "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
    "rot_2", "rot_3",
];

#[test]
fn trained_splats_keep_their_columns_and_are_written_with_them() {
    let file = splat_file(&SPLAT, &["1 -1 0.5 2 -4 -5 -6 0.5 0 0 2", "0 0 0 -9 0 0 0 1 0 0 0"]);
    let listener = Listener::default();
    let loaded = load_bytes("a.ply", file.as_bytes(), &LoadOptions::default(), &listener).unwrap();
    // Faint splats are no discs, but Gaussians.
    assert_eq!((loaded.cloud.len(), loaded.cloud.scalars.len()), (2, 11));
    assert_eq!(loaded.info.harmonics_degree, Some(0));
    assert!(listener.has_note("2 trained splats; colours are the same in all directions"));
    let again = round_trip(&loaded.cloud, "ply", &SaveOptions::default());
    assert_eq!(again.cloud, loaded.cloud);
    assert!(again.info.format.ends_with("trained splats"));
}

#[test]
fn broken_splats_are_skipped_and_counted() {
    let good = "0 0 0 1 0 0 0 1 0 0 0";
    let splats = [
        good,
        "nan 0 0 1 0 0 0 1 0 0 0",
        "0 0 0 nan 0 0 0 1 0 0 0",
        "0 0 0 1 inf 0 0 1 0 0 0",
        "0 0 0 1 0 99 0 1 0 0 0",
        "0 0 0 1 0 0 0 0 0 0 0",
        "0 0 0 1e30 -1e30 0 0 1 0 0 0",
    ];
    let listener = Listener::default();
    let file = splat_file(&SPLAT, &splats);
    let loaded = load_bytes("a.ply", file.as_bytes(), &LoadOptions::default(), &listener).unwrap();
    assert_eq!(loaded.cloud.len(), 2);
    assert!(listener.has_note("5 broken ones skipped"));
}

#[test]
fn incomplete_and_compressed_splats_are_named() {
    let listener = Listener::default();
    let file = splat_file(&SPLAT[..10], &["0 0 0 1 0 0 0 1 0 0"]);
    let loaded = load_bytes("a.ply", file.as_bytes(), &LoadOptions::default(), &listener).unwrap();
    assert_eq!((loaded.cloud.len(), loaded.cloud.has_gaussians()), (1, false));
    assert!(
        listener.has_note("read as plain points: trained splats also need the properties rot_3")
    );
    let packed = "ply\nformat ascii 1.0\nelement chunk 1\nproperty float min_x\n\
        element vertex 1\nproperty uint packed_position\nend_header\n0\n0\n";
    let error = load_bytes("a.ply", packed.as_bytes(), &LoadOptions::default(), &listener);
    let error = error.unwrap_err().to_string();
    assert!(
        error.contains("compressed PLY of trained splats") && error.contains("export"),
        "{error}"
    );
}

/// The total of the last stage and the sum of what was finished in it.
#[derive(Default)]
struct Stage(Mutex<(u64, u64)>);

impl Progress for Stage {
    fn begin(&self, _stage: &str, total: u64) {
        *self.0.lock().unwrap() = (total, 0);
    }

    fn advance(&self, units: u64) {
        self.0.lock().unwrap().1 += units;
    }
}

#[test]
fn the_progress_of_faces_ends_at_its_total() {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty char x\nproperty char y\n\
            property char z\nelement face 2\nproperty list uchar uchar vertex_indices\n\
            element strip 1\nproperty char i\nend_header\n"
        )
    };
    let text = header("ascii") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 2 1 0\n7\n";
    let body = [0, 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2, 3, 2, 1, 0, 7];
    let n_bytes = (text.len() - header("ascii").len()) as u64;
    let binary = binary(&header("binary_little_endian"), &body);
    for (file, total) in [(text.into_bytes(), n_bytes), (binary, 2)] {
        let stage = Stage::default();
        load_graph_bytes("a.ply", &file, &LoadOptions::default(), &stage).unwrap();
        assert_eq!(*stage.0.lock().unwrap(), (total, total));
    }
}

#[test]
fn one_late_value_makes_words_colours_of_16_bits() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 50000\nproperty char x\n\
        property char y\nproperty char z\nproperty ushort red\nproperty ushort green\n\
        property ushort blue\nend_header\n";
    let vertex = [0, 0, 0, 255, 0, 1, 0, 2, 0];
    let mut bytes = binary(header, &vertex.repeat(50_000));
    let color = |bytes: &[u8]| read("a.ply", bytes).unwrap().cloud.colors.unwrap()[0];
    assert_eq!(color(&bytes), [65535, 257, 514]);
    *bytes.last_mut().unwrap() = 1;
    assert_eq!(color(&bytes), [255, 1, 2]);
    let listener = Listener::default();
    listener.cancelled.store(true, Ordering::Relaxed);
    let cancelled = load_bytes("a.ply", &bytes, &LoadOptions::default(), &listener);
    assert!(cancelled.unwrap_err().is_cancelled());
}
