//! The sun at a date: where it stands over the place of a scene (Reda and Andreas, "Solar position algorithm for solar
//! radiation applications", 2003).

use super::loaded::LoadedScene;
use super::plan::coordinate_system;
use crate::crs::{Compass, Place};
use crate::description::{Invalid, LightKind, SceneDescription};
use chrono::{DateTime, FixedOffset};
use solar_positioning::{Location, RefractionCorrection, SolarPositions, delta_t};
use surfel_core::math::{DVec3, Vec3};
use surfel_core::progress::Progress;
use surfel_core::scene::north;

/// Writes azimuth and elevation of the sun into a description that gives its date. `position` is the middle of the scene.
///
/// # Errors
///
/// Fails if the place is not known, and if the sun is below the horizon and no other light is left.
pub fn stand_sun_at_date(
    scene: &LoadedScene,
    description: &mut SceneDescription,
    position: DVec3,
    up: Vec3,
    progress: &dyn Progress,
) -> Result<(), Invalid> {
    let Some(date) = description.sun.date.take() else { return Ok(()) };
    if !description.light.has(LightKind::Sun) {
        progress.warning("no effect: the lights have no sun", &["sun", "light"]);
        return Ok(());
    }
    let system = coordinate_system(scene, description);
    let place = description.world.place.or_else(|| system.as_ref()?.place(position));
    let Some(place) = place else {
        let advice = "no file states where on Earth it lies; add its latitude and longitude, or the EPSG code of its coordinates [place, crs]";
        return Err(Invalid::at("sun", advice));
    };
    let by_axes = Compass { north: north(up).as_dvec3(), up: up.as_dvec3() };
    let compass = system.and_then(|system| system.compass(position)).unwrap_or(by_axes);
    let (azimuth_deg, elevation_deg) = sun_angles_deg(place, &date)
        .ok_or_else(|| Invalid::at("sun", "the position of the sun is not known for this date"))?;
    let line = format!(
        "sun at azimuth {azimuth_deg:.1} degrees from true north, elevation {elevation_deg:.1} degrees, at {:.4},{:.4} on {}",
        place.latitude_deg,
        place.longitude_deg,
        date.format("%Y-%m-%d %H:%M %:z")
    );
    progress.choice(&line, &["sun", "place", "crs"]);
    if elevation_deg < 0.0 {
        return without_sun(description, elevation_deg, progress);
    }
    let direction = direction(&compass, azimuth_deg, elevation_deg);
    let (north, up) = (by_axes.north, by_axes.up);
    let azimuth = direction.dot(north.cross(up)).atan2(direction.dot(north)).to_degrees();
    description.sun.azimuth = Some(azimuth.rem_euclid(360.0));
    description.sun.elevation = Some(direction.dot(up).clamp(-1.0, 1.0).asin().to_degrees());
    Ok(())
}

/// Leaves out the sun, which would light everything from below.
fn without_sun(
    description: &mut SceneDescription,
    elevation_deg: f64,
    progress: &dyn Progress,
) -> Result<(), Invalid> {
    let mut kinds = description.light.kinds();
    kinds.retain(|kind| *kind != LightKind::Sun);
    let below = format!("the sun is {:.1} degrees below the horizon", -elevation_deg);
    if kinds.is_empty() && description.light.environment.is_none() {
        let advice = "choose another time, or add another light, as in sun,sky [light]";
        return Err(Invalid::at("sun", format!("{below}; {advice}")));
    }
    progress.warning(&format!("{below}: it gives no light"), &["sun"]);
    description.light.light = Some(kinds);
    Ok(())
}

/// Returns the direction of true azimuth and elevation, in world coordinates.
fn direction(compass: &Compass, azimuth_deg: f64, elevation_deg: f64) -> DVec3 {
    let east = compass.north.cross(compass.up);
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    let (sin_elevation, cos_elevation) = elevation_deg.to_radians().sin_cos();
    cos_elevation * (cos * compass.north + sin * east) + sin_elevation * compass.up
}

/// Returns azimuth from true north, clockwise, and elevation above the horizon, with the refraction of usual air.
fn sun_angles_deg(place: Place, date: &DateTime<FixedOffset>) -> Option<(f64, f64)> {
    // Universal time lags behind that of the sun's motion: the Earth slows down.
    let delta_t = delta_t::estimate_from_date_like(&date.date_naive()).ok()?;
    let location = Location { latitude: place.latitude_deg, longitude: place.longitude_deg };
    let air = Some(RefractionCorrection::standard());
    let sun = SolarPositions::new().at(date, location, 0.0, delta_t, air).ok()?;
    Some((sun.azimuth(), sun.elevation_angle()))
}

#[cfg(test)]
mod tests {
    //! Positions of the sun as almanacs have them.

    use super::*;

    fn angles(place: (f64, f64), date: &str) -> (f64, f64) {
        let (latitude_deg, longitude_deg) = place;
        let date = DateTime::parse_from_rfc3339(date).unwrap();
        sun_angles_deg(Place { latitude_deg, longitude_deg }, &date).unwrap()
    }

    #[test]
    fn the_example_of_the_algorithm_comes_out() {
        // Reda and Andreas (2003), table A5.1: azimuth 194.34024, zenith 50.11162.
        let (azimuth, elevation) = angles((39.742476, -105.1786), "2003-10-17T12:30:30-07:00");
        assert!((azimuth - 194.340).abs() < 0.01, "{azimuth}");
        assert!((90.0 - elevation - 50.112).abs() < 0.02, "{elevation}");
    }

    #[test]
    fn at_noon_the_sun_is_in_the_south_and_high_at_the_solstice() {
        let (azimuth, elevation) = angles((48.14, 11.58), "2026-06-21T13:16:00+02:00");
        assert!((azimuth - 180.0).abs() < 1.0, "{azimuth}");
        assert!((elevation - (90.0 - 48.14 + 23.44)).abs() < 0.1, "{elevation}");
        assert!(angles((48.14, 11.58), "2026-06-21T00:00:00Z").1 < 0.0);
    }

    #[test]
    fn azimuth_is_turned_by_the_convergence_of_the_grid() {
        let turned = Compass { north: DVec3::new(-0.0333, 0.9994, 0.0).normalize(), up: DVec3::Z };
        let south = direction(&turned, 180.0, 0.0);
        // True south is east of grid south.
        assert!((south.x - 0.0333).abs() < 1e-3 && south.y < -0.99, "{south}");
    }
}
