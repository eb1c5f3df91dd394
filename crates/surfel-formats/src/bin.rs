//! BIN: bare records of little-endian f32 without a header. Seven a point (position, radius, normal) are a format of ray
//! tracing benchmarks, four (position, intensity) that of KITTI, five (and the laser) that of nuScenes.

use surfel_core::progress::Progress;
use surfel_core::words::counted;

use crate::error::{Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::table::{
    ColumnField, ColumnRole, Field, NumberType, RecordLayout, Tolerance, origin_of_records,
    read_records,
};

/// Number of records that tell what they hold.
const N_SAMPLES: usize = 4096;
/// Minimum fraction of them that must agree.
const MIN_AGREEING: f32 = 0.9;
/// Minimum number of records of a scanner: a few numbers may be anything.
const MIN_RETURNS: usize = 64;
/// Maximum distance that a spinning scanner measures, in metres.
const MAX_RANGE: f32 = 1000.0;
/// Maximum intensity, and maximum number of lasers.
const MAX_BYTE: f32 = 255.0;

/// Contents of the records of a file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Records {
    /// Position, radius and normal.
    Surfels,
    /// Position and intensity.
    Returns,
    /// Position, intensity and laser.
    ReturnsOfLasers,
}

impl Records {
    /// Tells the records of a file by its length and their values.
    fn of(input: &Input) -> Result<Self> {
        let all = [Self::Surfels, Self::ReturnsOfLasers, Self::Returns];
        let fits = |records: &Self| {
            let n_records = input.len() / records.stride();
            let is_sure = *records == Self::Surfels || MIN_RETURNS <= n_records;
            is_sure && input.len().is_multiple_of(records.stride())
        };
        if let Some(found) = all.into_iter().filter(fits).find(|records| records.agree_with(input))
        {
            return Ok(found);
        }
        let rest = input.len() % Self::Surfels.stride();
        let n_surfels = input.len() / Self::Surfels.stride();
        if rest == 0 && n_surfels < MIN_RETURNS {
            return Ok(Self::Surfels);
        }
        if all.iter().any(fits) {
            return Err(input.malformed(
                Location::Byte(0),
                "numbers that fit no known records",
                "in most records of 28 bytes a normal of length 1 behind position and radius; in those of 16 or 20 \
                 bytes x y z within 1000 and an intensity of 0 to 255",
                "convert the file if it has other records, as to XYZ",
            ));
        }
        Err(input.malformed(
            Location::Byte((input.len() - rest) as u64),
            format!("a record of {}", counted(rest, "byte")),
            "28: x y z radius nx ny nz, 20: x y z intensity ring, or 16: x y z intensity, as \
             little-endian f32",
            "copy the file again from its source, or convert it if it has other records",
        ))
    }

    /// Returns true if most records have values that these columns may have.
    fn agree_with(self, input: &Input) -> bool {
        let n_records = input.len() / self.stride();
        let step = n_records.div_ceil(N_SAMPLES).max(1);
        let sampled = (0..n_records).step_by(step).map(|record| {
            let bytes = &input[record * self.stride()..][..self.stride()];
            let value = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            bytes.chunks_exact(4).map(value).collect::<Vec<f32>>()
        });
        let is_byte = |value: f32| (0.0..=MAX_BYTE).contains(&value);
        let is_return = |values: &[f32]| {
            let [x, y, z, intensity, ..] = *values else { return false };
            [x, y, z].iter().all(|coordinate| coordinate.abs() < MAX_RANGE) && is_byte(intensity)
        };
        let agrees = |values: &Vec<f32>| match (self, &values[..]) {
            (Self::Surfels, [_, _, _, _, nx, ny, nz]) => {
                let squared = nx * nx + ny * ny + nz * nz;
                squared == 0.0 || (squared - 1.0).abs() < 0.1
            }
            (Self::ReturnsOfLasers, [.., laser]) => {
                is_return(values) && laser.fract() == 0.0 && is_byte(*laser)
            }
            _ => is_return(values),
        };
        let n_sampled = n_records.div_ceil(step);
        MIN_AGREEING * n_sampled as f32 <= sampled.filter(|values| agrees(values)).count() as f32
    }

    /// Columns of each record, an f32 each.
    fn columns(self) -> Vec<ColumnRole> {
        let further = match self {
            Self::Surfels => vec![
                ColumnRole::Radius,
                ColumnRole::Normal(0),
                ColumnRole::Normal(1),
                ColumnRole::Normal(2),
            ],
            Self::Returns => vec![ColumnRole::Intensity],
            Self::ReturnsOfLasers => vec![ColumnRole::Intensity, ColumnRole::Scalar("ring".into())],
        };
        [0, 1, 2].map(ColumnRole::Position).into_iter().chain(further).collect()
    }

    /// Returns the number of bytes of a record.
    fn stride(self) -> usize {
        match self {
            Self::Surfels => 28,
            Self::ReturnsOfLasers => 20,
            Self::Returns => 16,
        }
    }
}

/// Determines the records by some of their values, and their number by the length of the file.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    Ok(info(input, Records::of(input)?))
}

fn info(input: &Input, records: Records) -> FileInfo {
    FileInfo {
        format: format!("BIN, records of {} f32", records.stride() / 4),
        n_points: Some((input.len() / records.stride()) as u64),
        columns: records.columns().iter().map(|role| role.name().into()).collect(),
        ..FileInfo::default()
    }
}

/// Reads the points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let records = Records::of(input)?;
    let (stride, info) = (records.stride(), info(input, records));
    let fields = records.columns().into_iter().enumerate();
    let columns =
        fields.map(|(i, role)| ColumnField { role, field: Field::new(4 * i, NumberType::F32) });
    let layout = RecordLayout::new(stride, false, columns.collect(), &options.columns)
        .expect("the first three columns are x, y and z");
    let origin = options
        .origin
        .unwrap_or_else(|| origin_of_records(input, &layout, Tolerance::F32_COORDINATES));
    progress.begin(&format!("read {}", input.name), (input.len() / stride) as u64);
    let cloud =
        read_records(input, input, &layout, origin, options.filter.as_ref(), |_, _| (), progress)?;
    Ok(Loaded { cloud, info })
}
