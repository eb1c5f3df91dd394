//! Every way a batch may take through the tree (packets, whole, partial or with far ends that meet, and
//! rays in flight) against a plain loop, at every SIMD level.

use crate::batches::surface;
use crate::plain::Plain;
use crate::{build, trace};
use std::path::Path;
use surfel::bvh::Node;
use surfel::flat::FlatCloud;
use surfel::math::{Aabb, Frame, LANES, Random, Ray, Vec3};
use surfel::points::PointCloud;
use surfel::surface::SurfaceKind;
use surfel::trace::{Hit, Simd};
use surfel_formats::{LoadOptions, load};
use surfel_tests::mesh::{Mesh, shared_data};
use surfel_tests::{clouds, scenes};

/// Rays of a packet.
pub const TILE: usize = 16;

#[test]
fn all_modes_find_the_same_in_sound_clouds() {
    let more = [
        ("cube", clouds::cube(12, 0.3, 5)),
        ("even cube", clouds::cube(8, 0.0, 5)),
        ("sphere of more discs than rays", clouds::sphere(20_000, 1.0)),
    ];
    for (name, cloud) in trace::test_clouds().into_iter().chain(more) {
        for kind in [SurfaceKind::Sphere, SurfaceKind::SplatFit] {
            check_modes(name, &scenes::flat(cloud.clone(), kind), 8);
        }
    }
}

#[test]
fn all_modes_find_the_same_in_bad_clouds() {
    for (name, cloud) in build::bad_clouds().into_iter().take(6) {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            check_modes(name, &build::flat(cloud.clone(), kind), 4);
        }
    }
}

#[test]
fn searches_end_where_numbers_overflow() {
    for (name, cloud) in build::bad_clouds().into_iter().skip(6) {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let flat = build::flat(cloud.clone(), kind);
            for simd in Simd::available() {
                let rays = [
                    camera_rays(&flat, 8),
                    degenerate_rays(&flat),
                    not_numbers(Ray::new(Vec3::X, -Vec3::X)),
                ]
                .concat();
                let hits = surface(&flat, simd, &rays);
                assert_eq!(hits.len(), rays.len(), "{name}");
            }
        }
    }
}

#[test]
fn all_modes_find_the_same_in_real_clouds() {
    let Some(data) = shared_data() else { return };
    let bunny = Mesh::from_ascii_ply(&data.join("meshes/bun_zipper.ply")).vertices;
    let scan = loaded(&data.join("clouds/sample_c.las"));
    for (name, cloud) in [("bunny", PointCloud::from_positions(bunny)), ("scan", scan)] {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Splat] {
            check_modes(name, &scenes::flat(cloud.clone(), kind), 4);
        }
    }
}

fn loaded(path: &Path) -> PointCloud {
    load(path, &LoadOptions::default(), &surfel::progress::Silent).unwrap().cloud
}

/// Camera rays, shadow rays from where they hit, rays that go all ways: sorted, mixed and one astray.
fn check_modes(name: &str, scene: &FlatCloud, n_tiles: usize) {
    let camera = Plain::new(scene, camera_rays(scene, n_tiles));
    let shadow = shadow_rays(scene, &camera);
    let rays = [camera.rays, shadow, loose_rays(scene, n_tiles * TILE)].concat();
    let plain = Plain::new(scene, rays);
    let n = plain.rays.len();
    let in_order: Vec<usize> = (0..n).collect();
    let shuffled = shuffled(in_order.clone());
    let tiles = in_order.chunks(TILE).map(<[usize]>::to_vec).collect();
    let tiles = self::shuffled(tiles).concat();
    // Only among rays whose ranges end as theirs: see `finite_and_infinite_ranges_may_share_a_packet`.
    let ends = |i: usize| plain.rays[i].t_max.is_finite();
    let one_astray = tiles.iter().zip(&shuffled).enumerate().map(|(place, (&i, &stray))| {
        if place % 37 == 5 && ends(i) == ends(stray) { stray } else { i }
    });
    let lens: Vec<usize> = (1..=40).collect();
    plain.check(&format!("{name} in tiles"), &in_order, &[TILE]);
    plain.check(&format!("{name} in parts of tiles"), &in_order, &lens);
    plain.check(&format!("{name} shuffled"), &shuffled, &[1, 31, 32, 33, 1000]);
    plain.check(&format!("{name} mixed"), &tiles, &[1000]);
    plain.check(&format!("{name} one astray"), &one_astray.collect::<Vec<_>>(), &[1000]);
}

pub fn shuffled<T>(mut values: Vec<T>) -> Vec<T> {
    let mut random = Random::new(51, 0);
    for i in (1..values.len()).rev() {
        values.swap(i, random.below(i as u64 + 1) as usize);
    }
    values
}

pub fn centers(scene: &FlatCloud) -> Vec<Vec3> {
    scene.points.slots().map(|slot| scene.points.center(slot)).collect()
}

/// From one eye through tiles of four by four pixels, each about a point.
pub fn camera_rays(scene: &FlatCloud, n_tiles: usize) -> Vec<Ray> {
    let centers = centers(scene);
    let bounds = Aabb::of_points(centers.iter().copied());
    let to_eye = (bounds.diagonal() + scene.points.radius(0)) * Vec3::new(0.8, 0.5, 0.6);
    let eye = bounds.center() + to_eye;
    let tile = |i: usize| {
        let to_point = centers[i * 7919 % centers.len()] - eye;
        let frame = Frame::around(to_point.normalize_or(Vec3::X));
        // From a few pixels a radius to a few radii a pixel.
        let slope = 0.02 / (1 + i % 5 * 4) as f32;
        (0..TILE).map(move |pixel| {
            let (x, y) = ((pixel % 4) as f32 - 1.5, (pixel / 4) as f32 - 1.5);
            let across = slope * (x * frame.tangent + y * frame.bitangent);
            Ray::new(eye, (to_point.normalize_or(Vec3::X) + across).normalize())
        })
    };
    (0..n_tiles).flat_map(tile).collect()
}

/// From where rays hit to a light whose distance is the end of their range.
pub fn shadow_rays(scene: &FlatCloud, camera: &Plain) -> Vec<Ray> {
    let bounds = Aabb::of_points(centers(scene));
    let light = bounds.center() + bounds.diagonal() * Vec3::new(0.4, 0.7, 0.5);
    let hits = camera.rays.iter().zip(&camera.closest).filter(|(_, hit)| !hit.is_miss());
    let ray = |(ray, hit): (&Ray, &Hit)| {
        let origin = ray.at(hit.distance - 0.5 * scene.points.radius(hit.slot));
        let distance = origin.distance(light);
        Ray { t_max: distance, ..Ray::new(origin, (light - origin) / distance) }
    };
    hits.map(ray).collect()
}

/// From near and far toward points, some of bounded range, some along an axis.
pub fn loose_rays(scene: &FlatCloud, n: usize) -> Vec<Ray> {
    let centers = centers(scene);
    let diagonal = Aabb::of_points(centers.iter().copied()).diagonal();
    let mut random = Random::new(52, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    (0..n)
        .map(|i| {
            let radius = scene.points.radius(0);
            let away = Vec3::new(gaussian(), gaussian(), gaussian()).normalize_or(Vec3::X);
            let distance = if i % 2 == 0 { 4.0 * radius } else { diagonal + radius };
            let origin = centers[i * 7919 % centers.len()] + distance * away;
            let direction = if i % 7 == 0 { Vec3::AXES[i % 3] } else { -away };
            let range = if i % 5 == 0 { 0.5..1.5 } else { 0.0..f32::INFINITY };
            Ray { origin, t_min: range.start * distance, direction, t_max: range.end * distance }
        })
        .collect()
}

#[test]
fn all_modes_agree_on_degenerate_rays() {
    for (name, cloud) in [
        ("one point", clouds::sphere(1, 1.0)),
        ("sphere", clouds::sphere(300, 1.0)),
        ("even plane", clouds::plane(12, 0.0, 1)),
        ("crossing planes", clouds::crossing_planes(12, 0.4, 2)),
        ("even cube", clouds::cube(4, 0.0, 5)),
        ("line", clouds::line(50)),
    ] {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let scene = scenes::flat(cloud.clone(), kind);
            let (ending, endless): (Vec<Ray>, Vec<Ray>) =
                degenerate_rays(&scene).into_iter().partition(|ray| ray.t_max.is_finite());
            for rays in [ending, endless] {
                check_degenerate(name, &Plain::new(&scene, rays));
            }
        }
    }
}

/// Each ray in a packet of sixteen of it, beside others of its sort and alone.
fn check_degenerate(name: &str, plain: &Plain) {
    let n = plain.rays.len();
    let in_order: Vec<usize> = (0..n).collect();
    let alike: Vec<usize> = (0..n).flat_map(|i| [i; TILE]).collect();
    plain.check(&format!("{name} alike"), &alike, &[TILE]);
    plain.check(&format!("{name} in order"), &in_order, &[n]);
    plain.check(&format!("{name} shuffled"), &shuffled(in_order), &[1, 5, 33]);
}

#[test]
fn a_degenerate_ray_leaves_the_others_of_its_packet_alone() {
    for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
        let scene = scenes::flat(clouds::sphere(300, 1.0), kind);
        check_strays(&scene, degenerate_rays(&scene));
    }
}

/// Packets of sound rays in which one place is taken by each of `strays`.
fn check_strays(scene: &FlatCloud, strays: Vec<Ray>) {
    let n_tiles = 4;
    let first = n_tiles * TILE;
    let plain = Plain::new(scene, [camera_rays(scene, n_tiles), strays].concat());
    let tile = |stray: usize| {
        let place = 1 + stray % (TILE - 1);
        let first = stray % n_tiles * TILE;
        (0..TILE).map(move |lane| if lane == place { stray } else { first + lane })
    };
    let order: Vec<usize> = (first..plain.rays.len()).flat_map(tile).collect();
    plain.check("one degenerate", &order, &[TILE]);
}

/// Along axes, in planes of discs, past rims, on faces of boxes, of bare and empty ranges, from far away.
pub fn degenerate_rays(scene: &FlatCloud) -> Vec<Ray> {
    let points = &scene.points;
    let mut rays = Vec::new();
    for slot in some_slots(scene) {
        let (center, normal, radius) =
            (points.center(slot), points.normal(slot), points.radius(slot));
        for direction in telling_directions(normal) {
            let distances = [radius, 3.0 * radius, 1e6, 1e12, 1e20, 1e30];
            rays.extend(distances.map(|d| Ray::new(center - d * direction, direction)));
        }
        let ray = Ray::new(center - 3.0 * radius * normal, normal);
        let distance = Plain::new(scene, vec![ray]).closest[0].distance;
        rays.extend(ranges(distance).map(|(t_min, t_max)| Ray { t_min, t_max, ..ray }));
    }
    rays.extend(from_box_faces(scene));
    rays.push(Ray::new(Vec3::splat(0.1), Vec3::ZERO));
    rays
}

fn some_slots(scene: &FlatCloud) -> Vec<u32> {
    let slots: Vec<u32> = scene.points.slots().collect();
    slots.iter().copied().step_by(slots.len().div_ceil(5)).collect()
}

fn telling_directions(normal: Vec3) -> Vec<Vec3> {
    let frame = Frame::around(normal);
    let others = [normal, -normal, frame.tangent, -frame.bitangent];
    signed_axes().into_iter().chain(others).collect()
}

/// Ranges that begin, end, or begin and end at the hit or just beside it, and ranges of nothing.
fn ranges(distance: f32) -> impl Iterator<Item = (f32, f32)> {
    let (before, behind, end) = (distance.next_down(), distance.next_up(), f32::INFINITY);
    let at_hit = [(distance, distance), (0.0, distance), (distance, end), (0.0, before)];
    let beside = [(behind, end), (before, behind), (behind, before), (before, end)];
    let empty = [(2.0 * distance, 0.5 * distance), (end, end), (end, 0.0)];
    let short = [(0.0, 0.0), (-0.0, end), (0.0, 1e-38), (0.0, f32::from_bits(1))];
    at_hit.into_iter().chain(beside).chain(empty).chain(short)
}

fn from_box_faces(scene: &FlatCloud) -> Vec<Ray> {
    let children = |node| (0..LANES).filter(move |&lane| Node::child(node, lane).is_some());
    let nodes = scene.points.nodes.iter().take(3);
    let boxes = nodes.flat_map(|node| children(node).map(|lane| node.bounds(lane)));
    let rays = |bounds: Aabb| {
        let ray = move |(i, direction): (usize, Vec3)| {
            let mut origin = bounds.center();
            origin[i % 3] = bounds.min[i % 3];
            [Ray::new(origin, direction), Ray::new(bounds.max, direction)]
        };
        signed_axes().into_iter().enumerate().flat_map(ray)
    };
    boxes.flat_map(rays).collect()
}

/// Each axis both ways, among zeros of both signs.
fn signed_axes() -> Vec<Vec3> {
    let zeros = [Vec3::ZERO, -Vec3::ZERO];
    let axes = Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    axes.flat_map(|axis| zeros.map(|zero| Vec3::select(axis.cmpeq(Vec3::ZERO), zero, axis)))
        .collect()
}

/// The ray, but something in it is not a number or not finite.
fn not_numbers(ray: Ray) -> Vec<Ray> {
    let is_axis = |axis: Vec3| axis.cmpeq(Vec3::ONE);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().flat_map(|value| {
        Vec3::AXES.into_iter().chain([Vec3::ONE]).flat_map(move |axes| {
            let with_bad = |vector| Vec3::select(is_axis(axes), Vec3::splat(value), vector);
            let origin = Ray { origin: with_bad(ray.origin), ..ray };
            [origin, Ray { direction: with_bad(ray.direction), ..ray }]
        })
    });
    bad.chain([Ray { t_min: f32::NAN, ..ray }, Ray { t_max: f32::NAN, ..ray }]).collect()
}

#[test]
fn rays_that_are_not_numbers_hit_nothing() {
    for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
        let scene = scenes::flat(clouds::sphere(300, 1.0), kind);
        let plain = Plain::new(&scene, not_numbers(Ray::new(3.0 * Vec3::X, -Vec3::X)));
        assert!(plain.closest.iter().all(Hit::is_miss));
        check_degenerate("not numbers", &plain);
    }
}

/// Ties everywhere: discs of one plane, spheres that touch, rays through corners and along planes.
#[test]
fn all_modes_agree_on_small_grids() {
    let rays = grid_rays(BESIDE_PLANES);
    for n in 1..=17 {
        for draw in 0..3u64 {
            let cloud = grid_points(n, draw);
            for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
                let scene = build::flat(cloud.clone(), kind);
                check_grid(&format!("{n} points, draw {draw}"), &scene, &rays);
            }
        }
    }
}

/// All the clouds that corners of a cube give.
#[test]
fn all_modes_agree_on_the_corners_of_a_cube() {
    let rays: Vec<Ray> = grid_rays(BESIDE_PLANES).into_iter().step_by(7).collect();
    for set in 1..256u32 {
        let corners = (0..8u32).filter(|corner| set >> corner & 1 == 1);
        let positions: Vec<Vec3> = corners.map(|i| grid_place(i as usize, 2)).collect();
        let normals = (0..positions.len()).map(|i| Vec3::AXES[(i + set as usize) % 3]);
        let cloud = PointCloud {
            normals: Some(normals.collect()),
            radii: Some(vec![0.5 + 0.5 * (set % 3) as f32; positions.len()]),
            ..PointCloud::from_positions(positions)
        };
        let kind = [SurfaceKind::Sphere, SurfaceKind::Disc][set as usize % 2];
        check_grid(&format!("corners {set:b}"), &build::flat(cloud, kind), &rays);
    }
}

fn check_grid(name: &str, scene: &FlatCloud, rays: &[Ray]) {
    let plain = Plain::new(scene, rays.to_vec());
    plain.check_in_order(name);
    let shuffled = shuffled((0..rays.len()).collect());
    plain.check(name, &shuffled, &[rays.len()]);
}

fn grid_place(i: usize, n_side: usize) -> Vec3 {
    Vec3::new((i % n_side) as f32, (i / n_side % n_side) as f32, (i / n_side / n_side) as f32)
}

/// Distinct places of a grid of 3 x 3 x 3 with normals along axes and radii of 0.5, 1 or 1.5.
fn grid_points(n: usize, draw: u64) -> PointCloud {
    let mut random = Random::new(53, draw);
    let mut places: Vec<Vec3> = (0..27).map(|i| grid_place(i, 3)).collect();
    for i in 0..n {
        places.swap(i, i + random.below(27 - i as u64) as usize);
    }
    places.truncate(n);
    let normals = places.iter().map(|_| Vec3::AXES[random.below(3) as usize]).collect();
    let radii = places.iter().map(|_| 0.5 * (1 + random.below(3)) as f32).collect();
    PointCloud { normals: Some(normals), radii: Some(radii), ..PointCloud::from_positions(places) }
}

/// Coordinates of rays' origins that are in no disc's plane.
const BESIDE_PLANES: [f32; 4] = [-1.0, 0.25, 0.5, 3.0];

/// From places in and around the grid in the directions of a cube's faces, edges and corners; sixteen
/// neighbouring origins go the same way.
fn grid_rays(along: [f32; 4]) -> Vec<Ray> {
    let directions = (0..27).filter(|&i| i != 13).map(|i| grid_place(i, 3) - Vec3::ONE);
    let origin = move |i: usize| Vec3::new(along[i % 4], along[i / 4 % 4], along[i / 16]);
    let from_everywhere =
        move |direction: Vec3| (0..64).map(move |i| Ray::new(origin(i), direction.normalize()));
    directions.flat_map(from_everywhere).collect()
}

/// Cases that once failed.
mod known {
    use super::*;

    #[test]
    fn a_disc_that_the_ray_starts_on_is_hit_at_zero() {
        let rays = grid_rays([-1.0, 0.0, 0.5, 2.0]);
        for n in 1..=17 {
            check_grid(
                &format!("{n} points"),
                &build::flat(grid_points(n, 1), SurfaceKind::Disc),
                &rays,
            );
        }
    }

    #[test]
    fn of_discs_that_the_ray_starts_on_the_one_in_the_lowest_slot_is_hit() {
        let scene = scenes::flat(clouds::plane(12, 0.0, 1), SurfaceKind::Disc);
        let from_centers = some_slots(&scene).into_iter().flat_map(|slot| {
            let center = scene.points.center(slot);
            telling_directions(Vec3::Z)
                .into_iter()
                .map(move |direction| Ray::new(center, direction))
        });
        check_degenerate("from centres", &Plain::new(&scene, from_centers.collect()));
    }

    #[test]
    fn a_range_may_end_at_negative_zero() {
        let scene = scenes::flat(clouds::sphere(300, 1.0), SurfaceKind::Sphere);
        let rays = camera_rays(&scene, 2).into_iter().map(|ray| {
            let origin = ray.at(0.9 * ray.origin.length());
            Ray { origin, t_max: -0.0, ..ray }
        });
        check_degenerate("-0.0", &Plain::new(&scene, rays.collect()));
    }

    #[test]
    fn finite_and_infinite_ranges_may_share_a_packet() {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let scene = scenes::flat(clouds::sphere(300, 1.0), kind);
            for end in [f32::INFINITY, f32::MAX] {
                let rays = camera_rays(&scene, 4).into_iter().enumerate();
                let rays = rays
                    .map(|(i, ray)| Ray { t_max: if i % TILE == 3 { end } else { 9.0 }, ..ray });
                Plain::new(&scene, rays.collect()).check_in_order(&format!("{end}"));
            }
        }
    }

    #[test]
    fn a_ray_that_is_not_a_number_leaves_the_others_of_its_packet_alone() {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let scene = scenes::flat(clouds::sphere(300, 1.0), kind);
            check_strays(&scene, not_numbers(Ray::new(3.0 * Vec3::X, -Vec3::X)));
            // Which go the same way as the others.
            let strays = camera_rays(&scene, 4).into_iter().flat_map(not_numbers);
            check_strays(&scene, strays.collect());
        }
    }
}
