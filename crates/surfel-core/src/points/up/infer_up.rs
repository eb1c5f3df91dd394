//! Inference of the up axis of a cloud whose file does not state it.

use super::axis_statistics::{AxisStatistics, is_wide_and_flat};
use super::camera_axes::CameraAxes;
use super::inferred_up::InferredUp;
use super::mirror_symmetry::mirror_axis;
use super::sample::sample;
use crate::math::Vec3;
use crate::points::PointCloud;

/// The up axis that a file's format implies.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum UpConvention {
    /// The format has no convention, as PLY and text.
    #[default]
    Unknown,
    /// Survey data: +Z, whatever the points show.
    Georeferenced,
    /// Programs that write the named format mostly have +Z up.
    ZUp(String),
    /// Programs that write the named format mostly have +Y up.
    YUp(String),
}

/// Infers the up axis of a cloud from its format and from its points.
///
/// Objects stand on something flat, so many points share the lowest height and few the highest: the Stanford bunny
/// (Y up) has 4.9 % of its points in the lowest hundredth, and below 1 % at every other end. Terrain and cities are
/// wide and flat. Such evidence overrides a convention. X is no candidate, as no common program exports with X up,
/// and neither is -Z, as the tops of tables and roofs are as flat as floors. A single wall perpendicular to Y
/// misleads. What is left is the left and right side of an animal or a vehicle.
pub fn infer_up(cloud: &PointCloud, convention: &UpConvention) -> InferredUp {
    let choice = |up: Vec3, reason: String| InferredUp { up, reason };
    if *convention == UpConvention::Georeferenced {
        return choice(Vec3::Z, "up is +Z, the convention of survey data".to_owned());
    }
    let points = sample(&cloud.positions);
    let shape = AxisStatistics::of(&points);
    let evidence = shape.flat_base().or_else(|| shape.terrain());
    let evidence = evidence.or_else(|| beside_mirror_axis(&points));
    let zero = (-cloud.origin).as_vec3();
    let offsets = || points.iter().map(|p| *p - zero).collect::<Vec<Vec3>>();
    match convention {
        UpConvention::YUp(format) => match evidence {
            Some(found) if found.up == Vec3::Z => found,
            _ => choice(Vec3::Y, format!("up is +Y, the convention of {format}")),
        },
        UpConvention::ZUp(format) => match evidence {
            Some(found) if found.up == Vec3::Y => found,
            _ => choice(Vec3::Z, format!("up is +Z, the convention of {format}")),
        },
        _ => {
            // The survey of a drone whose middle is zero lies in the field of view of a camera, too.
            let is_terrain = shape.terrain().is_some();
            let camera = CameraAxes::of_points(&offsets()).filter(|_| !is_terrain);
            match camera.filter(|axes| *axes == CameraAxes::YDown || evidence.is_none()) {
                Some(axes) => {
                    let name = if axes.up() == Vec3::Y { "+Y" } else { "-Y" };
                    let view = "the field of view of a depth camera at the origin";
                    choice(axes.up(), format!("up is {name}: nearly all points lie in {view}"))
                }
                None => evidence
                    .or_else(|| shape.figure())
                    .unwrap_or_else(|| choice(Vec3::Z, "up is +Z, the default".to_owned())),
            }
        }
    }
}

/// Returns the one of +Y and +Z along which the points are not their own mirror image, if along the other they are: an
/// animal or a vehicle is alike on its left and right, but not above and below.
fn beside_mirror_axis(points: &[Vec3]) -> Option<InferredUp> {
    let (up, name, mirrored) = match mirror_axis(points)? {
        1 => (Vec3::Z, "+Z", "Y"),
        2 => (Vec3::Y, "+Y", "Z"),
        _ => return None,
    };
    let reason = format!("up is {name}: the points are their mirror image along {mirrored} alone");
    Some(InferredUp { up, reason })
}

/// Returns true if a cloud is large, wide and flat in X and Y, as terrain and cities are.
pub(crate) fn is_terrain(positions: &[Vec3]) -> bool {
    AxisStatistics::of(&sample(positions)).terrain().is_some()
}

/// Returns true if most points of a cloud form land that is large, wide and flat in X and Y, whatever stands on it.
pub(crate) fn is_mostly_land(positions: &[Vec3]) -> bool {
    /// Fraction of the points at each end of an axis that need not be part of the land.
    const FRACTION: f64 = 0.1;
    let sample = sample(positions);
    if sample.is_empty() {
        return false;
    }
    let n_left_out = (FRACTION * sample.len() as f64) as usize;
    let last = sample.len() - 1 - n_left_out;
    is_wide_and_flat([0, 1, 2].map(|axis| {
        let mut values: Vec<f32> = sample.iter().map(|p| p[axis]).collect();
        let high = *values.select_nth_unstable_by(last, f32::total_cmp).1;
        f64::from(high - *values.select_nth_unstable_by(n_left_out, f32::total_cmp).1)
    }))
}

#[cfg(test)]
mod tests {
    //! Inferred axes of known clouds.

    use super::*;
    use crate::math::{DVec3, Random};

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
        inferred_with(points, &UpConvention::Unknown)
    }

    fn inferred_with(points: impl IntoIterator<Item = Vec3>, convention: &UpConvention) -> Vec3 {
        infer_up(&PointCloud::from_positions(points.into_iter().collect()), convention).up
    }

    /// Points on a ball.
    fn ball() -> Vec<Vec3> {
        let mut random = Random::new(4, 0);
        let mut gaussian = || random.next_gaussian() as f32;
        let directions = (0..5000).map(|_| Vec3::new(gaussian(), gaussian(), gaussian()));
        directions.map(|v| v.normalize_or(Vec3::X)).collect()
    }

    #[test]
    fn a_convention_decides_without_evidence() {
        let (obj, stl) = (UpConvention::YUp("OBJ".into()), UpConvention::ZUp("STL".into()));
        assert_eq!(inferred_with(ball(), &obj), Vec3::Y);
        assert_eq!(inferred_with(ball(), &stl), Vec3::Z);
        assert_eq!(inferred_with(vec![], &obj), Vec3::Y);
    }

    #[test]
    fn a_floor_overrides_a_convention() {
        let (obj, stl) = (UpConvention::YUp("OBJ".into()), UpConvention::ZUp("STL".into()));
        let z_up = things_on_the_ground();
        let y_up = z_up.iter().map(|p| Vec3::new(p.x, p.z, -p.y));
        assert_eq!(inferred_with(z_up.iter().copied(), &obj), Vec3::Z);
        assert_eq!(inferred_with(y_up.clone(), &obj), Vec3::Y);
        assert_eq!(inferred_with(y_up.clone(), &stl), Vec3::Y);
        assert_eq!(inferred_with(y_up, &UpConvention::Georeferenced), Vec3::Z);
    }

    #[test]
    fn terrain_overrides_a_convention() {
        let mut random = Random::new(5, 0);
        let mut next = || random.next_f32();
        let hills = (0..5000).map(|_| {
            let (x, y) = (100.0 * next(), 100.0 * next());
            Vec3::new(x, y, 5.0 * (0.1 * x).sin() + 5.0 * (0.13 * y).cos())
        });
        let z_up: Vec<Vec3> = hills.collect();
        assert_eq!(inferred_with(z_up.iter().copied(), &UpConvention::YUp("OBJ".into())), Vec3::Z);
        let relief = z_up.iter().map(|p| 0.01 * *p);
        assert_eq!(inferred_with(relief, &UpConvention::YUp("OBJ".into())), Vec3::Y);
    }

    #[test]
    fn the_left_and_right_side_of_a_vehicle_override_a_convention() {
        // A fuselage with wings and a fin, X ahead, Y to the left, Z up.
        let mut random = Random::new(10, 0);
        let mut next = || random.next_f32() - 0.5;
        let mut points: Vec<Vec3> = Vec::new();
        for _ in 0..3000 {
            points.push(Vec3::new(4.0 * next(), 0.4 * next(), 0.4 * next()));
            points.push(Vec3::new(0.3 + 0.5 * next(), 3.0 * next(), 0.3));
            points.push(Vec3::new(-1.8 + 0.3 * next(), 0.0, 0.8 * (next() + 0.5)));
        }
        let y_up: Vec<Vec3> = points.iter().map(|p| Vec3::new(p.y, p.z, p.x)).collect();
        let z_wide: Vec<Vec3> = points.iter().map(|p| Vec3::new(p.x, p.z, -p.y)).collect();
        let (obj, stl) = (UpConvention::YUp("OBJ".into()), UpConvention::ZUp("STL".into()));
        assert_eq!(inferred_with(points, &obj), Vec3::Z);
        assert_eq!(inferred_with(z_wide, &stl), Vec3::Y);
        assert_eq!(inferred_with(y_up.clone(), &obj), Vec3::Y);
        assert_eq!(inferred_with(y_up, &stl), Vec3::Z);
    }

    /// Points as a depth camera at zero measures them.
    fn depth_frame() -> Vec<Vec3> {
        let mut random = Random::new(6, 0);
        let mut next = || random.next_f32();
        let point = |_| {
            let depth = 1.0 + 2.0 * next();
            Vec3::new(depth * (next() - 0.5), depth * (next() - 0.5), depth)
        };
        (0..5000).map(point).collect()
    }

    #[test]
    fn a_depth_camera_at_the_origin_has_y_down_and_z_ahead_or_y_up_and_z_to_the_back() {
        assert_eq!(inferred(depth_frame()), Vec3::NEG_Y);
        let back = depth_frame().into_iter().map(|p| Vec3::new(p.x, -p.y, -p.z));
        assert_eq!(inferred(back), Vec3::Y);
        let elsewhere = depth_frame().into_iter().map(|p| p - 2.0 * Vec3::Z);
        assert_eq!(inferred(elsewhere), Vec3::Z);
    }

    #[test]
    fn terrain_above_zero_is_no_depth_image() {
        let mut random = Random::new(11, 0);
        let mut next = || random.next_f32();
        for [side, low, high] in [[150.0, 240.0, 260.0], [200.0, 100.0, 130.0]] {
            let mut point = || {
                let [x, y] = [0.05, 0.04].map(|frequency| (side * (next() - 0.5), frequency));
                let hills = 0.25 * ((x.0 * x.1).sin() + (y.0 * y.1).cos()) + 0.5;
                Vec3::new(x.0, y.0, low + (high - low) * hills)
            };
            assert_eq!(inferred((0..5000).map(|_| point())), Vec3::Z);
        }
    }

    #[test]
    fn a_depth_camera_stands_at_the_zero_of_the_file_and_not_at_that_of_the_cloud() {
        let up = |positions: Vec<Vec3>, origin: DVec3| {
            let cloud = PointCloud { origin, ..PointCloud::from_positions(positions) };
            infer_up(&cloud, &UpConvention::Unknown).up
        };
        let rebased = depth_frame().into_iter().map(|p| p - 2.0 * Vec3::Z).collect();
        assert_eq!(up(rebased, 2.0 * DVec3::Z), Vec3::NEG_Y);
        assert_eq!(up(depth_frame(), -2.0 * DVec3::Z), Vec3::Z);
    }

    #[test]
    fn a_ground_plane_lies_at_the_bottom() {
        let points = things_on_the_ground();
        assert_eq!(inferred(points.iter().copied()), Vec3::Z);
        let y_up = points.iter().map(|p| Vec3::new(p.x, p.z, -p.y));
        assert_eq!(inferred(y_up.clone()), Vec3::Y);
        let outliers = (0..5).map(|i| Vec3::splat(-100.0 * i as f32));
        assert_eq!(inferred(y_up.clone().chain(outliers)), Vec3::Y);
        let y_down = points.iter().map(|p| Vec3::new(p.x, -p.z, p.y));
        assert_eq!(inferred(y_down), Vec3::NEG_Y);
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
    fn a_pedestal_lies_at_the_bottom() {
        // A ball on a box whose six sides are seen.
        let mut random = Random::new(8, 0);
        let on_box = (0..9000).map(|i| {
            let mut p = Vec3::from_array(std::array::from_fn(|_| random.next_f32() - 0.5));
            p[i % 3] = if i % 2 == 0 { -0.5 } else { 0.5 };
            p
        });
        let statue: Vec<Vec3> =
            on_box.chain(ball().into_iter().map(|p| 0.6 * p + Vec3::Y)).collect();
        assert_eq!(inferred(statue.iter().copied()), Vec3::Y);
        assert_eq!(inferred(statue.iter().map(|p| Vec3::new(p.x, -p.z, p.y))), Vec3::Z);
        assert_eq!(inferred(statue.iter().map(|p| Vec3::new(p.x, -p.y, p.z))), Vec3::NEG_Y);
    }

    #[test]
    fn a_figure_on_a_pedestal_stands_upright() {
        // A pedestal of which the sides and the top are seen, and a body that tapers to a head.
        let mut random = Random::new(9, 0);
        let mut next = || random.next_f32() - 0.5;
        let mut points: Vec<Vec3> = Vec::new();
        for i in 0..6000 {
            let mut p = Vec3::new(next(), 0.3 * next(), next());
            match i % 5 {
                0 => p.y = 0.15,
                side => p[2 * (side % 2)] = if side < 3 { -0.5 } else { 0.5 },
            }
            points.push(p);
        }
        let body = (0..20_000).map(|_| {
            let height = next() + 0.5;
            let turn = std::f32::consts::TAU * next();
            let radius = 0.35 - 0.25 * height;
            Vec3::new(radius * turn.cos(), 0.15 + 1.8 * height, radius * turn.sin())
        });
        points.extend(body.collect::<Vec<Vec3>>());
        assert_eq!(inferred(points.iter().copied()), Vec3::Y);
        let z_up = points.iter().map(|p| Vec3::new(p.x, -p.z, p.y));
        assert_eq!(inferred(z_up), Vec3::Z);
        // A car is as wide before as behind.
        let car = points.iter().map(|p| Vec3::new(p.x, p.y.abs(), p.z));
        let ends = car.clone().map(|p| Vec3::new(p.x, 2.0 - p.y, p.z)).chain(car);
        assert_eq!(inferred(ends), Vec3::Z);
    }

    #[test]
    fn the_foot_of_an_upright_object_lies_at_the_bottom() {
        // A ball on a box that is as deep as the ball, but not as wide; the box has half of the points.
        let mut random = Random::new(9, 0);
        let on_box = (0..6000).map(|i| {
            let mut p = Vec3::from_array(std::array::from_fn(|_| random.next_f32() - 0.5));
            p[i % 3] = if i % 2 == 0 { -0.5 } else { 0.5 };
            p
        });
        let head = ball().into_iter().map(|p| Vec3::new(0.7, 0.5, 0.45) * p + Vec3::Y);
        let bust: Vec<Vec3> = on_box.chain(head).collect();
        assert_eq!(inferred(bust.iter().copied()), Vec3::Y);
        assert_eq!(inferred(bust.iter().map(|p| Vec3::new(p.x, -p.y, p.z))), Vec3::NEG_Y);
        // A corridor along Y that is open at one end.
        let corridor = (0..6000).map(|i| {
            let mut p = Vec3::from_array(std::array::from_fn(|_| random.next_f32() - 0.5));
            match i % 8 {
                7 => p.y = -0.5,
                side => p[2 * (side % 2)] = if i % 4 < 2 { -0.5 } else { 0.5 },
            }
            p * Vec3::new(1.0, 5.0, 1.0)
        });
        assert_eq!(inferred(corridor), Vec3::Z);
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
