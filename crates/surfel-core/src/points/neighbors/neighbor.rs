//! Neighbours, their distances, and their sort keys.

use crate::error::{Error, Result};
use crate::math::Vec3;

/// A neighbour of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Neighbor {
    /// Index of the neighbour.
    pub index: u32,
    /// Squared distance between the two points.
    pub distance_squared: f32,
}

/// The neighbours of a point. A point is never its own neighbour, but its duplicates are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Neighborhood {
    /// The k nearest points, or all others if there are fewer. Among equally distant points lower indices come first.
    Nearest(usize),
    /// All points within this distance.
    Within(f32),
}

/// Returns the ratio of the spacing of points on a surface to the distance within which each has so many neighbours.
pub(crate) fn spacing_per_reach(n_neighbors: f32) -> f32 {
    (std::f32::consts::PI / n_neighbors).sqrt()
}

/// Computes a squared distance in the one order of operations that all methods share, so that they agree to the bit.
pub(super) fn distance_squared(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x * d.x + d.y * d.y + d.z * d.z
}

/// Encodes a neighbour as one number that sorts by distance, then by index. Squares are not negative, so their bits
/// sort as they do.
pub(super) fn key(distance_squared: f32, index: u32) -> u64 {
    (u64::from(distance_squared.to_bits()) << 32) | u64::from(index)
}

/// Decodes a key.
pub(super) fn neighbor(key: u64) -> Neighbor {
    Neighbor { index: key as u32, distance_squared: f32::from_bits((key >> 32) as u32) }
}

/// Returns the square of a distance. Fails unless it is a normal number, whose rounding error does not matter.
pub(super) fn checked_square(distance: f32) -> Result<f32> {
    let square = distance * distance;
    if 0.0 < distance && square.is_normal() {
        return Ok(square);
    }
    let expected = "a positive number between 1e-18 and 1e19";
    Err(Error::Setting { name: "neighbour distance", found: distance.to_string(), expected })
}
