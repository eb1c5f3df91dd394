//! Punctual lights with known answers: fall-off, cones, ranges, shadows, and the transforms of their nodes.

use std::f32::consts::PI;
use surfel_core::flat::FlatScene;
use surfel_core::math::{DAffine3, DQuat, DVec3, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    Background, Geometry, Graph, Light, Material, Node, PunctualLight, PunctualLightKind, Scene,
    Sun, Transform,
};
use surfel_core::trace::Simd;
use surfel_tests::scenes::{self, from_above, render};

use crate::materials::SETTINGS;

fn punctual(kind: PunctualLightKind) -> PunctualLight {
    PunctualLight { kind, color: PI * Vec3::new(1.0, 2.0, 0.5), range: f32::INFINITY, radius: 0.0 }
}

/// Returns a scene of a punctual light at a node over a white floor of |x|, |y| <= 2 that fills the picture.
fn over_floor(light: PunctualLight, matrix: DAffine3) -> Scene {
    let mut graph =
        Graph::from_geometry(Geometry::Triangles(scenes::floor(0.0, 4.0)), Material::MATTE);
    let transform = Transform::Matrix(matrix);
    graph.nodes.push(Node { light: Some(light), transform, ..Node::new("light") });
    let background = Background::Transparent;
    Scene { graph, lights: Vec::new(), background, camera: from_above(4.0) }
}

/// Panics unless each point of the floor has the expected brightness, times the light's colour.
fn check(name: &str, scene: &Scene, expected: impl Fn(Vec3) -> f32) {
    let image = render(scene, &SETTINGS);
    let positions = &image.aovs.as_ref().unwrap().position;
    let mut brightest = 0.0f32;
    for (pixel, position) in image.color.iter().zip(positions) {
        let expected = expected(*position);
        brightest = brightest.max(expected);
        let color = expected * Vec3::new(1.0, 2.0, 0.5);
        let off = Vec3::new(pixel[0], pixel[1], pixel[2]).distance(color);
        // Numbers are rounded, and the edge of a cone is steep.
        assert!(off < 1e-4, "{name}: {pixel:?} for {color} at {position}");
    }
    assert!(0.02 < brightest, "{name} does not light the floor");
}

/// Returns the radiance of a white floor under a punctual light of intensity π: the inverse square and the cosine.
pub fn inverse_square(lamp_position: Vec3, position: Vec3) -> f32 {
    let to_lamp = lamp_position - position;
    to_lamp.z / to_lamp.length().powi(3)
}

#[test]
fn a_point_lamp_falls_off_with_the_square_of_the_distance() {
    for lamp_position in
        [Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, -0.5, 0.7), Vec3::new(3.0, 0.0, 5.0)]
    {
        let scene = over_floor(
            punctual(PunctualLightKind::Point),
            DAffine3::from_translation(lamp_position.as_dvec3()),
        );
        check("point", &scene, |position| inverse_square(lamp_position, position));
    }
}

#[test]
fn light_fades_smoothly_to_the_end_of_its_range() {
    let lamp_position = Vec3::new(0.2, 0.1, 1.5);
    let ranged = PunctualLight { range: 2.0, ..punctual(PunctualLightKind::Point) };
    let scene = over_floor(ranged, DAffine3::from_translation(lamp_position.as_dvec3()));
    // This is the window that KHR_lights_punctual recommends.
    check("range", &scene, |position| {
        let window = (1.0 - (lamp_position.distance(position) / 2.0).powi(4)).clamp(0.0, 1.0);
        window * inverse_square(lamp_position, position)
    });
}

#[test]
fn a_spot_lights_its_cone() {
    let (inner_rad, outer_rad) = (0.3f32, 0.6f32);
    let lamp_position = Vec3::new(0.5, -0.3, 2.0);
    let turn = DQuat::from_rotation_x(0.35);
    let axis = (turn * -DVec3::Z).as_vec3();
    let transform = DAffine3::from_rotation_translation(turn, lamp_position.as_dvec3());
    let scene = over_floor(punctual(PunctualLightKind::Spot { inner_rad, outer_rad }), transform);
    // KHR_lights_punctual recommends the square of a ramp in the cosine.
    check("spot", &scene, |position| {
        let cos = (position - lamp_position).normalize().dot(axis);
        let ramp = (cos - outer_rad.cos()) / (inner_rad.cos() - outer_rad.cos());
        ramp.clamp(0.0, 1.0).powi(2) * inverse_square(lamp_position, position)
    });
    // Light fades between the two angles; outside of the cone it is dark.
    let image = render(&scene, &SETTINGS);
    let n_dark = image.color.iter().filter(|pixel| pixel[0] == 0.0).count();
    assert!((200..900).contains(&n_dark), "{n_dark}");
}

#[test]
fn a_directional_lamp_is_a_sun() {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 0.4, 0.0).normalize(), 0.8);
    let mut by_punctual_light =
        over_floor(punctual(PunctualLightKind::Directional), DAffine3::from_quat(turn));
    let ball = Geometry::Triangles(scenes::uv_sphere(16, 32, 0.5));
    by_punctual_light.graph.append(Graph::from_geometry(ball, Material::MATTE));
    let mut by_sun = by_punctual_light.clone();
    by_sun.graph.nodes[1].light = None;
    by_sun.lights = vec![Light::Sun(Sun {
        direction: (turn * DVec3::Z).as_vec3(),
        color: Vec3::new(1.0, 2.0, 0.5),
        angular_diameter_deg: 0.0,
    })];
    let (by_punctual_light, by_sun) =
        (render(&by_punctual_light, &SETTINGS), render(&by_sun, &SETTINGS));
    let mut n_dark = 0;
    for (a, b) in by_punctual_light.color.iter().zip(&by_sun.color) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
        n_dark += u32::from(a[0] == 0.0);
    }
    assert!((10..200).contains(&n_dark), "{n_dark}");
}

/// The transform of a parent rotates, scales and moves the light.
#[test]
fn a_lamp_moves_with_its_parents() {
    let mut scene =
        over_floor(punctual(PunctualLightKind::Point), DAffine3::from_translation(DVec3::X));
    let turn = DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_2);
    // The parent maps X to twice Z.
    let parent = DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), turn, DVec3::Y);
    let arm = Node { transform: Transform::Matrix(parent), ..Node::new("arm") };
    scene.graph.nodes.insert(1, arm);
    scene.graph.nodes[2].parent = Some(1);
    let lamp_position = Vec3::new(0.0, 1.0, 2.0);
    check("arm", &scene, |position| inverse_square(lamp_position, position));
}

#[test]
fn a_ball_shadows_the_cone_behind_it() {
    let (center, radius) = (Vec3::new(0.3, 0.2, 0.8), 0.4f32);
    let lamp_position = Vec3::new(-0.4, 0.1, 2.5);
    let transform = DAffine3::from_translation(lamp_position.as_dvec3());
    let mut scene = over_floor(punctual(PunctualLightKind::Point), transform);
    // Facets and ball are 2/1000 of the radius apart.
    let ball = Geometry::Triangles(scenes::uv_sphere(64, 128, radius));
    let node = scene.graph.append(Graph::from_geometry(ball, Material::MATTE));
    let at_center = DAffine3::from_translation(center.as_dvec3());
    scene.graph.nodes[node].transform = Transform::Matrix(at_center);
    let image = render(&scene, &SETTINGS);
    let (mut n_dark, mut n_lit) = (0, 0);
    for (pixel, position) in image.color.iter().zip(&image.aovs.as_ref().unwrap().position) {
        // This pixel shows the ball itself.
        if 1e-3 < position.z {
            continue;
        }
        let direction = (lamp_position - *position).normalize();
        let to_center = center - *position;
        let nearest = (to_center - to_center.dot(direction) * direction).length();
        if (nearest - radius).abs() < 2e-3 * radius {
            continue;
        }
        let is_dark = nearest < radius;
        assert_eq!(pixel[0] == 0.0, is_dark, "at {position}");
        n_dark += u32::from(is_dark);
        n_lit += u32::from(!is_dark);
    }
    assert!(20 < n_dark && 500 < n_lit, "{n_dark} {n_lit}");
}

/// The mean of many samples is that of a lamp in the centre where the floor faces the ball, however near it is.
#[test]
fn balls_light_the_floor_below_them_as_points_do() {
    for (radius, height) in [(0.2f32, 1.0f32), (0.5, 1.0), (0.9, 1.0), (1.5, 2.0)] {
        let above = DAffine3::from_translation(f64::from(height) * DVec3::Z);
        let light = PunctualLight { radius, ..punctual(PunctualLightKind::Point) };
        let mut scene = over_floor(light, above);
        scene.camera = from_above(0.01);
        let settings = Settings { light_samples: 1024, ..SETTINGS };
        let image = render(&scene, &settings);
        let expected = 1.0 / (height * height);
        let mean = image.color.iter().map(|pixel| pixel[0]).sum::<f32>() / image.color.len() as f32;
        assert!((mean / expected - 1.0).abs() < 1e-3, "{radius} at {height}: {mean}");
    }
}

/// The light of a directional punctual light comes from one direction, whatever its radius.
#[test]
fn a_directional_lamp_takes_one_shadow_ray_a_point() {
    let above = DAffine3::from_translation(DVec3::Z);
    for (kind, n_rays) in [(PunctualLightKind::Directional, 1), (PunctualLightKind::Point, 16)] {
        let scene = over_floor(PunctualLight { radius: 0.5, ..punctual(kind) }, above);
        let flat = FlatScene::new(&scene, &NoProgress).unwrap();
        let renderer = CpuRenderer { simd: Simd::detect() };
        let (_, stats) = renderer.render(&flat, &SETTINGS, &NoProgress).unwrap();
        assert_eq!(stats.rays.shadow, n_rays * 32 * 32, "{kind:?}");
    }
}

#[test]
fn surfaces_behind_a_lamp_cast_no_shadow() {
    let lamp_position = Vec3::new(0.0, 0.0, 1.5);
    let mut scene = over_floor(
        punctual(PunctualLightKind::Point),
        DAffine3::from_translation(lamp_position.as_dvec3()),
    );
    let lid = Geometry::Triangles(scenes::floor(1.6, 4.0));
    // The camera sees through this glass, which reflects nothing.
    let clear = Material { ior: 1.0, is_thin: true, ..Material::GLASS };
    scene.graph.append(Graph::from_geometry(lid, clear));
    let image = render(&scene, &SETTINGS);
    let middle = image.color[16 * 32 + 16];
    assert!((middle[0] - 1.0 / 2.25).abs() < 0.01, "{middle:?}");
    // An opaque surface below the light casts a shadow, seen from above through the lid.
    let mut below = scene.clone();
    let disc = Geometry::Triangles(scenes::floor(1.4, 0.1));
    below.graph.append(Graph::from_geometry(disc, Material::MATTE));
    let image = render(&below, &SETTINGS);
    assert_eq!(image.color[16 * 32 + 24][0], 0.0);
}
