//! Who looks: the camera that was chosen, and where it is at a time.

use crate::args::{SceneArgs, Usage};
use crate::assemble::Assembly;
use crate::report::Report;
use crate::scene_file::CameraMotion;
use surfel::math::{Aabb, DVec3, Vec3};
use surfel::points::PointCloud;
use surfel::scene::{Camera, Graph, Projection};

/// A camera, and what moves it.
pub struct Eye {
    /// As it was chosen, before it moves.
    pub camera: Camera,
    /// The node of a file that has the camera, if it is one of a file and goes along with it.
    pub node: Option<usize>,
    up: Vec3,
    /// Of all that is seen.
    middle: DVec3,
    /// Asked for in place of that of a file.
    view_angle_deg: Option<f64>,
    motion: Option<CameraMotion>,
}

/// What there is to look at.
pub struct Sight<'a> {
    pub outline: &'a PointCloud,
    /// Of all but stray points, relative to the outline's origin.
    pub bounds: Aabb,
    pub up: Vec3,
}

impl Eye {
    /// From the options; where nothing is asked of the camera, the first of the files or one that sees all.
    pub fn choose(
        graph: &Graph,
        sight: &Sight,
        args: &SceneArgs,
        motion: Option<CameraMotion>,
        report: &Report,
    ) -> Self {
        let Sight { outline, bounds, up } = *sight;
        let middle = outline.origin + (0.5 * (bounds.min + bounds.max)).as_dvec3();
        let view_angle_deg = args.camera.camera_view_angle;
        let of_file = graph.camera().filter(|_| args.camera.is_automatic());
        let camera = match of_file {
            Some((node, camera)) => {
                let name = &graph.nodes[node].name;
                report.choice(
                    &format!("camera `{name}` of the file"),
                    "--camera-name, --camera-position",
                );
                of_file_as_asked(camera, middle, view_angle_deg)
            }
            None => {
                let (width, height) = args.picture.resolution;
                args.camera.camera(outline, up, f64::from(width) / f64::from(height), report)
            }
        };
        let is_still = args.camera.camera_still;
        let node = of_file.map(|(node, _)| node).filter(|_| !is_still);
        let motion = motion.filter(|_| !is_still);
        Self { camera, node, up, middle, view_angle_deg, motion }
    }

    /// Whether the scene moves the camera.
    pub fn moves(&self, assembly: &Assembly) -> bool {
        self.motion.is_some() || self.node.is_some_and(|node| assembly.moves(node))
    }

    /// The camera as its motion, or that of its node, has it at a time, at which `graph` is posed.
    pub fn at(&self, time_secs: f64, graph: &Graph) -> Camera {
        let of_file = graph.camera().filter(|_| self.node.is_some());
        let camera = of_file.map_or(self.camera, |(_, camera)| {
            of_file_as_asked(camera, self.middle, self.view_angle_deg)
        });
        self.motion.as_ref().map_or(camera, |motion| motion.at(time_secs, camera, self.up))
    }
}

/// A camera of a file tells a direction, but not how far away what it looks at is, about which orbits go:
/// as far as the middle of all that is seen, unless that is behind it.
fn of_file_as_asked(camera: Camera, middle: DVec3, view_angle_deg: Option<f64>) -> Camera {
    let [.., forward] = camera.axes();
    let depth = forward.dot(middle - camera.position);
    let focal_point = camera.position + depth * forward;
    let asked = view_angle_deg.map(|view_angle_deg| Projection::Perspective { view_angle_deg });
    Camera {
        focal_point: if 0.0 < depth { focal_point } else { camera.focal_point },
        projection: asked.unwrap_or(camera.projection),
        ..camera
    }
}

/// Leaves only the camera of this name in the graph.
pub fn keep_camera(graph: &mut Graph, name: &str) -> Result<(), Usage> {
    let is_visible = graph.visible_nodes();
    let nodes = graph.nodes.iter().enumerate();
    let cameras = nodes.filter(|(i, node)| node.camera.is_some() && is_visible[*i]);
    let cameras: Vec<(usize, &str)> = cameras.map(|(i, node)| (i, node.name.as_str())).collect();
    let Some((kept, _)) = cameras.iter().find(|(_, known)| *known == name) else {
        let names: Vec<&str> = cameras.iter().map(|(_, name)| *name).collect();
        let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        return Err(Usage(format!("--camera-name {name}: no such camera; there is {known}")));
    };
    let kept = *kept;
    let others = graph.nodes.iter_mut().enumerate().filter(|(i, _)| *i != kept);
    others.for_each(|(_, node)| node.camera = None);
    Ok(())
}
