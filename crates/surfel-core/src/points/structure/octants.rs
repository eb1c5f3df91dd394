//! Octants of directions in a plane, and whether points lie on all sides of another.

use crate::math::{Basis, Vec3};

/// A set of octants, a bit each.
#[derive(Clone, Copy, Default)]
pub struct Octants(u8);

impl Octants {
    /// All octants.
    pub const ALL: Self = Self(u8::MAX);

    /// Returns the octants of offsets in the plane of a basis.
    pub fn of(basis: &Basis, offsets: impl Iterator<Item = Vec3>) -> Self {
        let mut octants = Self::default();
        offsets.for_each(|offset| octants.insert(octant_around(basis, offset)));
        octants
    }

    /// Adds an octant.
    pub fn insert(&mut self, octant: usize) {
        self.0 |= 1 << octant;
    }

    /// Returns whether the set has an octant.
    pub fn contains(self, octant: usize) -> bool {
        self.0 >> octant & 1 == 1
    }

    /// Returns the octants of both sets.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns whether at least so many successive octants are empty.
    pub fn has_gap(self, min_empty: usize) -> bool {
        let empty = !self.0;
        let run = (1..min_empty).fold(empty, |run, n| run & empty.rotate_right(n as u32));
        run != 0
    }
}

/// Returns the octant of a direction in the plane of a basis, counterclockwise from the tangent.
pub fn octant_around(basis: &Basis, offset: Vec3) -> usize {
    octant(basis.tangent.dot(offset), basis.bitangent.dot(offset))
}

/// Returns the octant of a direction, counterclockwise from x.
pub fn octant(x: f32, y: f32) -> usize {
    let quadrant = match (x < 0.0, y < 0.0) {
        (false, false) => 0,
        (true, false) => 1,
        (true, true) => 2,
        (false, true) => 3,
    };
    let is_steep = x.abs() < y.abs();
    2 * quadrant + usize::from(is_steep != (quadrant % 2 == 1))
}

#[cfg(test)]
mod tests {
    //! Octants in their order, and gaps across the first of them.

    use super::*;

    #[test]
    fn octants_go_round_and_empty_ones_are_a_gap() {
        for index in 0..8 {
            let turn = (index as f32 + 0.5) * std::f32::consts::FRAC_PI_4;
            assert_eq!(octant(turn.cos(), turn.sin()), index);
        }
        assert!(Octants(0b0001_1111).has_gap(3) && Octants(0b0111_1100).has_gap(3));
        assert!(!Octants(0b0101_0101).has_gap(3) && !Octants(0b0011_1111).has_gap(3));
        assert!(Octants(0b0011_1111).has_gap(2) && !Octants(0b0101_0101).has_gap(2));
    }
}
