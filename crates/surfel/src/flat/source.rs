//! Points of a cloud as blocks take them.

use super::block::{self, BlockPoint};
use crate::bvh::{NO_PRIMITIVE, Primitive};
use crate::error::{Error, Result};
use crate::math::{Aabb, LANES, Vec3};
use crate::points::PointCloud;
use crate::surface::SurfaceKind;
use rayon::prelude::*;

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
            normal: self.normals.map_or(Vec3::Z, |normals| with_direction(normals[i])),
            radius: self.radii.map_or(0.0, |radii| self.kind.radius_factor() * radii[i]),
            color: self.colors[i],
        }
    }

    /// The points of a block; the first of `ids` is one.
    pub fn points(&self, ids: &[u32; LANES]) -> Members {
        let n_points = ids.iter().filter(|&&id| id != NO_PRIMITIVE).count();
        let mut points = [self.point(ids[0]); LANES];
        for (point, &id) in points[..n_points].iter_mut().zip(ids).skip(1) {
            *point = self.point(id);
        }
        Members { points, n_points }
    }

    /// A point that nothing can hit has an empty box, which keeps it out of the tree.
    pub fn primitive(&self, id: u32) -> Primitive {
        let point = self.point(id);
        let bounds = if self.is_solid(&point) {
            self.kind.bounds(point.position, point.normal, point.radius)
        } else {
            Aabb::EMPTY
        };
        Primitive::new(bounds, id, point.radius)
    }

    /// Points that can be hit.
    pub fn n_solid(&self) -> usize {
        let ids = (0..self.len() as u32).into_par_iter();
        ids.filter(|&id| self.is_solid(&self.point(id))).count()
    }

    pub fn is_solid(&self, point: &BlockPoint) -> bool {
        let has_radius = self.radii.is_none() || 0.0 < point.radius;
        has_radius && point.radius.is_finite() && point.position.is_finite()
    }
}

/// One to eight points.
pub(super) struct Members {
    points: [BlockPoint; LANES],
    n_points: usize,
}

impl Members {
    pub fn as_slice(&self) -> &[BlockPoint] {
        &self.points[..self.n_points]
    }
}

/// Whether points of these positions and radii may share a block.
pub(super) fn fits(kind: SurfaceKind, points: impl Iterator<Item = (Vec3, f32)> + Clone) -> bool {
    let size = Aabb::of_points(points.clone().map(|(position, _)| position)).size();
    let radii = points.map(|(_, radius)| radius);
    let smallest = radii.clone().fold(f32::INFINITY, f32::min);
    match kind {
        SurfaceKind::Points => size.is_finite(),
        _ => block::fits(size, smallest, radii.fold(0.0, f32::max)),
    }
}

/// Z in place of a normal without a direction, as blocks have it.
fn with_direction(normal: Vec3) -> Vec3 {
    let length_squared = normal.length_squared();
    if 0.0 < length_squared && length_squared.is_finite() { normal } else { Vec3::Z }
}

fn missing(column: &'static str) -> Error {
    Error::Setting {
        name: column,
        found: "none".into(),
        expected: "one for each point (see points::prepare)",
    }
}
