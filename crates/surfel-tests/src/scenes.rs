//! Scenes for tests and benchmarks: clouds from `clouds` and meshes of closed forms, made ready to trace.

use std::f32::consts::{PI, TAU};
use surfel::flat::{FlatCloud, FlatScene};
use surfel::image::Image;
use surfel::math::{DAffine3, DVec3, Random, Ray, Vec2, Vec3};
use surfel::points::{PointCloud, Preparation, prepare};
use surfel::progress::Silent;
use surfel::render::{CpuRenderer, Renderer, Settings};
use surfel::scene::{
    Background, Camera, Geometry, Graph, Light, Material, Mesh, Node, Part, Points, Projection,
    Scene, Transform,
};
use surfel::surface::{Boundary, SurfaceKind};
use surfel::trace::Simd;

/// `cloud` with the radii and normals it lacks, grey.
pub fn points(cloud: PointCloud, surface: SurfaceKind) -> Points {
    let (cloud, _) = prepare(cloud, &Preparation::default(), &Silent).unwrap();
    let colors = vec![[188; 3]; cloud.len()];
    Points { cloud, colors, surface, boundary: Boundary::Gap, has_outward_normals: false }
}

/// `cloud` made ready, matte, lit from the camera, seen from +X.
pub fn scene(cloud: PointCloud, surface: SurfaceKind) -> Scene {
    lit(points(cloud, surface))
}

/// Points, matte, lit from the camera, seen from +X.
pub fn lit(points: Points) -> Scene {
    let cloud = &points.cloud;
    let camera = Camera {
        position: cloud.origin + DVec3::new(6.0, 0.0, 0.0),
        focal_point: cloud.origin,
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle_deg: 30.0 },
    };
    Scene {
        graph: Graph::of(Geometry::Points(points), Material::MATTE),
        lights: vec![Light::Headlight(1.0)],
        background: Background::Transparent,
        camera,
    }
}

/// The flat form of [`points`].
pub fn flat(cloud: PointCloud, surface: SurfaceKind) -> FlatCloud {
    FlatCloud::new(&points(cloud, surface), &Silent).unwrap()
}

/// The only cloud of a scene.
pub fn cloud(scene: &Scene) -> &Points {
    match &scene.graph.geometries[..] {
        [Geometry::Points(points)] => points,
        _ => panic!("not one cloud"),
    }
}

/// Rays from around a ball of `radius` about the origin toward places within it, some of bounded range.
pub fn random_rays(n: usize, radius: f32, seed: u64) -> Vec<Ray> {
    let mut random = Random::new(seed, 0);
    let mut ball = || loop {
        let axis = |random: &mut Random| 2.0 * random.next_f32() - 1.0;
        let point = Vec3::new(axis(&mut random), axis(&mut random), axis(&mut random));
        if point.length_squared() < 1.0 {
            return radius * point;
        }
    };
    (0..n)
        .map(|i| {
            let origin =
                if i % 3 == 0 { ball() } else { 3.0 * radius * ball().normalize_or(Vec3::X) };
            let ray = Ray::new(origin, (ball() - origin).normalize_or(Vec3::Z));
            // Every fifth ray starts late and ends early; every seventh runs along an axis.
            let direction = if i % 7 == 0 { Vec3::AXES[i % 3] } else { ray.direction };
            let range =
                if i % 5 == 0 { (0.3 * radius, 2.5 * radius) } else { (0.0, f32::INFINITY) };
            Ray { direction, t_min: range.0, t_max: range.1, ..ray }
        })
        .collect()
}

/// The parallelogram about `center` that reaches so far to the right and up, seen from its front; its
/// texture coordinates are those of a picture's corners.
pub fn quad(center: Vec3, right: Vec3, up: Vec3) -> Mesh {
    let corner = |x: f32, y: f32| center + x * right + y * up;
    Mesh {
        positions: vec![corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: [Some(vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X]), None],
        ..Mesh::default()
    }
}

/// The square |x|, |y| <= `half` at z = `height`, its front up.
pub fn floor(height: f32, half: f32) -> Mesh {
    quad(height * Vec3::Z, half * Vec3::X, half * Vec3::Y)
}

/// The box between two corners, with vertices that its sides share.
pub fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let corner = |i: usize| {
        let pick = |axis: usize| [min, max][i >> axis & 1][axis];
        Vec3::new(pick(0), pick(1), pick(2))
    };
    let sides =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..Mesh::default()
    }
}

/// A closed ball about the origin of `n_rings` bands of `n_segments` quads, with vertex normals.
pub fn uv_sphere(n_rings: u32, n_segments: u32, radius: f32) -> Mesh {
    let direction = |ring: u32, segment: u32| {
        let (sin, cos) = (PI * ring as f32 / n_rings as f32).sin_cos();
        let (sin_around, cos_around) = (TAU * segment as f32 / n_segments as f32).sin_cos();
        Vec3::new(sin * cos_around, sin * sin_around, cos)
    };
    // The poles stand first and last.
    let between = (1..n_rings).flat_map(|ring| (0..n_segments).map(move |s| direction(ring, s)));
    let normals: Vec<Vec3> = [Vec3::Z].into_iter().chain(between).chain([-Vec3::Z]).collect();
    let south = normals.len() as u32 - 1;
    let vertex = |ring: u32, segment: u32| match ring {
        0 => 0,
        ring if ring == n_rings => south,
        ring => 1 + (ring - 1) * n_segments + segment % n_segments,
    };
    let quads = (0..n_rings).flat_map(|ring| (0..n_segments).map(move |segment| (ring, segment)));
    let triangles = quads.flat_map(|(ring, segment)| {
        let (upper, lower) = (ring, ring + 1);
        let [a, b] = [vertex(upper, segment), vertex(lower, segment)];
        let [c, d] = [vertex(lower, segment + 1), vertex(upper, segment + 1)];
        [[a, b, c], [a, c, d]]
    });
    // At a pole two corners of the quad are one.
    let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    Mesh {
        positions: normals.iter().map(|normal| radius * normal).collect(),
        normals: Some(normals),
        triangles,
        ..Mesh::default()
    }
}

/// `mesh` with its vertices where `transform` takes them, front and back as they were.
pub fn baked(mesh: &Mesh, transform: DAffine3) -> Mesh {
    let origin = transform.transform_point3(mesh.origin);
    let for_normals = transform.matrix3.inverse().transpose();
    let mut moved = Mesh { origin, ..mesh.clone() };
    for position in &mut moved.positions {
        *position = (transform.matrix3 * position.as_dvec3()).as_vec3();
    }
    for normal in moved.normals.iter_mut().flatten() {
        *normal = (for_normals * normal.as_dvec3()).normalize().as_vec3();
    }
    if transform.matrix3.determinant() < 0.0 {
        moved.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    moved
}

/// A graph of several things, each of a material of its own, where they are.
pub fn graph(things: Vec<(Geometry, Material)>) -> Graph {
    let mut graph = Graph::default();
    for (geometry, material) in things {
        graph.append(Graph::of(geometry, material));
    }
    graph
}

/// A node that shows a geometry in a material, placed by a matrix.
pub fn node(geometry: usize, material: usize, place: DAffine3) -> Node {
    let parts = vec![Part { geometry, material }];
    Node { parts, transform: Transform::Matrix(place), ..Node::new("") }
}

/// Looks straight down at the middle of the world, +X to the right and +Y up.
pub fn from_above(height: f64) -> Camera {
    Camera {
        position: DVec3::new(0.0, 0.0, 10.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Y,
        projection: Projection::Orthographic { height },
    }
}

/// The picture of `scene`.
pub fn render(scene: &Scene, settings: &Settings) -> Image {
    let flat = FlatScene::new(scene, &Silent).unwrap();
    CpuRenderer { simd: Simd::detect() }.render(&flat, settings, &Silent).unwrap().0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each edge of a closed surface is gone along once each way, and the volume within is positive.
    fn check_closed(mesh: &Mesh, volume: f32) {
        let edges = |triangle: &[u32; 3]| [0, 1, 2].map(|i| (triangle[i], triangle[(i + 1) % 3]));
        let mut all: Vec<(u32, u32)> = mesh.triangles.iter().flat_map(edges).collect();
        all.sort_unstable();
        let back = |&(a, b): &(u32, u32)| all.binary_search(&(b, a)).is_ok();
        assert!(all.iter().all(back) && all.windows(2).all(|pair| pair[0] != pair[1]));
        let parts = (0..mesh.triangles.len()).map(|i| {
            let [a, b, c] = mesh.corners(i);
            a.dot(b.cross(c)) / 6.0
        });
        let found: f32 = parts.sum();
        assert!((found / volume - 1.0).abs() < 0.03, "{found} of {volume}");
    }

    #[test]
    fn closed_meshes_are_closed_and_face_outward() {
        check_closed(&cuboid(-Vec3::ONE, Vec3::new(1.0, 2.0, 3.0)), 24.0);
        check_closed(&uv_sphere(24, 48, 2.0), 4.0 / 3.0 * PI * 8.0);
        let mirrored = DAffine3::from_scale(DVec3::new(-1.0, 2.0, 0.5));
        check_closed(&baked(&uv_sphere(24, 48, 2.0), mirrored), 4.0 / 3.0 * PI * 8.0);
    }
}
