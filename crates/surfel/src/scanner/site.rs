//! Solids by signed distance, and the search for the first of them along a beam.

use crate::math::DVec3;
use crate::math::Vec3;

/// A shape with a colour. Points are in the shape's own frame, metres, Z up.
pub trait Solid: Send + Sync {
    /// Signed distance to the surface, negative inside; outside it may be too short, never much too long.
    fn distance(&self, point: DVec3) -> f64;

    /// sRGB-encoded colour of the surface in [0, 1]; `normal` is in world space.
    fn color(&self, point: DVec3, normal: DVec3) -> Vec3;

    /// A box that contains the surface.
    fn bounds(&self) -> Bounds;

    /// ASPRS class: 1 is unclassified.
    fn class(&self) -> u8 {
        1
    }
}

/// An axis-aligned box; `Aabb` in double precision, with room for the infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub min: DVec3,
    pub max: DVec3,
}

/// A ray in double precision; `direction` has unit length.
#[derive(Clone, Copy, Debug)]
pub struct Beam {
    pub origin: DVec3,
    pub direction: DVec3,
}

/// The first surface along a beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub distance: f64,
    pub part_idx: usize,
}

/// Everything that stands in front of a scanner.
#[derive(Default)]
pub struct Site {
    parts: Vec<(Bounds, Box<dyn Solid>)>,
}

impl Site {
    /// Adds a part. Beams try parts in this order: put large ground last, most beams then end before it.
    pub fn add(&mut self, solid: impl Solid + 'static) {
        self.parts.push((solid.bounds(), Box::new(solid)));
    }

    pub fn with(mut self, solid: impl Solid + 'static) -> Self {
        self.add(solid);
        self
    }

    pub fn part(&self, part_idx: usize) -> &dyn Solid {
        &*self.parts[part_idx].1
    }

    /// Signed distance to the nearest part.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.parts.iter().map(|(_, solid)| solid.distance(point)).fold(f64::INFINITY, f64::min)
    }

    /// The first surface along `beam` nearer than `max_range`.
    pub fn first_hit(&self, beam: &Beam, max_range: f64) -> Option<Hit> {
        let mut nearest = None;
        let mut limit = max_range;
        for (part_idx, (bounds, solid)) in self.parts.iter().enumerate() {
            let Some((enter, leave)) = bounds.span(beam, limit) else { continue };
            if let Some(distance) = sphere_trace(&**solid, beam, enter, leave) {
                limit = distance;
                nearest = Some(Hit { distance, part_idx });
            }
        }
        nearest
    }

    /// Unit normal of a part's surface: the gradient of its distance, by differences over 2 mm.
    pub fn normal(&self, part_idx: usize, point: DVec3) -> DVec3 {
        let corners = [
            DVec3::new(1.0, -1.0, -1.0),
            DVec3::new(-1.0, -1.0, 1.0),
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(1.0, 1.0, 1.0),
        ];
        let solid = self.part(part_idx);
        let sum = |sum, corner: DVec3| sum + corner * solid.distance(point + 0.002 * corner);
        corners.into_iter().fold(DVec3::ZERO, sum).try_normalize().unwrap_or(DVec3::Z)
    }
}

impl Bounds {
    pub const EVERYWHERE: Self = Self { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };

    pub fn around(center: DVec3, half: DVec3) -> Self {
        Self { min: center - half, max: center + half }
    }

    pub fn corners(self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |bit: usize, low, high| if i & bit == 0 { low } else { high };
            DVec3::new(
                pick(1, self.min.x, self.max.x),
                pick(2, self.min.y, self.max.y),
                pick(4, self.min.z, self.max.z),
            )
        })
    }

    /// The part of 0 ..= `limit` for which `beam` is inside.
    fn span(&self, beam: &Beam, limit: f64) -> Option<(f64, f64)> {
        let (mut enter, mut leave) = (0.0f64, limit);
        for axis in 0..3 {
            let inverse = 1.0 / beam.direction[axis];
            let a = (self.min[axis] - beam.origin[axis]) * inverse;
            let b = (self.max[axis] - beam.origin[axis]) * inverse;
            // A beam within a face gives NaN, which `min` and `max` pass over.
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter < leave).then_some((enter, leave))
    }
}

/// Walks by the distance to the surface until there is none left (Hart, Sphere Tracing, 1996).
fn sphere_trace(solid: &dyn Solid, beam: &Beam, enter: f64, leave: f64) -> Option<f64> {
    // Along a grazing beam steps get short; those that find nothing in so many are let go.
    const MAX_STEPS: usize = 300;
    let mut t = enter;
    for _ in 0..MAX_STEPS {
        let distance = solid.distance(beam.origin + t * beam.direction);
        if distance.abs() < 1e-5 * (1.0 + t) {
            return Some(t);
        }
        // Where wear is steeper than its allowance a step may go through the surface; the next goes back.
        t += distance;
        if t < enter || leave < t {
            return None;
        }
    }
    None
}
