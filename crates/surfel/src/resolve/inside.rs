//! Views from within a scene: of a single scan from the place of its scanner, and along a tunnel.

use super::camera::short_position;
use super::interior::has_splats;
use super::loaded::LoadedScene;
use crate::description::{Interior, SceneDescription};
use surfel_core::math::Vec3;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::{InsideView, Room, find_depth_camera, find_station, find_tunnel};

/// The place within a scene from which it is shown.
pub enum Inside {
    /// The station of a scanner or the place of a depth camera.
    Station(InsideView),
    /// Near the end of a tunnel.
    Tunnel(InsideView),
}

impl Inside {
    /// Returns the view from this place.
    pub fn view(&self) -> &InsideView {
        match self {
            Self::Station(view) | Self::Tunnel(view) => view,
        }
    }

    /// Returns a line about this place for the user.
    fn line(&self) -> String {
        let [x, y, z] = self.view().position.to_array();
        match self {
            Self::Station(_) => format!(
                "camera at the scanner's station {x},{y},{z}: the points were measured from there"
            ),
            Self::Tunnel(_) => {
                let at = short_position(self.view().position);
                format!("camera in the tunnel at {at}: from outside its points show nothing")
            }
        }
    }
}

/// Returns, and reports, the place within the scene from which it is shown if it stands still and nothing is asked of the camera: the station
/// of a single cloud, or a tunnel that `points` show, which are all.
///
/// Turntables and rooms that do not contain the station are shown from outside.
pub fn choose_inside(
    scene: &LoadedScene,
    points: &PointCloud,
    description: &SceneDescription,
    up: Vec3,
    room: Option<&Room>,
    progress: &dyn Progress,
) -> Option<Inside> {
    let camera = &description.camera;
    let is_open = camera.is_automatic() && camera.interior() == Interior::Auto;
    let is_turned = description.output.turntable.is_some();
    if !is_open || is_turned || scene.moves() || scene.graph.camera().is_some() {
        return None;
    }
    let of_station = || {
        let cloud = scene.single_cloud().filter(|_| scene.file_infos.len() == 1)?;
        let view = find_station(cloud, up).or_else(|| find_depth_camera(cloud, up))?;
        room.is_none_or(|room| room.contains(view.position)).then_some(Inside::Station(view))
    };
    let in_tunnel = || {
        let has_room = room.is_some() || has_splats(scene);
        find_tunnel(points, up).filter(|_| !has_room).map(Inside::Tunnel)
    };
    let inside = of_station().or_else(in_tunnel)?;
    progress.choice(&inside.line(), &["camera.position", "camera.interior"]);
    Some(inside)
}
