//! Fluted columns and their drums, which stand on z = 0 of their own frame.

use super::masonry::{box_distance, groove, joint_shade};
use super::stone;
use crate::classes::BUILDING;
use crate::noise::mix;
use crate::sdf::{DAabb, Sdf};
use std::f64::consts::PI;
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;
use surfel_core::math::hash;

/// A fluted column on a plinth, under a capital.
pub struct ColumnSdf {
    /// Height in metres.
    pub height: f64,
    /// Radius at the base in metres.
    pub radius: f64,
    /// Seed of the stone.
    pub seed: u64,
}

/// One fluted drum of a column.
pub struct Drum {
    /// Height in metres.
    pub height: f64,
    /// Radius at the base in metres.
    pub radius: f64,
    /// Seed of the stone.
    pub seed: u64,
}

const DRUM_HEIGHT: f64 = 1.15;
const N_FLUTES: f64 = 18.0;

impl Sdf for ColumnSdf {
    fn distance(&self, point: DVec3) -> f64 {
        let r = point.truncate().length();
        // The corners of the plinth are farthest from the axis.
        let hull = (r - 1.95 * self.radius).max(point.z - self.height).max(-point.z);
        if 0.3 < hull {
            return hull;
        }
        let plinth = slab_distance(point, 1.36 * self.radius, 0.0, 0.22);
        let torus = ring_distance(r, point.z - 0.33, 1.08 * self.radius, 0.15);
        let neck = ring_distance(r, point.z - self.capital_base(), 0.84 * self.radius, 0.06);
        let abacus = slab_distance(point, 1.28 * self.radius, self.height - 0.24, self.height);
        let parts = [
            plinth,
            torus,
            neck,
            abacus,
            self.echinus_distance(r, point.z),
            self.shaft_distance(point, r),
        ];
        parts.into_iter().fold(f64::INFINITY, f64::min)
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        let drum = (point.z / DRUM_HEIGHT).floor();
        stone::sandstone(point, self.seed ^ hash(drum as i64 as u64))
            * joint_shade(drum_joint(point.z, self.height))
    }

    fn bounds(&self) -> DAabb {
        let half = DVec3::new(1.5 * self.radius, 1.5 * self.radius, 0.5 * self.height);
        DAabb::around(DVec3::Z * half.z, half)
    }

    fn class(&self) -> u8 {
        BUILDING
    }
}

impl ColumnSdf {
    fn capital_base(&self) -> f64 {
        self.height - 0.62
    }

    fn shaft_distance(&self, point: DVec3, r: f64) -> f64 {
        let fraction = (point.z / self.height).clamp(0.0, 1.0);
        // Entasis: the taper is slow at first, so the outline bulges.
        let radius = self.radius * mix(1.0, 0.82, fraction.powf(1.6));
        let side = r - radius + flute_depth(point) + drum_joint(point.z, self.height);
        (0.75 * side).max(point.z - self.height + 0.1).max(-point.z)
    }

    fn echinus_distance(&self, r: f64, z: f64) -> f64 {
        let fraction = (z - self.capital_base()) / 0.38;
        let bulge = (fraction.clamp(0.0, 1.0) * PI / 2.0).sin();
        let side = r - self.radius * mix(0.82, 1.24, bulge);
        (0.6 * side).max(self.capital_base() - z).max(z - self.capital_base() - 0.38)
    }
}

impl Sdf for Drum {
    fn distance(&self, point: DVec3) -> f64 {
        let r = point.truncate().length();
        let side = 0.75 * (r - self.radius + flute_depth(point));
        side.max(-point.z).max(point.z - self.height)
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        stone::sandstone(point, self.seed)
    }

    fn bounds(&self) -> DAabb {
        let half = DVec3::new(self.radius, self.radius, 0.5 * self.height);
        DAabb::around(DVec3::Z * half.z, half)
    }

    fn class(&self) -> u8 {
        BUILDING
    }
}

/// Returns the depth of the flutes, which meet in sharp edges as on Doric columns.
fn flute_depth(point: DVec3) -> f64 {
    let angle = point.y.atan2(point.x);
    0.055 * (0.5 * N_FLUTES * angle).cos().abs()
}

fn drum_joint(z: f64, height: f64) -> f64 {
    let joint = DRUM_HEIGHT * (z / DRUM_HEIGHT).round();
    if joint <= 0.0 || height - 0.7 < joint { 0.0 } else { groove((z - joint).abs()) }
}

/// Returns the signed distance to a square slab about the Z axis between two heights.
fn slab_distance(p: DVec3, half_width: f64, bottom: f64, top: f64) -> f64 {
    let half = DVec3::new(half_width, half_width, 0.5 * (top - bottom));
    box_distance(p - DVec3::Z * 0.5 * (top + bottom), half)
}

/// Returns the signed distance to a torus about the Z axis, from the distance to that axis and the height above its
/// middle.
fn ring_distance(r: f64, z: f64, ring_radius: f64, tube_radius: f64) -> f64 {
    // The inside is filled, as the shaft is there.
    (r - ring_radius).max(0.0).hypot(z) - tube_radius
}
