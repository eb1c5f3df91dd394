//! The surfaces that kernels trace.

use crate::numbers::{TRIANGLE, surface_number};
use surfel_core::flat::FlatCloud;
use surfel_core::surface::{EdgeTest, MAX_CANDIDATES, MAX_GATHERED, SurfaceKind};

/// A surface that kernels trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Surface {
    /// Spheres.
    Sphere,
    /// Capsules.
    Capsule,
    /// Clusters of leaves.
    Leaves,
    /// Flat discs.
    Disc,
    /// Flat discs up to their rims.
    DiscRims,
    /// Blended discs.
    Splat,
    /// Blended discs up to their rims.
    SplatRims,
    /// Blended discs with the normal of a plane through their centres.
    SplatFit,
    /// Blended discs at their mean distance.
    Cylinder,
    /// Moving least squares with polynomials of this degree, from 1 to 3.
    Mls(u32),
    /// The field of weighted planes.
    Implicit,
    /// An octree with the field at the corners of its cells.
    Octree,
    /// An octree with a plane in each cell.
    OctreeSplat,
    /// The smooth surface.
    Smooth,
    /// Triangles.
    Triangle,
}

impl Surface {
    /// Every surface.
    pub const ALL: [Self; 17] = [
        Self::Sphere,
        Self::Capsule,
        Self::Leaves,
        Self::Disc,
        Self::DiscRims,
        Self::Splat,
        Self::SplatRims,
        Self::SplatFit,
        Self::Cylinder,
        Self::Mls(1),
        Self::Mls(2),
        Self::Mls(3),
        Self::Implicit,
        Self::Octree,
        Self::OctreeSplat,
        Self::Smooth,
        Self::Triangle,
    ];

    /// Returns the surface by which a kind with the options of a cloud is traced, or none if no kernel traces it.
    pub fn of_kind(kind: SurfaceKind, cloud: &FlatCloud) -> Option<Self> {
        let (options, has_rims) = (&cloud.options, cloud.edge_test == EdgeTest::Off);
        match kind {
            SurfaceKind::Disc if has_rims => Some(Self::DiscRims),
            SurfaceKind::Splat | SurfaceKind::SplatMean if has_rims => Some(Self::SplatRims),
            SurfaceKind::Sphere => Some(Self::Sphere),
            SurfaceKind::Capsule => Some(Self::Capsule),
            SurfaceKind::Leaves => Some(Self::Leaves),
            SurfaceKind::Disc => Some(Self::Disc),
            SurfaceKind::Splat | SurfaceKind::SplatMean => Some(Self::Splat),
            SurfaceKind::Smooth => Some(Self::Smooth),
            SurfaceKind::SplatFit if cloud.fits_balls() => None,
            SurfaceKind::SplatFit => Some(Self::SplatFit),
            SurfaceKind::Cylinder => Some(Self::Cylinder),
            SurfaceKind::Mls if options.degree == 1 => Some(Self::Mls(1)),
            SurfaceKind::Mls if options.degree == 2 => Some(Self::Mls(2)),
            SurfaceKind::Mls => Some(Self::Mls(3)),
            SurfaceKind::Points => None,
            SurfaceKind::Octree => Some(Self::Octree),
            SurfaceKind::OctreeSplat => Some(Self::OctreeSplat),
            SurfaceKind::Implicit => Some(Self::Implicit),
            // They are composited, not hit.
            SurfaceKind::Gaussian => None,
        }
    }

    /// Returns the number by which kernels know the surface.
    pub fn number(self) -> u32 {
        match self {
            Self::SplatFit => surface_number(SurfaceKind::SplatFit),
            Self::Cylinder => surface_number(SurfaceKind::Cylinder),
            Self::Splat | Self::SplatRims => surface_number(SurfaceKind::Splat),
            Self::Smooth => surface_number(SurfaceKind::Smooth),
            Self::Mls(_) => surface_number(SurfaceKind::Mls),
            Self::Implicit => surface_number(SurfaceKind::Implicit),
            Self::Octree => surface_number(SurfaceKind::Octree),
            Self::OctreeSplat => surface_number(SurfaceKind::OctreeSplat),
            Self::Triangle => TRIANGLE,
            Self::Sphere | Self::Capsule | Self::Leaves | Self::Disc | Self::DiscRims => {
                surface_number(self.shape())
            }
        }
    }

    /// Returns true if the blocks of the points' tree hold the surface.
    pub fn is_in_blocks(self) -> bool {
        !matches!(self, Self::Implicit | Self::Octree | Self::OctreeSplat)
    }

    /// Returns true if passes test the first disc of each ray before others search what is behind it; with `is_any` any
    /// disc of rays toward a light.
    pub fn tests_first_disc(self, is_any: bool) -> bool {
        match self {
            Self::Smooth => true,
            Self::Disc | Self::Splat | Self::SplatFit => is_any,
            _ => false,
        }
    }

    /// Returns the maximum number of discs that are gathered along a ray.
    pub fn max_discs(self) -> usize {
        match self {
            Self::SplatFit | Self::Cylinder => MAX_CANDIDATES,
            _ => MAX_GATHERED,
        }
    }

    /// Returns the kind of the shapes in the blocks.
    pub fn shape(self) -> SurfaceKind {
        match self {
            Self::Sphere => SurfaceKind::Sphere,
            Self::Capsule => SurfaceKind::Capsule,
            Self::Leaves => SurfaceKind::Leaves,
            Self::Mls(_) => SurfaceKind::Mls,
            Self::Disc
            | Self::DiscRims
            | Self::Splat
            | Self::SplatRims
            | Self::SplatFit
            | Self::Cylinder
            | Self::Implicit
            | Self::Octree
            | Self::OctreeSplat
            | Self::Smooth
            | Self::Triangle => SurfaceKind::Disc,
        }
    }
}
