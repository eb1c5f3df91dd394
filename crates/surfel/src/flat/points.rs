//! A cloud in the form that kernels read: tree nodes and leaf blocks.

use super::block::{BlockPoint, PointBlock, fits};
use crate::bvh::{self, NO_PRIMITIVE, Node, Primitive};
use crate::error::{Error, Result};
use crate::image::decode_srgb8;
use crate::math::{Aabb, LANES, Vec3};
use crate::points::PointCloud;
use crate::progress::Progress;
use crate::surface::{Gathered, SurfaceKind};
use rayon::prelude::*;

/// Points and the tree over them.
#[derive(Clone, Debug, Default)]
pub struct FlatPoints {
    pub nodes: Vec<Node>,
    pub blocks: Vec<PointBlock>,
    /// Index in the cloud of the point at each slot; `NO_POINT` where there is none.
    pub ids: Vec<u32>,
}

/// Marks a slot without a point.
pub const NO_POINT: u32 = u32::MAX;

/// A point's place: eight times its block, plus its lane.
pub type Slot = u32;

impl FlatPoints {
    /// Sorts `cloud` into a tree. Each point needs a radius (but for `SurfaceKind::Points`) and, for
    /// oriented kinds, a normal.
    ///
    /// `colors` are sRGB-encoded, one a point.
    pub fn new(
        cloud: &PointCloud,
        kind: SurfaceKind,
        colors: &[[u8; 3]],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let is_traced = kind != SurfaceKind::Points;
        if is_traced && cloud.radii.is_none() {
            return Err(missing("radii"));
        }
        if kind.is_oriented() && cloud.normals.is_none() {
            return Err(missing("normals"));
        }
        let factor = kind.radius_factor();
        let point = |id: u32| {
            let i = id as usize;
            let normal = cloud.normals.as_ref().map_or(Vec3::Z, |normals| normals[i]);
            BlockPoint {
                position: cloud.positions[i],
                normal,
                radius: cloud
                    .radii
                    .as_ref()
                    .filter(|_| is_traced)
                    .map_or(0.0, |radii| factor * radii[i]),
                color: colors[i],
            }
        };
        let mut primitives: Vec<Primitive> = (0..cloud.len() as u32)
            .into_par_iter()
            .map(|id| Primitive { bounds: padded_bounds(kind, &point(id)), index: id })
            .collect();
        let fit = |primitives: &[Primitive]| {
            let points = primitives.iter().map(|p| point(p.index));
            let size = Aabb::of_points(points.clone().map(|p| p.position)).size();
            let smallest = points.clone().fold(f32::INFINITY, |r, p| r.min(p.radius));
            !is_traced || fits(size, smallest, points.fold(0.0, |r, p| r.max(p.radius)))
        };
        let tree = bvh::build(&mut primitives, fit, progress)?;
        drop(primitives);
        let encode = |ids: &[u32; LANES]| {
            let points = ids.iter().filter(|&&id| id != NO_PRIMITIVE).map(|&id| point(id));
            PointBlock::new(&points.collect::<Vec<_>>())
        };
        let blocks = tree.blocks.par_iter().map(encode).collect();
        Ok(Self { nodes: tree.nodes, blocks, ids: tree.blocks.into_flattened() })
    }

    /// Bytes of the tree, and of the points.
    pub fn bytes(&self) -> (usize, usize) {
        let points = size_of_val(self.blocks.as_slice()) + size_of_val(self.ids.as_slice());
        (size_of_val(self.nodes.as_slice()), points)
    }

    /// The point's index in its cloud.
    pub fn id(&self, slot: Slot) -> u32 {
        self.ids[slot as usize]
    }

    pub fn radius(&self, slot: Slot) -> f32 {
        self.blocks[slot as usize / LANES].radius(slot as usize % LANES)
    }

    #[inline]
    pub fn center(&self, slot: Slot) -> Vec3 {
        self.blocks[slot as usize / LANES].position(slot as usize % LANES)
    }

    /// Unit.
    #[inline]
    pub fn normal(&self, slot: Slot) -> Vec3 {
        self.blocks[slot as usize / LANES].normal(slot as usize % LANES)
    }

    /// The disc at `slot`, pierced at `position`.
    pub fn gathered(&self, slot: Slot, position: Vec3) -> Gathered {
        let (block, lane) = (&self.blocks[slot as usize / LANES], slot as usize % LANES);
        Gathered {
            center: block.position(lane),
            normal: block.normal(lane),
            radius: block.radius(lane),
            color: Vec3::from_array(block.color(lane).map(decode_srgb8)),
            position,
        }
    }

    /// Slots that hold points.
    pub fn slots(&self) -> impl Iterator<Item = Slot> {
        (0..self.ids.len() as Slot).filter(|&slot| self.id(slot) != NO_POINT)
    }
}

/// Larger than the point by what encoding and the rounding of coordinates may move it.
fn padded_bounds(kind: SurfaceKind, point: &BlockPoint) -> Aabb {
    let bounds = kind.bounds(point.position, point.normal, point.radius);
    let padding = 3e-3 * point.radius + 2.0 * f32::EPSILON * point.position.abs().max_element();
    Aabb { min: bounds.min - padding, max: bounds.max + padding }
}

fn missing(column: &'static str) -> Error {
    Error::Setting {
        name: column,
        found: "none".into(),
        expected: "one for each point (see points::prepare)",
    }
}
