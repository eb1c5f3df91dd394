//! What the columns of a file mean, by the names that programs give them.

/// The meaning of a column.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Role {
    /// 0, 1, 2: x, y, z.
    Position(usize),
    Normal(usize),
    /// 0, 1, 2: red, green, blue.
    Color(usize),
    Radius,
    Intensity,
    Classification,
    Scalar(String),
}

impl Role {
    /// The meaning of a name, if it is one of the usual ones; spelling of case and separators is free.
    pub fn of_name(name: &str) -> Option<Self> {
        let plain: String =
            name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase();
        Some(match plain.as_str() {
            "x" | "px" | "posx" | "xcoordinate" | "easting" => Self::Position(0),
            "y" | "py" | "posy" | "ycoordinate" | "northing" => Self::Position(1),
            "z" | "pz" | "posz" | "zcoordinate" | "elevation" | "height" => Self::Position(2),
            "nx" | "normalx" => Self::Normal(0),
            "ny" | "normaly" => Self::Normal(1),
            "nz" | "normalz" => Self::Normal(2),
            "r" | "red" | "diffusered" => Self::Color(0),
            "g" | "green" | "diffusegreen" => Self::Color(1),
            "b" | "blue" | "diffuseblue" => Self::Color(2),
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

    /// The meanings of columns by their names: a role is given to one of them, the others are scalars.
    ///
    /// Of several names of a role its own, such as `z`, goes before synonyms, such as `height`, and
    /// then the first before the others.
    pub fn of_names(names: &[&str]) -> Vec<Self> {
        let scalar = |name: &str| Self::Scalar(name.into());
        let wished: Vec<Self> =
            names.iter().map(|name| Self::of_name(name).unwrap_or_else(|| scalar(name))).collect();
        let has_role = |role: &Self| {
            let mut columns = (0..names.len()).filter(|i| wished[*i] == *role);
            let first = columns.clone().next();
            columns.find(|i| names[*i].trim().eq_ignore_ascii_case(role.name())).or(first)
        };
        let columns = wished.iter().zip(names).enumerate();
        let given =
            columns.map(
                |(i, (role, name))| {
                    if has_role(role) == Some(i) { role.clone() } else { scalar(name) }
                },
            );
        given.collect()
    }

    /// The name that users see.
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

    /// True for the opacity of a colour, which a cloud does not keep.
    pub fn is_alpha(name: &str) -> bool {
        ["alpha", "a", "diffuse_alpha"].contains(&name.to_lowercase().as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_names_are_known() {
        assert_eq!(Role::of_name("//X"), Some(Role::Position(0)));
        assert_eq!(Role::of_name("normal_z"), Some(Role::Normal(2)));
        assert_eq!(Role::of_name("diffuse_green"), Some(Role::Color(1)));
        assert_eq!(Role::of_name("scalar_Intensity"), Some(Role::Intensity));
        assert_eq!(Role::of_name("Scalar field"), None);
        assert_eq!(Role::of_name("f_rest_0"), None);
    }

    #[test]
    fn a_role_goes_to_its_own_name_and_the_others_are_kept_as_scalars() {
        let names = ["x", "y", "height", "Z", "elevation", "time"];
        let scalar = |name: &str| Role::Scalar(name.into());
        let expected = [
            Role::Position(0),
            Role::Position(1),
            scalar("height"),
            Role::Position(2),
            scalar("elevation"),
            scalar("time"),
        ];
        assert_eq!(Role::of_names(&names), expected);
        assert_eq!(Role::of_names(&["label", "class"]), [Role::Classification, scalar("class")]);
    }
}
