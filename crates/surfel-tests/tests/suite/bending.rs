//! Clouds that bend: they are seen as clouds are that were written where morph targets and joints take them.

use surfel::flat::{FlatCloud, FlatGeometry, FlatScene};
use surfel::image::Image;
use surfel::math::{DAffine3, DQuat, DVec3, Random, Vec3};
use surfel::points::PointCloud;
use surfel::progress::Silent;
use surfel::render::{CpuRenderer, Renderer, Settings};
use surfel::scene::{
    Geometry, Graph, Joint, Material, Morph, Node, Points, Scene, Skin, Transform,
};
use surfel::surface::SurfaceKind;
use surfel::trace::Simd;
use surfel_tests::{clouds, scenes};

const SETTINGS: Settings = Settings {
    width: 64,
    height: 64,
    samples_per_pixel: 4,
    light_samples: 1,
    max_depth: 2,
    seed: 9,
    with_layers: true,
};

/// A ball.
fn at_rest() -> PointCloud {
    clouds::sphere(3000, 1.0)
}

/// Where the target takes a place: twice as wide, and leaning.
fn stretched(place: Vec3) -> Vec3 {
    Vec3::new(place.x, 2.0 * place.y, place.z + 0.5 * place.y)
}

fn target(cloud: &PointCloud, moved: impl Fn(Vec3) -> Vec3) -> Morph {
    let offsets = cloud.positions.iter().map(|place| moved(*place) - place);
    Morph { positions: offsets.collect(), ..Morph::default() }
}

fn moved(mut cloud: PointCloud, place: impl Fn(Vec3) -> Vec3) -> PointCloud {
    cloud.positions.iter_mut().for_each(|position| *position = place(*position));
    cloud
}

/// Lit from the camera, at a distance from which all of it is seen.
fn scene(points: Points) -> Scene {
    let mut scene = scenes::lit(points);
    scene.camera.position *= 1.5;
    scene
}

fn flat(scene: &Scene) -> FlatScene {
    FlatScene::new(scene, &Silent).unwrap()
}

fn only(flat: &FlatScene) -> &FlatCloud {
    let FlatGeometry::Cloud(cloud) = &*flat.geometries[0] else { panic!("no cloud") };
    cloud
}

fn render(flat: &FlatScene) -> Image {
    CpuRenderer { simd: Simd::detect() }.render(flat, &SETTINGS, &Silent).unwrap().0
}

/// Mean difference of a channel, of a brightness of 1.
fn difference(a: &Image, b: &Image) -> f32 {
    let (a, b) = (a.color.as_flattened(), b.color.as_flattened());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32
}

/// Refitted blocks are as wide as the points have moved apart, and hold them to 1/65536 of that: a picture
/// of them differs at the rims of discs, by much less than what moves.
const REFITTED: f32 = 2e-3;

#[test]
fn morphed_points_are_seen_as_if_written_so() {
    let mut cloud = at_rest();
    // Leave both to the preparation, at rest and where the target takes the points.
    cloud.normals = None;
    for kind in [SurfaceKind::Disc, SurfaceKind::Splat] {
        let morphs = vec![target(&cloud, stretched)];
        let mut bending = scene(scenes::points(PointCloud { morphs, ..cloud.clone() }, kind));
        bending.graph.nodes[0].morph_weights = vec![0.0];
        let mut played = flat(&bending);
        let written = scenes::points(moved(cloud.clone(), stretched), kind);
        let written = render(&flat(&scene(written)));
        assert!(0.05 < difference(&render(&played), &written), "nothing to tell");
        bending.graph.nodes[0].morph_weights = vec![1.0];
        // Built where they are, they have the same tree: only the last bits of r + (s - r) differ from s.
        let anew = render(&flat(&bending));
        assert!(difference(&anew, &written) < 1e-4, "{}", difference(&anew, &written));
        played.update(&bending.graph, &Silent).unwrap();
        let off = difference(&render(&played), &written);
        assert!(off < REFITTED, "{kind:?}: {off}");
    }
}

#[test]
fn columns_of_the_file_change_by_its_targets_alone() {
    let mut cloud = at_rest();
    cloud.radii = Some(vec![0.1; cloud.len()]);
    let shift =
        Morph { normals: Some(vec![Vec3::Z; cloud.len()]), ..target(&cloud, |p| p + Vec3::Y) };
    cloud.morphs = vec![shift.clone()];
    let points = scenes::points(cloud, SurfaceKind::Disc);
    assert_eq!(points.cloud.morphs, [shift]);
    let mut bending = scene(points);
    bending.graph.nodes[0].morph_weights = vec![0.5];
    let bent = flat(&bending);
    let points = &only(&bent).points;
    for slot in points.slots() {
        let at_rest = at_rest().positions[points.id(slot) as usize];
        assert!(points.center(slot).distance(at_rest + 0.5 * Vec3::Y) < 1e-4);
        assert!(points.normal(slot).dot((at_rest + 0.5 * Vec3::Z).normalize_or(Vec3::Z)) > 0.999);
        assert!((points.radius(slot) - 0.1).abs() < 1e-3);
    }
}

/// Two joints at the origin, one for each half of the ball.
fn skinned(kind: SurfaceKind) -> Scene {
    let mut cloud = at_rest();
    let joint_of = |place: &Vec3| [u16::from(0.0 < place.y), 0, 0, 0];
    cloud.skin = Some(Skin {
        joints: cloud.positions.iter().map(joint_of).collect(),
        weights: vec![[1.0, 0.0, 0.0, 0.0]; cloud.len()],
    });
    let mut scene = scene(scenes::points(cloud, kind));
    scene.graph.nodes.extend([Node::new("left"), Node::new("right")]);
    let joint = |node| Joint { node, joint_from_mesh: DAffine3::IDENTITY };
    scene.graph.nodes[0].joints = vec![joint(1), joint(2)];
    scene
}

#[test]
fn joints_carry_points_with_their_normals_and_radii() {
    // The right half grows, turns and goes away.
    let place = DAffine3::from_scale_rotation_translation(
        DVec3::splat(1.5),
        DQuat::from_rotation_x(0.7),
        DVec3::new(0.0, 0.3, 0.2),
    );
    let mut written = scenes::points(at_rest(), SurfaceKind::Disc);
    let cloud = &mut written.cloud;
    for i in (0..cloud.len()).filter(|i| 0.0 < at_rest().positions[*i].y) {
        cloud.positions[i] = place.transform_point3(cloud.positions[i].as_dvec3()).as_vec3();
        let normal = &mut cloud.normals.as_mut().unwrap()[i];
        *normal = (DQuat::from_rotation_x(0.7) * normal.as_dvec3()).as_vec3();
        cloud.radii.as_mut().unwrap()[i] *= 1.5;
    }
    let written = render(&flat(&scene(written)));
    let mut bending = skinned(SurfaceKind::Disc);
    let mut played = flat(&bending);
    assert!(0.05 < difference(&render(&played), &written), "nothing to tell");
    bending.graph.nodes[2].transform = Transform::Matrix(place);
    assert!(difference(&render(&flat(&bending)), &written) < 1e-4);
    let before = only(&played).points.cost;
    played.update(&bending.graph, &Silent).unwrap();
    assert!(difference(&render(&played), &written) < REFITTED);
    assert_eq!(only(&played).points.cost, before, "refitted, not built");
}

/// A target that scatters the points, for which another tree has to be built.
fn scattering() -> Scene {
    let mut cloud = at_rest();
    let mut random = Random::new(77, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    let offsets =
        cloud.positions.iter().map(|_| 0.5 * Vec3::new(gaussian(), gaussian(), gaussian()));
    let positions = offsets.collect();
    cloud.morphs = vec![Morph { positions, ..Morph::default() }];
    let mut scene = scene(scenes::points(cloud, SurfaceKind::Splat));
    scene.graph.nodes[0].morph_weights = vec![0.0];
    scene
}

#[test]
fn a_frame_does_not_depend_on_those_before() {
    let mut bending = scattering();
    let first = flat(&bending);
    let cost = only(&first).points.cost;
    let mut played = first.clone();
    let mut n_built = 0;
    for weight in [0.02, 1.0, 0.04, 1.0, 0.7, 0.02, 0.0] {
        bending.graph.nodes[0].morph_weights = vec![weight];
        played.update(&bending.graph, &Silent).unwrap();
        let points = &only(&played).points;
        n_built += usize::from(points.cost != cost);
        assert_eq!(points.cost != cost, 0.1 < weight, "at {weight} a tree of its own");
        let mut straight = first.clone();
        straight.update(&bending.graph, &Silent).unwrap();
        assert!(render(&played) == render(&straight), "at {weight}");
    }
    assert_eq!(n_built, 3);
    assert!(render(&played) == render(&first));
}

#[test]
fn a_bent_mesh_does_not_depend_on_frames_before() {
    let mut mesh = scenes::uv_sphere(16, 32, 1.0);
    let mut random = Random::new(78, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    let offsets = mesh.positions.iter().map(|_| Vec3::new(gaussian(), gaussian(), gaussian()));
    mesh.morphs = vec![Morph { positions: offsets.collect(), ..Morph::default() }];
    let mut graph = Graph::of(Geometry::Triangles(mesh), Material::MATTE);
    graph.nodes[0].morph_weights = vec![0.0];
    let scene = scene(scenes::points(at_rest(), SurfaceKind::Disc));
    let first = flat(&Scene { graph: graph.clone(), ..scene });
    let tree = |scene: &FlatScene| {
        let FlatGeometry::Mesh(mesh) = &*scene.geometries[0] else { panic!("no mesh") };
        mesh.triangles.clone()
    };
    let mut played = first.clone();
    let mut n_built = 0;
    for weight in [0.02, 1.0, 0.04, 1.0, 0.9, 0.02, 0.0] {
        graph.nodes[0].morph_weights = vec![weight];
        played.update(&graph, &Silent).unwrap();
        let mut straight = first.clone();
        straight.update(&graph, &Silent).unwrap();
        let (played, straight) = (tree(&played), tree(&straight));
        assert!(played.nodes == straight.nodes && played.blocks == straight.blocks, "at {weight}");
        n_built += usize::from(played.cost != tree(&first).cost);
    }
    assert_eq!(n_built, 3);
}

#[test]
fn points_that_part_are_not_taken_for_one() {
    let grid = clouds::plane(60, 0.0, 1);
    let heap = PointCloud::from_positions(vec![Vec3::ZERO; grid.len()]);
    let spread = Morph { positions: grid.positions.clone(), ..Morph::default() };
    let heap = PointCloud { morphs: vec![spread], ..heap };
    let points = scenes::points(heap, SurfaceKind::Disc);
    assert_eq!(points.cloud.len(), grid.len());
    let mut graph = Graph::of(Geometry::Points(points), Material::MATTE);
    graph.nodes[0].morph_weights = vec![1.0];
    let mut spread = scenes::lit(scenes::points(grid.clone(), SurfaceKind::Disc));
    spread.camera = scenes::from_above(3.0);
    let seen = Scene { graph, ..spread.clone() };
    assert!(difference(&render(&flat(&seen)), &render(&flat(&spread))) < REFITTED);
}
