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
///
/// The thesis turns each normal toward the ray's origin on its own. On a silhouette that turns the discs
/// behind the bend inside out; here the nearest one is turned, and the others follow it.
pub fn blend(kind: SurfaceKind, hits: &[Gathered], direction: Vec3) -> (Vec3, Vec3) {
    let nearest = turned_with(hits[0].normal, -direction);
    let (mut normal, mut color, mut total) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for hit in hits {
        let weight = (1.0 - hit.position.distance(hit.center) / hit.radius).max(1e-4);
        let is_aligned = kind == SurfaceKind::Splat;
        normal += weight * if is_aligned { turned_with(hit.normal, nearest) } else { hit.normal };
        color += weight * hit.color;
        total += weight;
    }
    // Opposite normals may cancel in splat-mean; the nearest disc's own is then as good as any.
    let normal = match kind {
        SurfaceKind::Splat => facing(normal.normalize_or(nearest), direction),
        SurfaceKind::SplatFit => turned_with(plane_normal(hits).unwrap_or(nearest), -direction),
        _ => turned_with(normal.normalize_or(nearest), -direction),
    };
    (normal, color / total)
}

/// `normal` with the sign that it shares with `guide`.
fn turned_with(normal: Vec3, guide: Vec3) -> Vec3 {
    if normal.dot(guide) < 0.0 { -normal } else { normal }
}

/// A normal that leans away a little, over a bend, is only brought upright: turned around it would
/// point inward.
fn facing(normal: Vec3, direction: Vec3) -> Vec3 {
    let away = normal.dot(direction);
    if away <= 0.0 {
        return normal;
    }
    (normal - away * direction).try_normalize().unwrap_or(-direction)
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
