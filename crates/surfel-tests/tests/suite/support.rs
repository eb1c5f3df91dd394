//! Support: the number of points near a hit and the distance of the nearest one, against plain loops.

use super::instances::{at, flat, hits};
use surfel_core::flat::{FlatGeometry, FlatScene};
use surfel_core::image::{Colormap, NO_ID, PercentileRange, decode_srgb8};
use surfel_core::math::{DAffine3, DVec3, Ray, Vec3};
use surfel_core::points::{PointCloud, STRUCTURE, Scalar, Values};
use surfel_core::render::Settings;
use surfel_core::scene::color::SupportColors;
use surfel_core::scene::{CloudGeometry, Geometry, Material, Scene};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::{self, InstanceFilter, SceneHit, Simd, Support};
use surfel_tests::clouds;
use surfel_tests::scenes;

const SETTINGS: Settings = Settings {
    width: 48,
    height: 48,
    samples_per_pixel: 1,
    noise_threshold: 0.0,
    light_samples: 1,
    max_depth: 2,
    seed: 0,
    point_size: 3.0,
    with_aovs: true,
};

/// Finds the support of hits at all SIMD levels, which must agree.
fn supports(scene: &FlatScene, rays: &[Ray], hits: &[SceneHit]) -> Vec<Support> {
    let all = Simd::available().into_iter().map(|simd| {
        let mut supports = vec![Support::POINT; rays.len()];
        trace::scene_supports(scene, simd, rays, hits, &mut supports);
        supports
    });
    let all: Vec<_> = all.collect();
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
    all.into_iter().next().unwrap()
}

/// A cloud whose points are parts of a surface, of lines and of neither in turn.
fn mixed(kind: SurfaceKind) -> CloudGeometry {
    let points = scenes::points(clouds::sphere(3000, 1.0), kind);
    let codes = (0..points.cloud().len()).map(|i| [0, 0, 0, 1, 2][i % 5]).collect();
    let structure = Scalar { name: STRUCTURE.to_owned(), values: Values::U8(codes) };
    scenes::changed(&points, |cloud| cloud.scalars.push(structure))
}

#[test]
fn supports_equal_those_of_a_plain_loop() {
    let rays = scenes::random_rays(3000, 1.0, 5);
    for kind in scenes::hit_kinds() {
        let scene = flat(scenes::graph(vec![(Geometry::Points(mixed(kind)), Material::MATTE)]));
        let FlatGeometry::Cloud(cloud) = scene.geometry(&scene.instances[0]) else {
            panic!("the scene is a cloud");
        };
        let hits = hits(&scene, InstanceFilter::All, &rays);
        let mut n_of_kinds = [0; 3];
        for ((ray, hit), support) in rays.iter().zip(&hits).zip(supports(&scene, &rays, &hits)) {
            let Some(surface) = hit.surface else {
                assert_eq!(support, Support::NONE);
                continue;
            };
            let points = cloud.points_of(surface);
            assert_eq!(points.id(hit.slot), hit.id);
            let position = ray.at(hit.distance);
            let factor = if surface == kind { cloud.radius_factor() } else { 1.0 };
            let radius = points.radius(hit.slot) / factor;
            if !surface.is_continuous() {
                n_of_kinds[1 + usize::from(surface == SurfaceKind::Capsule)] += 1;
                let across = (points.center(hit.slot) - ray.origin).cross(ray.direction).length();
                assert_eq!(support.n_points, 1);
                assert!((support.distance - across / radius).abs() < 1e-3, "{support:?}");
                continue;
            }
            n_of_kinds[0] += 1;
            let distances = points.slots().map(|slot| points.center(slot).distance(position));
            let mut distances: Vec<f32> = distances.map(|distance| distance / radius).collect();
            distances.sort_by(f32::total_cmp);
            assert!((support.distance - distances[0]).abs() < 1e-3, "{support:?}");
            // Points just at the limit may be rounded to either side of it.
            let within = |limit: f32| distances.partition_point(|distance| *distance < limit);
            let n_points = support.n_points as usize;
            assert!((within(0.999)..=within(1.001)).contains(&n_points), "{support:?}");
        }
        let is_sphere = kind == SurfaceKind::Sphere;
        assert!(is_sphere || n_of_kinds.iter().all(|n| 20 < *n), "{kind:?}: {n_of_kinds:?}");
    }
}

/// A lattice of spacing 1 with discs of radius 2 in the plane of Z = 0.
fn lattice(kind: SurfaceKind) -> CloudGeometry {
    let points = (-6..=6).flat_map(|x| (-6..=6).map(move |y| Vec3::new(x as f32, y as f32, 0.0)));
    let mut cloud = PointCloud::from_positions(points.collect());
    cloud.radii = Some(vec![2.0; cloud.len()]);
    cloud.normals = Some(vec![Vec3::Z; cloud.len()]);
    let mut points = scenes::grey(cloud);
    points.surface = kind;
    points
}

#[test]
fn a_lattice_has_the_support_of_its_closed_form() {
    let half = 0.5f32;
    let rays = [Vec3::ZERO, Vec3::new(half, half, 0.0), Vec3::new(0.25, 0.0, 0.0)]
        .map(|target| Ray::new(target + 9.0 * Vec3::Z, Vec3::NEG_Z));
    for kind in scenes::hit_kinds().filter(|kind| kind.uses_discs()) {
        for (name, matrix) in [
            ("in place", DAffine3::IDENTITY),
            ("larger", DAffine3::from_scale(DVec3::splat(4.0))),
            ("moved", at(DVec3::new(0.0, 0.0, -3.0))),
        ] {
            let mut graph = scenes::graph(vec![(Geometry::Points(lattice(kind)), Material::MATTE)]);
            graph.nodes = vec![scenes::node(0, 0, matrix)];
            let scene = flat(graph);
            let scale = matrix.matrix3.x_axis.x as f32;
            let origin = scene.origin.as_vec3();
            let rays = rays.map(|ray| Ray {
                origin: Vec3::new(scale, scale, 1.0) * ray.origin - origin,
                ..ray
            });
            let hits = hits(&scene, InstanceFilter::All, &rays);
            let found = supports(&scene, &rays, &hits);
            let expected = [0.0, half.hypot(half) / 2.0, 0.125];
            for (support, expected) in found.iter().zip(expected) {
                let distance = support.distance;
                assert!((distance - expected).abs() < 5e-3, "{kind:?} {name}: {distance}");
            }
            // A disc of radius 2 holds 13 points of the lattice about a point, four of them at its rim, and 12 about the
            // middle of four.
            assert!((9..=13).contains(&found[0].n_points), "{kind:?} {name}: {found:?}");
            assert_eq!(found[1].n_points, 12, "{kind:?} {name}");
        }
    }
}

#[test]
fn layers_hold_the_support() {
    let floor = scenes::floor(-1.5, 3.0);
    for kind in scenes::hit_kinds() {
        let mut scene = scenes::lit(scenes::points(clouds::sphere(4000, 1.0), kind));
        scene.graph = scenes::graph(vec![
            (Geometry::Points(scenes::points(clouds::sphere(4000, 1.0), kind)), Material::MATTE),
            (Geometry::Triangles(floor.clone()), Material::MATTE),
        ]);
        scene.camera.position = DVec3::new(5.0, 0.0, 2.0);
        for samples_per_pixel in [1, 2] {
            let image = scenes::render(&scene, &Settings { samples_per_pixel, ..SETTINGS });
            let aovs = image.aovs.unwrap();
            let mut n_hits = [0; 3];
            for (pixel, instance) in aovs.instance_id.iter().enumerate() {
                let (count, distance) = (aovs.support_count[pixel], aovs.support_distance[pixel]);
                n_hits[(*instance).min(2) as usize] += 1;
                if *instance == 0 {
                    assert!(0 < count && distance < 1.5, "{kind:?}: {count} {distance}");
                } else {
                    assert_eq!((count, distance), (0, f32::INFINITY));
                }
            }
            assert!(n_hits.iter().all(|n| 50 < *n), "{n_hits:?}");
        }
    }
    let raster = scenes::scene(clouds::sphere(4000, 1.0), SurfaceKind::Points);
    let aovs = scenes::render(&raster, &SETTINGS).aovs.unwrap();
    for (pixel, instance) in aovs.instance_id.iter().enumerate() {
        let expected = if *instance == NO_ID { Support::NONE } else { Support::POINT };
        assert_eq!(aovs.support_count[pixel], expected.n_points);
        assert_eq!(aovs.support_distance[pixel], expected.distance);
    }
}

#[test]
fn colors_show_the_distances_of_the_layer() {
    let colormap = Colormap::from_name("turbo").unwrap();
    let range = PercentileRange { low: 0.0, high: 0.8 };
    let support_colors = SupportColors { colormap, range };
    for kind in scenes::hit_kinds() {
        let mut points = mixed(kind);
        points.support_colors = Some(support_colors);
        let image = scenes::render(&scenes::lit(points), &SETTINGS);
        let aovs = image.aovs.unwrap();
        for (pixel, albedo) in aovs.albedo.iter().enumerate() {
            if aovs.instance_id[pixel] != NO_ID {
                assert_eq!(*albedo, support_colors.color(aovs.support_distance[pixel]));
            }
        }
    }
}

/// A mirror shows the support of what it reflects.
#[test]
fn reflections_show_support_too() {
    let colormap = Colormap::from_name("gray").unwrap();
    let range = PercentileRange { low: 0.0, high: 0.0001 };
    let far = SupportColors { colormap, range }.color(1.0);
    assert_eq!(far, Vec3::splat(decode_srgb8(255)));
    let mut scene: Scene = scenes::lit(lattice(SurfaceKind::Smooth));
    let mut picture = |support_colors| {
        let mut points = lattice(SurfaceKind::Smooth);
        points.support_colors = support_colors;
        scene.graph = scenes::graph(vec![
            (Geometry::Points(points), Material::UNLIT),
            (Geometry::Triangles(scenes::floor(-1.0, 5.0)), Material::MIRROR),
        ]);
        scene.camera.position = DVec3::new(0.3, 0.2, -0.5);
        scene.camera.focal_point = DVec3::new(0.3, 0.2, -1.0);
        scene.camera.view_up = DVec3::Y;
        scenes::render(&scene, &SETTINGS).color[24 * 48 + 24]
    };
    let (own, by_support) = (picture(None), picture(Some(SupportColors { colormap, range })));
    assert!(own[0] + 0.2 < by_support[0], "{own:?} {by_support:?}");
}
