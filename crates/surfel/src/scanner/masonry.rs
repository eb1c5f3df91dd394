//! What masons make: walls of blocks, fluted columns, arches. Each stands on z = 0 of its own frame.

use super::noise::{mix, noise, unit};
use super::site::{Bounds, Solid};
use super::stone;
use crate::math::DVec3;
use crate::math::Vec3;
use crate::math::hash;
use std::f64::consts::{PI, TAU};

/// ASPRS class 'building'.
const BUILDING: u8 = 6;

/// A box of blocks in running bond, its edges worn.
pub struct Ashlar {
    pub half: DVec3,
    /// Length, depth and height of one block.
    pub block: DVec3,
    pub seed: u64,
}

/// A fluted column on a plinth, under a capital.
pub struct Column {
    pub height: f64,
    pub radius: f64,
    pub seed: u64,
}

/// One fluted drum of a column.
pub struct Drum {
    pub height: f64,
    pub radius: f64,
    pub seed: u64,
}

/// A round arch of voussoirs on two piers; the opening spans x, the depth lies along y.
pub struct Arch {
    pub spring_height: f64,
    pub inner_radius: f64,
    pub ring: f64,
    pub half_depth: f64,
    pub seed: u64,
}

/// A polished ball.
pub struct MarbleBall {
    pub center: DVec3,
    pub radius: f64,
}

impl Solid for Ashlar {
    fn distance(&self, point: DVec3) -> f64 {
        let p = point - DVec3::Z * self.half.z;
        let sharp = box_distance(p, self.half);
        if 0.3 < sharp {
            return sharp;
        }
        // Edges are rounded as far as noise lets them be: cut stone stays sharp here and crumbles there.
        let round = box_distance(p, self.half - DVec3::splat(0.22)) - 0.22;
        let keep = 0.05 + 0.05 * noise(point * 1.9 + DVec3::splat(unit(self.seed) * 64.0));
        sharp.max(round - keep) + self.joint_depth(p)
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        let p = point - DVec3::Z * self.half.z;
        let (cell, _) = self.block_at(p);
        let key = self.seed
            ^ hash(cell.x as i64 as u64 ^ hash(cell.y as i64 as u64 ^ hash(cell.z as i64 as u64)));
        stone::sandstone(point, key) * joint_shade(self.joint_depth(p))
    }

    fn bounds(&self) -> Bounds {
        Bounds::around(DVec3::Z * self.half.z, self.half)
    }

    fn class(&self) -> u8 {
        BUILDING
    }
}

impl Ashlar {
    /// The block's index along each axis, and where in it `p` lies, from 0 to 1.
    fn block_at(&self, p: DVec3) -> (DVec3, DVec3) {
        let mut q = (p + self.half) / self.block;
        // A point on the top face belongs to the top course.
        let course = q.z.floor().clamp(0.0, (2.0 * self.half.z / self.block.z - 0.01).floor());
        q.x += 0.5 * (course as i64).rem_euclid(2) as f64;
        let cell = DVec3::new(q.x.floor(), q.y.floor(), course);
        (cell, q - cell)
    }

    fn joint_depth(&self, p: DVec3) -> f64 {
        let (_, share) = self.block_at(p);
        let gap = share.min(DVec3::ONE - share) * self.block;
        let inner = self.half - DVec3::splat(0.06);
        // A face that itself lies along joints is no joint.
        let nearest = (0..3).filter(|&axis| p[axis].abs() < inner[axis]).map(|axis| gap[axis]);
        groove(nearest.fold(f64::INFINITY, f64::min))
    }
}

impl Solid for Column {
    fn distance(&self, point: DVec3) -> f64 {
        let r = point.truncate().length();
        // The corners of the plinth reach furthest.
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

    fn bounds(&self) -> Bounds {
        let half = DVec3::new(1.5 * self.radius, 1.5 * self.radius, 0.5 * self.height);
        Bounds::around(DVec3::Z * half.z, half)
    }

    fn class(&self) -> u8 {
        BUILDING
    }
}

impl Column {
    fn capital_base(&self) -> f64 {
        self.height - 0.62
    }

    fn shaft_distance(&self, point: DVec3, r: f64) -> f64 {
        let share = (point.z / self.height).clamp(0.0, 1.0);
        // Entasis: the taper is slow at first, the outline bulges.
        let radius = self.radius * mix(1.0, 0.82, share.powf(1.6));
        let side = r - radius + flute_depth(point) + drum_joint(point.z, self.height);
        (0.75 * side).max(point.z - self.height + 0.1).max(-point.z)
    }

    fn echinus_distance(&self, r: f64, z: f64) -> f64 {
        let share = (z - self.capital_base()) / 0.38;
        let bulge = (share.clamp(0.0, 1.0) * PI / 2.0).sin();
        let side = r - self.radius * mix(0.82, 1.24, bulge);
        (0.6 * side).max(self.capital_base() - z).max(z - self.capital_base() - 0.38)
    }
}

impl Solid for Drum {
    fn distance(&self, point: DVec3) -> f64 {
        let r = point.truncate().length();
        let side = 0.75 * (r - self.radius + flute_depth(point));
        side.max(-point.z).max(point.z - self.height)
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        stone::sandstone(point, self.seed)
    }

    fn bounds(&self) -> Bounds {
        let half = DVec3::new(self.radius, self.radius, 0.5 * self.height);
        Bounds::around(DVec3::Z * half.z, half)
    }

    fn class(&self) -> u8 {
        BUILDING
    }
}

impl Solid for Arch {
    fn distance(&self, point: DVec3) -> f64 {
        let (in_plane, joint) = if point.z < self.spring_height {
            (self.pier_distance(point), self.course_joint(point.z))
        } else {
            (self.ring_offset(point), self.radial_joint(point))
        };
        let stands_out = 0.05 * unit(self.stone_at(point));
        let depth = point.y.abs() - self.half_depth + stands_out;
        let gap = in_plane.max(depth).max(-point.z);
        0.8 * (gap + groove(joint))
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        let joint = if point.z < self.spring_height {
            self.course_joint(point.z)
        } else {
            self.radial_joint(point)
        };
        stone::sandstone(point, self.stone_at(point)) * joint_shade(groove(joint))
    }

    fn bounds(&self) -> Bounds {
        let outer = self.inner_radius + self.ring;
        let half = DVec3::new(outer, self.half_depth, 0.5 * (self.spring_height + outer));
        Bounds::around(DVec3::Z * half.z, half)
    }

    fn class(&self) -> u8 {
        BUILDING
    }
}

const N_VOUSSOIRS: f64 = 13.0;
const COURSE_HEIGHT: f64 = 0.5;

impl Arch {
    fn pier_distance(&self, point: DVec3) -> f64 {
        (point.x.abs() - self.inner_radius - 0.5 * self.ring).abs() - 0.5 * self.ring
    }

    fn ring_offset(&self, point: DVec3) -> f64 {
        let r = point.x.hypot(point.z - self.spring_height);
        (r - self.inner_radius - 0.5 * self.ring).abs() - 0.5 * self.ring
    }

    /// From 0 at the right springing to `N_VOUSSOIRS` at the left one.
    fn voussoir(&self, point: DVec3) -> f64 {
        (point.z - self.spring_height).atan2(point.x) / PI * N_VOUSSOIRS
    }

    fn radial_joint(&self, point: DVec3) -> f64 {
        let r = point.x.hypot(point.z - self.spring_height);
        let share = self.voussoir(point);
        (share - share.round()).abs() * r * PI / N_VOUSSOIRS
    }

    fn course_joint(&self, z: f64) -> f64 {
        (z - COURSE_HEIGHT * (z / COURSE_HEIGHT).round()).abs()
    }

    fn stone_at(&self, point: DVec3) -> u64 {
        let index = if point.z < self.spring_height {
            (point.z / COURSE_HEIGHT).floor() * point.x.signum() - 100.0
        } else {
            self.voussoir(point).floor()
        };
        hash(self.seed ^ hash(index as i64 as u64))
    }
}

impl Solid for MarbleBall {
    fn distance(&self, point: DVec3) -> f64 {
        (point - self.center).length() - self.radius
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        stone::marble(point)
    }

    fn bounds(&self) -> Bounds {
        Bounds::around(self.center, DVec3::splat(self.radius))
    }
}

const DRUM_HEIGHT: f64 = 1.15;
const N_FLUTES: f64 = 18.0;

/// Scallops that meet in sharp edges, as on Doric columns.
fn flute_depth(point: DVec3) -> f64 {
    let angle = point.y.atan2(point.x);
    0.055 * (0.5 * N_FLUTES * angle % TAU).cos().abs()
}

fn drum_joint(z: f64, height: f64) -> f64 {
    let joint = DRUM_HEIGHT * (z / DRUM_HEIGHT).round();
    if joint <= 0.0 || height - 0.7 < joint { 0.0 } else { groove((z - joint).abs()) }
}

/// Depth of the joint between two blocks at this distance from its middle.
fn groove(distance: f64) -> f64 {
    0.03 * (1.0 - distance / 0.035).max(0.0)
}

/// Dirt gathers in joints.
fn joint_shade(depth: f64) -> f32 {
    1.0 - 14.0 * depth as f32
}

fn box_distance(p: DVec3, half: DVec3) -> f64 {
    let q = p.abs() - half;
    q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
}

/// A square slab about the Z axis between two heights.
fn slab_distance(p: DVec3, half_width: f64, bottom: f64, top: f64) -> f64 {
    let half = DVec3::new(half_width, half_width, 0.5 * (top - bottom));
    box_distance(p - DVec3::Z * 0.5 * (top + bottom), half)
}

/// A torus about the Z axis, from the distance to that axis and the height above its middle.
fn ring_distance(r: f64, z: f64, ring_radius: f64, tube_radius: f64) -> f64 {
    // Filled inside: the shaft stands there.
    (r - ring_radius).max(0.0).hypot(z) - tube_radius
}
