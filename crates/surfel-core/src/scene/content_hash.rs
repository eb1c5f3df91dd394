//! Hashes of geometries, by which trees that were built before are found again.

use super::cloud_geometry::CloudGeometry;
use super::graph::Geometry;
use super::mesh::Mesh;
use crate::points::{PointCloud, Values};
use crate::surface::SurfaceKind;
use bytemuck::{NoUninit, cast_slice};
use rayon::prelude::*;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Number of bytes that a thread hashes at a time.
const BYTES_PER_TASK: usize = 1 << 20;

impl Geometry {
    /// Returns a hash of everything that the trees of the geometry hold: points or triangles, relative to their origin,
    /// with their attributes, and the surface. Morph targets and joints are not counted.
    pub fn content_hash(&self) -> u64 {
        match self {
            Self::Points(points) => cloud_hash(points),
            Self::Triangles(mesh) => mesh.content_hash(),
        }
    }
}

impl PointCloud {
    /// Returns a hash of all columns, with positions relative to their origin. Stations, morph targets and joints are not
    /// counted.
    pub fn content_hash(&self) -> u64 {
        let scalars = self.scalars.iter();
        let scalars: Vec<(&str, u64)> =
            scalars.map(|scalar| (scalar.name.as_str(), values_hash(&scalar.values))).collect();
        let columns = (
            (hash(&self.positions), self.normals.as_deref().map(hash)),
            (self.radii.as_deref().map(hash), self.colors.as_deref().map(hash)),
            (self.intensity.as_deref().map(hash), self.classification.as_deref().map(hash)),
            scalars,
        );
        let mut hasher = DefaultHasher::new();
        ("cloud", columns).hash(&mut hasher);
        hasher.finish()
    }
}

impl Mesh {
    /// Returns a hash of triangles and attributes, with positions relative to their origin. Morph targets and joints are
    /// not counted.
    pub fn content_hash(&self) -> u64 {
        let [first, second] = &self.uvs;
        let columns = (
            (hash(&self.positions), hash(&self.triangles)),
            (self.normals.as_deref().map(hash), self.tangents.as_deref().map(hash)),
            (first.as_deref().map(hash), second.as_deref().map(hash)),
            self.colors.as_deref().map(hash),
        );
        let mut hasher = DefaultHasher::new();
        ("triangles", columns).hash(&mut hasher);
        hasher.finish()
    }
}

fn cloud_hash(geometry: &CloudGeometry) -> u64 {
    let cloud = geometry.cloud();
    let mut columns = vec![
        hash(cloud.positions()),
        hash(cloud.normals()),
        hash(cloud.radii()),
        hash(geometry.colors()),
    ];
    let structures = geometry.structures().unwrap_or_default();
    let structures: Vec<u8> = structures.iter().map(|structure| *structure as u8).collect();
    columns.push(hash(&structures));
    if geometry.surface == SurfaceKind::Gaussian {
        for scalar in &cloud.scalars {
            let mut hasher = DefaultHasher::new();
            (&scalar.name, values_hash(&scalar.values)).hash(&mut hasher);
            columns.push(hasher.finish());
        }
    }
    let settings = format!(
        "{:?}",
        (
            (geometry.surface, geometry.options, geometry.edge_test, geometry.octree_depth),
            (geometry.blends_colors, geometry.support_colors, geometry.shows_trained_colors),
            (geometry.has_outward_normals, geometry.has_front_sides, geometry.cloud().has_leaves()),
        )
    );
    let mut hasher = DefaultHasher::new();
    ("points", columns, settings).hash(&mut hasher);
    hasher.finish()
}

fn values_hash(values: &Values) -> u64 {
    match values {
        Values::U8(values) => hash(values),
        Values::U16(values) => hash(values),
        Values::I32(values) => hash(values),
        Values::F32(values) => hash(values),
        Values::F64(values) => hash(values),
    }
}

/// Returns a hash of the bytes and of their number, the same on any number of threads.
fn hash<T: NoUninit>(values: &[T]) -> u64 {
    let bytes: &[u8] = cast_slice(values);
    let of_chunks: Vec<u64> = bytes
        .par_chunks(BYTES_PER_TASK)
        .map(|chunk| {
            let mut hasher = DefaultHasher::new();
            hasher.write(chunk);
            hasher.finish()
        })
        .collect();
    let mut hasher = DefaultHasher::new();
    (bytes.len(), of_chunks).hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    //! The hash changes with the content of trees, and with nothing else.

    use super::*;
    use crate::math::{DVec3, Vec3};
    use crate::points::{Preparation, PreparedCloud, Scalar, Structure, prepare};
    use crate::progress::NoProgress;
    use crate::surface::EdgeTest;
    use std::collections::BTreeSet;

    fn prepared() -> PreparedCloud {
        let position = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
        let cloud = PointCloud::from_positions((0..400).map(position).collect());
        prepare(cloud, &Preparation::default(), &NoProgress).unwrap().0
    }

    fn points_hash(change: impl FnOnce(&mut CloudGeometry)) -> u64 {
        let mut geometry = CloudGeometry::with_uniform_color(prepared(), [9; 3]);
        change(&mut geometry);
        Geometry::Points(geometry).content_hash()
    }

    #[test]
    fn points_and_their_surface_decide() {
        let first = points_hash(|_| {});
        assert_eq!(points_hash(|_| {}), first);
        let changed = [
            points_hash(|it| it.surface = SurfaceKind::Disc),
            points_hash(|it| it.edge_test = EdgeTest::Off),
            points_hash(|it| it.options.reach = Some(3.0)),
            points_hash(|it| it.retain(&(0..399).collect::<Vec<u32>>())),
            points_hash(|it| *it = CloudGeometry::with_uniform_color(prepared(), [8; 3])),
        ];
        assert!(changed.iter().all(|other| *other != first), "{changed:?}");
    }

    #[test]
    fn leaves_have_other_trees_than_balls() {
        let with_class = |class: u8| {
            points_hash(|geometry| {
                let mut cloud = geometry.cloud().clone().into_inner();
                let mut structures = vec![Structure::Surface; cloud.len()];
                structures[..100].fill(Structure::Scatter);
                cloud.set_structures(&structures);
                cloud.classification = Some(vec![class; cloud.len()]);
                let cloud = PreparedCloud::new(cloud).unwrap();
                *geometry = CloudGeometry::with_uniform_color(cloud, [9; 3]);
            })
        };
        assert_eq!(with_class(2), with_class(6));
        assert_ne!(with_class(2), with_class(5));
    }

    #[test]
    fn columns_of_a_cloud_decide() {
        let cloud = PointCloud::from_positions(vec![Vec3::ZERO, Vec3::X]);
        let column =
            |value| vec![Scalar { name: "age".into(), values: Values::U8(vec![value; 2]) }];
        let clouds = [
            cloud.clone(),
            PointCloud::from_positions(vec![Vec3::ZERO, Vec3::Y]),
            PointCloud { colors: Some(vec![[0; 3]; 2]), ..cloud.clone() },
            PointCloud { colors: Some(vec![[1; 3]; 2]), ..cloud.clone() },
            PointCloud { radii: Some(vec![1.0; 2]), ..cloud.clone() },
            PointCloud { scalars: column(1), ..cloud.clone() },
            PointCloud { scalars: column(2), ..cloud.clone() },
        ];
        let hashes: BTreeSet<u64> = clouds.iter().map(PointCloud::content_hash).collect();
        assert_eq!(hashes.len(), clouds.len());
        let moved = PointCloud { origin: DVec3::X, ..cloud.clone() };
        assert_eq!(moved.content_hash(), cloud.content_hash());
    }

    #[test]
    fn triangles_and_attributes_decide() {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let hash = |mesh: Mesh| mesh.content_hash();
        let first = hash(mesh.clone());
        assert_eq!(hash(Mesh { origin: DVec3::X, ..mesh.clone() }), first);
        assert_ne!(hash(Mesh { normals: Some(vec![Vec3::Z; 3]), ..mesh.clone() }), first);
        assert_ne!(hash(Mesh { triangles: vec![[1, 2, 0]], ..mesh.clone() }), first);
        let moved = vec![Vec3::ZERO, Vec3::X, 2.0 * Vec3::Y];
        assert_ne!(hash(Mesh { positions: moved, ..mesh }), first);
    }
}
