//! Visits the points of a scene in parallel, in a fixed order.

use super::{FlatGaussians, FlatGeometry, FlatPoints, FlatScene, Slot};
use crate::bvh::NO_PRIMITIVE;
use crate::error::Result;
use crate::math::{DVec3, LANES, Vec3};
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of slots that a task goes through.
const SLOTS_PER_PART: usize = 8192;

/// Number of tasks whose results are held at once.
const MAX_PARTS_AT_ONCE: usize = 64;

/// Names a point of a flat scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointId {
    /// Index of the instance in the flat scene.
    pub instance_idx: u32,
    /// Index of the point in its cloud.
    pub primitive_idx: u32,
}

/// A visible point of a scene.
#[derive(Clone, Copy, Debug)]
pub struct VisitedPoint {
    /// The point in its cloud.
    pub id: PointId,
    /// Position in world coordinates.
    pub position: DVec3,
    /// Colour as sRGB.
    pub color: [u8; 3],
    /// Number that no other point of the scene has, the same in each visit.
    pub key: u64,
}

/// The points of a tree by their slots.
trait Slots: Sync {
    /// Returns the index in the cloud of the point at each slot, `NO_PRIMITIVE` in unused ones.
    fn ids(&self) -> &[u32];

    /// Returns centre and sRGB-encoded colour of the point at a used slot.
    fn center_and_color(&self, slot: Slot) -> (Vec3, [u8; 3]);
}

impl Slots for FlatPoints {
    fn ids(&self) -> &[u32] {
        &self.ids
    }

    fn center_and_color(&self, slot: Slot) -> (Vec3, [u8; 3]) {
        let block = &self.blocks[slot as usize / LANES];
        (self.center(slot), block.color(slot as usize % LANES))
    }
}

impl Slots for FlatGaussians {
    fn ids(&self) -> &[u32] {
        self.ids()
    }

    fn center_and_color(&self, slot: Slot) -> (Vec3, [u8; 3]) {
        (self.gaussian(slot).center, self.color(slot))
    }
}

/// Calls `find` for each point that is shown; returns what it finds, in a fixed order.
///
/// # Errors
///
/// Fails if `progress` is cancelled.
pub fn visit_points<T: Send>(
    scene: &FlatScene,
    progress: &dyn Progress,
    find: impl Fn(&VisitedPoint) -> Option<T> + Sync,
) -> Result<Vec<T>> {
    let mut all = Vec::new();
    visit_points_in_turn(scene, progress, find, |found| all.push(found))?;
    Ok(all)
}

/// Calls `find` for each point that is shown, and `take` with what it finds, in a fixed order. Few results are held at
/// once, however many points there are.
///
/// # Errors
///
/// Fails if `progress` is cancelled.
pub fn visit_points_in_turn<T: Send>(
    scene: &FlatScene,
    progress: &dyn Progress,
    find: impl Fn(&VisitedPoint) -> Option<T> + Sync,
    mut take: impl FnMut(T),
) -> Result<()> {
    for (instance_idx, instance) in scene.instances.iter().enumerate() {
        let FlatGeometry::Cloud(cloud) = scene.geometry(instance) else { continue };
        let points = [&cloud.points, &cloud.lines, &cloud.scatter].map(|points| points as _);
        let trees: [&dyn Slots; 4] = [points[0], points[1], points[2], &*cloud.gaussians];
        for (tree_idx, tree) in trees.into_iter().enumerate() {
            let ids = tree.ids();
            let point_at = |slot: usize| {
                if ids[slot] == NO_PRIMITIVE {
                    return None;
                }
                let (center, color) = tree.center_and_color(slot as Slot);
                let position = scene.origin + instance.world_position(center).as_dvec3();
                let is_hidden = scene.camera_planes.iter().any(|plane| plane.hides(position));
                let key = ((trees.len() * instance_idx + tree_idx) as u64) << 40 | slot as u64;
                let id = PointId { instance_idx: instance_idx as u32, primitive_idx: ids[slot] };
                (!is_hidden).then_some(VisitedPoint { id, position, color, key })
            };
            let visit_part = |part: usize| {
                progress.check()?;
                let end = ids.len().min(SLOTS_PER_PART * (part + 1));
                let slots = SLOTS_PER_PART * part..end;
                Ok(slots.filter_map(point_at).filter_map(|point| find(&point)).collect())
            };
            let n_parts = ids.len().div_ceil(SLOTS_PER_PART);
            for first in (0..n_parts).step_by(MAX_PARTS_AT_ONCE) {
                let parts = first..n_parts.min(first + MAX_PARTS_AT_ONCE);
                let found: Vec<Vec<T>> =
                    parts.into_par_iter().map(visit_part).collect::<Result<_>>()?;
                found.into_iter().flatten().for_each(&mut take);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
pub(super) mod slope {
    //! A scene whose points are known.

    use super::*;
    use crate::points::{PointCloud, Preparation, PreparedCloud, prepare};
    use crate::progress::NoProgress;
    use crate::scene::{
        Background, Camera, CloudGeometry, Geometry, Graph, Material, Projection, Scene,
    };

    /// A grid of 101 x 101 points of a slope that rises along x, at an origin far away.
    pub fn slope() -> FlatScene {
        let positions = (0..101 * 101).map(|i| {
            let (x, y) = ((i % 101) as f32, (i / 101) as f32);
            Vec3::new(x, y, 0.5 * x)
        });
        let mut cloud = PointCloud::from_positions(positions.collect());
        cloud.origin = DVec3::new(484_000.0, 6_632_000.0, 100.0);
        let (cloud, _): (PreparedCloud, _) =
            prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let colors = vec![[10, 20, 30]; cloud.len()];
        let geometry = Geometry::Points(CloudGeometry::new(cloud, colors).unwrap());
        let camera = Camera {
            position: DVec3::Z,
            focal_point: DVec3::ZERO,
            view_up: DVec3::Y,
            projection: Projection::Panorama,
        };
        let scene = Scene {
            graph: Graph::from_geometry(geometry, Material::PLASTIC),
            lights: Vec::new(),
            background: Background::Transparent,
            camera,
        };
        FlatScene::new(&scene, &NoProgress).unwrap()
    }
}

#[cfg(test)]
mod tests {
    //! Points that are shown.

    use super::slope::slope;
    use super::*;
    use crate::progress::NoProgress;
    use crate::scene::ClipPlane;
    use std::collections::BTreeSet;

    #[test]
    fn each_shown_point_is_visited_once() {
        let mut scene = slope();
        let keys = visit_points(&scene, &NoProgress, |point| Some(point.key)).unwrap();
        assert_eq!(keys.iter().collect::<BTreeSet<_>>().len(), 101 * 101);
        let (point, normal) = (DVec3::new(484_050.5, 0.0, 0.0), DVec3::X);
        scene.camera_planes = vec![ClipPlane { point, normal }];
        let shown = visit_points(&scene, &NoProgress, |point| Some(point.position)).unwrap();
        assert_eq!(shown.len(), 51 * 101);
        assert!(shown.iter().all(|position| position.x < 484_050.5));
    }
}
