//! The meaning of a file's columns, from the names that programs give them.

/// The meaning of a column.
#[derive(Clone, Debug, PartialEq)]
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

/// Names of longitudes, in degrees.
const LONGITUDES: [&str; 4] = ["longitude", "lon", "lng", "long"];
/// Names of the axes in lists of survey points.
const SURVEY_AXES: [&str; 3] = ["e", "n", "h"];
/// Names of latitudes, in degrees.
const LATITUDES: [&str; 2] = ["latitude", "lat"];

impl ColumnRole {
    /// Returns the role of a column with one of the usual names; case, separators and a unit in brackets do not matter.
    pub fn from_name(name: &str) -> Option<Self> {
        let plain = plain_name(without_unit(name));
        Some(match plain.as_str() {
            "x" | "px" | "posx" | "xcoordinate" | "easting" | "east" | "rechtswert" | "ostwert" => {
                Self::Position(0)
            }
            "y" | "py" | "posy" | "ycoordinate" | "northing" | "north" | "hochwert"
            | "nordwert" => Self::Position(1),
            "z" | "pz" | "posz" | "zcoordinate" | "elevation" | "elev" | "height" | "hoehe"
            | "altitude" | "alt" => Self::Position(2),
            name if LONGITUDES.contains(&name) => Self::Position(0),
            name if LATITUDES.contains(&name) => Self::Position(1),
            // `Höhe` in any encoding, without the letter that is not ASCII.
            "hhe" => Self::Position(2),
            // `Grün`.
            "grn" => Self::Color(1),
            "nx" | "normalx" => Self::Normal(0),
            "ny" | "normaly" => Self::Normal(1),
            "nz" | "normalz" => Self::Normal(2),
            "r" | "red" | "diffusered" | "rot" | "rf" => Self::Color(0),
            "g" | "green" | "diffusegreen" | "gruen" | "gf" => Self::Color(1),
            "b" | "blue" | "diffuseblue" | "blau" | "bf" => Self::Color(2),
            "i" => Self::Intensity,
            // CloudCompare writes `scalar_` before the names of its scalar fields.
            _ => match plain.strip_prefix("scalar").unwrap_or(&plain) {
                "radius" | "radii" => Self::Radius,
                "intensity" | "reflectance" => Self::Intensity,
                "class" | "classification" | "label" => Self::Classification,
                _ => return None,
            },
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

    /// True for the name of a column of longitudes.
    pub fn is_longitude(name: &str) -> bool {
        LONGITUDES.contains(&plain_name(without_unit(name)).as_str())
    }

    /// Returns true for the names of a colour's opacity, which a cloud does not keep.
    pub fn is_alpha(name: &str) -> bool {
        ["alpha", "a", "af", "diffuse_alpha"].contains(&name.to_lowercase().as_str())
    }
}

/// Returns a name without a unit behind it, as in `Easting (m)` and `z [ft]`.
fn without_unit(name: &str) -> &str {
    let trimmed = name.trim_end();
    let unit = [('(', ')'), ('[', ']')].into_iter().find_map(|(opening, closing)| {
        trimmed.strip_suffix(closing).and_then(|start| start.rfind(opening))
    });
    unit.map_or(name, |unit| &name[..unit])
}

/// Returns the letters and digits of a name in lower case, since programs separate words in different ways.
pub(crate) fn plain_name(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase()
}

#[cfg(test)]
mod tests {
    //! Column names that mean coordinates, normals, colours and so on, and several columns of one meaning.

    use super::*;

    #[test]
    fn usual_names_have_a_role() {
        assert_eq!(ColumnRole::from_name("//X"), Some(ColumnRole::Position(0)));
        assert_eq!(ColumnRole::from_name("normal_z"), Some(ColumnRole::Normal(2)));
        assert_eq!(ColumnRole::from_name("diffuse_green"), Some(ColumnRole::Color(1)));
        assert_eq!(ColumnRole::from_name("scalar_Intensity"), Some(ColumnRole::Intensity));
        assert_eq!(ColumnRole::from_name("Longitude"), Some(ColumnRole::Position(0)));
        assert_eq!(ColumnRole::from_name("lat"), Some(ColumnRole::Position(1)));
        assert!(ColumnRole::is_longitude("Lon") && !ColumnRole::is_longitude("x"));
        assert_eq!(ColumnRole::from_name("Easting (m)"), Some(ColumnRole::Position(0)));
        assert_eq!(ColumnRole::from_name("Y[US survey ft] "), Some(ColumnRole::Position(1)));
        assert_eq!(ColumnRole::from_name("Gr\u{fc}n"), Some(ColumnRole::Color(1)));
        assert_eq!(ColumnRole::from_name("(m)"), None);
        assert_eq!(ColumnRole::from_name("[z]x"), None);
        assert_eq!(ColumnRole::from_name("Scalar field"), None);
        assert_eq!(ColumnRole::from_name("f_rest_0"), None);
    }

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
            ColumnRole::from_names(&["label", "class"]),
            [ColumnRole::Classification, scalar("class")]
        );
    }
}
