//! The nodes of the scene, parents before their children.

use std::collections::HashSet;

use super::document::Document;
use super::json::Json;
use crate::error::Result;

/// Index in the graph of the root node, which rotates the scene to Z up. The nodes of the file follow.
pub(super) const ROOT: usize = 0;

/// The nodes that the scene needs, in the order of the graph.
pub(super) struct Hierarchy<'a> {
    /// Nodes of the file. The node at index `i` has index `i + 1` in the graph.
    pub entries: Vec<Entry<'a>>,
    /// Index in `entries` of each node of the file, if it is needed.
    entry_idx: Vec<Option<usize>>,
}

/// A node of the file in the scene.
pub(super) struct Entry<'a> {
    /// The node's JSON.
    pub json: Json<'a>,
    /// Index of the parent in the graph.
    pub parent: usize,
    /// False for a node that carries joints but belongs to another scene.
    pub is_in_scene: bool,
    /// False if KHR_node_visibility hides the node or one of its ancestors.
    pub is_visible: bool,
}

/// The parents and children of all nodes of the file.
struct NodeTree<'a> {
    nodes: Vec<Json<'a>>,
    parents: Vec<Option<usize>>,
    children: Vec<Vec<usize>>,
}

impl<'a> Hierarchy<'a> {
    /// Reads the nodes of the scene that the document shows.
    pub fn read(document: &Document<'a>) -> Result<Self> {
        let tree = NodeTree::read(document)?;
        let mut hierarchy = Self { entries: Vec::new(), entry_idx: vec![None; tree.nodes.len()] };
        for root in tree.roots(document)? {
            hierarchy.add_subtree(&tree, root, true)?;
        }
        // Joints should be in the scene, but some files violate this.
        for joint in hierarchy.joints(document)? {
            if hierarchy.entry_idx[joint].is_none() {
                hierarchy.add_subtree(&tree, tree.root_of(joint), false)?;
            }
        }
        Ok(hierarchy)
    }

    /// Returns the index in the graph of the node at the index `reference`, if the scene has it.
    pub fn graph_idx(
        &self,
        document: &Document<'a>,
        reference: &Json<'a>,
    ) -> Result<Option<usize>> {
        document.resolve("nodes", reference)?;
        Ok(self.entry_idx.get(reference.index()?).copied().flatten().map(|entry| entry + 1))
    }

    /// Adds a node and its descendants.
    fn add_subtree(&mut self, tree: &NodeTree<'a>, node: usize, is_in_scene: bool) -> Result<()> {
        // An explicit stack, because chains of nodes may have any length.
        let mut stack = vec![(node, ROOT, true)];
        while let Some((node, parent, is_parent_visible)) = stack.pop() {
            let json = tree.nodes[node].clone();
            let own = json.extension("KHR_node_visibility");
            let own = own.map_or(Ok(true), |own| own.boolean_or("visible", true))?;
            let is_visible = is_parent_visible && own;
            self.entry_idx[node] = Some(self.entries.len());
            self.entries.push(Entry { json, parent, is_in_scene, is_visible });
            let graph_idx = self.entries.len();
            let children = tree.children[node].iter().rev();
            stack.extend(children.map(|child| (*child, graph_idx, is_visible)));
        }
        Ok(())
    }

    /// Returns the nodes of the file that are joints of skins in the scene.
    fn joints(&self, document: &Document<'a>) -> Result<Vec<usize>> {
        let mut visited_skins = HashSet::new();
        let mut joints = Vec::new();
        for entry in &self.entries {
            let Some(reference) = entry.json.get("skin") else { continue };
            let skin = document.resolve("skins", &reference)?;
            if !visited_skins.insert(reference.index()?) {
                continue;
            }
            for joint in skin.require("joints")?.array()? {
                document.resolve("nodes", &joint)?;
                joints.push(joint.index()?);
            }
        }
        Ok(joints)
    }
}

impl<'a> NodeTree<'a> {
    fn read(document: &Document<'a>) -> Result<Self> {
        let nodes = document.root.array_or_empty("nodes")?;
        let n = nodes.len();
        let mut tree = Self { parents: vec![None; n], children: vec![Vec::new(); n], nodes };
        for (parent, node) in tree.nodes.iter().enumerate() {
            for child in node.array_or_empty("children")? {
                document.resolve("nodes", &child)?;
                let index = child.index()?;
                if let Some(other) = tree.parents[index] {
                    let found = format!("node {index}, which is already a child of node {other}");
                    return Err(child.error(found, "a node without parent"));
                }
                tree.parents[index] = Some(parent);
                tree.children[parent].push(index);
            }
        }
        tree.check_cycles()?;
        Ok(tree)
    }

    /// Checks that every node is reachable from a node without parent.
    fn check_cycles(&self) -> Result<()> {
        let mut is_reachable = vec![false; self.nodes.len()];
        let is_root = |node: &usize| self.parents[*node].is_none();
        let mut stack: Vec<usize> = (0..self.nodes.len()).filter(is_root).collect();
        while let Some(node) = stack.pop() {
            is_reachable[node] = true;
            stack.extend(&self.children[node]);
        }
        let Some(mut node) = is_reachable.iter().position(|reached| !reached) else {
            return Ok(());
        };
        // The node may hang below the cycle; as many steps up as there are nodes lead into it.
        for _ in &self.nodes {
            node = self.parents[node].unwrap_or(node);
        }
        let found = format!("node {node}{} below itself", self.nodes[node].quoted_name());
        Err(self.nodes[node].error(found, "nodes without cycles"))
    }

    /// Returns the root nodes of the default scene.
    fn roots(&self, document: &Document<'a>) -> Result<Vec<usize>> {
        let scene = match document.root.get("scene") {
            Some(reference) => Some(document.resolve("scenes", &reference)?),
            None => document.root.array_or_empty("scenes")?.into_iter().next(),
        };
        let Some(scene) = scene else {
            let has_parent = |node: &usize| self.parents[*node].is_some();
            return Ok((0..self.nodes.len()).filter(|node| !has_parent(node)).collect());
        };
        let mut is_root = vec![false; self.nodes.len()];
        let mut roots = Vec::new();
        for reference in scene.array_or_empty("nodes")? {
            document.resolve("nodes", &reference)?;
            let node = reference.index()?;
            if self.parents[node].is_some() || is_root[node] {
                let found = format!("node {node}, which has a parent or is listed before");
                return Err(reference.error(found, "each root node once"));
            }
            is_root[node] = true;
            roots.push(node);
        }
        Ok(roots)
    }

    /// Returns the topmost ancestor of a node.
    fn root_of(&self, mut node: usize) -> usize {
        while let Some(parent) = self.parents[node] {
            node = parent;
        }
        node
    }
}
