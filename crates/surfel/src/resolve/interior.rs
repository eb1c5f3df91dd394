//! The inside of scanned rooms: the walls and the ceiling before the camera are hidden.

use super::loaded::LoadedScene;
use crate::description::{Interior, SceneDescription};
use surfel_core::progress::Progress;
use surfel_core::scene::{Camera, Clip, ClipPlane, Graph, Room};
use surfel_core::words::counted;

/// Returns the room whose inside is to be seen, if the points show one; reports if one is demanded that they do not show.
/// `found` is the room of the points, also if it is empty.
///
/// Scenes that move keep their walls, as those before the camera change with time. Trained splats keep theirs too: they
/// show things from outside as often as rooms from inside, and have no planes as walls.
pub fn choose_room<'a>(
    scene: &LoadedScene,
    description: &SceneDescription,
    found: Option<&'a Room>,
    progress: &dyn Progress,
) -> Option<&'a Room> {
    let room = match description.camera.interior() {
        Interior::Auto if !scene.moves() && !has_splats(scene) => {
            found.filter(|room| room.has_content())
        }
        Interior::On => found,
        _ => None,
    };
    if room.is_none() && description.camera.interior() == Interior::On {
        let line = "no room was found: nothing is hidden; stand inside";
        progress.warning(line, &["camera.interior", "camera.position", "camera.station"]);
    }
    room
}

/// True if a cloud of the scene has trained splats.
pub fn has_splats(scene: &LoadedScene) -> bool {
    scene.clouds().any(|(_, cloud)| cloud.has_gaussians())
}

/// Returns the planes that hide the walls and the ceiling before the camera, and reports how many there are.
pub fn hidden_walls(
    room: Option<&Room>,
    camera: &Camera,
    progress: &dyn Progress,
) -> Vec<ClipPlane> {
    let planes = room.map_or(Vec::new(), |room| room.planes_before(camera));
    if !planes.is_empty() {
        let sides = counted(planes.len(), "side");
        let line = format!("room: {sides} between the inside and the camera hidden");
        progress.choice(&line, &["camera.interior"]);
    }
    planes
}

/// Returns the plane that hides the ceiling of a room on a turntable, and reports what is hidden.
///
/// The walls before the camera change during the turn, and are hidden from the camera alone: if they let in light, it
/// would flicker.
pub fn hidden_ceiling(room: &Room, camera: &Camera, progress: &dyn Progress) -> Vec<ClipPlane> {
    let ceiling = room.ceiling_before(camera);
    if !room.planes_before(camera).is_empty() {
        let line = "room: the ceiling, and in each frame the walls before the camera, are hidden";
        progress.choice(line, &["camera.interior"]);
    }
    ceiling.into_iter().collect()
}

/// Removes everything beyond the planes.
pub fn hide_walls(graph: &mut Graph, planes: &[ClipPlane]) {
    for plane in planes {
        let clip = Clip { plane: Some(*plane), ..Clip::default() };
        graph.clip(&vec![clip; graph.geometries.len()]);
    }
}
