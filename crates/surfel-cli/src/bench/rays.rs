//! The sets of rays: camera rays in tiles, and rays that start at their hits.
//!
//! Order and formulas equal those of the program that measures Embree (docs/benchmarks.md), in f32 too, so that
//! both trace the same rays.

use super::BenchScene;
use super::camera_file::CameraFile;
use clap::ValueEnum;
use std::f32::consts::TAU;
use surfel_core::flat::FlatGeometry;
use surfel_core::math::{DVec3, Ray, Vec3, morton_decode};
use surfel_core::trace::Hit;

/// A kind of rays, and the question about them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Rays {
    /// Camera rays: the nearest disc, sphere or triangle.
    Primary,
    /// Rays from each hit to a point light: is anything between?
    Shadow,
    /// Rays from each hit in one random direction: is anything there?
    BounceAny,
    /// Rays from each hit in one random direction: the nearest disc, sphere or triangle.
    Bounce,
    /// Camera rays: up to 16 discs within a radius behind the nearest, and the mean of their normals.
    Gather,
    /// Camera rays: the finished surface, with its edge test.
    Surface,
}

/// Pixels along the side of a tile.
const TILE: u32 = 16;

/// Returns rays through the centres of all pixels, of the file's camera or else of the scene's.
pub fn camera_rays(scene: &BenchScene, file: Option<&CameraFile>, size: (u32, u32)) -> Vec<Ray> {
    if let Some(file) = file {
        let pinhole = Pinhole::new(file, scene.origin);
        return pixels(size).map(|pixel| pinhole.ray(pixel, size)).collect();
    }
    let view = scene.camera.view(scene.origin, size.0, size.1);
    pixels(size).map(|(x, y)| view.ray(x as f32 + 0.5, y as f32 + 0.5)).collect()
}

/// Returns rays from each hit that end at `light`.
pub fn shadow_rays(scene: &BenchScene, rays: &[Ray], hits: &[Hit], light: Vec3) -> Vec<Ray> {
    let shadow_ray = |start: Start| {
        let toward = light - start.origin;
        let direction = toward.normalize_or(start.normal);
        Ray { t_max: toward.length(), ..Ray::new(start.origin, direction) }
    };
    starts(scene, rays, hits).map(shadow_ray).collect()
}

/// Returns a ray from each hit, cosine-distributed around the normal.
pub fn bounce_rays(scene: &BenchScene, rays: &[Ray], hits: &[Hit]) -> Vec<Ray> {
    let direction = |start: &Start| cosine_direction(start.normal, start.ray_idx as u32);
    starts(scene, rays, hits).map(|start| Ray::new(start.origin, direction(&start))).collect()
}

/// Returns all pixels in tiles, the tiles row by row; inside a tile in Morton order.
fn pixels((width, height): (u32, u32)) -> impl Iterator<Item = (u32, u32)> {
    let corners = |size: u32| (0..size).step_by(TILE as usize);
    let tiles = corners(height).flat_map(move |y| corners(width).map(move |x| (x, y)));
    tiles
        .flat_map(move |(x, y)| {
            (0..TILE * TILE).map(morton_decode).map(move |(column, row)| (x + column, y + row))
        })
        .filter(move |&(x, y)| x < width && y < height)
}

/// A camera relative to a scene's origin.
struct Pinhole {
    eye: Vec3,
    forward: Vec3,
    right: Vec3,
    up: Vec3,
    /// Half of the picture's height at distance 1.
    half_height: f32,
}

impl Pinhole {
    fn new(file: &CameraFile, origin: DVec3) -> Self {
        let [eye, target] = [file.eye, file.target].map(|position| (position - origin).as_vec3());
        let forward = (target - eye).normalize();
        let right = forward.cross(Vec3::Z).normalize();
        let half_height = (file.view_angle_deg as f32 / 2.0).to_radians().tan();
        Self { eye, forward, right, up: right.cross(forward), half_height }
    }

    fn ray(&self, (x, y): (u32, u32), (width, height): (u32, u32)) -> Ray {
        let [x, y, width, height] = [x, y, width, height].map(|number| number as f32);
        let across = (2.0 * (x + 0.5) / width - 1.0) * self.half_height * width / height;
        let along = (1.0 - 2.0 * (y + 0.5) / height) * self.half_height;
        let direction = self.forward + self.right * across + self.up * along;
        Ray::new(self.eye, direction.normalize())
    }
}

/// The start of a ray: just off a hit, on the side that the hitting ray came from.
struct Start {
    /// Index of the ray that hit.
    ray_idx: usize,
    origin: Vec3,
    normal: Vec3,
}

fn starts(scene: &BenchScene, rays: &[Ray], hits: &[Hit]) -> impl Iterator<Item = Start> {
    let hit = rays.iter().zip(hits).enumerate().filter(|(_, (_, hit))| **hit != Hit::MISS);
    hit.map(|(ray_idx, (ray, hit))| start(scene, ray_idx, ray, hit))
}

fn start(scene: &BenchScene, ray_idx: usize, ray: &Ray, hit: &Hit) -> Start {
    let position = ray.at(hit.distance);
    let cloud = match &*scene.geometry {
        FlatGeometry::Cloud(cloud) => cloud,
        FlatGeometry::Mesh(mesh) => {
            let [a, b, c] = mesh.triangles.triangle(hit.slot);
            let normal = (b - a).cross(c - a).normalize();
            let normal = if 0.0 < normal.dot(ray.direction) { -normal } else { normal };
            // Far more than the rounding of a hit, far less than a triangle.
            let offset = 1e-4 * a.distance(b);
            return Start { ray_idx, origin: position + offset * normal, normal };
        }
    };
    let points = &cloud.points;
    // Spheres are solid; half a radius lifts a ray out of the discs or balls around its own.
    let (normal, offset) = if cloud.surface.is_continuous() {
        (points.normal(hit.slot), 0.5)
    } else {
        ((position - points.center(hit.slot)).normalize_or(-ray.direction), 1e-3)
    };
    let normal = if 0.0 < normal.dot(ray.direction) { -normal } else { normal };
    Start { ray_idx, origin: position + normal * (offset * points.radius(hit.slot)), normal }
}

fn cosine_direction(normal: Vec3, seed: u32) -> Vec3 {
    let mut state = seed.wrapping_mul(2_654_435_761);
    let (height, turn) = (random(&mut state), random(&mut state));
    let (sin, cos) = (TAU * turn).sin_cos();
    let helper = if 0.5 < normal.x.abs() { Vec3::Y } else { Vec3::X };
    let tangent = normal.cross(helper).normalize();
    let bitangent = normal.cross(tangent);
    let (across, along) = (height.sqrt() * cos, height.sqrt() * sin);
    let direction = tangent * across + bitangent * along + normal * (1.0 - height).max(0.0).sqrt();
    direction.normalize()
}

/// Returns a number from 0 up to 1 and advances the state, by Wellons' `lowbias32` (2018). `math::Random` gives other
/// numbers than the program that measures Embree.
fn random(state: &mut u32) -> f32 {
    let mut x = state.wrapping_add(0x9e37_79b9);
    x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    *state = x ^ x >> 16;
    (*state >> 8) as f32 / (1u32 << 24) as f32
}

#[cfg(test)]
mod tests {
    //! Rays and directions equal those of the program that measures Embree.

    use super::*;

    const FILE: CameraFile = CameraFile {
        eye: DVec3::new(-11.0, -25.0, 4.5),
        target: DVec3::new(1.5, 0.0, 6.2),
        view_angle_deg: 42.0,
        light: DVec3::new(14.0, -30.0, 22.0),
    };

    /// Printed by the formulas in C++, compiled without fused multiply-add.
    const DIRECTIONS: [(usize, [f32; 3]); 8] = [
        (0, [0.065_128_945, 0.926_244_9, 0.371_252_83]),
        (1, [0.099_914_9, 0.921_202_8, 0.376_035_06]),
        (2, [0.066_902_034, 0.938_885_7, 0.337_665_14]),
        (3, [0.102_129_15, 0.934_091, 0.342_116_74]),
        (4, [0.135_431_68, 0.914_833_3, 0.380_444_88]),
        (255, [0.623_866_8, 0.754_695_24, -0.203_040_17]),
        (256, [0.622_723_4, 0.681_488_4, 0.384_433_42]),
        (359, [0.719_213_25, 0.642_439_5, -0.264_582_25]),
    ];

    #[test]
    fn camera_rays_equal_those_of_the_embree_benchmark() {
        let size = (20, 18);
        let pinhole = Pinhole::new(&FILE, DVec3::ZERO);
        let rays: Vec<Ray> = pixels(size).map(|pixel| pinhole.ray(pixel, size)).collect();
        assert_eq!(rays.len(), 360);
        for (i, direction) in DIRECTIONS {
            let difference = rays[i].direction - Vec3::from(direction);
            assert!(difference.abs().max_element() < 2e-7, "{i}: {:?}", rays[i]);
            assert_eq!((rays[i].origin, rays[i].t_min), (FILE.eye.as_vec3(), 0.0));
            assert_eq!(rays[i].t_max, f32::INFINITY);
        }
    }

    #[test]
    fn the_camera_moves_with_the_origin() {
        let origin = DVec3::new(500_000.0, 4_900_000.0, 100.0);
        let moved = CameraFile { eye: FILE.eye + origin, target: FILE.target + origin, ..FILE };
        let [here, there] = [(FILE, DVec3::ZERO), (moved, origin)]
            .map(|(file, origin)| Pinhole::new(&file, origin).ray((3, 5), (20, 18)));
        assert!(here.origin.distance(there.origin) < 1e-6);
        assert!(here.direction.distance(there.direction) < 1e-6);
    }

    #[test]
    fn each_pixel_appears_once_and_tiles_go_row_by_row() {
        let found: Vec<(u32, u32)> = pixels((40, 20)).collect();
        let mut sorted = found.clone();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!((found.len(), sorted.len()), (800, 800));
        assert_eq!(found[..5], [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0)]);
        assert_eq!((found[255], found[256], found[640]), ((15, 15), (16, 0), (0, 16)));
    }

    #[test]
    fn bounce_directions_equal_those_of_the_embree_benchmark() {
        let expected = [
            (0, Vec3::Z, [0.062_414_516, -0.062_205_646, 0.996_109_9]),
            (1, Vec3::new(0.8, 0.0, 0.6), [0.642_629_6, 0.435_660_66, 0.630_259_4]),
            (1_000_000, Vec3::Z, [0.699_496_03, -0.603_788_14, 0.382_289_6]),
        ];
        for (seed, normal, direction) in expected {
            let difference = cosine_direction(normal, seed) - Vec3::from(direction);
            assert!(difference.abs().max_element() < 5e-7, "{seed}: {difference}");
        }
    }
}
