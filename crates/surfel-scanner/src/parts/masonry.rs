//! Walls and arches of blocks, which stand on z = 0 of their own frame, and a polished ball.

use super::stone;
use crate::classes::BUILDING;
use crate::noise::{noise, unit};
use crate::sdf::{DAabb, Sdf};
use std::f64::consts::PI;
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;
use surfel_core::math::hash;

/// A box of blocks in running bond with worn edges.
pub struct Ashlar {
    /// Half the size of the box.
    pub half: DVec3,
    /// Length, depth and height of one block.
    pub block: DVec3,
    /// Seed of the stone.
    pub seed: u64,
}

/// A round arch of voussoirs on two piers; the opening spans x, the depth lies along y.
pub struct Arch {
    /// Height of the springing in metres.
    pub spring_height: f64,
    /// Radius of the opening.
    pub inner_radius: f64,
    /// Thickness of the ring and the piers.
    pub ring: f64,
    /// Half the depth.
    pub half_depth: f64,
    /// Seed of the stone.
    pub seed: u64,
}

/// A polished ball.
pub struct MarbleBall {
    /// Centre.
    pub center: DVec3,
    /// Radius.
    pub radius: f64,
}

impl Sdf for Ashlar {
    fn distance(&self, point: DVec3) -> f64 {
        let p = point - DVec3::Z * self.half.z;
        let sharp = box_distance(p, self.half);
        if 0.3 < sharp {
            return sharp;
        }
        // Noise limits the rounding of edges, so that stone is sharp in some parts and crumbled in others.
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

    fn bounds(&self) -> DAabb {
        DAabb::around(DVec3::Z * self.half.z, self.half)
    }

    fn class(&self) -> u8 {
        BUILDING
    }
}

impl Ashlar {
    /// Returns the block's index along each axis, and the position of `p` in the block, from 0 to 1.
    fn block_at(&self, p: DVec3) -> (DVec3, DVec3) {
        let mut q = (p + self.half) / self.block;
        // A point on the top face belongs to the top course.
        let course = q.z.floor().clamp(0.0, (2.0 * self.half.z / self.block.z - 0.01).floor());
        q.x += 0.5 * (course as i64).rem_euclid(2) as f64;
        let cell = DVec3::new(q.x.floor(), q.y.floor(), course);
        (cell, q - cell)
    }

    fn joint_depth(&self, p: DVec3) -> f64 {
        let (_, fraction) = self.block_at(p);
        let gap = fraction.min(DVec3::ONE - fraction) * self.block;
        let inner = self.half - DVec3::splat(0.06);
        // A face that lies along joints is no joint.
        let nearest = (0..3).filter(|&axis| p[axis].abs() < inner[axis]).map(|axis| gap[axis]);
        groove(nearest.fold(f64::INFINITY, f64::min))
    }
}

impl Sdf for Arch {
    fn distance(&self, point: DVec3) -> f64 {
        let in_plane = if point.z < self.spring_height {
            self.pier_distance(point)
        } else {
            self.ring_distance(point)
        };
        let setback = 0.05 * unit(self.stone_at(point));
        let depth = point.y.abs() - self.half_depth + setback;
        let gap = in_plane.max(depth).max(-point.z);
        0.8 * (gap + groove(self.joint_distance(point)))
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        stone::sandstone(point, self.stone_at(point))
            * joint_shade(groove(self.joint_distance(point)))
    }

    fn bounds(&self) -> DAabb {
        let outer = self.inner_radius + self.ring;
        let half = DVec3::new(outer, self.half_depth, 0.5 * (self.spring_height + outer));
        DAabb::around(DVec3::Z * half.z, half)
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

    fn ring_distance(&self, point: DVec3) -> f64 {
        let r = point.x.hypot(point.z - self.spring_height);
        (r - self.inner_radius - 0.5 * self.ring).abs() - 0.5 * self.ring
    }

    /// Returns the position along the ring, from 0 at the right springing to `N_VOUSSOIRS` at the left one.
    fn voussoir(&self, point: DVec3) -> f64 {
        (point.z - self.spring_height).atan2(point.x) / PI * N_VOUSSOIRS
    }

    /// Returns the distance to the nearest joint between courses of the piers or voussoirs of the ring.
    fn joint_distance(&self, point: DVec3) -> f64 {
        if point.z < self.spring_height {
            return (point.z - COURSE_HEIGHT * (point.z / COURSE_HEIGHT).round()).abs();
        }
        let r = point.x.hypot(point.z - self.spring_height);
        let position = self.voussoir(point);
        (position - position.round()).abs() * r * PI / N_VOUSSOIRS
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

impl Sdf for MarbleBall {
    fn distance(&self, point: DVec3) -> f64 {
        (point - self.center).length() - self.radius
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        stone::marble(point)
    }

    fn bounds(&self) -> DAabb {
        DAabb::around(self.center, DVec3::splat(self.radius))
    }
}

/// Returns the depth of the joint between two blocks at a distance from its middle.
pub fn groove(distance: f64) -> f64 {
    0.03 * (1.0 - distance / 0.035).max(0.0)
}

/// Returns the brightness of a joint, which dirt darkens.
pub fn joint_shade(depth: f64) -> f32 {
    1.0 - 14.0 * depth as f32
}

/// Returns the signed distance to the box |x|, |y|, |z| <= `half`.
pub fn box_distance(p: DVec3, half: DVec3) -> f64 {
    let q = p.abs() - half;
    q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
}
