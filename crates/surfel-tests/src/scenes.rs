//! Scenes for tests and benchmarks: clouds from `clouds`, made ready to trace.

use surfel::flat::FlatCloud;
use surfel::math::{DVec3, Random, Ray, Vec3};
use surfel::points::{PointCloud, Preparation, prepare};
use surfel::progress::Silent;
use surfel::scene::{
    Background, Camera, Geometry, Graph, Light, Material, Points, Projection, Scene,
};
use surfel::surface::{Boundary, SurfaceKind};

/// `cloud` with the radii and normals it lacks, grey.
pub fn points(cloud: PointCloud, surface: SurfaceKind) -> Points {
    let (cloud, _) = prepare(cloud, &Preparation::default(), &Silent).unwrap();
    let colors = vec![[188; 3]; cloud.len()];
    Points { cloud, colors, surface, boundary: Boundary::Gap, has_outward_normals: false }
}

/// `cloud` made ready, matte, lit from the camera, seen from +X.
pub fn scene(cloud: PointCloud, surface: SurfaceKind) -> Scene {
    lit(points(cloud, surface))
}

/// Points, matte, lit from the camera, seen from +X.
pub fn lit(points: Points) -> Scene {
    let cloud = &points.cloud;
    let camera = Camera {
        position: cloud.origin + DVec3::new(6.0, 0.0, 0.0),
        focal_point: cloud.origin,
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle_deg: 30.0 },
    };
    Scene {
        graph: Graph::of(Geometry::Points(points), Material::MATTE),
        lights: vec![Light::Headlight(1.0)],
        background: Background::Transparent,
        camera,
    }
}

/// The flat form of [`points`].
pub fn flat(cloud: PointCloud, surface: SurfaceKind) -> FlatCloud {
    FlatCloud::new(&points(cloud, surface), &Silent).unwrap()
}

/// The only cloud of a scene.
pub fn cloud(scene: &Scene) -> &Points {
    match &scene.graph.geometries[..] {
        [Geometry::Points(points)] => points,
        _ => panic!("not one cloud"),
    }
}

/// Rays from around a ball of `radius` about the origin toward places within it, some of bounded range.
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
