//! A forest of spruces and oaks on rolling ground.

use super::named_scene::NamedScene;
use crate::classes::HIGH_VEGETATION;
use crate::instruments::{AirborneLidar, FlightLine, Scanner, Station, TerrestrialSurvey};
use crate::noise::unit;
use crate::parts::assembly::{Assembly, Solid};
use crate::parts::terrain::Terrain;
use crate::parts::tree::{Crown, CrownShape};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;
use surfel_core::math::hash;

const TERRAIN: Terrain = Terrain { radius: 26.0, platform: (0.5, 0.5) };
const GRID: i32 = 4;
const TREE_SPACING: f64 = 4.6;

/// Returns the scene.
pub fn scene() -> NamedScene {
    let mut scene = NamedScene::default();
    for i in -GRID..=GRID {
        for j in -GRID..=GRID {
            let seed = hash(((i + GRID) * 100 + j + GRID) as u64);
            // Every fifth tree was felled.
            if unit(seed) < 0.8 {
                add_tree(&mut scene, f64::from(i), f64::from(j), seed);
            }
        }
    }
    scene.add("ground", TERRAIN);
    scene.look([-34.0, -30.0, 16.0], [0.0, 0.0, 4.0]);
    scene.look([-2.0, -24.0, 3.0], [0.0, 0.0, 5.0]);
    scene
}

fn add_tree(scene: &mut NamedScene, column: f64, row: f64, seed: u64) {
    let jitter = |salt: u64| 1.5 * (unit(seed ^ salt) - 0.5);
    let (x, y) = (TREE_SPACING * column + jitter(1), TREE_SPACING * row + jitter(2));
    let foot = DVec3::new(x, y, TERRAIN.height(x, y) - 0.2);
    let height = 7.0 + 6.0 * unit(seed ^ 3);
    let is_spruce = unit(seed ^ 4) < 0.6;
    let top = foot + (if is_spruce { 0.9 } else { 0.6 }) * height * DVec3::Z;
    let solids = vec![Solid::capsule(foot.into(), top.into(), 0.1 + 0.012 * height)];
    let bark = Vec3::new(0.34, 0.28, 0.22);
    scene.add("trunk", Assembly { solids, blend: 0.0, color: bark, class: HIGH_VEGETATION });
    let (shape, half, rise) = if is_spruce {
        (CrownShape::Cone, DVec3::new(1.5, 1.5, 0.44 * height), 0.58)
    } else {
        (CrownShape::Ellipsoid, DVec3::new(2.2, 2.2, 0.3 * height), 0.68)
    };
    let center = foot + rise * height * DVec3::Z;
    scene.add("crown", Crown { shape, center, half, cell: 0.3, fill: 0.4, seed });
}

/// Returns three flight lines.
pub fn airborne() -> AirborneLidar {
    let line =
        |x: f64| FlightLine { from: DVec3::new(x, -28.0, 300.0), to: DVec3::new(x, 28.0, 300.0) };
    let lines = [-50.0, 0.0, 50.0].map(line).to_vec();
    AirborneLidar { lines, ..AirborneLidar::default() }
}

/// Returns a survey from four stations under the trees.
pub fn terrestrial(step_deg: f64) -> TerrestrialSurvey {
    let step_rad = step_deg.to_radians();
    let scanner = Scanner { step_rad, with_grid: true, ..Scanner::default() };
    let positions = [(-7.0, -7.0), (7.0, -6.5), (-6.5, 7.0), (2.3, -20.5)];
    let station =
        |(x, y): (f64, f64)| Station::full_dome(DVec3::new(x, y, TERRAIN.height(x, y) + 1.7));
    TerrestrialSurvey { scanner, stations: positions.map(station).to_vec() }
}

#[cfg(test)]
mod tests {
    //! The forest and its airborne scan.

    use super::*;
    use crate::instruments::Instrument;
    use crate::scenes::named_scene::checks;
    use surfel_core::points::Values;
    use surfel_core::progress::NoProgress;

    #[test]
    fn every_kind_of_object_is_seen_and_distances_are_never_too_long() {
        checks::check(&scene());
    }

    #[test]
    fn pulses_reach_the_ground_between_leaves() {
        let sparse = AirborneLidar { line_step: 2.0, pulse_step_rad: 0.004, ..airborne() };
        let cloud = sparse.scan(&scene().sdf, &NoProgress).unwrap();
        let Some(Values::U8(counts)) = cloud.scalar("number_of_returns") else { unreachable!() };
        assert!(counts.contains(&1) && counts.contains(&2));
        let classes = cloud.classification.as_ref().unwrap();
        let n_ground = classes.iter().filter(|class| **class == 2).count();
        assert!(cloud.len() / 20 < n_ground && n_ground < cloud.len(), "{n_ground}");
    }
}
