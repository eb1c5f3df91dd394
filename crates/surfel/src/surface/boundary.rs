//! The angular-gap test: do the points surround a hit, or does it lie beyond the edge of the surface?

use super::PointLanes;
use crate::math::{Floats, LANES, LaneMask, Lanes, Vec3, Vec3Lanes, WIDE, Wide, tangents};

/// Points within this many radii of the hit count ...
pub const NEIGHBOR_REACH: f32 = 1.3;
/// ... if they are not farther than this many from the tangent plane.
const THICKNESS: f32 = 0.8;
/// Points that a ray passed by at least this many radii before the hit tell which side is free.
const PASSED: f32 = 0.2;
/// They contradict the hit's normal if theirs makes this cosine with it, or less.
const CONTRARY: f32 = -0.5;
/// With fewer points than this in reach one looks farther; at 8 the bunny's depths got worse by a sixth,
/// at 4 radii of 0.85 spacings left holes.
const SPARSE: u32 = 5;
/// Fewer points than this are no surface.
const FEWEST: u32 = 4;
/// Sectors of the tangent plane in which the outermost points are remembered: gaps are exact, and
/// any number of points takes the same room.
const SECTORS: usize = 64;

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
}

impl<F: Floats> Candidates<F> {
    #[inline(always)]
    pub fn new(normal: Vec3Lanes<F>, direction: Vec3Lanes<F>, radius: F) -> Self {
        Self { normal, direction, radius, tangents: tangents(normal) }
    }

    /// Which points at `offset` from the hit count.
    #[inline(always)]
    fn near(&self, offset: Vec3Lanes<F>) -> F::Mask {
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

    /// How far the ray, where it passed a point, was from the point's plane, along its normal. That may
    /// have either sign and any length but zero, as it appears twice.
    #[inline(always)]
    fn lift(&self, offset: Vec3Lanes<F>, normal: Vec3Lanes<F>) -> Vec3Lanes<F> {
        let along = offset.dot(self.direction);
        let height = normal.dot(self.direction.scaled(along).minus(offset)) / normal.dot(normal);
        normal.scaled(height)
    }

    /// The `turn` of points about the hit, and which have one: those straight under it have not.
    #[inline(always)]
    fn turn(&self, offset: Vec3Lanes<F>) -> (F, F::Mask) {
        let (x, y) = (offset.dot(self.tangents[0]), offset.dot(self.tangents[1]));
        let least = F::splat(1e-6) * self.radius * self.radius;
        (turn(x, y), least.less(x * x + y * y))
    }
}

/// What the points around a hit have told so far; the order in which they come does not matter but
/// for rounding.
pub struct Surroundings<L: Lanes> {
    hit: Candidates<L>,
    normal: Vec3,
    n_near: u32,
    /// A bit for each sector that holds points.
    taken: u64,
    /// Least and greatest angle (as `turn` has it) of the points of each sector that holds any.
    sectors: [(f32, f32); SECTORS],
    n_passed: u32,
    free_side: Vec3,
}

impl<L: Lanes> Surroundings<L> {
    #[inline(always)]
    pub fn new(Candidate { normal, direction, radius }: Candidate) -> Self {
        let (lanes, direction) = (Vec3Lanes::splat(normal), Vec3Lanes::splat(direction));
        Self {
            hit: Candidates::new(lanes, direction, L::splat(radius)),
            normal,
            n_near: 0,
            taken: 0,
            sectors: [(f32::INFINITY, f32::NEG_INFINITY); SECTORS],
            n_passed: 0,
            free_side: Vec3::ZERO,
        }
    }

    /// Takes in points, relative to the hit; those out of reach or of radius 0 are passed over.
    #[inline(always)]
    pub fn add(&mut self, points: &PointLanes<L>) {
        let PointLanes { center: offset, normal, radius } = *points;
        let is_near = self.hit.near(offset) & L::splat(0.0).less(radius);
        let near = is_near.bits();
        if near == 0 {
            return;
        }
        self.n_near += near.count_ones();
        let mut passed = (self.hit.passed(offset) & is_near).bits();
        if passed != 0 {
            let [x, y, z] = self.hit.lift(offset, normal).store();
            self.n_passed += passed.count_ones();
            while passed != 0 {
                let lane = passed.trailing_zeros() as usize % LANES;
                passed &= passed - 1;
                self.free_side += Vec3::new(x[lane], y[lane], z[lane]);
            }
        }
        let (turns, has_turn) = self.hit.turn(offset);
        let (turns, mut angled) = (turns.store(), near & has_turn.bits());
        while angled != 0 {
            let turn = turns[angled.trailing_zeros() as usize % LANES];
            angled &= angled - 1;
            let sector = (turn * (SECTORS / 4) as f32) as usize % SECTORS;
            self.taken |= 1 << sector;
            let (low, high) = &mut self.sectors[sector];
            *low = low.min(turn);
            *high = high.max(turn);
        }
    }

    /// Whether there are too few points for a judgement.
    pub fn is_sparse(&self) -> bool {
        self.n_near < SPARSE
    }

    /// Whether the points leave no gap of 180 degrees: the hit lies on the surface, not beyond its edge. At
    /// 150 degrees closed surfaces have holes through which one sees their far side, at 200 several times
    /// as many pixels at the silhouettes of a cube's points are false.
    #[inline(always)]
    pub fn enclose(&self) -> bool {
        if self.n_near < FEWEST || self.is_from_within() {
            return false;
        }
        // Mostly the sectors tell, and it saves the rest.
        match rough_gap(self.taken) {
            RoughGap::Narrow => true,
            RoughGap::Doubtful => self.has_no_gap(),
            RoughGap::Wide => false,
        }
    }

    /// Just outside a silhouette, where a disc of the far side sticks out over the bend, a ray meets that
    /// disc from within; lit from the inside it would be a black rim. The ray came through free space, so
    /// the side on which it passed the points before the hit is the free side: a hit is refused if its
    /// normal, continued from theirs, faces away from the ray.
    #[inline(always)]
    fn is_from_within(&self) -> bool {
        if self.n_passed < 2 {
            return false;
        }
        self.free_side.dot(self.normal) < CONTRARY * self.free_side.length()
    }

    fn has_no_gap(&self) -> bool {
        let mut taken = self.taken;
        let (first, mut end) = self.sectors[taken.trailing_zeros() as usize % SECTORS];
        // Gaps within a sector are too small to count, so only those from one to the next are looked at.
        loop {
            taken &= taken - 1;
            let is_last = taken == 0;
            let (low, high) = match is_last {
                true => (first + 4.0, first),
                false => self.sectors[taken.trailing_zeros() as usize % SECTORS],
            };
            let ((x, y), (next_x, next_y)) = (direction(end), direction(low));
            // A wrap onto the same point is the full turn.
            let is_full_turn = is_last && end <= first;
            if is_full_turn || x * next_y - y * next_x < 0.0 {
                return false;
            }
            if is_last {
                return true;
            }
            end = high;
        }
    }
}

/// The surroundings of sixteen hits, a point at a time. Gives those judgements of `Surroundings` that do
/// not take exact angles.
pub struct Vicinities<W> {
    hits: Candidates<W>,
    n_near: W,
    n_passed: W,
    free_side: Vec3Lanes<W>,
    /// A bit for each sector that holds points.
    sectors: [W; 2],
}

/// The lanes whose judgement is known.
pub struct Verdicts {
    pub enclosed: u32,
    pub outside: u32,
    /// There are too few points for a judgement.
    pub sparse: u32,
}

impl<W: Wide> Vicinities<W> {
    #[inline(always)]
    pub fn new(hits: Candidates<W>) -> Self {
        let zero = W::splat(0.0);
        let free_side = Vec3Lanes::splat(Vec3::ZERO);
        Self { hits, n_near: zero, n_passed: zero, free_side, sectors: [zero; 2] }
    }

    /// Takes in a point at `offset` from each hit, for the hits in `lanes`.
    #[inline(always)]
    pub fn add(&mut self, offset: Vec3Lanes<W>, normal: Vec3Lanes<W>, lanes: W::Mask) {
        let (zero, one) = (W::splat(0.0), W::splat(1.0));
        let is_near = lanes & self.hits.near(offset);
        if is_near.bits() == 0 {
            return;
        }
        self.n_near = self.n_near + W::select(is_near, one, zero);
        let is_passed = is_near & self.hits.passed(offset);
        if is_passed.bits() != 0 {
            self.n_passed = self.n_passed + W::select(is_passed, one, zero);
            let lift = self.hits.lift(offset, normal);
            let none = Vec3Lanes::splat(Vec3::ZERO);
            self.free_side = self.free_side.plus(Vec3Lanes::select(is_passed, lift, none));
        }
        let (turn, has_turn) = self.hits.turn(offset);
        let counts = is_near & has_turn;
        let [low, high] = (turn * W::splat((SECTORS / 4) as f32)).to_single_bit();
        self.sectors[0] = self.sectors[0].or_bits(W::select(counts, low, zero));
        self.sectors[1] = self.sectors[1].or_bits(W::select(counts, high, zero));
    }

    #[inline(always)]
    pub fn judge(&self) -> Verdicts {
        let length = self.free_side.dot(self.free_side).sqrt();
        let contrary = self.free_side.dot(self.hits.normal).less(W::splat(CONTRARY) * length);
        let from_within = (contrary & W::splat(1.0).less(self.n_passed)).bits();
        // Points that are too few here may yet be enough farther away.
        let suffice = W::splat(SPARSE as f32).less_equal(self.n_near).bits();
        let (mut narrow, mut wide) = (0, 0);
        let (low, high) = (self.sectors[0].store(), self.sectors[1].store());
        for lane in 0..WIDE {
            let taken = u64::from(low[lane].to_bits()) | u64::from(high[lane].to_bits()) << 32;
            let gap = rough_gap(taken);
            narrow |= u32::from(gap == RoughGap::Narrow) << lane;
            wide |= u32::from(gap == RoughGap::Wide) << lane;
        }
        Verdicts {
            enclosed: suffice & narrow & !from_within,
            outside: suffice & (wide | from_within),
            sparse: !suffice,
        }
    }
}

/// What the sectors tell of the widest gap between points.
#[derive(Clone, Copy, PartialEq, Eq)]
enum RoughGap {
    /// Less than 180 degrees.
    Narrow,
    Doubtful,
    /// More than 180 degrees.
    Wide,
}

/// A quarter of the full turn has 16 sectors: 30 empty ones in a row make, with those at their ends, a gap
/// of less than 180 degrees, 33 alone one of more.
#[inline(always)]
fn rough_gap(taken: u64) -> RoughGap {
    let empty = !taken;
    let two = empty & empty.rotate_right(1);
    let four = two & two.rotate_right(2);
    let eight = four & four.rotate_right(4);
    let sixteen = eight & eight.rotate_right(8);
    if sixteen & sixteen.rotate_right(15) == 0 {
        RoughGap::Narrow
    } else if sixteen & sixteen.rotate_right(16) & empty.rotate_right(32) == 0 {
        RoughGap::Doubtful
    } else {
        RoughGap::Wide
    }
}

/// Grows with the angle of a vector, from 0 to 4, by 1 a quarter and by 1/2 an eighth (no arc tangent:
/// the same on every machine).
#[inline(always)]
fn turn<F: Floats>(x: F, y: F) -> F {
    let zero = F::splat(0.0);
    let (is_left, is_below) = (x.less(zero), y.less(zero));
    let share = y.abs() / (x.abs() + y.abs());
    let (two, four) = (F::splat(2.0), F::splat(4.0));
    let left = F::select(is_below, two + share, two - share);
    F::select(is_left, left, F::select(is_below, four - share, share))
}

/// The unit vector whose `turn` this is, below 8.
fn direction(turn: f32) -> (f32, f32) {
    let turn = if turn < 4.0 { turn } else { turn - 4.0 };
    let half = if turn < 2.0 { turn } else { turn - 2.0 };
    let share = 1.0 - (half - 1.0).abs();
    let x = if (1.0..3.0).contains(&turn) { share - 1.0 } else { 1.0 - share };
    let y = if turn < 2.0 { share } else { -share };
    let length = (x * x + y * y).sqrt();
    (x / length, y / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::PortableLanes;

    /// Offset and normal.
    type Point = (Vec3, Vec3);

    fn level(offset: Vec3) -> Point {
        (offset, Vec3::Z)
    }

    fn at_angles(degrees: &[f32]) -> Vec<Point> {
        let place = |a: &f32| Vec3::new(a.to_radians().cos(), a.to_radians().sin(), 0.1);
        degrees.iter().map(place).map(level).collect()
    }

    fn surroundings(hit: &Candidate, points: &[Point]) -> bool {
        let mut found = Surroundings::<PortableLanes>::new(*hit);
        for points in points.chunks(LANES) {
            let lanes = |value: &dyn Fn(&Point) -> f32| {
                let mut values = [0.0; LANES];
                values.iter_mut().zip(points).for_each(|(lane, point)| *lane = value(point));
                PortableLanes::load(&values)
            };
            let vector = |of: fn(&Point) -> Vec3| Vec3Lanes {
                x: lanes(&|point| of(point).x),
                y: lanes(&|point| of(point).y),
                z: lanes(&|point| of(point).z),
            };
            let (center, normal) = (vector(|point| point.0), vector(|point| point.1));
            found.add(&PointLanes { center, normal, radius: lanes(&|_| 1.0) });
        }
        found.enclose()
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
    fn turns_and_directions_are_inverse_and_eighths_are_eighths() {
        for degrees in (0..360).map(|d| d as f32 + 0.5) {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let turn = |x, y| turn(PortableLanes::splat(x), PortableLanes::splat(y)).store()[0];
            let (x, y) = direction(turn(3.0 * cos, 3.0 * sin));
            assert!((x - cos).abs() < 1e-5 && (y - sin).abs() < 1e-5, "{degrees}: {x} {y}");
            assert_eq!((2.0 * turn(cos, sin)) as u32, (degrees / 45.0) as u32);
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
                (2.0 * normal + y * Vec3::Y - Vec3::new(at, 0.0, 2.0 + height), normal)
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
