//! Connected components of points that are linked one by one, and on which side of a component each point is.

use crate::error::Result;
use crate::progress::Progress;

/// A point as a member of a connected component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Member {
    /// The component's root point.
    pub root: u32,
    /// True if the point is opposite to the root.
    pub is_flipped: bool,
}

/// Two components that became one.
#[derive(Clone, Copy)]
pub struct Joined {
    /// The root of both.
    pub root: u32,
    /// The point that was the root of one of them.
    pub former_root: u32,
    /// True if the former root is opposite to the root.
    pub is_flipped: bool,
}

/// A union-find structure whose members have a sign relative to their root.
pub struct SignedUnionFind {
    /// Parents as `parent << 1 | is_flipped`.
    parents: Vec<u64>,
    sizes: Vec<u32>,
}

impl SignedUnionFind {
    /// Makes each point a component of its own.
    pub fn new(n_points: usize) -> Self {
        let parents = (0..n_points as u64).map(|i| i << 1).collect();
        Self { parents, sizes: vec![1; n_points] }
    }

    /// Returns the component of a point.
    pub fn find(&mut self, point: u32) -> Member {
        let (mut at, mut is_flipped) = (point as usize, false);
        loop {
            let parent = self.parents[at];
            if (parent >> 1) as usize == at {
                return Member { root: at as u32, is_flipped };
            }
            // Path halving: the parent becomes the grandparent, with both signs.
            let above = self.parents[(parent >> 1) as usize];
            let grandparent = above ^ (parent & 1);
            self.parents[at] = grandparent;
            is_flipped ^= grandparent & 1 == 1;
            at = (grandparent >> 1) as usize;
        }
    }

    /// Returns the component of each point.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn members(&mut self, progress: &dyn Progress) -> Result<Vec<Member>> {
        let mut members = Vec::with_capacity(self.parents.len());
        for point in 0..self.parents.len() as u32 {
            if point.is_multiple_of(1 << 16) {
                progress.check()?;
            }
            members.push(self.find(point));
        }
        Ok(members)
    }

    /// Returns the number of points of the component with this root.
    pub fn size(&self, root: u32) -> u32 {
        self.sizes[root as usize]
    }

    /// Joins the components of two points, which are opposite to each other or not; `None` if they are one already. The root of
    /// the larger component remains.
    pub fn join(&mut self, a: Member, b: Member, is_opposite: bool) -> Option<Joined> {
        if a.root == b.root {
            return None;
        }
        let is_flipped = a.is_flipped ^ b.is_flipped ^ is_opposite;
        let (above, below) =
            if self.size(a.root) < self.size(b.root) { (b.root, a.root) } else { (a.root, b.root) };
        self.parents[below as usize] = u64::from(above) << 1 | u64::from(is_flipped);
        self.sizes[above as usize] += self.sizes[below as usize];
        Some(Joined { root: above, former_root: below, is_flipped })
    }
}

#[cfg(test)]
mod tests {
    //! Components of a few points, with their sides.

    use super::*;
    use crate::progress::NoProgress;

    #[test]
    fn signs_and_sizes_follow_the_links() {
        let mut sets = SignedUnionFind::new(6);
        for (a, b, is_opposite) in [(0, 1, true), (2, 3, false), (3, 1, true), (4, 5, true)] {
            let (a, b) = (sets.find(a), sets.find(b));
            assert!(sets.join(a, b, is_opposite).is_some());
        }
        let (a, b) = (sets.find(0), sets.find(2));
        assert!(sets.join(a, b, false).is_none());
        let members = sets.members(&NoProgress).unwrap();
        let is_opposite = |a: usize, b: usize| {
            assert_eq!(members[a].root, members[b].root);
            members[a].is_flipped != members[b].is_flipped
        };
        assert!(is_opposite(0, 1) && !is_opposite(2, 3) && is_opposite(3, 1) && !is_opposite(0, 2));
        assert!(is_opposite(4, 5) && members[4].root != members[0].root);
        assert_eq!([sets.size(members[0].root), sets.size(members[4].root)], [4, 2]);
    }
}
