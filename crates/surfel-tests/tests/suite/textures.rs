//! Textures on triangles with known answers: colours, masks, alpha, normal maps, roughness and emission.

use crate::materials::{
    SETTINGS, WHITE_SKY, assert_near, mesh, pane, rgb, scene, shadow_of, sun, with_positions,
};
use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;
use surfel_core::flat::FlatScene;
use surfel_core::math::{DAffine3, DVec3, Vec2, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::render::Settings;
use surfel_core::scene::{
    AlphaMode, Background, Environment, Graph, Light, Material, MaterialTextures, Mesh, Morph,
    Node, PunctualLight, PunctualLightKind, Scene, Texture, TextureRef, Transform,
};
use surfel_tests::scenes::{self, from_above, render};

const RED: [u8; 4] = [255, 0, 0, 255];
const GREEN: [u8; 4] = [0, 255, 0, 255];
const BLUE: [u8; 4] = [0, 0, 255, 255];
const WHITE: [u8; 4] = [255; 4];

fn two_by_two(texels: [[u8; 4]; 4]) -> Texture {
    Texture { width: 2, height: 2, texels: texels.into() }
}

fn nearest() -> TextureRef {
    TextureRef { is_nearest: true, ..TextureRef::new(0) }
}

/// Returns a graph of the square |x|, |y| <= 1, which fills the picture.
fn square(material: Material, texture: Texture) -> Graph {
    let mut graph = Graph::from_geometry(mesh(scenes::floor(0.0, 1.0)), material);
    graph.textures = vec![texture];
    graph
}

fn textured(base_color: TextureRef, material: Material) -> Material {
    let textures = MaterialTextures { base_color: Some(base_color), ..MaterialTextures::default() };
    Material { textures, ..material }
}

/// The expected colour at a point of a square.
type ColorAt<'a> = &'a dyn Fn(f32, f32) -> Vec3;

#[test]
fn a_texture_is_upright_on_a_quad() {
    let texture = two_by_two([RED, GREEN, BLUE, WHITE]);
    let color = |x: f32, y: f32| match (x < 0.0, y < 0.0) {
        (true, false) => Vec3::X,
        (false, false) => Vec3::Y,
        (true, true) => Vec3::Z,
        (false, true) => Vec3::ONE,
    };
    let turned = TextureRef { rotation_rad: FRAC_PI_2, offset: Vec2::Y, ..nearest() };
    let scaled = TextureRef { scale: Vec2::new(2.0, 1.0), ..nearest() };
    let at_turned = |x: f32, y: f32| color(-y, x);
    let at_scaled = |x: f32, y: f32| color(x - 0.5f32.copysign(x), y);
    let cases: [(&str, TextureRef, ColorAt); 3] = [
        ("not transformed", nearest(), &color),
        // Coordinates rotate counter-clockwise, so that the picture rotates clockwise.
        ("turned", turned, &at_turned),
        ("repeated", scaled, &at_scaled),
    ];
    for (name, reference, expected) in cases {
        let graph = square(textured(reference, Material::UNLIT), texture.clone());
        let image = render(&scene(graph, Vec::new(), from_above(2.0)), &SETTINGS);
        for (i, (found, position)) in with_positions(&image).enumerate() {
            assert_eq!(found, expected(position.x, position.y), "{name} at {position}");
            // The position of the pixel agrees with its row and column.
            assert_eq!((i % 32 < 16, i / 32 < 16), (position.x < 0.0, 0.0 < position.y));
        }
    }
}

#[test]
fn a_texture_uses_its_own_set_of_coordinates() {
    let mut upside_down = scenes::floor(0.0, 1.0);
    let turned = upside_down.uvs[0].iter().flatten().map(|uv| Vec2::ONE - uv).collect();
    upside_down.uvs[1] = Some(turned);
    let reference = TextureRef { uv_set: 1, ..nearest() };
    let mut graph =
        square(textured(reference, Material::UNLIT), two_by_two([RED, GREEN, BLUE, WHITE]));
    graph.geometries = vec![mesh(upside_down)];
    let image = render(&scene(graph, Vec::new(), from_above(2.0)), &SETTINGS);
    let corners = [0, 31, 31 * 32, 32 * 32 - 1].map(|i| rgb(image.color[i]));
    assert_eq!(corners, [Vec3::ONE, Vec3::Z, Vec3::Y, Vec3::X]);
}

#[test]
fn unlit_colours_on_triangles_are_exact() {
    let base_color = Vec3::new(0.1, 0.7, 3.0);
    let material = Material { base_color, ..Material::UNLIT };
    let graph = Graph::from_geometry(mesh(scenes::floor(0.0, 1.0)), material);
    let lights = vec![sun(Vec3::X), Light::Sky(WHITE_SKY), Light::Headlight(7.0)];
    let image = render(&scene(graph, lights, from_above(2.0)), &SETTINGS);
    assert!(image.color.iter().all(|pixel| rgb(*pixel) == base_color && pixel[3] == 1.0));
}

#[test]
fn emission_adds_to_reflected_light() {
    let material = Material {
        base_color: Vec3::new(0.5, 0.25, 1.0),
        emissive: Vec3::new(0.1, 0.2, 0.0),
        emissive_strength: 2.0,
        ..Material::MATTE
    };
    let expected = Vec3::new(1.1, 0.7, 2.0);
    let graph = Graph::from_geometry(mesh(scenes::floor(0.0, 1.0)), material);
    for (strength, reflected) in [(0.0, Vec3::ZERO), (3.0, Vec3::new(1.5, 0.75, 3.0))] {
        let lights = vec![Light::Headlight(strength)];
        let image = render(&scene(graph.clone(), lights, from_above(2.0)), &SETTINGS);
        for (color, _) in with_positions(&image) {
            assert_near(color, expected + reflected, 1e-5, "emission");
        }
    }
}

#[test]
fn colours_of_vertices_are_linear_between_them() {
    let mut square = scenes::floor(0.0, 1.0);
    let color = |p: Vec3| Vec3::new(0.5 + 0.5 * p.x, 0.5 - 0.3 * p.y, 0.2 * (p.x + p.y) + 0.5);
    let of_vertex = |p: &Vec3| color(*p).extend(1.0);
    square.colors = Some(square.positions.iter().map(of_vertex).collect());
    for (ignores_vertex_colors, material) in [(false, Material::UNLIT), (true, Material::UNLIT)] {
        let graph = Graph::from_geometry(
            mesh(square.clone()),
            Material { ignores_vertex_colors, ..material },
        );
        let image = render(&scene(graph, Vec::new(), from_above(2.0)), &SETTINGS);
        for (found, position) in with_positions(&image) {
            let expected = if ignores_vertex_colors { Vec3::ONE } else { color(position) };
            assert_near(found, expected, 1e-5, "vertex colours");
        }
    }
}

#[test]
fn a_mask_cuts_holes_into_picture_and_shadow() {
    // The upper left and lower right quarters are opaque.
    let (full, none) = ([255u8; 4], [255, 255, 255, 100]);
    let texture = two_by_two([full, none, none, full]);
    let mask = Material { alpha_mode: AlphaMode::Mask(0.5), ..Material::MATTE };
    let material = textured(nearest(), mask);
    let is_opaque = |position: Vec3| (position.x < 0.0) == (0.0 < position.y);
    let graph = square(material.clone(), texture.clone());
    let image = render(&scene(graph, vec![Light::Headlight(1.0)], from_above(2.0)), &SETTINGS);
    for (i, pixel) in image.color.iter().enumerate() {
        let center = Vec3::new((i % 32) as f32 - 15.5, 15.5 - (i / 32) as f32, 0.0);
        let expected = if is_opaque(center) { 1.0 } else { 0.0 };
        assert!(pixel.iter().all(|value| (value - expected).abs() < 1e-5), "{pixel:?} at {center}");
    }
    for (color, position) in shadow_of(mesh(pane()), material, vec![texture]) {
        let from_edge =
            (position.abs().max_element() - 0.5).abs().min(position.x.abs()).min(position.y.abs());
        if from_edge < 1e-3 {
            continue;
        }
        let is_dark = position.x.abs().max(position.y.abs()) < 0.5 && is_opaque(position);
        assert_near(color, Vec3::splat(if is_dark { 0.0 } else { 1.0 }), 1e-5, "shadow");
    }
}

#[test]
fn alpha_blends_a_surface_with_the_one_behind() {
    let blended = Material {
        alpha: 0.25,
        alpha_mode: AlphaMode::Blend,
        base_color: Vec3::X,
        ..Material::UNLIT
    };
    let behind = Material { base_color: Vec3::Y, ..Material::UNLIT };
    let graph = scenes::graph(vec![
        (mesh(scenes::floor(1.0, 2.0)), blended.clone()),
        (mesh(scenes::floor(0.5, 2.0)), blended),
        (mesh(scenes::quad(Vec3::X, Vec3::X, 2.0 * Vec3::Y)), behind),
    ]);
    let image = render(&scene(graph, Vec::new(), from_above(2.0)), &SETTINGS);
    let red = 0.25 + 0.75 * 0.25;
    for (i, pixel) in image.color.iter().enumerate() {
        let expected = if i % 32 < 16 { [red, 0.0, 0.0, red] } else { [red, 1.0 - red, 0.0, 1.0] };
        let off = pixel.iter().zip(expected).fold(0.0, |max: f32, (a, b)| max.max((a - b).abs()));
        assert!(off < 1e-5, "{pixel:?}");
    }
}

/// Returns a graph of a square with a normal map of one colour.
fn normal_mapped(texel: [u8; 3], change: impl Fn(&mut Mesh, &mut f32)) -> Graph {
    let (mut square, mut scale) = (scenes::floor(0.0, 1.0), 1.0);
    change(&mut square, &mut scale);
    let [x, y, z] = texel;
    let texture = Texture { width: 1, height: 1, texels: [[x, y, z, 255]].into() };
    let textures = MaterialTextures {
        normal: Some((TextureRef::new(0), scale)),
        ..MaterialTextures::default()
    };
    let mut graph = Graph::from_geometry(mesh(square), Material { textures, ..Material::MATTE });
    graph.textures = vec![texture];
    graph
}

/// Returns the colour of such a square under a sun.
fn normal_mapped_color(
    texel: [u8; 3],
    toward_sun: Vec3,
    change: impl Fn(&mut Mesh, &mut f32),
) -> Vec3 {
    color_of(normal_mapped(texel, change), toward_sun)
}

fn color_of(graph: Graph, toward_sun: Vec3) -> Vec3 {
    let image = render(&scene(graph, vec![sun(toward_sun)], from_above(1.0)), &SETTINGS);
    let color = rgb(image.color[0]);
    assert!(image.color.iter().all(|pixel| rgb(*pixel).distance(color) < 1e-5));
    color
}

#[test]
fn normal_maps_tilt_normals_to_the_right_and_up() {
    let flat = [128, 128, 255];
    let unchanged = |_: &mut Mesh, _: &mut f32| {};
    let toward = Vec3::new(0.6, 0.48, 0.64);
    // 128 of 255 is off the middle by 0.004.
    assert_near(normal_mapped_color(flat, toward, unchanged), Vec3::splat(0.64), 0.006, "flat");
    let scale_of_zero = |_: &mut Mesh, scale: &mut f32| *scale = 0.0;
    assert_near(
        normal_mapped_color([255, 200, 255], toward, scale_of_zero),
        Vec3::splat(0.64),
        1e-6,
        "scale 0",
    );
    // These texels tilt normals by 45 degrees: (1, 0, 1) and (0, 1, 1).
    let lit = |x: f32, y: f32| Vec3::splat(Vec3::new(x, y, 1.0).normalize().dot(toward));
    let mirrored = |square: &mut Mesh, _: &mut f32| {
        square.uvs[0].iter_mut().flatten().for_each(|uv| uv.x = 1.0 - uv.x);
    };
    let with_tangents = |square: &mut Mesh, _: &mut f32| {
        // These are the tangents of the texture coordinates, with bitangents up.
        square.normals = Some(vec![Vec3::Z; 4]);
        square.tangents = Some(vec![Vec3::X.extend(1.0); 4]);
    };
    for (name, change, sign) in [
        ("of the coordinates", &unchanged as &dyn Fn(&mut Mesh, &mut f32), 1.0),
        ("of tangents", &with_tangents, 1.0),
        ("mirrored", &mirrored, -1.0),
    ] {
        let found = normal_mapped_color([255, 128, 255], toward, change);
        assert_near(found, lit(sign, 0.0), 0.006, &format!("right, {name}"));
        let found = normal_mapped_color([128, 255, 255], toward, change);
        assert_near(found, lit(0.0, 1.0), 0.006, &format!("up, {name}"));
    }
}

/// Morph targets rotate the square by 90 degrees, with tangents of their own, or with tangents that follow from the
/// texture coordinates of the moved corners.
#[test]
fn normal_maps_rotate_with_deformed_meshes() {
    let toward = Vec3::new(0.6, 0.48, 0.64);
    let quarter = |p: Vec3| Vec3::new(-p.y, p.x, p.z);
    let offset = |p: Vec3| quarter(p) - p;
    let of_coordinates = |_: &mut Mesh, _: &mut f32| {};
    let of_tangents = |square: &mut Mesh, _: &mut f32| {
        square.normals = Some(vec![Vec3::Z; 4]);
        square.tangents = Some(vec![Vec3::X.extend(1.0); 4]);
    };
    for (name, change) in [
        ("coordinates", &of_coordinates as &dyn Fn(&mut Mesh, &mut f32)),
        ("tangents", &of_tangents),
    ] {
        for texel in [[255, 128, 255], [128, 255, 255]] {
            let at_rest = normal_mapped(texel, change);
            let turned = normal_mapped(texel, |square, scale| {
                change(square, scale);
                square.positions.iter_mut().for_each(|position| *position = quarter(*position));
                for tangent in square.tangents.iter_mut().flatten() {
                    *tangent = quarter(tangent.truncate()).extend(tangent.w);
                }
            });
            let mut bent = normal_mapped(texel, |square, scale| {
                change(square, scale);
                let along = square.tangents.iter().flatten();
                let along = along.map(|tangent| offset(tangent.truncate())).collect();
                let target = Morph {
                    positions: square.positions.iter().map(|position| offset(*position)).collect(),
                    tangents: square.tangents.is_some().then_some(along),
                    ..Morph::default()
                };
                square.morphs = vec![target];
            });
            bent.nodes[0].morph_weights = vec![1.0];
            let [at_rest, turned, bent] =
                [at_rest, turned, bent].map(|graph| color_of(graph, toward));
            assert!(0.05 < turned.distance(at_rest), "{name}: the rotation does not show");
            assert_near(bent, turned, 1e-6, name);
        }
    }
}

#[test]
fn normal_maps_of_mirrored_objects_are_mirrored() {
    let toward = Vec3::new(0.6, 0.48, 0.64);
    let lit = |x: f32, y: f32| Vec3::splat(Vec3::new(x, y, 1.0).normalize().dot(toward));
    let of_coordinates = |_: &mut Mesh, _: &mut f32| {};
    let of_tangents = |square: &mut Mesh, _: &mut f32| {
        square.normals = Some(vec![Vec3::Z; 4]);
        square.tangents = Some(vec![Vec3::X.extend(1.0); 4]);
    };
    // Some programs write normals that oppose the winding of the corners.
    let of_turned_normals = |square: &mut Mesh, _: &mut f32| {
        square.normals = Some(vec![-Vec3::Z; 4]);
        square.tangents = Some(vec![Vec3::X.extend(-1.0); 4]);
    };
    for (name, change) in [
        ("coordinates", &of_coordinates as &dyn Fn(&mut Mesh, &mut f32)),
        ("tangents", &of_tangents),
        ("turned normals", &of_turned_normals),
    ] {
        for (x, y) in [(1.0f32, 1.0f32), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
            let scale = DVec3::new(f64::from(x), f64::from(y), 1.0);
            let placed = |texel: [u8; 3]| {
                let mut graph = normal_mapped(texel, change);
                graph.nodes[0].transform = Transform::Matrix(DAffine3::from_scale(scale));
                color_of(graph, toward)
            };
            let context = |tilt: &str| format!("{tilt}, {name}, scaled by {scale}");
            assert_near(placed([255, 128, 255]), lit(x, 0.0), 0.006, &context("right"));
            assert_near(placed([128, 255, 255]), lit(0.0, y), 0.006, &context("up"));
        }
    }
}

/// The floor is lit from below, and its normals are tilted toward the light.
#[test]
fn tilted_normals_receive_no_light_from_behind_the_surface() {
    let leaning = |square: &mut Mesh, _: &mut f32| {
        square.normals = Some(vec![Vec3::new(0.8, 0.0, 0.6); 4]);
        square.tangents = Some(vec![Vec3::new(0.6, 0.0, -0.8).extend(1.0); 4]);
    };
    let flat = |_: &mut Mesh, _: &mut f32| {};
    // The environment is dark above and at the horizon.
    let pixel = |i: usize| if 9 * 8 <= i { Vec3::ONE } else { Vec3::ZERO };
    let from_below =
        Environment::new(8, 16, (0..8 * 16).map(pixel).collect(), Vec3::Z, 0.0).unwrap();
    let light = PunctualLight {
        kind: PunctualLightKind::Point,
        color: Vec3::ONE,
        range: f32::INFINITY,
        radius: 0.0,
    };
    let transform_of_lamp = Transform::from_translation(DVec3::new(4.0, 0.0, -1.0));
    for (name, graph) in [
        ("vertices", normal_mapped([128, 128, 255], leaning)),
        ("texture", normal_mapped([255, 128, 128], flat)),
    ] {
        let mut with_light = graph.clone();
        with_light.nodes.push(Node {
            light: Some(light),
            transform: transform_of_lamp,
            ..Node::new("light")
        });
        let environment = Light::Environment(from_below.clone());
        for (light, graph, lights) in [
            ("sun", graph.clone(), vec![sun(Vec3::new(0.95, 0.0, -0.3))]),
            ("environment", graph.clone(), vec![environment]),
            ("punctual light", with_light, Vec::new()),
        ] {
            let image = render(&scene(graph, lights, from_above(1.0)), &SETTINGS);
            let is_dark = image.color.iter().all(|pixel| rgb(*pixel) == Vec3::ZERO);
            assert!(is_dark, "{light}, normals of {name}");
        }
    }
}

#[test]
fn a_rough_pane_blurs_the_surfaces_behind_it() {
    let paint = |base_color| Material { base_color, ..Material::UNLIT };
    let half = |x: f32| mesh(scenes::quad(x * Vec3::X, Vec3::X, 2.0 * Vec3::Y));
    let see = |roughness: f32| {
        let pane = Material { is_thin: true, roughness, ..Material::GLASS };
        let graph = scenes::graph(vec![
            (half(-1.0), paint(Vec3::X)),
            (half(1.0), paint(Vec3::Y)),
            (mesh(scenes::floor(0.5, 2.0)), pane),
        ]);
        let settings = Settings { samples_per_pixel: 64, ..SETTINGS };
        render(&scene(graph, Vec::new(), from_above(1.0)), &settings)
    };
    // Red at the middle of the left half and just right of the edge.
    let reds = |image: &surfel_core::image::Image| [8, 18].map(|x| image.color[16 * 32 + x][0]);
    let (sharp, rough) = (reds(&see(0.0)), reds(&see(0.5)));
    let transmitted = 0.96 / 1.04;
    assert!((sharp[0] - transmitted).abs() < 1e-4 && sharp[1] == 0.0, "{sharp:?}");
    assert!((0.1..0.8).contains(&(rough[1] / rough[0])), "{rough:?}");
}

#[test]
fn flat_scenes_share_textures_with_their_graph() {
    let texture = two_by_two([RED, GREEN, BLUE, WHITE]);
    let graph = square(textured(nearest(), Material::UNLIT), texture.clone());
    let flat = FlatScene::new(&scene(graph, Vec::new(), from_above(1.0)), &NoProgress).unwrap();
    assert!(Arc::ptr_eq(&flat.textures[0].texels, &texture.texels));
}

/// Textures multiply the values of the material.
#[test]
fn textures_scale_transmission_and_emission() {
    let texel = |texel: [u8; 4]| Texture { width: 1, height: 1, texels: [texel].into() };
    let see = |material: Material, texture: Texture| {
        let graph = square(material, texture);
        let background = Background::Gradient { top: Vec3::ONE, bottom: Vec3::ONE };
        let mut dim = WHITE_SKY;
        (dim.zenith, dim.ground) = (Vec3::splat(0.5), Vec3::splat(0.5));
        let scene = Scene { background, ..scene(graph, vec![Light::Sky(dim)], from_above(1.0)) };
        rgb(render(&scene, &SETTINGS).color[0])
    };
    let with = |textures: MaterialTextures, material: Material| Material { textures, ..material };
    let reference = Some(TextureRef::new(0));
    // Emission is stored in sRGB like colours: 188 is 0.503.
    let emissive = MaterialTextures { emissive: reference, ..MaterialTextures::default() };
    let material = Material { base_color: Vec3::ZERO, emissive: Vec3::ONE, ..Material::MATTE };
    assert_near(
        see(with(emissive, material), texel([188, 0, 255, 255])),
        Vec3::new(0.503, 0.0, 1.0),
        1e-3,
        "emissive",
    );
    // A fifth is transmitted from the white background; the rest is matte white under half light.
    let transmission = MaterialTextures { transmission: reference, ..MaterialTextures::default() };
    let clear = Material { ior: 1.0, ..Material::GLASS };
    assert_near(
        see(with(transmission, clear), texel([51, 0, 0, 255])),
        Vec3::splat(0.2 + 0.8 * 0.5),
        1e-3,
        "transmission",
    );
}

/// The green channel scales roughness and the blue one metalness. With a green of 0 and a blue of 51 the surface is a
/// mirror for a fifth of the light, sharp although the material is rough. The background is bright above and dark
/// below.
#[test]
fn a_texture_scales_roughness_by_green_and_metal_by_blue() {
    let reference = Some(TextureRef::new(0));
    let textures =
        MaterialTextures { metallic_roughness: reference, ..MaterialTextures::default() };
    let base_color = Vec3::splat(0.5);
    let rough = Material { metallic: 1.0, base_color, textures, ..Material::MATTE };
    let background = Background::Gradient { top: Vec3::ONE, bottom: Vec3::ZERO };
    let see = |texel: [u8; 4]| {
        let graph = square(rough.clone(), Texture { width: 1, height: 1, texels: [texel].into() });
        let scene = Scene { background, ..scene(graph, Vec::new(), from_above(1.0)) };
        render(&scene, &SETTINGS).color
    };
    // Rays are reflected straight back to the middle of the gradient.
    for pixel in see([255, 0, 51, 255]) {
        assert_near(rgb(pixel), Vec3::splat(0.2 * 0.5 * 0.5), 1e-5, "sharp");
    }
    let (sharp, rough) = (see([0, 0, 255, 255]), see([0, 128, 255, 255]));
    assert!(sharp.iter().all(|pixel| *pixel == sharp[0]));
    assert!(rough.iter().any(|pixel| 0.05 < (pixel[0] - sharp[0][0]).abs()));
}
