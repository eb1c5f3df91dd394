//! Views along tunnels, galleries and culverts: long clouds that are closed all around and hollow, and show nothing from
//! outside.

use super::corridor::long_axis;
use super::ground::ground_axes;
use super::inliers::{range_along, sample_inliers};
use super::inside_view::InsideView;
use crate::math::{Vec3, median, quantile};
use crate::points::PointCloud;
use std::f32::consts::TAU;

/// Length of a slice in widths of the tunnel.
const SLICE_LENGTH: f32 = 0.5;
/// Number of sectors around the middle of a slice.
const N_SECTORS: usize = 24;
/// Minimum fraction of the sectors with points around a closed slice: the shadow of a vehicle hides some.
const MIN_SECTORS: f64 = 0.8;
/// Minimum fraction of the slices that are closed: niches, portals and the shadow of the scanner open some.
const MIN_CLOSED: f64 = 0.8;
/// Minimum number of points in a slice that counts.
const MIN_POINTS: usize = 4 * N_SECTORS;
/// Fraction of the distance of the wall up to which points lie in the middle of the tunnel, which is free.
const MIDDLE: f32 = 0.4;
/// Maximum fraction of the points in the middle.
const MAX_IN_MIDDLE: f64 = 0.1;
/// Fraction of the distance of the wall up to which points lie within the tunnel: a road, rails, cables, lamps.
const INNER: f32 = 0.9;
/// Minimum fraction of the points within: pipes and beams, which were scanned from outside, have none.
const MIN_INNER: f64 = 0.01;
/// Minimum ratio of the width at an end to the typical one: fishes, tools and planes taper off.
const MIN_END: f32 = 0.6;
/// Maximum number of normals that are looked at.
const MAX_NORMALS: usize = 10_000;
/// Minimum number of points around the camera, as a fraction of that of the densest slice.
const MIN_DENSITY: f64 = 0.5;
/// Minimum distance of the camera from the ends of the tunnel, in slices.
const N_SLICES_BEHIND: usize = 2;
/// Distance of the camera from the points that are dense, in slices: they are seen better from before them.
const N_SLICES_BEFORE: usize = 3;
/// Distance of what the camera looks at, in slices: beyond it a tunnel may bend.
const N_SLICES_AHEAD: usize = 8;
/// Vertical angle of view in degrees: wider than for objects, as the walls are near.
const VIEW_ANGLE_DEG: f64 = 60.0;

/// A piece of a tunnel.
struct Slice {
    /// Middle of the points, zero if they are too few for a closed slice.
    middle: Vec3,
    /// Distance of the wall from the middle.
    radius: f32,
    /// True if points lie all around.
    is_closed: bool,
    n_points: usize,
    n_in_middle: usize,
    n_inner: usize,
}

/// Returns the view along the tunnel that the points of a cloud show, or `None` if they show none. It is the longest one to
/// where the points are dense, as near a scanner; of equally long ones that to the north or east.
pub fn find_tunnel(cloud: &PointCloud, up: Vec3) -> Option<InsideView> {
    let points = sample_inliers(cloud);
    let axis = long_axis(&points, up)?;
    let (east, north) = ground_axes(up);
    let axis = if axis.dot(north + 0.01 * east) < 0.0 { -axis } else { axis };
    let slices = slices(&points, axis, up);
    let first = slices.iter().position(|slice| slice.is_closed)?;
    let last = slices.iter().rposition(|slice| slice.is_closed)?;
    let between = &slices[first..=last];
    if !is_hollow(between, slices.len()) || !faces_inside(cloud, axis, &slices) {
        return None;
    }
    let dense = dense_slices(between);
    let (south, north) = (*dense.first()?, *dense.last()?);
    let end = between.len() - 1;
    let (near, far) = match south <= end - north {
        true => {
            let near = south.saturating_sub(N_SLICES_BEFORE).max(N_SLICES_BEHIND);
            (near, (near + N_SLICES_AHEAD).min(end))
        }
        false => {
            let near = (north + N_SLICES_BEFORE).min(end - N_SLICES_BEHIND);
            (near, near.saturating_sub(N_SLICES_AHEAD))
        }
    };
    let (near, far) = (nearest_closed(between, near)?, nearest_closed(between, far)?);
    if near == far {
        return None;
    }
    let (near, far) = (between[near].middle, between[far].middle);
    let ahead = (far - near).as_dvec3();
    Some(InsideView {
        position: cloud.origin + near.as_dvec3(),
        direction: ahead.normalize(),
        distance: ahead.length(),
        view_angle_deg: VIEW_ANGLE_DEG,
    })
}

/// Returns the index of the closed slice that is nearest to the one at `slice_idx`, or `None` if none is closed.
fn nearest_closed(slices: &[Slice], slice_idx: usize) -> Option<usize> {
    let closed = (0..slices.len()).filter(|other| slices[*other].is_closed);
    closed.min_by_key(|other| other.abs_diff(slice_idx))
}

/// Returns the slices, but those at the ends, that have many points for the tunnel.
fn dense_slices(slices: &[Slice]) -> Vec<usize> {
    let most = slices.iter().map(|slice| slice.n_points).max().unwrap_or_default();
    let is_dense = |slice: &usize| MIN_DENSITY * most as f64 <= slices[*slice].n_points as f64;
    let inner = N_SLICES_BEHIND..slices.len().saturating_sub(N_SLICES_BEHIND);
    inner.filter(|slice| slices[*slice].is_closed).filter(is_dense).collect()
}

/// True if most of `n_slices` are closed, with few points in the middle and some within, and about as wide at both ends.
fn is_hollow(slices: &[Slice], n_slices: usize) -> bool {
    let n_closed = slices.iter().filter(|slice| slice.is_closed).count();
    let sum = |count: fn(&Slice) -> usize| slices.iter().map(count).sum::<usize>() as f64;
    let n_points = sum(|slice| slice.n_points);
    let Some(typical) = median(slices.iter().map(|slice| slice.radius)) else { return false };
    let is_open_end = |slice: &Slice| {
        MIN_END * typical <= slice.radius
            && slice.n_in_middle as f64 <= MAX_IN_MIDDLE * slice.n_points as f64
    };
    MIN_CLOSED * n_slices as f64 <= n_closed as f64
        && sum(|slice| slice.n_in_middle) <= MAX_IN_MIDDLE * n_points
        && MIN_INNER * n_points <= sum(|slice| slice.n_inner)
        && slices.first().is_some_and(is_open_end)
        && slices.last().is_some_and(is_open_end)
}

/// True if most normals of the cloud, if it has any, point toward the middle of their slice.
fn faces_inside(cloud: &PointCloud, axis: Vec3, slices: &[Slice]) -> bool {
    let Some(normals) = &cloud.normals else { return true };
    let middles: Vec<(f32, Vec3)> = slices
        .iter()
        .filter(|slice| slice.is_closed)
        .map(|slice| (slice.middle.dot(axis), slice.middle))
        .collect();
    let is_inward = |(point, normal): (&Vec3, &Vec3)| {
        let along = point.dot(axis);
        let next = middles.partition_point(|(other, _)| *other < along).min(middles.len() - 1);
        0.0 < normal.dot(middles[next].1 - *point)
    };
    let step = cloud.len().div_ceil(MAX_NORMALS).max(1);
    let sample = cloud.positions.iter().zip(normals).step_by(step);
    let n_samples = sample.len();
    n_samples < 2 * sample.filter(|sample| is_inward(*sample)).count()
}

/// Returns the slices of the points along an axis.
fn slices(points: &[Vec3], axis: Vec3, up: Vec3) -> Vec<Slice> {
    let side = up.cross(axis);
    let extent = |axis: Vec3| {
        let (low, high) = range_along(points, axis);
        high - low
    };
    let (low, high) = range_along(points, axis);
    let width = extent(side).min(extent(up)).max((high - low) / points.len() as f32);
    let n_slices = ((high - low) / (SLICE_LENGTH * width)).floor().max(1.0);
    let mut of_slices: Vec<Vec<Vec3>> = vec![Vec::new(); n_slices as usize];
    for point in points {
        let slice = ((point.dot(axis) - low) / (high - low) * n_slices) as usize;
        of_slices[slice.min(n_slices as usize - 1)].push(*point);
    }
    of_slices.iter().map(|points| Slice::of(points, axis, side, up)).collect()
}

impl Slice {
    fn of(points: &[Vec3], axis: Vec3, side: Vec3, up: Vec3) -> Self {
        let middle_along = |axis: Vec3| {
            let (low, high) = range_along(points, axis);
            0.5 * (low + high)
        };
        if points.len() < MIN_POINTS {
            let middle = Vec3::ZERO;
            return Self {
                middle,
                radius: 0.0,
                is_closed: false,
                n_points: 0,
                n_in_middle: 0,
                n_inner: 0,
            };
        }
        let (across, height) = (middle_along(side), middle_along(up));
        let polar = |point: &Vec3| {
            let (x, y) = (point.dot(side) - across, point.dot(up) - height);
            let sector = (y.atan2(x) / TAU + 0.5) * N_SECTORS as f32;
            ((sector as usize).min(N_SECTORS - 1), x.hypot(y))
        };
        let mut of_sectors: Vec<Vec<f32>> = vec![Vec::new(); N_SECTORS];
        for (sector, distance) in points.iter().map(polar) {
            of_sectors[sector].push(distance);
        }
        let (mut n_in_middle, mut n_inner, mut radius) = (0, 0, 0.0);
        for distances in &of_sectors {
            // Few points lie behind the wall.
            let Some(wall) = quantile(distances.iter().copied(), 0.9) else { continue };
            let n_within =
                |fraction: f32| distances.iter().filter(|d| **d < fraction * wall).count();
            radius += wall / N_SECTORS as f32;
            n_in_middle += n_within(MIDDLE);
            n_inner += n_within(INNER);
        }
        let n_filled = of_sectors.iter().filter(|distances| !distances.is_empty()).count();
        Self {
            middle: middle_along(axis) * axis + across * side + height * up,
            radius,
            is_closed: MIN_SECTORS * N_SECTORS as f64 <= n_filled as f64,
            n_points: points.len(),
            n_in_middle,
            n_inner,
        }
    }
}

#[cfg(test)]
mod tests {
    //! Tunnels are seen from within, and long things that are no tunnels are not.

    use super::*;
    use crate::math::{DVec3, Random};

    const RADIUS: f32 = 3.0;
    const N_POINTS: usize = 60_000;

    /// The surface of a round pipe of 100 units along X with a radius at each place, from 0 to 1, of its length.
    fn pipe(radius: impl Fn(f32) -> f32) -> Vec<Vec3> {
        let mut random = Random::new(3, 0);
        let mut point = || {
            let (along, angle) = (random.next_f32(), TAU * random.next_f32());
            Vec3::new(100.0 * along, radius(along) * angle.cos(), radius(along) * angle.sin())
        };
        (0..N_POINTS).map(|_| point()).collect()
    }

    /// Two rails.
    fn rails() -> Vec<Vec3> {
        let mut random = Random::new(4, 0);
        (0..N_POINTS / 20)
            .map(|i| Vec3::new(100.0 * random.next_f32(), (i % 2) as f32 - 0.5, -2.0))
            .collect()
    }

    fn tunnel() -> Vec<Vec3> {
        [pipe(|_| RADIUS), rails()].concat()
    }

    fn view(positions: Vec<Vec3>) -> Option<InsideView> {
        find_tunnel(&PointCloud::from_positions(positions), Vec3::Z)
    }

    #[test]
    fn a_tunnel_is_seen_along_its_axis_wherever_it_lies() {
        for (sin, cos) in [0.0f32, 0.6, 1.9, 3.0].map(f32::sin_cos) {
            let turned = |p: Vec3| Vec3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z);
            let positions = tunnel().into_iter().map(turned).collect();
            let origin = DVec3::new(690_000.0, 5_300_000.0, 500.0);
            let cloud = PointCloud { origin, ..PointCloud::from_positions(positions) };
            let view = find_tunnel(&cloud, Vec3::Z).unwrap();
            let axis = turned(Vec3::X).as_dvec3();
            assert!(0.99 < view.direction.dot(axis).abs(), "{view:?}");
            // The end is at least one width away, and the camera hangs in the middle.
            let offset = view.position - origin;
            let along = offset.dot(axis);
            assert!((5.0..95.0).contains(&along) && offset.distance(along * axis) < 0.3, "{along}");
            assert!(0.0 < view.direction.dot(axis) * (50.0 - along), "{along}");
        }
    }

    #[test]
    fn a_bend_is_seen_along_its_first_part() {
        let bent = |p: Vec3| p + Vec3::Y * 0.0025 * p.x * p.x;
        let view = view(tunnel().into_iter().map(bent).collect()).unwrap();
        let middle = bent(view.position.as_vec3().with_y(0.0).with_z(0.0));
        assert!(view.position.as_vec3().distance(middle) < 0.5, "{view:?}");
    }

    #[test]
    fn a_gap_without_points_is_neither_looked_from_nor_looked_at() {
        // The gaps are where the camera would stand, and where it would look. The tunnel is beside the cloud's zero.
        for gaps in [vec![5.0f32..10.0, 90.0..95.0], vec![28.0..36.0]] {
            let is_kept = |p: &Vec3| !gaps.iter().any(|gap| gap.contains(&p.x));
            let kept = tunnel().into_iter().filter(is_kept);
            let view = view(kept.map(|p| p + 50.0 * Vec3::Y).collect()).unwrap();
            assert!(0.99 < view.direction.x.abs(), "{gaps:?}: {view:?}");
            assert!((view.position.y - 50.0).abs() < 0.3, "{gaps:?}: {view:?}");
        }
    }

    #[test]
    fn points_that_are_dense_are_seen_from_before_them() {
        let near_scanner = |p: &Vec3| (60.0..64.0).contains(&p.x);
        let dense = tunnel();
        let few = dense.iter().filter(|p| !near_scanner(p)).step_by(3);
        let positions = dense.iter().filter(|p| near_scanner(p)).chain(few).copied().collect();
        let view = view(positions).unwrap();
        assert!(view.direction.x < -0.99 && (62.0..76.0).contains(&view.position.x), "{view:?}");
    }

    #[test]
    fn pipes_fishes_roads_and_short_tunnels_are_none() {
        assert!(view(tunnel()).is_some());
        assert_eq!(view(pipe(|_| RADIUS)), None, "nothing within");
        let fish = pipe(|along| 2.0 * RADIUS * (along * (1.0 - along)).sqrt());
        assert_eq!(view([fish, rails()].concat()), None, "tapers off");
        let below_ceiling = tunnel().into_iter().filter(|p| p.z < 1.0).collect();
        assert_eq!(view(below_ceiling), None, "open above");
        let short = tunnel().into_iter().filter(|p| p.x < 40.0).collect();
        assert_eq!(view(short), None, "40 units long");
        let mut random = Random::new(5, 0);
        let mut within = || RADIUS * (2.0 * random.next_f32() - 1.0);
        let mass: Vec<Vec3> =
            tunnel().into_iter().map(|p| Vec3::new(p.x, within(), within())).collect();
        assert_eq!(view(mass), None, "full");
        assert_eq!(view(Vec::new()), None);
    }

    #[test]
    fn normals_tell_the_side_that_was_scanned() {
        for (side, is_tunnel) in [(-1.0, true), (1.0, false)] {
            let positions = tunnel();
            let normal = |p: &Vec3| side * p.with_x(0.0).normalize();
            let normals = Some(positions.iter().map(normal).collect());
            let cloud = PointCloud { normals, ..PointCloud::from_positions(positions) };
            assert_eq!(find_tunnel(&cloud, Vec3::Z).is_some(), is_tunnel);
        }
    }
}
