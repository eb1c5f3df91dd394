//! Stations: the place from which one scanner or depth camera measured a cloud in its own coordinates.

use super::direction_cells::{
    PolarPoint, density_slope, fraction_behind, polar_points, spread_within_cells,
};
use super::ground::direction;
use super::inside_view::InsideView;
use crate::math::{self, Aabb, DVec3, Vec3, quantile};
use crate::points::{CameraAxes, PointCloud, is_valid_position};
use std::f32::consts::TAU;

/// Maximum number of points that are looked at: enough for some 40 in each cell of directions.
const MAX_SAMPLES: usize = 100_000;
/// Minimum number of points: fewer do not fill the cells of directions.
const MIN_POINTS: usize = 1000;
/// Number of sectors about the vertical in which points are counted: one is as wide as a near obstacle.
const N_SECTORS: usize = 16;
/// Minimum number of sectors with points: a vehicle or a wall at the scanner's back hides up to a quarter.
const MIN_SECTORS: usize = 12;
/// Minimum fraction of the points in a sector with points: stray points fill no sector.
const MIN_SECTOR_FRACTION: f64 = 0.005;
/// Minimum ratio of the 90th to the 10th percentile of the distances: the middle of an object that was scanned from
/// outside is about equally far from all of its surface.
const MIN_DISTANCE_RATIO: f32 = 3.0;
/// Minimum ratio of these distances from a depth camera: an object alone is shown as any other.
const MIN_CAMERA_DISTANCE_RATIO: f32 = 1.5;
/// Maximum slope of the logarithm of the points in a cell over that of its squared distance. It is 0 for points that are
/// dense in angle and 1 for points that are dense in area: scanners had -0.26 to 0.03, vertices of meshes 0.68, evenly
/// sampled boxes and terrain 1.0 to 1.4.
const MAX_DENSITY_SLOPE: f64 = 0.4;
/// Maximum spread of the distances within cells, as a fraction of that of all: most rays of a scanner end at the first
/// surface.
const MAX_SPREAD_WITHIN_CELLS: f64 = 0.7;
/// Maximum fraction of the points that lie behind others: a scanner does not see through surfaces. Scans had 0.02 to 0.03,
/// an object whose zero lies within it 0.4.
const MAX_BEHIND: f64 = 0.25;
/// Minimum fraction of the normals that face a scanner: it measures no surface from behind. Half of the normals face it if
/// their signs mean nothing; 0.15 of those of an object face a zero within it.
const MIN_FACING: f64 = 0.33;
/// Fraction of the points of a depth camera at each border of its view that may be strays.
const STRAY_FRACTION: f64 = 0.002;
/// Horizontal angle that should have most of the far points: that of a picture of 16:9.
const WINDOW_DEG: usize = 90;
/// Vertical angle of view in degrees: wider than for objects, as things all around are near.
const VIEW_ANGLE_DEG: f64 = 60.0;

/// Returns the station of `cloud`, which is at the place that its file states or else at the zero of its world
/// coordinates, or `None` if its points are not those of a scanner that stood there: they surround it, at many
/// distances, and are dense in angle rather than in area.
pub fn find_station(cloud: &PointCloud, up: Vec3) -> Option<InsideView> {
    let position = match &cloud.stations[..] {
        [station] => station.position.unwrap_or_default(),
        _ => DVec3::ZERO,
    };
    let scanner = (position - cloud.origin).as_vec3();
    let points = valid_sample(cloud);
    let bounds = Aabb::of_points(points.iter().copied());
    let is_within = bounds.min.cmplt(scanner).all() && scanner.cmplt(bounds.max).all();
    if !is_within || points.len() < MIN_POINTS {
        return None;
    }
    let points = polar_points(scanner, &points, up);
    let [near, median, far] = distances(&points)?;
    let is_scan = MIN_DISTANCE_RATIO * near <= far
        && MIN_FACING <= facing_fraction(cloud, scanner)
        && MIN_SECTORS <= n_filled_sectors(&points)
        && density_slope(&points)? < MAX_DENSITY_SLOPE
        && spread_within_cells(&points) < MAX_SPREAD_WITHIN_CELLS
        && fraction_behind(&points) < MAX_BEHIND;
    is_scan.then(|| InsideView {
        position,
        direction: longest_view(&points, median, up),
        distance: median.into(),
        view_angle_deg: VIEW_ANGLE_DEG,
    })
}

/// Returns the view from a station of `cloud` along its longest view, or `None` if its position is not known. Without
/// points, the view is to the north.
pub fn view_from_station(cloud: &PointCloud, station_idx: usize, up: Vec3) -> Option<InsideView> {
    let station = cloud.stations.get(station_idx)?;
    let position = station.position?;
    let scan_of = cloud.scan_of_point();
    let is_measured_here =
        |i: &usize| scan_of.as_ref().is_some_and(|scan_of| scan_of.get(*i) == station_idx);
    let points = sample_indices(cloud).filter(is_measured_here).map(|i| cloud.positions[i]);
    let points: Vec<Vec3> = points.collect();
    let points = polar_points((position - cloud.origin).as_vec3(), &points, up);
    let [_, median, _] = distances(&points).unwrap_or([1.0; 3]);
    Some(InsideView {
        position,
        direction: longest_view(&points, median, up),
        distance: median.into(),
        view_angle_deg: VIEW_ANGLE_DEG,
    })
}

/// Returns the view from the depth camera at the zero of the world coordinates of `cloud`, which looks along +Z if -Y is up and
/// along -Z if +Y is up, onto the middle of what it measured, or `None` if no such camera measured the points.
pub fn find_depth_camera(cloud: &PointCloud, up: Vec3) -> Option<InsideView> {
    let zero = (-cloud.origin).as_vec3();
    let offsets: Vec<Vec3> = valid_sample(cloud).into_iter().map(|point| point - zero).collect();
    let axes = CameraAxes::of_points(&offsets).filter(|axes| axes.up() == up)?;
    if offsets.len() < MIN_POINTS {
        return None;
    }
    let ahead = axes.ahead();
    let in_view = offsets.iter().filter(|offset| axes.sees(**offset));
    let angles = |axis: usize, sign: f32| {
        let angles = in_view.clone().map(|offset| sign * (offset[axis] / offset.dot(ahead)).atan());
        quantile(angles, STRAY_FRACTION).map(|angle| sign * angle)
    };
    let [low_x, high_x] = [angles(0, 1.0)?, angles(0, -1.0)?].map(f64::from);
    let [low_y, high_y] = [angles(1, 1.0)?, angles(1, -1.0)?].map(f64::from);
    let [x, y] = [low_x + high_x, low_y + high_y].map(|sum| (0.5 * sum).tan());
    let points = polar_points(Vec3::ZERO, &offsets, up);
    let [near, median, far] = distances(&points)?;
    let is_scan =
        MIN_CAMERA_DISTANCE_RATIO * near <= far && density_slope(&points)? < MAX_DENSITY_SLOPE;
    is_scan.then(|| InsideView {
        position: DVec3::ZERO,
        direction: (DVec3::new(x, y, 0.0) + ahead.as_dvec3()).normalize(),
        distance: median.into(),
        view_angle_deg: (high_y - low_y).to_degrees(),
    })
}

/// Returns the valid ones of points at about equal steps.
fn valid_sample(cloud: &PointCloud) -> Vec<Vec3> {
    sample_indices(cloud).map(|i| cloud.positions[i]).collect()
}

/// Returns the indices of valid points at about equal steps.
fn sample_indices(cloud: &PointCloud) -> impl Iterator<Item = usize> {
    let is_valid = |i: &usize| is_valid_position(cloud.positions[*i]);
    math::sample_indices(cloud.len(), MAX_SAMPLES).filter(is_valid)
}

/// Returns the 10th, 50th and 90th percentile of the distances.
fn distances(points: &[PolarPoint]) -> Option<[f32; 3]> {
    let quantile = |fraction| quantile(points.iter().map(|point| point.distance), fraction);
    Some([quantile(0.1)?, quantile(0.5)?, quantile(0.9)?])
}

fn n_filled_sectors(points: &[PolarPoint]) -> usize {
    let mut counts = [0usize; N_SECTORS];
    for point in points {
        let sector = (point.azimuth_rad / TAU * N_SECTORS as f32) as usize;
        counts[sector.min(N_SECTORS - 1)] += 1;
    }
    let min_count = MIN_SECTOR_FRACTION * points.len() as f64;
    counts.into_iter().filter(|count| min_count <= *count as f64).count()
}

/// Returns the fraction of the normals of `cloud` that face `scanner`, or 1 if it has none.
fn facing_fraction(cloud: &PointCloud, scanner: Vec3) -> f64 {
    let Some(normals) = &cloud.normals else { return 1.0 };
    let toward = |i: usize| normals[i].dot(scanner - cloud.positions[i]);
    let (facing, other): (Vec<f32>, Vec<f32>) =
        sample_indices(cloud).map(toward).filter(|cosine| *cosine != 0.0).partition(|c| 0.0 < *c);
    facing.len() as f64 / (facing.len() + other.len()).max(1) as f64
}

/// Returns the horizontal direction about which most points lie beyond `distance`.
fn longest_view(points: &[PolarPoint], distance: f32, up: Vec3) -> DVec3 {
    /// Width of the steps in which directions are tried.
    const STEP_DEG: usize = 5;
    const N_STEPS: usize = 360 / STEP_DEG;
    const N_IN_WINDOW: usize = WINDOW_DEG / STEP_DEG;
    let mut counts = [0usize; N_STEPS];
    for point in points.iter().filter(|point| distance < point.distance) {
        let step = (point.azimuth_rad / TAU * N_STEPS as f32) as usize;
        counts[step.min(N_STEPS - 1)] += 1;
    }
    let n_far =
        |first: usize| (first..first + N_IN_WINDOW).map(|i| counts[i % N_STEPS]).sum::<usize>();
    // Of equally long views the northernmost comes first.
    let first = (0..N_STEPS).rev().max_by_key(|first| n_far(*first)).unwrap_or(0);
    direction((STEP_DEG * first) as f64 + WINDOW_DEG as f64 / 2.0, 0.0, up)
}

#[cfg(test)]
mod tests {
    //! Scans in their scanner's coordinates have a station; evenly sampled and georeferenced clouds have none.

    use super::*;
    use crate::math::Random;
    use crate::points::{STATION, Scalar, ScanStation, Values};

    /// A sweep of a street along `azimuth_deg`, 8 m wide, from 2 m above the ground: every 2 degrees of elevation.
    fn street_sweep(azimuth_deg: f32) -> PointCloud {
        let rings = (-15..=10).map(|ring| (2.0 * ring as f32 + 0.5).to_radians());
        let rays = rings.flat_map(|elevation| (0..720).map(move |i| (elevation, i)));
        let hit = |(elevation, i): (f32, i32)| {
            let (sin, cos) = (0.5 * i as f32).to_radians().sin_cos();
            let direction =
                Vec3::new(elevation.cos() * sin, elevation.cos() * cos, elevation.sin());
            let to_wall = 4.0 / direction.x.abs();
            let to_ground = if direction.z < 0.0 { -2.0 / direction.z } else { f32::INFINITY };
            let point = to_wall.min(to_ground) * direction;
            (point.length() < 80.0 && point.z < 12.0).then_some(point)
        };
        let (sin, cos) = azimuth_deg.to_radians().sin_cos();
        let rotated = |p: Vec3| Vec3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z);
        PointCloud::from_positions(rays.filter_map(hit).map(rotated).collect())
    }

    /// A box of this size about zero whose six sides are sampled evenly.
    fn even_box(size: Vec3) -> PointCloud {
        let mut random = Random::new(3, 0);
        let areas = Vec3::new(size.y * size.z, size.x * size.z, size.x * size.y);
        let total = areas.x + areas.y + areas.z;
        let mut side = |_| {
            let mut p = Vec3::from_array(std::array::from_fn(|_| random.next_f32() - 0.5));
            let sample = total * random.next_f32();
            let axis = usize::from(areas.x < sample) + usize::from(areas.x + areas.y < sample);
            p[axis] = if p[axis] < 0.0 { -0.5 } else { 0.5 };
            size * p
        };
        PointCloud::from_positions((0..50_000).map(&mut side).collect())
    }

    #[test]
    fn a_sweep_of_a_street_looks_along_the_street() {
        for azimuth_deg in [0.0f32, 30.0, 90.0] {
            let station = find_station(&street_sweep(azimuth_deg), Vec3::Z).unwrap();
            let (sin, cos) = f64::from(azimuth_deg).to_radians().sin_cos();
            let along = station.direction.dot(DVec3::new(sin, cos, 0.0)).abs();
            assert!(0.85 < along, "{azimuth_deg}: {station:?}");
            let camera = station.camera(Vec3::Z, None);
            assert_eq!((camera.position, camera.focal_point.z), (DVec3::ZERO, 0.0));
        }
    }

    #[test]
    fn the_zero_of_the_file_decides_and_not_that_of_the_cloud() {
        let mut cloud = street_sweep(0.0);
        let station = find_station(&cloud, Vec3::Z).unwrap();
        cloud.rebase(DVec3::new(5.0, -7.0, 1.0));
        let rebased = find_station(&cloud, Vec3::Z).unwrap();
        assert!(rebased.direction.distance(station.direction) < 1e-6);
        assert_eq!(rebased.position, DVec3::ZERO);
        // The same scan in a national grid, about its own origin.
        cloud.rebase(DVec3::ZERO);
        cloud.origin = DVec3::new(500_000.0, 5_400_000.0, 300.0);
        assert_eq!(find_station(&cloud, Vec3::Z), None);
    }

    /// A floor 1 m below a depth camera and a wall 8 m ahead, seen by a grid of rays; or an even part of the floor.
    fn depth_image(is_even: bool) -> PointCloud {
        let grid =
            (0..40_000).map(|i| ((i % 200) as f32 / 199.0 - 0.5, (i / 200) as f32 / 199.0 - 0.5));
        let of_ray = |(x, y): (f32, f32)| {
            let direction = Vec3::new(x, 0.8 * y, 1.0);
            let to_floor = if 0.0 < direction.y { 1.0 / direction.y } else { f32::INFINITY };
            direction * to_floor.min(8.0)
        };
        let of_surface = |(x, y): (f32, f32)| Vec3::new(3.0 * x, 1.0, 4.5 + 2.0 * y);
        let points = match is_even {
            true => grid.map(of_surface).collect(),
            false => grid.map(of_ray).collect(),
        };
        PointCloud::from_positions(points)
    }

    #[test]
    fn depth_images_are_seen_from_their_camera() {
        let cloud = depth_image(false);
        let station = find_depth_camera(&cloud, Vec3::NEG_Y).unwrap();
        assert_eq!((station.position, station.direction), (DVec3::ZERO, DVec3::Z));
        assert!((station.view_angle_deg - 2.0 * 0.4f64.atan().to_degrees()).abs() < 0.1);
        assert_eq!(find_depth_camera(&cloud, Vec3::Y), None);
        let mut y_up = cloud.clone();
        y_up.positions.iter_mut().for_each(|position| *position *= Vec3::new(1.0, -1.0, -1.0));
        let of_y_up = InsideView { direction: DVec3::NEG_Z, ..station };
        assert_eq!(find_depth_camera(&y_up, Vec3::Y), Some(of_y_up));
        assert_eq!(find_depth_camera(&y_up, Vec3::NEG_Y), None);
        assert_eq!(find_depth_camera(&depth_image(true), Vec3::NEG_Y), None);
        let mut moved = cloud;
        moved.origin = DVec3::new(0.0, 0.0, -20.0);
        assert_eq!(find_depth_camera(&moved, Vec3::NEG_Y), None);
    }

    #[test]
    fn a_depth_image_without_its_left_side_is_seen_in_the_middle() {
        let mut cloud = depth_image(false);
        cloud.positions.retain(|point| -0.1 * point.z < point.x);
        cloud.positions.push(Vec3::new(-1.1, 0.0, 1.0));
        let station = find_depth_camera(&cloud, Vec3::NEG_Y).unwrap();
        let angle = f64::atan2(station.direction.x, station.direction.z);
        assert!((angle - 0.5 * (0.5f64.atan() - 0.1f64.atan())).abs() < 5e-3, "{angle}");
    }

    #[test]
    fn a_few_stray_points_behind_a_depth_camera_do_not_hide_it() {
        let mut cloud = depth_image(false);
        let station = find_depth_camera(&cloud, Vec3::NEG_Y).unwrap();
        cloud.positions.extend([Vec3::new(0.3, 0.5, -2.0); 3]);
        let with_strays = find_depth_camera(&cloud, Vec3::NEG_Y).unwrap();
        assert_eq!(with_strays.view_angle_deg, station.view_angle_deg);
    }

    #[test]
    fn stated_stations_are_looked_from() {
        let mut cloud = street_sweep(40.0);
        let moved = DVec3::new(500_000.0, 4_900_000.0, 80.0);
        let zero_based = find_station(&cloud, Vec3::Z).unwrap();
        cloud.origin += moved;
        assert_eq!(find_station(&cloud, Vec3::Z), None);
        let unknown =
            ScanStation { name: "unknown".into(), position: None, ..ScanStation::default() };
        cloud.stations = vec![ScanStation {
            name: "street".into(),
            position: Some(moved),
            ..ScanStation::default()
        }];
        let station = find_station(&cloud, Vec3::Z).unwrap();
        assert_eq!(station, InsideView { position: moved, ..zero_based });
        cloud.stations.push(unknown);
        let column = Values::U16((0..cloud.len()).map(|i| (i % 2) as u16).collect());
        cloud.scalars = vec![Scalar { name: STATION.into(), values: column }];
        let half = view_from_station(&cloud, 0, Vec3::Z).unwrap();
        assert_eq!(half.direction, station.direction);
        assert_eq!(view_from_station(&cloud, 1, Vec3::Z), None);
        cloud.stations.pop();
        cloud.scalars.clear();
        assert_eq!(view_from_station(&cloud, 0, Vec3::Z), Some(station));
        assert_eq!(view_from_station(&cloud, 1, Vec3::Z), None);
        cloud.positions.clear();
        let single = view_from_station(&cloud, 0, Vec3::Z).unwrap();
        assert!(single.direction.is_finite() && single.distance == 1.0, "{single:?}");
    }

    #[test]
    fn even_clouds_have_no_station() {
        for size in [Vec3::new(6.0, 4.0, 2.5), Vec3::new(60.0, 8.0, 4.0)] {
            assert_eq!(find_station(&even_box(size), Vec3::Z), None, "{size}");
        }
        let ball = (0..20_000).map(|i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / 20_000.0;
            let (sin, cos) = (2.399_963 * i as f32).sin_cos();
            Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
        });
        assert_eq!(find_station(&PointCloud::from_positions(ball.collect()), Vec3::Z), None);
        assert_eq!(find_station(&PointCloud::default(), Vec3::Z), None);
    }

    #[test]
    fn an_object_about_zero_has_no_station() {
        // A ball on a pedestal whose foot is zero: the far side of the ball lies behind its near side.
        let mut random = Random::new(6, 0);
        let ball = (0..60_000).map(|_| {
            let gaussian = Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32));
            40.0 * gaussian.normalize_or(Vec3::Z) + 60.0 * Vec3::Z
        });
        let mut points: Vec<Vec3> = ball.collect();
        points.extend((0..60_000).map(|_| {
            let (sin, cos) = (TAU * random.next_f32()).sin_cos();
            Vec3::new(18.0 * cos, 18.0 * sin, 31.0 * random.next_f32() - 1.0)
        }));
        let object = PointCloud::from_positions(points);
        assert_eq!(find_station(&object, Vec3::Z), None);
    }

    #[test]
    fn a_surface_that_is_seen_from_behind_has_no_station() {
        let mut cloud = street_sweep(0.0);
        let toward_zero = |position: &Vec3| -position.normalize();
        cloud.normals = Some(cloud.positions.iter().map(toward_zero).collect());
        assert!(find_station(&cloud, Vec3::Z).is_some());
        for normal in cloud.normals.iter_mut().flatten() {
            *normal = -*normal;
        }
        assert_eq!(find_station(&cloud, Vec3::Z), None);
    }

    #[test]
    fn points_that_fill_space_have_no_station() {
        let mut random = Random::new(5, 0);
        let mut point =
            |_| Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32));
        let filled = PointCloud::from_positions((0..50_000).map(&mut point).collect());
        assert_eq!(find_station(&filled, Vec3::Z), None);
    }

    #[test]
    fn terrain_has_no_station() {
        let height = |x: f32, y: f32| 6.0 * (0.05 * x).sin() + 4.0 * (0.08 * y).cos();
        let terrain = (0..90_000).map(|i| {
            let (x, y) = ((i % 300) as f32 - 150.0, (i / 300) as f32 - 150.0);
            Vec3::new(x, y, height(x, y))
        });
        let mut cloud = PointCloud::from_positions(terrain.collect());
        assert_eq!(find_station(&cloud, Vec3::Z), None);
        cloud.origin = DVec3::new(500_000.0, 5_400_000.0, 300.0);
        assert_eq!(find_station(&cloud, Vec3::Z), None);
    }

    #[test]
    fn a_long_cloud_is_sampled_over_its_length() {
        let n = 5 * MAX_SAMPLES + 1;
        let cloud = PointCloud::from_positions((0..n).map(|i| Vec3::X * i as f32).collect());
        let points = valid_sample(&cloud);
        assert!(points.len() <= MAX_SAMPLES && points.is_sorted_by(|a, b| a.x < b.x));
        assert!((0.99 * n as f32) < points[points.len() - 1].x);
    }
}
