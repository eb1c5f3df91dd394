//! The GPU draws mirrors, glass, alpha, textures, environment maps and colours by support as the CPU does.

use crate::backends::{SETTINGS, check, flat};
use crate::materials::{gentle_light, mesh, scene};
use crate::reference;
use surfel_core::image::{Colormap, PercentileRange};
use surfel_core::math::{DAffine3, DVec3, Vec2, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::render::{Renderer, Settings};
use surfel_core::scene::color::SupportColors;
use surfel_core::scene::{
    AlphaMode, Background, Geometry, Graph, Light, Material, MaterialTextures, Scene, Texture,
    TextureRef, Wrap,
};
use surfel_core::surface::SurfaceKind;
use surfel_tests::backends::{cpu, gpu};
use surfel_tests::scenes;

/// Returns the ball on a cube with this material, before a floor and a wall of triangles.
fn in_a_room(kind: SurfaceKind, material: Material) -> Scene {
    before_a_wall(reference::scene(kind), material)
}

fn before_a_wall(mut scene: Scene, material: Material) -> Scene {
    scene.graph.materials[0] = material;
    let mut floor = scenes::floor(-1.3, 4.0);
    floor.colors = Some(floor.positions.iter().map(|p| (0.1 * p.abs()).extend(1.0)).collect());
    let wall = scenes::quad(Vec3::new(-3.0, 0.0, 1.0), 4.0 * Vec3::Y, 2.0 * Vec3::Z);
    for mesh in [floor, wall] {
        let geometry = Geometry::Triangles(mesh);
        scene.graph.append(Graph::from_geometry(geometry, Material::MATTE));
    }
    scene
}

fn tinted() -> Material {
    Material {
        attenuation_color: Vec3::new(0.9, 0.5, 0.3),
        attenuation_distance: 0.8,
        ..Material::GLASS
    }
}

#[test]
fn mirrors_and_glass_are_equal() {
    let smooth = SurfaceKind::Smooth;
    let materials = [
        ("mirror", smooth, Material::MIRROR),
        ("glass", smooth, Material::GLASS),
        ("tinted-glass", SurfaceKind::Sphere, tinted()),
        ("metal", SurfaceKind::Splat, Material::METAL),
        ("plastic", SurfaceKind::Splat, Material::PLASTIC),
        ("frosted", smooth, Material { roughness: 0.3, ..Material::GLASS }),
        ("pane", SurfaceKind::Disc, Material { is_thin: true, ..Material::GLASS }),
    ];
    for (name, kind, material) in materials {
        // Each bounce between rough surfaces multiplies the rays, any of which may pass a rim.
        let is_rough_glass = 0.0 < material.transmission && 0.0 < material.roughness;
        let max_depth = if is_rough_glass { 2 } else { 8 };
        let settings = Settings { width: 48, height: 36, max_depth, ..SETTINGS };
        check(name, &flat(&in_a_room(kind, material)), &settings);
    }
}

#[test]
fn paths_with_more_branches_than_queues_hold_are_equal() {
    let Some(gpu) = gpu() else { return };
    let mut scene = flat(&in_a_room(SurfaceKind::Splat, Material::METAL));
    // A hit of a camera ray on rough metal has sixteen branches, and a queue has four entries a pixel.
    scene.materials.fill(Material::METAL);
    let settings = Settings { samples_per_pixel: 1, light_samples: 16, max_depth: 1, ..SETTINGS };
    check("branches", &scene, &settings);
    let (_, stats) = gpu.render(&scene, &settings, &NoProgress).unwrap();
    assert_eq!(stats.rays.primary, 80 * 60);
}

#[test]
fn kinds_are_equal_as_mirrors_and_as_glass() {
    let kinds = [
        SurfaceKind::SplatFit,
        SurfaceKind::Mls,
        SurfaceKind::Cylinder,
        SurfaceKind::Implicit,
        SurfaceKind::Octree,
        SurfaceKind::OctreeSplat,
    ];
    let settings = Settings { width: 40, height: 30, max_depth: 4, light_samples: 4, ..SETTINGS };
    let both = |kind| [(kind, Material::MIRROR), (kind, Material::GLASS)];
    // Glass of `mls` multiplies the rounding of fits at edges beyond the tolerance: docs/gpu.md has the figures.
    let pairs = kinds.into_iter().flat_map(both);
    for (kind, material) in pairs.filter(|pair| *pair != (SurfaceKind::Mls, Material::GLASS)) {
        let name = format!(
            "{}-{}",
            kind.name(),
            if material.metallic == 0.0 { "glass" } else { "mirror" }
        );
        let (settings, scene) = match kind {
            // Fits multiply rounding at edges, where one pixel of a small picture moves the mean by the tolerance, and
            // where the ball touches the cube.
            SurfaceKind::Mls => (
                Settings { width: 96, height: 72, ..settings },
                reference::scene_with_ball_at(2.2, kind),
            ),
            _ => (settings, reference::scene(kind)),
        };
        let scene = before_a_wall(scene, material);
        check(&name, &flat(&scene), &settings);
    }
}

#[test]
fn gaussians_among_surfaces_are_equal() {
    // They stand before a mirror and behind a pane, cast shadows through a veil, and overlap another cloud of them.
    let mut scene = in_a_room(SurfaceKind::Gaussian, Material::MATTE);
    let other = reference::scene(SurfaceKind::Gaussian).graph;
    scene.graph.append(other);
    let turned =
        DAffine3::from_translation(DVec3::new(0.3, 0.4, 0.2)) * DAffine3::from_rotation_z(0.6);
    let last = scene.graph.nodes.len() - 1;
    scene.graph.nodes[last].transform = surfel_core::scene::Transform::Matrix(turned);
    let mirror = scenes::quad(Vec3::new(-1.9, 0.0, 1.0), 2.0 * Vec3::Y, 1.5 * Vec3::Z);
    let pane = scenes::quad(Vec3::new(2.0, -1.5, 1.0), Vec3::new(0.6, 0.6, 0.0), 0.8 * Vec3::Z);
    let ball = scenes::uv_sphere(12, 24, 0.5);
    let veil = Material { alpha: 0.4, alpha_mode: AlphaMode::Blend, ..Material::MATTE };
    for (mesh, material) in [(mirror, Material::MIRROR), (pane, veil), (ball, Material::GLASS)] {
        scene.graph.append(Graph::from_geometry(Geometry::Triangles(mesh), material));
    }
    scene.background = Background::Transparent;
    let settings = Settings { max_depth: 4, ..SETTINGS };
    check("gaussians-among-surfaces", &flat(&scene), &settings);
    // A single sample has no hits of its own for the layers.
    let settings = Settings { samples_per_pixel: 1, ..settings };
    check("gaussians-single-sample", &flat(&scene), &settings);
}

#[test]
fn bodies_of_glass_are_equal() {
    let mut scene = in_a_room(SurfaceKind::Splat, Material::MATTE);
    let ball = Geometry::Triangles(scenes::uv_sphere(24, 48, 0.6));
    let drop = Geometry::Triangles(scenes::uv_sphere(12, 24, 0.3));
    let water = Material { ior: 1.33, ..tinted() };
    let turned = DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 1.2, 0.9),
        surfel_core::math::DQuat::from_rotation_x(0.4),
        DVec3::new(1.8, -1.6, 0.4),
    );
    for (geometry, material) in [(ball, Material::GLASS), (drop, water)] {
        let mut graph = Graph::from_geometry(geometry, material);
        graph.nodes[0].transform = surfel_core::scene::Transform::Matrix(turned);
        scene.graph.append(graph);
    }
    check("nested-glass", &flat(&scene), &SETTINGS);
}

#[test]
fn depth_and_backgrounds_behind_glass_are_equal() {
    let backgrounds = [Background::Transparent, Background::Environment];
    for (name, background) in ["glass-on-nothing", "glass-on-sky"].into_iter().zip(backgrounds) {
        let mut scene = reference::scene(SurfaceKind::Splat);
        scene.graph.materials[0] = Material::GLASS;
        scene.background = background;
        let settings = Settings { max_depth: 2, samples_per_pixel: 1, ..SETTINGS };
        check(name, &flat(&scene), &settings);
    }
}

#[test]
fn alpha_is_equal() {
    let veil = Material { alpha: 0.4, alpha_mode: AlphaMode::Blend, ..Material::MATTE };
    let mut scene = in_a_room(SurfaceKind::Splat, veil.clone());
    let mut pane = scenes::quad(Vec3::new(1.5, -1.0, 0.5), Vec3::Y, Vec3::Z);
    let alpha = |p: &Vec3| Vec3::new(0.9, 0.3, 0.2).extend(0.5 + 0.4 * p.z);
    pane.colors = Some(pane.positions.iter().map(alpha).collect());
    let veil = Material { alpha: 1.0, ..veil };
    scene.graph.append(Graph::from_geometry(Geometry::Triangles(pane), veil));
    // Each ray toward a light passes several layers.
    check("alpha", &flat(&scene), &Settings { light_samples: 4, ..SETTINGS });
}

/// Returns a texture of some colours.
fn checkered() -> Texture {
    let texel = |i: u32| {
        let (x, y) = (i % 16, i / 16);
        let grey = if (x / 4 + y / 4) % 2 == 0 { 255 } else { 40 };
        [grey, (16 * x) as u8, (16 * y) as u8, if x == y { 60 } else { 255 }]
    };
    Texture { width: 16, height: 16, texels: (0..256).map(texel).collect() }
}

#[test]
fn textures_are_equal() {
    let reference = TextureRef {
        offset: Vec2::new(0.2, -0.4),
        rotation_rad: 0.5,
        scale: Vec2::new(2.5, 1.5),
        wrap: [Wrap::MirroredRepeat, Wrap::ClampToEdge],
        ..TextureRef::new(0)
    };
    let nearest = TextureRef { is_nearest: true, scale: Vec2::splat(3.0), ..TextureRef::new(0) };
    let all = MaterialTextures {
        base_color: Some(nearest),
        metallic_roughness: Some(reference),
        normal: Some((TextureRef::new(0), 0.7)),
        emissive: Some(reference),
        transmission: Some(nearest),
    };
    let base = Material { emissive: Vec3::splat(0.1), ..Material::MATTE };
    let of = |textures| Material { textures, ..base.clone() };
    let none = MaterialTextures::default;
    let alpha_mode = AlphaMode::Mask(0.5);
    let materials = [
        ("texture", of(MaterialTextures { base_color: Some(reference), ..none() })),
        ("normal-map", of(MaterialTextures { normal: all.normal, ..none() })),
        (
            "mask",
            Material { alpha_mode, ..of(MaterialTextures { base_color: Some(nearest), ..none() }) },
        ),
        ("textures", Material { metallic: 0.5, ior: 1.5, ..of(all) }),
    ];
    for (name, material) in materials {
        let mut scene = reference::scene(SurfaceKind::Disc);
        let mut ball = scenes::uv_sphere(24, 48, 0.8);
        let second = ball.uvs[0].clone();
        ball.uvs[1] = second;
        let pane = scenes::quad(Vec3::new(1.5, -1.5, 0.5), Vec3::Y, Vec3::Z);
        let moved = DAffine3::from_translation(DVec3::new(1.8, -0.6, 0.6))
            * DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        for mesh in [ball, pane] {
            let mut graph = Graph::from_geometry(Geometry::Triangles(mesh), material.clone());
            graph.textures = vec![checkered()];
            graph.nodes[0].transform = surfel_core::scene::Transform::Matrix(moved);
            scene.graph.append(graph);
        }
        check(name, &flat(&scene), &SETTINGS);
    }
}

#[test]
fn environment_maps_are_equal() {
    let environment = Light::Environment(gentle_light());
    for (name, material) in [("environment", Material::MATTE), ("reflected", Material::MIRROR)] {
        let mut scene = in_a_room(SurfaceKind::Splat, material);
        scene.lights = vec![environment.clone()];
        scene.background = Background::Environment;
        check(name, &flat(&scene), &SETTINGS);
    }
}

#[test]
fn colours_by_support_are_equal() {
    for kind in [SurfaceKind::Smooth, SurfaceKind::Sphere] {
        let mut scene = reference::scene(kind);
        let colormap = Colormap::from_name("viridis").unwrap();
        // Colours have 8 bits: on a steep map, rounding alone moves many hits over the edge between two of them.
        let range = PercentileRange { low: 0.0, high: 4.0 };
        for geometry in &mut scene.graph.geometries {
            if let Geometry::Points(points) = geometry {
                points.support_colors = Some(SupportColors { colormap, range });
            }
        }
        check(&format!("support-{}", kind.name()), &flat(&scene), &SETTINGS);
    }
}

#[test]
fn many_instances_are_equal() {
    let mut scene = reference::scene(SurfaceKind::Splat);
    let ball = Geometry::Triangles(scenes::uv_sphere(8, 16, 0.3));
    scene.graph.append(Graph::from_geometry(ball, Material::GLASS));
    scene.graph.nodes.clear();
    for i in 0..60 {
        let position =
            DVec3::new(f64::from(i % 8) - 4.0, f64::from(i / 8) - 4.0, 0.1 * f64::from(i));
        let turned = DAffine3::from_axis_angle(DVec3::Z, f64::from(i));
        let matrix = DAffine3::from_translation(position) * turned;
        let (geometry, scale) = if i % 3 == 0 { (1, 1.0) } else { (0, 0.3) };
        let matrix = matrix * DAffine3::from_scale(DVec3::splat(scale));
        scene.graph.nodes.push(scenes::node(geometry, geometry, matrix));
    }
    scene.camera.position = DVec3::new(12.0, -10.0, 9.0);
    scene.camera.focal_point = DVec3::new(0.0, 0.0, 2.0);
    check("many-instances", &flat(&scene), &SETTINGS);
}

#[test]
fn counts_of_branched_rays_are_equal() {
    let Some(gpu) = gpu() else { return };
    let ball = mesh(scenes::uv_sphere(12, 24, 0.8));
    let graph = Graph::from_geometry(ball, Material::GLASS);
    let lights = reference::lights();
    let camera = reference::scene(SurfaceKind::Sphere).camera;
    let scene = flat(&scene(graph, lights, camera));
    let count =
        |renderer: &dyn Renderer| renderer.render(&scene, &SETTINGS, &NoProgress).unwrap().1.rays;
    let (a, b) = (count(&cpu()), count(gpu));
    assert_eq!(a.primary, b.primary);
    assert!(0 < a.secondary);
    assert!(a.secondary.abs_diff(b.secondary) <= a.secondary / 1000, "{a:?} {b:?}");
}
