//! Meshes: the primitives that a node shows, each with its material.

use std::collections::HashMap;

use surfel::scene::{Material, Part};

use super::document::Document;
use super::json::Json;
use super::material;
use super::primitive::Primitives;
use crate::error::Result;

/// The meshes that nodes have asked for so far, and all materials.
pub(super) struct Meshes<'d, 'a> {
    document: &'d Document<'a>,
    pub primitives: Primitives<'d, 'a>,
    pub materials: Vec<Material>,
    /// Of primitives that name none.
    default_material: Option<usize>,
    /// By index in the file.
    known: HashMap<usize, Shown>,
    /// How many joints each geometry that is bound to some uses.
    n_joints: HashMap<usize, usize>,
}

struct Shown {
    parts: Vec<Part>,
    /// One a morph target.
    weights: Vec<f32>,
}

impl<'d, 'a> Meshes<'d, 'a> {
    pub fn new(document: &'d Document<'a>, materials: Vec<Material>) -> Self {
        Self {
            document,
            primitives: Primitives::new(document),
            materials,
            default_material: None,
            known: HashMap::new(),
            n_joints: HashMap::new(),
        }
    }

    /// The parts and morph weights of a node with the mesh that `reference` names; `weights` are the node's
    /// own.
    pub fn refer(
        &mut self,
        reference: &Json<'a>,
        weights: Option<&Json<'a>>,
    ) -> Result<(Vec<Part>, Vec<f32>)> {
        let mesh = self.document.referred("meshes", reference)?;
        let index = reference.index()?;
        if !self.known.contains_key(&index) {
            let shown = self.read(&mesh)?;
            self.known.insert(index, shown);
            self.document.progress.advance(1);
        }
        let Shown { parts, weights: defaults } = &self.known[&index];
        self.document.charge(&mesh, parts.len(), size_of::<Part>())?;
        self.document.charge(&mesh, defaults.len(), size_of::<f32>())?;
        let weights = weights.map(|weights| read_weights(weights, defaults.len()));
        Ok((parts.clone(), weights.transpose()?.unwrap_or_else(|| defaults.clone())))
    }

    /// How many joints the parts use; 0 if none is bound to any.
    pub fn most_joints(&self, parts: &[Part]) -> usize {
        let n_joints = parts.iter().filter_map(|part| self.n_joints.get(&part.geometry));
        n_joints.copied().max().unwrap_or(0)
    }

    fn read(&mut self, mesh: &Json<'a>) -> Result<Shown> {
        let mut parts = Vec::new();
        let mut n_targets = None;
        for primitive in mesh.need("primitives")?.items()? {
            let targets = primitive.list("targets")?;
            if let Some(n) = n_targets.filter(|n| *n != targets.len()) {
                let found = format!("{} morph targets", targets.len());
                return Err(primitive.error(found, format!("{n}, as in the first primitive")));
            }
            n_targets = Some(targets.len());
            let material = self.material(&primitive)?;
            let Some(geometry) = self.primitives.refer(&primitive)? else { continue };
            if let Some(skin) = self.primitives.geometries[geometry].skin() {
                let most = skin.joints.as_flattened().iter().max().map_or(0, |joint| *joint);
                self.n_joints.insert(geometry, usize::from(most) + 1);
            }
            parts.push(Part { geometry, material });
        }
        let n_targets = n_targets.unwrap_or(0);
        let weights = mesh.get("weights").map(|weights| read_weights(&weights, n_targets));
        let weights = weights.transpose()?.unwrap_or_else(|| vec![0.0; n_targets]);
        Ok(Shown { parts, weights })
    }

    fn material(&mut self, primitive: &Json<'a>) -> Result<usize> {
        if let Some(reference) = primitive.get("material") {
            self.document.referred("materials", &reference)?;
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

fn read_weights(json: &Json, n_targets: usize) -> Result<Vec<f32>> {
    let weights: Vec<f32> = json.items()?.map(|weight| weight.float()).collect::<Result<_>>()?;
    if weights.len() == n_targets {
        return Ok(weights);
    }
    Err(json
        .error(format!("{} weights", weights.len()), format!("{n_targets}, one a morph target")))
}
