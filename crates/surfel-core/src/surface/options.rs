//! Options of surface kinds: how far from a ray points count, and how many a hit needs.

use super::align::Align;
use super::kind::SurfaceKind;
use super::mls;

/// Number of points that a hit of a ray of finite width needs: three span a surface.
pub const DEFAULT_DENSITY: u32 = 3;

/// The rule that says how far behind the first disc of a ray others are blended with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum GatherLimit {
    /// Up to the least distance plus radius of all discs that the ray hits.
    #[default]
    Least,
    /// Up to the distance plus radius of the nearest disc (Wiesmeier, Ray Tracing Point Clouds, 2011). Where radii
    /// differ much, more discs are looked at.
    Nearest,
}

impl GatherLimit {
    /// Every rule with its name.
    pub const ALL: [(&'static str, Self); 2] = [("least", Self::Least), ("nearest", Self::Nearest)];
}

/// Options of the surface kinds of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// The rule by which `Splat` turns normals before it blends them.
    pub align: Align,
    /// The rule that says which discs are blended.
    pub gather_limit: GatherLimit,
    /// Distance before which new rays ignore hits, in radii. The height of their origin is proportional to it. Each kind of
    /// surface has a default.
    pub min_distance: Option<f32>,
    /// Factor on the radii of points: how far from a ray or a position they count. Each kind has a default.
    pub reach: Option<f32>,
    /// Minimum number of points at a hit of `Cylinder`. Where there are fewer, a ray goes through a hole.
    pub density: u32,
    /// Degree of the polynomials of `Mls`, from 1 (planes) to 3.
    pub degree: u32,
}

impl Default for SurfaceOptions {
    fn default() -> Self {
        Self {
            align: Align::default(),
            gather_limit: GatherLimit::default(),
            min_distance: None,
            reach: None,
            density: DEFAULT_DENSITY,
            degree: mls::DEFAULT_DEGREE,
        }
    }
}

impl SurfaceOptions {
    /// Returns the factor that multiplies the points' radii before tracing.
    pub fn radius_factor(&self, kind: SurfaceKind) -> f32 {
        match self.reach.filter(|_| kind.has_reach()) {
            Some(reach) if kind == SurfaceKind::Mls => reach / mls::SUPPORT_FACTOR,
            Some(reach) => reach,
            None => kind.radius_factor(),
        }
    }

    /// Returns the factor on a point's radius that gives the distance which new rays skip: points with a long reach are
    /// hit again farther away.
    pub fn spawn_factor(&self, kind: SurfaceKind) -> f32 {
        if let Some(distance) = self.min_distance.filter(|_| kind.is_continuous()) {
            return distance / kind.spawn_distance();
        }
        match kind {
            SurfaceKind::Cylinder => self.radius_factor(kind).max(1.0),
            SurfaceKind::Mls | SurfaceKind::SplatFit => {
                (self.radius_factor(kind) / kind.radius_factor()).max(1.0)
            }
            _ => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    //! Factors that follow from options.

    use super::*;

    #[test]
    fn a_longer_reach_lets_new_rays_skip_more() {
        let options = SurfaceOptions { reach: Some(8.0), ..SurfaceOptions::default() };
        for kind in [SurfaceKind::SplatFit, SurfaceKind::Mls] {
            let expected = options.radius_factor(kind) / kind.radius_factor();
            assert!(1.0 < expected);
            assert_eq!(options.spawn_factor(kind), expected, "{kind:?}");
            assert_eq!(SurfaceOptions::default().spawn_factor(kind), 1.0);
        }
    }
}
