//! A street: ground, a house with recesses, a head, a cow, poles with a wire, and a tree.

use super::named_scene::NamedScene;
use crate::classes::{BUILDING, HIGH_VEGETATION, TRANSMISSION_TOWER};
use crate::instruments::TerrestrialSurvey;
use crate::instruments::{AirborneLidar, FlightLine, Scanner, SpinningLidar, Station};
use crate::parts::assembly::{Assembly, Solid};
use crate::parts::body::{Cow, Head};
use crate::parts::house::House;
use crate::parts::street_ground::StreetGround;
use crate::parts::tree::{Crown, CrownShape};
use crate::parts::wire::Wire;
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

const POLE_HEIGHT: f64 = 6.5;
const POLES: [DVec3; 2] = [DVec3::new(-13.0, -4.2, 0.0), DVec3::new(11.0, -4.2, 0.0)];
const TREE: DVec3 = DVec3::new(9.5, 5.5, 0.0);

/// Returns the scene. The street runs along X.
pub fn scene() -> NamedScene {
    let mut scene = NamedScene::default();
    let base = DVec3::new(-3.0, 10.0, -0.3);
    let house = House { base, half: (5.5, 4.0), wall_height: 5.9, roof_height: 2.6 };
    scene.add("house", house);
    let block = |center, half| vec![Solid::block(center, half)];
    let stone = |solids| Assembly { solids, blend: 0.0, color: Vec3::splat(0.6), class: BUILDING };
    scene.add("plinth", stone(block([-6.0, -5.0, 0.5], [0.4, 0.4, 0.55])));
    scene.add("head", Head::new(DVec3::new(-6.0, -5.0, 1.05)));
    scene.add("cow", Cow::new(DVec3::new(4.0, -5.5, 0.02)));
    for foot in POLES {
        let top = foot + POLE_HEIGHT * DVec3::Z;
        let solids = vec![Solid::capsule(foot.into(), top.into(), 0.11)];
        scene.add(
            "pole",
            Assembly { solids, blend: 0.0, color: Vec3::splat(0.45), class: TRANSMISSION_TOWER },
        );
    }
    for side in [-0.25, 0.25] {
        let [from, to] = POLES.map(|foot| foot + DVec3::new(0.0, side, POLE_HEIGHT - 0.1));
        scene.add("wire", Wire::new(from, to, 0.5, 0.012));
    }
    let trunk = vec![
        Solid::capsule(TREE.into(), (TREE + 3.2 * DVec3::Z).into(), 0.17),
        Solid::capsule([9.5, 5.5, 2.0], [10.5, 5.9, 4.2], 0.08),
        Solid::capsule([9.5, 5.5, 2.3], [8.6, 5.0, 4.4], 0.08),
        Solid::capsule([9.5, 5.5, 2.6], [9.4, 6.4, 4.6], 0.07),
    ];
    let bark = Vec3::new(0.36, 0.29, 0.22);
    scene.add("trunk", Assembly { solids: trunk, blend: 0.1, color: bark, class: HIGH_VEGETATION });
    let center = TREE + 4.4 * DVec3::Z;
    let half = DVec3::new(2.1, 2.1, 1.9);
    let crown =
        Crown { shape: CrownShape::Ellipsoid, center, half, cell: 0.2, fill: 0.35, seed: 4 };
    scene.add("tree", crown);
    scene.add("ground", StreetGround { half_road: 3.0, radius: 32.0 });
    scene.look([-9.0, -14.0, 3.2], [0.0, 2.0, 2.2]);
    scene.look([14.0, -9.0, 1.8], [2.0, 2.0, 2.6]);
    scene.look([-16.0, 1.5, 2.0], [4.0, 2.0, 2.4]);
    scene
}

/// Returns a survey from three stations with an angle of `step_deg` between rays.
pub fn terrestrial(step_deg: f64) -> TerrestrialSurvey {
    let step_rad = step_deg.to_radians();
    let scanner = Scanner { step_rad, with_grid: true, ..Scanner::default() };
    let positions = [[-10.0, -1.0, 1.6], [6.5, 1.0, 1.6], [-1.0, -9.5, 1.7]];
    let stations = positions.map(|position| Station::full_dome(position.into()));
    TerrestrialSurvey { scanner, stations: stations.to_vec() }
}

/// Returns a spinning scanner on a car that drives along the road.
pub fn spinning() -> SpinningLidar {
    let path = vec![DVec3::new(-12.0, -1.2, 1.8), DVec3::new(12.0, -1.2, 1.8)];
    SpinningLidar { path, speed: 12.0, ..SpinningLidar::default() }
}

/// Returns one revolution of the spinning scanner on the car, which stands.
pub fn standing() -> SpinningLidar {
    SpinningLidar { path: vec![DVec3::new(0.0, -1.2, 1.8)], n_azimuths: 2048, ..spinning() }
}

/// Returns two flight lines across the street.
pub fn airborne() -> AirborneLidar {
    let line =
        |x: f64| FlightLine { from: DVec3::new(x, -35.0, 300.0), to: DVec3::new(x, 35.0, 300.0) };
    AirborneLidar { lines: vec![line(-60.0), line(55.0)], ..AirborneLidar::default() }
}

#[cfg(test)]
mod tests {
    //! The street and its scans.

    use super::*;
    use crate::instruments::{Instrument, SpinningLidar, TerrestrialSurvey};
    use crate::scenes::named_scene::checks;
    use surfel_core::math::Vec3;
    use surfel_core::progress::NoProgress;
    use surfel_core::scene::find_station;

    #[test]
    fn the_renderer_finds_the_station_of_a_scan() {
        let scene = scene().sdf;
        let standing = spinning().path[0];
        let spinning = SpinningLidar { path: vec![standing], ..SpinningLidar::default() };
        let survey = terrestrial(0.5);
        let positions = survey.stations.iter().map(|station| station.position);
        let surveys = survey.stations.iter().map(|station| {
            let stations = vec![station.clone()];
            TerrestrialSurvey { stations, scanner: survey.scanner.clone() }
        });
        let swept = (spinning.scan(&scene, &NoProgress).unwrap(), standing);
        let scans = surveys.map(|survey| survey.scan(&scene, &NoProgress).unwrap()).zip(positions);
        for (mut scan, position) in scans.chain([swept]) {
            // The file states no station.
            scan.stations.clear();
            scan.origin -= position;
            assert!(find_station(&scan, Vec3::Z).is_some(), "{position}");
        }
    }

    #[test]
    fn every_kind_of_object_is_seen_and_distances_are_never_too_long() {
        checks::check(&scene());
    }

    #[test]
    fn a_scan_has_every_class() {
        let cloud = terrestrial(0.5).scan(&scene().sdf, &NoProgress).unwrap();
        let classes = cloud.classification.unwrap();
        for class in [1, 2, 5, 6, 14, 15] {
            assert!(classes.contains(&class), "class {class}");
        }
    }
}
