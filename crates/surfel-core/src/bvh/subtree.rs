//! The tree under construction, before nodes and blocks have indices.

/// A node under construction.
pub(super) struct Branch {
    /// Up to eight children.
    pub children: Vec<Subtree>,
    /// Number of nodes below this one.
    pub n_nodes: usize,
    /// Number of blocks below this node.
    pub n_blocks: usize,
}

/// A child of a node under construction.
pub(super) enum Subtree {
    /// A node.
    Branch(Branch),
    /// A block of consecutive primitives.
    Block {
        /// Index of the first primitive.
        offset: usize,
        /// Number of primitives.
        len: usize,
    },
}

impl Branch {
    /// Returns a node over `children`.
    pub fn over(children: Vec<Subtree>) -> Self {
        let (mut n_nodes, mut n_blocks) = (0, 0);
        for child in &children {
            match child {
                Subtree::Branch(branch) => {
                    n_nodes += 1 + branch.n_nodes;
                    n_blocks += branch.n_blocks;
                }
                Subtree::Block { .. } => n_blocks += 1,
            }
        }
        Self { children, n_nodes, n_blocks }
    }
}
