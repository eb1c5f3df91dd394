//! The columns of a cloud that the fields of its scans become.

use std::collections::HashSet;

use e57::{ColorLimits, PointCloud, RecordDataType, RecordName, RecordValue};

use super::values::Encoding;
use crate::table::{ColumnRole, NumberType};

/// A field of a scan that becomes a column.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ScanColumn {
    /// Meaning of the column.
    pub role: ColumnRole,
    /// Narrowest type that holds the values.
    pub number_type: NumberType,
    /// Index among the scan's fields.
    pub field: usize,
    /// Index of the field that is not 0 where the value is invalid.
    pub invalid_flag: Option<usize>,
    /// Factor and summand that bring colours to 0..65535.
    pub scale: [f64; 2],
}

/// Returns the columns of a scan, without its position, which may be in spherical coordinates.
pub(super) fn scan_columns(scan: &PointCloud) -> Vec<ScanColumn> {
    let find = |name: RecordName| scan.prototype.iter().position(|record| record.name == name);
    let invalid_color = find(RecordName::IsColorInvalid);
    let invalid_intensity = find(RecordName::IsIntensityInvalid);
    let names = scan.prototype.iter().map(|record| &record.name);
    let standard = names.filter(|name| !matches!(name, RecordName::Unknown { .. }));
    let standard_roles: HashSet<ColumnRole> = standard.filter_map(role).collect();
    let fields = scan.prototype.iter().enumerate();
    let columns = fields.filter_map(|(field, record)| {
        let role = match (role(&record.name)?, &record.name) {
            // An extension may hold another value of the same meaning, as a calibrated reflectance.
            (taken, RecordName::Unknown { name, .. }) if standard_roles.contains(&taken) => {
                ColumnRole::Scalar(name.clone())
            }
            (role, _) => role,
        };
        let scale = match role {
            ColumnRole::Color(channel) => {
                color_scale(scan.color_limits.as_ref(), channel, &record.data_type)
            }
            _ => [1.0, 0.0],
        };
        let number_type = Encoding::new(&record.data_type).number_type();
        let invalid_flag = match record.name {
            RecordName::ColorRed | RecordName::ColorGreen | RecordName::ColorBlue => invalid_color,
            RecordName::Intensity => invalid_intensity,
            _ => None,
        };
        Some(ScanColumn { role, number_type, field, invalid_flag, scale })
    });
    columns.collect()
}

/// Returns the meaning of a field; `None` for positions and for fields that say which values are valid.
fn role(name: &RecordName) -> Option<ColumnRole> {
    let scalar = |name: &str| ColumnRole::Scalar(name.into());
    Some(match name {
        RecordName::Intensity => ColumnRole::Intensity,
        RecordName::ColorRed => ColumnRole::Color(0),
        RecordName::ColorGreen => ColumnRole::Color(1),
        RecordName::ColorBlue => ColumnRole::Color(2),
        RecordName::RowIndex => scalar("row_index"),
        RecordName::ColumnIndex => scalar("column_index"),
        RecordName::ReturnCount => scalar("number_of_returns"),
        RecordName::ReturnIndex => scalar("return_number"),
        RecordName::TimeStamp => scalar("time"),
        // The extension of normals has prefixes other than its own in some files, so its name alone decides.
        RecordName::Unknown { name, .. } => ColumnRole::from_name(name)
            .filter(|role| !matches!(role, ColumnRole::Position(_)))
            .unwrap_or_else(|| scalar(name)),
        _ => return None,
    })
}

/// Returns factor and summand that bring a colour channel to 0..65535: by the limits that the scan states, else by those
/// of its type, else from 0..255.
fn color_scale(
    limits: Option<&ColorLimits>,
    channel: usize,
    data_type: &RecordDataType,
) -> [f64; 2] {
    let stated = limits.and_then(|limits| {
        let (min, max) = match channel {
            0 => (&limits.red_min, &limits.red_max),
            1 => (&limits.green_min, &limits.green_max),
            _ => (&limits.blue_min, &limits.blue_max),
        };
        let value = |value: &Option<RecordValue>| value.as_ref()?.to_f64(data_type).ok();
        Some([value(min)?, value(max)?])
    });
    let of_type = match *data_type {
        RecordDataType::Single { min, max } => {
            min.zip(max).map(|(min, max)| [min.into(), max.into()])
        }
        RecordDataType::Double { min, max } => min.zip(max).map(|(min, max)| [min, max]),
        RecordDataType::Integer { min, max } => Some([min as f64, max as f64]),
        RecordDataType::ScaledInteger { min, max, scale, offset } => {
            Some([min, max].map(|limit| limit as f64 * scale + offset))
        }
    };
    let is_range = |[min, max]: &[f64; 2]| min < max && (max - min).is_finite();
    let [min, max] = stated.filter(is_range).or(of_type.filter(is_range)).unwrap_or([0.0, 255.0]);
    let factor = 65535.0 / (max - min);
    [factor, -min * factor]
}
