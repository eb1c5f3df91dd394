//! What to load, and what is known about what was loaded.

use std::path::PathBuf;

use surfel::math::DVec3;
use surfel::points::PointCloud;

use crate::role::Role;

/// How to load a file.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    pub columns: ColumnChoice,
    /// The columns of a text file, in order; found out from the file if absent.
    pub text_columns: Option<Vec<TextColumn>>,
    /// World coordinates of the zero of the positions; chosen from the data if absent.
    pub origin: Option<DVec3>,
    /// Name of the animation of glTF files that have any; the first if absent.
    pub animation: Option<String>,
}

/// Which columns to keep in memory; positions are always kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ColumnChoice {
    #[default]
    All,
    Only(Vec<Column>),
}

/// A column of a cloud besides its positions.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    Normals,
    Radii,
    Colors,
    Intensity,
    Classification,
    Scalar(String),
}

/// The meaning of one column of a text file, made by `TextColumn::parse`.
#[derive(Clone, Debug, PartialEq)]
pub struct TextColumn(pub(crate) Option<Role>);

/// A cloud and where it came from.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    pub cloud: PointCloud,
    pub source: Source,
}

/// What a file says about itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    /// As users call it: "LAZ 1.4, point format 6".
    pub format: String,
    /// As far as it is known without reading all points.
    pub n_points: Option<u64>,
    /// Of a mesh; before it is read the number of its faces, which may have more corners.
    pub n_triangles: Option<u64>,
    /// Smallest step between coordinates, if the format states one.
    pub resolution: Option<DVec3>,
    /// WKT, or "EPSG:" and a code, or other words of the file.
    pub coordinate_system: Option<String>,
    /// Names of the columns in the file.
    pub columns: Vec<String>,
    /// Further files that it names and that were looked for as it was read: buffers, materials, textures.
    pub beside: Vec<PathBuf>,
}

impl ColumnChoice {
    pub(crate) fn wants(&self, role: &Role) -> bool {
        let Self::Only(columns) = self else { return true };
        if let Role::Position(_) = role {
            return true;
        }
        columns.iter().any(|column| match (column, role) {
            (Column::Normals, Role::Normal(_))
            | (Column::Radii, Role::Radius)
            | (Column::Colors, Role::Color(_))
            | (Column::Intensity, Role::Intensity)
            | (Column::Classification, Role::Classification) => true,
            (Column::Scalar(wanted), Role::Scalar(name)) => wanted.eq_ignore_ascii_case(name),
            _ => false,
        })
    }

    /// Whether the scalar column is asked for by its name.
    pub(crate) fn names(&self, scalar: &str) -> bool {
        *self != Self::All && self.wants(&Role::Scalar(scalar.into()))
    }
}

impl TextColumn {
    /// A column by its name; `-` and `skip` name one that is not read.
    pub fn parse(name: &str) -> Self {
        match name.trim() {
            "-" | "skip" => Self(None),
            name => Self(Role::of_names(&[name]).pop()),
        }
    }

    /// Columns separated by commas, as in `x,y,z,-,r,g,b`.
    pub fn parse_list(list: &str) -> Vec<Self> {
        let mut columns: Vec<Self> = list.split(',').map(Self::parse).collect();
        let names = list.split(',').map(str::trim).zip(&columns);
        let names: Vec<&str> =
            names.filter(|(_, column)| column.0.is_some()).map(|(name, _)| name).collect();
        // Of several names of one role, only all of them together tell which has it.
        let kept = columns.iter_mut().filter_map(|column| column.0.as_mut());
        kept.zip(Role::of_names(&names)).for_each(|(role, given)| *role = given);
        columns
    }
}
