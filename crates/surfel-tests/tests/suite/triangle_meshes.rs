//! Meshes for tests of triangles, and rays toward them.

use surfel_core::math::{Aabb, Random, Ray, Vec3};
use surfel_core::scene::Mesh;
use surfel_tests::scenes;

/// Returns a mesh whose vertices have moved.
pub fn moved(mut mesh: Mesh, movement: impl Fn(Vec3) -> Vec3) -> Mesh {
    mesh.positions.iter_mut().for_each(|position| *position = movement(*position));
    mesh
}

/// Returns `n` triangles of random size and shape, each with vertices of its own.
pub fn soup(n: u32) -> Mesh {
    let mut random = Random::new(61, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    let mut positions = Vec::new();
    for _ in 0..n {
        let (center, size) = (Vec3::new(gaussian(), gaussian(), gaussian()), 0.3 * gaussian());
        positions.extend(
            [(); 3].map(|()| center + size * Vec3::new(gaussian(), gaussian(), gaussian())),
        );
    }
    Mesh {
        positions,
        triangles: (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    }
}

/// Returns slivers, points, lines and non-finite triangles among sound ones.
pub fn degenerate() -> Mesh {
    let mut mesh = soup(200);
    for (i, corners) in mesh.positions.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        let [a, b, c] = corners;
        match i % 10 {
            0 => *b = *a,
            1 => (*b, *c) = (*a, *a),
            2 => *c = 0.5 * (*a + *b),
            3 => *c = a.lerp(*b, 0.3) + Vec3::X * 1e-6,
            4 => a.x = f32::NAN,
            5 => b.y = f32::INFINITY,
            6 => *c = *b + Vec3::splat(1e-30),
            _ => {}
        }
    }
    mesh
}

/// Returns `n` by `n` cells of the square |x|, |y| <= 1 at z = 0, with corners jittered within the plane.
pub fn grid(n: u32) -> Mesh {
    let mut random = Random::new(62, 0);
    let mut jitter = || 0.4 * (random.next_f32() - 0.5);
    let cell = 2.0 / n as f32;
    let mut vertex = |i: u32| {
        let (x, y) = (i % (n + 1), i / (n + 1));
        let is_inner = |i: u32| 0 < i && i < n;
        let mut along = |i: u32| {
            let moved = if is_inner(x) && is_inner(y) { jitter() } else { 0.0 };
            cell * (i as f32 + moved) - 1.0
        };
        Vec3::new(along(x), along(y), 0.0)
    };
    let positions = (0..(n + 1) * (n + 1)).map(&mut vertex).collect();
    let cells = (0..n * n).map(|i| i / n * (n + 1) + i % n);
    let triangles = cells.flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]);
    Mesh { positions, triangles: triangles.collect(), ..Mesh::default() }
}

pub fn one_triangle() -> Mesh {
    let positions = vec![Vec3::X, Vec3::Y, Vec3::new(-1.0, -1.0, 0.5)];
    Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() }
}

pub fn meshes() -> Vec<(&'static str, Mesh)> {
    let ball = || scenes::uv_sphere(16, 32, 1.0);
    let far = Vec3::new(3000.0, -2000.0, 100.0);
    vec![
        ("one triangle", one_triangle()),
        ("cube", scenes::cuboid(-Vec3::ONE, Vec3::ONE)),
        ("sphere", ball()),
        ("grid", grid(20)),
        ("soup", soup(500)),
        ("degenerate", degenerate()),
        ("huge", moved(ball(), |p| 1e7 * p)),
        ("tiny", moved(ball(), |p| 1e-7 * p)),
        ("far away", moved(ball(), |p| p + far)),
        ("flat and wide", moved(soup(300), |p| p * Vec3::new(1000.0, 1000.0, 1e-3))),
    ]
}

/// Returns the bounds of all finite vertices.
pub fn bounds(mesh: &Mesh) -> Aabb {
    Aabb::of_points(mesh.positions.iter().copied().filter(|position| position.is_finite()))
}

/// Returns camera rays through tiles of four by four pixels.
pub fn camera_rays(bounds: Aabb) -> Vec<Ray> {
    let eye = bounds.center() + bounds.diagonal() * Vec3::new(0.7, 0.5, 0.3);
    let toward = (bounds.center() - eye).normalize();
    let right = toward.cross(Vec3::Z).normalize();
    let up = right.cross(toward);
    let pixel = |i: usize| {
        let (tile, inner) = (i / 16, i % 16);
        let (x, y) = (tile % 6 * 4 + inner % 4, tile / 6 * 4 + inner / 4);
        let offset = |i: usize| (i as f32 - 11.5) / 18.0;
        Ray::new(eye, (toward + offset(x) * right + offset(y) * up).normalize())
    };
    (0..24 * 24).map(pixel).collect()
}

/// Returns incoherent rays from outside and inside toward vertices, midpoints of edges and other targets, some of
/// bounded range.
pub fn incoherent_rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    let bounds = bounds(mesh);
    let mut random = Random::new(63, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    let corners: Vec<[Vec3; 3]> = (0..mesh.triangles.len())
        .map(|i| mesh.corners(i))
        .filter(|corners| corners.iter().all(|corner| corner.is_finite()))
        .collect();
    let ray = |i: usize| {
        let away = Vec3::new(gaussian(), gaussian(), gaussian());
        let reach = if i.is_multiple_of(2) { 0.1 } else { 0.8 };
        let origin = bounds.center() + reach * bounds.diagonal() * away;
        let [a, b, c] = corners[i * 7919 % corners.len()];
        let target = [a, 0.5 * (a + b), (a + b + c) / 3.0, origin + away][i / 2 % 4];
        let distance = origin.distance(target);
        let direction =
            if i.is_multiple_of(7) { Vec3::AXES[i % 3] } else { (target - origin) / distance };
        let range = if i.is_multiple_of(5) { 0.5..1.5 } else { 0.0..f32::INFINITY };
        Ray { origin, t_min: range.start * distance, direction, t_max: range.end * distance }
    };
    (0..n).map(ray).collect()
}
