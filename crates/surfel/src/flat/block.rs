//! A leaf block: eight points, quantised against their common corner.

use crate::math::{Aabb, LANES, LaneMask, Lanes, TO_INTEGER, Vec3, Vec3Lanes};
use crate::surface::{NORMAL_MAX, PointLanes};

/// Eight points in two cache lines, lane by lane.
///
/// Positions are 16 bits an axis on a grid of a power of two: off by at most 1/1000 of the radius,
/// which `fits` sees to. Radii have 10 bits and are off by at most 0.2 %. Normals have 10 bits an axis
/// and are off by at most 0.08 degrees.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PointBlock {
    /// Lower corner of the centres.
    origin: [f32; 3],
    /// Step of the radii as an f32, but for its low byte: that is the biased exponent of the positions' step.
    steps: u32,
    position: [[u16; LANES]; 3],
    /// From the low bits: x, y and z of the normal in 10 signed bits each, the upper 2 bits of the radius.
    normal: [u32; LANES],
    /// Lower 8 bits of the radius in steps; no steps at all mark an unused lane.
    radius: [u8; LANES],
    /// sRGB-encoded.
    color: [[u8; 3]; LANES],
}

/// A point as it goes into a block.
#[derive(Clone, Copy, Debug)]
pub struct BlockPoint {
    pub position: Vec3,
    /// Unit.
    pub normal: Vec3,
    pub radius: f32,
    /// sRGB-encoded.
    pub color: [u8; 3],
}

const POSITION_MAX: f32 = 65535.0;
const RADIUS_MAX: f32 = 1023.0;

/// Whether points of these bounds (of their centres) and radii may share a block within its precision.
pub fn fits(size: Vec3, radius_min: f32, radius_max: f32) -> bool {
    radius_max <= 4.0 * radius_min && size.max_element() / POSITION_MAX <= 1e-3 * radius_min
}

impl PointBlock {
    /// Encodes one to eight points.
    pub fn new(points: &[BlockPoint]) -> Self {
        let bounds = Aabb::of_points(points.iter().map(|p| p.position));
        let radius_max = points.iter().fold(0.0, |max, p| p.radius.max(max));
        // Rounded up, so that the largest radius has no more than the steps there are.
        let radius_step = ((radius_max / RADIUS_MAX).to_bits() + 0xff) & !0xff;
        let exponent = step_exponent(bounds.size().max_element() / POSITION_MAX);
        let mut block = Self {
            origin: bounds.min.to_array(),
            steps: radius_step | u32::from(exponent),
            ..bytemuck::Zeroable::zeroed()
        };
        let (position_step, radius_step) = (block.position_step(), block.radius_step());
        // Exact: the step is a power of two.
        let per_step = if 0.0 < position_step { 1.0 / position_step } else { 0.0 };
        for (lane, point) in points.iter().enumerate() {
            let steps = (point.position - bounds.min) * per_step;
            for axis in 0..3 {
                block.position[axis][lane] = rounded(steps[axis]) as u16;
            }
            let radius = if 0.0 < radius_step { point.radius / radius_step } else { 0.0 };
            let radius = rounded(radius.clamp(1.0, RADIUS_MAX)) & 0x3ff;
            block.radius[lane] = radius as u8;
            block.normal[lane] = packed_normal(point.normal) | (radius >> 8) << 30;
            block.color[lane] = point.color;
        }
        block
    }

    #[inline(always)]
    fn position_step(&self) -> f32 {
        f32::from_bits((self.steps & 0xff) << 23)
    }

    #[inline(always)]
    fn radius_step(&self) -> f32 {
        f32::from_bits(self.steps & !0xff)
    }

    /// Bit i is set if lane i holds a point.
    pub fn occupied(&self) -> u8 {
        let is_used = |lane: usize| self.radius_steps(lane) != 0;
        (0..LANES).fold(0, |bits, lane| bits | u8::from(is_used(lane)) << lane)
    }

    /// Lower corner of the centres.
    pub fn corner(&self) -> Vec3 {
        Vec3::from_array(self.origin)
    }

    /// Centres, relative to the corner.
    #[inline(always)]
    pub fn offsets<L: Lanes>(&self) -> Vec3Lanes<L> {
        let step = L::splat(self.position_step());
        Vec3Lanes {
            x: L::from_u16(&self.position[0]) * step,
            y: L::from_u16(&self.position[1]) * step,
            z: L::from_u16(&self.position[2]) * step,
        }
    }

    /// Centres, relative to `origin`. The corner is made relative first, so that rounding is in
    /// proportion to the distance.
    #[inline(always)]
    pub fn centers<L: Lanes>(&self, origin: Vec3) -> Vec3Lanes<L> {
        Vec3Lanes::splat(self.corner() - origin).plus(self.offsets())
    }

    /// The lanes of points whose centres lie in `region`, but for rounding.
    #[inline(always)]
    pub fn lanes_within<L: Lanes>(&self, region: &Aabb) -> u32 {
        let Vec3Lanes { x, y, z } = self.offsets::<L>();
        let (low, high) = (region.min - self.corner(), region.max - self.corner());
        let mut is_within = L::splat(0.0).less(self.radii());
        for (offset, low, high) in [(x, low.x, high.x), (y, low.y, high.y), (z, low.z, high.z)] {
            is_within = is_within & L::splat(low).less_equal(offset);
            is_within = is_within & offset.less_equal(L::splat(high));
        }
        is_within.bits()
    }

    #[inline(always)]
    pub fn radii<L: Lanes>(&self) -> L {
        let steps = L::from_u8(&self.radius) + L::from_top_bits(&self.normal) * L::splat(256.0);
        steps * L::splat(self.radius_step())
    }

    /// All that an intersection needs, relative to `origin`. The radius of an unused lane is 0.
    #[inline(always)]
    pub fn points<L: Lanes>(&self, origin: Vec3) -> PointLanes<L> {
        PointLanes { center: self.centers(origin), normal: self.normals(), radius: self.radii() }
    }

    /// Not of unit length, but never zero in a lane that holds a point.
    #[inline(always)]
    pub fn normals<L: Lanes>(&self) -> Vec3Lanes<L> {
        Vec3Lanes {
            x: L::from_signed_bits::<0>(&self.normal),
            y: L::from_signed_bits::<10>(&self.normal),
            z: L::from_signed_bits::<20>(&self.normal),
        }
    }

    pub fn position(&self, lane: usize) -> Vec3 {
        let steps = Vec3::from_array([0, 1, 2].map(|axis| f32::from(self.position[axis][lane])));
        Vec3::from_array(self.origin) + steps * self.position_step()
    }

    /// Unit.
    pub fn normal(&self, lane: usize) -> Vec3 {
        let axis = |shift: u32| ((self.normal[lane] << (22 - shift)) as i32 >> 22) as f32;
        Vec3::new(axis(0), axis(10), axis(20)).normalize()
    }

    pub fn radius(&self, lane: usize) -> f32 {
        self.radius_steps(lane) as f32 * self.radius_step()
    }

    pub(super) fn greatest_radius(&self) -> f32 {
        (0..LANES).map(|lane| self.radius(lane)).fold(0.0, f32::max)
    }

    fn radius_steps(&self, lane: usize) -> u32 {
        (self.normal[lane] >> 30) << 8 | u32::from(self.radius[lane])
    }

    /// sRGB-encoded.
    pub fn color(&self, lane: usize) -> [u8; 3] {
        self.color[lane]
    }
}

/// Biased exponent of the smallest power of two that is not below `wanted`, 0 for a step of zero.
fn step_exponent(wanted: f32) -> u8 {
    if wanted <= 0.0 {
        return 0;
    }
    let bits = wanted.to_bits();
    let is_power = bits.trailing_zeros() >= 23;
    ((bits >> 23) + u32::from(!is_power)).clamp(1, 254) as u8
}

/// Nearest integer to a number below 2^22, in the low bits: `round` is a call into the C library where SSE 4
/// is not assumed.
fn rounded(value: f32) -> u32 {
    (value + TO_INTEGER).to_bits()
}

/// `normal` times what makes its longest axis 511, rounded; Z if it has no direction.
fn packed_normal(normal: Vec3) -> u32 {
    let longest = normal.abs().max_element();
    let has_direction = 0.0 < longest && normal.is_finite();
    let normal = if has_direction { normal * (NORMAL_MAX / longest) } else { NORMAL_MAX * Vec3::Z };
    let [x, y, z] = normal.to_array().map(|n| rounded(n) & 0x3ff);
    x | y << 10 | z << 20
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PortableLanes, Random};

    fn random_points(n: usize, random: &mut Random) -> Vec<BlockPoint> {
        let mut gaussian = || random.next_gaussian() as f32;
        let mut vector = || Vec3::new(gaussian(), gaussian(), gaussian());
        (0..n)
            .map(|i| BlockPoint {
                position: Vec3::new(3000.0, -200.0, 70.0) + vector(),
                normal: vector().normalize(),
                radius: 1.0 + 0.3 * i as f32,
                color: [i as u8, 2, 3],
            })
            .collect()
    }

    #[test]
    fn decoding_is_within_the_stated_precision() {
        let mut random = Random::new(5, 0);
        for case in 0..500 {
            let points = random_points(1 + case % LANES, &mut random);
            let block = PointBlock::new(&points);
            assert_eq!(u32::from(block.occupied()), (1u32 << points.len()) - 1);
            for (lane, point) in points.iter().enumerate() {
                assert!(block.position(lane).distance(point.position) < 1e-3 * point.radius);
                assert!((block.radius(lane) - point.radius).abs() < 2e-3 * point.radius);
                assert!(block.normal(lane).angle_between(point.normal) < 1.4e-3);
                assert_eq!(block.color(lane), point.color);
            }
        }
    }

    #[test]
    fn lanes_and_single_points_decode_alike() {
        let mut random = Random::new(6, 0);
        let points = random_points(LANES, &mut random);
        let block = PointBlock::new(&points);
        let lanes = block.points::<PortableLanes>(Vec3::ZERO);
        let normals = lanes.normal;
        for lane in 0..LANES {
            let normal = Vec3::new(
                normals.x.store()[lane],
                normals.y.store()[lane],
                normals.z.store()[lane],
            );
            assert_eq!(normal.normalize(), block.normal(lane));
            assert_eq!(lanes.center.x.store()[lane], block.position(lane).x);
            assert_eq!(lanes.radius.store()[lane], block.radius(lane));
        }
    }

    #[test]
    fn axis_normals_are_exact() {
        for normal in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z] {
            let point = BlockPoint { position: Vec3::ZERO, normal, radius: 1.0, color: [0; 3] };
            assert_eq!(PointBlock::new(&[point]).normal(0), normal);
        }
    }
}
