//! Rings of a polygon that cross themselves or each other.

use super::polygon::Strips;

/// A side of a ring.
type Segment = [[f64; 2]; 2];

/// Returns true if sides of a polygon's rings cross, so that areas inside of an even number of rings are outside of it.
/// Sides that only touch, as at corners, do not cross.
pub fn rings_cross(rings: &[Vec<[f64; 2]>]) -> bool {
    let sides = rings.iter().flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
    let sides: Vec<Segment> = sides.map(|(a, b)| [*a, *b]).collect();
    let range = |side: &Segment, axis: usize| {
        let [a, b] = [side[0][axis], side[1][axis]];
        [a.min(b), a.max(b)]
    };
    let ranges: Vec<[f64; 2]> = sides.iter().map(|side| range(side, 1)).collect();
    Strips::new(&ranges).indices.into_iter().any(|strip| {
        let mut near: Vec<([f64; 2], &Segment)> =
            strip.iter().map(|i| &sides[*i as usize]).map(|side| (range(side, 0), side)).collect();
        near.sort_unstable_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]));
        near.iter().enumerate().any(|(i, (x_range, side))| {
            let mut overlapping =
                near[i + 1..].iter().take_while(|(other, _)| other[0] <= x_range[1]);
            overlapping.any(|(_, other)| cross(side, other))
        })
    })
}

/// Returns true if the ends of each segment lie on different sides of the other.
fn cross(a: &Segment, b: &Segment) -> bool {
    let turn = |[from, to]: &Segment, p: &[f64; 2]| {
        (to[0] - from[0]) * (p[1] - from[1]) - (to[1] - from[1]) * (p[0] - from[0])
    };
    let separates =
        |line: &Segment, ends: &Segment| turn(line, &ends[0]) * turn(line, &ends[1]) < 0.0;
    separates(a, b) && separates(b, a)
}

#[cfg(test)]
mod tests {
    //! Rings that cross, and rings that only touch.

    use super::*;
    use crate::math::Random;

    fn square(low: f64, high: f64) -> Vec<[f64; 2]> {
        vec![[low, low], [high, low], [high, high], [low, high], [low, low]]
    }

    #[test]
    fn crossings_are_found_within_a_ring_and_between_rings() {
        let bow = vec![[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]];
        assert!(rings_cross(&[bow]));
        assert!(rings_cross(&[square(0.0, 2.0), square(1.0, 3.0)]));
        // Down through a level side and up again.
        let through_level = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, -1.0], [0.0, 2.0]];
        assert!(rings_cross(&[through_level]));
    }

    #[test]
    fn holes_and_corners_that_touch_do_not_cross() {
        assert!(!rings_cross(&[]) && !rings_cross(&[vec![]]));
        assert!(!rings_cross(&[square(0.0, 4.0), square(1.0, 2.0), square(2.0, 3.0)]));
        let hourglass = [[0.0, 0.0], [1.0, 1.0], [0.0, 2.0], [2.0, 2.0], [1.0, 1.0], [2.0, 0.0]];
        assert!(!rings_cross(&[hourglass.to_vec()]));
    }

    #[test]
    fn strips_change_no_result() {
        let mut random = Random::new(6, 0);
        let (mut n_crossing, n_rings) = (0, 300);
        for _ in 0..n_rings {
            let ring: Vec<[f64; 2]> =
                (0..5).map(|_| [random.next_f32().into(), random.next_f32().into()]).collect();
            let side = |i: usize| [ring[i], ring[(i + 1) % 5]];
            let expected = (0..5).any(|i| (0..i).any(|j| cross(&side(i), &side(j))));
            assert_eq!(rings_cross(std::slice::from_ref(&ring)), expected, "{ring:?}");
            n_crossing += usize::from(expected);
        }
        assert!(0 < n_crossing && n_crossing < n_rings, "{n_crossing}");
    }
}
