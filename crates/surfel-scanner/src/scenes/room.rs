//! A room with furniture.

use super::named_scene::NamedScene;
use crate::instruments::{DepthCamera, Scanner, Station, TerrestrialSurvey};
use crate::parts::furniture::{chair, lamp, shelves, sofa, table};
use crate::parts::room_shell::RoomShell;
use surfel_core::math::DVec3;

/// Returns the scene: 6 m by 5 m, 2.6 m high.
pub fn scene() -> NamedScene {
    let mut scene = NamedScene::default();
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    scene.add("table", table(at(-0.8, -0.6)));
    scene.add("chair", chair(at(-1.2, 0.15), 1.0));
    scene.add("chair", chair(at(-0.4, 0.2), 1.0));
    scene.add("chair", chair(at(-0.9, -1.35), -1.0));
    scene.add("sofa", sofa(at(-0.5, 1.95)));
    scene.add("shelves", shelves(at(2.8, 0.3)));
    scene.add("lamp", lamp(at(1.2, 2.0)));
    scene.add("walls", RoomShell { half: DVec3::new(3.0, 2.5, 1.3) });
    scene.look([2.5, -2.2, 1.6], [-0.8, 0.6, 0.8]);
    scene.look([-2.7, -2.1, 1.5], [1.2, 0.8, 0.9]);
    scene
}

/// Returns a depth camera that is turned in the room.
pub fn depth_camera() -> DepthCamera {
    let eyes = [DVec3::new(1.8, -1.8, 1.5), DVec3::new(-2.2, -1.9, 1.4)];
    let poses = eyes.into_iter().flat_map(|eye| {
        (0..8).map(move |i| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 8.0).sin_cos();
            (eye, eye + DVec3::new(cos, sin, -0.25))
        })
    });
    DepthCamera { poses: poses.collect(), ..DepthCamera::default() }
}

/// Returns a depth camera that takes one picture, with the steps and the noise of structured light. On a wall 5 m before such a
/// camera disparities have a standard deviation of half a step, and their correlation falls to zero within 9 pixels.
pub fn depth_image() -> DepthCamera {
    let eye = DVec3::new(2.6, -2.1, 1.5);
    let target = DVec3::new(-1.0, 0.8, 0.9);
    DepthCamera {
        poses: vec![(eye, target)],
        width: 640,
        height: 480,
        noise_at_1_m: 0.00145,
        step_at_1_m: 0.0029,
        window: 9,
        ..DepthCamera::default()
    }
}

/// Returns a survey from two stations.
pub fn terrestrial(step_deg: f64) -> TerrestrialSurvey {
    let step_rad = step_deg.to_radians();
    let scanner = Scanner { step_rad, with_grid: true, ..Scanner::default() };
    let positions = [[1.5, -1.5, 1.5], [-2.2, 0.8, 1.5]];
    let stations = positions.map(|position| Station::full_dome(position.into()));
    TerrestrialSurvey { scanner, stations: stations.to_vec() }
}

#[cfg(test)]
mod tests {
    //! The room and its pictures.

    use super::*;
    use crate::instruments::Instrument;
    use crate::scenes::named_scene::checks;
    use surfel_core::progress::NoProgress;

    #[test]
    fn every_kind_of_object_is_seen_and_distances_are_never_too_long() {
        checks::check(&scene());
    }

    #[test]
    fn the_room_is_closed() {
        let camera = DepthCamera { width: 40, height: 30, ..depth_camera() };
        let cloud = camera.scan(&scene().sdf, &NoProgress).unwrap();
        assert_eq!(cloud.len(), 16 * 40 * 30);
        assert!(cloud.positions.iter().all(|p| p.x.abs() < 3.2 && p.y.abs() < 2.7));
    }
}
