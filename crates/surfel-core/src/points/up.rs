//! Inference of the up axis of a cloud whose file does not state it.

use super::PointCloud;
use super::cloud::is_valid_position;
use crate::math::Vec3;

/// The inferred up axis.
#[derive(Clone, Debug, PartialEq)]
pub struct InferredUp {
    /// Unit vector along the axis.
    pub up: Vec3,
    /// The reason for the choice, in one line.
    pub reason: String,
}

/// Thickness of the slab at each end of an axis, as a fraction of the longest side.
const SLAB_THICKNESS: f64 = 0.01;

/// Minimum fraction of the points that lie on a floor.
const MIN_FLOOR_FRACTION: f64 = 0.02;

/// Minimum ratio of the points on the floor to those at any other end: 5 for the Stanford bunny, 3.6 for the
/// armadillo. A room whose walls are scanned as well as its floor has a lower ratio.
const MIN_FLOOR_RATIO: f64 = 2.5;

/// Infers the up axis: +Z, unless the cloud stands on a floor or a flat base at the low end of Y alone.
///
/// Objects stand on something flat, so many points share the lowest height and few the highest: the Stanford bunny
/// (Y up) has 4.9 % of its points in the lowest hundredth, and below 1 % at every other end. Only Y and Z are
/// compared, as no common program exports with X up. A single wall perpendicular to Y misleads.
pub fn infer_up(cloud: &PointCloud, is_georeferenced: bool) -> InferredUp {
    if is_georeferenced {
        let reason = "up is +Z, as in every georeferenced file".to_owned();
        return InferredUp { up: Vec3::Z, reason };
    }
    let [x, y, z] = ends(&cloud.positions);
    let other = x.low.max(x.high).max(y.high).max(z.low).max(z.high);
    if MIN_FLOOR_FRACTION <= y.low && MIN_FLOOR_RATIO * other < y.low {
        let percent = 100.0 * y.low;
        let reason = format!(
            "up is +Y: {percent:.1} % of the points lie on a flat base at the low end of Y"
        );
        return InferredUp { up: Vec3::Y, reason };
    }
    InferredUp { up: Vec3::Z, reason: "up is +Z, the default".to_owned() }
}

/// Fraction of the points near each end of an axis.
#[derive(Clone, Copy, Default)]
struct Ends {
    low: f64,
    high: f64,
}

fn ends(positions: &[Vec3]) -> [Ends; 3] {
    let step = positions.len().div_ceil(200_000).max(1);
    let sample: Vec<Vec3> =
        positions.iter().step_by(step).copied().filter(|p| is_valid_position(*p)).collect();
    if sample.is_empty() {
        return [Ends::default(); 3];
    }
    let sorted = [0, 1, 2].map(|axis| {
        let mut values: Vec<f64> = sample.iter().map(|p| f64::from(p[axis])).collect();
        values.sort_unstable_by(f64::total_cmp);
        values
    });
    // A few outliers may lie below the floor.
    let n_outliers = sample.len() / 1000;
    let range = |values: &[f64]| (values[n_outliers], values[values.len() - 1 - n_outliers]);
    let sides = sorted.each_ref().map(|values| range(values).1 - range(values).0);
    let slab = SLAB_THICKNESS * sides.into_iter().fold(0.0, f64::max);
    sorted.each_ref().map(|values| {
        let (low, high) = range(values);
        let n_low = values.partition_point(|&value| value <= low + slab);
        let n_below_high = values.partition_point(|&value| value < high - slab);
        let fraction = |count: usize| count as f64 / values.len() as f64;
        Ends { low: fraction(n_low), high: fraction(values.len() - n_below_high) }
    })
}

#[cfg(test)]
mod tests {
    //! Inferred axes of known clouds.

    use super::*;
    use crate::math::Random;

    /// Balls of points on a ground plane, Z up.
    fn things_on_the_ground() -> Vec<Vec3> {
        let mut random = Random::new(1, 0);
        let mut next = || random.next_f32();
        let ground = (0..3000).map(|_| Vec3::new(20.0 * next(), 20.0 * next(), 0.02 * next()));
        let mut points: Vec<Vec3> = ground.collect();
        while points.len() < 6000 {
            let v = Vec3::new(next() - 0.5, next() - 0.5, next() - 0.5);
            points.push(Vec3::new(10.0, 8.0, 4.0) + 4.0 * v.normalize_or(Vec3::X));
        }
        points
    }

    fn inferred(points: impl IntoIterator<Item = Vec3>) -> Vec3 {
        infer_up(&PointCloud::from_positions(points.into_iter().collect()), false).up
    }

    #[test]
    fn a_ground_plane_lies_at_the_bottom() {
        let points = things_on_the_ground();
        assert_eq!(inferred(points.iter().copied()), Vec3::Z);
        let y_up = points.iter().map(|p| Vec3::new(p.x, p.z, -p.y));
        assert_eq!(inferred(y_up.clone()), Vec3::Y);
        let outliers = (0..5).map(|i| Vec3::splat(-100.0 * i as f32));
        assert_eq!(inferred(y_up.clone().chain(outliers)), Vec3::Y);
        let cloud = PointCloud::from_positions(y_up.collect());
        assert_eq!(infer_up(&cloud, true).up, Vec3::Z);
    }

    #[test]
    fn a_flat_base_lies_at_the_bottom() {
        // A dome of points over its own base, as closed scans of standing things have.
        let mut random = Random::new(2, 0);
        let dome = (0..20_000).map(|_| {
            let direction =
                Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32));
            let on_ball = direction.normalize();
            Vec3::new(on_ball.x, on_ball.y.max(-0.8), on_ball.z)
        });
        assert_eq!(inferred(dome), Vec3::Y);
    }

    #[test]
    fn up_is_z_without_evidence() {
        let mut random = Random::new(3, 0);
        let mut in_a_box =
            || Vec3::new(random.next_f32(), random.next_f32(), random.next_f32() * 0.1);
        assert_eq!(inferred((0..5000).map(|_| in_a_box())), Vec3::Z);
        let room = (0..6000).map(|i| {
            let mut p = in_a_box();
            p[i % 3] = if i % 2 == 0 { 0.0 } else { 1.0 };
            p
        });
        assert_eq!(inferred(room), Vec3::Z);
        for points in [vec![], vec![Vec3::ONE], vec![Vec3::ONE; 9], vec![Vec3::NAN; 2]] {
            assert_eq!(inferred(points), Vec3::Z);
        }
    }
}
