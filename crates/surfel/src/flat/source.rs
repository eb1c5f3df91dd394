//! Points of a cloud as blocks take them.

use super::block::BlockPoint;
use crate::bvh::Primitive;
use crate::error::{Error, Result};
use crate::math::{Aabb, Vec3};
use crate::points::PointCloud;
use crate::surface::SurfaceKind;

/// The columns that the flat form holds.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub kind: SurfaceKind,
    positions: &'a [Vec3],
    normals: Option<&'a [Vec3]>,
    /// None where radii are not asked for.
    radii: Option<&'a [f32]>,
    /// sRGB-encoded.
    colors: &'a [[u8; 3]],
}

impl<'a> Source<'a> {
    pub fn new(cloud: &'a PointCloud, kind: SurfaceKind, colors: &'a [[u8; 3]]) -> Result<Self> {
        let is_traced = kind != SurfaceKind::Points;
        if is_traced && cloud.radii.is_none() {
            return Err(missing("radii"));
        }
        if kind.is_oriented() && cloud.normals.is_none() {
            return Err(missing("normals"));
        }
        Ok(Self {
            kind,
            positions: &cloud.positions,
            normals: cloud.normals.as_deref(),
            radii: cloud.radii.as_deref().filter(|_| is_traced),
            colors,
        })
    }

    pub fn len(&self) -> usize {
        self.positions.len()
    }

    pub fn point(&self, id: u32) -> BlockPoint {
        let i = id as usize;
        BlockPoint {
            position: self.positions[i],
            normal: self.normals.map_or(Vec3::Z, |normals| normals[i]),
            radius: self.radius(i),
            color: self.colors[i],
        }
    }

    fn radius(&self, i: usize) -> f32 {
        self.radii.map_or(0.0, |radii| self.kind.radius_factor() * radii[i])
    }

    /// A point that nothing can hit has an empty box: its position is not finite or its radius not positive.
    pub fn primitive(&self, id: u32) -> Primitive {
        let BlockPoint { position, normal, radius, .. } = self.point(id);
        let is_point = position.is_finite() && (self.radii.is_none() || 0.0 < radius);
        let bounds =
            if is_point { self.kind.bounds(position, normal, radius) } else { Aabb::EMPTY };
        Primitive::new(bounds, id, radius)
    }
}

fn missing(column: &'static str) -> Error {
    Error::Setting {
        name: column,
        found: "none".into(),
        expected: "one for each point (see points::prepare)",
    }
}
