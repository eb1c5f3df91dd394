//! Point clouds in the form that kernels read.

use super::block_tree::BlockTree;
use super::deform::Deformed;
use super::field::{FieldTree, Octree, OctreeOptions};
use super::gaussians::FlatGaussians;
use super::point_columns::PointColumns;
use super::points::FlatPoints;
use super::refit::Refit;
use crate::bvh::BvhNode;
use crate::error::{Error, Result};
use crate::math::{Aabb, LANES, Vec3};
use crate::points::Structure;
use crate::progress::Progress;
use crate::scene::CloudGeometry;
use crate::scene::color::SupportColors;
use crate::surface::{EdgeTest, MIN_SLIT_DEPTH, SurfaceKind, SurfaceOptions, edge_retest_factor};

/// Number of discs over each other, on average, beyond which they are crowded.
const MAX_OVERLAP: f32 = 50.0;

/// A point cloud with the surface that its points describe.
#[derive(Clone, Debug, Default)]
pub struct FlatCloud {
    /// Points of the surface, relative to the cloud's origin.
    pub points: FlatPoints,
    /// Points of lines, as capsules.
    pub lines: FlatPoints,
    /// Scattered points.
    pub scatter: FlatPoints,
    /// True if scattered points are clusters of leaves; false if they are spheres.
    pub has_leaves: bool,
    /// The kd-tree over the field of weighted planes; empty unless that is the surface.
    pub field: Box<FieldTree>,
    /// The octree whose cells are the surface; empty unless they are.
    pub octree: Box<Octree>,
    /// Trained Gaussians; empty unless they are what the points are shown as. The trees of points are empty then.
    pub gaussians: Box<FlatGaussians>,
    /// The shape of the points.
    pub surface: SurfaceKind,
    /// Options of that shape.
    pub options: SurfaceOptions,
    /// The test that decides where the surface ends.
    pub edge_test: EdgeTest,
    /// Factor on the radius of the neighbourhood that decides about a hit which the nearest points do not enclose.
    pub edge_retest_factor: f32,
    /// True if so many discs lie over each other that the edge test of each one that a shadow ray meets takes too long: the
    /// search for the nearest hit, which gives up after a few rejected ones, then decides about shadows of discs.
    pub is_crowded: bool,
    /// True if normals point out of the body that the points enclose.
    pub has_outward_normals: bool,
    /// True if normals point to the side from which the surface was seen.
    pub has_front_sides: bool,
    /// True if the points have normals of their own, rather than none.
    pub has_normals: bool,
    /// True if colours may be blended; false if each belongs to one point, as those of classes do.
    pub blends_colors: bool,
    /// Colours of hits by their support, instead of the points' own.
    pub support_colors: Option<SupportColors>,
    /// Maximum distance between a ray's nearest disc and what decides about its hit: discs that are blended with it, and
    /// what is behind a slit; 0 if the disc itself is the surface.
    pub max_blend_distance: f32,
}

impl FlatCloud {
    /// Sorts the points into a tree.
    ///
    /// # Errors
    ///
    /// Fails if the cloud has too many points for 32-bit indices, if it lacks the normals that its surface needs, or if
    /// `progress` is cancelled.
    pub fn new(geometry: &CloudGeometry, progress: &dyn Progress) -> Result<Self> {
        let cloud = geometry.cloud();
        let (positions, normals, radii) = (cloud.positions(), cloud.normals(), cloud.radii());
        let colors = geometry.colors();
        if geometry.surface == SurfaceKind::Gaussian {
            return Self::of_gaussians(geometry, positions, progress);
        }
        let columns = PointColumns::new(shape(geometry), positions, normals, radii, colors)?;
        Self::from_columns(scaled(columns, geometry), geometry, progress)
    }

    /// Sorts deformed points into a tree.
    pub(super) fn deformed(
        geometry: &CloudGeometry,
        deformed: &Deformed,
        progress: &dyn Progress,
    ) -> Result<Self> {
        if geometry.surface == SurfaceKind::Gaussian {
            return Self::of_gaussians(geometry, &deformed.positions, progress);
        }
        Self::from_columns(deformed_columns(deformed, geometry)?, geometry, progress)
    }

    /// Sorts trained Gaussians at these positions into a tree.
    fn of_gaussians(
        geometry: &CloudGeometry,
        positions: &[Vec3],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let gaussians = Box::new(FlatGaussians::new(geometry, positions, progress)?);
        let (surface, options) = (geometry.surface, geometry.options);
        Ok(Self { gaussians, surface, options, ..Self::default() })
    }

    /// Sorts the points of `columns` into a tree; their surface is that of `geometry`.
    fn from_columns(
        columns: PointColumns,
        geometry: &CloudGeometry,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (mut lines, mut scatter) = (FlatPoints::default(), FlatPoints::default());
        let mut surface_columns = columns;
        if let Some(parts) = parts(columns, geometry) {
            if geometry.cloud().normals.is_none() {
                return Err(Error::MissingColumn { column: "normals" });
            }
            surface_columns = parts.surface;
            lines = FlatPoints::new(parts.lines, progress)?;
            scatter = FlatPoints::new(parts.scatter, progress)?;
        }
        let points = FlatPoints::new(surface_columns, progress)?;
        let mut flat = Self {
            edge_retest_factor: edge_retest_factor(points.evenness()),
            is_crowded: MAX_OVERLAP < points.overlap(),
            points,
            lines,
            scatter,
            has_leaves: geometry.cloud().has_leaves(),
            field: Box::default(),
            octree: Box::default(),
            gaussians: Box::default(),
            surface: geometry.surface,
            options: geometry.options,
            edge_test: geometry.edge_test,
            has_outward_normals: geometry.has_outward_normals,
            has_front_sides: geometry.has_front_sides,
            has_normals: geometry.cloud().normals.is_some(),
            blends_colors: geometry.blends_colors,
            support_colors: geometry.support_colors,
            max_blend_distance: 0.0,
        };
        flat.set_max_blend_distance();
        flat.build_field(geometry, progress)?;
        Ok(flat)
    }

    /// Moves the points to their deformed positions without changing the tree's structure. If the tree needs a
    /// rebuild, returns a new cloud in a tree of its own.
    pub(super) fn refit(
        &mut self,
        geometry: &CloudGeometry,
        deformed: &Deformed,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        if geometry.surface == SurfaceKind::Gaussian {
            return Self::deformed(geometry, deformed, progress).map(Some);
        }
        let columns = deformed_columns(deformed, geometry)?;
        let needs_rebuild = match parts(columns, geometry) {
            None => self.points.refit(columns) == Refit::NeedsRebuild,
            Some(parts) => {
                let refits = [
                    self.points.refit(parts.surface),
                    self.lines.refit(parts.lines),
                    self.scatter.refit(parts.scatter),
                ];
                refits.contains(&Refit::NeedsRebuild)
            }
        };
        self.set_max_blend_distance();
        if !needs_rebuild {
            self.edge_retest_factor = edge_retest_factor(self.points.evenness());
            self.is_crowded = MAX_OVERLAP < self.points.overlap();
            self.build_field(geometry, progress)?;
        }
        needs_rebuild.then(|| Self::from_columns(columns, geometry, progress)).transpose()
    }

    /// Returns the tree of the points that a hit on a surface of this kind belongs to.
    pub fn points_of(&self, surface: SurfaceKind) -> &FlatPoints {
        match surface {
            SurfaceKind::Capsule => &self.lines,
            SurfaceKind::Leaves => &self.scatter,
            SurfaceKind::Sphere if self.surface != SurfaceKind::Sphere => &self.scatter,
            _ => &self.points,
        }
    }

    /// Returns the shape of scattered points.
    pub fn scatter_kind(&self) -> SurfaceKind {
        scatter_kind(self.has_leaves)
    }

    /// True if the discs of the surface's points have no normals, and face each ray.
    pub fn fits_balls(&self) -> bool {
        self.surface == SurfaceKind::SplatFit && !self.has_normals
    }

    /// True if rays may go on behind the discs that they hit, whatever the edge test.
    pub fn goes_through_holes(&self) -> bool {
        self.surface == SurfaceKind::Cylinder || self.fits_balls()
    }

    /// Returns the factor that multiplied the radii of the surface's points.
    pub fn radius_factor(&self) -> f32 {
        self.options.radius_factor(self.surface)
    }

    /// Returns the sizes of the trees and of the points in bytes.
    pub fn bytes(&self) -> (usize, usize) {
        let parts = [&self.points, &self.lines, &self.scatter].map(FlatPoints::bytes);
        let parts = parts.into_iter().chain([self.gaussians.bytes()]);
        let (trees, points): (Vec<usize>, Vec<usize>) = parts.unzip();
        let trees = trees.iter().sum::<usize>() + self.field.bytes() + self.octree.bytes();
        (trees, points.iter().sum())
    }

    /// Returns the bounding box of all points, which is empty if no point is traceable.
    pub fn bounds(&self) -> Aabb {
        let parts = [&self.points, &self.lines, &self.scatter].map(|part| &part.nodes[..]);
        let parts = parts.into_iter().chain([self.gaussians.nodes()]);
        let field = self.field.bounds().or(self.octree.cube()).unwrap_or(Aabb::EMPTY);
        parts.fold(field, |bounds, nodes| bounds.union(root_bounds(nodes)))
    }

    /// True if all normals point to the same side of the surface.
    pub fn has_known_sides(&self) -> bool {
        self.has_outward_normals || self.has_front_sides
    }

    fn build_field(&mut self, geometry: &CloudGeometry, progress: &dyn Progress) -> Result<()> {
        let has_sides = self.has_known_sides();
        match self.surface {
            SurfaceKind::Implicit => {
                *self.field = FieldTree::new(&self.points, has_sides, progress)?;
            }
            SurfaceKind::Octree | SurfaceKind::OctreeSplat => {
                let options = OctreeOptions {
                    has_corners: self.surface == SurfaceKind::Octree,
                    depth: geometry.octree_depth,
                    has_edge_test: self.edge_test == EdgeTest::AngularGap,
                    has_sides,
                };
                *self.octree = Octree::new(&self.points, &options, progress)?;
            }
            _ => {}
        }
        Ok(())
    }

    fn set_max_blend_distance(&mut self) {
        let max_radius = self.points.max_radius();
        self.max_blend_distance = match self.surface {
            SurfaceKind::Smooth if self.has_front_sides => f32::INFINITY,
            SurfaceKind::Smooth => (1.0 + MIN_SLIT_DEPTH) * max_radius,
            SurfaceKind::Mls => max_radius,
            surface if surface.blends_discs() => max_radius,
            _ => 0.0,
        };
    }
}

/// The columns of a cloud by structure.
struct Parts<'a> {
    surface: PointColumns<'a>,
    lines: PointColumns<'a>,
    scatter: PointColumns<'a>,
}

/// Splits columns by structure; none if all points are part of the surface.
fn parts<'a>(columns: PointColumns<'a>, geometry: &'a CloudGeometry) -> Option<Parts<'a>> {
    let structures = geometry.structures()?;
    let part = |kind, structure| columns.only(structures, kind, structure);
    Some(Parts {
        surface: part(geometry.surface, Structure::Surface),
        lines: part(SurfaceKind::Capsule, Structure::Line),
        scatter: part(scatter_kind(geometry.cloud().has_leaves()), Structure::Scatter),
    })
}

/// Returns the shape of scattered points.
fn scatter_kind(has_leaves: bool) -> SurfaceKind {
    if has_leaves { SurfaceKind::Leaves } else { SurfaceKind::Sphere }
}

/// Returns the bounding box of a tree.
pub(super) fn root_bounds(nodes: &[BvhNode]) -> Aabb {
    let Some(root) = nodes.first() else { return Aabb::EMPTY };
    let children = (0..LANES).filter(|&lane| root.child(lane).is_some());
    children.map(|lane| root.bounds(lane)).fold(Aabb::EMPTY, Aabb::union)
}

fn deformed_columns<'a>(
    deformed: &'a Deformed,
    geometry: &'a CloudGeometry,
) -> Result<PointColumns<'a>> {
    let Deformed { positions, normals, radii, .. } = deformed;
    let columns = PointColumns::new(shape(geometry), positions, normals, radii, geometry.colors())?;
    Ok(scaled(columns.at_rest(geometry.cloud().positions()), geometry))
}

/// Returns the shape of the points of a surface. Without normals those of `SplatFit` are balls.
fn shape(geometry: &CloudGeometry) -> SurfaceKind {
    match geometry.surface {
        SurfaceKind::SplatFit if geometry.cloud().normals.is_none() => SurfaceKind::Sphere,
        surface => surface,
    }
}

/// Scales the radii of columns as the options of the surface ask for.
fn scaled<'a>(columns: PointColumns<'a>, geometry: &CloudGeometry) -> PointColumns<'a> {
    columns.with_radius_factor(geometry.options.radius_factor(geometry.surface))
}
