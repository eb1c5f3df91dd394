//! The meaning of columns, from the names that programs give them.

/// A column with a meaning of its own, for which a cloud has a place besides its scalars.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnownColumn {
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
}

/// Names of longitudes, in degrees.
const LONGITUDES: [&str; 4] = ["longitude", "lon", "lng", "long"];
/// Names of columns of labels.
const LABELS: [&str; 4] = ["label", "labels", "class", "classification"];
/// Names of latitudes, in degrees.
const LATITUDES: [&str; 2] = ["latitude", "lat"];

impl KnownColumn {
    /// All columns with a meaning.
    pub const ALL: [Self; 12] = [
        Self::Position(0),
        Self::Position(1),
        Self::Position(2),
        Self::Normal(0),
        Self::Normal(1),
        Self::Normal(2),
        Self::Color(0),
        Self::Color(1),
        Self::Color(2),
        Self::Radius,
        Self::Intensity,
        Self::Classification,
    ];

    /// Returns the column with one of the usual names; case, separators and a unit in brackets do not matter.
    pub fn from_name(name: &str) -> Option<Self> {
        // Without letters that are not ASCII: in text of another encoding they are others.
        let mut plain = plain_name(without_unit(name));
        plain.retain(|letter| letter.is_ascii());
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
            // `Höhe`.
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
                "class" | "classification" => Self::Classification,
                _ => return None,
            },
        })
    }

    /// Returns the name that users see.
    pub fn name(self) -> &'static str {
        match self {
            Self::Position(axis) => ["x", "y", "z"][axis],
            Self::Normal(axis) => ["nx", "ny", "nz"][axis],
            Self::Color(channel) => ["red", "green", "blue"][channel],
            Self::Radius => "radius",
            Self::Intensity => "intensity",
            Self::Classification => "classification",
        }
    }

    /// Returns true for the name of a column of longitudes.
    pub fn is_longitude(name: &str) -> bool {
        LONGITUDES.contains(&plain_name(without_unit(name)).as_str())
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

/// Returns true for the name of a scalar column of labels: numbers of segments, objects or classes other than those of
/// ASPRS, of which none is more than another.
pub fn is_label(name: &str) -> bool {
    let plain = plain_name(name);
    LABELS.contains(&plain.strip_prefix("scalar").unwrap_or(&plain))
}

/// Columns of LAS files by their names in PDAL, where these are other words.
const NAMES_OF_PDAL: [(&str, &str); 3] =
    [("scananglerank", "scan_angle"), ("infrared", "nir"), ("scanchannel", "scanner_channel")];

/// Returns the name of the column of LAS files that has this name in PDAL, if that is another word.
pub fn name_of_pdal(name: &str) -> Option<&'static str> {
    let plain = plain_name(name);
    NAMES_OF_PDAL.iter().find(|(of_pdal, _)| *of_pdal == plain).map(|(_, name)| *name)
}

/// Returns the letters and digits of a name in lower case, since programs separate words in different ways.
pub fn plain_name(name: &str) -> String {
    name.chars().filter(|letter| letter.is_alphanumeric()).collect::<String>().to_lowercase()
}

#[cfg(test)]
mod tests {
    //! Names that mean coordinates, normals, colours and so on.

    use super::*;

    #[test]
    fn usual_names_have_a_meaning() {
        for (name, meaning) in [
            ("//X", Some(KnownColumn::Position(0))),
            ("normal_z", Some(KnownColumn::Normal(2))),
            ("diffuse_green", Some(KnownColumn::Color(1))),
            ("scalar_Intensity", Some(KnownColumn::Intensity)),
            ("Longitude", Some(KnownColumn::Position(0))),
            ("lat", Some(KnownColumn::Position(1))),
            ("Easting (m)", Some(KnownColumn::Position(0))),
            ("Y[US survey ft] ", Some(KnownColumn::Position(1))),
            ("Gr\u{fc}n", Some(KnownColumn::Color(1))),
            ("(m)", None),
            ("[z]x", None),
            ("Scalar field", None),
            ("scalar_Label", None),
            ("f_rest_0", None),
        ] {
            assert_eq!(KnownColumn::from_name(name), meaning, "{name}");
        }
        assert!(KnownColumn::is_longitude("Lon") && !KnownColumn::is_longitude("x"));
        assert!(is_label("scalar_Label") && is_label("class") && !is_label("labelled"));
        let named = KnownColumn::ALL.map(|column| KnownColumn::from_name(column.name()));
        assert_eq!(named, KnownColumn::ALL.map(Some));
    }
}
