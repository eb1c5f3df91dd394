//! Deformed clouds: they look like clouds whose points were written at the positions to which morph targets and
//! joints move them.

use surfel_core::flat::{FlatCloud, FlatGeometry, FlatScene};
use surfel_core::image::Image;
use surfel_core::math::{DAffine3, DQuat, DVec3, Random, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    CloudGeometry, Geometry, Graph, Joint, Material, Morph, Node, Scene, Skin, Transform,
};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::Simd;
use surfel_tests::clouds;
use surfel_tests::scenes;

const SETTINGS: Settings = Settings {
    width: 64,
    height: 64,
    samples_per_pixel: 4,
    noise_threshold: 0.0,
    light_samples: 1,
    max_depth: 2,
    seed: 9,
    point_size: 1.0,
    with_aovs: true,
};

/// Returns a ball, the undeformed cloud.
fn at_rest() -> PointCloud {
    clouds::sphere(3000, 1.0)
}

/// Returns the position to which the target moves a point: twice as wide, and sheared.
fn stretched(p: Vec3) -> Vec3 {
    Vec3::new(p.x, 2.0 * p.y, p.z + 0.5 * p.y)
}

fn target(cloud: &PointCloud, moved: impl Fn(Vec3) -> Vec3) -> Morph {
    let offsets = cloud.positions.iter().map(|position| moved(*position) - position);
    Morph { positions: offsets.collect(), ..Morph::default() }
}

fn moved(mut cloud: PointCloud, movement: impl Fn(Vec3) -> Vec3) -> PointCloud {
    cloud.positions.iter_mut().for_each(|position| *position = movement(*position));
    cloud
}

/// Returns points lit from the camera, which is far enough away to see all of them.
fn scene(points: CloudGeometry) -> Scene {
    let mut scene = scenes::lit(points);
    scene.camera.position *= 1.5;
    scene
}

fn flat(scene: &Scene) -> FlatScene {
    FlatScene::new(scene, &NoProgress).unwrap()
}

fn only(flat: &FlatScene) -> &FlatCloud {
    let FlatGeometry::Cloud(cloud) = &*flat.geometries[0] else { panic!("no cloud") };
    cloud
}

fn render(flat: &FlatScene) -> Image {
    CpuRenderer { simd: Simd::detect() }.render(flat, &SETTINGS, &NoProgress).unwrap().0
}

/// Returns the mean difference over all channels, in units of brightness.
fn difference(a: &Image, b: &Image) -> f32 {
    let (a, b) = (a.color.as_flattened(), b.color.as_flattened());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32
}

/// The greatest difference that a refitted tree may make.
///
/// Refitted blocks grow as their points move apart, and store positions to 1/65536 of their width. Pictures differ
/// at the rims of discs, by much less than the deformation changes.
const REFITTED: f32 = 2e-3;

#[test]
fn morphed_points_look_like_points_written_there() {
    let mut cloud = at_rest();
    // Preparation estimates normals and radii, both at rest and in the morph target.
    cloud.normals = None;
    for kind in [SurfaceKind::Disc, SurfaceKind::Splat] {
        let morphs = vec![target(&cloud, stretched)];
        let mut deformed = scene(scenes::points(PointCloud { morphs, ..cloud.clone() }, kind));
        deformed.graph.nodes[0].morph_weights = vec![0.0];
        let mut played = flat(&deformed);
        let written = scenes::points(moved(cloud.clone(), stretched), kind);
        let written = render(&flat(&scene(written)));
        assert!(0.05 < difference(&render(&played), &written), "the deformation does not show");
        deformed.graph.nodes[0].morph_weights = vec![1.0];
        // A tree built in this pose is the same: only the last bits of r + (s - r) differ from s.
        let rebuilt = render(&flat(&deformed));
        assert!(difference(&rebuilt, &written) < 1e-4, "{}", difference(&rebuilt, &written));
        played.update(&deformed.graph, &NoProgress).unwrap();
        let off = difference(&render(&played), &written);
        assert!(off < REFITTED, "{kind:?}: {off}");
    }
}

#[test]
fn columns_of_the_file_change_only_by_its_own_targets() {
    let mut cloud = at_rest();
    cloud.radii = Some(vec![0.1; cloud.len()]);
    let shift =
        Morph { normals: Some(vec![Vec3::Z; cloud.len()]), ..target(&cloud, |p| p + Vec3::Y) };
    cloud.morphs = vec![shift.clone()];
    let points = scenes::points(cloud, SurfaceKind::Disc);
    assert_eq!(points.cloud().morphs, [shift]);
    let mut deformed = scene(points);
    deformed.graph.nodes[0].morph_weights = vec![0.5];
    let bent = flat(&deformed);
    let points = &only(&bent).points;
    for slot in points.slots() {
        let at_rest = at_rest().positions[points.id(slot) as usize];
        assert!(points.center(slot).distance(at_rest + 0.5 * Vec3::Y) < 1e-4);
        assert!(points.normal(slot).dot((at_rest + 0.5 * Vec3::Z).normalize_or(Vec3::Z)) > 0.999);
        assert!((points.radius(slot) - 0.1).abs() < 1e-3);
    }
}

/// Returns a scene of the ball with two joints at the origin, one for each half.
fn skinned(kind: SurfaceKind) -> Scene {
    let mut cloud = at_rest();
    let joint_of = |position: &Vec3| [u16::from(0.0 < position.y), 0, 0, 0];
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
fn joints_move_points_with_their_normals_and_radii() {
    // The right half is scaled, rotated and moved away.
    let matrix = DAffine3::from_scale_rotation_translation(
        DVec3::splat(1.5),
        DQuat::from_rotation_x(0.7),
        DVec3::new(0.0, 0.3, 0.2),
    );
    let written = scenes::points(at_rest(), SurfaceKind::Disc);
    let written = scenes::changed(&written, |cloud| {
        for i in (0..cloud.len()).filter(|i| 0.0 < at_rest().positions[*i].y) {
            cloud.positions[i] = matrix.transform_point3(cloud.positions[i].as_dvec3()).as_vec3();
            let normal = &mut cloud.normals.as_mut().unwrap()[i];
            *normal = (DQuat::from_rotation_x(0.7) * normal.as_dvec3()).as_vec3();
            cloud.radii.as_mut().unwrap()[i] *= 1.5;
        }
    });
    let written = render(&flat(&scene(written)));
    let mut deformed = skinned(SurfaceKind::Disc);
    let mut played = flat(&deformed);
    assert!(0.05 < difference(&render(&played), &written), "the deformation does not show");
    deformed.graph.nodes[2].transform = Transform::Matrix(matrix);
    assert!(difference(&render(&flat(&deformed)), &written) < 1e-4);
    let before = only(&played).points.cost;
    played.update(&deformed.graph, &NoProgress).unwrap();
    assert!(difference(&render(&played), &written) < REFITTED);
    assert_eq!(only(&played).points.cost, before, "the tree was rebuilt, not refitted");
}

/// Returns a scene whose morph target scatters the points, so that their tree has to be rebuilt.
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
fn a_frame_of_a_cloud_does_not_depend_on_frames_before() {
    let mut deformed = scattering();
    let first = flat(&deformed);
    let cost = only(&first).points.cost;
    let mut played = first.clone();
    let mut n_built = 0;
    for weight in [0.02, 1.0, 0.04, 1.0, 0.7, 0.02, 0.0] {
        deformed.graph.nodes[0].morph_weights = vec![weight];
        played.update(&deformed.graph, &NoProgress).unwrap();
        let points = &only(&played).points;
        n_built += usize::from(points.cost != cost);
        assert_eq!(points.cost != cost, 0.1 < weight, "whether the tree was rebuilt at {weight}");
        let mut straight = first.clone();
        straight.update(&deformed.graph, &NoProgress).unwrap();
        assert!(render(&played) == render(&straight), "at {weight}");
    }
    assert_eq!(n_built, 3);
    assert!(render(&played) == render(&first));
}

#[test]
fn a_frame_of_a_mesh_does_not_depend_on_frames_before() {
    let mut mesh = scenes::uv_sphere(16, 32, 1.0);
    let mut random = Random::new(78, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    let offsets = mesh.positions.iter().map(|_| Vec3::new(gaussian(), gaussian(), gaussian()));
    mesh.morphs = vec![Morph { positions: offsets.collect(), ..Morph::default() }];
    let mut graph = Graph::from_geometry(Geometry::Triangles(mesh), Material::MATTE);
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
        played.update(&graph, &NoProgress).unwrap();
        let mut straight = first.clone();
        straight.update(&graph, &NoProgress).unwrap();
        let (played, straight) = (tree(&played), tree(&straight));
        assert!(played.nodes == straight.nodes && played.blocks == straight.blocks, "at {weight}");
        n_built += usize::from(played.cost != tree(&first).cost);
    }
    assert_eq!(n_built, 3);
}

#[test]
fn points_that_coincide_only_at_rest_are_kept() {
    let grid = clouds::plane(60, 0.0, 1);
    let heap = PointCloud::from_positions(vec![Vec3::ZERO; grid.len()]);
    let spread = Morph { positions: grid.positions.clone(), ..Morph::default() };
    let heap = PointCloud { morphs: vec![spread], ..heap };
    let points = scenes::points(heap, SurfaceKind::Disc);
    assert_eq!(points.cloud().len(), grid.len());
    let mut graph = Graph::from_geometry(Geometry::Points(points), Material::MATTE);
    graph.nodes[0].morph_weights = vec![1.0];
    let mut spread = scenes::lit(scenes::points(grid.clone(), SurfaceKind::Disc));
    spread.camera = scenes::from_above(3.0);
    let seen = Scene { graph, ..spread.clone() };
    assert!(difference(&render(&flat(&seen)), &render(&flat(&spread))) < REFITTED);
}
