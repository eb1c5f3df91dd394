//! Signs of normals along a minimum spanning tree of the neighbour graph (Hoppe et al. 1992), cut where it contradicts the
//! outer sides that rays tell.

use super::outward_votes::{Voter, outward_votes};
use crate::error::Result;
use crate::math::{DVec3, Vec3};
use crate::points::neighbors::{KdTree, Member, Neighborhood, SignedUnionFind};
use crate::progress::Progress;
use crate::words::counted;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};

/// Number of neighbours that each point is linked to. Each link takes about 10 bytes per point for a while.
const DEGREE: usize = 8;

/// Minimum sum of absolute votes that decide about a component.
const MIN_VOTES: f32 = 2.0;
/// Minimum ratio of the sum of these votes to that of their absolute values.
const MIN_AGREEMENT: f32 = 0.5;

/// Marks an unused link.
const NONE: u32 = u32::MAX;

/// Returns true for each normal that is to be flipped.
///
/// # Errors
///
/// Returns [`Error::TooManyPoints`](crate::Error::TooManyPoints) beyond 32-bit indices and
/// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn flips_by_spanning_tree(
    positions: &[Vec3],
    normals: &[Vec3],
    progress: &dyn Progress,
) -> Result<Vec<bool>> {
    let tree = KdTree::new(positions, progress)?;
    let links = tree.map(Neighborhood::Nearest(DEGREE), progress, |_, neighbors| {
        let mut links = [NONE; DEGREE];
        links.iter_mut().zip(neighbors).for_each(|(link, neighbor)| *link = neighbor.index);
        links
    })?;
    let spacing = |(point, links): (usize, &[u32; DEGREE])| {
        let is_used = |link: &&u32| **link != NONE;
        let farthest = links.iter().rfind(is_used).map(|link| positions[*link as usize]);
        farthest.map_or(0.0, |farthest| farthest.distance(positions[point]))
    };
    let spacings: Vec<f32> = links.par_iter().enumerate().map(spacing).collect();
    let voters = outward_votes(&tree, &spacings, normals, progress)?;
    drop((tree, spacings));
    let edges = sorted_edges(&links, normals, progress)?;
    progress.begin("orient", edges.len() as u64);
    let mut components = Components::new(normals.len(), &voters);
    for (edge_idx, &edge) in edges.iter().enumerate() {
        if edge_idx % (1 << 16) == 0 {
            progress.check()?;
            progress.advance((1 << 16).min(edges.len() - edge_idx) as u64);
        }
        let (a, b) = ends(edge, &links);
        components.join(a, b, normals[a as usize].dot(normals[b as usize]) < 0.0);
    }
    drop((edges, links));
    let members = components.sets.members(progress)?;
    let votes = components.votes;
    let (backward, n_components) =
        backward_components(positions, normals, &members, &votes, progress)?;
    let components = counted(n_components, "connected component");
    progress.note(&format!("normals oriented along a spanning tree in {components}"));
    let is_backward = |member: &Member| member.is_flipped != backward.contains(&member.root);
    Ok(members.par_iter().map(is_backward).collect())
}

/// Returns the edges of the neighbour graph as `weight << 40 | link`, the most parallel first.
fn sorted_edges(
    links: &[[u32; DEGREE]],
    normals: &[Vec3],
    progress: &dyn Progress,
) -> Result<Vec<u64>> {
    progress.check()?;
    let edges_of = |point: usize| {
        (0..DEGREE).filter_map(move |link| {
            let other = links[point][link];
            let is_listed_there =
                (other as usize) < point && links[other as usize].contains(&(point as u32));
            if other == NONE || is_listed_there {
                return None;
            }
            let weight = 1.0 - normals[point].dot(normals[other as usize]).abs();
            let steps = (weight.max(0.0) * (1 << 23) as f32) as u64;
            Some(steps << 40 | (point * DEGREE + link) as u64)
        })
    };
    let mut edges: Vec<u64> = (0..links.len()).into_par_iter().flat_map_iter(edges_of).collect();
    progress.check()?;
    edges.par_sort_unstable();
    Ok(edges)
}

fn ends(edge: u64, links: &[[u32; DEGREE]]) -> (u32, u32) {
    let link = (edge & ((1 << 40) - 1)) as usize;
    ((link / DEGREE) as u32, links[link / DEGREE][link % DEGREE])
}

/// Votes of the members of a component.
#[derive(Clone, Copy, Default)]
struct Votes {
    /// Sum of the votes, positive if the normal of the root points outward.
    sum: f32,
    absolute_sum: f32,
}

impl Votes {
    /// Returns true if there are enough votes, and most agree.
    fn are_certain(self) -> bool {
        MIN_VOTES <= self.absolute_sum && MIN_AGREEMENT * self.absolute_sum < self.sum.abs()
    }
}

/// Connected components whose normals have signs, so that these need no traversal of the spanning tree.
struct Components {
    sets: SignedUnionFind,
    /// Votes of the members of each root for its outer side.
    votes: Vec<Votes>,
}

impl Components {
    fn new(n_points: usize, voters: &[Voter]) -> Self {
        let mut votes = vec![Votes::default(); n_points];
        for voter in voters {
            votes[voter.point as usize] = Votes { sum: voter.vote, absolute_sum: voter.vote.abs() };
        }
        Self { sets: SignedUnionFind::new(n_points), votes }
    }

    /// Joins the components of two points, unless the votes of both are certain and contradict this.
    fn join(&mut self, a: u32, b: u32, is_opposite: bool) {
        let (a, b) = (self.sets.find(a), self.sets.find(b));
        let sign = |is_flipped: bool| if is_flipped { -1.0 } else { 1.0 };
        let [of_a, of_b] = [a, b].map(|member| self.votes[member.root as usize]);
        let agreement = sign(a.is_flipped ^ b.is_flipped ^ is_opposite) * of_a.sum * of_b.sum;
        if of_a.are_certain() && of_b.are_certain() && agreement < 0.0 {
            return;
        }
        if let Some(joined) = self.sets.join(a, b, is_opposite) {
            let former = self.votes[joined.former_root as usize];
            let votes = &mut self.votes[joined.root as usize];
            votes.sum += sign(joined.is_flipped) * former.sum;
            votes.absolute_sum += former.absolute_sum;
        }
    }
}

/// Returns the roots of connected components whose normals must all be flipped, and the number of all components.
fn backward_components(
    positions: &[Vec3],
    normals: &[Vec3],
    members: &[Member],
    votes: &[Votes],
    progress: &dyn Progress,
) -> Result<(HashSet<u32>, usize)> {
    let mut components: HashMap<u32, Component> = HashMap::new();
    for (point, member) in members.iter().enumerate() {
        if point % (1 << 16) == 0 {
            progress.check()?;
        }
        let new = Component { highest: point, ..Component::default() };
        let component = components.entry(member.root).or_insert(new);
        if positions[component.highest].z < positions[point].z {
            component.highest = point;
        }
        component.sum += positions[point].as_dvec3();
        component.n_points += 1;
    }
    let n_components = components.len();
    let backward = components.into_iter().filter(|(root, component)| {
        let votes = votes[*root as usize];
        if votes.are_certain() {
            return votes.sum < 0.0;
        }
        let sign = if members[component.highest].is_flipped { -1.0 } else { 1.0 };
        let normal = sign * normals[component.highest].as_dvec3();
        let outward =
            positions[component.highest].as_dvec3() - component.sum / component.n_points as f64;
        // At the top of a wall the normal is level.
        let facing = if 0.2 < normal.z.abs() { normal.z } else { normal.dot(outward) };
        facing < 0.0
    });
    Ok((backward.map(|(root, _)| root).collect(), n_components))
}

#[derive(Default)]
struct Component {
    highest: usize,
    sum: DVec3,
    n_points: usize,
}
