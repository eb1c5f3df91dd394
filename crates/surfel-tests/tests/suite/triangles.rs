//! Triangles: every search against brute force, watertight edges, and refitting to moved vertices.

use crate::rays::shuffled;
use crate::triangle_meshes::{
    bounds, camera_rays, grid, incoherent_rays, meshes, moved, one_triangle, soup,
};
use std::f32::consts::TAU;
use surfel_core::flat::{FlatTriangles, MAX_COST_RATIO, Refit};
use surfel_core::math::{
    Aabb, LANES, LaneMask, Lanes, PortableLanes, Quat, Random, Ray, Vec3, Vec3Lanes,
};
use surfel_core::progress::NoProgress;
use surfel_core::scene::Mesh;
use surfel_core::surface::{RayFrame, RayLanes, TriangleLanes};
use surfel_core::trace::{self, Hit, Simd};
use surfel_tests::scenes;

fn flat(mesh: &Mesh) -> FlatTriangles {
    FlatTriangles::new(&mesh.positions, &mesh.triangles, &NoProgress).unwrap()
}

/// Returns the nearest hit by brute force; the lowest slot wins a tie.
fn brute_force_hit(triangles: &FlatTriangles, ray: &Ray) -> Hit {
    let mut nearest = Hit::MISS;
    let line = RayFrame::new(RayLanes::new(ray));
    for (block_idx, block) in triangles.blocks.iter().enumerate() {
        let origin = Vec3Lanes::splat(ray.origin);
        let lanes = TriangleLanes::new(block.corners::<PortableLanes>());
        let (distances, mask) = lanes.relative_to(origin).intersect(&line);
        for lane in (0..LANES).filter(|&lane| mask.bits() >> lane & 1 == 1) {
            // Negative zero becomes positive zero.
            let distance = distances.store()[lane] + 0.0;
            if distance <= ray.t_max && distance < nearest.distance {
                nearest = Hit { distance, slot: (block_idx * LANES + lane) as u32 };
            }
        }
    }
    nearest
}

/// Panics unless both searches find the same bits as brute force at every SIMD level: all rays as one batch, in
/// packets, shuffled in parts of packets, and one by one.
fn check(name: &str, triangles: &FlatTriangles, rays: &[Ray]) {
    let expected: Vec<Hit> = rays.iter().map(|ray| brute_force_hit(triangles, ray)).collect();
    let in_order: Vec<usize> = (0..rays.len()).collect();
    let few: Vec<usize> = in_order.iter().copied().step_by(7).collect();
    let orders =
        [(in_order.clone(), 1000), (in_order.clone(), 16), (shuffled(in_order), 33), (few, 1)];
    for simd in Simd::available() {
        for (order, batch_len) in &orders {
            for batch in order.chunks(*batch_len) {
                let batch_rays: Vec<Ray> = batch.iter().map(|&i| rays[i]).collect();
                let (closest, any) = search(triangles, simd, &batch_rays);
                for (position, &i) in batch.iter().enumerate() {
                    let (found, expected) = (closest[position], expected[i]);
                    let bits = |hit: Hit| (hit.distance.to_bits(), hit.slot);
                    let context = format!("{name}, {}, {i} {:?}", simd.name(), rays[i]);
                    assert_eq!(bits(found), bits(expected), "{found:?} {expected:?} {context}");
                    assert_eq!(any[position], !expected.is_miss(), "{context}");
                }
            }
        }
    }
}

fn search(triangles: &FlatTriangles, simd: Simd, rays: &[Ray]) -> (Vec<Hit>, Vec<bool>) {
    let (mut hits, mut any) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
    trace::closest_triangles(triangles, simd, rays, &mut hits);
    trace::any_triangles(triangles, simd, rays, &mut any);
    (hits, any)
}

/// Returns rays from the hits of `rays` to a light, where their ranges end.
fn shadow_rays(triangles: &FlatTriangles, bounds: Aabb, rays: &[Ray]) -> Vec<Ray> {
    let light = bounds.center() + bounds.diagonal() * Vec3::new(0.2, 0.4, 0.9);
    let hits = rays.iter().map(|ray| (ray, brute_force_hit(triangles, ray)));
    let ray = |(ray, hit): (&Ray, Hit)| {
        let origin = ray.at(0.999 * hit.distance);
        let distance = origin.distance(light);
        Ray { t_max: distance, ..Ray::new(origin, (light - origin) / distance) }
    };
    hits.filter(|(_, hit)| !hit.is_miss()).map(ray).collect()
}

#[test]
fn triangle_searches_equal_brute_force() {
    for (name, mesh) in meshes() {
        let triangles = flat(&mesh);
        let camera = camera_rays(bounds(&mesh));
        let shadow = shadow_rays(&triangles, bounds(&mesh), &camera);
        let n_hits =
            camera.iter().filter(|ray| !brute_force_hit(&triangles, ray).is_miss()).count();
        assert!(0 < n_hits && n_hits < camera.len(), "{name}: {n_hits} hits");
        check(name, &triangles, &camera);
        check(&format!("{name}, shadows"), &triangles, &shadow);
        check(&format!("{name}, incoherent"), &triangles, &incoherent_rays(&mesh, 400));
    }
}

/// Degenerate rays run along faces and edges, start on them, or have ranges that end at them.
#[test]
fn triangle_searches_equal_brute_force_on_degenerate_rays() {
    for (name, mesh) in [
        ("one triangle", one_triangle()),
        ("cube", scenes::cuboid(-Vec3::ONE, Vec3::ONE)),
        ("grid", grid(8)),
    ] {
        let triangles = flat(&mesh);
        let mut rays = Vec::new();
        for i in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(i);
            let middle = (a + b + c) / 3.0;
            let normal = (b - a).cross(c - a).normalize();
            for direction in [normal, (b - a).normalize(), (middle - a).normalize()] {
                for origin in [a, middle, a - 2.0 * direction, middle - 3.0 * direction] {
                    rays.push(Ray::new(origin, direction));
                }
            }
            let ray = Ray::new(middle + 2.0 * normal, -normal);
            let at_hit = brute_force_hit(&triangles, &ray).distance;
            assert!((at_hit - 2.0).abs() < 1e-5, "{name}");
            let (before, behind) = (at_hit.next_down(), at_hit.next_up());
            for (t_min, t_max) in
                [(0.0, at_hit), (at_hit, at_hit), (0.0, before), (behind, 9.0), (-0.0, -0.0)]
            {
                rays.push(Ray { t_min, t_max, ..ray });
            }
            for bad in [f32::NAN, f32::INFINITY] {
                rays.push(Ray { origin: ray.origin.with_x(bad), ..ray });
                rays.push(Ray { direction: ray.direction.with_y(bad), ..ray });
            }
            rays.push(Ray { direction: Vec3::ZERO, ..ray });
        }
        check(name, &triangles, &rays);
    }
}

/// Returns rays from `origin` to each vertex, to midpoints and other points of edges, and to centres of triangles.
fn aimed(mesh: &Mesh, origin: Vec3) -> Vec<Ray> {
    let targets = (0..mesh.triangles.len()).flat_map(|i| {
        let [a, b, c] = mesh.corners(i);
        [a, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a), a.lerp(b, 0.137), (a + b + c) / 3.0]
    });
    targets.map(|target| Ray::new(origin, (target - origin).normalize())).collect()
}

/// Panics unless all rays hit at every SIMD level, in order and shuffled.
fn check_all_hit(name: &str, triangles: &FlatTriangles, rays: &[Ray]) {
    let shuffled = shuffled(rays.to_vec());
    for simd in Simd::available() {
        for rays in [rays, &shuffled] {
            let (hits, any) = search(triangles, simd, rays);
            let n_missed = hits.iter().filter(|hit| hit.is_miss()).count();
            let n_open = any.iter().filter(|is_hit| !**is_hit).count();
            let context = (rays.len(), simd.name());
            assert_eq!((n_missed, n_open), (0, 0), "{name}: of {context:?} rays");
        }
    }
}

#[test]
fn no_ray_leaves_a_closed_mesh() {
    let ball = scenes::uv_sphere(24, 48, 1.0);
    let mut random = Random::new(64, 0);
    let mut gaussian = move || random.next_gaussian() as f32;
    let mut dented = ball.clone();
    // Each vertex moves by up to half of the distance to its neighbours.
    for position in &mut dented.positions {
        *position *= 1.0 + 0.02 * gaussian().clamp(-2.0, 2.0);
        *position += 0.01 * Vec3::new(gaussian(), gaussian(), gaussian());
    }
    let far = moved(dented.clone(), |p| p + Vec3::new(3000.0, -2000.0, 100.0));
    for (name, mesh, center) in [
        ("ball", &ball, Vec3::ZERO),
        ("dented ball", &dented, Vec3::ZERO),
        ("far away", &far, Vec3::new(3000.0, -2000.0, 100.0)),
        ("cube", &scenes::cuboid(-Vec3::ONE, Vec3::ONE), Vec3::ZERO),
    ] {
        let triangles = flat(mesh);
        for i in 0..6 {
            let away = Vec3::new(gaussian(), gaussian(), gaussian()).normalize();
            let origin = center + 0.15 * i as f32 * away;
            let mut rays = aimed(mesh, origin);
            rays.extend((0..500).map(|_| {
                let direction = Vec3::new(gaussian(), gaussian(), gaussian());
                Ray::new(origin, direction.normalize())
            }));
            check_all_hit(name, &triangles, &rays);
        }
    }
}

#[test]
fn no_ray_slips_through_the_edges_of_a_plane() {
    let mesh = grid(40);
    for (scale, shift) in [(1.0, Vec3::ZERO), (1e3, Vec3::new(7e3, -4e3, 1e3))] {
        let mesh = moved(mesh.clone(), |p| scale * p + shift);
        let triangles = flat(&mesh);
        // Rays to the rim are left out: rounding may lead past it.
        let rim = 0.99 * scale;
        for eye in [Vec3::new(0.3, 0.2, 1.0), Vec3::new(9.0, -4.0, 0.5), Vec3::new(0.0, 0.0, 50.0)]
        {
            let eye = scale * eye + shift;
            let is_inner = |ray: &Ray| {
                let at_plane = ray.at((shift.z - eye.z) / ray.direction.z) - shift;
                at_plane.x.abs().max(at_plane.y.abs()) < rim
            };
            let rays: Vec<Ray> = aimed(&mesh, eye).into_iter().filter(is_inner).collect();
            assert!(5000 < rays.len());
            check_all_hit("plane", &triangles, &rays);
        }
        // Parallel rays go straight down to vertices.
        let inner = mesh.positions.iter().filter(|p| (**p - shift).abs().max_element() < rim);
        let down: Vec<Ray> =
            inner.map(|&vertex| Ray::new(vertex + scale * Vec3::Z, -Vec3::Z)).collect();
        check_all_hit("straight down", &triangles, &down);
    }
}

/// Returns the mesh rotated about Z by an angle that grows with height.
fn twisted(mesh: &Mesh, turn_rad: f32) -> Mesh {
    moved(mesh.clone(), |p| Quat::from_rotation_z(turn_rad * p.z) * p)
}

fn refit(triangles: &mut FlatTriangles, mesh: &Mesh) -> Refit {
    triangles.refit(&mesh.positions, &mesh.triangles)
}

fn same_bytes(a: &FlatTriangles, b: &FlatTriangles) -> bool {
    a.nodes == b.nodes && a.blocks == b.blocks && a.cost == b.cost
}

#[test]
fn vertices_that_have_not_moved_give_the_same_bytes() {
    for mesh in [scenes::uv_sphere(16, 32, 1.0), soup(300)] {
        let mut triangles = flat(&mesh);
        assert_eq!(refit(&mut triangles, &mesh), Refit::Kept { cost_ratio: 1.0 });
        assert!(same_bytes(&triangles, &flat(&mesh)));
    }
}

#[test]
fn refitted_triangles_are_hit_like_rebuilt_ones() {
    let mesh = scenes::uv_sphere(24, 48, 1.0);
    let mut triangles = flat(&mesh);
    let rays = scenes::random_rays(800, 1.2, 65);
    for turn_rad in [0.2, 0.5] {
        let moved = twisted(&mesh, turn_rad);
        assert!(matches!(refit(&mut triangles, &moved), Refit::Kept { .. }));
        triangles.validate();
        check("twisted", &triangles, &rays);
        let rebuilt = flat(&moved);
        for ray in &rays {
            let (found, expected) =
                (brute_force_hit(&triangles, ray), brute_force_hit(&rebuilt, ray));
            assert_eq!(found.distance, expected.distance);
            if !found.is_miss() {
                assert_eq!(triangles.id(found.slot), rebuilt.id(expected.slot));
            }
        }
    }
    // Moving the vertices back restores every byte.
    refit(&mut triangles, &mesh);
    assert!(same_bytes(&triangles, &flat(&mesh)));
}

#[test]
fn triangles_that_scatter_appear_or_vanish_need_a_rebuild() {
    let mesh = scenes::uv_sphere(24, 48, 1.0);
    let mut random = Random::new(66, 0);
    let mut scattered = mesh.clone();
    for position in &mut scattered.positions {
        *position = Vec3::new(random.next_f32(), random.next_f32(), random.next_f32());
    }
    let mut gone = mesh.clone();
    gone.positions[7].y = f32::NAN;
    let collapsed = moved(mesh.clone(), |_| Vec3::ONE);
    let mut triangles = flat(&mesh);
    for moved in [&scattered, &gone, &collapsed] {
        assert_eq!(refit(&mut triangles, moved), Refit::NeedsRebuild, "{MAX_COST_RATIO}");
        // Moving the vertices back restores every byte.
        assert_eq!(refit(&mut triangles, &mesh), Refit::Kept { cost_ratio: 1.0 });
        assert!(same_bytes(&triangles, &flat(&mesh)));
    }
    for fewer in [&gone, &collapsed] {
        let mut triangles = flat(fewer);
        assert_eq!(refit(&mut triangles, &mesh), Refit::NeedsRebuild);
    }
    assert!(flat(&collapsed).nodes.is_empty());
}

#[test]
fn meshes_without_area_are_never_hit() {
    let line = |i: u32| Vec3::X * i as f32;
    let along = Mesh {
        positions: (0..30).map(line).collect(),
        triangles: (0..28).map(|i| [i, i + 1, i + 2]).collect(),
        ..Mesh::default()
    };
    let unused = Mesh { triangles: Vec::new(), ..along.clone() };
    let equal = moved(along.clone(), |_| Vec3::ONE);
    let not_finite = moved(along.clone(), |p| p * f32::NAN);
    for mesh in [Mesh::default(), along, unused, equal, not_finite] {
        let triangles = flat(&mesh);
        assert_eq!(triangles.slots().count(), 0);
        let rays = scenes::random_rays(100, 1.0, 67);
        for simd in Simd::available() {
            let (hits, any) = search(&triangles, simd, &rays);
            assert!(hits.iter().all(Hit::is_miss) && !any.contains(&true));
        }
    }
}

#[test]
fn non_finite_triangles_are_left_out() {
    let sound = scenes::uv_sphere(16, 32, 1.0);
    let mut mesh = sound.clone();
    for (vertex, bad) in [(40, f32::NAN), (90, f32::INFINITY), (140, f32::NEG_INFINITY)] {
        mesh.positions[vertex].z = bad;
    }
    let triangles = flat(&mesh);
    triangles.validate();
    let is_sound =
        |triangle: &&[u32; 3]| triangle.iter().all(|&i| mesh.positions[i as usize].is_finite());
    let n_sound = mesh.triangles.iter().filter(is_sound).count();
    // Six triangles meet at each of these vertices.
    assert_eq!((triangles.slots().count(), n_sound + 18), (n_sound, sound.triangles.len()));
    let rays = scenes::random_rays(600, 1.1, 68);
    check("not finite", &triangles, &rays);
    // The other triangles are hit as before.
    let whole = flat(&sound);
    for ray in &rays {
        let before = brute_force_hit(&whole, ray);
        if !before.is_miss() && is_sound(&&mesh.triangles[whole.id(before.slot) as usize]) {
            assert_eq!(brute_force_hit(&triangles, ray).distance, before.distance);
        }
    }
}

/// The distance of a hit is that of its triangle, even if the ray grazes it.
#[test]
fn hits_lie_on_their_triangles() {
    let mut random = Random::new(69, 0);
    for (name, mesh) in [("ball", scenes::uv_sphere(24, 48, 1.0)), ("grid", grid(20))] {
        let triangles = flat(&mesh);
        let mut n_hits = 0;
        for i in 0..20_000 {
            let corners = mesh.corners(i * 7919 % mesh.triangles.len());
            let target = corners[0].lerp(corners[1], random.next_f32());
            // The ray is almost within the plane of the triangle.
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            let (sin, cos) = (TAU * random.next_f32()).sin_cos();
            let tangent = (corners[1] - corners[0]).normalize();
            let tilt = 10f32.powf(-1.0 - 7.0 * random.next_f32());
            let direction = cos * tangent + sin * normal.cross(tangent) + tilt * normal;
            let origin = target + 3.0 * direction.normalize();
            let ray = Ray::new(origin, (target - origin).normalize());
            let (hits, _) = search(&triangles, Simd::detect(), &[ray]);
            let Some(hit) = hits.first().filter(|hit| !hit.is_miss()) else { continue };
            let position = ray.at(hit.distance);
            let bounds = Aabb::of_points(triangles.triangle(hit.slot));
            let beyond = (bounds.min - position).max(position - bounds.max).max_element();
            let [a, b, c] = triangles.triangle(hit.slot);
            let cos = (b - a).cross(c - a).normalize().dot(ray.direction).abs();
            // Coordinates of corners about 3 away are rounded, so that planes of triangles of a size of 0.1 are
            // exact to 4e-6: the distance of rays that graze them more closely is undefined.
            if cos < 1e-4 {
                continue;
            }
            let allowed = 100.0 * f32::EPSILON * (1.0 + 1.0 / cos);
            assert!(beyond < allowed, "{name}, tilt {tilt}: off by {beyond} at {cos}");
            n_hits += 1;
        }
        assert!(5000 < n_hits, "{name}: {n_hits}");
    }
}
