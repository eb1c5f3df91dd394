//! Decodes blocks of a scan's points to world coordinates.

use e57::{PointCloud, RecordName};
use surfel_core::math::{DQuat, DVec3};

use surfel_core::points::ScanStation;

use super::columns::{ScanColumn, scan_columns};
use super::pages::Pages;
use super::streams::Stream;
use super::values::Encoding;
use crate::table::ColumnRole;

/// A scan: its fields and its pose.
pub(super) struct Scan {
    /// Number of points that the file claims.
    pub n_points: u64,
    /// Encodings of all fields.
    pub encodings: Vec<Encoding>,
    /// Columns besides the position.
    pub columns: Vec<ScanColumn>,
    cartesian: Option<Coordinates>,
    spherical: Option<Coordinates>,
    /// True if cells of a grid without measurement are at the scanner.
    has_empty_cells: bool,
    rotation: DQuat,
    translation: DVec3,
}

/// The fields of three coordinates, and of the number that is not 0 if they are invalid.
#[derive(Clone, Copy)]
struct Coordinates {
    fields: [usize; 3],
    invalid_state: Option<usize>,
}

/// The values of a block of points, which are decoded as they are needed.
struct Block<'a> {
    scan: &'a Scan,
    streams: &'a [Stream],
    pages: Pages<'a>,
    first: u64,
    n_points: usize,
}

/// Returns the name of the `index`-th scan of a file.
pub(super) fn scan_name(index: usize, description: &PointCloud) -> String {
    let name = description.name.clone().filter(|name| !name.trim().is_empty());
    name.unwrap_or_else(|| format!("scan {}", index + 1))
}

/// Returns the numbers of rows and columns of a scan's grid, if its description states them.
fn stated_grid(description: &PointCloud) -> Option<[u64; 2]> {
    let bounds = description.index_bounds.as_ref()?;
    let count = |min: Option<i64>, max: Option<i64>| {
        let last = max?.checked_sub(min.unwrap_or(0))?;
        u64::try_from(last).ok()?.checked_add(1)
    };
    Some([count(bounds.row_min, bounds.row_max)?, count(bounds.column_min, bounds.column_max)?])
}

/// Returns the bounds of two boxes together.
pub(super) fn union([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> [DVec3; 2] {
    [a.min(c), b.max(d)]
}

impl Scan {
    /// The scan of a description, in which points at the scanner may be cells without a measurement; `None` if its points
    /// have no coordinates.
    pub fn new(description: &PointCloud, has_empty_cells: bool) -> Option<Self> {
        let find =
            |name: RecordName| description.prototype.iter().position(|record| record.name == name);
        let coordinates = |names: [RecordName; 3], invalid_state| {
            let [x, y, z] = names.map(find);
            Some(Coordinates { fields: [x?, y?, z?], invalid_state: find(invalid_state) })
        };
        let cartesian = coordinates(
            [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ],
            RecordName::CartesianInvalidState,
        );
        let spherical = coordinates(
            [
                RecordName::SphericalRange,
                RecordName::SphericalAzimuth,
                RecordName::SphericalElevation,
            ],
            RecordName::SphericalInvalidState,
        );
        if cartesian.is_none() && spherical.is_none() {
            return None;
        }
        let pose = description.transform.clone().unwrap_or_default();
        let (r, t) = (pose.rotation, pose.translation);
        let rotation = DQuat::from_xyzw(r.x, r.y, r.z, r.w);
        // Some programs write zeros for a pose that they do not know.
        let is_rotation = 0.0 < rotation.length() && rotation.is_finite();
        let encodings: Vec<Encoding> =
            description.prototype.iter().map(|record| Encoding::new(&record.data_type)).collect();
        let mut columns = scan_columns(description);
        columns.retain(|column| {
            // Numbers that are the same for all points take no bytes, however many columns there are.
            !matches!(column.role, ColumnRole::Scalar(_)) || 0 < encodings[column.field].n_bits()
        });
        Some(Self {
            n_points: description.records,
            encodings,
            columns,
            cartesian,
            spherical,
            has_empty_cells,
            rotation: if is_rotation { rotation.normalize() } else { DQuat::IDENTITY },
            translation: DVec3::new(t.x, t.y, t.z),
        })
    }

    /// Returns true if the scan has a column of this role.
    pub fn has_column(&self, role: &ColumnRole) -> bool {
        self.columns.iter().any(|column| column.role == *role)
    }

    /// Returns the station of the scan, which is the `index`-th of the file. Ranges and angles are measured from it.
    pub fn station(&self, index: usize, description: &PointCloud) -> ScanStation {
        let is_known = description.transform.is_some() || self.cartesian.is_none();
        ScanStation {
            name: scan_name(index, description),
            position: is_known.then_some(self.translation),
            rotation: self.rotation,
            grid: description.has_row_column().then(|| stated_grid(description)).flatten(),
        }
    }

    /// Returns the least and greatest world coordinates that the points may have by a description that states bounds.
    pub fn stated_bounds(&self, description: &PointCloud) -> Option<[DVec3; 2]> {
        let bounds = description.cartesian_bounds.as_ref()?;
        let low = DVec3::new(bounds.x_min?, bounds.y_min?, bounds.z_min?);
        let high = DVec3::new(bounds.x_max?, bounds.y_max?, bounds.z_max?);
        let is_valid = low.is_finite() && high.is_finite() && low.cmple(high).all();
        let corners = (0..8).map(|corner: u32| {
            let side = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            self.rotation * DVec3::from_array([0, 1, 2].map(side)) + self.translation
        });
        let boxes = corners.map(|corner| [corner; 2]);
        boxes.reduce(union).filter(|_| is_valid)
    }

    /// Returns the bytes that the stream of each field must have.
    pub fn stream_lengths(&self) -> Vec<u64> {
        let lengths = self.encodings.iter().map(|encoding| {
            let n_bits = u128::from(self.n_points) * u128::from(encoding.n_bits());
            u64::try_from(n_bits.div_ceil(8)).unwrap_or(u64::MAX)
        });
        lengths.collect()
    }

    /// Returns the number of points whose values are all in the streams.
    pub fn n_readable(&self, streams: &[Stream]) -> u64 {
        let fields =
            self.encodings.iter().zip(streams).filter(|(encoding, _)| 0 < encoding.n_bits());
        let n_values = fields.map(|(encoding, stream)| stream.len() * 8 / encoding.n_bits());
        // A point all of whose numbers are known beforehand can be there once.
        n_values.min().unwrap_or(1).min(self.n_points)
    }

    /// Decodes the valid ones of `n_points` points from `first` on to records of f64: world coordinates, then a number
    /// for each of `roles`, NaN where the scan has none.
    pub fn decode(
        &self,
        streams: &[Stream],
        pages: Pages,
        first: u64,
        n_points: usize,
        roles: &[ColumnRole],
    ) -> Vec<u8> {
        let block = Block { scan: self, streams, pages, first, n_points };
        let positions = block.positions();
        let columns: Vec<Option<Vec<f64>>> = roles.iter().map(|role| block.column(role)).collect();
        let normal_of = |axis| roles.iter().position(|role| *role == ColumnRole::Normal(axis));
        let normals = [normal_of(0), normal_of(1), normal_of(2)];
        let stride = 3 + roles.len();
        let mut records = Vec::with_capacity(8 * stride * n_points);
        let mut row = vec![0.0; stride];
        for (i, measured) in positions.into_iter().enumerate() {
            let Some(measured) = measured else { continue };
            let world = self.rotation * measured + self.translation;
            row[..3].copy_from_slice(&world.to_array());
            for (slot, column) in row[3..].iter_mut().zip(&columns) {
                *slot = column.as_ref().map_or(f64::NAN, |column| column[i]);
            }
            if let [Some(x), Some(y), Some(z)] = normals.map(|at| at.map(|at| at + 3)) {
                let normal = self.rotation * DVec3::new(row[x], row[y], row[z]);
                [row[x], row[y], row[z]] = normal.to_array();
            }
            records.extend(row.iter().flat_map(|value| value.to_le_bytes()));
        }
        records
    }
}

impl Block<'_> {
    fn values(&self, field: usize) -> Vec<f64> {
        let mut values = vec![0.0; self.n_points];
        let encoding = self.scan.encodings[field];
        encoding.decode(&self.streams[field], self.pages, self.first, &mut values);
        values
    }

    /// Returns the values of a column, colours scaled, NaN where the file says that a value is invalid; `None` if the
    /// scan has no such column.
    fn column(&self, role: &ColumnRole) -> Option<Vec<f64>> {
        let column = self.scan.columns.iter().find(|column| column.role == *role)?;
        let mut values = self.values(column.field);
        let [factor, summand] = column.scale;
        if (factor, summand) != (1.0, 0.0) {
            values.iter_mut().for_each(|value| *value = *value * factor + summand);
        }
        if let Some(flag) = column.invalid_flag {
            let flagged = values.iter_mut().zip(self.values(flag)).filter(|(_, flag)| *flag != 0.0);
            flagged.for_each(|(value, _)| *value = f64::NAN);
        }
        Some(values)
    }

    /// Returns the positions relative to the scanner, `None` for points that were not measured.
    fn positions(&self) -> Vec<Option<DVec3>> {
        let mut positions = vec![None; self.n_points];
        let scan = self.scan;
        if let Some(cartesian) = scan.cartesian {
            self.fill(cartesian, &mut positions, DVec3::new);
        }
        if let Some(spherical) = scan.spherical
            && positions.iter().any(Option::is_none)
        {
            self.fill(spherical, &mut positions, |range, azimuth, elevation| {
                let ((sin, cos), (up, level)) = (azimuth.sin_cos(), elevation.sin_cos());
                range * DVec3::new(level * cos, level * sin, up)
            });
        }
        positions
    }

    /// Fills the positions that are still absent.
    fn fill(
        &self,
        Coordinates { fields, invalid_state }: Coordinates,
        positions: &mut [Option<DVec3>],
        position_of: impl Fn(f64, f64, f64) -> DVec3,
    ) {
        let [a, b, c] = fields.map(|field| self.values(field));
        let states = invalid_state.map(|field| self.values(field));
        for (i, position) in positions.iter_mut().enumerate() {
            let is_valid = states.as_ref().is_none_or(|states| states[i] == 0.0);
            if position.is_some() || !is_valid {
                continue;
            }
            let measured = position_of(a[i], b[i], c[i]);
            let is_empty = self.scan.has_empty_cells && measured == DVec3::ZERO;
            *position = (measured.is_finite() && !is_empty).then_some(measured);
        }
    }
}
