//! The clouds of the thesis, or others of their sizes, with cameras.

use surfel_core::math::{DVec3, Random, Vec3};
use surfel_core::points::{PointCloud, PreparedCloud, prepare};
use surfel_core::progress::NoProgress;
use surfel_core::scene::{Camera, CameraFit, CloudGeometry, Projection, fit_camera};
use surfel_core::surface::SurfaceKind;
use surfel_scanner::scenes::ruin;
use surfel_tests::clouds;
use surfel_tests::ground_truth::GroundTruth;
use surfel_tests::sampling::Sampling;
use surfel_tests::scenes;
use surfel_tests::shapes;
use surfel_tests::shared_data::shared_data;

/// A prepared cloud and a camera.
#[derive(Clone)]
pub struct Subject {
    /// The name in headings.
    pub name: &'static str,
    cloud: PreparedCloud,
    /// The camera.
    pub camera: Camera,
}

impl Subject {
    /// Prepares a cloud as one surface, seen along a direction.
    fn new(name: &'static str, cloud: PointCloud, direction: DVec3) -> Self {
        let fit = CameraFit { aspect: 1.0, direction: Some(direction), ..CameraFit::default() };
        let camera = fit_camera(&cloud, &fit);
        Self { name, cloud: prepared(cloud), camera }
    }

    /// Returns the number of points.
    pub fn n_points(&self) -> usize {
        self.cloud.len()
    }

    /// Returns the world coordinates of the zero of the positions.
    pub fn origin(&self) -> DVec3 {
        self.cloud.origin
    }

    /// Returns a grey geometry of a kind, without normals if the kind needs none.
    pub fn geometry(&self, kind: SurfaceKind) -> CloudGeometry {
        let mut cloud = self.cloud.clone().into_inner();
        cloud.normals = cloud.normals.filter(|_| kind.needs_normals());
        let cloud = PreparedCloud::new(cloud).unwrap();
        let mut geometry = CloudGeometry::with_uniform_color(cloud, [188; 3]);
        geometry.surface = kind;
        geometry
    }

    /// Returns the first `n` points of a shuffled cloud, prepared from scratch.
    pub fn subset(&self, n: usize) -> Self {
        let mut random = Random::new(7, 0);
        let mut indices: Vec<u32> = (0..self.n_points() as u32).collect();
        let n = n.min(indices.len());
        for i in 0..n {
            let other = i + random.below((indices.len() - i) as u64) as usize;
            indices.swap(i, other);
        }
        let origin = self.cloud.origin;
        let positions = indices[..n].iter().map(|i| self.cloud.positions()[*i as usize]).collect();
        let cloud = PointCloud { origin, ..PointCloud::from_positions(positions) };
        Self { cloud: prepared(cloud), ..*self }
    }

    /// Returns the same points with normals of random sign.
    pub fn with_random_signs(&self) -> Self {
        let cloud = clouds::with_random_signs(self.cloud.clone().into_inner());
        Self { cloud: PreparedCloud::new(cloud).unwrap(), ..*self }
    }
}

fn prepared(cloud: PointCloud) -> PreparedCloud {
    prepare(cloud, &scenes::one_surface(), &NoProgress).unwrap().0
}

const CORNER: DVec3 = DVec3::new(-0.55, 0.7, -0.45);
const FRONT: DVec3 = DVec3::new(-0.35, 0.9, -0.25);

/// Returns the 35,947 vertices of the Stanford bunny, if there is the folder of test data.
pub fn bunny() -> Option<Subject> {
    let mesh = GroundTruth::from_file(&shared_data()?.join("meshes/bun_zipper.ply"));
    let upright = |p: &Vec3| Vec3::new(p.x, -p.z, p.y);
    let positions = mesh.vertices.iter().map(upright).collect();
    Some(Subject::new("Bunny, 36k", PointCloud::from_positions(positions), FRONT))
}

/// Returns a cube of 301,056 points with exact normals.
pub fn cube() -> Subject {
    Subject::new("Cube, 301k", clouds::cube(224, 0.3, 1), CORNER)
}

/// Returns a cube of 20,184 points, whose discs are a few pixels wide in small pictures.
pub fn coarse_cube() -> Subject {
    Subject::new("Cube, 20k", clouds::cube(58, 0.3, 1), CORNER)
}

/// Returns scans of the built-in ruin of 1,078,000 points.
pub fn ruin_scan() -> Subject {
    let cloud = ruin::scan(1_078_000, &NoProgress).unwrap();
    let view = ruin::view();
    let camera = Camera {
        position: ruin::UTM_ORIGIN + view.position,
        focal_point: ruin::UTM_ORIGIN + view.focal_point,
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle_deg: view.view_angle_deg },
    };
    Subject { name: "Ruin, 1,078k", cloud: prepared(cloud), camera }
}

/// Returns 172,974 random points of a head.
pub fn head() -> Subject {
    let mesh = GroundTruth::from_mesh(&shapes::head());
    let positions = Sampling::Random.sample(&mesh, 172_974, 1);
    Subject::new("Head, 173k", PointCloud::from_positions(positions), FRONT)
}
