//! Bodies that are smooth all over: a head on a plinth and a cow.

use super::assembly::{Assembly, Solid};
use crate::classes::UNCLASSIFIED;
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// A larger-than-life head that looks along -Y.
pub struct Head {
    shape: Assembly,
}

/// A cow that looks along -Y.
pub struct Cow {
    shape: Assembly,
}

impl Head {
    /// Creates a head of 1.1 m height whose neck stands at `base`.
    pub fn new(base: DVec3) -> Self {
        let solids = vec![
            Solid::ellipsoid([0.0, 0.05, 0.68], [0.36, 0.43, 0.42]), // skull
            Solid::ellipsoid([0.0, -0.12, 0.45], [0.27, 0.28, 0.32]), // jaw
            Solid::capsule([0.0, 0.1, 0.0], [0.0, 0.06, 0.4], 0.19), // neck
            Solid::capsule([0.0, -0.4, 0.68], [0.0, -0.47, 0.52], 0.045), // nose
            Solid::ellipsoid([0.0, -0.35, 0.23], [0.11, 0.09, 0.08]), // chin
            Solid::capsule([-0.08, -0.385, 0.38], [0.08, -0.385, 0.38], 0.028), // upper lip
            Solid::capsule([-0.06, -0.38, 0.335], [0.06, -0.38, 0.335], 0.03), // lower lip
            Solid::capsule([-0.2, -0.31, 0.76], [-0.06, -0.37, 0.77], 0.04), // brows
            Solid::capsule([0.2, -0.31, 0.76], [0.06, -0.37, 0.77], 0.04),
            Solid::ellipsoid([-0.39, 0.05, 0.62], [0.05, 0.09, 0.13]), // ears
            Solid::ellipsoid([0.39, 0.05, 0.62], [0.05, 0.09, 0.13]),
        ];
        let shape = Assembly {
            solids,
            blend: 0.06,
            color: Vec3::new(0.8, 0.68, 0.58),
            class: UNCLASSIFIED,
        };
        Self { shape: moved(shape, base) }
    }
}

impl Cow {
    /// Creates a cow of 2.6 m length that stands on the ground at `base`.
    pub fn new(base: DVec3) -> Self {
        let leg = |x: f64, y: f64| Solid::capsule([x, y, 0.08], [x, y, 0.8], 0.09);
        let solids = vec![
            Solid::ellipsoid([0.0, 0.0, 1.05], [0.42, 0.95, 0.44]), // trunk
            Solid::ellipsoid([0.0, 0.65, 1.15], [0.34, 0.4, 0.36]), // rump
            Solid::capsule([0.0, -0.75, 1.15], [0.0, -1.2, 1.45], 0.2), // neck
            Solid::ellipsoid([0.0, -1.4, 1.42], [0.16, 0.32, 0.18]), // head
            Solid::ellipsoid([0.0, -1.62, 1.36], [0.12, 0.14, 0.12]), // muzzle
            Solid::capsule([-0.12, -1.22, 1.58], [-0.3, -1.25, 1.75], 0.03), // horns
            Solid::capsule([0.12, -1.22, 1.58], [0.3, -1.25, 1.75], 0.03),
            Solid::ellipsoid([-0.27, -1.2, 1.48], [0.13, 0.04, 0.07]), // ears
            Solid::ellipsoid([0.27, -1.2, 1.48], [0.13, 0.04, 0.07]),
            Solid::ellipsoid([0.0, 0.5, 0.66], [0.2, 0.22, 0.14]), // udder
            Solid::capsule([0.0, 0.98, 1.3], [0.0, 1.1, 0.55], 0.035), // tail
            leg(-0.24, -0.6),
            leg(0.24, -0.6),
            leg(-0.24, 0.65),
            leg(0.24, 0.65),
        ];
        let shape = Assembly { solids, blend: 0.1, color: Vec3::ONE, class: UNCLASSIFIED };
        Self { shape: moved(shape, base) }
    }
}

fn moved(mut shape: Assembly, offset: DVec3) -> Assembly {
    for solid in &mut shape.solids {
        match solid {
            Solid::Ellipsoid { center, .. } | Solid::Box { center, .. } => *center += offset,
            Solid::Capsule { ends, .. } => ends.iter_mut().for_each(|end| *end += offset),
        }
    }
    shape
}

impl Sdf for Head {
    fn distance(&self, point: DVec3) -> f64 {
        self.shape.distance(point)
    }

    fn color(&self, point: DVec3, normal: DVec3) -> Vec3 {
        self.shape.color(point, normal)
    }

    fn bounds(&self) -> DAabb {
        self.shape.bounds()
    }
}

impl Sdf for Cow {
    fn distance(&self, point: DVec3) -> f64 {
        self.shape.distance(point)
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        let patches = (4.1 * point.x).sin() + (3.3 * point.y).sin() + (5.0 * point.z).sin();
        if 0.5 < patches { Vec3::new(0.2, 0.16, 0.14) } else { Vec3::new(0.9, 0.88, 0.84) }
    }

    fn bounds(&self) -> DAabb {
        self.shape.bounds()
    }
}

#[cfg(test)]
mod tests {
    //! Bodies are in one piece and stand on their base.

    use super::*;

    #[test]
    fn bodies_are_solid_inside_and_end_at_their_bounds() {
        let base = DVec3::new(3.0, -2.0, 0.5);
        let head = Head::new(base);
        assert!(head.distance(base + DVec3::new(0.0, 0.0, 0.6)) < -0.2);
        assert!(0.3 < head.distance(base + DVec3::new(0.0, -0.9, 0.6)));
        let cow = Cow::new(base);
        assert!(cow.distance(base + DVec3::new(0.0, 0.0, 1.0)) < -0.3);
        assert!(cow.distance(base + DVec3::new(0.24, 0.65, 0.3)) < -0.05);
        assert!((cow.bounds().min.z - base.z).abs() < 0.12);
    }
}
