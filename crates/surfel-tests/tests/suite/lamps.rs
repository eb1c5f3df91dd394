//! Lamps with known answers: fall-off, cones, ranges, shadows, and where their nodes put them.

use std::f32::consts::PI;
use surfel::flat::FlatScene;
use surfel::math::{DAffine3, DQuat, DVec3, Vec3};
use surfel::progress::Silent;
use surfel::render::{CpuRenderer, Renderer};
use surfel::scene::{
    Background, Geometry, Graph, Lamp, LampKind, Light, Material, Node, Scene, Sun, Transform,
};
use surfel::trace::Simd;
use surfel_tests::scenes::{self, from_above, render};

use crate::materials::SETTINGS;

fn lamp(kind: LampKind) -> Lamp {
    Lamp { kind, color: PI * Vec3::new(1.0, 2.0, 0.5), range: f32::INFINITY, radius: 0.0 }
}

/// A lamp at a node over a white floor of |x|, |y| <= 2 that fills the picture.
fn over_floor(lamp: Lamp, place: DAffine3) -> Scene {
    let mut graph = Graph::of(Geometry::Triangles(scenes::floor(0.0, 4.0)), Material::MATTE);
    let transform = Transform::Matrix(place);
    graph.nodes.push(Node { lamp: Some(lamp), transform, ..Node::new("lamp") });
    let background = Background::Transparent;
    Scene { graph, lights: Vec::new(), background, camera: from_above(4.0) }
}

/// Panics unless each place of the floor is as bright as `expected` says, times the lamp's colour.
fn check(name: &str, scene: &Scene, expected: impl Fn(Vec3) -> f32) {
    let image = render(scene, &SETTINGS);
    let positions = &image.layers.as_ref().unwrap().position;
    let mut brightest = 0.0f32;
    for (pixel, position) in image.color.iter().zip(positions) {
        let expected = expected(*position);
        brightest = brightest.max(expected);
        let color = expected * Vec3::new(1.0, 2.0, 0.5);
        let off = Vec3::new(pixel[0], pixel[1], pixel[2]).distance(color);
        // Roundings; the edge of a cone is steep.
        assert!(off < 1e-4, "{name}: {pixel:?} for {color} at {position}");
    }
    assert!(0.02 < brightest, "{name} lights nothing");
}

/// What a lamp of intensity pi at `place` gives a white floor: the inverse square and the cosine.
pub fn inverse_square(place: Vec3, position: Vec3) -> f32 {
    let way = place - position;
    way.z / way.length().powi(3)
}

#[test]
fn a_point_lamp_falls_off_with_the_square_of_the_distance() {
    for place in [Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, -0.5, 0.7), Vec3::new(3.0, 0.0, 5.0)] {
        let scene = over_floor(lamp(LampKind::Point), DAffine3::from_translation(place.as_dvec3()));
        check("point", &scene, |position| inverse_square(place, position));
    }
}

#[test]
fn a_range_ends_light_smoothly() {
    let place = Vec3::new(0.2, 0.1, 1.5);
    let ranged = Lamp { range: 2.0, ..lamp(LampKind::Point) };
    let scene = over_floor(ranged, DAffine3::from_translation(place.as_dvec3()));
    // As KHR_lights_punctual recommends.
    check("range", &scene, |position| {
        let window = (1.0 - (place.distance(position) / 2.0).powi(4)).clamp(0.0, 1.0);
        window * inverse_square(place, position)
    });
}

#[test]
fn a_spot_lights_its_cone() {
    let (inner_rad, outer_rad) = (0.3f32, 0.6f32);
    let place = Vec3::new(0.5, -0.3, 2.0);
    let turn = DQuat::from_rotation_x(0.35);
    let axis = (turn * -DVec3::Z).as_vec3();
    let transform = DAffine3::from_rotation_translation(turn, place.as_dvec3());
    let scene = over_floor(lamp(LampKind::Spot { inner_rad, outer_rad }), transform);
    // As KHR_lights_punctual recommends: the square of a ramp in the cosine.
    check("spot", &scene, |position| {
        let cos = (position - place).normalize().dot(axis);
        let ramp = (cos - outer_rad.cos()) / (inner_rad.cos() - outer_rad.cos());
        ramp.clamp(0.0, 1.0).powi(2) * inverse_square(place, position)
    });
    // Between the angles there is something, within all, and beyond nothing.
    let image = render(&scene, &SETTINGS);
    let n_dark = image.color.iter().filter(|pixel| pixel[0] == 0.0).count();
    assert!((200..900).contains(&n_dark), "{n_dark}");
}

#[test]
fn a_directional_lamp_is_a_sun() {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 0.4, 0.0).normalize(), 0.8);
    let mut by_lamp = over_floor(lamp(LampKind::Directional), DAffine3::from_quat(turn));
    let ball = Geometry::Triangles(scenes::uv_sphere(16, 32, 0.5));
    by_lamp.graph.append(Graph::of(ball, Material::MATTE));
    let mut by_sun = by_lamp.clone();
    by_sun.graph.nodes[1].lamp = None;
    by_sun.lights = vec![Light::Sun(Sun {
        direction: (turn * DVec3::Z).as_vec3(),
        color: Vec3::new(1.0, 2.0, 0.5),
        angular_diameter_deg: 0.0,
    })];
    let (by_lamp, by_sun) = (render(&by_lamp, &SETTINGS), render(&by_sun, &SETTINGS));
    let mut n_dark = 0;
    for (a, b) in by_lamp.color.iter().zip(&by_sun.color) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
        n_dark += u32::from(a[0] == 0.0);
    }
    assert!((10..200).contains(&n_dark), "{n_dark}");
}

/// A lamp in the arms of two parents that turn, stretch and move it: it shines from where it then is.
#[test]
fn a_lamp_goes_where_its_parents_do() {
    let mut scene = over_floor(lamp(LampKind::Point), DAffine3::from_translation(DVec3::X));
    let turn = DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_2);
    // X goes to Z, twice as far.
    let parent = DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), turn, DVec3::Y);
    let arm = Node { transform: Transform::Matrix(parent), ..Node::new("arm") };
    scene.graph.nodes.insert(1, arm);
    scene.graph.nodes[2].parent = Some(1);
    let place = Vec3::new(0.0, 1.0, 2.0);
    check("arm", &scene, |position| inverse_square(place, position));
}

#[test]
fn a_ball_shadows_the_cone_behind_it() {
    let (center, radius) = (Vec3::new(0.3, 0.2, 0.8), 0.4f32);
    let place = Vec3::new(-0.4, 0.1, 2.5);
    let transform = DAffine3::from_translation(place.as_dvec3());
    let mut scene = over_floor(lamp(LampKind::Point), transform);
    // Finely cut: 2/1000 of the radius lie between facets and ball.
    let ball = Geometry::Triangles(scenes::uv_sphere(64, 128, radius));
    let node = scene.graph.append(Graph::of(ball, Material::MATTE));
    let at_center = DAffine3::from_translation(center.as_dvec3());
    scene.graph.nodes[node].transform = Transform::Matrix(at_center);
    let image = render(&scene, &SETTINGS);
    let (mut n_dark, mut n_lit) = (0, 0);
    for (pixel, position) in image.color.iter().zip(&image.layers.as_ref().unwrap().position) {
        // What shows the ball itself.
        if 1e-3 < position.z {
            continue;
        }
        let direction = (place - *position).normalize();
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

/// Its light comes from one direction, however large it is said to be.
#[test]
fn a_directional_lamp_takes_one_ray_a_place() {
    let above = DAffine3::from_translation(DVec3::Z);
    for (kind, n_rays) in [(LampKind::Directional, 1), (LampKind::Point, 16)] {
        let scene = over_floor(Lamp { radius: 0.5, ..lamp(kind) }, above);
        let flat = FlatScene::new(&scene, &Silent).unwrap();
        let renderer = CpuRenderer { simd: Simd::detect() };
        let (_, stats) = renderer.render(&flat, &SETTINGS, &Silent).unwrap();
        assert_eq!(stats.rays.shadow, n_rays * 32 * 32, "{kind:?}");
    }
}

#[test]
fn what_lies_behind_a_lamp_casts_no_shadow() {
    let place = Vec3::new(0.0, 0.0, 1.5);
    let mut scene = over_floor(lamp(LampKind::Point), DAffine3::from_translation(place.as_dvec3()));
    let lid = Geometry::Triangles(scenes::floor(1.6, 4.0));
    // Glass lets the camera through, and reflects nothing.
    let clear = Material { ior: 1.0, is_thin: true, ..Material::GLASS };
    scene.graph.append(Graph::of(lid, clear));
    let image = render(&scene, &SETTINGS);
    let middle = image.color[16 * 32 + 16];
    assert!((middle[0] - 1.0 / 2.25).abs() < 0.01, "{middle:?}");
    // An opaque one below it does, seen through from above.
    let mut below = scene.clone();
    let disc = Geometry::Triangles(scenes::floor(1.4, 0.1));
    below.graph.append(Graph::of(disc, Material::MATTE));
    let image = render(&below, &SETTINGS);
    assert_eq!(image.color[16 * 32 + 24][0], 0.0);
}
