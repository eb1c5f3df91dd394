//! The angular-gap test: do the points surround a hit, or does it lie beyond the edge of the surface?

use crate::math::{Floats, LaneMask, Lanes, TO_INTEGER, Vec3, Vec3Lanes, tangents};

/// Points within this many radii of the hit count ...
pub const NEIGHBOR_REACH: f32 = 1.3;
/// ... if they are not farther than this many from the tangent plane.
const THICKNESS: f32 = 0.8;
/// Points that a ray passed by at least this many radii before the hit tell which side is free.
const PASSED: f32 = 0.2;
/// They contradict the hit's normal if theirs makes this cosine with it, or less.
const CONTRARY: f32 = -0.5;
/// Heights above the points' planes are counted in steps of a radius over this and the normal's length: of
/// 0.002 radii at most, and f32 adds up some thirty of the greatest heights exactly.
const STEPS: f32 = 1.0;
/// Thirty times what rounding does to a direction, and far less than is seen.
const TURN: f32 = 4e-6;
/// With fewer points than this in reach one looks farther; at 8 the bunny's depths got worse by a sixth,
/// at 4 radii of 0.85 spacings left holes.
const SPARSE: u32 = 5;
/// Fewer points than this are no surface.
const FEWEST: u32 = 4;

/// A hit in question.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Unit, facing the ray's origin.
    pub normal: Vec3,
    /// Of the ray, unit.
    pub direction: Vec3,
    pub radius: f32,
}

/// Hits in question: a different one in each lane, or the same in all.
#[derive(Clone, Copy)]
pub struct Candidates<F> {
    normal: Vec3Lanes<F>,
    direction: Vec3Lanes<F>,
    radius: F,
    tangents: [Vec3Lanes<F>; 2],
    steps_per_length: F,
}

impl<F: Floats> Candidates<F> {
    #[inline(always)]
    pub fn of_one(hit: &Candidate) -> Self {
        Self::new(
            Vec3Lanes::splat(hit.normal),
            Vec3Lanes::splat(hit.direction),
            F::splat(hit.radius),
        )
    }

    #[inline(always)]
    pub fn new(normal: Vec3Lanes<F>, direction: Vec3Lanes<F>, radius: F) -> Self {
        let steps_per_length = F::splat(STEPS) / radius;
        Self { normal, direction, radius, tangents: tangents(normal), steps_per_length }
    }

    /// Which points at `offset` from the hit count.
    #[inline(always)]
    pub fn near(&self, offset: Vec3Lanes<F>) -> F::Mask {
        let reach = F::splat(NEIGHBOR_REACH) * self.radius;
        let thickness = F::splat(THICKNESS) * self.radius;
        let height = self.normal.dot(offset).abs();
        offset.dot(offset).less(reach * reach) & height.less(thickness)
    }

    /// Which points the ray passed well before the hit.
    #[inline(always)]
    fn passed(&self, offset: Vec3Lanes<F>) -> F::Mask {
        offset.dot(self.direction).less(F::splat(-PASSED) * self.radius)
    }

    /// The points' normals, as long as the ray was above their planes where it passed them, negative below.
    /// As normals are whole numbers and heights become such, their sum does not depend on the points' order.
    #[inline(always)]
    fn lift(&self, offset: Vec3Lanes<F>, normal: Vec3Lanes<F>) -> Vec3Lanes<F> {
        let along = offset.dot(self.direction);
        let above = normal.dot(self.direction.scaled(along).minus(offset));
        let to_integer = F::splat(TO_INTEGER);
        normal.scaled(above * self.steps_per_length + to_integer - to_integer)
    }

    /// Where points lie in the tangent plane, and which lie in some direction there: those straight under
    /// the hit do not.
    ///
    /// Half of the directions are turned a little, so that points of a grid are not exactly opposite to each
    /// other: on a line between two of them the hit would lie on either side of it, as the points come.
    #[inline(always)]
    fn flattened(&self, offset: Vec3Lanes<F>) -> ([F; 2], F::Mask) {
        let zero = F::splat(0.0);
        let [x, y] = [offset.dot(self.tangents[0]), offset.dot(self.tangents[1])];
        let least = F::splat(1e-6) * self.radius * self.radius;
        let is_below = y.less(zero) | y.less_equal(zero) & x.less(zero);
        let turn = F::select(is_below, F::splat(TURN), zero);
        ([x - turn * y, y + turn * x], least.less(x * x + y * y))
    }
}

/// What the points around a hit have told so far.
pub struct Surroundings<F: Floats> {
    hit: Candidates<F>,
    n_near: F,
    wedge: Wedge<F>,
    n_passed: F,
    free_side: Vec3Lanes<F>,
}

/// Lanes of hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Verdicts {
    /// The points leave no gap of 180 degrees: the hit lies on the surface, not beyond its edge. At
    /// 150 degrees closed surfaces have holes through which one sees their far side, at 200 several times
    /// as many pixels at the silhouettes of a cube's points are false.
    pub enclosed: u32,
    /// There are too few points for a judgement.
    pub sparse: u32,
}

impl<F: Floats> Surroundings<F> {
    #[inline(always)]
    pub fn new(hit: Candidates<F>) -> Self {
        let zero = F::splat(0.0);
        let free_side = Vec3Lanes::splat(Vec3::ZERO);
        Self { hit, n_near: zero, wedge: Wedge::new(), n_passed: zero, free_side }
    }

    /// Takes in a point at `offset` from the hits to which it `is_near`; its normal is as in `PointLanes`.
    #[inline(always)]
    pub fn add(&mut self, offset: Vec3Lanes<F>, normal: Vec3Lanes<F>, is_near: F::Mask) {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        self.n_near = self.n_near + F::select(is_near, one, zero);
        let is_passed = is_near & self.hit.passed(offset);
        self.n_passed = self.n_passed + F::select(is_passed, one, zero);
        let lift = self.hit.lift(offset, normal);
        let none = Vec3Lanes::splat(Vec3::ZERO);
        self.free_side = self.free_side.plus(Vec3Lanes::select(is_passed, lift, none));
        let (place, has_direction) = self.hit.flattened(offset);
        self.wedge.add(place, is_near & has_direction);
    }

    #[inline(always)]
    pub fn near(&self, offset: Vec3Lanes<F>) -> F::Mask {
        self.hit.near(offset)
    }

    #[inline(always)]
    pub fn judge(&self) -> Verdicts {
        let suffice = F::splat(FEWEST as f32).less_equal(self.n_near);
        let enclosed = (self.wedge.is_full & suffice).bits();
        Verdicts {
            enclosed: enclosed & !self.is_from_within(),
            sparse: self.n_near.less(F::splat(SPARSE as f32)).bits(),
        }
    }

    /// Just outside a silhouette, where a disc of the far side sticks out over the bend, a ray meets that
    /// disc from within; lit from the inside it would be a black rim. The ray came through free space, so
    /// the side on which it passed the points before the hit is the free side: a hit is refused if its
    /// normal, continued from theirs, faces away from the ray.
    #[inline(always)]
    fn is_from_within(&self) -> u32 {
        let length = self.free_side.dot(self.free_side).sqrt();
        let is_contrary = self.free_side.dot(self.hit.normal).less(F::splat(CONTRARY) * length);
        (is_contrary & F::splat(1.0).less(self.n_passed)).bits()
    }
}

impl<L: Lanes> Surroundings<L> {
    /// What all lanes have told together, of a hit that is the same in all of them.
    #[inline(always)]
    pub fn together(self) -> Self {
        self.with_rotated::<4>().with_rotated::<2>().with_rotated::<1>()
    }

    /// Adds to each lane what the one `BY` lanes on has told.
    #[inline(always)]
    fn with_rotated<const BY: usize>(self) -> Self {
        let Vec3Lanes { x, y, z } = self.free_side;
        let free_side =
            Vec3Lanes { x: x.rotated::<BY>(), y: y.rotated::<BY>(), z: z.rotated::<BY>() };
        Self {
            hit: self.hit,
            n_near: self.n_near + self.n_near.rotated::<BY>(),
            wedge: self.wedge.with_rotated::<BY>(),
            n_passed: self.n_passed + self.n_passed.rotated::<BY>(),
            free_side: self.free_side.plus(free_side),
        }
    }
}

/// The directions of a plane between those met so far, as long as they leave a gap of 180 degrees.
struct Wedge<F: Floats> {
    /// The one from which all others are met counterclockwise; infinite before there is any.
    first: [F; 2],
    last: [F; 2],
    is_full: F::Mask,
}

impl<F: Floats> Wedge<F> {
    #[inline(always)]
    fn new() -> Self {
        let none = [F::splat(f32::INFINITY); 2];
        Self { first: none, last: none, is_full: F::splat(0.0).less(F::splat(0.0)) }
    }

    /// Takes in vectors other than zero. One that rounding cannot tell from the last changes nothing.
    #[inline(always)]
    fn add(&mut self, [x, y]: [F; 2], lanes: F::Mask) {
        let zero = F::splat(0.0);
        let [first_x, first_y] = self.first;
        let [last_x, last_y] = self.last;
        // Positive for what lies counterclockwise of them.
        let from_first = first_x * y - first_y * x;
        let from_last = last_x * y - last_y * x;
        let is_after = zero.less_equal(from_first) & zero.less(from_last);
        let is_before = from_first.less(zero) & from_last.less_equal(zero);
        self.is_full = self.is_full | lanes & from_first.less(zero) & zero.less(from_last);
        let is_new = lanes & F::splat(f32::INFINITY).less_equal(first_x);
        let (is_first, is_last) = (is_new | lanes & is_before, is_new | lanes & is_after);
        self.first = [F::select(is_first, x, first_x), F::select(is_first, y, first_y)];
        self.last = [F::select(is_last, x, last_x), F::select(is_last, y, last_y)];
    }
}

impl<L: Lanes> Wedge<L> {
    /// Adds to each lane's wedge that of the lane `BY` on: its ends tell all there is to know of it.
    #[inline(always)]
    fn with_rotated<const BY: usize>(mut self) -> Self {
        let rotated = |[x, y]: [L; 2]| [x.rotated::<BY>(), y.rotated::<BY>()];
        let (first, last) = (rotated(self.first), rotated(self.last));
        let zero = L::splat(0.0);
        let is_full = L::select(self.is_full, L::splat(1.0), zero).rotated::<BY>();
        let is_any = first[0].less(L::splat(f32::INFINITY));
        self.add(first, is_any);
        self.add(last, is_any);
        self.is_full = self.is_full | zero.less(is_full);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{LANES, Mat3, PortableLanes};
    use crate::surface::NORMAL_MAX;

    /// Offset and normal.
    type Point = (Vec3, Vec3);

    fn level(offset: Vec3) -> Point {
        (offset, NORMAL_MAX * Vec3::Z)
    }

    fn at_angles(degrees: &[f32]) -> Vec<Point> {
        let place = |a: &f32| Vec3::new(a.to_radians().cos(), a.to_radians().sin(), 0.1);
        degrees.iter().map(place).map(level).collect()
    }

    /// Each point is seen by a lane of its own choice.
    fn judge_in_lanes(hit: &Candidate, points: &[(usize, Point)]) -> Verdicts {
        let mut found = Surroundings::new(Candidates::<PortableLanes>::of_one(hit));
        for &(lane, (offset, normal)) in points {
            let mut is_point = [0.0; LANES];
            is_point[lane] = 1.0;
            let is_point = PortableLanes::splat(0.0).less(PortableLanes::load(&is_point));
            let offset = Vec3Lanes::splat(offset);
            let is_near = is_point & found.near(offset);
            found.add(offset, Vec3Lanes::splat(normal), is_near);
        }
        found.together().judge()
    }

    /// Tells one by one, and sees to it that lanes tell the same.
    fn surroundings(hit: &Candidate, points: &[Point]) -> bool {
        let in_one = points.iter().map(|&point| (0, point)).collect::<Vec<_>>();
        let expected = judge_in_lanes(hit, &in_one);
        let mut random = crate::math::Random::new(9, 0);
        for _ in 0..4 {
            let mut in_lanes = in_one.clone();
            for i in (1..in_lanes.len()).rev() {
                in_lanes.swap(i, random.below(i as u64 + 1) as usize);
            }
            in_lanes.iter_mut().for_each(|(lane, _)| *lane = random.below(LANES as u64) as usize);
            let Verdicts { enclosed, sparse } = judge_in_lanes(hit, &in_lanes);
            assert_eq!((enclosed & 1, sparse & 1), (expected.enclosed & 1, expected.sparse & 1));
        }
        expected.enclosed & 1 == 1
    }

    const FROM_ABOVE: Candidate =
        Candidate { normal: Vec3::Z, direction: Vec3::NEG_Z, radius: 1.0 };

    fn judge(degrees: &[f32]) -> bool {
        surroundings(&FROM_ABOVE, &at_angles(degrees))
    }

    #[test]
    fn the_largest_gap_decides() {
        assert!(judge(&[0.0, 90.0, 180.0, 270.0]));
        assert!(judge(&[0.0, 60.0, 120.0, 208.0]));
        assert!(judge(&[10.0, 60.0, 120.0, 191.0]));
        assert!(!judge(&[10.0, 60.0, 120.0, 189.0]));
        assert!(!judge(&[0.0, 20.0, 40.0, 60.0]));
        assert!(!judge(&[300.0, 301.0, 299.0, 298.0]));
        assert!(!judge(&[45.0; 5]));
        assert!(!judge(&[0.0, 120.0, 240.0]));
    }

    #[test]
    fn straight_opposite_points_close_the_gap_in_any_order() {
        let cross = [0.0, 90.0, 180.0, 270.0].map(|a: f32| {
            let (sin, cos) = a.to_radians().sin_cos();
            Vec3::new(cos.round(), sin.round(), 0.1)
        });
        for order in 0..256 {
            let order = [order & 3, order >> 2 & 3, order >> 4 & 3, order >> 6];
            let points: Vec<Point> = order.iter().map(|&i| level(cross[i])).collect();
            // With three of them the hit lies on the edge itself, which may count or not.
            match (0..4).filter(|i| order.contains(i)).count() {
                4 => assert!(surroundings(&FROM_ABOVE, &points), "{order:?}"),
                3 => {}
                _ => assert!(!surroundings(&FROM_ABOVE, &points), "{order:?}"),
            }
        }
    }

    #[test]
    fn any_number_of_points_counts_to_the_last() {
        // The first hundred all lie on one side; the last two close the gap.
        let mut degrees: Vec<f32> = (0..100).map(|i| i as f32).collect();
        assert!(!judge(&degrees));
        degrees.extend([200.0, 280.0]);
        assert!(judge(&degrees));
    }

    #[test]
    fn gaps_equal_those_of_sorted_angles() {
        let mut random = crate::math::Random::new(8, 0);
        for _ in 0..2000 {
            let n = 4 + random.below(20) as usize;
            let span = 400.0 * random.next_f32();
            let mut angles: Vec<f32> = (0..n).map(|_| (span * random.next_f32()) % 360.0).collect();
            let found = judge(&angles);
            angles.sort_by(f32::total_cmp);
            angles.push(angles[0] + 360.0);
            let widest = angles.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f32::max);
            if 0.01 < (widest - 180.0).abs() {
                assert_eq!(found, widest < 180.0, "{angles:?}");
            }
        }
    }

    #[test]
    fn opposite_points_tell_the_same_in_any_order() {
        let mut random = crate::math::Random::new(10, 0);
        let eighth = |i: usize| {
            let [x, y] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
                .map(|(x, y)| [x as f32, y as f32])[i];
            Vec3::new(x, y, 0.1) * 0.5
        };
        for _ in 0..10_000 {
            let n = 4 + random.below(8) as usize;
            let points: Vec<usize> = (0..n).map(|_| random.below(8) as usize).collect();
            let gap = |from: usize| (1..=8).find(|step| points.contains(&((from + step) % 8)));
            let widest = points.iter().filter_map(|&i| gap(i)).max().unwrap_or(8);
            let turn = Mat3::from_axis_angle(Vec3::new(1.0, 2.0, 0.5).normalize(), 0.7);
            for turn in [Mat3::IDENTITY, turn] {
                let hit = Candidate { normal: turn.z_axis, direction: -turn.z_axis, radius: 1.0 };
                let points: Vec<Point> =
                    points.iter().map(|&i| (turn * eighth(i), NORMAL_MAX * turn.z_axis)).collect();
                let enclosed = surroundings(&hit, &points);
                // At 4 the hit lies on the edge itself, which may count or not.
                if widest != 4 {
                    assert_eq!(enclosed, widest < 4, "{points:?}");
                }
            }
        }
    }

    #[test]
    fn points_off_the_plane_or_out_of_reach_do_not_count() {
        let mut points = at_angles(&[0.0, 90.0, 180.0]);
        for stray in [Vec3::new(0.0, -1.4, 0.0), Vec3::new(0.0, -0.5, 0.9)] {
            points.push(level(stray));
            assert!(!surroundings(&FROM_ABOVE, &points));
            points.pop();
        }
        points.push(level(Vec3::new(0.0, -1.2, 0.0)));
        assert!(surroundings(&FROM_ABOVE, &points));
    }

    /// Points of a cylinder of radius 2 along Y under the place where a ray along +X passes it.
    fn bend(height: f32, at: f32) -> Vec<Point> {
        let degrees = (-40..=40).step_by(8);
        let points =
            degrees.flat_map(|a| [-0.5f32, -0.1, 0.4].map(|y| ((a as f32).to_radians(), y)));
        points
            .map(|(angle, y)| {
                let normal = Vec3::new(angle.sin(), 0.0, angle.cos());
                (2.0 * normal + y * Vec3::Y - Vec3::new(at, 0.0, 2.0 + height), NORMAL_MAX * normal)
            })
            .collect()
    }

    #[test]
    fn a_disc_met_from_within_over_a_bend_is_refused() {
        let angle = 0.3f32;
        // The disc that touches at `angle` behind the top meets the line at `height` over the top here.
        let height = 0.02;
        let at = (2.0 - (2.0 + height) * angle.cos()) / angle.sin();
        let outward = Vec3::new(angle.sin(), 0.0, angle.cos());
        let from_within = Candidate { normal: -outward, direction: Vec3::X, radius: 1.0 };
        assert!(!surroundings(&from_within, &bend(height, at)));
        // Its mirror image before the top is met from outside.
        let outward = Vec3::new(-angle.sin(), 0.0, angle.cos());
        let from_outside = Candidate { normal: outward, direction: Vec3::X, radius: 1.0 };
        assert!(surroundings(&from_outside, &bend(height, -at)));
    }
}
