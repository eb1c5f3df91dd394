//! Writes clouds as binary little-endian PLY.

use std::io::Write;
use std::ops::Range;
use std::path::Path;

use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, Values, to_8_bits};
use surfel_core::progress::Progress;

use super::station_comment::format_station;
use crate::error::Result;
use crate::file::{write_error, write_file};
use crate::table::{encode_points, note_rounded_colors, scalar_word};

/// Writes `cloud` to `path`.
pub(crate) fn write(path: &Path, cloud: &PointCloud, progress: &dyn Progress) -> Result<()> {
    let has_wide_positions = cloud.origin != DVec3::ZERO;
    note_rounded_colors(path, cloud, progress);
    progress.begin(&format!("write {}", path.display()), cloud.len() as u64);
    write_file(path, |writer| {
        let mut put = |bytes: &[u8]| writer.write_all(bytes).map_err(|e| write_error(path, e));
        put(header(cloud, has_wide_positions).as_bytes())?;
        encode_points(
            cloud.len(),
            |points| Ok(encode(cloud, has_wide_positions, points)),
            progress,
            put,
        )
    })
}

/// Returns the header; positions are f64 if they are wide, else f32.
fn header(cloud: &PointCloud, has_wide_positions: bool) -> String {
    let mut header =
        String::from("ply\nformat binary_little_endian 1.0\ncomment written by surfel\n");
    cloud.stations.iter().for_each(|station| header += &(format_station(station) + "\n"));
    header += &format!("element vertex {}\n", cloud.len());
    let mut property =
        |type_name: &str, name: &str| header += &format!("property {type_name} {name}\n");
    for name in ["x", "y", "z"] {
        property(if has_wide_positions { "double" } else { "float" }, name);
    }
    if cloud.normals.is_some() {
        ["nx", "ny", "nz"].iter().for_each(|name| property("float", name));
    }
    if cloud.colors.is_some() {
        ["red", "green", "blue"].iter().for_each(|name| property("uchar", name));
    }
    if cloud.radii.is_some() {
        property("float", "radius");
    }
    if cloud.intensity.is_some() {
        property("float", "intensity");
    }
    if cloud.classification.is_some() {
        property("uchar", "classification");
    }
    for scalar in &cloud.scalars {
        let type_name = match scalar.values {
            Values::U8(_) => "uchar",
            Values::U16(_) => "ushort",
            Values::I32(_) => "int",
            Values::F32(_) => "float",
            Values::F64(_) => "double",
        };
        property(type_name, &scalar_word(&scalar.name));
    }
    header + "end_header\n"
}

fn encode(cloud: &PointCloud, has_wide_positions: bool, points: Range<usize>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for i in points {
        if has_wide_positions {
            let position = cloud.world_position(i).to_array();
            position.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        } else {
            cloud.positions[i].to_array().iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        }
        if let Some(normals) = &cloud.normals {
            normals[i].to_array().iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        }
        if let Some(colors) = &cloud.colors {
            bytes.extend(colors[i].map(to_8_bits));
        }
        for column in [&cloud.radii, &cloud.intensity].into_iter().flatten() {
            bytes.extend(column[i].to_le_bytes());
        }
        bytes.extend(cloud.classification.iter().map(|column| column[i]));
        for scalar in &cloud.scalars {
            match &scalar.values {
                Values::U8(v) => bytes.push(v[i]),
                Values::U16(v) => bytes.extend(v[i].to_le_bytes()),
                Values::I32(v) => bytes.extend(v[i].to_le_bytes()),
                Values::F32(v) => bytes.extend(v[i].to_le_bytes()),
                Values::F64(v) => bytes.extend(v[i].to_le_bytes()),
            }
        }
    }
    bytes
}
