//! Rooms: the walls and the ceiling that hide the inside of a scanned room from a camera.

use super::camera::Camera;
use super::clip::ClipPlane;
use super::ground::ground_axes;
use super::inliers::{range_along, sample_inliers};
use crate::math::{DVec3, Vec3};
use crate::points::PointCloud;

/// Number of layers along each axis in which walls are searched.
const N_LAYERS: usize = 120;
/// Fraction of the layers at each end of an axis in which its wall can lie: scans through windows reach beyond walls.
const WALL_RANGE: f32 = 0.3;
/// Number of cells across a wall that are tested for points.
const N_CELLS: usize = 10;
/// Minimum fraction of the cells of a wall, floor or ceiling that contain points.
const MIN_COVERAGE: f64 = 0.5;
/// Minimum fraction of the points above the floor that lie on the walls and the ceiling. The trees of a forest fill a box as
/// well, but few of their points lie at its sides.
const MIN_ON_SIDES: f64 = 0.5;
/// Minimum fraction of the points that lie well within a room: furniture, people, the other side of a wall. Boxes and
/// houses that were scanned from outside have none.
const MIN_CONTENT: f64 = 0.004;
/// Distance from the sides of the box of points that lie well within, as a fraction of its size along each axis.
const CONTENT_MARGIN: f32 = 0.15;
/// Minimum height as a fraction of the longest side: flatter boxes are plates with bores rather than halls with columns.
const MIN_HEIGHT: f32 = 0.05;
/// Thickness of the layer that is removed with a wall, as a fraction of the room's longest side, and at most as one of the
/// side across the wall: floor and ceiling of a flat hall stay apart, and wide terrain is no room.
const WALL_THICKNESS: f32 = 0.02;
const MAX_THICKNESS: f32 = 0.08;
/// Azimuth from the room's own axes and elevation of the viewpoint: two walls are seen, and most of the floor.
const VIEW_AZIMUTH_DEG: f64 = 35.0;
const VIEW_ELEVATION_DEG: f64 = 42.0;

/// A room: a box with a vertical axis whose sides are covered by points.
#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// Origin of the cloud; the other fields are relative to it.
    origin: DVec3,
    /// Two horizontal axes, and up.
    axes: [Vec3; 3],
    /// Lowest coordinates along the axes.
    low: [f32; 3],
    /// Highest coordinates along the axes.
    high: [f32; 3],
    /// True if there are points well within.
    has_content: bool,
    /// True if points cover the ceiling.
    has_ceiling: bool,
}

/// The sides of a box that points cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Enclosure {
    /// Too few for a room.
    Open,
    /// The floor and four walls: depth cameras rarely look up.
    WithoutCeiling,
    /// The floor, the ceiling and at least three walls.
    WithCeiling,
}

/// Returns the room that a cloud shows, or `None` if its points cover neither a floor, a ceiling and three walls nor a
/// floor and four walls.
pub fn find_room(cloud: &PointCloud, up: Vec3) -> Option<Room> {
    const MIN_POINTS: usize = 1000;
    let points = sample_inliers(cloud);
    if points.len() < MIN_POINTS {
        return None;
    }
    let step = points.len().div_ceil(20_000);
    let few: Vec<Vec3> = points.iter().step_by(step).copied().collect();
    let rooms = (0..45).map(|step| box_at(&few, up, 2.0 * step as f32));
    let (room, _) = rooms.max_by(|(_, a), (_, b)| a.cmp(b))?;
    let enclosure = room.enclosure(&points);
    if !room.is_high() || enclosure == Enclosure::Open {
        return None;
    }
    let has_ceiling = enclosure == Enclosure::WithCeiling;
    let [first, second, mut top] = room.high;
    if !has_ceiling {
        top = top.max(range_along(&points, room.axes[2]).1);
    }
    let high = [first, second, top];
    let has_content = MIN_CONTENT <= room.content(&points);
    Some(Room { origin: cloud.origin, high, has_content, has_ceiling, ..room })
}

/// Returns the box of the densest layers for an azimuth, and the number of points in the layers of its walls.
fn box_at(points: &[Vec3], up: Vec3, azimuth_deg: f32) -> (Room, usize) {
    let (east, north) = ground_axes(up);
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    let axes = [cos * east + sin * north, cos * north - sin * east, up];
    let sides = axes.map(|axis| densest_layers(points, axis));
    let n_in_walls = sides[..2].iter().map(|side| side.2).sum();
    let (low, high) = (sides.map(|side| side.0), sides.map(|side| side.1));
    let origin = DVec3::ZERO;
    (Room { origin, axes, low, high, has_content: false, has_ceiling: false }, n_in_walls)
}

/// Returns the coordinates of the densest layer near each end of an axis, and the number of points in both.
fn densest_layers(points: &[Vec3], axis: Vec3) -> (f32, f32, usize) {
    let (low, high) = range_along(points, axis);
    let thickness = ((high - low) / N_LAYERS as f32).max(f32::MIN_POSITIVE);
    let mut counts = [0usize; N_LAYERS];
    for point in points {
        let layer = ((point.dot(axis) - low) / thickness) as usize;
        counts[layer.min(N_LAYERS - 1)] += 1;
    }
    let n_searched = (WALL_RANGE * N_LAYERS as f32) as usize;
    // Of equally dense layers the outermost is the wall.
    let first = (0..n_searched).rev().max_by_key(|layer| counts[*layer]).unwrap_or(0);
    let searched = N_LAYERS - n_searched..N_LAYERS;
    let last = searched.max_by_key(|layer| counts[*layer]).unwrap_or(N_LAYERS - 1);
    let middle = |layer: usize| low + (layer as f32 + 0.5) * thickness;
    (middle(first), middle(last), counts[first] + counts[last])
}

impl Room {
    /// Returns the coordinates of a position along the room's axes.
    fn local(&self, point: Vec3) -> [f32; 3] {
        self.axes.map(|axis| point.dot(axis))
    }

    fn size(&self, axis: usize) -> f32 {
        self.high[axis] - self.low[axis]
    }

    fn is_high(&self) -> bool {
        MIN_HEIGHT * self.size(0).max(self.size(1)) <= self.size(2)
    }

    /// Returns the thickness of the walls across each axis.
    fn wall_thickness(&self) -> [f32; 3] {
        let sizes = [0, 1, 2].map(|axis| self.size(axis));
        let longest = sizes.iter().copied().fold(0.0, f32::max);
        sizes.map(|size| (WALL_THICKNESS * longest).min(MAX_THICKNESS * size))
    }

    /// Returns the fraction of the points that lie well within the box.
    fn content(&self, points: &[Vec3]) -> f64 {
        let is_within = |point: &&Vec3| {
            let local = self.local(**point);
            (0..3).all(|axis| {
                let margin = CONTENT_MARGIN * self.size(axis);
                self.low[axis] + margin < local[axis] && local[axis] < self.high[axis] - margin
            })
        };
        points.iter().filter(is_within).count() as f64 / points.len() as f64
    }

    /// Returns which sides points cover.
    fn enclosure(&self, points: &[Vec3]) -> Enclosure {
        let mut is_covered = [[[false; N_CELLS * N_CELLS]; 2]; 3];
        let thickness = self.wall_thickness();
        let (mut n_above_floor, mut n_on_sides) = (0usize, 0usize);
        for point in points {
            let local = self.local(*point);
            let is_at = |axis: usize, side: f32| (local[axis] - side).abs() < thickness[axis];
            let is_on_side =
                |axis: usize| is_at(axis, self.low[axis]) || is_at(axis, self.high[axis]);
            if self.low[2] + thickness[2] <= local[2] {
                n_above_floor += 1;
                n_on_sides += usize::from((0..3).any(is_on_side));
            }
            let cell = |axis: usize| {
                let along = (local[axis] - self.low[axis]) / self.size(axis).max(f32::MIN_POSITIVE);
                (0.0..1.0).contains(&along).then_some((N_CELLS as f32 * along) as usize)
            };
            for (axis, is_covered) in is_covered.iter_mut().enumerate() {
                let (Some(a), Some(b)) = (cell((axis + 1) % 3), cell((axis + 2) % 3)) else {
                    continue;
                };
                for (side, wall) in [self.low[axis], self.high[axis]].into_iter().enumerate() {
                    if is_at(axis, wall) {
                        is_covered[side][a * N_CELLS + b] = true;
                    }
                }
            }
        }
        let is_closed = |cells: &[bool; N_CELLS * N_CELLS]| {
            let n_covered = cells.iter().filter(|covered| **covered).count();
            MIN_COVERAGE * cells.len() as f64 <= n_covered as f64
        };
        let [first, second, vertical] = is_covered;
        let n_walls = first.iter().chain(&second).filter(|wall| is_closed(wall)).count();
        let is_hollow = MIN_ON_SIDES * n_above_floor as f64 <= n_on_sides as f64;
        let [has_floor, has_ceiling] = [0, 1].map(|side| is_closed(&vertical[side]));
        match (is_hollow && has_floor, has_ceiling, n_walls) {
            (true, true, 3..) => Enclosure::WithCeiling,
            (true, false, 4) => Enclosure::WithoutCeiling,
            _ => Enclosure::Open,
        }
    }

    /// Returns true if there are points well within the room: furniture, or people.
    pub fn has_content(&self) -> bool {
        self.has_content
    }

    /// Returns true if a world position lies within the room.
    pub fn contains(&self, position: DVec3) -> bool {
        let local = self.local((position - self.origin).as_vec3());
        (0..3).all(|axis| (self.low[axis]..self.high[axis]).contains(&local[axis]))
    }

    /// Returns true if a world position lies within the room and below its ceiling, which a courtyard lacks.
    pub fn encloses(&self, position: DVec3) -> bool {
        self.has_ceiling && self.contains(position)
    }

    /// Returns the direction of view into the room over its southernmost corner, rotated by `azimuth_deg` clockwise
    /// seen from above.
    pub fn view_direction(&self, azimuth_deg: f64, elevation_deg: Option<f64>) -> DVec3 {
        let [first, second, up] = self.axes.map(Vec3::as_dvec3);
        let (_, north) = ground_axes(self.axes[2]);
        let turns = (0..4).map(|quarter| 90.0 * f64::from(quarter) + VIEW_AZIMUTH_DEG);
        let ahead = |turn_deg: f64| {
            let (sin, cos) = turn_deg.to_radians().sin_cos();
            cos * first + sin * second
        };
        let northward = |turn_deg: &f64| ahead(*turn_deg).dot(north.as_dvec3());
        let turn_deg = turns.max_by(|a, b| northward(a).total_cmp(&northward(b))).unwrap_or(0.0);
        let elevation_deg = elevation_deg.unwrap_or(VIEW_ELEVATION_DEG);
        let (sin, cos) = elevation_deg.to_radians().sin_cos();
        // Azimuths count clockwise seen from above.
        cos * ahead(turn_deg - azimuth_deg) - sin * up
    }

    /// Returns the plane that hides the ceiling if the camera stands above it.
    pub fn ceiling_before(&self, camera: &Camera) -> Option<ClipPlane> {
        let up = self.axes[2].as_dvec3();
        self.planes_before(camera).into_iter().find(|plane| plane.normal == up)
    }

    /// Returns the planes that hide the walls and the ceiling beyond which the camera stands.
    ///
    /// A camera within the room hides nothing, and the floor always stays.
    pub fn planes_before(&self, camera: &Camera) -> Vec<ClipPlane> {
        let position = self.local((camera.position - self.origin).as_vec3());
        let thickness = self.wall_thickness();
        let mut planes = Vec::new();
        for (axis, position) in position.into_iter().enumerate() {
            let normal = self.axes[axis];
            let (low, high) = (self.low[axis] + thickness[axis], self.high[axis] - thickness[axis]);
            let mut hide = |normal: Vec3, coordinate: f32| {
                let point = self.origin + (coordinate * self.axes[axis]).as_dvec3();
                planes.push(ClipPlane { point, normal: normal.as_dvec3() });
            };
            if self.high[axis] < position && (axis < 2 || self.has_ceiling) {
                hide(normal, high);
            } else if position < self.low[axis] && axis < 2 {
                hide(-normal, low);
            }
        }
        planes
    }
}

#[cfg(test)]
mod tests {
    //! Rooms are found by their six sides and content, and opened toward the camera.

    use super::*;
    use crate::math::Random;
    use crate::scene::Projection;

    /// A room of 6 x 4 x 2.5 m, rotated about the vertical, with a table if it is furnished.
    fn room(azimuth_deg: f32, is_furnished: bool) -> PointCloud {
        let mut random = Random::new(8, 0);
        let mut points = Vec::new();
        let size = Vec3::new(6.0, 4.0, 2.5);
        for i in 0..30_000 {
            let mut p = size * Vec3::from_array(std::array::from_fn(|_| random.next_f32()));
            let axis = i % 3;
            p[axis] = if random.next_f32() < 0.5 { 0.0 } else { size[axis] };
            points.push(p);
        }
        if is_furnished {
            let table = (0..1000)
                .map(|_| Vec3::new(2.0 + 2.0 * random.next_f32(), 1.5 + random.next_f32(), 0.8));
            points.extend(table);
        }
        let (sin, cos) = azimuth_deg.to_radians().sin_cos();
        let rotated = |p: Vec3| Vec3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z);
        let cloud = PointCloud::from_positions(points.into_iter().map(rotated).collect());
        PointCloud { origin: DVec3::new(500.0, 600.0, 70.0), ..cloud }
    }

    /// Returns the room of a cloud if there is something in it.
    fn find_filled(cloud: &PointCloud) -> Option<Room> {
        find_room(cloud, Vec3::Z).filter(Room::has_content)
    }

    fn camera_at(position: DVec3) -> Camera {
        Camera {
            position,
            focal_point: DVec3::new(500.0, 600.0, 70.0),
            view_up: DVec3::Z,
            projection: Projection::Perspective { view_angle_deg: 35.0 },
        }
    }

    #[test]
    fn a_furnished_room_is_found_at_any_azimuth() {
        for azimuth_deg in [0.0, 20.0, 75.0] {
            assert!(find_filled(&room(azimuth_deg, true)).is_some(), "{azimuth_deg}");
        }
    }

    #[test]
    fn an_empty_box_is_a_room_only_on_request() {
        assert_eq!(find_filled(&room(0.0, false)), None);
        assert!(find_room(&room(0.0, false), Vec3::Z).is_some());
    }

    #[test]
    fn a_room_without_a_ceiling_needs_four_walls_and_a_floor() {
        let cloud = room(0.0, true);
        let find_part = |is_seen: fn(&Vec3) -> bool| {
            let seen = cloud.positions.iter().copied().filter(is_seen).collect();
            find_filled(&PointCloud { positions: seen, ..PointCloud::default() })
        };
        let open = find_part(|p| p.z < 2.4).unwrap();
        let above = camera_at(DVec3::new(3.0, 2.0, 20.0));
        assert_eq!(open.planes_before(&above), [], "the walls are not cut");
        let within = DVec3::new(3.0, 2.0, 1.2);
        assert!(open.contains(within) && !open.encloses(within));
        assert!(find_part(|_| true).is_some_and(|closed| closed.encloses(within)));
        assert_eq!(find_part(|p| p.z < 2.4 && p.x < 5.9), None);
        assert_eq!(find_part(|p| 0.1 < p.z && p.z < 2.4), None);
    }

    #[test]
    fn a_ball_is_no_room() {
        let ball = (0..20_000).map(|i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / 20_000.0;
            let (sin, cos) = (2.399_963 * i as f32).sin_cos();
            Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
        });
        let ball = PointCloud::from_positions(ball.collect());
        assert_eq!(find_room(&ball, Vec3::Z), None);
        assert_eq!(find_room(&PointCloud::default(), Vec3::Z), None);
    }

    #[test]
    fn a_wood_is_no_room() {
        let mut random = Random::new(10, 0);
        let mut within = |size: Vec3| size * Vec3::from_array([0; 3].map(|_| random.next_f32()));
        let mut points: Vec<Vec3> =
            (0..20_000).map(|_| within(Vec3::new(50.0, 50.0, 0.0))).collect();
        points.extend((0..12_000).map(|_| within(Vec3::new(50.0, 50.0, 14.0))));
        assert_eq!(find_room(&PointCloud::from_positions(points), Vec3::Z), None);
    }

    #[test]
    fn terrain_and_plates_are_no_rooms_and_a_flat_hall_is_one() {
        let mut random = Random::new(9, 0);
        let mut scattered = |n: usize, height: &dyn Fn(f32, f32) -> f32| -> Vec<Vec3> {
            let mut point = || (1400.0 * random.next_f32(), 1200.0 * random.next_f32());
            let at = |(x, y): (f32, f32)| Vec3::new(x, y, height(x, y));
            (0..n).map(|_| at(point())).collect()
        };
        let hills = |x: f32, y: f32| {
            8.0 * (x / 130.0).sin()
                + 6.0 * (y / 90.0 + x / 300.0).cos()
                + 15.0 * (x * y).sin().powi(8)
        };
        let terrain = PointCloud::from_positions(scattered(60_000, &hills));
        assert_eq!(find_filled(&terrain), None);
        let mut hall = room(0.0, true);
        let mut widen = |by: f32| {
            hall.positions.iter_mut().for_each(|p| *p *= Vec3::new(by, by, 1.0));
            find_filled(&hall)
        };
        assert!(widen(6.0).is_some());
        assert_eq!(widen(3.0), None);
    }

    #[test]
    fn the_ceiling_and_two_near_walls_are_hidden_from_above_a_corner() {
        let cloud = room(20.0, true);
        let room = find_filled(&cloud).unwrap();
        let center = cloud.origin + DVec3::new(2.2, 2.9, 1.25);
        assert!(room.contains(center));
        let forward = room.view_direction(0.0, None);
        assert!(0.0 < forward.y && forward.z < 0.0, "{forward}");
        let planes = room.planes_before(&camera_at(center - 20.0 * forward));
        assert_eq!(planes.len(), 3);
        for plane in &planes {
            assert!(plane.normal.dot(forward) < 0.0, "{plane:?}");
            assert!((center - plane.point).dot(plane.normal) < 0.0, "{plane:?}");
        }
        assert_eq!(room.planes_before(&camera_at(center)), []);
        let ceiling = room.ceiling_before(&camera_at(center - 20.0 * forward)).unwrap();
        assert_eq!(ceiling.normal, DVec3::Z);
        assert_eq!(room.ceiling_before(&camera_at(center - 20.0 * DVec3::X)), None);
    }
}
