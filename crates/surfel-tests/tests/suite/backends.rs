//! The GPU draws the pictures of the CPU.

use crate::light;
use crate::reference;
use std::path::PathBuf;
use surfel_core::Error;
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::math::{DAffine3, DQuat, DVec3, Vec3};
use surfel_core::points::{Preparation, StructureChoice};
use surfel_core::progress::NoProgress;
use surfel_core::render::{RenderRegion, Renderer, Settings};
use surfel_core::scene::{
    Background, Camera, ClipPlane, Geometry, Graph, Light, Material, Node, Projection,
    PunctualLight, PunctualLightKind, Scene, Transform,
};
use surfel_core::surface::{Align, EdgeTest, GatherLimit, SurfaceKind, SurfaceOptions};
use surfel_formats::{ImageOptions, save_image};
use surfel_gpu::GpuRenderer;
use surfel_tests::backends::{Difference, TOLERANCE, cpu, gpu, render};
use surfel_tests::cancel_after::CancelAfter;
use surfel_tests::clouds;
use surfel_tests::scenes;

/// Returns the kinds of surface that the GPU renders: all but that without rays.
fn kinds() -> impl Iterator<Item = SurfaceKind> {
    scenes::hit_kinds().chain([SurfaceKind::Gaussian])
}

pub const SETTINGS: Settings = Settings {
    width: 80,
    height: 60,
    samples_per_pixel: 4,
    noise_threshold: 0.0,
    light_samples: 8,
    max_depth: 8,
    seed: 7,
    point_size: 1.0,
    with_aovs: true,
};

/// Fails unless both renderers give one picture; writes both and their difference if they do not.
pub fn check(name: &str, scene: &FlatScene, settings: &Settings) {
    let Some(gpu) = gpu() else { return };
    check_on(gpu, name, scene, settings);
}

fn check_on(gpu: &dyn Renderer, name: &str, scene: &FlatScene, settings: &Settings) {
    let (a, b) = (render(&cpu(), scene, settings), render(gpu, scene, settings));
    let difference = Difference::new(&a, &b);
    let shows_all = std::env::var_os("SURFEL_SHOW_BACKENDS").is_some();
    if difference.is_allowed() && !shows_all {
        return;
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let write = |kind: &str, image: &Image| {
        let path = folder.join(format!("{name}.{kind}.png"));
        save_image(&path, image, &ImageOptions::default()).unwrap();
    };
    write("cpu", &a);
    write("gpu", &b);
    let mut shown = Image::new(a.width, a.height);
    for (shown, (a, b)) in shown.color.iter_mut().zip(a.color.iter().zip(&b.color)) {
        let channel = |i: usize| (8.0 * (a[i] - b[i]).abs()).min(1.0);
        *shown = [channel(0), channel(1), channel(2), 1.0];
    }
    write("difference", &shown);
    assert!(
        difference.is_allowed(),
        "{name}: {difference:?}; see {}/{name}.*.png",
        folder.display()
    );
}

pub fn flat(scene: &Scene) -> FlatScene {
    FlatScene::new(scene, &NoProgress).unwrap()
}

#[test]
fn surfaces_are_equal() {
    for kind in kinds() {
        check(kind.name(), &flat(&reference::scene(kind)), &SETTINGS);
    }
}

#[test]
fn surfaces_without_edge_test_are_equal() {
    for kind in kinds() {
        let mut scene = reference::scene(kind);
        if let Geometry::Points(points) = &mut scene.graph.geometries[0] {
            points.edge_test = EdgeTest::Off;
        }
        check(&format!("{}-rims", kind.name()), &flat(&scene), &SETTINGS);
    }
}

#[test]
fn options_of_surfaces_are_equal() {
    let default = SurfaceOptions::default();
    let options = [
        ("align-each", SurfaceKind::Splat, SurfaceOptions { align: Align::Each, ..default }),
        ("align-nearest", SurfaceKind::Splat, SurfaceOptions { align: Align::Nearest, ..default }),
        (
            "gather-limit",
            SurfaceKind::Splat,
            SurfaceOptions { gather_limit: GatherLimit::Nearest, ..default },
        ),
        (
            "min-distance",
            SurfaceKind::Smooth,
            SurfaceOptions { min_distance: Some(2.5), ..default },
        ),
        ("degree-1", SurfaceKind::Mls, SurfaceOptions { degree: 1, ..default }),
        ("degree-3", SurfaceKind::Mls, SurfaceOptions { degree: 3, ..default }),
        ("reach", SurfaceKind::SplatFit, SurfaceOptions { reach: Some(1.3), ..default }),
        (
            "density",
            SurfaceKind::Cylinder,
            SurfaceOptions { density: 5, reach: Some(1.5), ..default },
        ),
    ];
    for (name, kind, options) in options {
        let mut scene = reference::scene(kind);
        if let Geometry::Points(points) = &mut scene.graph.geometries[0] {
            points.options = options;
        }
        let scene = flat(&scene);
        check(name, &scene, &SETTINGS);
        let default = render(&cpu(), &flat(&reference::scene(kind)), &SETTINGS);
        assert!(render(&cpu(), &scene, &SETTINGS) != default, "{name} changes nothing");
    }
}

#[test]
fn one_sample_goes_through_the_centre_of_the_pixel() {
    let settings = Settings { samples_per_pixel: 1, ..SETTINGS };
    check("centres", &flat(&reference::scene(SurfaceKind::Splat)), &settings);
}

#[test]
fn lines_and_scatter_are_equal() {
    let mut cloud = clouds::plane(60, 0.4, 8);
    cloud.positions.extend(clouds::line(200).positions.into_iter().map(|p| p + 0.5 * Vec3::Z));
    cloud.positions.extend((0..9).map(|i| Vec3::new(0.2 * i as f32 - 0.8, 0.5, 1.0)));
    cloud.normals = None;
    let preparation = Preparation { structure: StructureChoice::Auto, ..Preparation::default() };
    let points = scenes::prepared(cloud, &preparation, SurfaceKind::Smooth);
    let scene = Scene { lights: reference::lights(), ..scenes::lit(points) };
    let mut scene = flat(&scene);
    scene.camera.position = DVec3::new(4.0, -3.0, 3.0);
    assert!(scene.clouds().all(|cloud| !cloud.lines.nodes.is_empty()));
    check("structure", &scene, &SETTINGS);
}

#[test]
fn leaves_are_equal() {
    let scene = Scene { lights: reference::lights(), ..scenes::lit(crate::leaves::tree()) };
    let mut scene = flat(&scene);
    scene.camera.position = DVec3::new(4.0, -3.0, 3.0);
    assert!(scene.clouds().all(|cloud| cloud.has_leaves));
    check("leaves", &scene, &SETTINGS);
}

#[test]
fn cameras_are_equal() {
    let projections = [
        ("orthographic", Projection::Orthographic { height: 4.0 }),
        ("panorama", Projection::Panorama),
    ];
    for (name, projection) in projections {
        let scene = reference::scene(SurfaceKind::Splat);
        let camera = Camera { projection, ..scene.camera };
        check(name, &flat(&Scene { camera, ..scene }), &SETTINGS);
    }
}

#[test]
fn planes_hide_the_same() {
    let mut scene = flat(&reference::scene(SurfaceKind::Splat));
    let normal = DVec3::new(1.0, 0.2, 0.1);
    scene.camera_planes = vec![
        ClipPlane { point: DVec3::new(0.3, 0.0, 0.0), normal },
        ClipPlane { point: DVec3::new(0.0, 0.0, -0.4), normal: -DVec3::Z },
    ];
    check("planes", &scene, &SETTINGS);
}

#[test]
fn instances_are_equal() {
    let mut scene = reference::scene(SurfaceKind::Splat);
    scene.graph.nodes.clear();
    for (i, scale) in [1.0, 0.5, 1.5].into_iter().enumerate() {
        let turned = DAffine3::from_axis_angle(DVec3::Z, i as f64);
        let placed = DAffine3::from_translation(DVec3::new(0.0, 2.2 * i as f64 - 2.2, 0.0));
        let matrix = placed * turned * DAffine3::from_scale(DVec3::new(scale, 1.0, 0.8));
        scene.graph.nodes.push(scenes::node(0, 0, matrix));
    }
    check("instances", &flat(&scene), &SETTINGS);
}

#[test]
fn georeferenced_clouds_are_equal() {
    let cloud = clouds::georeferenced(&clouds::cube(24, 0.4, 11));
    let scene = scenes::scene(cloud, SurfaceKind::Smooth);
    check("georeferenced", &flat(&scene), &SETTINGS);
}

#[test]
fn materials_and_backgrounds_are_equal() {
    let glowing = Material { emissive: Vec3::new(0.1, 0.0, 0.3), ..Material::EMISSIVE };
    let painted = Material {
        base_color: Vec3::new(0.9, 0.2, 0.1),
        ignores_vertex_colors: true,
        ..Material::MATTE
    };
    let gradient = Background::Gradient { top: Vec3::X, bottom: Vec3::Y };
    for (name, material, background) in [
        ("unlit", Material::UNLIT, Background::Transparent),
        ("emissive", glowing, Background::Environment),
        ("painted", painted, gradient),
    ] {
        let mut scene = reference::scene(SurfaceKind::Splat);
        scene.graph.materials[0] = material;
        scene.background = background;
        scene.lights.push(Light::Headlight(0.3));
        check(name, &flat(&scene), &SETTINGS);
    }
}

#[test]
fn triangles_are_equal() {
    let ball = scenes::uv_sphere(12, 24, 0.8);
    let mut painted = scenes::cuboid(Vec3::new(-1.5, -2.0, -1.0), Vec3::new(-0.5, -1.0, 1.2));
    let color = |p: &Vec3| (0.3 * p.abs()).extend(1.0);
    painted.colors = Some(painted.positions.iter().map(color).collect());
    let floor = scenes::floor(-1.0, 4.0);
    let mut scene = reference::scene(SurfaceKind::Splat);
    for mesh in [ball, painted, floor] {
        scene.graph.append(Graph::from_geometry(Geometry::Triangles(mesh), Material::MATTE));
    }
    let turned = DAffine3::from_axis_angle(DVec3::X, 0.7);
    let moved = DAffine3::from_translation(DVec3::new(1.6, -1.0, 0.5)) * turned;
    scene.graph.nodes[1].transform = Transform::Matrix(moved);
    check("triangles", &flat(&scene), &SETTINGS);
}

#[test]
fn lamps_are_equal() {
    let kinds = [
        ("directional", PunctualLightKind::Directional),
        ("point", PunctualLightKind::Point),
        ("spot", PunctualLightKind::Spot { inner_rad: 0.2, outer_rad: 0.5 }),
    ];
    for (name, kind) in kinds {
        for radius in [0.0, 0.3] {
            let mut scene = reference::scene(SurfaceKind::Splat);
            let color = Vec3::new(60.0, 50.0, 40.0);
            let light = PunctualLight { kind, color, range: 20.0, radius };
            let position = DVec3::new(3.0, -2.0, 3.5);
            let toward_ball = (DVec3::Z - position).normalize();
            let turned = DQuat::from_rotation_arc(DVec3::NEG_Z, toward_ball);
            let placed = DAffine3::from_rotation_translation(turned, position);
            let transform = Transform::Matrix(placed);
            let lamp = Node { light: Some(light), transform, ..Node::new("lamp") };
            scene.graph.nodes.push(lamp);
            scene.lights.clear();
            check(name, &flat(&scene), &SETTINGS);
        }
    }
}

#[test]
fn light_on_a_gpu_has_known_answers() {
    let Some(gpu) = gpu() else { return };
    light::check_furnace(gpu, &[SurfaceKind::Sphere, SurfaceKind::Disc, SurfaceKind::Splat]);
}

#[test]
fn pictures_of_a_gpu_equal_the_references() {
    let Some(gpu) = gpu() else { return };
    // The references of the CPU have 8 bits, where rounding alone may make a step.
    let n_pixels = (TOLERANCE.other_pixels * 96.0 * 72.0) as usize;
    let allowed = reference::ByteDifference { n_pixels, n_steps: TOLERANCE.steps };
    reference::check(gpu, &kinds().collect::<Vec<_>>(), allowed);
}

#[test]
fn empty_scenes_are_background() {
    let scene = Scene { graph: Default::default(), ..reference::scene(SurfaceKind::Splat) };
    check("empty", &flat(&scene), &SETTINGS);
}

#[test]
fn regions_are_parts_of_the_picture() {
    let Some(gpu) = gpu() else { return };
    let scene = flat(&reference::scene(SurfaceKind::Splat));
    let whole = render(gpu, &scene, &SETTINGS);
    let region = RenderRegion { rows: (13, 40), ..RenderRegion::whole(&SETTINGS) };
    let (part, _) = gpu.render_region(&scene, &SETTINGS, region, &NoProgress).unwrap();
    let rows = 13 * 80..40 * 80;
    assert_eq!(part.color, whole.color[rows.clone()]);
    assert_eq!(part.aovs.unwrap().point_id, whole.aovs.as_ref().unwrap().point_id[rows]);
    let region = RenderRegion { columns: (7, 50), ..region };
    let (part, stats) = gpu.render_region(&scene, &SETTINGS, region, &NoProgress).unwrap();
    // Four samples of each pixel, and the ray through its centre.
    assert_eq!(stats.rays.primary, 5 * 43 * 27);
    let pixels: Vec<_> = (13..40).flat_map(|y| (7..50).map(move |x| y * 80 + x)).collect();
    let colors: Vec<_> = pixels.iter().map(|pixel| whole.color[*pixel]).collect();
    assert_eq!((part.width, part.height, part.color), (43, 27, colors));
    let ids = &whole.aovs.as_ref().unwrap().point_id;
    let ids: Vec<_> = pixels.iter().map(|pixel| ids[*pixel]).collect();
    assert_eq!(part.aovs.unwrap().point_id, ids);
}

#[test]
fn pictures_repeat_and_follow_changes_of_the_scene() {
    let Some(gpu) = gpu() else { return };
    let mut scene = flat(&reference::scene(SurfaceKind::Disc));
    let first = render(gpu, &scene, &SETTINGS);
    assert!(first == render(gpu, &scene, &SETTINGS));
    scene.camera.position.z += 1.0;
    let other = flat(&reference::scene(SurfaceKind::Sphere));
    check("moved", &scene, &SETTINGS);
    check("other", &other, &SETTINGS);
}

#[test]
fn ray_counts_are_equal() {
    let Some(gpu) = gpu() else { return };
    // The layers of Gaussians take a second ray through the centre of a pixel, also if it has one sample.
    for (kind, samples_per_pixel) in
        kinds().map(|kind| (kind, 4)).chain([(SurfaceKind::Gaussian, 1)])
    {
        let scene = flat(&reference::scene(kind));
        let settings = Settings { samples_per_pixel, ..SETTINGS };
        let count = |renderer: &dyn Renderer| {
            renderer.render(&scene, &settings, &NoProgress).unwrap().1.rays
        };
        let (a, b) = (count(&cpu()), count(gpu));
        assert_eq!(a.primary, b.primary);
        for (a, b) in [(a.shadow, b.shadow), (a.sky, b.sky)] {
            assert!(a.abs_diff(b) <= a / 1000, "{}: {a} {b}", kind.name());
        }
    }
}

#[test]
fn what_a_gpu_does_not_render_is_refused_with_its_name() {
    let Some(gpu) = gpu() else { return };
    let scene = flat(&reference::scene(SurfaceKind::Points));
    let error = gpu.render(&scene, &SETTINGS, &NoProgress).err();
    let Some(Error::Renderer(reason)) = error else { panic!("{error:?}") };
    let expected = "the GPU does not render the surface points yet";
    assert!(reason.ends_with(expected), "{reason}");
}

#[test]
fn trees_in_pages_are_equal_and_larger_ones_are_refused() {
    if gpu().is_none() {
        return;
    }
    let device = std::env::var("SURFEL_DEVICE").ok();
    let with_pages = |bytes| GpuRenderer::with_pages(device.as_deref(), bytes).unwrap();
    let mut scene = reference::scene(SurfaceKind::Disc);
    let ball = Geometry::Triangles(scenes::uv_sphere(20, 30, 0.8));
    scene.graph.append(Graph::from_geometry(ball, Material::MATTE));
    let scene = flat(&scene);
    let settings =
        Settings { width: 24, height: 18, samples_per_pixel: 1, light_samples: 1, ..SETTINGS };
    check_on(&with_pages(1 << 16), "pages", &scene, &settings);
    let error = with_pages(1 << 12).render(&scene, &settings, &NoProgress).unwrap_err();
    let Error::Renderer(reason) = error else { panic!("{error}") };
    assert!(reason.contains("allows 16384 bytes in the pages of a tree, "), "{reason}");
}

#[test]
fn trees_in_pages_are_equal_for_surfaces_of_many_points_and_of_fields() {
    if gpu().is_none() {
        return;
    }
    let device = std::env::var("SURFEL_DEVICE").ok();
    let settings =
        Settings { width: 24, height: 18, samples_per_pixel: 1, light_samples: 1, ..SETTINGS };
    let with_pages = |shift: u32| GpuRenderer::with_pages(device.as_deref(), 1 << shift).unwrap();
    for kind in [SurfaceKind::Smooth, SurfaceKind::Implicit, SurfaceKind::Octree] {
        let scene = flat(&reference::scene(kind));
        let is_refused = |renderer: &GpuRenderer| {
            let error = renderer.render(&scene, &settings, &NoProgress).err();
            let reason = error.map(|error| error.to_string());
            let is_expected = |reason: &str| reason.contains(" bytes in the pages of a tree, ");
            assert!(reason.as_deref().is_none_or(is_expected), "{reason:?}");
            reason.is_some()
        };
        assert!(is_refused(&with_pages(12)), "{}", kind.name());
        // With the smallest pages that hold the tree, it has more than one.
        let paged = (13..20).map(with_pages).find(|renderer| !is_refused(renderer)).unwrap();
        check_on(&paged, &format!("pages-{}", kind.name()), &scene, &settings);
    }
}

#[test]
fn more_memory_than_the_limit_is_refused_before_the_upload() {
    if gpu().is_none() {
        return;
    }
    let device = std::env::var("SURFEL_DEVICE").ok();
    let open = || GpuRenderer::open(device.as_deref()).unwrap();
    let scene = flat(&reference::scene(SurfaceKind::Disc));
    let settings =
        Settings { width: 24, height: 18, samples_per_pixel: 1, light_samples: 1, ..SETTINGS };
    let refusing = open().with_memory_limit(Some(1 << 16));
    let error = refusing.render(&scene, &settings, &NoProgress).unwrap_err();
    assert_eq!(refusing.upload_time().n_bytes, 0);
    let Error::Renderer(reason) = error else { panic!("{error}") };
    let expected = " of memory are needed, and the limit is 64.0 KiB [memory_limit]";
    assert!(reason.ends_with(expected), "{reason}");
    let enough = open().with_memory_limit(Some(1 << 24));
    check_on(&enough, "limit", &scene, &settings);
}

#[test]
fn rendering_can_be_cancelled() {
    let Some(gpu) = gpu() else { return };
    let scene = flat(&reference::scene(SurfaceKind::Splat));
    let result = gpu.render(&scene, &SETTINGS, &CancelAfter::new(1));
    assert_eq!(result.err(), Some(Error::Cancelled));
    check("after-cancel", &scene, &SETTINGS);
}

#[test]
fn cancelled_pictures_leave_nothing_to_later_ones() {
    let Some(gpu) = gpu() else { return };
    let scene = flat(&reference::scene(SurfaceKind::Disc));
    // On a software device several parts are on their way at once.
    let settings =
        Settings { width: 128, height: 100, light_samples: 4, with_aovs: false, ..SETTINGS };
    let picture = render(gpu, &scene, &settings);
    for n_checks in 0..4 {
        let result = gpu.render(&scene, &settings, &CancelAfter::new(n_checks));
        assert_eq!(result.err(), Some(Error::Cancelled));
        assert!(picture == render(gpu, &scene, &settings), "{n_checks}");
    }
}
