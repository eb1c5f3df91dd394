//! White furnaces: a surface that absorbs nothing is indistinguishable from the uniform light around it.

use crate::materials::{SETTINGS, WHITE_SKY, assert_near, mesh, rgb, scene, with_positions};
use surfel_core::image::Image;
use surfel_core::math::Vec3;
use surfel_core::render::Settings;
use surfel_core::scene::{
    AlphaMode, CloudGeometry, Environment, Geometry, Graph, Light, Material, Mesh,
};
use surfel_core::surface::SurfaceKind;
use surfel_tests::clouds;
use surfel_tests::scenes::{self, from_above, render};

/// A material with the greatest allowed differences from white: of the mean over a ball of points, of the mean over
/// a ball of triangles, and of any pixel of a ball of facets.
struct InFurnace {
    name: &'static str,
    material: Material,
    mean_on_points: f32,
    mean_on_triangles: f32,
    each: f32,
}

/// Difference because discs shade each other's rims a little when light comes from all sides.
const DENTS: f32 = 0.015;
/// Difference of triangles: facets block a part of the hemisphere about a vertex normal that differs from theirs by
/// up to 3 degrees, and the mean of 5000 samples of an environment, each off by 0.4, is uncertain by 0.006.
const LEANING: f32 = 0.015;
/// Four standard errors of the mean of 32 such samples.
const NOISE: f32 = 0.3;
/// Difference because rays of small weight are traced at random. (Without facets 16 bounces would be enough. Between
/// facets some light is reflected a thousand times: after 64 bounces 0.009 of it is still inside.)
const WITHIN: f32 = 0.005;
/// Four standard errors of the mean of 2800 samples of rough reflections, each off by up to 0.4: 0.0075 is one.
const ROUGH: f32 = 0.03;

fn in_furnace() -> Vec<InFurnace> {
    let rough = |roughness| Material { ignores_vertex_colors: true, roughness, ..Material::METAL };
    let entry = |name, material, mean_on_points, mean_on_triangles, each| InFurnace {
        name,
        material,
        mean_on_points,
        mean_on_triangles,
        each,
    };
    let any = f32::INFINITY;
    let half = Material { alpha: 0.5, alpha_mode: AlphaMode::Blend, ..Material::MATTE };
    let pane = Material { is_thin: true, ..Material::GLASS };
    let frosted = Material { roughness: 0.3, ..Material::GLASS };
    vec![
        entry("matte", Material::MATTE, DENTS + LEANING, LEANING, NOISE),
        entry("mirror", Material::MIRROR, 1e-5, 1e-5, 1e-5),
        entry("glass", Material::GLASS, WITHIN, WITHIN, 0.1),
        entry("plastic", Material::PLASTIC, DENTS + 0.01, 0.01, any),
        entry("metal", rough(0.25), ROUGH, ROUGH, any),
        entry("metal 0.1", rough(0.1), ROUGH, ROUGH, any),
        entry("metal 0.3", rough(0.3), ROUGH, ROUGH, any),
        entry("metal 0.6", rough(0.6), ROUGH, ROUGH, any),
        entry("metal 1.0", rough(1.0), ROUGH, ROUGH, any),
        entry("plastic 0.5", Material { roughness: 0.5, ..Material::PLASTIC }, ROUGH, ROUGH, any),
        entry("plastic 1.0", Material { roughness: 1.0, ..Material::PLASTIC }, ROUGH, ROUGH, any),
        entry("pane", pane, 1e-3, 1e-3, 0.1),
        entry("frosted glass", frosted, ROUGH, ROUGH, any),
        entry(
            "masked out",
            Material { alpha: 0.2, alpha_mode: AlphaMode::Mask(0.5), ..half },
            0.0,
            0.0,
            0.0,
        ),
    ]
}

fn white_lights() -> [(&'static str, Light); 2] {
    let picture = Environment::new(4, 2, vec![Vec3::ONE; 8], Vec3::Z, 0.0).unwrap();
    [("sky", Light::Sky(WHITE_SKY)), ("environment", Light::Environment(picture))]
}

/// Returns the mean over the covered pixels, the greatest difference of one of them from white, and their number.
fn whiteness(image: &Image) -> (f32, f32, usize) {
    let covered = image.color.iter().filter(|pixel| 0.4 < pixel[3]);
    let values: Vec<f32> = covered.map(|pixel| rgb(*pixel).y / pixel[3]).collect();
    let farthest = values.iter().fold(0.0, |max: f32, value| max.max((value - 1.0).abs()));
    (values.iter().sum::<f32>() / values.len() as f32, farthest, values.len())
}

fn white(points: CloudGeometry) -> CloudGeometry {
    scenes::colored(&points, vec![[255; 3]; points.cloud().len()])
}

#[test]
fn materials_without_absorption_are_white_in_a_furnace() {
    let points = white(scenes::points(clouds::sphere(8000, 1.0), SurfaceKind::Splat));
    let outward = scenes::outward(&points);
    let smooth = scenes::uv_sphere(32, 64, 1.0);
    let facets = Mesh { normals: None, ..smooth.clone() };
    let settings = Settings {
        width: 24,
        height: 24,
        samples_per_pixel: 16,
        light_samples: 32,
        max_depth: 1000,
        ..SETTINGS
    };
    for (light_name, light) in white_lights() {
        for InFurnace { name, material, mean_on_points, mean_on_triangles, each } in in_furnace() {
            for (shape, geometry, allowed) in [
                ("points", Geometry::Points(points.clone()), mean_on_points),
                ("outward points", Geometry::Points(outward.clone()), mean_on_points),
                ("smooth mesh", mesh(smooth.clone()), mean_on_triangles),
                ("facets", mesh(facets.clone()), mean_on_triangles),
            ] {
                if shape == "outward points" && material.transmission == 0.0 {
                    continue;
                }
                let camera = scenes::lit(points.clone()).camera;
                let graph = Graph::from_geometry(geometry, material.clone());
                let image = render(&scene(graph, vec![light.clone()], camera), &settings);
                if name == "masked out" {
                    assert!(image.color.iter().all(|pixel| *pixel == [0.0; 4]));
                    continue;
                }
                let (mean, farthest, n) = whiteness(&image);
                let context = format!("{name}, {shape}, {light_name}: {mean}, {farthest}");
                assert!(120 < n && (mean - 1.0).abs() <= allowed, "{context}");
                if shape == "facets" {
                    assert!(farthest <= each, "{context}");
                }
            }
        }
    }
}

/// A shell with an alpha of 0.5 shows half of its outside and a quarter of its inside, which half of the light
/// reaches.
#[test]
fn the_inside_of_a_half_transparent_shell_is_dimmer() {
    let half = Material { alpha: 0.5, alpha_mode: AlphaMode::Blend, ..Material::MATTE };
    let shell = Mesh { normals: None, ..scenes::uv_sphere(32, 64, 1.0) };
    let image = render(
        &scene(
            Graph::from_geometry(mesh(shell), half),
            vec![Light::Sky(WHITE_SKY)],
            from_above(1.2),
        ),
        &SETTINGS,
    );
    for pixel in image.color {
        assert_near(rgb(pixel), Vec3::splat(0.5 + 0.5 * 0.5 * 0.5), 1e-5, "shell");
        assert!((pixel[3] - 0.75).abs() < 1e-5, "{pixel:?}");
    }
}

/// A dome that does not refract neither adds nor removes light.
#[test]
fn a_floor_under_a_clear_dome_is_white() {
    // An index of refraction of 1 makes no interface.
    let nothing = Material { ior: 1.0, ..Material::GLASS };
    let pane = Material { is_thin: true, ..nothing.clone() };
    for material in [nothing, pane] {
        let dome = mesh(scenes::uv_sphere(16, 32, 3.0));
        let floor = mesh(scenes::floor(0.0, 2.0));
        let graph = scenes::graph(vec![(floor, Material::MATTE), (dome, material)]);
        let image = render(&scene(graph, vec![Light::Sky(WHITE_SKY)], from_above(3.0)), &SETTINGS);
        for (color, _) in with_positions(&image) {
            assert_near(color, Vec3::ONE, 1e-5, "below the dome");
        }
    }
}
