//! Which nodes the scene has, parents before their children.

use std::collections::HashSet;

use super::document::Document;
use super::json::Json;
use crate::error::Result;

/// The graph's first node turns the scene upright; those of the file follow.
pub(super) const ROOT: usize = 0;

pub(super) struct Hierarchy<'a> {
    /// Nodes of the file; the graph has each at its place here plus one.
    pub entries: Vec<Entry<'a>>,
    /// Place in `entries` of each node of the file, if it is needed.
    places: Vec<Option<usize>>,
}

pub(super) struct Entry<'a> {
    pub json: Json<'a>,
    /// Index in the graph.
    pub parent: usize,
    /// False for what carries joints but belongs to another scene.
    pub is_in_scene: bool,
    /// Whether neither the node nor one above it is hidden (KHR_node_visibility).
    pub is_visible: bool,
}

/// All nodes of the file, and who is whose child.
struct Family<'a> {
    nodes: Vec<Json<'a>>,
    parents: Vec<Option<usize>>,
    children: Vec<Vec<usize>>,
}

impl<'a> Hierarchy<'a> {
    pub fn read(document: &Document<'a>) -> Result<Self> {
        let family = Family::read(document)?;
        let mut hierarchy = Self { entries: Vec::new(), places: vec![None; family.nodes.len()] };
        for root in family.roots(document)? {
            hierarchy.visit(&family, root, true)?;
        }
        // Joints should be in the scene, but there are files where they are not.
        for joint in hierarchy.joints(document)? {
            if hierarchy.places[joint].is_none() {
                hierarchy.visit(&family, family.top(joint), false)?;
            }
        }
        Ok(hierarchy)
    }

    /// Index in the graph of the node that `reference` names, if it is there.
    pub fn node(&self, document: &Document<'a>, reference: &Json<'a>) -> Result<Option<usize>> {
        document.referred("nodes", reference)?;
        Ok(self.places.get(reference.index()?).copied().flatten().map(|place| place + 1))
    }

    /// Takes in a node and all below it.
    fn visit(&mut self, family: &Family<'a>, node: usize, is_in_scene: bool) -> Result<()> {
        // Not by recursion: chains of nodes may be of any length.
        let mut open = vec![(node, ROOT, true)];
        while let Some((node, parent, is_parent_visible)) = open.pop() {
            let json = family.nodes[node].clone();
            let own = json.extension("KHR_node_visibility");
            let own = own.map_or(Ok(true), |own| own.flag_or("visible", true))?;
            let is_visible = is_parent_visible && own;
            self.places[node] = Some(self.entries.len());
            self.entries.push(Entry { json, parent, is_in_scene, is_visible });
            let place = self.entries.len();
            let children = family.children[node].iter().rev();
            open.extend(children.map(|child| (*child, place, is_visible)));
        }
        Ok(())
    }

    /// The nodes of the file that are joints of what is in the scene.
    fn joints(&self, document: &Document<'a>) -> Result<Vec<usize>> {
        let mut seen = HashSet::new();
        let mut joints = Vec::new();
        for entry in &self.entries {
            let Some(reference) = entry.json.get("skin") else { continue };
            let skin = document.referred("skins", &reference)?;
            if !seen.insert(reference.index()?) {
                continue;
            }
            for joint in skin.need("joints")?.items()? {
                document.referred("nodes", &joint)?;
                joints.push(joint.index()?);
            }
        }
        Ok(joints)
    }
}

impl<'a> Family<'a> {
    fn read(document: &Document<'a>) -> Result<Self> {
        let nodes = document.root.list("nodes")?;
        let n = nodes.len();
        let mut family = Self { parents: vec![None; n], children: vec![Vec::new(); n], nodes };
        for (parent, node) in family.nodes.iter().enumerate() {
            for child in node.list("children")? {
                document.referred("nodes", &child)?;
                let index = child.index()?;
                if let Some(other) = family.parents[index] {
                    let found = format!("node {index}, which is below node {other} already");
                    return Err(child.error(found, "a node without parent"));
                }
                family.parents[index] = Some(parent);
                family.children[parent].push(index);
            }
        }
        family.check_cycles()?;
        Ok(family)
    }

    /// Every node has to be below one without parent.
    fn check_cycles(&self) -> Result<()> {
        let mut is_reached = vec![false; self.nodes.len()];
        let is_root = |node: &usize| self.parents[*node].is_none();
        let mut open: Vec<usize> = (0..self.nodes.len()).filter(is_root).collect();
        while let Some(node) = open.pop() {
            is_reached[node] = true;
            open.extend(&self.children[node]);
        }
        let Some(mut node) = is_reached.iter().position(|reached| !reached) else { return Ok(()) };
        // It may hang below the cycle: as many steps up as there are nodes end in it.
        for _ in &self.nodes {
            node = self.parents[node].unwrap_or(node);
        }
        let found = format!("node {node}{} below itself", self.nodes[node].title());
        Err(self.nodes[node].error(found, "nodes without cycles"))
    }

    /// The nodes at the top of the scene that the file shows first.
    fn roots(&self, document: &Document<'a>) -> Result<Vec<usize>> {
        let scene = match document.root.get("scene") {
            Some(reference) => Some(document.referred("scenes", &reference)?),
            None => document.root.list("scenes")?.into_iter().next(),
        };
        let Some(scene) = scene else {
            let has_parent = |node: &usize| self.parents[*node].is_some();
            return Ok((0..self.nodes.len()).filter(|node| !has_parent(node)).collect());
        };
        let mut is_root = vec![false; self.nodes.len()];
        let mut roots = Vec::new();
        for reference in scene.list("nodes")? {
            document.referred("nodes", &reference)?;
            let node = reference.index()?;
            if self.parents[node].is_some() || is_root[node] {
                let found = format!("node {node}, which is below another or named before");
                return Err(reference.error(found, "each node once, at the top"));
            }
            is_root[node] = true;
            roots.push(node);
        }
        Ok(roots)
    }

    fn top(&self, mut node: usize) -> usize {
        while let Some(parent) = self.parents[node] {
            node = parent;
        }
        node
    }
}
