//! Views from the stations of scans: from the one that is asked for, and of single scans from their own.

use super::loaded::LoadedScene;
use crate::description::{CameraSettings, Interior, Invalid, SceneDescription};
use surfel_core::math::{DQuat, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::scene::{Room, StationView, find_depth_camera, find_station, view_from_station};

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

/// Returns the camera's settings with the position of the station that they name, and with the view from there.
///
/// # Errors
///
/// Fails if no cloud has a station of this name whose position is known.
pub fn stand_at_station<'a>(
    camera: &CameraSettings,
    clouds: impl Iterator<Item = &'a PointCloud>,
    up: Vec3,
) -> Result<CameraSettings, Invalid> {
    let Some(name) = &camera.station else { return Ok(camera.clone()) };
    let stations = clouds.flat_map(|cloud| {
        let stations = cloud.stations.iter().enumerate();
        let located = stations.filter(|(_, station)| station.position.is_some());
        located.map(move |(station_idx, station)| (cloud, station_idx, station.name.as_str()))
    });
    let stations: Vec<(&PointCloud, usize, &str)> = stations.collect();
    let found = stations.iter().find(|(.., known)| known == name);
    let found =
        found.or_else(|| stations.iter().find(|(.., known)| known.eq_ignore_ascii_case(name)));
    let view = found.and_then(|(cloud, station_idx, _)| view_from_station(cloud, *station_idx, up));
    let Some(view) = view else {
        let names: Vec<&str> = stations.iter().map(|(.., name)| *name).collect();
        let known = match &names[..] {
            [] => "no file states the place of a scanner, as E57 and PTX files do".to_owned(),
            names => format!("there is {}", names.join(", ")),
        };
        return Err(Invalid::at("camera.station", format!("no station `{name}`; {known}")));
    };
    let mut settled = CameraSettings { position: Some(view.position), ..camera.clone() };
    if !camera.is_panorama() {
        let angle_rad = -camera.azimuth_angle().to_radians();
        let direction = DQuat::from_axis_angle(up.as_dvec3(), angle_rad) * view.direction;
        settled.azimuth_angle = None;
        settled.focal_point.get_or_insert(view.position + view.distance * direction);
        settled.view_angle.get_or_insert(view.view_angle_deg);
    }
    Ok(settled)
}
