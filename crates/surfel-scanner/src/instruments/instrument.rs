//! The interface of all instruments.

use crate::sdf::SdfScene;
use surfel_core::Error;
use surfel_core::Result;
use surfel_core::math::DVec3;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;

/// An instrument with the positions that it measures from.
pub trait Instrument: Sync {
    /// Measures `scene`.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Setting`] for a property out of range and [`Error::Cancelled`] if `progress` is cancelled.
    fn scan(&self, scene: &SdfScene, progress: &dyn Progress) -> Result<PointCloud>;

    /// Returns positions from which the instrument sends pulses toward `point`, whether or not something is in the way.
    fn viewpoints(&self, point: DVec3) -> Vec<DVec3>;
}

/// Checks the number of positions that an instrument measures from, which points hold in 16 bits, and that of its rays.
pub fn check_size(n_positions: usize, n_rays: f64) -> Result<()> {
    const MAX_POSITIONS: usize = u16::MAX as usize - 1;
    const MAX_RAYS: f64 = 4_294_967_296.0;
    if !(1..=MAX_POSITIONS).contains(&n_positions) {
        let (found, expected) = (n_positions.to_string(), "from 1 to 65534");
        return Err(Error::Setting { name: "number of positions", found, expected });
    }
    if MAX_RAYS < n_rays || n_rays.is_nan() {
        let (found, expected) = (n_rays.to_string(), "at most 4294967296, by longer steps");
        return Err(Error::Setting { name: "number of rays", found, expected });
    }
    Ok(())
}

/// Checks a property that must be a positive finite number.
pub fn check_positive(name: &'static str, found: f64) -> Result<()> {
    check(0.0 < found && found.is_finite(), name, found, "a positive number")
}

/// Checks a property that must be zero or a positive finite number.
pub fn check_not_negative(name: &'static str, found: f64) -> Result<()> {
    check(0.0 <= found && found.is_finite(), name, found, "0 or a positive number")
}

/// Returns the error of a property that is not as expected.
pub fn check(is_valid: bool, name: &'static str, found: f64, expected: &'static str) -> Result<()> {
    if is_valid { Ok(()) } else { Err(Error::Setting { name, found: found.to_string(), expected }) }
}

#[cfg(test)]
mod tests {
    //! Properties out of range.

    use super::super::{AirborneLidar, DepthCamera, FlightLine, Scanner, SpinningLidar, Station};
    use super::*;
    use surfel_core::progress::NoProgress;

    /// Asserts that each instrument is refused because of the property that is named beside it.
    fn assert_refused<I: Instrument>(cases: impl IntoIterator<Item = (&'static str, I)>) {
        for (expected, instrument) in cases {
            match instrument.scan(&SdfScene::default(), &NoProgress) {
                Err(Error::Setting { name, .. }) => assert_eq!(name, expected),
                other => panic!("{expected}: {:?}", other.map(|cloud| cloud.len())),
            }
        }
    }

    #[test]
    fn properties_out_of_range_are_refused() {
        let stations = vec![Station::full_dome(DVec3::ZERO)];
        let survey =
            |scanner| super::super::TerrestrialSurvey { scanner, stations: stations.clone() };
        assert_refused([
            ("step_rad", survey(Scanner { step_rad: 0.0, ..Scanner::default() })),
            ("range_noise", survey(Scanner { range_noise: -1.0, ..Scanner::default() })),
            ("max_range", survey(Scanner { max_range: f64::NAN, ..Scanner::default() })),
        ]);
        let path = vec![DVec3::ZERO];
        let spinning = SpinningLidar { path, ..SpinningLidar::default() };
        assert_refused([
            ("number of positions", SpinningLidar::default()),
            ("range_noise", SpinningLidar { range_noise: f64::NAN, ..spinning.clone() }),
            ("speed", SpinningLidar { speed: 0.0, ..spinning.clone() }),
        ]);
        let level = FlightLine { from: DVec3::Z, to: DVec3::new(1.0, 0.0, 1.0) };
        let airborne = |line| AirborneLidar { lines: vec![line], ..AirborneLidar::default() };
        assert_refused([
            ("height of a flight line", airborne(FlightLine { to: DVec3::ZERO, ..level })),
            ("length of a flight line", airborne(FlightLine { to: level.from, ..level })),
            ("range_noise", AirborneLidar { range_noise: -0.1, ..airborne(level) }),
        ]);
        let camera = |target| {
            let poses = vec![(DVec3::ZERO, target)];
            DepthCamera { poses, ..DepthCamera::default() }
        };
        assert_refused([
            ("direction of a pose", camera(DVec3::NEG_Z)),
            ("direction of a pose", camera(DVec3::ZERO)),
            ("noise_at_1_m", DepthCamera { noise_at_1_m: -1.0, ..camera(DVec3::X) }),
            ("step_at_1_m", DepthCamera { step_at_1_m: f64::NAN, ..camera(DVec3::X) }),
            ("view_angle_rad", DepthCamera { view_angle_rad: 4.0, ..camera(DVec3::X) }),
        ]);
    }
}
