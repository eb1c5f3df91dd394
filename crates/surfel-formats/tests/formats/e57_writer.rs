//! Writes small E57 files, with valid checksums also after changes.

use std::io::Cursor;

use e57::{E57Writer, Quaternion, Record, RecordValue, Transform, Translation};

/// Bytes of a page, whose last four are its checksum.
const PAGE_LENGTH: usize = 1024;

/// A scan to write.
pub struct Scan {
    pub name: &'static str,
    pub pose: Option<([f64; 4], [f64; 3])>,
    pub prototype: Vec<Record>,
    pub points: Vec<Vec<RecordValue>>,
}

/// Returns a file of these scans.
pub fn write(scans: &[Scan]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
    writer
        .register_extension(e57::Extension::new(
            "nor",
            "http://www.libe57.org/E57_NOR_surface_normals.txt",
        ))
        .unwrap();
    for Scan { name, pose, prototype, points } in scans {
        let mut scan = writer.add_pointcloud(name, prototype.clone()).unwrap();
        scan.set_name(Some((*name).into()));
        scan.set_transform(pose.map(|([w, x, y, z], [tx, ty, tz])| Transform {
            rotation: Quaternion { w, x, y, z },
            translation: Translation { x: tx, y: ty, z: tz },
        }));
        points.iter().for_each(|point| scan.add_point(point.clone()).unwrap());
        scan.finalize().unwrap();
    }
    writer.finalize().unwrap();
    drop(writer);
    bytes.into_inner()
}

/// Returns a file of a scan with scaled integers, and of one of two points with colours.
pub fn small_file() -> Vec<u8> {
    let scaled =
        e57::RecordDataType::ScaledInteger { min: -500, max: 600, scale: 0.01, offset: 1.0 };
    let axes =
        [e57::RecordName::CartesianX, e57::RecordName::CartesianY, e57::RecordName::CartesianZ];
    let record = |name| Record { name, data_type: scaled.clone() };
    let integers = |values: [i64; 3]| values.map(RecordValue::ScaledInteger).to_vec();
    let quarter_turn = [0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()];
    let colored = vec![
        Record::CARTESIAN_X_F32,
        Record::CARTESIAN_Y_F32,
        Record::CARTESIAN_Z_F32,
        Record::COLOR_RED_U8,
        Record::COLOR_GREEN_U8,
        Record::COLOR_BLUE_U8,
    ];
    let point = |position: [f32; 3], color: [i64; 3]| {
        let values = position.map(RecordValue::Single).into_iter();
        values.chain(color.map(RecordValue::Integer)).collect()
    };
    write(&[
        Scan {
            name: "hall",
            pose: Some((quarter_turn, [500_000.0, 4_900_000.0, 10.0])),
            prototype: axes.map(record).to_vec(),
            points: vec![integers([0, 100, -500]), integers([600, 1, 2]), integers([-100; 3])],
        },
        Scan {
            name: "yard",
            pose: None,
            prototype: colored,
            points: vec![point([1.0, 2.0, 3.0], [255, 0, 128]), point([4.0, 5.0, 6.0], [1, 2, 3])],
        },
    ])
}

/// Replaces text in the XML by text of the same length, and makes the checksums valid.
pub fn replace(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut content: Vec<u8> =
        bytes.chunks(PAGE_LENGTH).flat_map(|page| &page[..PAGE_LENGTH - 4]).copied().collect();
    let at = content.windows(from.len()).position(|text| text == from.as_bytes()).unwrap();
    content[at..at + to.len()].copy_from_slice(to.as_bytes());
    let pages = content.chunks(PAGE_LENGTH - 4);
    with_checksums(&pages.flat_map(|page| [page, &[0; 4]].concat()).collect::<Vec<u8>>())
}

/// Returns the pages with valid checksums.
pub fn with_checksums(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for page in bytes.chunks_exact_mut(PAGE_LENGTH) {
        let checksum = crc32c::crc32c(&page[..PAGE_LENGTH - 4]).to_be_bytes();
        page[PAGE_LENGTH - 4..].copy_from_slice(&checksum);
    }
    bytes
}
