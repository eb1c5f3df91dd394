//! Scans of one scanner in its own coordinates are shown from its station.

use super::loaded::LoadedScene;
use crate::description::{Interior, SceneDescription};
use surfel_core::math::Vec3;
use surfel_core::scene::{Room, StationView, find_depth_camera, find_station};

/// Returns the station from which the scene is shown: that of a single cloud that stands still, if nothing is asked of
/// the camera.
///
/// Turntables and rooms that do not contain the station are shown from outside.
pub fn choose_station(
    scene: &LoadedScene,
    description: &SceneDescription,
    up: Vec3,
    room: Option<&Room>,
) -> Option<StationView> {
    let camera = &description.camera;
    let is_open = camera.is_automatic() && camera.interior() == Interior::Auto;
    let is_merged = scene.file_infos.len() != 1;
    let is_turned = description.output.turntable.is_some();
    if !is_open || is_merged || is_turned || scene.moves() || scene.graph.camera().is_some() {
        return None;
    }
    let cloud = scene.single_cloud()?;
    let station = find_station(cloud, up).or_else(|| find_depth_camera(cloud, up))?;
    room.is_none_or(|room| room.contains(station.position)).then_some(station)
}
