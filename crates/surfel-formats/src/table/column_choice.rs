//! The columns to read from a file, chosen by the caller.

use surfel_core::points::{PointCloud, STATION, name_of_pdal, plain_name};

use super::column_role::ColumnRole;

/// The columns to keep in memory; positions are always kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ColumnChoice {
    /// All columns of the file.
    #[default]
    All,
    /// These columns, if the file has them.
    Only(Vec<Column>),
}

/// A column of a cloud besides its positions.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// Unit normals.
    Normals,
    /// Radii of the points.
    Radii,
    /// RGB colours.
    Colors,
    /// Intensity of the return.
    Intensity,
    /// Class of each point.
    Classification,
    /// The scalar column of this name, whose case and separators do not matter.
    Scalar(String),
}

/// The meaning of one column of a text file, from [`TextColumn::parse`].
#[derive(Clone, Debug, PartialEq)]
pub struct TextColumn(pub(crate) Option<ColumnRole>);

impl ColumnChoice {
    /// Returns true if a column of this role is to be kept.
    pub(crate) fn wants(&self, role: &ColumnRole) -> bool {
        let Self::Only(columns) = self else { return true };
        if let ColumnRole::Position(_) = role {
            return true;
        }
        columns.iter().any(|column| match (column, role) {
            (Column::Normals, ColumnRole::Normal(_))
            | (Column::Radii, ColumnRole::Radius)
            | (Column::Colors, ColumnRole::Color(_))
            | (Column::Intensity, ColumnRole::Intensity)
            | (Column::Classification, ColumnRole::Classification) => true,
            (Column::Scalar(wanted), ColumnRole::Scalar(name)) => {
                plain_name(wanted) == plain_name(name)
            }
            _ => false,
        })
    }

    /// Returns the choice of these columns and of those with these names.
    pub(crate) fn with_names(&self, names: &[&str]) -> Self {
        let Self::Only(columns) = self else { return Self::All };
        let of_pdal = names.iter().filter_map(|name| name_of_pdal(name));
        let named = names.iter().copied().chain(of_pdal).flat_map(|name| {
            let scalar = Column::Scalar(name.to_owned());
            match ColumnRole::from_name(name) {
                Some(ColumnRole::Position(_)) => vec![],
                Some(ColumnRole::Normal(_)) => vec![Column::Normals],
                Some(ColumnRole::Color(_)) => vec![Column::Colors],
                Some(ColumnRole::Radius) => vec![Column::Radii],
                Some(ColumnRole::Intensity) => vec![Column::Intensity],
                // A column of this name may hold labels instead.
                Some(ColumnRole::Classification) => vec![Column::Classification, scalar],
                Some(ColumnRole::Scalar(_)) | None => vec![scalar],
            }
        });
        Self::Only(columns.iter().cloned().chain(named).collect())
    }

    /// Drops the columns of `cloud` that are not chosen.
    pub(crate) fn drop_others(&self, cloud: &mut PointCloud) {
        let drops = |role: ColumnRole| !self.wants(&role);
        if drops(ColumnRole::Normal(0)) {
            cloud.normals = None;
        }
        if drops(ColumnRole::Radius) {
            cloud.radii = None;
        }
        if drops(ColumnRole::Color(0)) {
            cloud.colors = None;
        }
        if drops(ColumnRole::Intensity) {
            cloud.intensity = None;
        }
        if drops(ColumnRole::Classification) {
            cloud.classification = None;
        }
        cloud.scalars.retain(|scalar| {
            scalar.name == STATION || self.wants(&ColumnRole::Scalar(scalar.name.clone()))
        });
    }

    /// Returns true if a scalar column of this name is to be kept.
    pub(crate) fn keeps(&self, scalar: &str) -> bool {
        self.wants(&ColumnRole::Scalar(scalar.into()))
    }

    /// Returns true if the choice names this scalar column.
    pub(crate) fn names(&self, scalar: &str) -> bool {
        *self != Self::All && self.keeps(scalar)
    }
}

impl TextColumn {
    /// Names of the columns that have a meaning.
    pub const NAMES: [&str; 12] = [
        "x",
        "y",
        "z",
        "nx",
        "ny",
        "nz",
        "red",
        "green",
        "blue",
        "radius",
        "intensity",
        "classification",
    ];

    /// Returns the name of a column that has no other meaning.
    pub fn scalar(&self) -> Option<&str> {
        match &self.0 {
            Some(ColumnRole::Scalar(name)) => Some(name),
            _ => None,
        }
    }

    /// Returns the column of this name; `-` and `skip` name one that is not read.
    pub fn parse(name: &str) -> Self {
        match name.trim() {
            "-" | "skip" => Self(None),
            name => Self(ColumnRole::from_names(&[name]).pop()),
        }
    }

    /// Returns the columns of a list separated by commas, as in `x,y,z,-,r,g,b`.
    pub fn parse_list(list: &str) -> Vec<Self> {
        let mut columns: Vec<Self> = list.split(',').map(Self::parse).collect();
        let names = list.split(',').map(str::trim).zip(&columns);
        let names: Vec<&str> =
            names.filter(|(_, column)| column.0.is_some()).map(|(name, _)| name).collect();
        // If several names have one role, all of them together decide which gets it.
        let kept = columns.iter_mut().filter_map(|column| column.0.as_mut());
        kept.zip(ColumnRole::from_names(&names)).for_each(|(role, assigned)| *role = assigned);
        columns
    }
}
