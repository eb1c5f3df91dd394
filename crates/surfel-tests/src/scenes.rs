//! Scenes for tests and benchmarks: prepared clouds, meshes of closed forms, cameras and rays.

use std::f32::consts::{PI, TAU};
use surfel_core::flat::{FlatCloud, FlatScene, PointColumns};
use surfel_core::image::Image;
use surfel_core::math::{DAffine3, DVec3, Quat, Random, Ray, Vec2, Vec3};
use surfel_core::points::{
    GAUSSIAN_COLUMNS, PointCloud, Preparation, PreparedCloud, Scalar, StructureChoice, Values,
    prepare,
};
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    Background, Camera, CloudGeometry, Geometry, Graph, Light, Material, Mesh, Node, Primitive,
    Projection, Scene, Transform,
};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::Simd;

/// The kinds of surface that are the zeros of a field, which has a structure of its own.
pub const FIELD_KINDS: [SurfaceKind; 3] =
    [SurfaceKind::Implicit, SurfaceKind::Octree, SurfaceKind::OctreeSplat];

/// Returns the kinds of surface that rays hit: all but pixels, which have no rays, and Gaussians, which emit light
/// along the rays.
pub fn hit_kinds() -> impl Iterator<Item = SurfaceKind> {
    let others = [SurfaceKind::Points, SurfaceKind::Gaussian];
    SurfaceKind::ALL.into_iter().map(|(_, kind)| kind).filter(move |kind| !others.contains(kind))
}

/// Returns the preparation that takes all points for one surface.
pub fn one_surface() -> Preparation {
    Preparation { structure: StructureChoice::Surface, ..Preparation::default() }
}

/// Prepares a cloud as one surface, which adds missing normals and radii, and makes it grey.
pub fn points(cloud: PointCloud, surface: SurfaceKind) -> CloudGeometry {
    prepared(cloud, &one_surface(), surface)
}

/// Prepares a cloud and makes it grey.
pub fn prepared(
    cloud: PointCloud,
    preparation: &Preparation,
    surface: SurfaceKind,
) -> CloudGeometry {
    let (cloud, _) = prepare(cloud, preparation, &NoProgress).unwrap();
    let cloud = cloud.into_inner();
    let mut points = grey(if surface == SurfaceKind::Gaussian { trained(cloud) } else { cloud });
    points.surface = surface;
    points.shows_trained_colors = false;
    points
}

/// Adds the columns of trained Gaussians to a cloud that has normals and radii: grey, nearly opaque, and as flat as the
/// discs that they lie in.
pub fn trained(mut cloud: PointCloud) -> PointCloud {
    let (normals, radii) = (cloud.normals.clone().unwrap(), cloud.radii.clone().unwrap());
    let rotations: Vec<Quat> =
        normals.iter().map(|normal| Quat::from_rotation_arc(Vec3::Z, *normal)).collect();
    let column = |value: &dyn Fn(usize) -> f32| Values::F32((0..radii.len()).map(value).collect());
    let columns = [
        column(&|_| 0.0),
        column(&|_| 0.0),
        column(&|_| 0.0),
        column(&|_| 5.0),
        column(&|i| (0.5 * radii[i]).ln()),
        column(&|i| (0.5 * radii[i]).ln()),
        column(&|i| (0.05 * radii[i]).ln()),
        column(&|i| rotations[i].w),
        column(&|i| rotations[i].x),
        column(&|i| rotations[i].y),
        column(&|i| rotations[i].z),
    ];
    let scalars = GAUSSIAN_COLUMNS.into_iter().zip(columns);
    cloud.scalars.extend(scalars.map(|(name, values)| Scalar { name: name.to_owned(), values }));
    cloud
}

/// Makes a cloud grey that has normals and radii, and gives it a surface of splats.
pub fn grey(cloud: PointCloud) -> CloudGeometry {
    let mut grey = CloudGeometry::with_uniform_color(PreparedCloud::new(cloud).unwrap(), [188; 3]);
    grey.surface = SurfaceKind::Splat;
    grey
}

/// Returns the columns that the flat form of a cloud keeps.
pub fn columns<'a>(
    cloud: &'a PointCloud,
    kind: SurfaceKind,
    colors: &'a [[u8; 3]],
) -> PointColumns<'a> {
    let normals = cloud.normals.as_deref().unwrap();
    let radii = cloud.radii.as_deref().unwrap();
    PointColumns::new(kind, &cloud.positions, normals, radii, colors).unwrap()
}

/// Returns `points` with other colours.
pub fn colored(points: &CloudGeometry, colors: Vec<[u8; 3]>) -> CloudGeometry {
    let cloud = CloudGeometry::new(points.cloud().clone(), colors).unwrap();
    with_settings_of(points, cloud)
}

/// Returns `points` with a changed cloud of the same number of points.
pub fn changed(points: &CloudGeometry, change: impl FnOnce(&mut PointCloud)) -> CloudGeometry {
    let mut cloud = points.cloud().clone().into_inner();
    change(&mut cloud);
    let cloud = PreparedCloud::new(cloud).unwrap();
    with_settings_of(points, CloudGeometry::new(cloud, points.colors().to_vec()).unwrap())
}

/// Returns `cloud` with the settings of `points`.
fn with_settings_of(points: &CloudGeometry, mut cloud: CloudGeometry) -> CloudGeometry {
    cloud.surface = points.surface;
    cloud.options = points.options;
    cloud.edge_test = points.edge_test;
    cloud.octree_depth = points.octree_depth;
    cloud.blends_colors = points.blends_colors;
    cloud.support_colors = points.support_colors;
    cloud.shows_trained_colors = points.shows_trained_colors;
    cloud.has_outward_normals = points.has_outward_normals;
    cloud.has_front_sides = points.has_front_sides;
    cloud
}

/// `points` with normals that point out of what they enclose.
pub fn outward(points: &CloudGeometry) -> CloudGeometry {
    let mut outward = points.clone();
    outward.has_outward_normals = true;
    outward
}

/// Prepares a cloud and returns a scene of it: matte, lit from the camera, seen from +X.
pub fn scene(cloud: PointCloud, surface: SurfaceKind) -> Scene {
    lit(points(cloud, surface))
}

/// Returns a scene of matte points that are lit from the camera and seen from +X.
pub fn lit(points: CloudGeometry) -> Scene {
    let cloud = points.cloud();
    let camera = Camera {
        position: cloud.origin + DVec3::new(6.0, 0.0, 0.0),
        focal_point: cloud.origin,
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle_deg: 30.0 },
    };
    Scene {
        graph: Graph::from_geometry(Geometry::Points(points), Material::MATTE),
        lights: vec![Light::Headlight(1.0)],
        background: Background::Transparent,
        camera,
    }
}

/// Prepares a cloud and returns its flat form.
pub fn flat(cloud: PointCloud, surface: SurfaceKind) -> FlatCloud {
    FlatCloud::new(&points(cloud, surface), &NoProgress).unwrap()
}

/// Returns the only cloud of a scene.
pub fn cloud(scene: &Scene) -> &CloudGeometry {
    match &scene.graph.geometries[..] {
        [Geometry::Points(points)] => points,
        _ => panic!("not one cloud"),
    }
}

/// Returns rays from around a ball of `radius` about the origin toward points within it, some of bounded range.
pub fn random_rays(n: usize, radius: f32, seed: u64) -> Vec<Ray> {
    let mut random = Random::new(seed, 0);
    let mut ball = || loop {
        let axis = |random: &mut Random| 2.0 * random.next_f32() - 1.0;
        let point = Vec3::new(axis(&mut random), axis(&mut random), axis(&mut random));
        if point.length_squared() < 1.0 {
            return radius * point;
        }
    };
    (0..n)
        .map(|i| {
            let origin =
                if i % 3 == 0 { ball() } else { 3.0 * radius * ball().normalize_or(Vec3::X) };
            let ray = Ray::new(origin, (ball() - origin).normalize_or(Vec3::Z));
            // Every fifth ray starts late and ends early; every seventh runs along an axis.
            let direction = if i % 7 == 0 { Vec3::AXES[i % 3] } else { ray.direction };
            let range =
                if i % 5 == 0 { (0.3 * radius, 2.5 * radius) } else { (0.0, f32::INFINITY) };
            Ray { direction, t_min: range.0, t_max: range.1, ..ray }
        })
        .collect()
}

/// Returns the parallelogram about `center` with half sides `right` and `up` as seen from its front; its texture
/// coordinates are those of the corners of a picture.
pub fn quad(center: Vec3, right: Vec3, up: Vec3) -> Mesh {
    let corner = |x: f32, y: f32| center + x * right + y * up;
    Mesh {
        positions: vec![corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: [Some(vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X]), None],
        ..Mesh::default()
    }
}

/// Returns the square |x|, |y| <= `half` at z = `height`; its front faces up.
pub fn floor(height: f32, half: f32) -> Mesh {
    quad(height * Vec3::Z, half * Vec3::X, half * Vec3::Y)
}

/// Returns the box between two corners, with vertices that its sides share.
pub fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let corner = |i: usize| {
        let pick = |axis: usize| [min, max][i >> axis & 1][axis];
        Vec3::new(pick(0), pick(1), pick(2))
    };
    let sides =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..Mesh::default()
    }
}

/// Returns a closed ball about the origin of `n_rings` bands of `n_segments` quads, with vertex normals.
pub fn uv_sphere(n_rings: u32, n_segments: u32, radius: f32) -> Mesh {
    let direction = |ring: u32, segment: u32| {
        let (sin, cos) = (PI * ring as f32 / n_rings as f32).sin_cos();
        let (sin_around, cos_around) = (TAU * segment as f32 / n_segments as f32).sin_cos();
        Vec3::new(sin * cos_around, sin * sin_around, cos)
    };
    // The poles are the first and last vertices.
    let between = (1..n_rings).flat_map(|ring| (0..n_segments).map(move |s| direction(ring, s)));
    let normals: Vec<Vec3> = [Vec3::Z].into_iter().chain(between).chain([-Vec3::Z]).collect();
    let south = normals.len() as u32 - 1;
    let vertex = |ring: u32, segment: u32| match ring {
        0 => 0,
        ring if ring == n_rings => south,
        ring => 1 + (ring - 1) * n_segments + segment % n_segments,
    };
    let quads = (0..n_rings).flat_map(|ring| (0..n_segments).map(move |segment| (ring, segment)));
    let triangles = quads.flat_map(|(ring, segment)| {
        let (upper, lower) = (ring, ring + 1);
        let [a, b] = [vertex(upper, segment), vertex(lower, segment)];
        let [c, d] = [vertex(lower, segment + 1), vertex(upper, segment + 1)];
        [[a, b, c], [a, c, d]]
    });
    // At a pole two corners of a quad coincide.
    let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    Mesh {
        positions: normals.iter().map(|normal| radius * normal).collect(),
        normals: Some(normals),
        triangles,
        ..Mesh::default()
    }
}

/// Returns `mesh` with transformed vertices; fronts of triangles stay fronts.
pub fn baked(mesh: &Mesh, transform: DAffine3) -> Mesh {
    let origin = transform.transform_point3(mesh.origin);
    let for_normals = transform.matrix3.inverse().transpose();
    let mut moved = Mesh { origin, ..mesh.clone() };
    for position in &mut moved.positions {
        *position = (transform.matrix3 * position.as_dvec3()).as_vec3();
    }
    for normal in moved.normals.iter_mut().flatten() {
        *normal = (for_normals * normal.as_dvec3()).normalize().as_vec3();
    }
    if transform.matrix3.determinant() < 0.0 {
        moved.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    moved
}

/// Returns a graph of several objects with materials of their own, without transforms.
pub fn graph(things: Vec<(Geometry, Material)>) -> Graph {
    let mut graph = Graph::default();
    for (geometry, material) in things {
        graph.append(Graph::from_geometry(geometry, material));
    }
    graph
}

/// Returns a node that shows a geometry with a material and has a matrix as its transform.
pub fn node(geometry: usize, material: usize, matrix: DAffine3) -> Node {
    let parts = vec![Primitive { geometry, material }];
    Node { primitives: parts, transform: Transform::Matrix(matrix), ..Node::new("") }
}

/// Returns an orthographic camera that looks straight down at the origin, with +X to the right and +Y up.
pub fn from_above(height: f64) -> Camera {
    Camera {
        position: DVec3::new(0.0, 0.0, 10.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Y,
        projection: Projection::Orthographic { height },
    }
}

/// Renders a scene at the best SIMD level of this machine.
pub fn render(scene: &Scene, settings: &Settings) -> Image {
    let flat = FlatScene::new(scene, &NoProgress).unwrap();
    CpuRenderer { simd: Simd::detect() }.render(&flat, settings, &NoProgress).unwrap().0
}

#[cfg(test)]
mod tests {
    //! Closed meshes have no open edge, and their triangles face outward.

    use super::*;

    /// Panics unless each edge is part of two triangles in opposite directions, and the volume is as expected.
    fn check_closed(mesh: &Mesh, volume: f32) {
        let edges = |triangle: &[u32; 3]| [0, 1, 2].map(|i| (triangle[i], triangle[(i + 1) % 3]));
        let mut all: Vec<(u32, u32)> = mesh.triangles.iter().flat_map(edges).collect();
        all.sort_unstable();
        let back = |&(a, b): &(u32, u32)| all.binary_search(&(b, a)).is_ok();
        assert!(all.iter().all(back) && all.windows(2).all(|pair| pair[0] != pair[1]));
        let parts = (0..mesh.triangles.len()).map(|i| {
            let [a, b, c] = mesh.corners(i);
            a.dot(b.cross(c)) / 6.0
        });
        let found: f32 = parts.sum();
        assert!((found / volume - 1.0).abs() < 0.03, "{found} of {volume}");
    }

    #[test]
    fn closed_meshes_are_closed_and_face_outward() {
        check_closed(&cuboid(-Vec3::ONE, Vec3::new(1.0, 2.0, 3.0)), 24.0);
        check_closed(&uv_sphere(24, 48, 2.0), 4.0 / 3.0 * PI * 8.0);
        let mirrored = DAffine3::from_scale(DVec3::new(-1.0, 2.0, 0.5));
        check_closed(&baked(&uv_sphere(24, 48, 2.0), mirrored), 4.0 / 3.0 * PI * 8.0);
    }
}
