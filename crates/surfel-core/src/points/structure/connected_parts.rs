//! Connected parts: points that are linked to some of their nearest neighbours.

use crate::error::Result;
use crate::points::neighbors::{KdTree, SignedUnionFind};
use crate::progress::Progress;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Number of neighbours with which a point may be linked.
const N_LINKS: usize = 8;
/// Number of points whose links are kept at a time.
const CHUNK: usize = 1 << 16;

/// Returns the connected parts of the points that are members, each in ascending order. `is_linked` decides about two members
/// of which one is a near neighbour of the other.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn connected_parts(
    tree: &KdTree,
    is_member: impl Fn(usize) -> bool + Sync,
    is_linked: impl Fn(usize, usize) -> bool + Sync,
    progress: &dyn Progress,
) -> Result<Vec<Vec<u32>>> {
    let positions = tree.positions();
    let links = |point: usize| -> Result<Vec<u32>> {
        progress.check()?;
        if !is_member(point) {
            return Ok(Vec::new());
        }
        let nearest = tree.nearest(positions[point], N_LINKS, Some(point as u32));
        let is_linked =
            |other: &u32| is_member(*other as usize) && is_linked(point, *other as usize);
        Ok(nearest.iter().map(|neighbor| neighbor.index).filter(is_linked).collect())
    };
    let mut components = SignedUnionFind::new(positions.len());
    for start in (0..positions.len()).step_by(CHUNK) {
        let chunk = start..positions.len().min(start + CHUNK);
        let links = chunk.clone().into_par_iter().map(links);
        let links: Vec<Vec<u32>> = links.collect::<Result<_>>()?;
        for (point, links) in chunk.zip(links) {
            for other in links {
                let (own, other) = (components.find(point as u32), components.find(other));
                components.join(own, other, false);
            }
        }
    }
    let mut parts: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for point in (0..positions.len()).filter(|point| is_member(*point)) {
        parts.entry(components.find(point as u32).root).or_default().push(point as u32);
    }
    Ok(parts.into_values().collect())
}
