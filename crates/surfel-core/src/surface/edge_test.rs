//! The angular-gap test decides whether the points surround a hit or it lies beyond the edge of the surface.

use crate::error::Error;
use crate::math::{Floats, LaneMask, Lanes, ROUND_TO_INTEGER, Vec3, Vec3Lanes, tangents};

/// The radius of the neighbourhood of a hit, in multiples of the hit's radius.
pub const NEIGHBORHOOD_RADIUS_FACTOR: f32 = 1.3;
/// Maximum distance of a neighbour from the hit's tangent plane, in radii.
pub const MAX_PLANE_DISTANCE: f32 = 0.8;
/// Minimum distance before the hit, in radii, at which the ray passes a point for the point to count for the
/// back-face test.
pub const MIN_PASSED_DISTANCE: f32 = 0.2;
/// Maximum cosine between the hit's normal and the normal of the passed points at which the hit counts as a
/// back face.
pub const MAX_BACKFACE_COSINE: f32 = -0.5;
/// Steps per radius and unit of normal length to which heights above the points' planes are rounded. Steps are
/// at most 0.002 radii long, and f32 adds about thirty of the greatest heights exactly.
pub const HEIGHT_STEPS: f32 = 1.0;
/// Angle in radians by which half of the directions are rotated: thirty times the rounding error of a
/// direction, and far too small to be visible.
pub const TIE_BREAK_ANGLE: f32 = 4e-6;
/// Square of the distance from a hit in the tangent plane, in radii, up to which a neighbour has no direction.
pub const MIN_SQUARED_OFFSET: f32 = 1e-6;
/// A neighbourhood of fewer points is sparse and has to be evaluated again at a larger radius. With 8 the
/// depth error of the bunny grew by a sixth; with 4 there were holes at radii of 0.85 spacings.
pub const MIN_DENSE: u32 = 5;
/// Fewer points than this form no surface.
pub const MIN_NEIGHBORS: u32 = 4;

/// The test that decides where a surface of discs ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum EdgeTest {
    /// No test: the surface ends at the rims of its discs.
    Off,
    /// The angular-gap test: a hit beyond the outermost points is rejected and the search continues.
    #[default]
    AngularGap,
}

impl EdgeTest {
    /// Every test with its name.
    pub const ALL: [(&'static str, Self); 2] =
        [("angular-gap", Self::AngularGap), ("off", Self::Off)];

    /// Returns the name that `from_str` parses.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, test)| *test == self).map_or("", |(name, _)| name)
    }
}

impl std::str::FromStr for EdgeTest {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let known = Self::ALL.iter().find(|(name, _)| *name == text);
        known.map(|(_, test)| *test).ok_or_else(|| Error::UnknownName {
            kind: "edge test",
            found: text.to_owned(),
            known: Self::ALL.map(|(name, _)| name).join(", "),
        })
    }
}

/// A hit to test.
#[derive(Clone, Copy, Debug)]
pub struct CandidateHit {
    /// Unit normal, which faces the ray's origin.
    pub normal: Vec3,
    /// Unit direction of the ray.
    pub direction: Vec3,
    /// Radius of the disc or splat that was hit.
    pub radius: f32,
}

/// Hits to test: a different one in each lane, or the same in all.
#[derive(Clone, Copy)]
pub struct CandidateHitLanes<F> {
    normal: Vec3Lanes<F>,
    direction: Vec3Lanes<F>,
    radius: F,
    tangents: [Vec3Lanes<F>; 2],
    steps_per_length: F,
}

impl<F: Floats> CandidateHitLanes<F> {
    /// Returns `hit` in every lane.
    #[inline(always)]
    pub fn splat(hit: &CandidateHit) -> Self {
        Self::new(
            Vec3Lanes::splat(hit.normal),
            Vec3Lanes::splat(hit.direction),
            F::splat(hit.radius),
        )
    }

    /// Returns hits with these unit normals, unit ray directions and radii.
    #[inline(always)]
    pub fn new(normal: Vec3Lanes<F>, direction: Vec3Lanes<F>, radius: F) -> Self {
        let steps_per_length = F::splat(HEIGHT_STEPS) / radius;
        Self { normal, direction, radius, tangents: tangents(normal), steps_per_length }
    }

    /// Returns the lanes in which a point at `offset` from the hit is its neighbour.
    #[inline(always)]
    pub fn is_neighbor(&self, offset: Vec3Lanes<F>) -> F::Mask {
        let max_distance = F::splat(NEIGHBORHOOD_RADIUS_FACTOR) * self.radius;
        let max_height = F::splat(MAX_PLANE_DISTANCE) * self.radius;
        let height = self.normal.dot(offset).abs();
        offset.dot(offset).lt(max_distance * max_distance) & height.lt(max_height)
    }

    /// Returns the lanes in which the ray passes a point well before the hit.
    #[inline(always)]
    fn is_passed(&self, offset: Vec3Lanes<F>) -> F::Mask {
        offset.dot(self.direction).lt(F::splat(-MIN_PASSED_DISTANCE) * self.radius)
    }

    /// Returns the points' normals scaled by the signed height of the ray above the points' planes, where it
    /// passes the points. Normals have integer components and heights are rounded to integers, so that the sum
    /// over points does not depend on their order.
    #[inline(always)]
    fn height_weighted_normal(&self, offset: Vec3Lanes<F>, normal: Vec3Lanes<F>) -> Vec3Lanes<F> {
        let along = offset.dot(self.direction);
        let above = normal.dot(self.direction.scaled(along).minus(offset));
        let to_integer = F::splat(ROUND_TO_INTEGER);
        normal.scaled(above * self.steps_per_length + to_integer - to_integer)
    }

    /// Projects points to the tangent plane. Returns their coordinates there and the lanes in which they have a
    /// direction from the hit: points straight above or below the hit have none.
    ///
    /// The lower half of the directions is rotated by `TIE_BREAK_ANGLE`, so that points of a grid are never
    /// exactly opposite to each other. Otherwise the side of a hit on the line between two such points would
    /// depend on the order of the points.
    #[inline(always)]
    fn project_to_tangent_plane(&self, offset: Vec3Lanes<F>) -> ([F; 2], F::Mask) {
        let zero = F::splat(0.0);
        let [x, y] = [offset.dot(self.tangents[0]), offset.dot(self.tangents[1])];
        let min_squared = F::splat(MIN_SQUARED_OFFSET) * self.radius * self.radius;
        let is_below = y.lt(zero) | y.le(zero) & x.lt(zero);
        let angle = F::select(is_below, F::splat(TIE_BREAK_ANGLE), zero);
        ([x - angle * y, y + angle * x], min_squared.lt(x * x + y * y))
    }
}

/// Statistics of the points around hits, accumulated one point per lane at a time. `BACKFACES` says whether hits on
/// back faces are rejected too.
pub struct NeighborhoodStats<F: Floats, const BACKFACES: bool> {
    hit: CandidateHitLanes<F>,
    n_neighbors: F,
    interval: AngularInterval<F>,
    n_passed: F,
    /// Sum of the normals of passed points, weighted by the ray's heights above their planes: it points into the
    /// free space through which the ray came.
    free_side: Vec3Lanes<F>,
}

/// Results of the angular-gap test, one bit per lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EdgeTestResult {
    /// Lanes in which the points leave no gap of 180 degrees: the hit lies on the surface, not beyond its edge.
    /// A threshold of 150 degrees leaves holes in closed surfaces that show their far side; at 200 degrees several
    /// times as many pixels at the silhouettes of a cube's points are false.
    pub enclosed: u32,
    /// Lanes with too few points for a reliable result.
    pub sparse: u32,
}

impl<F: Floats, const BACKFACES: bool> NeighborhoodStats<F, BACKFACES> {
    /// Returns the statistics of no points.
    #[inline(always)]
    pub fn new(hit: CandidateHitLanes<F>) -> Self {
        let zero = F::splat(0.0);
        let free_side = Vec3Lanes::splat(Vec3::ZERO);
        Self { hit, n_neighbors: zero, interval: AngularInterval::new(), n_passed: zero, free_side }
    }

    /// Adds a point at `offset` from the hits of the lanes in `is_neighbor`. Its normal is scaled as in
    /// `PointLanes`.
    #[inline(always)]
    pub fn add(&mut self, offset: Vec3Lanes<F>, normal: Vec3Lanes<F>, is_neighbor: F::Mask) {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        self.n_neighbors = self.n_neighbors + F::select(is_neighbor, one, zero);
        if BACKFACES {
            let is_passed = is_neighbor & self.hit.is_passed(offset);
            self.n_passed = self.n_passed + F::select(is_passed, one, zero);
            let weighted_normal = self.hit.height_weighted_normal(offset, normal);
            let none = Vec3Lanes::splat(Vec3::ZERO);
            let weighted_normal = Vec3Lanes::select(is_passed, weighted_normal, none);
            self.free_side = self.free_side.plus(weighted_normal);
        }
        let (projected, has_direction) = self.hit.project_to_tangent_plane(offset);
        self.interval.add(projected, is_neighbor & has_direction);
    }

    /// Returns the lanes in which a point at `offset` from the hit is its neighbour.
    #[inline(always)]
    pub fn is_neighbor(&self, offset: Vec3Lanes<F>) -> F::Mask {
        self.hit.is_neighbor(offset)
    }

    /// Returns the result of the angular-gap test over all points added so far.
    #[inline(always)]
    pub fn evaluate(&self) -> EdgeTestResult {
        let has_surface = F::splat(MIN_NEIGHBORS as f32).le(self.n_neighbors);
        let enclosed = (self.interval.is_full & has_surface).bits();
        EdgeTestResult {
            enclosed: if BACKFACES { enclosed & !self.backfaces() } else { enclosed },
            sparse: self.n_neighbors.lt(F::splat(MIN_DENSE as f32)).bits(),
        }
    }

    /// Returns the lanes in which the ray hits a back face.
    ///
    /// Just outside a silhouette a disc of the far side can stick out beyond the bend. A ray hits the inner
    /// side of that disc, which would show as a black rim. The ray came through free space, so it passed the
    /// points before the hit on their free side. The hit is a back face if its normal, oriented like the
    /// normals of these points, faces away from the ray.
    #[inline(always)]
    fn backfaces(&self) -> u32 {
        let length = self.free_side.dot(self.free_side).sqrt();
        let cosine_times_length = self.free_side.dot(self.hit.normal);
        let is_backface = cosine_times_length.lt(F::splat(MAX_BACKFACE_COSINE) * length);
        (is_backface & F::splat(1.0).lt(self.n_passed)).bits()
    }
}

impl<L: Lanes, const BACKFACES: bool> NeighborhoodStats<L, BACKFACES> {
    /// Combines the statistics of all lanes, whose hits must be the same.
    #[inline(always)]
    pub fn reduce_lanes(self) -> Self {
        self.with_rotated::<4>().with_rotated::<2>().with_rotated::<1>()
    }

    /// Adds the statistics of the lane `BY` lanes further on to each lane.
    #[inline(always)]
    fn with_rotated<const BY: usize>(self) -> Self {
        let Vec3Lanes { x, y, z } = self.free_side;
        let free_side = Vec3Lanes {
            x: x.rotate_lanes::<BY>(),
            y: y.rotate_lanes::<BY>(),
            z: z.rotate_lanes::<BY>(),
        };
        Self {
            hit: self.hit,
            n_neighbors: self.n_neighbors + self.n_neighbors.rotate_lanes::<BY>(),
            interval: self.interval.with_rotated::<BY>(),
            n_passed: self.n_passed + self.n_passed.rotate_lanes::<BY>(),
            free_side: self.free_side.plus(free_side),
        }
    }
}

/// The interval of directions in a plane that contains all directions added so far, as long as they leave a gap
/// of 180 degrees.
struct AngularInterval<F: Floats> {
    /// The clockwise end: all others lie counterclockwise of it. It is infinite in an empty interval.
    first: [F; 2],
    /// The counterclockwise end.
    last: [F; 2],
    /// Lanes in which the directions leave no gap of 180 degrees.
    is_full: F::Mask,
}

impl<F: Floats> AngularInterval<F> {
    #[inline(always)]
    fn new() -> Self {
        let none = [F::splat(f32::INFINITY); 2];
        Self { first: none, last: none, is_full: F::splat(0.0).lt(F::splat(0.0)) }
    }

    /// Adds vectors other than zero. One that equals `last` but for rounding changes nothing.
    #[inline(always)]
    fn add(&mut self, [x, y]: [F; 2], lanes: F::Mask) {
        let zero = F::splat(0.0);
        let [first_x, first_y] = self.first;
        let [last_x, last_y] = self.last;
        // Positive if the vector lies counterclockwise of the end.
        let from_first = first_x * y - first_y * x;
        let from_last = last_x * y - last_y * x;
        let is_after = zero.le(from_first) & zero.lt(from_last);
        let is_before = from_first.lt(zero) & from_last.le(zero);
        self.is_full = self.is_full | lanes & from_first.lt(zero) & zero.lt(from_last);
        let is_new = lanes & F::splat(f32::INFINITY).le(first_x);
        let (is_first, is_last) = (is_new | lanes & is_before, is_new | lanes & is_after);
        self.first = [F::select(is_first, x, first_x), F::select(is_first, y, first_y)];
        self.last = [F::select(is_last, x, last_x), F::select(is_last, y, last_y)];
    }
}

impl<L: Lanes> AngularInterval<L> {
    /// Adds the interval of the lane `BY` lanes further on to each lane; its two ends determine it.
    #[inline(always)]
    fn with_rotated<const BY: usize>(mut self) -> Self {
        let rotated = |[x, y]: [L; 2]| [x.rotate_lanes::<BY>(), y.rotate_lanes::<BY>()];
        let (first, last) = (rotated(self.first), rotated(self.last));
        let zero = L::splat(0.0);
        let is_full = L::select(self.is_full, L::splat(1.0), zero).rotate_lanes::<BY>();
        let is_any = first[0].lt(L::splat(f32::INFINITY));
        self.add(first, is_any);
        self.add(last, is_any);
        self.is_full = self.is_full | zero.lt(is_full);
        self
    }
}

#[cfg(test)]
mod tests {
    //! Gaps between the directions of neighbours, the points that count, and back faces beyond a bend.

    use super::*;
    use crate::math::{LANES, Mat3, PortableLanes};
    use crate::surface::MAX_NORMAL_COMPONENT;

    type Stats = NeighborhoodStats<PortableLanes, true>;

    /// A point's offset from the hit, and its normal.
    type Point = (Vec3, Vec3);

    fn level(offset: Vec3) -> Point {
        (offset, MAX_NORMAL_COMPONENT * Vec3::Z)
    }

    fn at_angles(degrees: &[f32]) -> Vec<Point> {
        let offset = |a: &f32| Vec3::new(a.to_radians().cos(), a.to_radians().sin(), 0.1);
        degrees.iter().map(offset).map(level).collect()
    }

    /// Evaluates the test with each point added in the lane given with it.
    fn evaluate_in_lanes(hit: &CandidateHit, points: &[(usize, Point)]) -> EdgeTestResult {
        let mut stats = Stats::new(CandidateHitLanes::<PortableLanes>::splat(hit));
        for &(lane, (offset, normal)) in points {
            let mut is_point = [0.0; LANES];
            is_point[lane] = 1.0;
            let is_point = PortableLanes::splat(0.0).lt(PortableLanes::load(&is_point));
            let offset = Vec3Lanes::splat(offset);
            let is_neighbor = is_point & stats.is_neighbor(offset);
            stats.add(offset, Vec3Lanes::splat(normal), is_neighbor);
        }
        stats.reduce_lanes().evaluate()
    }

    /// Returns whether the points enclose the hit. Checks that the result does not depend on the points' order
    /// and lanes.
    fn is_enclosed(hit: &CandidateHit, points: &[Point]) -> bool {
        let in_one_lane = points.iter().map(|&point| (0, point)).collect::<Vec<_>>();
        let expected = evaluate_in_lanes(hit, &in_one_lane);
        let mut random = crate::math::Random::new(9, 0);
        for _ in 0..4 {
            let mut in_lanes = in_one_lane.clone();
            for i in (1..in_lanes.len()).rev() {
                in_lanes.swap(i, random.below(i as u64 + 1) as usize);
            }
            in_lanes.iter_mut().for_each(|(lane, _)| *lane = random.below(LANES as u64) as usize);
            let EdgeTestResult { enclosed, sparse } = evaluate_in_lanes(hit, &in_lanes);
            assert_eq!((enclosed & 1, sparse & 1), (expected.enclosed & 1, expected.sparse & 1));
        }
        expected.enclosed & 1 == 1
    }

    const FROM_ABOVE: CandidateHit =
        CandidateHit { normal: Vec3::Z, direction: Vec3::NEG_Z, radius: 1.0 };

    fn is_enclosed_at(degrees: &[f32]) -> bool {
        is_enclosed(&FROM_ABOVE, &at_angles(degrees))
    }

    #[test]
    fn a_hit_is_enclosed_if_the_largest_gap_is_below_180_degrees() {
        assert!(is_enclosed_at(&[0.0, 90.0, 180.0, 270.0]));
        assert!(is_enclosed_at(&[0.0, 60.0, 120.0, 208.0]));
        assert!(is_enclosed_at(&[10.0, 60.0, 120.0, 191.0]));
        assert!(!is_enclosed_at(&[10.0, 60.0, 120.0, 189.0]));
        assert!(!is_enclosed_at(&[0.0, 20.0, 40.0, 60.0]));
        assert!(!is_enclosed_at(&[300.0, 301.0, 299.0, 298.0]));
        assert!(!is_enclosed_at(&[45.0; 5]));
        assert!(!is_enclosed_at(&[0.0, 120.0, 240.0]));
    }

    #[test]
    fn exactly_opposite_points_close_the_gap_in_any_order() {
        let cross = [0.0, 90.0, 180.0, 270.0].map(|a: f32| {
            let (sin, cos) = a.to_radians().sin_cos();
            Vec3::new(cos.round(), sin.round(), 0.1)
        });
        for order in 0..256 {
            let order = [order & 3, order >> 2 & 3, order >> 4 & 3, order >> 6];
            let points: Vec<Point> = order.iter().map(|&i| level(cross[i])).collect();
            // With three of the points the hit lies on the edge itself, so that either result is right.
            match (0..4).filter(|i| order.contains(i)).count() {
                4 => assert!(is_enclosed(&FROM_ABOVE, &points), "{order:?}"),
                3 => {}
                _ => assert!(!is_enclosed(&FROM_ABOVE, &points), "{order:?}"),
            }
        }
    }

    #[test]
    fn every_point_counts_in_a_large_neighborhood() {
        // The first hundred points lie on one side; the last two close the gap.
        let mut degrees: Vec<f32> = (0..100).map(|i| i as f32).collect();
        assert!(!is_enclosed_at(&degrees));
        degrees.extend([200.0, 280.0]);
        assert!(is_enclosed_at(&degrees));
    }

    #[test]
    fn gaps_equal_the_gaps_of_sorted_angles() {
        let mut random = crate::math::Random::new(8, 0);
        for _ in 0..2000 {
            let n = 4 + random.below(20) as usize;
            let span = 400.0 * random.next_f32();
            let mut angles: Vec<f32> = (0..n).map(|_| (span * random.next_f32()) % 360.0).collect();
            let found = is_enclosed_at(&angles);
            angles.sort_by(f32::total_cmp);
            angles.push(angles[0] + 360.0);
            let widest = angles.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f32::max);
            if 0.01 < (widest - 180.0).abs() {
                assert_eq!(found, widest < 180.0, "{angles:?}");
            }
        }
    }

    #[test]
    fn results_are_independent_of_point_order_with_opposite_points() {
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
                let hit =
                    CandidateHit { normal: turn.z_axis, direction: -turn.z_axis, radius: 1.0 };
                let points: Vec<Point> = points
                    .iter()
                    .map(|&i| (turn * eighth(i), MAX_NORMAL_COMPONENT * turn.z_axis))
                    .collect();
                let enclosed = is_enclosed(&hit, &points);
                // With a gap of 4 the hit lies on the edge itself, so that either result is right.
                if widest != 4 {
                    assert_eq!(enclosed, widest < 4, "{points:?}");
                }
            }
        }
    }

    #[test]
    fn points_off_the_plane_or_too_far_away_do_not_count() {
        let mut points = at_angles(&[0.0, 90.0, 180.0]);
        for stray in [Vec3::new(0.0, -1.4, 0.0), Vec3::new(0.0, -0.5, 0.9)] {
            points.push(level(stray));
            assert!(!is_enclosed(&FROM_ABOVE, &points));
            points.pop();
        }
        points.push(level(Vec3::new(0.0, -1.2, 0.0)));
        assert!(is_enclosed(&FROM_ABOVE, &points));
    }

    /// Returns points of a cylinder of radius 2 along Y, relative to the point at X `at` of a ray that passes along
    /// +X at `height` above the cylinder's top.
    fn cylinder_points(height: f32, at: f32) -> Vec<Point> {
        let degrees = (-40..=40).step_by(8);
        let points =
            degrees.flat_map(|a| [-0.5f32, -0.1, 0.4].map(|y| ((a as f32).to_radians(), y)));
        points
            .map(|(angle, y)| {
                let normal = Vec3::new(angle.sin(), 0.0, angle.cos());
                (
                    2.0 * normal + y * Vec3::Y - Vec3::new(at, 0.0, 2.0 + height),
                    MAX_NORMAL_COMPONENT * normal,
                )
            })
            .collect()
    }

    #[test]
    fn a_back_face_beyond_a_bend_is_rejected() {
        let angle = 0.3f32;
        // The tangent disc at `angle` behind the top intersects the ray, at `height` above the top, at this X.
        let height = 0.02;
        let at = (2.0 - (2.0 + height) * angle.cos()) / angle.sin();
        let outward = Vec3::new(angle.sin(), 0.0, angle.cos());
        let back_face = CandidateHit { normal: -outward, direction: Vec3::X, radius: 1.0 };
        assert!(!is_enclosed(&back_face, &cylinder_points(height, at)));
        // The ray hits the outer side of the mirrored disc before the top.
        let outward = Vec3::new(-angle.sin(), 0.0, angle.cos());
        let front_face = CandidateHit { normal: outward, direction: Vec3::X, radius: 1.0 };
        assert!(is_enclosed(&front_face, &cylinder_points(height, -at)));
    }
}
