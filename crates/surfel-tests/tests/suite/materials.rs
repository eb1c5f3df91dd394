//! Materials with known answers: glass, absorption, mirrors, and the shadows of transmissive surfaces.

use std::f32::consts::PI;
use surfel_core::image::Image;
use surfel_core::math::{DAffine3, DVec3, Vec3, Vec4};
use surfel_core::render::Settings;
use surfel_core::scene::{
    AlphaMode, Background, Camera, Environment, Geometry, Graph, Light, Material, Mesh, Projection,
    Scene, Sky, Sun, Texture, Transform,
};
use surfel_core::surface::SurfaceKind;
use surfel_tests::clouds;
use surfel_tests::scenes::{self, from_above, render};

pub const SETTINGS: Settings = Settings {
    width: 32,
    height: 32,
    samples_per_pixel: 1,
    noise_threshold: 0.0,
    light_samples: 16,
    max_depth: 8,
    seed: 1,
    point_size: 1.0,
    with_aovs: true,
};

pub const WHITE_SKY: Sky =
    Sky { up: Vec3::Z, zenith: Vec3::ONE, ground: Vec3::ONE, ao_distance: f32::INFINITY };

pub fn sun(direction: Vec3) -> Light {
    let direction = direction.normalize();
    Light::Sun(Sun { direction, color: Vec3::ONE, angular_diameter_deg: 0.0 })
}

pub fn mesh(mesh: Mesh) -> Geometry {
    Geometry::Triangles(mesh)
}

/// Returns a scene with a transparent background.
pub fn scene(graph: Graph, lights: Vec<Light>, camera: Camera) -> Scene {
    Scene { graph, lights, background: Background::Transparent, camera }
}

pub fn rgb(pixel: [f32; 4]) -> Vec3 {
    Vec4::from_array(pixel).truncate()
}

/// Panics unless `found` is within `allowed` of `expected`, channel by channel.
pub fn assert_near(found: Vec3, expected: Vec3, allowed: f32, context: &str) {
    let off = (found - expected).abs().max_element();
    assert!(off <= allowed, "{context}: {found} for {expected}");
}

/// Returns the colour of each pixel with the position that it shows.
pub fn with_positions(image: &Image) -> impl Iterator<Item = (Vec3, Vec3)> {
    let positions = &image.aovs.as_ref().unwrap().position;
    image.color.iter().map(|pixel| rgb(*pixel)).zip(positions.iter().copied())
}

/// Returns smooth light from all directions, which changes by at most one over a radian.
pub fn gentle_light() -> Environment {
    let (width, height) = (256u32, 128u32);
    let pixel = |i: u32| {
        let azimuth = 2.0 * PI * ((i % width) as f32 + 0.5) / width as f32 - PI;
        let polar = PI * ((i / width) as f32 + 0.5) / height as f32;
        let direction =
            Vec3::new(polar.sin() * azimuth.sin(), polar.sin() * azimuth.cos(), polar.cos());
        0.5 + 0.5 * direction
    };
    Environment::new(width, height, (0..width * height).map(pixel).collect(), Vec3::Z, 0.0).unwrap()
}

fn gentle(direction: DVec3) -> DVec3 {
    0.5 + 0.5 * direction
}

/// Returns the reflectance of glass of index `ior` from outside, by Fresnel's equations and Snell's law.
pub fn fresnel(sin_outside: f64, ior: f64) -> f64 {
    let (outside, inside) = (sin_outside.asin(), (sin_outside / ior).asin());
    if sin_outside < 1e-6 {
        return ((ior - 1.0) / (ior + 1.0)).powi(2);
    }
    let across = (outside - inside).sin() / (outside + inside).sin();
    let along = (outside - inside).tan() / (outside + inside).tan();
    0.5 * (across * across + along * along)
}

/// Returns the radiance of a glass ball about the origin along a line that passes its centre at `offset` radii.
fn glass_ball(direction: DVec3, offset: DVec3, ior: f64) -> DVec3 {
    let sin = offset.length();
    let (outside, inside) = (sin.asin(), (sin / ior).asin());
    let reflectance = fresnel(sin, ior);
    // The path stays in one plane; each refraction and reflection turns its direction by a known angle.
    let aside = offset.try_normalize().unwrap_or(DVec3::ZERO);
    let turned = |angle: f64| angle.cos() * direction + angle.sin() * aside;
    let mut light = reflectance * gentle(turned(std::f64::consts::PI - 2.0 * outside));
    let mut weight = (1.0 - reflectance).powi(2);
    let mut angle = -2.0 * (outside - inside);
    for _ in 0..60 {
        light += weight * gentle(turned(angle));
        weight *= reflectance;
        angle -= std::f64::consts::PI - 2.0 * inside;
    }
    light
}

/// Returns the mean and greatest difference from the closed form within 0.9 of the radius, where a shift of the ray
/// turns its direction on leaving by at most about six times as much.
fn off_glass_ball(geometry: Geometry, ior: f32) -> (f64, f64) {
    let camera = Camera {
        position: DVec3::new(6.0, 0.0, 0.0),
        view_up: DVec3::Z,
        projection: Projection::Orthographic { height: 2.2 },
        ..from_above(1.0)
    };
    let graph = Graph::from_geometry(geometry, Material { ior, ..Material::GLASS });
    let light = Light::Environment(gentle_light());
    let settings = Settings { width: 48, height: 48, max_depth: 16, ..SETTINGS };
    let scene = scene(graph, vec![light], camera);
    // Several pictures are averaged, as rays of weights below 0.01 are traced at random, off by up to 0.01 each.
    let mut mean = vec![Vec3::ZERO; 48 * 48];
    for seed in 0..8 {
        let image = render(&scene, &Settings { seed, ..settings });
        mean.iter_mut().zip(&image.color).for_each(|(mean, pixel)| *mean += rgb(*pixel) / 8.0);
    }
    let (mut sum, mut max, mut n) = (0.0, 0.0f64, 0);
    for (i, color) in mean.iter().enumerate() {
        let offset_of = |i: usize| (i as f64 + 0.5 - 24.0) * 2.2 / 48.0;
        // Seen from +X with +Z up, +Y is to the right.
        let offset = DVec3::new(0.0, offset_of(i % 48), -offset_of(i / 48));
        if 0.9 < offset.length() {
            continue;
        }
        let expected = glass_ball(-DVec3::X, offset, f64::from(ior));
        let off = (color.as_dvec3() - expected).abs().max_element();
        (sum, max, n) = (sum + off, max.max(off), n + 1);
    }
    (sum / f64::from(n), max)
}

#[test]
fn a_ball_of_glass_refracts_light_like_the_closed_form() {
    let points = scenes::points(clouds::sphere(60_000, 1.0), SurfaceKind::Splat);
    let outward = scenes::outward(&points);
    for ior in [1.5, 1.1, 2.4] {
        // Normals between corners are exact to 1e-3, and facets lie up to 1e-3 within the ball; after four
        // refractions and reflections directions may be off by about 0.02. Rays of weights below 0.01 are
        // traced at random, off by up to 0.01 each.
        let (mean, max) = off_glass_ball(mesh(scenes::uv_sphere(64, 128, 1.0)), ior);
        assert!(mean < 0.004 && max < 0.04, "smooth mesh of {ior}: {mean} {max}");
        // Points are 0.015 apart: blended normals are off by a tenth of that, stored ones by 0.0014, and rays
        // start half a radius off the surface.
        for (name, points) in [("points", &points), ("outward points", &outward)] {
            let (mean, max) = off_glass_ball(Geometry::Points(points.clone()), ior);
            assert!(mean < 0.01 && max < 0.08, "{name} of {ior}: {mean} {max}");
        }
    }
}

/// The camera looks up from within a block of glass above an unlit floor. Beyond the critical angle the ceiling
/// reflects all light of the floor, below it the fraction of Fresnel's equations.
#[test]
fn the_ceiling_of_a_block_of_glass_reflects_totally_beyond_the_critical_angle() {
    let color = Vec3::new(0.2, 0.5, 0.9);
    let paint = Material { base_color: color, ..Material::UNLIT };
    for degrees in [20.0f32, 40.0, 43.0, 60.0, 80.0] {
        let block = scenes::cuboid(Vec3::new(-100.0, -100.0, -1.0), Vec3::new(100.0, 100.0, 1.0));
        let floor = scenes::floor(-0.5, 90.0);
        let graph =
            scenes::graph(vec![(mesh(block), Material::GLASS), (mesh(floor), paint.clone())]);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let camera = Camera {
            position: DVec3::ZERO,
            focal_point: Vec3::new(sin, 0.0, cos).as_dvec3(),
            view_up: DVec3::Y,
            projection: Projection::Orthographic { height: 0.1 },
        };
        let image = render(
            &scene(graph, Vec::new(), camera),
            &Settings { width: 4, height: 4, ..SETTINGS },
        );
        let outside = sin * 1.5;
        let reflected = if 1.0 < outside { 1.0 } else { fresnel(f64::from(outside), 1.5) as f32 };
        for pixel in image.color {
            assert_near(rgb(pixel), reflected * color, 1e-4, &format!("at {degrees} degrees"));
        }
    }
}

/// Returns the colours of a slab across the view in front of white; an index of 1 does not refract.
fn slab(geometry: Geometry, node: DAffine3, tilt_rad: f64) -> Vec<Vec3> {
    let absorbing = Material {
        ior: 1.0,
        attenuation_color: Vec3::new(0.5, 0.25, 0.8),
        attenuation_distance: 2.0,
        ..Material::GLASS
    };
    let mut graph = Graph::from_geometry(geometry, absorbing);
    graph.nodes[0].transform = Transform::Matrix(node);
    let position = 20.0 * DVec3::new(tilt_rad.sin(), 0.0, tilt_rad.cos());
    let camera = Camera { position, ..from_above(0.2) };
    let white = Background::Gradient { top: Vec3::ONE, bottom: Vec3::ONE };
    let scene = Scene { background: white, ..scene(graph, Vec::new(), camera) };
    render(&scene, &Settings { width: 8, height: 8, ..SETTINGS })
        .color
        .into_iter()
        .map(rgb)
        .collect()
}

#[test]
fn a_slab_absorbs_by_beers_law() {
    let absorbed = |length: f64| Vec3::new(0.5, 0.25, 0.8).as_dvec3().powf(length / 2.0).as_vec3();
    let block = scenes::cuboid(Vec3::new(-9.0, -9.0, -0.5), Vec3::new(9.0, 9.0, 0.5));
    for tilt_rad in [0.0, 0.5, 1.0] {
        for color in slab(mesh(block.clone()), DAffine3::IDENTITY, tilt_rad) {
            // Rays start off the surface by 32 times the rounding error of the coordinates.
            assert_near(color, absorbed(1.0 / tilt_rad.cos()), 3e-4, "block");
        }
        // Attenuation distances scale with their object.
        for color in slab(mesh(block.clone()), DAffine3::from_scale(DVec3::splat(0.2)), tilt_rad) {
            assert_near(color, absorbed(1.0 / tilt_rad.cos()), 3e-4, "small block");
        }
    }
    // A slab can also be two sheets of points.
    let sheet = clouds::plane(60, 0.3, 81);
    let mut cloud = sheet.clone();
    for side in [-0.5f32, 0.5] {
        let at_side = sheet.positions.iter().map(|p| p.with_z(side));
        cloud.positions.extend(at_side);
    }
    cloud.positions.drain(..sheet.len());
    let n = sheet.len();
    cloud.normals = Some([vec![-Vec3::Z; n], vec![Vec3::Z; n]].concat());
    let mut points = scenes::points(cloud, SurfaceKind::Splat);
    for has_outward_normals in [false, true] {
        points.has_outward_normals = has_outward_normals;
        for tilt_rad in [0.0, 0.3, 0.8] {
            for color in slab(Geometry::Points(points.clone()), DAffine3::IDENTITY, tilt_rad) {
                // Positions are stored with 16 bits.
                assert_near(color, absorbed(1.0 / tilt_rad.cos()), 1e-3, "points");
            }
        }
    }
}

// Mirrors.

/// Returns objects without symmetry above the plane z = 0, one of them emissive.
fn still_life() -> Vec<(Geometry, Material, DAffine3)> {
    let ball = mesh(scenes::uv_sphere(24, 48, 0.5));
    let block = mesh(scenes::cuboid(Vec3::ZERO, Vec3::new(0.3, 0.5, 0.9)));
    let cloud = Geometry::Points(scenes::points(clouds::sphere(3000, 0.4), SurfaceKind::Splat));
    let painted = |base_color| Material { base_color, ..Material::MATTE };
    let at = |x, y, z| DAffine3::from_translation(DVec3::new(x, y, z));
    let glowing = Material { emissive_strength: 0.7, ..painted(Vec3::new(0.3, 0.9, 0.2)) };
    vec![
        (ball, painted(Vec3::new(0.9, 0.3, 0.1)), at(0.8, 0.3, 1.2)),
        (block, glowing, at(-0.9, 0.2, 0.8) * DAffine3::from_rotation_z(0.6)),
        (cloud, painted(Vec3::new(0.2, 0.3, 1.0)), at(-0.2, -0.8, 1.0)),
    ]
}

/// Renders the still life in a mirror, or without one its mirror image under the mirror image of the sun.
fn reflection(mirror: Option<Geometry>) -> Image {
    let flip = DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let (mut graph, mut direction) = (Graph::default(), Vec3::new(0.3, 0.2, 0.9));
    let has_mirror = mirror.is_some();
    if let Some(mirror) = mirror {
        graph.append(Graph::from_geometry(mirror, Material::MIRROR));
    }
    for (geometry, material, matrix) in still_life() {
        let node = graph.append(Graph::from_geometry(geometry, material));
        let matrix = if has_mirror { matrix } else { flip * matrix };
        graph.nodes[node].transform = Transform::Matrix(matrix);
    }
    if !has_mirror {
        direction.z = -direction.z;
    }
    let camera = Camera {
        // The camera is so low that the still life itself is above the picture.
        position: DVec3::new(0.0, 4.0, 1.5),
        focal_point: DVec3::new(0.0, -0.1, -1.1),
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle_deg: 30.0 },
    };
    let lights = vec![sun(direction), Light::Headlight(0.3)];
    render(&scene(graph, lights, camera), &Settings { width: 64, height: 64, ..SETTINGS })
}

#[test]
fn a_mirror_shows_the_mirror_image_of_the_scene() {
    let expected = reflection(None);
    let plane = clouds::plane(250, 0.3, 82);
    let positions = plane.positions.iter().map(|position| 3.0 * position).collect();
    let plane = surfel_core::points::PointCloud { positions, ..plane };
    let plane = scenes::points(plane, SurfaceKind::Splat);
    let half_radius = 0.5 * plane.cloud().radii()[0];
    assert!(half_radius < 0.05);
    for (name, mirror, max_differing) in [
        // Silhouettes are rounded.
        ("triangles", mesh(scenes::floor(0.0, 5.0)), 4),
        // Rays start half a radius above the plane, which moves silhouettes and shadows by up to a pixel.
        ("points", Geometry::Points(plane), 300),
    ] {
        let found = reflection(Some(mirror));
        let (mut n_differing, mut n_seen) = (0, 0);
        for (found, expected) in found.color.iter().zip(&expected.color) {
            // The mirror is opaque where the other picture is transparent.
            assert_eq!(found[3], 1.0, "{name}");
            let off = (rgb(*found) - rgb(*expected)).abs().max_element();
            // Shading changes by up to this over half a radius.
            let allowed = if name == "points" { 0.1 } else { 2e-3 };
            n_differing += u32::from(allowed < off);
            n_seen += u32::from(0.0 < expected[3]);
        }
        assert!(400 < n_seen && n_differing <= max_differing, "{name}: {n_differing} of {n_seen}");
    }
}

#[test]
fn at_depth_0_mirrors_and_glass_are_black() {
    let background = Background::Gradient { top: Vec3::ONE, bottom: Vec3::ONE };
    for material in
        [Material::MIRROR, Material::GLASS, Material { is_thin: true, ..Material::GLASS }]
    {
        let graph = Graph::from_geometry(mesh(scenes::floor(0.0, 5.0)), material);
        let scene =
            Scene { background, ..scene(graph, vec![Light::Sky(WHITE_SKY)], from_above(1.0)) };
        let at_depth = |max_depth| render(&scene, &Settings { max_depth, ..SETTINGS }).color;
        assert!(at_depth(0).iter().all(|pixel| *pixel == [0.0, 0.0, 0.0, 1.0]));
        assert!(at_depth(1).iter().all(|pixel| 0.9 < pixel[0]));
    }
}

// Shadows of transmissive surfaces.

/// Returns the colours and positions of a floor below an object, under a sun straight above.
pub fn shadow_of(
    geometry: Geometry,
    material: Material,
    textures: Vec<Texture>,
) -> Vec<(Vec3, Vec3)> {
    let floor = mesh(scenes::floor(0.0, 4.0));
    let mut graph = scenes::graph(vec![(floor, Material::MATTE), (geometry, material)]);
    graph.textures = textures;
    let camera = Camera {
        position: DVec3::new(0.0, -8.0, 3.0),
        view_up: DVec3::Z,
        projection: Projection::Orthographic { height: 1.6 },
        ..from_above(1.0)
    };
    let image = render(&scene(graph, vec![sun(Vec3::Z)], camera), &SETTINGS);
    let seen: Vec<(Vec3, Vec3)> = with_positions(&image).collect();
    assert!(seen.iter().all(|(_, position)| position.z.abs() < 1e-4));
    seen
}

/// The square |x|, |y| <= 0.5, high above the floor.
pub fn pane() -> Mesh {
    scenes::floor(4.0, 0.5)
}

#[test]
fn a_tinted_pane_casts_a_tinted_shadow() {
    let base_color = Vec3::new(0.2, 0.6, 1.0);
    let tinted = Material { base_color, ior: 1.0, ..Material::GLASS };
    let thin = Material { is_thin: true, ..tinted.clone() };
    let half = Material { alpha: 0.25, alpha_mode: AlphaMode::Blend, ..Material::MATTE };
    let block = || mesh(scenes::cuboid(Vec3::new(-0.5, -0.5, 4.0), Vec3::new(0.5, 0.5, 5.0)));
    let dark = Vec3::new(0.5, 0.25, 0.8);
    let absorbing = Material {
        ior: 1.0,
        attenuation_color: dark,
        attenuation_distance: 0.5,
        ..Material::GLASS
    };
    for (name, geometry, material, expected) in [
        ("thin", mesh(pane()), thin, base_color),
        // Both surfaces tint.
        ("solid", block(), tinted, base_color * base_color),
        ("absorbing", block(), absorbing, dark * dark),
        ("alpha of a quarter", mesh(pane()), half, Vec3::splat(0.75)),
        ("opaque", mesh(pane()), Material::MATTE, Vec3::ZERO),
    ] {
        let (mut n_in, mut n_out) = (0, 0);
        for (color, position) in shadow_of(geometry, material, Vec::new()) {
            let beyond = position.x.abs().max(position.y.abs()) - 0.5;
            if beyond < -1e-3 {
                assert_near(color, expected, 1e-4, name);
                n_in += 1;
            } else if 1e-3 < beyond {
                assert_near(color, Vec3::ONE, 1e-5, name);
                n_out += 1;
            }
        }
        assert!(100 < n_in && 100 < n_out, "{name}: {n_in} {n_out}");
    }
}

/// Light at normal incidence on a sheet of glass loses the light that both of its faces reflect.
#[test]
fn glass_dims_shadows_by_its_reflections() {
    let face = 0.04f32;
    let block = mesh(scenes::cuboid(Vec3::new(-0.5, -0.5, 4.0), Vec3::new(0.5, 0.5, 5.0)));
    let thin = Material { is_thin: true, ..Material::GLASS };
    for (name, geometry, material, expected) in [
        // Light that is reflected within the block is left out of shadows.
        ("solid", block, Material::GLASS, (1.0 - face).powi(2)),
        // A pane transmits (1 - F) / (1 + F) of the light, reflections within it included.
        ("thin", mesh(pane()), thin, (1.0 - face) / (1.0 + face)),
    ] {
        for (color, position) in shadow_of(geometry, material, Vec::new()) {
            if position.x.abs().max(position.y.abs()) < 0.499 {
                assert_near(color, Vec3::splat(expected), 1e-4, name);
            }
        }
    }
}
