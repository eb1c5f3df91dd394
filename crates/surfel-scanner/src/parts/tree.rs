//! Crowns of trees: leaves in the cells of a grid.

use super::stone;
use crate::classes::HIGH_VEGETATION;
use crate::noise::{noise, unit};
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;
use surfel_core::math::hash;

/// The outline of a crown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CrownShape {
    /// The crown fills the ellipsoid in its box, as that of an oak.
    Ellipsoid,
    /// The crown fills the cone in its box, as that of a spruce.
    Cone,
}

/// The leaves of a tree: flat discs, at most one in each cell of a grid.
pub struct Crown {
    /// Outline.
    pub shape: CrownShape,
    /// Centre of the box around the crown.
    pub center: DVec3,
    /// Half sizes of the box.
    pub half: DVec3,
    /// Width of a cell in metres; leaves are about half as wide.
    pub cell: f64,
    /// Fraction of cells with a leaf.
    pub fill: f64,
    /// Seed of the leaves.
    pub seed: u64,
}

/// Half the thickness of a leaf. Normals are differences over 2 mm.
const HALF_THICKNESS: f64 = 0.004;
/// Distance that leaves keep from the faces of their cell.
const MARGIN: f64 = 0.012;
impl Crown {
    /// Returns less than 1 inside of the outline, and more outside.
    fn level(&self, point: DVec3) -> f64 {
        let q = (point - self.center) / self.half;
        match self.shape {
            CrownShape::Ellipsoid => q.length(),
            // The radius falls from 1 at the bottom to 0 at the top.
            CrownShape::Cone => (q.truncate().length() + 0.5 * (q.z + 1.0)).max(-q.z),
        }
    }

    /// Returns the distance to the leaf of a cell, or infinity if the cell is empty. `point` is relative to the
    /// middle of the cell.
    fn leaf_distance(&self, cell: DVec3, point: DVec3) -> f64 {
        let middle = (cell + DVec3::splat(0.5)) * self.cell;
        let clumps = 0.6 * noise(middle * 1.1 + DVec3::splat(9.0 * unit(self.seed)));
        let key = self.key(cell);
        if 1.0 < self.level(middle) || self.fill * (1.0 + clumps) < unit(key) {
            return f64::INFINITY;
        }
        let radius = self.cell * (0.2 + 0.1 * unit(key ^ 1));
        let freedom = 0.5 * self.cell - MARGIN - radius.hypot(HALF_THICKNESS);
        let signed = |salt: u64| 2.0 * unit(key ^ salt) - 1.0;
        let offset = point - freedom * DVec3::new(signed(2), signed(3), signed(4));
        let normal = DVec3::new(signed(5), signed(6), 0.3 + signed(7)).normalize_or(DVec3::Z);
        let height = normal.dot(offset);
        let across = (offset - height * normal).length();
        let (beside, above) = (across - radius, height.abs() - HALF_THICKNESS);
        beside.max(0.0).hypot(above.max(0.0)) + beside.max(above).min(0.0)
    }

    fn key(&self, cell: DVec3) -> u64 {
        let [x, y, z] = cell.to_array().map(|c| c as i64 as u64);
        hash(self.seed ^ hash(x ^ hash(y ^ hash(z))))
    }
}

impl Sdf for Crown {
    fn distance(&self, point: DVec3) -> f64 {
        let outside = DAabb::around(self.center, self.half).distance(point);
        if self.cell < outside {
            return outside - 0.5 * self.cell;
        }
        let cell = (point / self.cell).floor();
        let local = point - (cell + DVec3::splat(0.5)) * self.cell;
        // Leaves of other cells are at least as far away as the nearest face and their margin.
        let other_cells = 0.5 * self.cell - local.abs().max_element() + MARGIN;
        self.leaf_distance(cell, local).min(other_cells)
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        let depth = 1.0 - 2.0 * self.level(point);
        stone::leaves(point, depth, unit(self.seed ^ 0x77))
    }

    fn bounds(&self) -> DAabb {
        DAabb::around(self.center, self.half + DVec3::splat(0.5 * self.cell))
    }

    fn class(&self) -> u8 {
        HIGH_VEGETATION
    }
}

#[cfg(test)]
mod tests {
    //! Leaves fill their fraction of the crown, and distances to them are never too long.

    use super::*;
    use surfel_core::math::Random;

    fn crown(shape: CrownShape) -> Crown {
        let center = DVec3::new(1.0, 2.0, 5.0);
        Crown { shape, center, half: DVec3::new(2.0, 2.0, 3.0), cell: 0.2, fill: 0.4, seed: 3 }
    }

    #[test]
    fn a_fraction_of_cells_has_a_leaf() {
        let crown = crown(CrownShape::Ellipsoid);
        let middle = (crown.center / crown.cell).floor();
        let cells = (0..1000).map(|i| {
            let offset = [i % 10, i / 10 % 10, i / 100].map(|c| f64::from(c) - 5.0);
            middle + DVec3::from_array(offset)
        });
        let n_leaves =
            cells.filter(|&cell| crown.leaf_distance(cell, DVec3::ZERO).is_finite()).count();
        assert!((250..600).contains(&n_leaves), "{n_leaves}");
    }

    #[test]
    fn no_leaf_is_nearer_than_the_distance() {
        for shape in [CrownShape::Ellipsoid, CrownShape::Cone] {
            let crown = crown(shape);
            let mut random = Random::new(1, 0);
            for _ in 0..20_000 {
                let mut vector =
                    || DVec3::from_array([(); 3].map(|()| 2.0 * random.next_f64() - 1.0));
                let point = crown.center + crown.half * 1.1 * vector();
                let step = 0.01 * vector();
                let distance = crown.distance(point);
                let moved = crown.distance(point + step);
                // Where the nearest leaf is in another cell, the distance is a lower bound that may jump up.
                if moved <= 0.0 {
                    assert!(distance <= step.length() + 1e-9, "{distance} before {moved}");
                }
            }
        }
    }
}
