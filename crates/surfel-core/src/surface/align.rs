//! The side to which the normals of blended discs are turned.

use crate::math::{Floats, Vec3Lanes};

/// Minimum cosine between two normals, of any sign, that have the same side.
pub const MIN_ALIGNED_COSINE: f32 = 0.5;
/// Minimum cosine, of any sign, between a normal and that of the nearest disc carried around a bend, which then decides.
pub const MIN_BENT_COSINE: f32 = 0.25;

/// The rule by which `Splat` turns the normals of discs before it blends them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Align {
    /// Each normal is turned toward the ray's origin (Wiesmeier, Ray Tracing Point Clouds, 2011). At a silhouette that
    /// turns the discs behind the bend inside out.
    Each,
    /// The normal of the nearest disc is turned toward the ray's origin, and the others to its side. At a sharp edge
    /// the two sides' normals are perpendicular, and have none.
    Nearest,
    /// Normals near that of the nearest disc follow it. The others follow its mirror image, which a circle through both
    /// discs' centres would have at the other one, and if that is perpendicular, too, the ray's origin.
    #[default]
    Both,
}

impl Align {
    /// Every rule with its name.
    pub const ALL: [(&'static str, Self); 3] =
        [("each", Self::Each), ("nearest", Self::Nearest), ("both", Self::Both)];

    /// Returns the lanes in which a disc's unit normal is to be turned around. `nearest` is the unit normal of the nearest
    /// disc, which faces the ray's origin, and `chord` leads from its centre to that of the other disc.
    #[inline(always)]
    pub fn is_opposed<F: Floats>(
        self,
        normal: Vec3Lanes<F>,
        nearest: Vec3Lanes<F>,
        chord: Vec3Lanes<F>,
        direction: Vec3Lanes<F>,
    ) -> F::Mask {
        let zero = F::splat(0.0);
        let toward = zero - normal.dot(direction);
        if self == Self::Each {
            return toward.lt(zero);
        }
        let cosine = normal.dot(nearest);
        if self == Self::Nearest {
            return cosine.lt(zero);
        }
        let squared = chord.dot(chord);
        let bent = cosine * squared - F::splat(2.0) * nearest.dot(chord) * normal.dot(chord);
        let is_decisive = (F::splat(MIN_BENT_COSINE) * squared).lt(bent.abs());
        let is_near = F::splat(MIN_ALIGNED_COSINE).lt(cosine.abs());
        let around_bend = F::select(is_decisive, bent, toward);
        F::select(is_near, cosine, around_bend).lt(zero)
    }
}

#[cfg(test)]
mod tests {
    //! The sides of normals around bends and at edges.

    use super::*;
    use crate::math::Vec3;

    fn is_opposed(align: Align, normal: Vec3, nearest: Vec3, chord: Vec3, direction: Vec3) -> bool {
        let [normal, nearest, chord] = [normal, nearest, chord].map(Vec3Lanes::<f32>::splat);
        align.is_opposed(normal, nearest, chord, Vec3Lanes::splat(direction))
    }

    #[test]
    fn normals_of_either_sign_get_the_same_side() {
        // A ray meets the top of a cube just before an edge, whose other side it sees or not; then a step, and a bend.
        let down = Vec3::new(0.3, 0.0, -1.0).normalize();
        let toward_edge = Vec3::new(-0.5, 0.0, -1.0).normalize();
        let cases = [
            (Vec3::X, Vec3::new(0.3, 0.0, -0.3), down),
            (Vec3::X, Vec3::new(0.3, 0.0, -0.3), toward_edge),
            (-Vec3::X, Vec3::new(0.3, 0.0, 0.3), toward_edge),
            (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.3, 0.0, -0.1), down),
            (Vec3::Z, Vec3::new(0.01, 0.0, 0.1), down),
        ];
        for (outward, chord, direction) in cases {
            let of = |normal| is_opposed(Align::Both, normal, Vec3::Z, chord, direction);
            assert!(!of(outward) && of(-outward), "{outward} {chord} {direction}");
        }
        // The thesis' rule turns the hidden side inside out, the nearest one's decides nothing at right angles.
        let (chord, direction) = (Vec3::new(0.3, 0.0, -0.3), down);
        assert!(is_opposed(Align::Each, Vec3::X, Vec3::Z, chord, direction));
        assert!(!is_opposed(Align::Nearest, -Vec3::X, Vec3::Z, chord, direction));
    }
}
