//! The rules that turn normals before they are blended, at the edges of a cube whose normals have random signs.

use surfel_core::flat::FlatCloud;
use surfel_core::math::{Ray, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::surface::{Align, EdgeTest, GatherLimit, SurfaceKind, SurfaceOptions};
use surfel_core::trace::{Simd, SurfaceHit, surface_hits};
use surfel_tests::clouds;
use surfel_tests::scenes;

const EYE: Vec3 = Vec3::new(4.0, -3.2, 2.6);
/// Radius of a point: 1.5 times the distance to the next.
const RADIUS: f32 = 1.5 * 2.0 / 58.0;

fn cube() -> PointCloud {
    let mut cloud = clouds::with_random_signs(clouds::cube(58, 0.0, 1));
    cloud.radii = Some(vec![RADIUS; cloud.len()]);
    cloud
}

fn flat(options: SurfaceOptions) -> FlatCloud {
    let mut points = scenes::points(cube(), SurfaceKind::Splat);
    (points.options, points.edge_test) = (options, EdgeTest::Off);
    FlatCloud::new(&points, &NoProgress).unwrap()
}

/// A ray that meets the cube near an edge, with the outward normals of both sides.
struct EdgeRay {
    ray: Ray,
    normals: [Vec3; 2],
    /// True if both sides face the eye.
    is_visible: bool,
}

/// Returns the ray to a position on a face of the cube if the position is near an edge, but not near two.
fn edge_ray(face: Vec3, position: Vec3) -> Option<EdgeRay> {
    let faces = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    let others = faces.filter(|other| other.dot(face) == 0.0);
    let mut near = others.filter(|other| 1.0 - RADIUS < position.dot(*other));
    let (other, second) = (near.next()?, near.next());
    let ray = Ray::new(EYE, (position - EYE).normalize());
    let is_visible = 0.0 < other.dot(EYE - position);
    second.is_none().then_some(EdgeRay { ray, normals: [face, other], is_visible })
}

fn edge_rays() -> Vec<EdgeRay> {
    let mut rays = Vec::new();
    for face in [Vec3::X, Vec3::NEG_Y, Vec3::Z] {
        let (a, b) = (Vec3::new(face.y, face.z, face.x), Vec3::new(face.z, face.x, face.y));
        for (i, j) in (0..200).flat_map(|i| (0..200).map(move |j| (i, j))) {
            let [u, v] = [i, j].map(|k| (k as f32 + 0.5) / 100.0 - 1.0);
            rays.extend(edge_ray(face, face + u * a + v * b));
        }
    }
    rays
}

/// Returns the shares of rays at visible edges, and at silhouettes, whose normal is more than 30 degrees from all
/// directions between those of both sides.
fn shares_off(align: Align) -> [f32; 2] {
    let flat = flat(SurfaceOptions { align, ..SurfaceOptions::default() });
    let edge_rays = edge_rays();
    let rays: Vec<Ray> = edge_rays.iter().map(|edge| edge.ray).collect();
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    surface_hits(&flat, Simd::detect(), &rays, &mut hits);
    let is_off = |edge: &EdgeRay, hit: &SurfaceHit| {
        let [a, b] = edge.normals;
        let between = |i: i32| a.lerp(b, 0.1 * i as f32).normalize();
        let nearest = (0..=10).map(|i| hit.normal.dot(between(i))).fold(-1.0, f32::max);
        nearest < 30f32.to_radians().cos()
    };
    [true, false].map(|is_visible| {
        let of_kind = edge_rays.iter().zip(&hits).filter(|(edge, _)| edge.is_visible == is_visible);
        let (mut n, mut n_off) = (0, 0);
        for (edge, hit) in of_kind {
            n += 1;
            n_off += usize::from(hit.is_miss() || is_off(edge, hit));
        }
        assert!(1000 < n);
        n_off as f32 / n as f32
    })
}

#[test]
fn the_default_rule_wins_at_visible_edges_and_at_silhouettes() {
    let [visible, silhouette] = shares_off(Align::default());
    assert!(visible < 0.01 && silhouette < 0.02, "both: {visible} {silhouette}");
    let [of_each, each_silhouette] = shares_off(Align::Each);
    assert!(of_each < 0.01 && 0.1 < each_silhouette, "each: {of_each} {each_silhouette}");
    let [of_nearest, nearest_silhouette] = shares_off(Align::Nearest);
    let nearest = format!("nearest: {of_nearest} {nearest_silhouette}");
    assert!(0.05 < of_nearest && 0.05 < nearest_silhouette, "{nearest}");
}

/// The nearest disc is large and the one behind it small: by the least limit the second one ends the blend before a third.
#[test]
fn the_limit_of_the_nearest_disc_reaches_as_far_as_its_radius() {
    let heights = [0.0, -0.2, -0.6, -1.4];
    let cloud = PointCloud {
        normals: Some(vec![Vec3::Z; 4]),
        radii: Some(vec![1.0, 0.1, 1.0, 1.0]),
        ..PointCloud::from_positions(heights.map(|z| Vec3::new(0.0, 0.0, z)).to_vec())
    };
    let ray = Ray::new(3.0 * Vec3::Z, Vec3::NEG_Z);
    for (gather_limit, expected) in [(GatherLimit::Least, 2), (GatherLimit::Nearest, 3)] {
        let mut points = scenes::points(cloud.clone(), SurfaceKind::Splat);
        points.options.gather_limit = gather_limit;
        let flat = FlatCloud::new(&points, &NoProgress).unwrap();
        for simd in Simd::available() {
            for n_rays in [1, 64] {
                let mut splats = vec![surfel_core::trace::Splat::MISS; n_rays];
                surfel_core::trace::splats(&flat, simd, &vec![ray; n_rays], &mut splats);
                assert!(splats.iter().all(|splat| splat.n_discs == expected), "{gather_limit:?}");
            }
        }
    }
}

#[test]
fn a_smaller_distance_lets_new_rays_hit_their_own_surface() {
    let spawn = |min_distance| SurfaceOptions { min_distance, ..SurfaceOptions::default() };
    let factor = |min_distance, kind| spawn(min_distance).spawn_factor(kind);
    assert_eq!(factor(None, SurfaceKind::Disc), 1.0);
    assert_eq!(factor(Some(0.0), SurfaceKind::Disc), 0.0);
    assert_eq!(factor(Some(4.0), SurfaceKind::Splat), 2.0);
    assert_eq!(factor(Some(1.0), SurfaceKind::Smooth), 2.0);
    assert_eq!(factor(Some(0.0), SurfaceKind::Sphere), 1.0);
}
