//! Orientation: which of its two sides a point's surface shows.

use super::PointCloud;
use super::neighbors::{Query, Tree};
use crate::error::{Error, Result};
use crate::math::{DVec3, Vec3};
use crate::progress::Progress;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::str::FromStr;

/// Neighbours that each point may pass its orientation to; each costs about 10 bytes a point for a while.
const DEGREE: usize = 8;

/// No neighbour.
const NONE: u32 = u32::MAX;

/// What decides the sign of estimated normals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Orientation {
    /// Nothing: the sign has no meaning.
    #[default]
    None,
    /// Toward these world coordinates, as where a scanner stood.
    Viewpoint(DVec3),
    /// Toward +Z, as for airborne scans.
    Up,
    /// Passed on from neighbour to neighbour, the most parallel first (Hoppe et al. 1992). The highest
    /// point of each connected piece looks up, or if it does neither, out.
    SpanningTree,
}

/// `normals` of the points of `cloud`, turned where needed.
pub fn orient(
    cloud: &PointCloud,
    normals: Vec<Vec3>,
    orientation: Orientation,
    progress: &dyn Progress,
) -> Result<Vec<Vec3>> {
    match orientation {
        Orientation::None => Ok(normals),
        Orientation::Viewpoint(world_viewpoint) => {
            let viewpoint = world_viewpoint - cloud.origin;
            Ok(turned(normals, |i, normal| {
                (viewpoint - cloud.positions[i].as_dvec3()).dot(normal.as_dvec3()) < 0.0
            }))
        }
        Orientation::Up => Ok(turned(normals, |_, normal| normal.z < 0.0)),
        Orientation::SpanningTree => by_spanning_tree(&cloud.positions, normals, progress),
    }
}

fn turned(mut normals: Vec<Vec3>, backward: impl Fn(usize, Vec3) -> bool + Sync) -> Vec<Vec3> {
    normals.par_iter_mut().enumerate().for_each(|(i, normal)| {
        if backward(i, *normal) {
            *normal = -*normal;
        }
    });
    normals
}

fn by_spanning_tree(
    positions: &[Vec3],
    normals: Vec<Vec3>,
    progress: &dyn Progress,
) -> Result<Vec<Vec3>> {
    let links =
        Tree::new(positions, progress)?.map(Query::Nearest(DEGREE), progress, |_, neighbors| {
            let mut links = [NONE; DEGREE];
            links.iter_mut().zip(neighbors).for_each(|(link, neighbor)| *link = neighbor.index);
            links
        })?;
    let edges = sorted_edges(&links, &normals, progress)?;
    progress.begin("orient", edges.len() as u64);
    let mut pieces = Pieces::new(normals.len());
    for (place, &edge) in edges.iter().enumerate() {
        if place % (1 << 16) == 0 {
            progress.check()?;
            progress.advance((1 << 16).min(edges.len() - place) as u64);
        }
        let (a, b) = ends(edge, &links);
        pieces.join(a, b, normals[a as usize].dot(normals[b as usize]) < 0.0);
    }
    drop((edges, links));
    let places = pieces.places(progress)?;
    let (backward_pieces, n_pieces) = backward_pieces(positions, &normals, &places, progress)?;
    progress.note(&format!("normals oriented along a spanning tree in {n_pieces} pieces"));
    Ok(turned(normals, |i, _| places[i].flipped != backward_pieces.contains(&places[i].root)))
}

/// Edges of the neighbour graph as `weight << 40 | link`, the most parallel first.
fn sorted_edges(
    links: &[[u32; DEGREE]],
    normals: &[Vec3],
    progress: &dyn Progress,
) -> Result<Vec<u64>> {
    progress.check()?;
    let edges_of = |point: usize| {
        (0..DEGREE).filter_map(move |link| {
            let other = links[point][link];
            let listed_there =
                (other as usize) < point && links[other as usize].contains(&(point as u32));
            if other == NONE || listed_there {
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

/// Where a point belongs, and whether its normal is opposite to that of the piece's root.
#[derive(Clone, Copy)]
struct Place {
    root: u32,
    flipped: bool,
}

/// Disjoint sets whose members know their sign relative to the root: no walk through the tree is needed.
struct Pieces {
    /// `parent << 1 | flipped`.
    parents: Vec<u64>,
    sizes: Vec<u32>,
}

impl Pieces {
    fn new(n_points: usize) -> Self {
        Self { parents: (0..n_points as u64).map(|i| i << 1).collect(), sizes: vec![1; n_points] }
    }

    fn find(&mut self, point: u32) -> Place {
        let (mut at, mut flipped) = (point as usize, false);
        loop {
            let parent = self.parents[at];
            if (parent >> 1) as usize == at {
                return Place { root: at as u32, flipped };
            }
            // Halving the path: point to the grandparent, with both signs.
            let above = self.parents[(parent >> 1) as usize];
            let grandparent = above ^ (parent & 1);
            self.parents[at] = grandparent;
            flipped ^= grandparent & 1 == 1;
            at = (grandparent >> 1) as usize;
        }
    }

    fn places(&mut self, progress: &dyn Progress) -> Result<Vec<Place>> {
        let mut places = Vec::with_capacity(self.parents.len());
        for point in 0..self.parents.len() as u32 {
            if point.is_multiple_of(1 << 16) {
                progress.check()?;
            }
            places.push(self.find(point));
        }
        Ok(places)
    }

    fn join(&mut self, a: u32, b: u32, opposite: bool) {
        let (a, b) = (self.find(a), self.find(b));
        if a.root == b.root {
            return;
        }
        let flip = a.flipped ^ b.flipped ^ opposite;
        let (above, below) = (a.root as usize, b.root as usize);
        let (above, below) =
            if self.sizes[above] < self.sizes[below] { (below, above) } else { (above, below) };
        self.parents[below] = (above as u64) << 1 | u64::from(flip);
        self.sizes[above] += self.sizes[below];
    }
}

/// The roots of pieces that must be turned as a whole, and the number of all pieces.
fn backward_pieces(
    positions: &[Vec3],
    normals: &[Vec3],
    places: &[Place],
    progress: &dyn Progress,
) -> Result<(HashSet<u32>, usize)> {
    let mut pieces: HashMap<u32, Piece> = HashMap::new();
    for (point, place) in places.iter().enumerate() {
        if point % (1 << 16) == 0 {
            progress.check()?;
        }
        let piece = pieces.entry(place.root).or_insert(Piece { top: point, ..Piece::default() });
        if positions[piece.top].z < positions[point].z {
            piece.top = point;
        }
        piece.sum += positions[point].as_dvec3();
        piece.n_points += 1;
    }
    let n_pieces = pieces.len();
    let backward = pieces.into_iter().filter(|(_, piece)| {
        let sign = if places[piece.top].flipped { -1.0 } else { 1.0 };
        let normal = sign * normals[piece.top].as_dvec3();
        let outward = positions[piece.top].as_dvec3() - piece.sum / piece.n_points as f64;
        // A wall's top looks neither up nor down.
        let facing = if 0.2 < normal.z.abs() { normal.z } else { normal.dot(outward) };
        facing < 0.0
    });
    Ok((backward.map(|(root, _)| root).collect(), n_pieces))
}

#[derive(Default)]
struct Piece {
    top: usize,
    sum: DVec3,
    n_points: usize,
}

impl FromStr for Orientation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let viewpoint = |numbers: &str| {
            let numbers: Vec<f64> =
                numbers.split(',').map(|x| x.trim().parse().ok()).collect::<Option<_>>()?;
            let [x, y, z] = numbers.try_into().ok()?;
            let viewpoint = DVec3::new(x, y, z);
            viewpoint.is_finite().then_some(Self::Viewpoint(viewpoint))
        };
        let orientation = match text.split_once(':').unwrap_or((text, "")) {
            ("none", "") => Some(Self::None),
            ("up", "") => Some(Self::Up),
            ("mst", "") => Some(Self::SpanningTree),
            ("viewpoint", numbers) => viewpoint(numbers),
            _ => None,
        };
        orientation.ok_or_else(|| Error::Setting {
            name: "orientation",
            found: text.to_owned(),
            expected: "none, up, mst or viewpoint:x,y,z",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::progress::Silent;

    /// Two balls apart, the outward normals of one third turned inward.
    fn balls() -> (PointCloud, Vec<Vec3>) {
        let mut random = Random::new(1, 0);
        let outward: Vec<Vec3> = (0..4000)
            .map(|_| Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32)))
            .map(Vec3::normalize)
            .collect();
        let center = |i: usize| if i < 2000 { Vec3::ZERO } else { Vec3::new(0.0, 9.0, 30.0) };
        let positions = outward.iter().enumerate().map(|(i, &n)| center(i) + n).collect();
        let mixed = outward.iter().map(|&n| if random.below(3) == 0 { -n } else { n }).collect();
        let mut cloud = PointCloud::from_positions(positions);
        cloud.normals = Some(outward);
        (cloud, mixed)
    }

    #[test]
    fn a_spanning_tree_turns_closed_surfaces_outward() {
        let (cloud, mixed) = balls();
        let found = orient(&cloud, mixed, Orientation::SpanningTree, &Silent).unwrap();
        assert_eq!(Some(found), cloud.normals);
    }

    #[test]
    fn a_spanning_tree_turns_ground_up_whatever_its_shape() {
        for bend in [-0.05f32, 0.0, 0.05] {
            let height = |x: f32, y: f32| bend * (x * x + y * y);
            let place = |i: usize| ((i % 40) as f32 - 20.0, (i / 40) as f32 - 20.0);
            let points = (0..1600).map(|i| {
                let (x, y) = place(i);
                Vec3::new(x, y, height(x, y))
            });
            let cloud = PointCloud::from_positions(points.collect());
            let normals: Vec<Vec3> = (0..1600)
                .map(|i| {
                    let (x, y) = place(i);
                    let sign = if i % 7 < 3 { -1.0 } else { 1.0 };
                    sign * Vec3::new(-2.0 * bend * x, -2.0 * bend * y, 1.0).normalize()
                })
                .collect();
            let found = orient(&cloud, normals, Orientation::SpanningTree, &Silent).unwrap();
            assert!(found.iter().all(|normal| 0.0 < normal.z), "bend {bend}");
        }
    }

    #[test]
    fn a_viewpoint_is_given_in_world_coordinates() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::ZERO, Vec3::X * 10.0]);
        cloud.origin = DVec3::new(1e6, 0.0, 0.0);
        let viewpoint = Orientation::Viewpoint(DVec3::new(1e6 + 5.0, 0.0, 0.0));
        let found = orient(&cloud, vec![Vec3::X; 2], viewpoint, &Silent).unwrap();
        assert_eq!(found, [Vec3::X, -Vec3::X]);
        let found = orient(&cloud, vec![-Vec3::Z, Vec3::Z], Orientation::Up, &Silent).unwrap();
        assert_eq!(found, [Vec3::Z; 2]);
    }

    #[test]
    fn few_or_equal_points_do_no_harm() {
        for positions in [vec![], vec![Vec3::X], vec![Vec3::X; 40], vec![Vec3::NAN, Vec3::X]] {
            let normals = vec![-Vec3::Z; positions.len()];
            let cloud = PointCloud::from_positions(positions);
            let found = orient(&cloud, normals, Orientation::SpanningTree, &Silent).unwrap();
            assert!(found.iter().all(|&normal| normal == Vec3::Z), "{found:?}");
        }
    }

    #[test]
    fn texts() {
        let viewpoint = Orientation::Viewpoint(DVec3::new(1.0, -2.5, 3e5));
        assert_eq!("viewpoint:1, -2.5,3e5".parse::<Orientation>().unwrap(), viewpoint);
        assert_eq!("mst".parse::<Orientation>().unwrap(), Orientation::SpanningTree);
        for text in ["", "up:1", "viewpoint", "viewpoint:1,2", "viewpoint:1,2,nan", "down"] {
            assert!(text.parse::<Orientation>().is_err(), "{text}");
        }
    }
}
