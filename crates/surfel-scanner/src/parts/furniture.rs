//! Furniture of boxes and capsules with sharp edges.

use super::assembly::{Assembly, Solid};
use crate::classes::UNCLASSIFIED;
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

const WOOD: Vec3 = Vec3::new(0.62, 0.45, 0.3);
const CLOTH: Vec3 = Vec3::new(0.35, 0.42, 0.5);
const PAINT: Vec3 = Vec3::new(0.85, 0.84, 0.8);

fn furniture(solids: Vec<Solid>, color: Vec3) -> Assembly {
    Assembly { solids, blend: 0.0, color, class: UNCLASSIFIED }
}

fn block(center: DVec3, offset: [f64; 3], half: [f64; 3]) -> Solid {
    Solid::block((center + DVec3::from_array(offset)).into(), half)
}

/// Returns four legs from the floor at `base` up to `height`.
fn legs(base: DVec3, half_width: f64, half_depth: f64, height: f64) -> impl Iterator<Item = Solid> {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
    corners.into_iter().map(move |(x, y)| {
        let offset = [x * half_width, y * half_depth, 0.5 * height];
        block(base, offset, [0.025, 0.025, 0.5 * height])
    })
}

/// Returns a table of 1.6 m by 0.9 m.
pub fn table(base: DVec3) -> Assembly {
    let top = block(base, [0.0, 0.0, 0.735], [0.8, 0.45, 0.02]);
    furniture(legs(base, 0.72, 0.37, 0.73).chain([top]).collect(), WOOD)
}

/// Returns a chair whose back is on the side `toward_back` along Y, 1 or -1.
pub fn chair(base: DVec3, toward_back: f64) -> Assembly {
    let seat = block(base, [0.0, 0.0, 0.44], [0.22, 0.22, 0.02]);
    let back = block(base, [0.0, 0.21 * toward_back, 0.72], [0.22, 0.015, 0.24]);
    furniture(legs(base, 0.18, 0.18, 0.43).chain([seat, back]).collect(), WOOD)
}

/// Returns a sofa with rounded cushions whose back is toward +Y.
pub fn sofa(base: DVec3) -> Assembly {
    let cushion = |offset: [f64; 3], half: [f64; 3]| Solid::Box {
        center: base + DVec3::from_array(offset),
        half: half.into(),
        rounding: 0.08,
    };
    let solids = vec![
        cushion([0.0, 0.0, 0.22], [1.0, 0.42, 0.2]),
        cushion([0.0, 0.38, 0.5], [1.0, 0.14, 0.36]),
        cushion([-0.95, 0.0, 0.35], [0.13, 0.42, 0.28]),
        cushion([0.95, 0.0, 0.35], [0.13, 0.42, 0.28]),
    ];
    furniture(solids, CLOTH)
}

/// Returns open shelves whose back is toward +X.
pub fn shelves(base: DVec3) -> Assembly {
    let boards = (0..6).map(|i| {
        let height = 0.02 + 0.38 * f64::from(i);
        block(base, [0.0, 0.0, height], [0.17, 0.6, 0.015])
    });
    let sides = [-0.6, 0.6].map(|y| block(base, [0.0, y, 0.97], [0.17, 0.015, 0.97]));
    let back = block(base, [0.165, 0.0, 0.97], [0.008, 0.6, 0.97]);
    furniture(boards.chain(sides).chain([back]).collect(), PAINT)
}

/// Returns a lamp on a thin pole.
pub fn lamp(base: DVec3) -> Assembly {
    let at = |height: f64| (base + DVec3::Z * height).into();
    let solids = vec![
        block(base, [0.0, 0.0, 0.015], [0.15, 0.15, 0.015]),
        Solid::capsule(at(0.0), at(1.5), 0.012),
        Solid::ellipsoid(at(1.6), [0.2, 0.2, 0.14]),
    ];
    furniture(solids, PAINT)
}

#[cfg(test)]
mod tests {
    //! Furniture stands on the floor and is hollow where it should be.

    use super::*;
    use crate::sdf::Sdf;

    #[test]
    fn all_furniture_stands_on_the_floor() {
        let base = DVec3::new(1.0, 2.0, 3.0);
        let all = [table(base), chair(base, 1.0), sofa(base), shelves(base), lamp(base)];
        for piece in &all {
            assert!((piece.bounds().min.z - base.z).abs() < 0.03, "{:?}", piece.bounds());
        }
    }

    #[test]
    fn there_is_room_under_the_table_and_in_the_shelves() {
        assert!(0.3 < table(DVec3::ZERO).distance(DVec3::new(0.0, 0.0, 0.4)));
        assert!(0.1 < shelves(DVec3::ZERO).distance(DVec3::new(0.0, 0.0, 0.2)));
    }
}
