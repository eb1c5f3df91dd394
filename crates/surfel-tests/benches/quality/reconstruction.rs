//! Meshes that another program made from the clouds, and the clouds as files for it.

use crate::selection::Selection;
use std::fs;
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::scene::{Geometry, Mesh};
use surfel_formats::{LoadOptions, SaveOptions, load_graph, save};

/// A mesh that was reconstructed from a cloud.
pub struct Reconstruction {
    /// The mesh, with its origin at zero.
    pub mesh: Mesh,
    /// Processor seconds that the reconstruction took.
    pub secs: f64,
}

/// The name of reconstructions in tables.
pub const METHOD: &str = "Poisson";

/// Writes a cloud as `NAME.ply` if the command line asks for it.
pub fn write_cloud(selection: &Selection, name: &str, cloud: &PointCloud) {
    if let Some(folder) = &selection.written_clouds {
        let path = folder.join(format!("{name}.ply"));
        save(&path, cloud, &SaveOptions::default(), &NoProgress).unwrap();
    }
}

/// Reads the mesh `NAME.ply` and its processor seconds `NAME.secs`, if the command line names their folder and they are there.
pub fn read(selection: &Selection, name: &str) -> Option<Reconstruction> {
    let folder = selection.meshes.as_ref()?;
    let secs = fs::read_to_string(folder.join(format!("{name}.secs"))).ok()?;
    let path = folder.join(format!("{name}.ply"));
    let (mut graph, _) = load_graph(&path, &LoadOptions::default(), &NoProgress).unwrap();
    let Some(Geometry::Triangles(mut mesh)) = graph.geometries.pop() else {
        panic!("{}: no mesh", path.display());
    };
    let origin = std::mem::take(&mut mesh.origin).as_vec3();
    mesh.positions.iter_mut().for_each(|position| *position += origin);
    Some(Reconstruction { mesh, secs: secs.trim().parse().unwrap() })
}
