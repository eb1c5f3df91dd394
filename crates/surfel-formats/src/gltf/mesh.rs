//! Meshes: the primitives of a node with their materials.

use std::collections::HashMap;
use surfel_core::words::counted;

use surfel_core::scene::{Material, Primitive};

use super::document::Document;
use super::json::Json;
use super::material;
use super::primitive::GeometryCache;
use crate::error::Result;

/// The meshes that nodes have referred to so far, and all materials.
pub(super) struct MeshCache<'d, 'a> {
    document: &'d Document<'a>,
    /// The geometries of the meshes.
    pub geometries: GeometryCache<'d, 'a>,
    /// All materials of the file and, if needed, the default material.
    pub materials: Vec<Material>,
    /// Index of the material of primitives that declare none.
    default_material: Option<usize>,
    /// Loaded meshes by index in the file.
    by_index: HashMap<usize, LoadedMesh>,
    /// Number of joints that each skinned geometry uses.
    n_joints: HashMap<usize, usize>,
}

/// A mesh as nodes use it.
struct LoadedMesh {
    parts: Vec<Primitive>,
    /// Default weight per morph target.
    weights: Vec<f32>,
}

impl<'d, 'a> MeshCache<'d, 'a> {
    /// Creates a reader of the document's meshes.
    pub fn new(document: &'d Document<'a>, materials: Vec<Material>) -> Self {
        Self {
            document,
            geometries: GeometryCache::new(document),
            materials,
            default_material: None,
            by_index: HashMap::new(),
            n_joints: HashMap::new(),
        }
    }

    /// Returns the parts and morph weights of a node that shows the mesh at the index `reference`. `weights`
    /// are the node's own, which override those of the mesh.
    pub fn load(
        &mut self,
        reference: &Json<'a>,
        weights: Option<&Json<'a>>,
    ) -> Result<(Vec<Primitive>, Vec<f32>)> {
        let mesh = self.document.resolve("meshes", reference)?;
        let index = reference.index()?;
        if !self.by_index.contains_key(&index) {
            let loaded = self.read(&mesh)?;
            self.by_index.insert(index, loaded);
            self.document.progress.advance(1);
        }
        let LoadedMesh { parts, weights: defaults } = &self.by_index[&index];
        self.document.reserve(&mesh, parts.len(), size_of::<Primitive>())?;
        self.document.reserve(&mesh, defaults.len(), size_of::<f32>())?;
        let weights = weights.map(|weights| read_weights(weights, defaults.len()));
        Ok((parts.clone(), weights.transpose()?.unwrap_or_else(|| defaults.clone())))
    }

    /// Returns the number of joints that the parts use; 0 if none of them is skinned.
    pub fn n_joints_used(&self, parts: &[Primitive]) -> usize {
        let n_joints = parts.iter().filter_map(|part| self.n_joints.get(&part.geometry));
        n_joints.copied().max().unwrap_or(0)
    }

    fn read(&mut self, mesh: &Json<'a>) -> Result<LoadedMesh> {
        let mut parts = Vec::new();
        let mut n_targets = None;
        for primitive in mesh.require("primitives")?.array()? {
            let targets = primitive.array_or_empty("targets")?;
            if let Some(n) = n_targets.filter(|n| *n != targets.len()) {
                let found = format!("{} morph targets", targets.len());
                return Err(primitive.error(found, format!("{n}, as in the first primitive")));
            }
            n_targets = Some(targets.len());
            let material = self.material(&primitive)?;
            let Some(geometry) = self.geometries.load(&primitive)? else { continue };
            if let Some(skin) = self.geometries.all[geometry].skin() {
                let max_joint = skin.joints.as_flattened().iter().max().map_or(0, |joint| *joint);
                self.n_joints.insert(geometry, usize::from(max_joint) + 1);
            }
            parts.push(Primitive { geometry, material });
        }
        let n_targets = n_targets.unwrap_or(0);
        let weights = mesh.get("weights").map(|weights| read_weights(&weights, n_targets));
        let weights = weights.transpose()?.unwrap_or_else(|| vec![0.0; n_targets]);
        Ok(LoadedMesh { parts, weights })
    }

    /// Returns the index of the material of a primitive.
    fn material(&mut self, primitive: &Json<'a>) -> Result<usize> {
        if let Some(reference) = primitive.get("material") {
            self.document.resolve("materials", &reference)?;
            return reference.index();
        }
        let next = self.materials.len();
        let index = *self.default_material.get_or_insert(next);
        if index == next {
            self.materials.push(material::DEFAULT);
        }
        Ok(index)
    }
}

/// Reads one weight per morph target.
fn read_weights(json: &Json, n_targets: usize) -> Result<Vec<f32>> {
    let weights: Vec<f32> = json.array()?.map(|weight| weight.float()).collect::<Result<_>>()?;
    if weights.len() == n_targets {
        return Ok(weights);
    }
    Err(json.error(counted(weights.len(), "weight"), format!("{n_targets}, one per morph target")))
}
