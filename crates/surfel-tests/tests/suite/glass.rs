//! Nested glass bodies against closed forms: absorption, refraction and tinted shadows.

use crate::materials::{SETTINGS, assert_near, fresnel, gentle_light, mesh, rgb, scene, sun};
use crate::punctual_lights::inverse_square;
use std::f32::consts::PI;
use surfel_core::flat::FlatScene;
use surfel_core::math::{DVec3, Vec2, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    AlphaMode, Background, Camera, CloudGeometry, Geometry, Graph, Light, Material, Mesh, Node,
    Projection, PunctualLight, PunctualLightKind, Scene, Transform,
};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::Simd;
use surfel_tests::clouds;
use surfel_tests::scenes::{self, from_above, render};

const AMBER: Vec3 = Vec3::new(0.7, 0.4, 0.2);
const AZURE: Vec3 = Vec3::new(0.3, 0.6, 0.8);
const WHITE: Background = Background::Gradient { top: Vec3::ONE, bottom: Vec3::ONE };

/// Returns glass that transmits `color` over a length of 1.
fn tinted(color: Vec3, ior: f32) -> Material {
    let absorbing = Material { attenuation_color: color, ..Material::GLASS };
    Material { ior, attenuation_distance: 1.0, ..absorbing }
}

/// Returns a scene of several objects in front of a white background.
fn before_white(things: Vec<(Geometry, Material)>, camera: Camera) -> Scene {
    Scene { background: WHITE, ..scene(scenes::graph(things), Vec::new(), camera) }
}

fn cuboid(low: f32, high: f32, half: f32) -> Geometry {
    mesh(scenes::cuboid(Vec3::new(-half, -half, low), Vec3::new(half, half, high)))
}

/// Returns the positions of the pixel centres of a square picture of this height, seen from above.
fn pixel_positions(height: f32) -> impl Iterator<Item = Vec2> {
    let n = SETTINGS.width;
    let along = move |i: u32| ((i as f32 + 0.5) / n as f32 - 0.5) * height;
    (0..n * n).map(move |i| Vec2::new(along(i % n), -along(i / n)))
}

/// Returns balls about the origin: of triangles, of points, and of points with outward normals.
fn balls(radius: f32) -> [(&'static str, Geometry); 3] {
    let points = scenes::points(clouds::sphere(60_000, radius), SurfaceKind::Splat);
    let outward = scenes::outward(&points);
    [
        ("triangles", mesh(scenes::uv_sphere(128, 256, radius))),
        ("points", Geometry::Points(points)),
        ("outward points", Geometry::Points(outward)),
    ]
}

/// Returns two sheets of points |x|, |y| <= 1 with normals that face away from each other.
fn sheets(low: f32, high: f32) -> CloudGeometry {
    let sheet = clouds::plane(60, 0.3, 81);
    let at = |z: f32| sheet.positions.iter().map(move |position| position.with_z(z));
    let n = sheet.len();
    let cloud = PointCloud {
        normals: Some([vec![-Vec3::Z; n], vec![Vec3::Z; n]].concat()),
        ..PointCloud::from_positions(at(low).chain(at(high)).collect())
    };
    scenes::points(cloud, SurfaceKind::Splat)
}

#[test]
fn balls_within_balls_absorb_along_their_chords() {
    for ((name, outer), (_, inner)) in balls(1.0).into_iter().zip(balls(0.5)) {
        let things = vec![(outer, tinted(AMBER, 1.0)), (inner, tinted(AZURE, 1.0))];
        // Triangles are within 3/10000 of the ball. Rays leave points at half a radius (0.008) from the surface,
        // which shifts oblique rays sideways.
        let (max_offset, allowed) = if name == "triangles" { (0.9, 2e-3) } else { (0.3, 6e-3) };
        let image = render(&before_white(things, from_above(2.0)), &SETTINGS);
        for (pixel, position) in image.color.iter().zip(pixel_positions(2.0)) {
            let offset = position.length();
            if max_offset < offset || (0.45..0.55).contains(&offset) {
                continue;
            }
            let chord = |radius: f32| 2.0 * (radius * radius - offset * offset).max(0.0).sqrt();
            let expected = AMBER.powf(chord(1.0) - chord(0.5)) * AZURE.powf(chord(0.5));
            assert_near(rgb(*pixel), expected, allowed, &format!("{name}, offset {offset}"));
        }
    }
}

#[test]
fn a_ball_of_the_same_glass_within_a_block_is_invisible() {
    let camera = Camera {
        position: DVec3::new(4.0, 3.0, 2.5),
        view_up: DVec3::Z,
        projection: Projection::Orthographic { height: 3.0 },
        ..from_above(1.0)
    };
    let glass = tinted(AMBER, 1.5);
    let picture = |ball: Option<Geometry>| {
        let mut graph = Graph::from_geometry(cuboid(-1.0, 1.0, 1.0), glass.clone());
        if let Some(ball) = ball {
            graph.append(Graph::from_geometry(ball, glass.clone()));
        }
        let lights = vec![Light::Environment(gentle_light())];
        render(&scene(graph, lights, camera), &Settings { max_depth: 24, ..SETTINGS })
    };
    let expected = picture(None);
    for (name, ball) in balls(0.5) {
        for (found, expected) in picture(Some(ball)).color.iter().zip(&expected.color) {
            // Rays of weights below 0.01 are traced at random, which is off by up to 0.01 each; light that is shifted
            // sideways by half a radius of points may leave the block on another side.
            assert_near(rgb(*found), rgb(*expected), 0.03, name);
        }
    }
}

/// The expected light follows Snell's and Fresnel's laws at four interfaces and Beer's law between them.
#[test]
fn glass_in_water_refracts_and_absorbs_by_both_media() {
    let (water, glass) = (4.0f64 / 3.0, 1.5);
    for tilt in [0.0f64, 0.5, 1.0] {
        let things = vec![
            (cuboid(-1.0, 1.0, 30.0), tinted(AZURE, water as f32)),
            (cuboid(-0.5, 0.5, 25.0), tinted(AMBER, glass as f32)),
            (mesh(scenes::floor(-1.5, 40.0)), Material::UNLIT),
        ];
        let position = 20.0 * DVec3::new(tilt.sin(), 0.0, tilt.cos());
        let camera = Camera { position, ..from_above(0.1) };
        // This depth is enough for the path straight through; reflections on it are cut off.
        let settings = Settings { width: 4, height: 4, max_depth: 4, ..SETTINGS };
        let scene = scene(scenes::graph(things), Vec::new(), camera);
        let (in_water, in_glass) = (tilt.sin() / water, tilt.sin() / glass);
        let transmitted =
            (1.0 - fresnel(tilt.sin(), water)) * (1.0 - fresnel(in_water, glass / water));
        let length = |sin: f64| (1.0 / (1.0 - sin * sin).sqrt()) as f32;
        let expected = (transmitted * transmitted) as f32
            * AZURE.powf(length(in_water))
            * AMBER.powf(length(in_glass));
        for pixel in render(&scene, &settings).color {
            assert_near(rgb(pixel), expected, 5e-4, &format!("tilted by {tilt}"));
        }
    }
}

/// Water that overlaps the wall of its glass leaves no gap and no third medium.
#[test]
fn the_body_entered_last_counts_where_bodies_overlap() {
    let things = vec![
        (cuboid(-1.0, 0.1, 3.0), tinted(AMBER, 1.0)),
        (cuboid(-0.1, 1.0, 2.0), tinted(AZURE, 1.0)),
    ];
    for pixel in render(&before_white(things, from_above(1.0)), &SETTINGS).color {
        assert_near(rgb(pixel), AZURE.powf(0.9) * AMBER.powf(1.1), 1e-4, "overlap");
    }
}

#[test]
fn a_mirror_within_tinted_glass_does_not_change_the_medium() {
    let points = sheets(-1.0, 1.0);
    let outward = scenes::outward(&points);
    for (name, body) in [
        ("triangles", cuboid(-1.0, 1.0, 1.0)),
        ("points", Geometry::Points(points)),
        ("outward points", Geometry::Points(outward)),
    ] {
        let ball = mesh(scenes::uv_sphere(64, 128, 0.5));
        let things = vec![(body, tinted(AMBER, 1.0)), (ball, Material::MIRROR)];
        // The camera sees the top of the ball, which reflects light straight up.
        for pixel in render(&before_white(things, from_above(0.02)), &SETTINGS).color {
            assert_near(rgb(pixel), AMBER.powf(2.0 * 0.5), 3e-3, name);
        }
    }
}

/// A white matte floor within a tinted ball is lit by a punctual light within the ball.
#[test]
fn light_is_absorbed_between_a_lamp_in_glass_and_the_lit_surface() {
    for (name, ball) in balls(1.0) {
        let floor = mesh(scenes::floor(-0.2, 0.4));
        let mut graph = scenes::graph(vec![(ball, tinted(AMBER, 1.0)), (floor, Material::MATTE)]);
        let lamp_position = Vec3::new(0.0, 0.0, 0.5);
        let color = PI * Vec3::ONE;
        let light = PunctualLight {
            kind: PunctualLightKind::Point,
            color,
            range: f32::INFINITY,
            radius: 0.0,
        };
        let transform = Transform::from_translation(lamp_position.as_dvec3());
        graph.nodes.push(Node { light: Some(light), transform, ..Node::new("light") });
        let image = render(&scene(graph, Vec::new(), from_above(0.6)), &SETTINGS);
        for (pixel, position) in image.color.iter().zip(pixel_positions(0.6)) {
            let position = position.extend(-0.2);
            let to_camera = (1.0 - position.truncate().length_squared()).sqrt() + 0.2;
            let length = position.distance(lamp_position) + to_camera;
            let expected = inverse_square(lamp_position, position) * AMBER.powf(length);
            assert_near(rgb(*pixel), expected, 0.015, &format!("{name} at {position}"));
        }
    }
}

#[test]
fn shadows_of_glass_in_water_are_tinted_by_both() {
    let shadow = |water: &Geometry, inner: &Geometry, material: &Material| {
        let graph = scenes::graph(vec![
            (mesh(scenes::floor(0.0, 4.0)), Material::MATTE),
            (water.clone(), tinted(AZURE, 4.0 / 3.0)),
            (inner.clone(), material.clone()),
        ]);
        let camera =
            Camera { position: DVec3::new(0.0, -8.0, 3.0), view_up: DVec3::Z, ..from_above(0.5) };
        render(&scene(graph, vec![sun(Vec3::Z)], camera), &SETTINGS)
    };
    let through_water = 1.0 - fresnel(0.0, 4.0 / 3.0) as f32;
    let through_glass = 1.0 - fresnel(0.0, 1.5 / (4.0 / 3.0)) as f32;
    let half = Material { alpha: 0.25, alpha_mode: AlphaMode::Blend, ..Material::MATTE };
    for (name, inner, material, expected) in [
        (
            "glass",
            cuboid(4.5, 5.5, 0.9),
            tinted(AMBER, 1.5),
            (through_water * through_glass).powi(2) * AZURE * AMBER,
        ),
        // A surface that is blended by alpha is no interface of the water.
        (
            "a leaf",
            mesh(scenes::floor(5.0, 0.9)),
            half,
            0.75 * through_water.powi(2) * AZURE.powf(2.0),
        ),
    ] {
        for (body, water) in
            [("triangles", cuboid(4.0, 6.0, 1.0)), ("points", Geometry::Points(sheets(4.0, 6.0)))]
        {
            for pixel in shadow(&water, &inner, &material).color {
                assert_near(rgb(pixel), expected, 1e-3, &format!("{name} in water of {body}"));
            }
        }
    }
}

#[test]
fn a_path_with_one_end_in_open_glass_ends_at_its_box() {
    let mut open = scenes::cuboid(Vec3::new(-1.0, -1.0, -0.6), Vec3::new(1.0, 1.0, 0.6));
    // The bottom is removed.
    open.triangles.drain(..2);
    let camera = from_above(1.0);
    let from_below = Camera { position: -camera.position, ..camera };
    for (name, camera) in [("entered and not left", camera), ("left only", from_below)] {
        let things = vec![(mesh(open.clone()), tinted(AMBER, 1.0))];
        for pixel in render(&before_white(things, camera), &SETTINGS).color {
            assert_near(rgb(pixel), AMBER.powf(1.2), 1e-4, name);
        }
    }
    // A single sheet has no inside.
    let sheet = scenes::points(clouds::plane(60, 0.3, 81), SurfaceKind::Splat);
    let things = vec![(Geometry::Points(sheet), tinted(AMBER, 1.0))];
    for pixel in render(&before_white(things, from_above(1.0)), &SETTINGS).color {
        assert_near(rgb(pixel), Vec3::ONE, 1e-3, "a sheet of points");
    }
}

#[test]
fn light_to_a_camera_within_glass_is_absorbed_up_to_the_camera() {
    let camera = Camera { position: DVec3::ZERO, focal_point: -DVec3::Z, ..from_above(1.0) };
    let glass = || (cuboid(-0.7, 2.0, 3.0), tinted(AMBER, 1.0));
    for pixel in render(&before_white(vec![glass()], camera), &SETTINGS).color {
        assert_near(rgb(pixel), AMBER.powf(0.7), 1e-4, "white");
        assert_eq!(pixel[3], 1.0);
    }
}

#[test]
fn nested_glass_does_not_depend_on_threads_or_simd_level() {
    let [_, (_, points), _] = balls(1.0);
    let [(_, triangles), _, _] = balls(0.5);
    let things = vec![
        (points, tinted(AMBER, 1.5)),
        (triangles, tinted(AZURE, 4.0 / 3.0)),
        (cuboid(-0.2, 0.2, 0.2), Material::METAL),
        (mesh(Mesh { normals: None, ..scenes::uv_sphere(12, 24, 0.35) }), Material::GLASS),
    ];
    let camera = scenes::lit(sheets(-1.0, 1.0)).camera;
    let lights = vec![Light::Environment(gentle_light()), sun(Vec3::new(1.0, 0.5, 2.0))];
    let flat = FlatScene::new(&scene(scenes::graph(things), lights, camera), &NoProgress).unwrap();
    let settings = Settings { samples_per_pixel: 2, light_samples: 4, ..SETTINGS };
    let picture = |n_threads: usize, simd: Simd| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        let render = || CpuRenderer { simd }.render(&flat, &settings, &NoProgress).unwrap();
        pool.install(render).0
    };
    let reference = picture(1, Simd::PORTABLE);
    for n_threads in [1, 3] {
        for simd in Simd::available() {
            let name = simd.name();
            assert!(picture(n_threads, simd) == reference, "{n_threads} threads, {name}");
        }
    }
}
