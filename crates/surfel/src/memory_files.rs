//! Clouds and meshes in memory, which a description names as it names files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel_core::points::PointCloud;
use surfel_core::scene::{Geometry, Graph, Material, Mesh};
use surfel_formats::FileInfo;

/// Content in memory by the names that the files of a description give it. Copies share it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MemoryFiles(Arc<BTreeMap<PathBuf, MemoryContent>>);

/// A cloud or a mesh in memory. Content is equal if it is the same.
#[derive(Clone, Debug)]
pub enum MemoryContent {
    /// A point cloud, with its coordinate system as WKT or as "EPSG:" and a code, if that is known.
    Points(Arc<PointCloud>, Option<String>),
    /// A triangle mesh.
    Triangles(Arc<Mesh>),
    /// All that was read of a file.
    File(Arc<FileContent>),
}

/// The content of a file, and what the file states about itself.
#[derive(Clone, Debug)]
pub struct FileContent {
    /// The clouds and meshes.
    pub graph: Graph<PointCloud>,
    /// The facts.
    pub info: FileInfo,
}

impl MemoryFiles {
    /// Adds content under a name, in place of what had it.
    pub fn insert(&mut self, name: impl Into<PathBuf>, content: MemoryContent) {
        Arc::make_mut(&mut self.0).insert(name.into(), content);
    }

    /// Returns true if content has this name.
    pub fn contains(&self, name: &Path) -> bool {
        self.0.contains_key(name)
    }

    /// Returns a name of content, if it has one: objects with one name share a geometry.
    pub fn name_of(&self, content: &MemoryContent) -> Option<&Path> {
        let named = self.0.iter().find(|(_, other)| *other == content);
        named.map(|(name, _)| name.as_path())
    }

    /// Returns the content of a name.
    pub(crate) fn get(&self, name: &Path) -> Option<&MemoryContent> {
        self.0.get(name)
    }

    /// Adds the content of another, in place of what had its names.
    pub(crate) fn extend(&mut self, other: Self) {
        Arc::make_mut(&mut self.0).extend(Arc::unwrap_or_clone(other.0));
    }
}

impl MemoryContent {
    /// Returns a copy as a graph, as reading a file does.
    pub(crate) fn to_graph(&self) -> Graph<PointCloud> {
        let geometry = match self {
            Self::Points(cloud, _) => Geometry::Points(PointCloud::clone(cloud)),
            Self::Triangles(mesh) => Geometry::Triangles(Mesh::clone(mesh)),
            Self::File(file) => return file.graph.clone(),
        };
        Graph::from_geometry(geometry, Material::MATTE)
    }

    /// Returns true for content that is more than one cloud or mesh.
    pub(crate) fn is_scene(&self) -> bool {
        matches!(self, Self::File(file) if 1 < file.graph.nodes.len())
    }

    /// Returns a text that changes with the clouds and meshes, their places and materials.
    pub(crate) fn fingerprint(&self) -> String {
        match self {
            Self::Points(cloud, system) => {
                format!("{} {system:?}", points_fingerprint(cloud))
            }
            Self::Triangles(mesh) => mesh_fingerprint(mesh),
            Self::File(file) => {
                let Graph { geometries, materials, nodes, .. } = &file.graph;
                let geometries = geometries.iter().map(|geometry| match geometry {
                    Geometry::Points(cloud) => points_fingerprint(cloud),
                    Geometry::Triangles(mesh) => mesh_fingerprint(mesh),
                });
                format!("{:?} {materials:?} {nodes:?}", geometries.collect::<Vec<_>>())
            }
        }
    }

    /// Returns what is known of the content, as the header of a file states it.
    pub(crate) fn info(&self) -> FileInfo {
        let info = FileInfo { format: "in memory".into(), ..FileInfo::default() };
        match self {
            Self::Points(cloud, system) => FileInfo {
                n_points: Some(cloud.len() as u64),
                coordinate_system: system.clone(),
                columns: column_names(cloud),
                ..info
            },
            Self::Triangles(mesh) => FileInfo {
                n_points: Some(mesh.positions.len() as u64),
                n_triangles: Some(mesh.triangles.len() as u64),
                ..info
            },
            Self::File(file) => file.info.clone(),
        }
    }
}

impl PartialEq for MemoryContent {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Points(a, system), Self::Points(b, other)) => {
                Arc::ptr_eq(a, b) && system == other
            }
            (Self::Triangles(a), Self::Triangles(b)) => Arc::ptr_eq(a, b),
            (Self::File(a), Self::File(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

fn points_fingerprint(cloud: &PointCloud) -> String {
    format!("{:016x} {:?} {:?}", cloud.content_hash(), cloud.origin, cloud.stations)
}

fn mesh_fingerprint(mesh: &Mesh) -> String {
    format!("{:016x} {:?}", mesh.content_hash(), mesh.origin)
}

/// Returns the columns of a cloud as files name them.
fn column_names(cloud: &PointCloud) -> Vec<String> {
    let known = [
        ("normal", cloud.normals.is_some()),
        ("radius", cloud.radii.is_some()),
        ("rgb", cloud.colors.is_some()),
        ("intensity", cloud.intensity.is_some()),
        ("classification", cloud.classification.is_some()),
    ];
    let known = known.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name.into());
    known.chain(cloud.scalars.iter().map(|scalar| scalar.name.clone())).collect()
}

#[cfg(test)]
mod tests {
    //! Clouds in memory are shown as those of files are, once for all objects that name them.

    use super::*;
    use crate::SceneDescription;
    use crate::resolve::resolve;
    use serde_json::json;
    use surfel_core::math::Vec3;
    use surfel_core::progress::NoProgress;

    #[test]
    fn objects_of_one_name_share_a_geometry() {
        let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
        let cloud = Arc::new(PointCloud::from_positions((0..400).map(corner).collect()));
        let content = MemoryContent::Points(cloud, None);
        let mut description = SceneDescription::default();
        description.memory.insert("memory:square", content.clone());
        assert_eq!(description.memory.name_of(&content), Some(Path::new("memory:square")));
        for x in [0, 30] {
            let object = json!({ "file": "memory:square", "translate": [x, 0, 0] });
            let Some(table) = object.as_object() else { panic!("an object is a table") };
            description.add_object(table, Path::new("")).unwrap();
        }
        let resolved = resolve(&description, &NoProgress).unwrap();
        let graph = &resolved.scene.graph;
        assert_eq!(graph.geometries.len(), 1);
        assert_eq!(graph.nodes.iter().filter(|node| !node.primitives.is_empty()).count(), 2);
    }
}
