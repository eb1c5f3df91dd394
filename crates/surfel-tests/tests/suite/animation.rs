//! Animation: tracks drive nodes, targets and joints deform meshes, and an updated scene equals a rebuilt one.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;
use surfel_core::flat::{FlatGeometry, FlatScene};
use surfel_core::image::Image;
use surfel_core::math::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    Animation, Background, Camera, Channel, Geometry, Graph, Interpolation, Joint, Keyframes,
    Light, Material, Mesh, Morph, Node, Primitive, Projection, PunctualLight, PunctualLightKind,
    Scene, Skin, Sky, Track, Transform,
};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::Simd;
use surfel_tests::clouds;
use surfel_tests::scenes;

const SETTINGS: Settings = Settings {
    width: 48,
    height: 40,
    samples_per_pixel: 2,
    noise_threshold: 0.0,
    light_samples: 4,
    max_depth: 6,
    seed: 5,
    point_size: 1.0,
    with_aovs: true,
};

fn keys<T>(times_secs: &[f64], values: Vec<T>, interpolation: Interpolation) -> Keyframes<T> {
    Keyframes { times_secs: times_secs.to_vec(), values, interpolation }
}

fn channel(node: usize, track: Track) -> Channel {
    Channel { node, track }
}

fn matrix_at(graph: &Graph, node: usize) -> DAffine3 {
    graph.world_from_nodes()[node]
}

#[test]
fn tracks_drive_nodes() {
    let mut graph = Graph { nodes: vec![Node::new("arm"), Node::new("hand")], ..Graph::default() };
    graph.nodes[1].parent = Some(0);
    // A track decomposes this matrix.
    graph.nodes[0].transform = Transform::Matrix(DAffine3::from_scale_rotation_translation(
        DVec3::splat(2.0),
        DQuat::from_rotation_x(1.0),
        DVec3::Y,
    ));
    let turns = [0.0, FRAC_PI_2].map(DQuat::from_rotation_z).to_vec();
    let spline = [0.0, 0.0, 1.0, -2.0, 3.0, 0.0].map(|x| x * DVec3::X).to_vec();
    let scales = [1.0, 4.0, 9.0].map(DVec3::splat).to_vec();
    graph.animation = Animation {
        channels: vec![
            channel(0, Track::Rotation(keys(&[1.0, 3.0], turns, Interpolation::Ease))),
            channel(1, Track::Translation(keys(&[0.0, 4.0], spline, Interpolation::Cubic))),
            channel(1, Track::Scale(keys(&[0.0, 1.0, 2.0], scales, Interpolation::Step))),
            channel(1, Track::Visible(keys(&[0.0, 2.5], vec![true, false], Interpolation::Step))),
        ],
    };
    assert_eq!(graph.animation.duration_secs(), 4.0);
    for (time_secs, angle, scale, is_visible) in [
        (-1.0, 0.0, 1.0, true),
        (0.5, 0.0, 1.0, true),
        // A quarter of the time: 3/16 - 2/64 of the turn.
        (1.5, FRAC_PI_2 * 0.15625, 4.0, true),
        (2.0, FRAC_PI_2 * 0.5, 9.0, true),
        (2.5, FRAC_PI_2 * 0.84375, 9.0, false),
        (7.0, FRAC_PI_2, 9.0, false),
    ] {
        graph.evaluate_at(time_secs);
        // Hermite from 0, leaving at 1 a second, to 3, reached at -2 a second, over 4 seconds.
        let t = (time_secs / 4.0).clamp(0.0, 1.0);
        let x = 4.0 * (t.powi(3) - 2.0 * t * t + t) + 3.0 * (3.0 * t * t - 2.0 * t.powi(3))
            - 8.0 * (t.powi(3) - t * t);
        let arm = DAffine3::from_scale_rotation_translation(
            DVec3::splat(2.0),
            DQuat::from_rotation_z(angle),
            DVec3::Y,
        );
        let hand =
            DAffine3::from_translation(x * DVec3::X) * DAffine3::from_scale(DVec3::splat(scale));
        let (found, expected) = (matrix_at(&graph, 1), arm * hand);
        assert!(found.abs_diff_eq(expected, 1e-9), "{found:?} {expected:?} at {time_secs}");
        assert_eq!(graph.visible_nodes(), [true, is_visible]);
    }
}

/// Returns an upright strip of quads from z = 0 to 2.
fn strip() -> Mesh {
    let n = 16;
    let position = |i: u32| Vec3::new((i % 2) as f32 - 0.5, 0.0, 2.0 * (i / 2) as f32 / n as f32);
    Mesh {
        positions: (0..2 * n + 2).map(position).collect(),
        triangles: (0..n)
            .flat_map(|i| [[0, 1, 3], [0, 3, 2]].map(|corners| corners.map(|c| 2 * i + c)))
            .collect(),
        normals: Some(vec![-Vec3::Y; 2 * n as usize + 2]),
        tangents: Some(vec![Vec3::Z.extend(-1.0); 2 * n as usize + 2]),
        ..Mesh::default()
    }
}

/// Returns the deformed positions of all vertices of a flat mesh that triangles use.
fn deformed_positions(scene: &FlatScene, geometry: usize) -> Vec<Vec3> {
    let FlatGeometry::Mesh(mesh) = &*scene.geometries[geometry] else { panic!("no mesh") };
    let n = mesh.vertex_indices.as_flattened().iter().max().unwrap() + 1;
    let mut positions = vec![Vec3::NAN; n as usize];
    for slot in mesh.triangles.slots() {
        let vertices = mesh.vertex_indices[mesh.triangles.id(slot) as usize];
        for (vertex, position) in vertices.into_iter().zip(mesh.triangles.triangle(slot)) {
            positions[vertex as usize] = position;
        }
    }
    positions
}

fn deformed_normals(scene: &FlatScene, geometry: usize) -> &[Vec3] {
    let FlatGeometry::Mesh(mesh) = &*scene.geometries[geometry] else { panic!("no mesh") };
    &mesh.normals
}

fn deformed_tangents(scene: &FlatScene, geometry: usize) -> &[Vec4] {
    let FlatGeometry::Mesh(mesh) = &*scene.geometries[geometry] else { panic!("no mesh") };
    &mesh.tangents
}

fn scene_of(graph: Graph) -> Scene {
    let camera = Camera {
        position: DVec3::new(1.0, -7.0, 3.0),
        focal_point: DVec3::Z,
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle_deg: 40.0 },
    };
    let sky = Sky { up: Vec3::Z, zenith: Vec3::ONE, ground: Vec3::splat(0.3), ao_distance: 2.0 };
    let lights = vec![Light::Sky(sky), Light::Headlight(0.5)];
    Scene { graph, lights, background: Background::Transparent, camera }
}

#[test]
fn morph_targets_add_up_by_their_weights() {
    let plain = strip();
    let n = plain.positions.len();
    let bulge: Vec<Vec3> = plain.positions.iter().map(|p| -p.z * Vec3::Y).collect();
    let lean = vec![0.5 * Vec3::X; n];
    let normals = vec![Vec3::Z; n];
    let morphs = vec![
        Morph { positions: bulge.clone(), normals: Some(normals), ..Morph::default() },
        Morph { positions: lean.clone(), ..Morph::default() },
    ];
    let mut graph = Graph::from_geometry(
        Geometry::Triangles(Mesh { morphs, ..plain.clone() }),
        Material::MATTE,
    );
    for weights in [vec![0.5, 2.0], vec![-1.0, 0.0], vec![0.0, 0.0], vec![1.0]] {
        graph.nodes[0].morph_weights = weights.clone();
        let scene = FlatScene::new(&scene_of(graph.clone()), &NoProgress).unwrap();
        let weight = |i: usize| weights.get(i).copied().unwrap_or(0.0);
        for (i, position) in deformed_positions(&scene, 0).into_iter().enumerate() {
            let expected = plain.positions[i] + weight(0) * bulge[i] + weight(1) * lean[i];
            assert!(position.distance(expected) < 1e-6, "{weights:?}, vertex {i}");
            let normal = (weight(0) * Vec3::Z - Vec3::Y).normalize();
            assert!(
                deformed_normals(&scene, 0)[i].distance(normal) < 1e-6,
                "{weights:?}, vertex {i}"
            );
        }
    }
}

#[test]
fn tangents_morph_and_keep_their_sign() {
    let plain = strip();
    let turn = vec![Vec3::X; plain.positions.len()];
    let target = Morph {
        positions: vec![Vec3::ZERO; plain.positions.len()],
        tangents: Some(turn),
        ..Morph::default()
    };
    let mesh = Mesh { morphs: vec![target], ..plain };
    let mut graph = Graph::from_geometry(Geometry::Triangles(mesh), Material::MATTE);
    graph.nodes[0].morph_weights = vec![0.0];
    let mut flat = FlatScene::new(&scene_of(graph.clone()), &NoProgress).unwrap();
    for weight in [1.0, 0.5, 0.0] {
        graph.nodes[0].morph_weights = vec![weight];
        flat.update(&graph, &NoProgress).unwrap();
        let expected = (Vec3::Z + weight * Vec3::X).normalize().extend(-1.0);
        let tangents = deformed_tangents(&flat, 0);
        assert!(tangents.iter().all(|tangent| tangent.distance(expected) < 1e-6), "{weight}");
    }
}

/// Returns the strip with two joints, one at its foot and one in its middle.
fn skinned() -> Graph {
    let mut mesh = strip();
    let weight = |z: f32| (z - 0.5).clamp(0.0, 1.0);
    mesh.skin = Some(Skin {
        joints: vec![[0, 1, 0, 0]; mesh.positions.len()],
        weights: mesh
            .positions
            .iter()
            .map(|p| [1.0 - weight(p.z), weight(p.z), 0.0, 0.0])
            .collect(),
    });
    let mut graph = Graph::from_geometry(Geometry::Triangles(mesh), Material::MATTE);
    let foot = Node::new("foot");
    let mut knee = Node { parent: Some(1), ..Node::new("knee") };
    knee.transform =
        Transform::Trs { translation: DVec3::Z, rotation: DQuat::IDENTITY, scale: DVec3::ONE };
    graph.nodes.extend([foot, knee]);
    graph.nodes[0].joints = vec![
        Joint { node: 1, joint_from_mesh: DAffine3::IDENTITY },
        Joint { node: 2, joint_from_mesh: DAffine3::from_translation(-DVec3::Z) },
    ];
    graph
}

#[test]
fn joints_move_vertices_by_their_weights() {
    let mut graph = skinned();
    let plain = strip();
    // At rest no vertex moves, whatever the transform of the mesh's own node.
    for position in [DVec3::ZERO, DVec3::new(3.0, 1.0, -2.0)] {
        graph.nodes[0].transform = Transform::Matrix(DAffine3::from_translation(position));
        let scene = FlatScene::new(&scene_of(graph.clone()), &NoProgress).unwrap();
        for (found, at_rest) in deformed_positions(&scene, 0).iter().zip(&plain.positions) {
            let found = scene.instances[0].world_position(*found) + scene.origin.as_vec3();
            assert!(found.distance(*at_rest) < 1e-5, "{found} {at_rest}");
        }
    }
    graph.nodes[0].transform = Transform::IDENTITY;
    let (turn, shift) = (DQuat::from_rotation_x(0.8), DVec3::new(0.5, 0.0, 0.2));
    graph.nodes[1].transform = Transform::Matrix(DAffine3::from_translation(shift));
    graph.nodes[2].transform =
        Transform::Matrix(DAffine3::from_rotation_translation(turn, DVec3::Z));
    let scene = FlatScene::new(&scene_of(graph), &NoProgress).unwrap();
    for (i, found) in deformed_positions(&scene, 0).into_iter().enumerate() {
        let position = plain.positions[i].as_dvec3();
        let weight = (position.z - 0.5).clamp(0.0, 1.0);
        // The knee rotates this part.
        let by_knee = shift + DVec3::Z + turn * (position - DVec3::Z);
        let expected = (1.0 - weight) * (shift + position) + weight * by_knee;
        assert!(found.as_dvec3().distance(expected) < 1e-6, "vertex {i}");
        let normal = (-DVec3::Y).lerp(turn * -DVec3::Y, weight).normalize();
        assert!(deformed_normals(&scene, 0)[i].as_dvec3().distance(normal) < 1e-6, "vertex {i}");
    }
}

#[test]
fn tangents_deform_with_their_mesh() {
    let mut graph = skinned();
    let mut updated = FlatScene::new(&scene_of(graph.clone()), &NoProgress).unwrap();
    let turn = DQuat::from_rotation_x(0.8);
    graph.nodes[2].transform =
        Transform::Matrix(DAffine3::from_rotation_translation(turn, DVec3::Z));
    updated.update(&graph, &NoProgress).unwrap();
    let rebuilt = FlatScene::new(&scene_of(graph), &NoProgress).unwrap();
    for scene in [updated, rebuilt] {
        for (tangent, position) in deformed_tangents(&scene, 0).iter().zip(strip().positions) {
            let weight = f64::from((position.z - 0.5).clamp(0.0, 1.0));
            let expected = DVec3::Z.lerp(turn * DVec3::Z, weight).normalize().as_vec3();
            assert!(tangent.distance(expected.extend(-1.0)) < 1e-6, "{tangent} at {position}");
        }
    }
}

#[test]
fn a_mesh_is_deformed_only_for_a_new_pose() {
    let mut graph = skinned();
    let mut flat = FlatScene::new(&scene_of(graph.clone()), &NoProgress).unwrap();
    let FlatGeometry::Mesh(mesh) = Arc::make_mut(&mut flat.geometries[0]) else {
        panic!("no mesh")
    };
    // These normals stay as long as the mesh is not deformed again.
    mesh.normals.fill(Vec3::ONE);
    flat.update(&graph, &NoProgress).unwrap();
    assert!(deformed_normals(&flat, 0).iter().all(|normal| *normal == Vec3::ONE));
    graph.nodes[2].transform = Transform::Matrix(DAffine3::from_rotation_x(0.1));
    flat.update(&graph, &NoProgress).unwrap();
    assert!(deformed_normals(&flat, 0).iter().all(|normal| *normal != Vec3::ONE));
}

/// Returns a graph of all kinds of geometry and material, in which all but the floor moves.
fn animated_graph() -> Graph {
    let painted = |x, y, z| Material { base_color: Vec3::new(x, y, z), ..Material::MATTE };
    let ball = Geometry::Triangles(scenes::uv_sphere(12, 24, 0.5));
    let cloud = Geometry::Points(scenes::points(clouds::sphere(800, 0.5), SurfaceKind::Splat));
    let mut graph = scenes::graph(vec![
        (Geometry::Triangles(scenes::floor(0.0, 3.0)), painted(0.8, 0.7, 0.6)),
        (ball, Material::GLASS),
        (cloud, Material { roughness: 0.3, ..Material::METAL }),
    ]);
    let skinned_at = graph.append(skinned());
    let plain = strip();
    let lean = plain.positions.iter().map(|p| p.z * Vec3::X).collect();
    let lean = Morph { positions: lean, ..Morph::default() };
    let morphed = Mesh { morphs: vec![lean], ..plain };
    let morphed_at =
        graph.append(Graph::from_geometry(Geometry::Triangles(morphed), painted(0.2, 0.9, 0.3)));
    graph.nodes[morphed_at].morph_weights = vec![0.0];
    let moved_to = |x: f64, y: f64| Transform::Trs {
        translation: DVec3::new(x, y, 0.0),
        rotation: DQuat::IDENTITY,
        scale: DVec3::ONE,
    };
    graph.nodes[morphed_at].transform = moved_to(1.5, 0.5);
    graph.nodes[skinned_at + 1].transform = moved_to(-1.5, 0.5);
    let light = PunctualLight {
        kind: PunctualLightKind::Point,
        color: Vec3::splat(20.0),
        range: f32::INFINITY,
        radius: 0.2,
    };
    let lamp_at = graph.nodes.len();
    graph.nodes.push(Node { light: Some(light), ..Node::new("light") });
    // This second instance of the cloud is a child of the glass ball.
    graph.nodes.push(Node {
        parent: Some(1),
        primitives: vec![Primitive { geometry: 2, material: 3 }],
        transform: moved_to(0.0, 1.2),
        ..Node::new("rider")
    });
    let along = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let turn = |angle: f64| DQuat::from_rotation_x(angle);
    let linear = Interpolation::Linear;
    graph.animation.channels.extend([
        channel(
            1,
            Track::Translation(keys(
                &[0.0, 1.0],
                vec![along(0.0, -1.0, 0.6), along(0.5, -1.5, 1.5)],
                Interpolation::Ease,
            )),
        ),
        channel(
            1,
            Track::Rotation(keys(
                &[0.0, 1.0],
                vec![DQuat::IDENTITY, DQuat::from_rotation_z(2.0)],
                linear,
            )),
        ),
        channel(
            2,
            Track::Translation(keys(
                &[0.0, 1.0],
                vec![along(-0.3, 1.0, 0.6), along(0.0, 1.5, 1.9)],
                linear,
            )),
        ),
        channel(2, Track::Scale(keys(&[0.0, 1.0], vec![DVec3::ONE, along(1.5, 1.0, 0.7)], linear))),
        channel(
            skinned_at + 2,
            Track::Rotation(keys(&[0.0, 1.0], vec![turn(0.0), turn(1.0)], linear)),
        ),
        channel(
            morphed_at,
            Track::MorphWeights(keys(&[0.0, 1.0], vec![vec![0.0], vec![-1.0]], linear)),
        ),
        channel(
            lamp_at,
            Track::Translation(keys(
                &[0.0, 1.0],
                vec![along(-2.0, -2.0, 4.0), along(2.0, -2.0, 3.0)],
                linear,
            )),
        ),
        channel(
            lamp_at + 1,
            Track::Visible(keys(&[0.0, 0.7], vec![true, false], Interpolation::Step)),
        ),
    ]);
    graph
}

fn render(flat: &FlatScene, simd: Simd) -> Image {
    CpuRenderer { simd }.render(flat, &SETTINGS, &NoProgress).unwrap().0
}

#[test]
fn an_updated_scene_gives_the_picture_of_a_rebuilt_one() {
    let mut graph = animated_graph();
    graph.evaluate_at(0.0);
    let mut flat = FlatScene::new(&scene_of(graph.clone()), &NoProgress).unwrap();
    let mut before = None;
    for time_secs in [0.3, 1.0, 0.6, 0.0] {
        graph.evaluate_at(time_secs);
        flat.update(&graph, &NoProgress).unwrap();
        let rebuilt = FlatScene::new(&scene_of(graph.clone()), &NoProgress).unwrap();
        assert_eq!(flat.origin, rebuilt.origin);
        let picture = render(&flat, Simd::detect());
        assert!(picture == render(&rebuilt, Simd::detect()), "at {time_secs}");
        assert!(Some(&picture) != before.as_ref());
        before = Some(picture);
    }
}

#[test]
fn animated_pictures_do_not_depend_on_threads_or_simd_level() {
    let picture = |n_threads: usize, simd: Simd| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| {
            let mut graph = animated_graph();
            let mut flat = FlatScene::new(&scene_of(graph.clone()), &NoProgress).unwrap();
            graph.evaluate_at(0.4);
            flat.update(&graph, &NoProgress).unwrap();
            render(&flat, simd)
        })
    };
    let reference = picture(1, Simd::PORTABLE);
    for n_threads in [1, 2, 3] {
        for simd in Simd::available() {
            let name = simd.name();
            assert!(picture(n_threads, simd) == reference, "{n_threads} threads, {name}");
        }
    }
}

/// Regression tests of cases that once failed.
mod known {
    use super::*;

    /// The node has no weights when the scene is built: an update is the first to set some.
    #[test]
    fn a_mesh_that_only_an_update_deforms_is_deformed() {
        let plain = strip();
        let shift = vec![Vec3::X; plain.positions.len()];
        let shift = Morph { positions: shift, ..Morph::default() };
        let mesh = Geometry::Triangles(Mesh { morphs: vec![shift], ..plain });
        let mut graph = Graph::from_geometry(mesh, Material::MATTE);
        let mut flat = FlatScene::new(&scene_of(graph.clone()), &NoProgress).unwrap();
        graph.nodes[0].morph_weights = vec![1.0];
        flat.update(&graph, &NoProgress).unwrap();
        let rebuilt = FlatScene::new(&scene_of(graph), &NoProgress).unwrap();
        assert_eq!(flat.instances.len(), 1);
        assert!(render(&flat, Simd::detect()) == render(&rebuilt, Simd::detect()));
    }
}

#[test]
fn a_replaced_geometry_gives_the_picture_of_a_rebuilt_scene() {
    let renderer = CpuRenderer { simd: Simd::detect() };
    let picture = |flat: &FlatScene| renderer.render(flat, &SETTINGS, &NoProgress).unwrap().0;
    let scene = |cloud| scenes::scene(cloud, SurfaceKind::Splat);
    let (before, after) = (scene(clouds::plane(30, 0.1, 1)), scene(clouds::sphere(2000, 1.0)));
    let mut flat = FlatScene::new(&before, &NoProgress).unwrap();
    let first = picture(&flat);
    flat.replace(0, &after.graph.geometries[0], &NoProgress).unwrap();
    flat.update(&after.graph, &NoProgress).unwrap();
    flat.camera = after.camera;
    let expected = picture(&FlatScene::new(&after, &NoProgress).unwrap());
    assert!(picture(&flat) == expected && first != expected);
}
