//! Light on points with known answers: furnaces, shadows, unlit colours, layers and backgrounds.

use surfel_core::flat::FlatScene;
use surfel_core::image::encode_srgb8;
use surfel_core::math::{DVec3, Random, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    Background, Camera, CloudGeometry, Geometry, Light, Material, Projection, Scene, Sky, Sun,
};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::Simd;
use surfel_tests::backends;
use surfel_tests::clouds;
use surfel_tests::scenes;

const SETTINGS: Settings = Settings {
    width: 64,
    height: 64,
    samples_per_pixel: 1,
    noise_threshold: 0.0,
    light_samples: 16,
    max_depth: 8,
    seed: 1,
    point_size: 1.0,
    with_aovs: true,
};

const FURNACE: Sky =
    Sky { up: Vec3::Z, zenith: Vec3::ONE, ground: Vec3::ONE, ao_distance: f32::INFINITY };

#[test]
fn pixels_are_lit_by_the_normals_of_points_that_have_some() {
    let direction = Vec3::new(0.0, 0.6, 0.8);
    let sun = Light::Sun(Sun { direction, color: Vec3::ONE, angular_diameter_deg: 0.0 });
    let brightness = |has_normals: bool, light: &Light| {
        let mut points = scenes::points(clouds::plane(120, 0.0, 1), SurfaceKind::Points);
        if !has_normals {
            points = scenes::changed(&points, |cloud| cloud.normals = None);
        }
        let (lights, camera) = (vec![light.clone()], scenes::from_above(1.0));
        let scene = Scene { lights, camera, ..scenes::lit(points) };
        let image = scenes::render(&scene, &Settings { point_size: 3.0, ..SETTINGS });
        let sum: f32 = image.color.iter().map(|color| color[0]).sum();
        sum / image.coverage.iter().sum::<f32>()
    };
    let headlight = Light::Headlight(1.0);
    let ratio = brightness(true, &sun) / brightness(true, &headlight);
    assert!((ratio - 0.8).abs() < 0.01, "{ratio}");
    // Eye-dome lighting depends on no light, and leaves a plane seen from above as it is.
    let eye_dome = brightness(false, &sun);
    assert_eq!(eye_dome, brightness(false, &headlight));
    assert!((eye_dome / brightness(true, &headlight) - 1.0).abs() < 0.01, "{eye_dome}");
}

#[test]
fn a_white_sphere_in_a_furnace_is_white() {
    let kinds = [SurfaceKind::Sphere, SurfaceKind::Disc, SurfaceKind::Splat, SurfaceKind::SplatFit];
    check_furnace(&backends::cpu(), &kinds);
}

/// Fails unless a renderer shows white spheres of these kinds in a white furnace as white.
pub fn check_furnace(renderer: &dyn Renderer, kinds: &[SurfaceKind]) {
    for &kind in kinds {
        let points = scenes::points(clouds::sphere(20_000, 1.0), kind);
        let colors = vec![[255; 3]; points.cloud().len()];
        let scene = scenes::lit(scenes::colored(&points, colors));
        let scene = Scene { lights: vec![Light::Sky(FURNACE)], ..scene };
        let flat = FlatScene::new(&scene, &NoProgress).unwrap();
        let image = backends::render(renderer, &flat, &SETTINGS);
        let covered = image.color.iter().filter(|pixel| pixel[3] == 1.0);
        let (sum, count) = covered.fold((0.0, 0), |(sum, n), pixel| (sum + pixel[0], n + 1));
        let mean = sum / count as f32;
        // Spheres shade the dents between them; discs on a convex surface hardly shade each other.
        let min = if kind == SurfaceKind::Sphere { 0.70 } else { 0.985 };
        assert!(600 < count && (min..=1.0).contains(&mean), "{}: {mean} over {count}", kind.name());
    }
}

/// Returns a scene of a ball above a floor under a sun.
fn ball_over_floor(sun: Sun) -> Scene {
    let floor = clouds::plane(150, 0.4, 8).positions.into_iter().map(|p| 3.0 * p);
    let ball = clouds::sphere(6000, 0.5).positions.into_iter().map(|p| p + Vec3::Z);
    let cloud = PointCloud::from_positions(floor.chain(ball).collect());
    let camera = Camera {
        position: DVec3::new(0.0, 0.0, -10.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Y,
        projection: Projection::Orthographic { height: 4.0 },
    };
    // The camera is below, so that the ball does not hide its shadow: the floor is one sheet of points.
    Scene { lights: vec![Light::Sun(sun)], camera, ..scenes::scene(cloud, SurfaceKind::Splat) }
}

#[test]
fn a_shadow_lies_where_the_sun_casts_it() {
    // Seen from below the floor faces away from the sun, so this camera is above.
    let sun = Sun { direction: Vec3::Z, color: Vec3::ONE, angular_diameter_deg: 0.0 };
    let mut scene = ball_over_floor(sun);
    scene.camera.position = DVec3::new(0.0, 0.0, 10.0);
    for (direction, center) in
        [(Vec3::Z, Vec3::ZERO), (Vec3::new(1.0, 0.0, 1.0).normalize(), Vec3::new(-1.0, 0.0, 0.0))]
    {
        scene.lights = vec![Light::Sun(Sun { direction, ..sun })];
        let image = scenes::render(&scene, &SETTINGS);
        let mut n_checked = 0;
        for (pixel, position) in image.color.iter().zip(&image.aovs.as_ref().unwrap().position) {
            // Only pixels of the floor that the ball does not hide are tested.
            if 0.2 < position.z || 1.9 < position.abs().max_element() {
                continue;
            }
            // The shadow is within 0.5 of the axis through the ball along the sun's direction.
            let from_center = *position - center.with_z(0.0);
            let across = from_center - from_center.dot(direction) * direction;
            let is_dark = pixel[0] < 0.1;
            if (across.length() - 0.5).abs() > 0.06 {
                assert_eq!(is_dark, across.length() < 0.5, "at {position} toward {direction}");
                n_checked += 1;
            }
        }
        assert!(2500 < n_checked, "{n_checked}");
    }
}

#[test]
fn a_wide_sun_casts_a_penumbra() {
    let sun = Sun { direction: Vec3::Z, color: Vec3::ONE, angular_diameter_deg: 30.0 };
    let mut scene = ball_over_floor(sun);
    scene.camera.position = DVec3::new(0.0, 0.0, 10.0);
    let settings = Settings { light_samples: 64, ..SETTINGS };
    let image = scenes::render(&scene, &settings);
    let grey = image
        .color
        .iter()
        .zip(&image.aovs.as_ref().unwrap().position)
        .filter(|(pixel, position)| position.z < 0.2 && (0.1..0.4).contains(&pixel[0]))
        .count();
    assert!(100 < grey, "{grey} pixels in the penumbra");
}

/// Returns how many pixels show a cloud, and how many of them the sun does not light.
fn shaded_pixels(points: &CloudGeometry, to_sun: Vec3, view: (DVec3, f64)) -> (usize, usize) {
    let direction = to_sun.normalize();
    let sun = Sun { direction, color: Vec3::ONE, angular_diameter_deg: 0.0 };
    let (toward_camera, height) = view;
    let focal_point = DVec3::new(0.0, 1.0, 0.0);
    let camera = Camera {
        position: focal_point + 10.0 * toward_camera,
        focal_point,
        view_up: DVec3::Z,
        projection: Projection::Orthographic { height },
    };
    let scene = scenes::lit(points.clone());
    let image =
        scenes::render(&Scene { lights: vec![Light::Sun(sun)], camera, ..scene }, &SETTINGS);
    let covered = image.color.iter().zip(&image.coverage).filter(|(_, c)| 0.0 < **c);
    let n_dark = covered.clone().filter(|(pixel, _)| pixel[0] <= 0.1).count();
    (covered.count(), n_dark)
}

#[test]
fn no_light_leaks_between_a_floor_and_the_wall_before_the_sun() {
    const SPACING: f32 = 0.04;
    let grid = || (0..50 * 50).map(|i| SPACING * Vec3::new((i % 50) as f32, (i / 50) as f32, 0.0));
    let wall = grid().map(|p| Vec3::new(0.0, p.y, p.x));
    let mut cloud = PointCloud::from_positions(grid().chain(wall).collect());
    cloud.normals = Some([[Vec3::Z; 2500], [Vec3::X; 2500]].concat());
    let mut points = scenes::points(cloud, SurfaceKind::Smooth);
    for sides_are_known in [false, true] {
        points.has_front_sides = sides_are_known;
        let view = (DVec3::new(1.0, 0.0, 0.8), 0.25);
        let shaded = shaded_pixels(&points, Vec3::new(-1.0, 0.0, 0.8), view);
        assert_eq!(shaded, (64 * 64, 64 * 64));
    }
}

#[test]
fn edges_do_not_shade_themselves_where_sides_are_known() {
    let mut random = Random::new(4, 0);
    let mut side = |i: usize| {
        let mut p = Vec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f32() - 1.0));
        let mut normal = Vec3::ZERO;
        p[i % 3] = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        normal[i % 3] = p[i % 3];
        let noise = Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32));
        (p + Vec3::Y + 0.015 * noise, normal)
    };
    let (positions, normals) = (0..8000).map(&mut side).unzip();
    let cloud = PointCloud { normals: Some(normals), ..PointCloud::from_positions(positions) };
    let mut points = scenes::points(cloud, SurfaceKind::Smooth);
    let [unknown, known] = [false, true].map(|sides_are_known| {
        points.has_front_sides = sides_are_known;
        shaded_pixels(&points, Vec3::new(0.6, 1.0, 0.8), (DVec3::new(1.0, 0.5, 0.8), 4.0)).1
    });
    assert!(known == 0 && 0 < unknown, "{unknown} {known}");
}

#[test]
fn unlit_colors_are_exact() {
    for (name, kind) in SurfaceKind::ALL {
        for value in [0u8, 1, 64, 128, 200, 255] {
            let points = scenes::points(clouds::sphere(8000, 1.0), kind);
            let colors = vec![[value, 128, value]; points.cloud().len()];
            let mut scene = scenes::lit(scenes::colored(&points, colors));
            scene.graph.materials[0] = Material::UNLIT;
            let settings = Settings { samples_per_pixel: 4, ..SETTINGS };
            let image = scenes::render(&scene, &settings);
            let center = image.color[32 * 64 + 32];
            let full = if kind == SurfaceKind::Points {
                image.color.iter().find(|pixel| pixel[3] == 1.0).copied().unwrap()
            } else {
                center
            };
            assert_eq!(full.map(encode_srgb8), [value, 128, value, 255], "{name}");
        }
    }
}

#[test]
fn layers_hold_the_hits_of_the_pixel_centres() {
    let scene =
        scenes::scene(clouds::georeferenced(&clouds::sphere(20_000, 1.0)), SurfaceKind::Splat);
    let image = scenes::render(&scene, &SETTINGS);
    let aovs = image.aovs.as_ref().unwrap();
    let center = 32 * 64 + 32;
    assert!((aovs.depth[center] - 5.0).abs() < 0.01, "{}", aovs.depth[center]);
    assert!(aovs.position[center].distance(Vec3::X) < 0.06);
    assert!(0.99 < aovs.normal[center].x);
    assert_eq!((aovs.instance_id[center], image.coverage[center]), (0, 1.0));
    let point = scenes::cloud(&scene).cloud().positions()[aovs.point_id[center] as usize];
    assert!(point.distance(aovs.position[center]) < 0.06);
    assert_eq!((aovs.point_id[0], aovs.instance_id[0]), (u32::MAX, u32::MAX));
    assert_eq!((aovs.depth[0], image.coverage[0], image.color[0]), (f32::INFINITY, 0.0, [0.0; 4]));
}

/// Rasterised points and traced splats have the same background.
#[test]
fn the_environment_is_seen_behind_points() {
    for camera_direction in [DVec3::X, DVec3::new(0.5, 1.0, 2.0), -DVec3::Z] {
        let picture = |kind: SurfaceKind| {
            let mut scene = scenes::scene(clouds::sphere(2000, 1.0), kind);
            scene.camera.position = 8.0 * camera_direction.normalize();
            scene.camera.view_up = DVec3::Y;
            scene.background = Background::Environment;
            let ground = Vec3::new(0.1, 0.2, 0.3);
            scene.lights = vec![Light::Sky(Sky { ground, ..FURNACE })];
            scenes::render(&scene, &SETTINGS)
        };
        let (points, splats) = (picture(SurfaceKind::Points), picture(SurfaceKind::Splat));
        for corner in [0, 63, 63 * 64, 64 * 64 - 1] {
            assert_eq!(points.color[corner], splats.color[corner]);
            assert_eq!(points.color[corner][3], 1.0);
            assert_eq!((points.coverage[corner], splats.coverage[corner]), (0.0, 0.0));
        }
    }
}

#[test]
fn a_material_without_vertex_colors_and_its_emission_are_seen_on_rasterised_points() {
    let picture = |material: Material| {
        let geometry = scenes::points(clouds::sphere(2000, 1.0), SurfaceKind::Points);
        let mut scene = scenes::lit(geometry);
        scene.graph.materials[0] = material;
        scenes::render(&scene, &SETTINGS)
    };
    let green = Vec3::new(0.0, 0.5, 0.0);
    let emissive = Vec3::new(1.0, 0.0, 0.0);
    let plain = Material { base_color: green, ignores_vertex_colors: true, ..Material::MATTE };
    let (dark, bright) = (picture(plain.clone()), picture(Material { emissive, ..plain }));
    let center = 32 * 64 + 32;
    let albedo = dark.aovs.as_ref().unwrap().albedo[center];
    assert_eq!(albedo, green);
    let [emitted, ..] = [0, 1, 2].map(|i| bright.color[center][i] - dark.color[center][i]);
    assert!((emitted - 1.0).abs() < 1e-6, "{emitted}");
}

/// A round point behind a panorama's camera continues from one edge of the picture to the other.
#[test]
fn points_wrap_around_panoramas() {
    let cloud = PointCloud::from_positions(vec![-3.0 * Vec3::Y, 3.0 * Vec3::Y]);
    let mut scene = scenes::scene(cloud, SurfaceKind::Points);
    scene.camera = Camera {
        position: DVec3::ZERO,
        focal_point: DVec3::Y,
        view_up: DVec3::Z,
        projection: Projection::Panorama,
    };
    let image = scenes::render(&scene, &Settings { point_size: 9.0, ..SETTINGS });
    let is_covered = |x: usize| image.coverage[32 * 64 + x] == 1.0;
    let columns: Vec<usize> = (0..64).filter(|x| is_covered(*x)).collect();
    let expected = (0..4).chain(28..36).chain(60..64);
    assert_eq!(columns, expected.collect::<Vec<_>>());
}

/// Two rasterised clouds look like one cloud of all their points.
#[test]
fn the_nearest_points_of_several_clouds_are_seen() {
    let (a, b) = (clouds::sphere(4000, 1.0), clouds::plane(60, 0.3, 4));
    let both = a.positions.iter().chain(&b.positions).copied().collect();
    let points = |cloud: PointCloud| scenes::points(cloud, SurfaceKind::Points);
    let merged = scenes::lit(points(PointCloud::from_positions(both)));
    let mut separate = merged.clone();
    separate.graph = scenes::graph(vec![
        (Geometry::Points(points(a)), Material::MATTE),
        (Geometry::Points(points(b)), Material::MATTE),
    ]);
    for position in [DVec3::new(5.0, 1.0, 3.0), DVec3::new(1.0, 5.0, -4.0)] {
        let picture = |scene: &Scene| {
            let camera = Camera { position, ..scene.camera };
            scenes::render(&Scene { camera, ..scene.clone() }, &SETTINGS)
        };
        let (merged, separate) = (picture(&merged), picture(&separate));
        let [a, b] = [&merged, &separate].map(|image| &image.aovs.as_ref().unwrap().depth);
        // Positions are stored with 16 bits: some points fall into a neighbouring pixel.
        let is_same = |(a, b): &(&f32, &f32)| a == b || (*a - *b).abs() < 1e-3;
        let n_same = a.iter().zip(b).filter(is_same).count();
        assert!(64 * 64 - 40 < n_same, "{n_same}");
        let instances = &separate.aovs.as_ref().unwrap().instance_id;
        assert!([0, 1].iter().all(|i| 100 < instances.iter().filter(|found| *found == i).count()));
    }
}

#[test]
fn invalid_settings_are_errors() {
    let scene = scenes::scene(clouds::sphere(50, 1.0), SurfaceKind::Splat);
    let flat = FlatScene::new(&scene, &NoProgress).unwrap();
    let renderer = CpuRenderer { simd: Simd::detect() };
    for settings in [
        Settings { width: 0, ..SETTINGS },
        Settings { width: 1 << 20, height: 1 << 20, ..SETTINGS },
        Settings { samples_per_pixel: 0, ..SETTINGS },
        Settings { light_samples: 0, ..SETTINGS },
    ] {
        let result = renderer.render(&flat, &settings, &NoProgress);
        assert!(matches!(result, Err(surfel_core::Error::Setting { .. })), "{settings:?}");
    }
}
