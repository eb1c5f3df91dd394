//! The way of a ray through a kd-tree: its leaves, front to back, with the interval of its line in each.

use crate::flat::{FieldTree, KdChild, MAX_KD_DEPTH};
use crate::math::{Ray, Vec3, clip_to_box, finite_inverse_vec3};
use crate::trace::counts::{Counted, count};

/// A part of the ray in a node that is still to be visited.
#[derive(Clone, Copy)]
struct Pending {
    node_idx: u32,
    enter: f32,
    leave: f32,
}

/// The interval of a ray's line in a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeafInterval {
    /// Index of the leaf.
    pub leaf_idx: u32,
    /// Distance at which the ray enters the leaf's cell.
    pub enter: f32,
    /// Distance at which the ray leaves the leaf's cell.
    pub leave: f32,
}

impl LeafInterval {
    /// The interval of a ray in no leaf.
    pub const NONE: Self = Self { leaf_idx: u32::MAX, enter: 0.0, leave: 0.0 };
}

/// The leaves on a ray that are not empty. Its memory is reused from ray to ray.
pub struct KdWalk<'t> {
    tree: &'t FieldTree,
    origin: Vec3,
    inverse: Vec3,
    /// The range of the ray.
    range: (f32, f32),
    pending: [Pending; MAX_KD_DEPTH + 1],
    n_pending: usize,
}

impl<'t> KdWalk<'t> {
    /// Returns the walk of no ray.
    pub fn new(tree: &'t FieldTree) -> Self {
        let none = Pending { node_idx: 0, enter: 0.0, leave: 0.0 };
        let pending = [none; MAX_KD_DEPTH + 1];
        let range = (0.0, f32::INFINITY);
        Self { tree, origin: Vec3::ZERO, inverse: Vec3::ZERO, range, pending, n_pending: 0 }
    }

    /// Starts where the line of a ray enters the tree.
    #[inline(always)]
    pub fn start(&mut self, ray: &Ray) {
        self.n_pending = 0;
        self.origin = ray.origin;
        self.range = (ray.t_min, ray.t_max);
        self.inverse = Vec3::from(finite_inverse_vec3(ray.direction.into()));
        let Some(bounds) = self.tree.bounds() else { return };
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let (origin, inverse) = (self.origin.to_array(), self.inverse.to_array());
        // Intervals do not depend on the range, nor does the place where a zero is found in them.
        let line = (f32::NEG_INFINITY, f32::INFINITY);
        let (enter, leave) = clip_to_box(line, &origin, &inverse, &min, &max);
        if enter <= leave {
            self.pending[0] = Pending { node_idx: 0, enter, leave };
            self.n_pending = 1;
        }
    }

    /// Returns the next leaf in which some of the ray's range lies.
    #[inline(always)]
    pub fn next_leaf(&mut self) -> Option<LeafInterval> {
        while 0 < self.n_pending {
            self.n_pending -= 1;
            let Pending { mut node_idx, mut enter, mut leave } = self.pending[self.n_pending];
            while enter <= self.range.1 {
                match self.tree.node(node_idx) {
                    KdChild::Empty => break,
                    KdChild::Leaf(_) if leave < self.range.0 => break,
                    KdChild::Leaf(leaf_idx) => {
                        count(Counted::Cells, 1);
                        return Some(LeafInterval { leaf_idx, enter, leave });
                    }
                    KdChild::Split { axis, at, first_child } => {
                        let crossing = (at - self.origin[axis]) * self.inverse[axis];
                        // The children differ for NaN, too: each node is visited once at most.
                        let is_upper_near = self.inverse[axis] < 0.0;
                        let near = first_child + u32::from(is_upper_near);
                        let far = first_child + u32::from(!is_upper_near);
                        if crossing <= enter.max(self.range.0) {
                            (node_idx, enter) = (far, enter.max(crossing));
                        } else if leave <= crossing {
                            node_idx = near;
                        } else {
                            self.pending[self.n_pending] =
                                Pending { node_idx: far, enter: crossing, leave };
                            self.n_pending += 1;
                            (node_idx, leave) = (near, crossing);
                        }
                    }
                }
            }
        }
        None
    }
}
