//! A leaf block: eight points, quantised against their common corner.

use crate::math::{LANES, Lanes, Vec3, Vec3Lanes};
use crate::surface::PointLanes;

/// Eight points in 168 bytes, lane by lane.
///
/// Positions are 16 bits an axis of the block's longest side: off by at most 1/1000 of the radius,
/// which `fits` sees to. Radii are rounded down, by at most 1.2 %. Normals are octahedral (Meyer et
/// al. 2010), 16 bits a coordinate.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PointBlock {
    origin: [f32; 3],
    /// Length of a position's step.
    step: f32,
    radius_min: f32,
    radius_step: f32,
    position: [[u16; LANES]; 3],
    normal: [[i16; LANES]; 2],
    radius: [u8; LANES],
    /// sRGB-encoded.
    color: [[u8; 3]; LANES],
    /// Index in the cloud; `NO_POINT` where the lane is unused.
    pub id: [u32; LANES],
}

/// Marks an unused lane.
pub const NO_POINT: u32 = u32::MAX;

/// A point as it goes into a block.
#[derive(Clone, Copy, Debug)]
pub struct BlockPoint {
    pub position: Vec3,
    /// Unit.
    pub normal: Vec3,
    pub radius: f32,
    /// sRGB-encoded.
    pub color: [u8; 3],
    pub id: u32,
}

const POSITION_MAX: f32 = 65535.0;
const NORMAL_MAX: f32 = 32767.0;

/// Whether points of these bounds (of their centres) and radii may share a block within its precision.
pub fn fits(size: Vec3, radius_min: f32, radius_max: f32) -> bool {
    radius_max <= 4.0 * radius_min && size.max_element() / POSITION_MAX <= 1e-3 * radius_min
}

impl PointBlock {
    /// Encodes one to eight points.
    pub fn new(points: &[BlockPoint]) -> Self {
        let bounds = crate::math::Aabb::of_points(points.iter().map(|p| p.position));
        let radii = points.iter().map(|p| p.radius);
        let radius_min = radii.clone().fold(f32::INFINITY, f32::min);
        let radius_max = radii.fold(0.0, f32::max);
        let mut block = Self {
            origin: bounds.min.to_array(),
            step: bounds.size().max_element() / POSITION_MAX,
            radius_min,
            radius_step: (radius_max - radius_min) / 255.0,
            id: [NO_POINT; LANES],
            ..bytemuck::Zeroable::zeroed()
        };
        for (lane, point) in points.iter().enumerate() {
            block.set(lane, point);
        }
        block
    }

    fn set(&mut self, lane: usize, point: &BlockPoint) {
        let steps = |value: f32, step: f32| if 0.0 < step { value / step } else { 0.0 };
        for axis in 0..3 {
            let offset = point.position[axis] - self.origin[axis];
            self.position[axis][lane] = steps(offset, self.step).round() as u16;
        }
        let (u, v) = octahedral(point.normal);
        self.normal[0][lane] = (u * NORMAL_MAX).round() as i16;
        self.normal[1][lane] = (v * NORMAL_MAX).round() as i16;
        self.radius[lane] = steps(point.radius - self.radius_min, self.radius_step) as u8;
        self.color[lane] = point.color;
        self.id[lane] = point.id;
    }

    /// Bit i is set if lane i holds a point.
    #[inline(always)]
    pub fn occupied(&self) -> u8 {
        self.id.iter().enumerate().fold(0, |bits, (i, &id)| bits | (u8::from(id != NO_POINT) << i))
    }

    /// Centres, relative to `origin`.
    #[inline(always)]
    pub fn centers<L: Lanes>(&self, origin: Vec3) -> Vec3Lanes<L> {
        let step = L::splat(self.step);
        let corner = Vec3::from_array(self.origin) - origin;
        let coordinate =
            |axis: usize| L::splat(corner[axis]) + L::from_u16(&self.position[axis]) * step;
        Vec3Lanes { x: coordinate(0), y: coordinate(1), z: coordinate(2) }
    }

    /// All that an intersection needs, relative to `origin`.
    #[inline(always)]
    pub fn points<L: Lanes>(&self, origin: Vec3) -> PointLanes<L> {
        let radius =
            L::splat(self.radius_min) + L::from_u8(&self.radius) * L::splat(self.radius_step);
        PointLanes { center: self.centers(origin), normal: self.normals(), radius }
    }

    /// Not of unit length, but never zero.
    #[inline(always)]
    pub fn normals<L: Lanes>(&self) -> Vec3Lanes<L> {
        let (x, y) = (L::from_i16(&self.normal[0]), L::from_i16(&self.normal[1]));
        let z = L::splat(NORMAL_MAX) - x.abs() - y.abs();
        let fold = L::splat(0.0).max(L::splat(0.0) - z);
        Vec3Lanes { x: x - fold.copysign(x), y: y - fold.copysign(y), z }
    }

    pub fn position(&self, lane: usize) -> Vec3 {
        let steps = Vec3::from_array([0, 1, 2].map(|axis| f32::from(self.position[axis][lane])));
        Vec3::from_array(self.origin) + steps * self.step
    }

    /// Unit.
    pub fn normal(&self, lane: usize) -> Vec3 {
        let (x, y) = (f32::from(self.normal[0][lane]), f32::from(self.normal[1][lane]));
        let z = NORMAL_MAX - x.abs() - y.abs();
        let fold = (-z).max(0.0);
        Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize()
    }

    pub fn radius(&self, lane: usize) -> f32 {
        self.radius_min + f32::from(self.radius[lane]) * self.radius_step
    }

    /// sRGB-encoded.
    pub fn color(&self, lane: usize) -> [u8; 3] {
        self.color[lane]
    }
}

/// Coordinates in [-1, 1] of a unit vector on the unfolded octahedron.
fn octahedral(normal: Vec3) -> (f32, f32) {
    let scaled = normal / (normal.x.abs() + normal.y.abs() + normal.z.abs());
    if 0.0 <= scaled.z {
        return (scaled.x, scaled.y);
    }
    ((1.0 - scaled.y.abs()).copysign(scaled.x), (1.0 - scaled.x.abs()).copysign(scaled.y))
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
                id: 40 + i as u32,
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
                assert!(
                    block.radius(lane) <= point.radius && 0.988 * point.radius < block.radius(lane)
                );
                assert!(block.normal(lane).angle_between(point.normal) < 5e-4);
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
            let point =
                BlockPoint { position: Vec3::ZERO, normal, radius: 1.0, color: [0; 3], id: 0 };
            assert_eq!(PointBlock::new(&[point]).normal(0), normal);
        }
    }
}
