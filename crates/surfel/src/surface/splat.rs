//! Splats: the discs just behind the first one blended into a smooth surface (Wiesmeier 2011, 'multi').

use super::SurfaceKind;
use crate::math::{DVec3, SymmetricMatrix, Vec3, smallest_eigenvector};

/// Discs blended at most; the nearest are kept.
pub const MAX_GATHERED: usize = 16;

/// One of the discs that a ray pierced.
#[derive(Clone, Copy, Debug)]
pub struct Gathered {
    pub center: Vec3,
    /// Unit.
    pub normal: Vec3,
    pub radius: f32,
    /// Linear.
    pub color: Vec3,
    /// Where the ray pierced the disc.
    pub position: Vec3,
}

impl Gathered {
    /// Fills unused places.
    pub const NONE: Self = Self {
        center: Vec3::ZERO,
        normal: Vec3::Z,
        radius: 0.0,
        color: Vec3::ZERO,
        position: Vec3::ZERO,
    };
}

/// Farthest distance gathered if a disc of `radius` is hit at `distance`; the least over all hits counts,
/// which does not depend on the order in which they are found.
#[inline(always)]
pub fn gather_limit(distance: f32, radius: f32) -> f32 {
    distance + radius
}

/// Unit normal facing against `direction`, and colour, of the surface that `hits` (nearest first) describe.
pub fn blend(kind: SurfaceKind, hits: &[Gathered], direction: Vec3) -> (Vec3, Vec3) {
    let facing = |normal: Vec3| if 0.0 < normal.dot(direction) { -normal } else { normal };
    let (mut normal, mut color, mut total) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for hit in hits {
        let weight = (1.0 - hit.position.distance(hit.center) / hit.radius).max(1e-4);
        normal += weight * if kind == SurfaceKind::Splat { facing(hit.normal) } else { hit.normal };
        color += weight * hit.color;
        total += weight;
    }
    if kind == SurfaceKind::SplatFit {
        normal = plane_normal(hits).unwrap_or(hits[0].normal);
    }
    // Opposite normals may cancel in splat-mean; the nearest disc's own is then as good as any.
    (facing(normal.try_normalize().unwrap_or(hits[0].normal)), color / total)
}

/// Normal of the plane through the gathered points, if they span one.
fn plane_normal(hits: &[Gathered]) -> Option<Vec3> {
    let relative = |hit: &Gathered| (hit.center - hits[0].center).as_dvec3();
    let mean = hits.iter().map(relative).sum::<DVec3>() / hits.len() as f64;
    let mut covariance = SymmetricMatrix::default();
    for hit in hits {
        covariance.add_outer(relative(hit) - mean, 1.0);
    }
    let (normal, values) = smallest_eigenvector(&covariance);
    // Fewer than three points, or points on a line, leave the second eigenvalue at zero.
    (1e-4 * values[2] < values[1]).then(|| normal.as_vec3())
}
