//! The columns of a point cloud that blocks encode.

use super::block::{self, BlockPoint};
use crate::bvh::{BvhPrimitive, NO_PRIMITIVE};
use crate::error::{Error, Result};
use crate::math::{Aabb, LANES, Vec3};
use crate::points::{Structure, check_length};
use crate::surface::{SurfaceKind, leaves};
use rayon::prelude::*;

/// The columns of a cloud that the flat form keeps, with one entry for each point.
#[derive(Clone, Copy)]
pub struct PointColumns<'a> {
    kind: SurfaceKind,
    positions: &'a [Vec3],
    /// Empty if there are none.
    normals: &'a [Vec3],
    radii: &'a [f32],
    colors: &'a [[u8; 3]],
    /// The factor that multiplies the radii.
    radius_factor: f32,
    /// The structure of each point, and the one whose points count; none if all do.
    part: Option<(&'a [Structure], Structure)>,
    /// The positions of the points at rest.
    rest_positions: &'a [Vec3],
}

impl<'a> PointColumns<'a> {
    /// Borrows columns of any values. `colors` are sRGB-encoded. `normals` may be empty if the kind needs none.
    ///
    /// # Errors
    ///
    /// Returns [`Error::MissingColumn`] if the kind needs normals and there are none, and [`Error::ColumnLength`] unless
    /// all columns have the same length.
    pub fn new(
        kind: SurfaceKind,
        positions: &'a [Vec3],
        normals: &'a [Vec3],
        radii: &'a [f32],
        colors: &'a [[u8; 3]],
    ) -> Result<Self> {
        if kind.needs_normals() && normals.is_empty() && !positions.is_empty() {
            return Err(Error::MissingColumn { column: "normals" });
        }
        if !normals.is_empty() {
            check_length("normals", normals.len(), positions.len())?;
        }
        check_length("radii", radii.len(), positions.len())?;
        check_length("colours", colors.len(), positions.len())?;
        let radius_factor = kind.radius_factor();
        Ok(Self {
            kind,
            positions,
            normals,
            radii,
            colors,
            radius_factor,
            part: None,
            rest_positions: positions,
        })
    }

    /// Multiplies the radii by this factor instead of that of the surface kind.
    pub(super) fn with_radius_factor(self, radius_factor: f32) -> Self {
        Self { radius_factor, ..self }
    }

    /// States where the points are at rest, if `positions` are deformed.
    pub(super) fn at_rest(self, rest_positions: &'a [Vec3]) -> Self {
        Self { rest_positions, ..self }
    }

    /// Leaves out all points but those of one structure, which get this kind.
    pub(super) fn only(
        self,
        structures: &'a [Structure],
        kind: SurfaceKind,
        part: Structure,
    ) -> Self {
        let is_same = kind == self.kind;
        let radius_factor = if is_same { self.radius_factor } else { kind.radius_factor() };
        Self { kind, radius_factor, part: Some((structures, part)), ..self }
    }

    /// Returns the shape of the points.
    pub(super) fn kind(&self) -> SurfaceKind {
        self.kind
    }

    /// Returns the number of points.
    pub(super) fn len(&self) -> usize {
        self.positions.len()
    }

    /// Returns the point with index `id`, its radius scaled for the surface kind. That of leaves has the mirror of its cluster
    /// for a normal.
    pub(super) fn point(&self, id: u32) -> BlockPoint {
        let i = id as usize;
        let normal = match self.kind {
            SurfaceKind::Leaves => Some(leaves::mirror(self.rest_positions[i])),
            _ => self.normals.get(i).copied(),
        };
        BlockPoint {
            position: self.positions[i],
            normal: normal.map_or(Vec3::Z, normal_or_z),
            radius: if self.has_radii() { self.radius_factor * self.radii[i] } else { 0.0 },
            color: self.colors[i],
        }
    }

    /// Returns the points of a block. At least the first of `ids` must be a point.
    pub(super) fn points(&self, ids: &[u32; LANES]) -> BlockPoints {
        let n_points = ids.iter().filter(|&&id| id != NO_PRIMITIVE).count();
        let mut points = [self.point(ids[0]); LANES];
        for (point, &id) in points[..n_points].iter_mut().zip(ids).skip(1) {
            *point = self.point(id);
        }
        BlockPoints { points, n_points }
    }

    /// Returns the primitive of the point with index `id`. The box of an untraceable point is empty, which keeps
    /// it out of the tree.
    pub(super) fn primitive(&self, id: u32) -> BvhPrimitive {
        let point = self.point(id);
        let bounds = if self.has_part(id) && self.is_traceable(&point) {
            self.kind.bounds(point.position, point.normal, point.radius)
        } else {
            Aabb::EMPTY
        };
        BvhPrimitive::new(bounds, id, point.radius)
    }

    /// Returns the number of traceable points.
    pub(super) fn n_traceable(&self) -> usize {
        let ids = (0..self.len() as u32).into_par_iter();
        ids.filter(|&id| self.has_part(id) && self.is_traceable(&self.point(id))).count()
    }

    fn has_part(&self, id: u32) -> bool {
        self.part.is_none_or(|(structures, part)| structures[id as usize] == part)
    }

    /// Returns true if a ray can hit `point`: its position and radius are finite, and its radius is positive.
    pub(super) fn is_traceable(&self, point: &BlockPoint) -> bool {
        let has_radius = !self.has_radii() || 0.0 < point.radius;
        has_radius && point.radius.is_finite() && point.position.is_finite()
    }

    /// Returns false for points that are drawn as pixels.
    fn has_radii(&self) -> bool {
        self.kind != SurfaceKind::Points
    }
}

/// One to eight points of a block.
pub(super) struct BlockPoints {
    points: [BlockPoint; LANES],
    n_points: usize,
}

impl BlockPoints {
    /// Returns the points.
    pub fn as_slice(&self) -> &[BlockPoint] {
        &self.points[..self.n_points]
    }
}

/// Returns true if a block can hold points of these positions and radii within its precision.
pub(super) fn fits_precision(
    kind: SurfaceKind,
    points: impl Iterator<Item = (Vec3, f32)> + Clone,
) -> bool {
    let size = Aabb::of_points(points.clone().map(|(position, _)| position)).size();
    let radii = points.map(|(_, radius)| radius);
    let min_radius = radii.clone().fold(f32::INFINITY, f32::min);
    match kind {
        SurfaceKind::Points => size.is_finite(),
        _ => block::fits_precision(size, min_radius, radii.fold(0.0, f32::max)),
    }
}

/// Returns `normal`, or Z if it has no direction, as blocks do.
fn normal_or_z(normal: Vec3) -> Vec3 {
    let length_squared = normal.length_squared();
    if 0.0 < length_squared && length_squared.is_finite() { normal } else { Vec3::Z }
}
