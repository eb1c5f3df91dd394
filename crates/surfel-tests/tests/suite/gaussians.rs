//! Trained Gaussians: composited like a sorted list of all of them, among surfaces, in mirrors and as shadows.

use surfel_core::flat::FlatScene;
use surfel_core::image::{decode_srgb, encode_srgb8};
use surfel_core::math::{DAffine3, DQuat, DVec3, Quat, Random, Ray, Vec3};
use surfel_core::points::{
    GAUSSIAN_COLUMNS, Gaussian, GaussianColumns, PointCloud, Scalar, Values, rest_column,
};
use surfel_core::render::Settings;
use surfel_core::scene::{Background, CloudGeometry, Geometry, Light, Material, Mesh, Scene, Sun};
use surfel_core::surface::SurfaceKind;
use surfel_core::surface::gaussian::spherical_harmonics;
use surfel_core::trace::{self, GaussianLight, InstanceFilter, Simd};
use surfel_tests::scenes;

use crate::instances::{flat, hits, occlusions};

/// A Gaussian with its coefficients, one channel after the other.
struct Trained {
    gaussian: Gaussian,
    coefficients: Vec<f32>,
}

/// Returns a round Gaussian at a place that shows one sRGB-encoded colour in all directions.
fn round(center: Vec3, deviation: f32, opacity: f32, color: [f32; 3]) -> Trained {
    let gaussian =
        Gaussian { center, rotation: Quat::IDENTITY, deviations: Vec3::splat(deviation), opacity };
    Trained { gaussian, coefficients: color.map(|channel| (channel - 0.5) / 0.282_094_8).to_vec() }
}

/// Returns the columns of a file of these Gaussians.
fn cloud(all: &[Trained]) -> CloudGeometry {
    let mut cloud =
        PointCloud::from_positions(all.iter().map(|trained| trained.gaussian.center).collect());
    let n_harmonics = all[0].coefficients.len() / 3;
    let mut add = |name: String, value: &dyn Fn(&Trained) -> f32| {
        let values = Values::F32(all.iter().map(value).collect());
        cloud.scalars.push(Scalar { name, values });
    };
    for (channel, name) in GAUSSIAN_COLUMNS[..3].iter().enumerate() {
        add((*name).to_owned(), &|trained| trained.coefficients[channel * n_harmonics]);
    }
    for i in 0..3 * (n_harmonics - 1) {
        let (channel, harmonic) = (i / (n_harmonics - 1), 1 + i % (n_harmonics - 1));
        add(rest_column(i), &|trained| trained.coefficients[channel * n_harmonics + harmonic]);
    }
    let logit = |opacity: f32| (opacity / (1.0 - opacity)).ln();
    add("opacity".into(), &|trained| logit(trained.gaussian.opacity));
    for axis in 0..3 {
        add(format!("scale_{axis}"), &|trained| trained.gaussian.deviations[axis].ln());
    }
    for (i, axis) in [3, 0, 1, 2].into_iter().enumerate() {
        // Files need no unit rotations.
        add(format!("rot_{i}"), &|trained| 3.0 * trained.gaussian.rotation.to_array()[axis]);
    }
    cloud.normals = Some(vec![Vec3::Z; all.len()]);
    cloud.radii = Some(vec![1.0; all.len()]);
    let mut geometry = scenes::grey(cloud);
    geometry.surface = SurfaceKind::Gaussian;
    geometry
}

fn graph_of(all: &[Trained]) -> FlatScene {
    flat(scenes::graph(vec![(Geometry::Points(cloud(all)), Material::MATTE)]))
}

/// Returns the light along rays, which must be the same at all SIMD levels.
fn lights(scene: &FlatScene, rays: &[Ray]) -> Vec<GaussianLight> {
    let all = Simd::available().into_iter().map(|simd| {
        let mut lights = vec![GaussianLight::NONE; rays.len()];
        trace::scene_gaussians(scene, simd, rays, &mut lights);
        lights
    });
    let all: Vec<_> = all.collect();
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
    all.into_iter().next().unwrap()
}

/// Returns Gaussians of all shapes in a ball of radius 1, with harmonics of degree 3.
fn random_gaussians(n: usize, seed: u64) -> Vec<Trained> {
    let mut random = Random::new(seed, 0);
    let mut number = move || random.next_gaussian() as f32;
    let gaussian = |_| {
        let rotation = Quat::from_xyzw(number(), number(), number(), number()).normalize();
        let center = 0.5 * Vec3::new(number(), number(), number());
        let deviations = 0.05 * Vec3::new(number(), number(), number()).exp();
        let opacity = 1.0 / (1.0 + number().exp());
        let coefficients = (0..48).map(|i| if i % 16 == 0 { number() } else { 0.3 * number() });
        let coefficients = coefficients.collect();
        Trained { gaussian: Gaussian { center, rotation, deviations, opacity }, coefficients }
    };
    (0..n).map(gaussian).collect()
}

/// Composites all Gaussians along a ray in the order of their distances, in double precision, and returns the encoded
/// colour and the transmittance.
fn composite_all(all: &[Trained], ray: &Ray) -> (DVec3, f64) {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut layers = Vec::new();
    for Trained { gaussian, coefficients } in all {
        let to_local = |vector: DVec3| {
            gaussian.rotation.as_dquat().inverse() * vector / gaussian.deviations.as_dvec3()
        };
        let offset = gaussian.rotation.as_dquat().inverse() * (origin - gaussian.center.as_dvec3())
            / gaussian.deviations.as_dvec3();
        let along = to_local(direction);
        let distance = -offset.dot(along) / along.length_squared();
        let squared = offset.cross(along).length_squared() / along.length_squared();
        let alpha = (f64::from(gaussian.opacity) * (-0.5 * squared).exp()).min(0.99);
        let is_in_range = (f64::from(ray.t_min)..=f64::from(ray.t_max)).contains(&distance);
        if 1.0 / 255.0 <= alpha && is_in_range {
            let basis = spherical_harmonics(ray.direction);
            let channel = |channel: usize| {
                let own = coefficients[channel * 16..][..16].iter().zip(basis);
                own.map(|(value, basis)| f64::from(value * basis)).sum::<f64>() + 0.5
            };
            let color = DVec3::new(channel(0), channel(1), channel(2)).max(DVec3::ZERO);
            layers.push((distance, alpha, color));
        }
    }
    layers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut encoded, mut transmittance) = (DVec3::ZERO, 1.0);
    for (_, alpha, color) in layers {
        encoded += transmittance * alpha * color;
        transmittance *= 1.0 - alpha;
        if transmittance < 1e-3 {
            // What is left counts as nothing.
            return (encoded / (1.0 - transmittance), 0.0);
        }
    }
    (encoded, transmittance)
}

#[test]
fn light_equals_that_of_all_gaussians_sorted_and_composited() {
    for (n, seed) in [(1, 1), (7, 2), (60, 3), (3000, 4)] {
        let all = random_gaussians(n, seed);
        let scene = graph_of(&all);
        let rays = scenes::random_rays(1500, 1.0, seed);
        let mut n_passed = 0;
        for (ray, light) in rays.iter().zip(lights(&scene, &rays)) {
            let (encoded, transmittance) = composite_all(&all, ray);
            let difference = (f64::from(light.transmittance) - transmittance).abs();
            assert!(difference < 2e-3, "{n}: {transmittance} {light:?}");
            let alpha = 1.0 - transmittance;
            if alpha < 0.02 {
                continue;
            }
            n_passed += 1;
            let color = (encoded / alpha).as_vec3().map(decode_srgb);
            let difference = alpha as f32 * (light.color() - color).abs().max_element();
            assert!(difference < 4e-3 * color.max_element().max(1.0), "{n}: {color} {light:?}");
        }
        assert!(n < 60 || 1000 < n_passed, "{n}: {n_passed}");
    }
}

#[test]
fn a_round_gaussian_has_the_profile_of_its_closed_form() {
    let scene = graph_of(&[round(Vec3::ZERO, 0.5, 0.8, [0.2, 0.6, 0.9])]);
    for distance in [3.0, 100.0, 1e4] {
        for across in [0.0, 0.1, 0.4, 0.7, 1.2, 1.5] {
            let origin = Vec3::new(across, 0.0, distance);
            let light = lights(&scene, &[Ray::new(origin, -Vec3::Z)])[0];
            let expected = 0.8 * (-0.5 * (across / 0.5) * (across / 0.5)).exp();
            assert!((1.0 - light.transmittance - expected).abs() < 1e-4, "{across} {light:?}");
            let color = light.color() - Vec3::new(0.2, 0.6, 0.9).map(decode_srgb);
            assert!(color.abs().max_element() < 2e-3, "{color}");
        }
        // The alpha is below 1/255.
        let origin = Vec3::new(1.65, 0.0, distance);
        assert_eq!(lights(&scene, &[Ray::new(origin, -Vec3::Z)])[0], GaussianLight::NONE);
    }
}

#[test]
fn a_dipole_shows_another_colour_on_each_side() {
    let mut coefficients = vec![0.0; 12];
    // The fourth harmonic of the first channel is -x: rays along +x see more of it.
    coefficients[3] = -0.5;
    let gaussian = round(Vec3::ZERO, 0.1, 0.95, [0.5; 3]).gaussian;
    let scene = graph_of(&[Trained { gaussian, coefficients }]);
    let along =
        |direction: Vec3| lights(&scene, &[Ray::new(-5.0 * direction, direction)])[0].color();
    let amplitude = 0.5 * 0.488_602_5;
    let expected =
        |x: f32| Vec3::new(decode_srgb(0.5 + amplitude * x), decode_srgb(0.5), decode_srgb(0.5));
    for direction in [Vec3::X, -Vec3::X, Vec3::Y, Vec3::new(0.6, 0.0, 0.8)] {
        let difference = (along(direction) - expected(direction.x)).abs().max_element();
        assert!(difference < 1e-3, "{direction} {}", along(direction));
    }
}

#[test]
fn an_instance_turns_ellipsoids_and_colours() {
    let all = random_gaussians(300, 7);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.7).normalize(), 1.3);
    let matrix = DAffine3::from_scale_rotation_translation(
        DVec3::splat(2.5),
        turn,
        DVec3::new(3.0, -1.0, 0.5),
    );
    let graph = scenes::graph(vec![(Geometry::Points(cloud(&all)), Material::MATTE)]);
    let mut placed = graph.clone();
    placed.nodes = vec![scenes::node(0, 0, matrix)];
    let (original, placed) = (flat(graph), flat(placed));
    let rays = scenes::random_rays(1000, 1.0, 8);
    let moved: Vec<Ray> = rays
        .iter()
        .map(|ray| {
            let origin = matrix.transform_point3(ray.origin.as_dvec3()) - placed.origin;
            let direction = (turn * ray.direction.as_dvec3()).as_vec3();
            let (t_min, t_max) = (2.5 * ray.t_min, 2.5 * ray.t_max);
            Ray { origin: origin.as_vec3(), direction, t_min, t_max }
        })
        .collect();
    let pairs = lights(&original, &rays).into_iter().zip(lights(&placed, &moved));
    let mut n_seen = 0;
    for (a, b) in pairs {
        n_seen += usize::from(a.transmittance < 0.9);
        assert!((a.transmittance - b.transmittance).abs() < 2e-3, "{a:?} {b:?}");
        assert!((a.radiance() - b.radiance()).abs().max_element() < 4e-3, "{a:?} {b:?}");
    }
    assert!(300 < n_seen, "{n_seen}");
}

#[test]
fn overlapping_instances_are_composited_in_one_order() {
    let all = random_gaussians(400, 9);
    let parts = [0, 1].map(|part| {
        let own = all.iter().enumerate().filter(|(i, _)| i % 2 == part);
        let own = own.map(|(_, Trained { gaussian, coefficients })| Trained {
            gaussian: *gaussian,
            coefficients: coefficients.clone(),
        });
        own.collect::<Vec<_>>()
    });
    let of_parts = parts.iter().map(|part| (Geometry::Points(cloud(part)), Material::MATTE));
    let (together, apart) = (graph_of(&all), flat(scenes::graph(of_parts.collect())));
    let rays = scenes::random_rays(1000, 1.0, 10);
    for (a, b) in lights(&together, &rays).into_iter().zip(lights(&apart, &rays)) {
        assert!((a.transmittance - b.transmittance).abs() < 1e-6, "{a:?} {b:?}");
        assert!((a.radiance() - b.radiance()).abs().max_element() < 1e-4, "{a:?} {b:?}");
    }
}

const SETTINGS: Settings = Settings {
    width: 33,
    height: 33,
    samples_per_pixel: 1,
    noise_threshold: 0.0,
    light_samples: 1,
    max_depth: 2,
    seed: 0,
    point_size: 1.0,
    with_aovs: true,
};

/// Returns a scene of Gaussians and meshes, seen from 10 above, whose middle pixel sees the origin.
fn scene_with(all: &[Trained], meshes: Vec<(Mesh, Material)>, lights: Vec<Light>) -> Scene {
    let meshes = meshes.into_iter().map(|(mesh, material)| (Geometry::Triangles(mesh), material));
    let things = [(Geometry::Points(cloud(all)), Material::MATTE)].into_iter().chain(meshes);
    let graph = scenes::graph(things.collect());
    let (background, camera) = (Background::Transparent, scenes::from_above(6.0));
    Scene { graph, lights, background, camera }
}

fn wall(height: f32, color: [f32; 3]) -> (Mesh, Material) {
    let quad = scenes::quad(height * Vec3::Z, 4.0 * Vec3::X, 4.0 * Vec3::Y);
    (quad, Material { base_color: Vec3::from_array(color), ..Material::UNLIT })
}

fn middle(scene: &Scene) -> [f32; 4] {
    let pixels = scenes::render(scene, &SETTINGS).color;
    pixels[pixels.len() / 2]
}

#[test]
fn surfaces_hide_gaussians_and_show_through_them() {
    let all = [round(Vec3::ZERO, 0.8, 0.6, [0.5, 0.25, 1.0])];
    let own = Vec3::new(0.5, 0.25, 1.0).map(decode_srgb);
    // Alone: alpha is that of the Gaussian.
    let [r, g, b, alpha] = middle(&scene_with(&all, vec![], vec![]));
    assert!((alpha - 0.6).abs() < 1e-3, "{alpha}");
    assert!((Vec3::new(r, g, b) - 0.6 * own).abs().max_element() < 2e-3);
    let red = [1.0, 0.0, 0.0];
    let [r, g, b, alpha] = middle(&scene_with(&all, vec![wall(-2.0, red)], vec![]));
    let expected = 0.6 * own + 0.4 * Vec3::X;
    assert!((alpha - 1.0).abs() < 1e-5, "{alpha}");
    assert!((Vec3::new(r, g, b) - expected).abs().max_element() < 2e-3, "{r} {g} {b}");
    assert_eq!(middle(&scene_with(&all, vec![wall(2.0, red)], vec![])), [1.0, 0.0, 0.0, 1.0]);
}

#[test]
fn opaque_gaussians_show_the_trained_colour_exactly() {
    let color = [0.8, 100.0 / 255.0, 30.0 / 255.0];
    let all: Vec<Trained> =
        (0..4).map(|i| round(0.1 * i as f32 * Vec3::Z, 1.0, 0.989, color)).collect();
    // Lights do not change it.
    let sun = Sun { direction: Vec3::Z, color: Vec3::splat(3.0), angular_diameter_deg: 0.0 };
    let found = middle(&scene_with(&all, vec![], vec![Light::Sun(sun)]));
    assert_eq!(found.map(encode_srgb8), [204, 100, 30, 255]);
}

#[test]
fn mirrors_show_gaussians() {
    let all = [round(2.0 * Vec3::Z, 0.2, 0.9, [0.0, 1.0, 0.0])];
    // The mirror at the origin turns the view from above to +X.
    let tilted = scenes::quad(Vec3::ZERO, Vec3::Y, Vec3::new(1.0, 0.0, -1.0));
    let mirror =
        Material { metallic: 1.0, roughness: 0.0, base_color: Vec3::ONE, ..Material::MATTE };
    let moved = [round(3.0 * Vec3::X, 0.2, 0.9, [0.0, 1.0, 0.0])];
    for (all, is_seen) in
        [(&moved, true), (&[round(-3.0 * Vec3::X, 0.2, 0.9, [0.0, 1.0, 0.0])], false)]
    {
        let scene = scene_with(all, vec![(tilted.clone(), mirror.clone())], vec![]);
        let green = middle(&scene)[1];
        assert_eq!(0.7 < green, is_seen, "{green}");
    }
    assert!(0.8 < middle(&scene_with(&all, vec![(tilted, mirror)], vec![]))[1]);
}

#[test]
fn gaussians_cast_shadows_by_their_transmittance() {
    let floor = scenes::floor(-1.0, 4.0);
    let material = Material { base_color: Vec3::ONE, ..Material::MATTE };
    let direction = Vec3::new(1.0, 0.0, 1.0).normalize();
    let sun = Light::Sun(Sun { direction, color: Vec3::ONE, angular_diameter_deg: 0.0 });
    // On the way from the floor below the origin to the sun.
    let light_of = |opacity: f32| {
        let all = [round(Vec3::new(2.0, 0.0, 1.0), 0.2, opacity, [0.5; 3])];
        middle(&scene_with(&all, vec![(floor.clone(), material.clone())], vec![sun.clone()]))[0]
    };
    let without = light_of(0.003);
    assert!(0.3 < without);
    for opacity in [0.2, 0.7, 0.9] {
        assert!((light_of(opacity) / without - (1.0 - opacity)).abs() < 5e-3, "{opacity}");
    }
}

#[test]
fn layers_and_queries_hold_the_place_of_half_transmittance() {
    let thin = |height: f32, opacity: f32| {
        let mut trained = round(height * Vec3::Z, 0.5, opacity, [0.5; 3]);
        trained.gaussian.deviations.z = 0.01;
        trained.gaussian.rotation = Quat::from_rotation_y(0.3);
        trained
    };
    let all = [thin(1.0, 0.3), thin(0.5, 0.4), thin(0.0, 0.9)];
    let scene = scene_with(&all, vec![], vec![]);
    let image = scenes::render(&scene, &SETTINGS);
    let (aovs, center) = (image.aovs.unwrap(), image.color.len() / 2);
    assert!((aovs.depth[center] - 9.5).abs() < 0.01, "{}", aovs.depth[center]);
    assert_eq!(aovs.point_id[center], 1);
    let normal = Quat::from_rotation_y(0.3) * Vec3::Z;
    assert!(aovs.normal[center].distance(normal) < 1e-3, "{}", aovs.normal[center]);
    let transmittance = 0.7 * 0.6 * 0.1;
    assert!((image.coverage[center] - (1.0 - transmittance)).abs() < 1e-3);
    let scene = graph_of(&all[..1]);
    let down = [Ray::new(4.0 * Vec3::Z, -Vec3::Z)];
    assert!(hits(&scene, InstanceFilter::All, &down)[0].is_miss());
    assert_eq!(occlusions(&scene, InstanceFilter::All, &down), [false]);
    let scene = graph_of(&all);
    assert_eq!(hits(&scene, InstanceFilter::All, &down)[0].id, 1);
    assert!(hits(&scene, InstanceFilter::Surfaces, &down)[0].is_miss());
    assert_eq!(occlusions(&scene, InstanceFilter::All, &down), [true]);
    assert_eq!(occlusions(&scene, InstanceFilter::Opaque, &down), [false]);
}

#[test]
fn faint_and_broken_gaussians_are_left_out() {
    let mut all = random_gaussians(20, 12);
    all[3].gaussian.opacity = 0.003;
    let mut geometry = cloud(&all).cloud().clone().into_inner();
    if let Some(Values::F32(values)) = geometry
        .scalars
        .iter_mut()
        .find(|column| column.name == "scale_1")
        .map(|own| &mut own.values)
    {
        values[5] = f32::NAN;
    }
    let columns = GaussianColumns::new(&geometry).unwrap();
    assert!(columns.gaussian(5).is_none() && columns.gaussian(3).is_some());
    let mut broken = scenes::grey(geometry);
    broken.surface = SurfaceKind::Gaussian;
    let scene = flat(scenes::graph(vec![(Geometry::Points(broken), Material::MATTE)]));
    let mut ids = scene.clouds().next().unwrap().gaussians.ids().to_vec();
    ids.retain(|id| *id != surfel_core::bvh::NO_PRIMITIVE);
    ids.sort_unstable();
    assert_eq!(ids, (0..20).filter(|id| ![3, 5].contains(id)).collect::<Vec<u32>>());
}

#[test]
fn clouds_without_the_columns_are_refused() {
    let mut plain = scenes::points(surfel_tests::clouds::sphere(50, 1.0), SurfaceKind::Disc);
    plain.surface = SurfaceKind::Gaussian;
    let error = surfel_core::flat::FlatCloud::new(&plain, &surfel_core::progress::NoProgress);
    assert!(error.unwrap_err().to_string().contains("trained Gaussians"));
}
