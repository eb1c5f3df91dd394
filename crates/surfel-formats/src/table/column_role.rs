//! The meaning of a file's columns, from the names that programs give them.

use surfel_core::points::KnownColumn;

/// The meaning of a column.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum ColumnRole {
    /// Coordinate on an axis; 0, 1, 2 are x, y, z.
    Position(usize),
    /// Component of the normal on an axis.
    Normal(usize),
    /// Colour channel; 0, 1, 2 are red, green, blue.
    Color(usize),
    /// Radius of the point.
    Radius,
    /// Intensity of the return.
    Intensity,
    /// Class of the point.
    Classification,
    /// Any other number, with its name.
    Scalar(String),
}

/// Names of the axes in lists of survey points.
const SURVEY_AXES: [&str; 3] = ["e", "n", "h"];

impl ColumnRole {
    /// Returns the role of a column with one of the usual names; case, separators and a unit in brackets do not matter.
    pub fn from_name(name: &str) -> Option<Self> {
        KnownColumn::from_name(name).map(|column| match column {
            KnownColumn::Position(axis) => Self::Position(axis),
            KnownColumn::Normal(axis) => Self::Normal(axis),
            KnownColumn::Color(channel) => Self::Color(channel),
            KnownColumn::Radius => Self::Radius,
            KnownColumn::Intensity => Self::Intensity,
            KnownColumn::Classification => Self::Classification,
        })
    }

    /// Returns the roles of columns with these names. Each role goes to one column, and further columns of the role are
    /// scalars.
    ///
    /// The role's own name, such as `z`, takes precedence over synonyms, such as `height`, and an earlier synonym over
    /// a later one. E, N and H are axes if no other column is the axis.
    pub fn from_names(names: &[&str]) -> Vec<Self> {
        let scalar = |name: &str| Self::Scalar(name.into());
        let candidates: Vec<Self> = names
            .iter()
            .map(|name| Self::from_name(name).unwrap_or_else(|| scalar(name)))
            .collect();
        let column_with_role = |role: &Self| {
            let mut columns = (0..names.len()).filter(|i| candidates[*i] == *role);
            let first = columns.clone().next();
            columns.find(|i| names[*i].trim().eq_ignore_ascii_case(role.name())).or(first)
        };
        let columns = candidates.iter().zip(names).enumerate();
        let assigned = columns.map(|(i, (role, name))| {
            if column_with_role(role) == Some(i) { role.clone() } else { scalar(name) }
        });
        let mut roles: Vec<Self> = assigned.collect();
        for (axis, name) in SURVEY_AXES.iter().enumerate() {
            let column = names.iter().position(|column| column.trim().eq_ignore_ascii_case(name));
            if let Some(column) = column.filter(|_| !roles.contains(&Self::Position(axis))) {
                roles[column] = Self::Position(axis);
            }
        }
        roles
    }

    /// Returns the name that users see.
    pub fn name(&self) -> &str {
        match self {
            Self::Position(axis) => ["x", "y", "z"][*axis],
            Self::Normal(axis) => ["nx", "ny", "nz"][*axis],
            Self::Color(channel) => ["red", "green", "blue"][*channel],
            Self::Radius => "radius",
            Self::Intensity => "intensity",
            Self::Classification => "classification",
            Self::Scalar(name) => name,
        }
    }

    /// Returns true for the names of a colour's opacity, which a cloud does not keep.
    pub fn is_alpha(name: &str) -> bool {
        ["alpha", "a", "af", "diffuse_alpha"].contains(&name.to_lowercase().as_str())
    }
}

#[cfg(test)]
mod tests {
    //! Several columns of one meaning.

    use super::*;

    #[test]
    fn role_goes_to_its_own_name_and_synonyms_become_scalars() {
        let names = ["x", "y", "height", "Z", "elevation", "time"];
        let scalar = |name: &str| ColumnRole::Scalar(name.into());
        let expected = [
            ColumnRole::Position(0),
            ColumnRole::Position(1),
            scalar("height"),
            ColumnRole::Position(2),
            scalar("elevation"),
            scalar("time"),
        ];
        assert_eq!(ColumnRole::from_names(&names), expected);
        assert_eq!(
            ColumnRole::from_names(&["class", "classification", "label"]),
            [scalar("class"), ColumnRole::Classification, scalar("label")]
        );
    }
}
