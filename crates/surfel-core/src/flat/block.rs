//! Leaf blocks of eight points, quantised relative to their common lower corner.

use crate::math::{Aabb, LANES, LaneMask, Lanes, ROUND_TO_INTEGER, Vec3, Vec3Lanes};
use crate::surface::{MAX_NORMAL_COMPONENT, PointLanes};

/// Eight points in two cache lines, lane by lane.
///
/// Positions have 16 bits per axis on a grid whose step is a power of two. Their error is at most 1/1000 of the
/// radius, which `fits_precision` ensures. Radii have 10 bits and an error of at most 0.2 %. Normals have
/// 10 bits per axis and an error of at most 0.08 degrees.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PointBlock {
    /// Lower corner of the centres.
    origin: [f32; 3],
    /// Upper 24 bits of the f32 step of the radii, and the biased exponent of the positions' step in the low
    /// byte.
    steps: u32,
    /// Centres relative to `origin` in steps, one row per axis.
    position: [[u16; LANES]; 3],
    /// Normals in 10 signed bits each for x, y and z, from the low bits, and the upper 2 bits of the radius.
    normal: [u32; LANES],
    /// Lower 8 bits of the radius in steps. A radius of zero steps marks an unused lane.
    radius: [u8; LANES],
    /// sRGB-encoded colours.
    color: [[u8; 3]; LANES],
}

/// A point before it is encoded in a block.
#[derive(Clone, Copy, Debug)]
pub struct BlockPoint {
    /// Centre in the cloud's coordinates.
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Radius in the units of the position.
    pub radius: f32,
    /// sRGB-encoded colour.
    pub color: [u8; 3],
}

/// Maximum number of steps of a position.
const MAX_POSITION_STEPS: f32 = 65535.0;
/// Maximum number of steps of a radius.
const MAX_RADIUS_STEPS: f32 = 1023.0;

/// Returns true if a block can hold points within its precision. `size` is that of the bounding box of their
/// centres.
pub fn fits_precision(size: Vec3, min_radius: f32, max_radius: f32) -> bool {
    max_radius <= 4.0 * min_radius && size.max_element() / MAX_POSITION_STEPS <= 1e-3 * min_radius
}

impl PointBlock {
    /// Encodes one to eight points.
    pub fn new(points: &[BlockPoint]) -> Self {
        let bounds = Aabb::of_points(points.iter().map(|p| p.position));
        let max_radius = points.iter().fold(0.0, |max, p| p.radius.max(max));
        // The step is rounded up, so that no radius exceeds the maximum number of steps.
        let radius_step = ((max_radius / MAX_RADIUS_STEPS).to_bits() + 0xff) & !0xff;
        let exponent = step_exponent(bounds.size().max_element() / MAX_POSITION_STEPS);
        let mut block = Self {
            origin: bounds.min.to_array(),
            steps: radius_step | u32::from(exponent),
            ..bytemuck::Zeroable::zeroed()
        };
        let (position_step, radius_step) = (block.position_step(), block.radius_step());
        // The reciprocal is exact, because the step is a power of two.
        let per_step = if 0.0 < position_step { 1.0 / position_step } else { 0.0 };
        for (lane, point) in points.iter().enumerate() {
            let steps = (point.position - bounds.min) * per_step;
            for axis in 0..3 {
                block.position[axis][lane] = round_to_bits(steps[axis]) as u16;
            }
            let radius = if 0.0 < radius_step { point.radius / radius_step } else { 0.0 };
            let radius = round_to_bits(radius.clamp(1.0, MAX_RADIUS_STEPS)) & 0x3ff;
            block.radius[lane] = radius as u8;
            block.normal[lane] = pack_normal(point.normal) | (radius >> 8) << 30;
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

    /// Returns the lanes that hold a point, one bit per lane.
    pub fn occupied_lanes(&self) -> u8 {
        let is_used = |lane: usize| self.radius_steps(lane) != 0;
        (0..LANES).fold(0, |bits, lane| bits | u8::from(is_used(lane)) << lane)
    }

    /// Returns the lower corner of the centres.
    pub fn corner(&self) -> Vec3 {
        Vec3::from_array(self.origin)
    }

    /// Returns the centres relative to the corner.
    #[inline(always)]
    pub fn offsets<L: Lanes>(&self) -> Vec3Lanes<L> {
        let step = L::splat(self.position_step());
        Vec3Lanes {
            x: L::from_u16(&self.position[0]) * step,
            y: L::from_u16(&self.position[1]) * step,
            z: L::from_u16(&self.position[2]) * step,
        }
    }

    /// Returns the centres relative to `origin`. The corner is subtracted first, so that rounding errors are
    /// proportional to the distance from `origin`.
    #[inline(always)]
    pub fn centers<L: Lanes>(&self, origin: Vec3) -> Vec3Lanes<L> {
        Vec3Lanes::splat(self.corner() - origin).plus(self.offsets())
    }

    /// Returns the lanes, one bit each, of the points whose centres lie in `region`, up to rounding.
    #[inline(always)]
    pub fn lanes_within<L: Lanes>(&self, region: &Aabb) -> u32 {
        let Vec3Lanes { x, y, z } = self.offsets::<L>();
        let (low, high) = (region.min - self.corner(), region.max - self.corner());
        let mut is_within = L::splat(0.0).lt(self.radii());
        for (offset, low, high) in [(x, low.x, high.x), (y, low.y, high.y), (z, low.z, high.z)] {
            is_within = is_within & L::splat(low).le(offset);
            is_within = is_within & offset.le(L::splat(high));
        }
        is_within.bits()
    }

    /// Returns the radii, which are 0 in unused lanes.
    #[inline(always)]
    pub fn radii<L: Lanes>(&self) -> L {
        let steps = L::from_u8(&self.radius) + L::from_top_bits(&self.normal) * L::splat(256.0);
        steps * L::splat(self.radius_step())
    }

    /// Returns the points relative to `origin`. The radius is 0 in unused lanes.
    #[inline(always)]
    pub fn points<L: Lanes>(&self, origin: Vec3) -> PointLanes<L> {
        PointLanes { center: self.centers(origin), normal: self.normals(), radius: self.radii() }
    }

    /// Returns the normals with integer components. They are not of unit length, and zero in unused lanes only.
    #[inline(always)]
    pub fn normals<L: Lanes>(&self) -> Vec3Lanes<L> {
        Vec3Lanes {
            x: L::from_signed_bits::<0>(&self.normal),
            y: L::from_signed_bits::<10>(&self.normal),
            z: L::from_signed_bits::<20>(&self.normal),
        }
    }

    /// Returns the centre of the point in `lane`.
    pub fn position(&self, lane: usize) -> Vec3 {
        let steps = Vec3::from_array([0, 1, 2].map(|axis| f32::from(self.position[axis][lane])));
        Vec3::from_array(self.origin) + steps * self.position_step()
    }

    /// Returns the unit normal of the point in `lane`.
    pub fn normal(&self, lane: usize) -> Vec3 {
        let axis = |shift: u32| ((self.normal[lane] << (22 - shift)) as i32 >> 22) as f32;
        Vec3::new(axis(0), axis(10), axis(20)).normalize()
    }

    /// Returns the least distance between two points in units of their mean radius; none if the block is not full.
    pub(super) fn min_distance(&self) -> Option<f32> {
        let is_full = self.occupied_lanes() == u8::MAX;
        let mut min = f32::INFINITY;
        for (a, b) in (0..LANES).flat_map(|a| (0..a).map(move |b| (a, b))) {
            let reach = 0.5 * (self.radius(a) + self.radius(b));
            min = min.min(self.position(a).distance(self.position(b)) / reach);
        }
        is_full.then_some(min)
    }

    /// Returns the radius of the point in `lane`, which is 0 if the lane is unused.
    pub fn radius(&self, lane: usize) -> f32 {
        self.radius_steps(lane) as f32 * self.radius_step()
    }

    /// Returns the largest radius of the block.
    pub(super) fn max_radius(&self) -> f32 {
        (0..LANES).map(|lane| self.radius(lane)).fold(0.0, f32::max)
    }

    fn radius_steps(&self, lane: usize) -> u32 {
        (self.normal[lane] >> 30) << 8 | u32::from(self.radius[lane])
    }

    /// Returns the sRGB-encoded colour of the point in `lane`.
    pub fn color(&self, lane: usize) -> [u8; 3] {
        self.color[lane]
    }
}

/// Returns the biased exponent of the smallest power of two that is not below `wanted`, or 0 for a step of zero.
fn step_exponent(wanted: f32) -> u8 {
    if wanted <= 0.0 {
        return 0;
    }
    let bits = wanted.to_bits();
    let is_power = bits.trailing_zeros() >= 23;
    ((bits >> 23) + u32::from(!is_power)).clamp(1, 254) as u8
}

/// Returns the integer nearest to a number below 2^22 in the low bits. `f32::round` is a call into the C library
/// if SSE 4 is not assumed.
fn round_to_bits(value: f32) -> u32 {
    (value + ROUND_TO_INTEGER).to_bits()
}

/// Returns `normal`, scaled so that its largest component is `MAX_NORMAL_COMPONENT` and rounded, or Z if it has no
/// direction.
fn pack_normal(normal: Vec3) -> u32 {
    let max_component = normal.abs().max_element();
    let has_direction = 0.0 < max_component && normal.is_finite();
    let normal = if has_direction {
        normal * (MAX_NORMAL_COMPONENT / max_component)
    } else {
        MAX_NORMAL_COMPONENT * Vec3::Z
    };
    let [x, y, z] = normal.to_array().map(|n| round_to_bits(n) & 0x3ff);
    x | y << 10 | z << 20
}

#[cfg(test)]
mod tests {
    //! Positions, radii and normals that a block stores in few bits, decoded in lanes and one by one.

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
    fn decoded_points_are_within_the_documented_precision() {
        let mut random = Random::new(5, 0);
        for case in 0..500 {
            let points = random_points(1 + case % LANES, &mut random);
            let block = PointBlock::new(&points);
            assert_eq!(u32::from(block.occupied_lanes()), (1u32 << points.len()) - 1);
            for (lane, point) in points.iter().enumerate() {
                assert!(block.position(lane).distance(point.position) < 1e-3 * point.radius);
                assert!((block.radius(lane) - point.radius).abs() < 2e-3 * point.radius);
                assert!(block.normal(lane).angle_between(point.normal) < 1.4e-3);
                assert_eq!(block.color(lane), point.color);
            }
        }
    }

    #[test]
    fn lanes_and_single_points_decode_equally() {
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
