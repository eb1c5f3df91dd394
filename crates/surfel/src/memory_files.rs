//! Clouds and meshes in memory, which a description names as it names files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel_core::points::PointCloud;
use surfel_core::scene::{Geometry, Graph};
use surfel_formats::FileInfo;

/// Content in memory by the names that the files of a description give it. Copies share it.
#[derive(Clone, Debug, Default)]
pub struct MemoryFiles(BTreeMap<PathBuf, Arc<Graph<PointCloud>>>);

impl MemoryFiles {
    /// Adds content under a name, in place of what had it.
    pub fn insert(&mut self, name: impl Into<PathBuf>, content: Graph<PointCloud>) {
        self.0.insert(name.into(), Arc::new(content));
    }

    /// Returns true if content has this name.
    pub fn contains(&self, name: &Path) -> bool {
        self.0.contains_key(name)
    }

    /// Returns the content of a name.
    pub(crate) fn get(&self, name: &Path) -> Option<&Graph<PointCloud>> {
        self.0.get(name).map(Arc::as_ref)
    }

    /// Returns what is known of the content of a name, as the header of a file states it.
    pub(crate) fn info(&self, name: &Path) -> Option<FileInfo> {
        let content = self.get(name)?;
        let (n_points, n_triangles) = content.n_points_and_triangles();
        let columns = content.geometries.iter().flat_map(|geometry| match geometry {
            Geometry::Points(cloud) => column_names(cloud),
            Geometry::Triangles(_) => Vec::new(),
        });
        Some(FileInfo {
            format: "in memory".into(),
            n_points: Some(n_points as u64),
            n_triangles: (0 < n_triangles).then_some(n_triangles as u64),
            columns: columns.collect(),
            ..FileInfo::default()
        })
    }

    /// Adds the content of another, in place of what had its names.
    pub(crate) fn extend(&mut self, other: Self) {
        self.0.extend(other.0);
    }
}

impl PartialEq for MemoryFiles {
    /// Content is equal if it is the same.
    fn eq(&self, other: &Self) -> bool {
        let same = |a: &Arc<_>, b: &Arc<_>| Arc::ptr_eq(a, b);
        self.0.len() == other.0.len()
            && self.0.iter().all(|(name, a)| other.0.get(name).is_some_and(|b| same(a, b)))
    }
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
