//! Coordinate reference systems (CRS): their unit, their EPSG codes, and where on Earth a position lies.

mod georeference;
mod reproject;
mod wkt;

pub use georeference::georeference;
pub use reproject::{is_in_degrees, move_to_metres, report_degrees};
pub use wkt::short_name;

use std::fmt;

use proj4rs::Proj;
use proj4rs::adaptors::transform_xyz;
use surfel_core::math::DVec3;
use surfel_formats::EpsgCodes;

/// A coordinate reference system that is projected, geographic or geocentric.
#[derive(Debug)]
pub struct CoordinateSystem {
    projection: Proj,
    geographic: Proj,
    epsg: Option<EpsgCodes>,
}

/// A unit of coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Unit {
    /// Lengths in multiples of a metre: 1, or 0.3048 for feet.
    Metres(f64),
    /// Degrees of longitude and latitude.
    Degrees,
    /// Not known; taken as metres.
    #[default]
    Unknown,
}

/// A place on Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Degrees north of the equator.
    pub latitude_deg: f64,
    /// Degrees east of Greenwich.
    pub longitude_deg: f64,
}

/// True north and the zenith at a place, as unit vectors in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compass {
    /// Direction of true north, along the ground.
    pub north: DVec3,
    /// Direction of the zenith.
    pub up: DVec3,
}

/// Geographic coordinates of the World Geodetic System 1984.
const WGS84: &str = "+proj=longlat +datum=WGS84 +no_defs";

/// Degrees of latitude over which the direction of true north is measured: about 10 m.
const NORTH_STEP_DEG: f64 = 1e-4;

impl Unit {
    /// Returns metres per unit; unknown units are taken as metres. Degrees have none.
    pub fn metres(self) -> Option<f64> {
        match self {
            Self::Metres(metres) => Some(metres),
            Self::Unknown => Some(1.0),
            Self::Degrees => None,
        }
    }

    /// Returns the symbol that stands after a number: `m`, `ft` for the feet of all countries, or `°`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Unknown => "m",
            Self::Metres(1.0) => "m",
            Self::Metres(metres) if (metres - 0.3048).abs() < 1e-5 => "ft",
            Self::Metres(_) => "units",
            Self::Degrees => "°",
        }
    }
}

impl fmt::Display for Unit {
    /// Writes the name of the unit in the singular, as in `US survey foot`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Relative difference of numbers that mean the same unit; the feet differ by 2e-6.
        const TOLERANCE: f64 = 2e-7;
        let is = |metres: &f64, known: f64| (metres - known).abs() <= TOLERANCE * known;
        match self {
            Self::Unknown => f.write_str("unknown"),
            Self::Degrees => f.write_str("degree"),
            Self::Metres(metres) if is(metres, 1.0) => f.write_str("metre"),
            Self::Metres(metres) if is(metres, 0.3048) => f.write_str("foot"),
            Self::Metres(metres) if is(metres, 1200.0 / 3937.0) => f.write_str("US survey foot"),
            Self::Metres(metres) => write!(f, "unit of {metres} m"),
        }
    }
}

impl CoordinateSystem {
    /// Parses "EPSG:" and a code, with or without a vertical code after `+`, or WKT. `None` if the system is not known.
    pub fn parse(text: &str) -> Option<Self> {
        let (definition, epsg) = match text.trim().get(..5) {
            Some(start) if start.eq_ignore_ascii_case("EPSG:") => {
                let codes = epsg_codes(&text.trim()[5..])?;
                let known = crs_definitions::from_code(codes.horizontal)?;
                (known.proj4.to_owned(), Some(codes))
            }
            _ => wkt::definition(text)?,
        };
        let projection = Proj::from_proj_string(&definition).ok()?;
        let geographic = Proj::from_proj_string(WGS84).ok()?;
        Some(Self { projection, geographic, epsg })
    }

    /// Returns the EPSG codes, if the system has one.
    pub fn epsg(&self) -> Option<EpsgCodes> {
        self.epsg
    }

    /// Returns the unit of its coordinates.
    pub fn unit(&self) -> Unit {
        if self.projection.is_latlong() {
            return Unit::Degrees;
        }
        Unit::Metres(self.projection.to_meter())
    }

    /// Returns where a position lies; `None` outside of what the system describes.
    pub fn place(&self, position: DVec3) -> Option<Place> {
        let [x, y, z] = match self.projection.is_latlong() {
            true => [position.x.to_radians(), position.y.to_radians(), position.z],
            false => position.to_array(),
        };
        let found = transform_xyz(&self.projection, &self.geographic, x, y, z).ok()?;
        let place =
            Place { longitude_deg: found.0.to_degrees(), latitude_deg: found.1.to_degrees() };
        let is_on_earth = place.latitude_deg.abs() <= 90.0 && place.longitude_deg.abs() <= 360.0;
        is_on_earth.then_some(place)
    }

    /// Returns the directions of true north and the zenith at a position.
    ///
    /// In a projected system true north is not +Y but off the central meridian: the grid converges (1.9 degrees in
    /// Munich's UTM zone).
    pub fn compass(&self, position: DVec3) -> Option<Compass> {
        let place = self.place(position)?;
        if self.projection.is_latlong() {
            return Some(Compass { north: DVec3::Y, up: DVec3::Z });
        }
        let step = if 0.0 < place.latitude_deg { -NORTH_STEP_DEG } else { NORTH_STEP_DEG };
        let start = self.position(place)?;
        let end = self.position(Place { latitude_deg: place.latitude_deg + step, ..place })?;
        let north = (step.signum() * (end - start)).try_normalize()?;
        if !self.projection.is_geocent() {
            return Some(Compass { north: north.with_z(0.0).try_normalize()?, up: DVec3::Z });
        }
        let (sin_lat, cos_lat) = place.latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = place.longitude_deg.to_radians().sin_cos();
        let up = DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat);
        Some(Compass { north, up })
    }

    /// Returns the position of a place on the ellipsoid.
    fn position(&self, place: Place) -> Option<DVec3> {
        let (x, y) = (place.longitude_deg.to_radians(), place.latitude_deg.to_radians());
        let (x, y, z) = transform_xyz(&self.geographic, &self.projection, x, y, 0.0).ok()?;
        Some(DVec3::new(x, y, z)).filter(|position| position.is_finite())
    }
}

/// Parses a horizontal code, and a vertical one after `+`.
fn epsg_codes(text: &str) -> Option<EpsgCodes> {
    let (horizontal, vertical) = match text.split_once('+') {
        Some((horizontal, vertical)) => (horizontal, Some(vertical)),
        None => (text, None),
    };
    let vertical = vertical.map(|code| code.trim().trim_start_matches("EPSG:").parse());
    Some(EpsgCodes {
        horizontal: horizontal.trim().parse().ok()?,
        vertical: vertical.transpose().ok()?,
    })
}

#[cfg(test)]
mod tests {
    //! Known places, units and directions of north.

    use super::*;

    /// Degrees from +Y to true north, clockwise.
    fn north_deg(system: &CoordinateSystem, position: DVec3) -> f64 {
        let north = system.compass(position).unwrap().north;
        north.x.atan2(north.y).to_degrees()
    }

    #[test]
    fn the_frauenkirche_lies_in_munich_and_the_grid_converges_there() {
        let utm = CoordinateSystem::parse("EPSG:25832").unwrap();
        let place = utm.place(DVec3::new(691_607.0, 5_334_760.0, 520.0)).unwrap();
        assert!((place.latitude_deg - 48.1387).abs() < 2e-3, "{place:?}");
        assert!((place.longitude_deg - 11.5736).abs() < 3e-3, "{place:?}");
        // Grid convergence of UTM: longitude from the central meridian times the sine of the latitude.
        let expected = -(place.longitude_deg - 9.0) * place.latitude_deg.to_radians().sin();
        let found = north_deg(&utm, DVec3::new(691_607.0, 5_334_760.0, 520.0));
        assert!((found - expected).abs() < 0.01 && found < -1.9, "{found} {expected}");
        assert!(north_deg(&utm, DVec3::new(500_000.0, 5_334_760.0, 520.0)).abs() < 1e-6);
    }

    #[test]
    fn units_are_those_of_the_system() {
        let unit = |text: &str| CoordinateSystem::parse(text).map(|system| system.unit());
        assert_eq!(unit("EPSG:2154+5720"), Some(Unit::Metres(1.0)));
        assert_eq!(unit("epsg:2261").unwrap().symbol(), "ft");
        assert_eq!(unit("EPSG:4326"), Some(Unit::Degrees));
        assert_eq!(unit("EPSG:4326").unwrap().metres(), None);
        let name = |text: &str| unit(text).unwrap_or_default().to_string();
        assert_eq!(["EPSG:25832", "EPSG:4326", "grid"].map(name), ["metre", "degree", "unknown"]);
        assert_eq!(["EPSG:2261", "EPSG:2256"].map(name), ["US survey foot", "foot"]);
        assert_eq!(Unit::Metres(0.9144).to_string(), "unit of 0.9144 m");
        for unknown in ["", "EPSG:", "EPSG:99999", "EPSG:abc", "Local grid", "EPSG:2154+x", "é"] {
            assert_eq!(unit(unknown), None, "{unknown}");
        }
    }

    #[test]
    fn geocentric_coordinates_have_a_zenith() {
        let system = CoordinateSystem::parse("EPSG:4978").unwrap();
        // Austin, Texas.
        let position = DVec3::new(-741_500.0, -5_462_500.0, 3_198_200.0);
        let place = system.place(position).unwrap();
        assert!((place.latitude_deg - 30.3).abs() < 0.1, "{place:?}");
        assert!((place.longitude_deg + 97.73).abs() < 0.1, "{place:?}");
        let Compass { north, up } = system.compass(position).unwrap();
        assert!(up.dot(position.normalize()) > 0.999 && north.dot(up).abs() < 1e-4);
        assert!(0.0 < north.z);
    }

    #[test]
    fn positions_far_outside_have_no_place() {
        let utm = CoordinateSystem::parse("EPSG:25832").unwrap();
        for position in [DVec3::splat(1e12), DVec3::splat(f64::NAN)] {
            assert!(utm.compass(position).is_none_or(|c| c.north.is_finite()), "{position}");
        }
    }
}
