//! Views from the stations of scans that files state.

use super::loaded::LoadedScene;
use crate::description::{CameraSettings, Invalid};
use surfel_core::math::{DAffine3, DQuat, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::scene::{InsideView, view_from_station};

/// A station whose position is known, in the world of the scene.
pub struct LocatedStation<'a> {
    /// Name of its scan.
    pub name: &'a str,
    cloud: &'a PointCloud,
    station_idx: usize,
    world_from_cloud: DAffine3,
}

impl LocatedStation<'_> {
    /// Returns the view along the longest view from the station.
    pub fn view(&self, up: Vec3) -> Option<InsideView> {
        let world = &self.world_from_cloud;
        let up = (world.matrix3.transpose() * up.as_dvec3()).normalize_or(up.as_dvec3());
        let view = view_from_station(self.cloud, self.station_idx, up.as_vec3())?;
        let ahead = world.transform_vector3(view.direction);
        Some(InsideView {
            position: world.transform_point3(view.position),
            direction: ahead.normalize_or(view.direction),
            distance: view.distance * ahead.length(),
            ..view
        })
    }
}

/// Returns the stations of all clouds whose positions are known, in the order of the files.
pub fn located_stations(scene: &LoadedScene) -> Vec<LocatedStation<'_>> {
    let transforms = scene.graph.world_from_geometries();
    let stations = scene.clouds().flat_map(|(geometry, cloud)| {
        let world_from_cloud = transforms[geometry];
        let stations = cloud.stations.iter().enumerate();
        let located = stations.filter(|(_, station)| station.position.is_some());
        located.map(move |(station_idx, station)| LocatedStation {
            name: &station.name,
            cloud,
            station_idx,
            world_from_cloud,
        })
    });
    stations.collect()
}

/// Returns the camera's settings with the position of the station that they name, and with the view from there.
///
/// # Errors
///
/// Fails if no cloud has a station of this name whose position is known.
pub fn stand_at_station(
    camera: &CameraSettings,
    scene: &LoadedScene,
    up: Vec3,
) -> Result<CameraSettings, Invalid> {
    let Some(name) = &camera.station else { return Ok(camera.clone()) };
    let stations = located_stations(scene);
    let found = stations.iter().find(|station| station.name == name);
    let found =
        found.or_else(|| stations.iter().find(|station| station.name.eq_ignore_ascii_case(name)));
    let Some(view) = found.and_then(|station| station.view(up)) else {
        let names: Vec<&str> = stations.iter().map(|station| station.name).collect();
        let known = match &names[..] {
            [] => {
                "no file states the position of a scanner, as E57, PTX and organised PCD files do"
                    .to_owned()
            }
            names => format!("there is {}", names.join(", ")),
        };
        return Err(Invalid::at("camera.station", format!("no station `{name}`; {known}")));
    };
    let mut located = CameraSettings { position: Some(view.position), ..camera.clone() };
    if !camera.is_panorama() {
        let angle_rad = -camera.azimuth_angle().to_radians();
        let direction = DQuat::from_axis_angle(up.as_dvec3(), angle_rad) * view.direction;
        located.azimuth_angle = None;
        located.focal_point.get_or_insert(view.position + view.distance * direction);
        located.view_angle.get_or_insert(view.view_angle_deg);
    }
    Ok(located)
}
