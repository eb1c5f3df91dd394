//! Lines of sight of airborne scanners, from the scan angles of their pulses.
//!
//! A scan angle says how far a pulse is tilted to the side of the flight, not where that side is. Within a small part of
//! a flight line the angle grows linearly across the flight, so a regression over the points there gives the side,
//! whatever the order of the points (after `scanline_orient_normals` of CGAL, which needs the order of scan lines).

use crate::error::Result;
use crate::math::{DVec2, DVec3};
use crate::points::{PointCloud, Values, is_valid_position};
use crate::progress::Progress;
use std::collections::HashMap;

/// Name of the scalar column of scan angles in degrees.
pub const SCAN_ANGLE: &str = "scan_angle";
/// Name of the scalar column that holds the number of each point's flight line.
pub const POINT_SOURCE: &str = "point_source_id";

/// Number of cells along the longer side of a cloud. A flight turns little over a cell.
const N_CELLS: f64 = 8.0;
/// Minimum number of points of a regression.
const MIN_POINTS: f64 = 16.0;
/// Minimum fraction of the variance of scan angles that a plane over X and Y explains.
const MIN_EXPLAINED: f64 = 0.8;

/// The directions from points to the scanner of an airborne survey.
pub struct SightLines<'a> {
    cloud: &'a PointCloud,
    angles: &'a Values,
    sources: Option<&'a Values>,
    corner: DVec2,
    cell_size: f64,
    /// Horizontal unit vectors along which the scan angle grows.
    across: HashMap<(u32, u8, u8), DVec2>,
    /// Vectors of whole flight lines, for cells with too few points.
    across_of_lines: HashMap<u32, DVec2>,
}

impl<'a> SightLines<'a> {
    /// Finds the side of each flight line; `None` for a cloud without scan angles or with the same one everywhere.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn new(cloud: &'a PointCloud, progress: &dyn Progress) -> Result<Option<Self>> {
        let Some(angles) = cloud.scalar(SCAN_ANGLE) else { return Ok(None) };
        let bounds = cloud.bounds();
        let size = (bounds.max - bounds.min).as_dvec3().truncate();
        let mut sights = Self {
            cloud,
            angles,
            sources: cloud.scalar(POINT_SOURCE),
            corner: bounds.min.as_dvec3().truncate(),
            cell_size: size.max_element() / N_CELLS,
            across: HashMap::new(),
            across_of_lines: HashMap::new(),
        };
        if !(0.0 < sights.cell_size && sights.cell_size.is_finite()) {
            return Ok(None);
        }
        let mut cells: HashMap<(u32, u8, u8), Regression> = HashMap::new();
        let mut lines: HashMap<u32, Regression> = HashMap::new();
        for point in (0..cloud.len()).filter(|point| is_valid_position(cloud.positions[*point])) {
            if point.is_multiple_of(1 << 16) {
                progress.check()?;
            }
            let Some(angle) = sights.angle_deg(point) else { continue };
            let key = sights.cell(point);
            let offset = sights.offset(point);
            let middle = DVec2::new(f64::from(key.1) + 0.5, f64::from(key.2) + 0.5);
            cells.entry(key).or_default().add(offset - middle, angle);
            lines.entry(key.0).or_default().add(offset - 0.5 * N_CELLS, angle);
        }
        sights.across = directions(&cells);
        sights.across_of_lines = directions(&lines);
        Ok((!sights.across_of_lines.is_empty()).then_some(sights))
    }

    /// Returns the unit vector from a point to the scanner: straight up if its flight line has no known side.
    pub fn toward_scanner(&self, point_idx: usize) -> DVec3 {
        let key = self.cell(point_idx);
        let across = self.across.get(&key).or_else(|| self.across_of_lines.get(&key.0));
        let (Some(across), Some(angle)) = (across, self.angle_deg(point_idx)) else {
            return DVec3::Z;
        };
        let (sin, cos) = angle.to_radians().sin_cos();
        (-sin * *across).extend(cos)
    }

    fn angle_deg(&self, point_idx: usize) -> Option<f64> {
        Some(self.angles.get(point_idx)).filter(|angle| angle.abs() < 90.0)
    }

    /// Returns the horizontal offset of a point from the corner of the cloud, in cells.
    fn offset(&self, point_idx: usize) -> DVec2 {
        (self.cloud.positions[point_idx].as_dvec3().truncate() - self.corner) / self.cell_size
    }

    /// Returns the flight line of a point, and the cell that it lies in.
    fn cell(&self, point_idx: usize) -> (u32, u8, u8) {
        let source = self.sources.map_or(0.0, |sources| sources.get(point_idx));
        let offset = self.offset(point_idx);
        (source as u32, offset.x as u8, offset.y as u8)
    }
}

/// Returns the directions in which the scan angle grows, where it does.
fn directions<K: Copy + Eq + std::hash::Hash>(
    regressions: &HashMap<K, Regression>,
) -> HashMap<K, DVec2> {
    let found = regressions.iter().filter_map(|(key, sums)| Some((*key, sums.direction()?)));
    found.collect()
}

/// Sums over the points of a linear regression of the scan angle on X and Y.
#[derive(Clone, Copy, Default)]
struct Regression {
    count: f64,
    offset: DVec2,
    angle: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    offset_angle: DVec2,
    angle_squared: f64,
}

impl Regression {
    fn add(&mut self, offset: DVec2, angle: f64) {
        self.count += 1.0;
        self.offset += offset;
        self.angle += angle;
        self.xx += offset.x * offset.x;
        self.xy += offset.x * offset.y;
        self.yy += offset.y * offset.y;
        self.offset_angle += angle * offset;
        self.angle_squared += angle * angle;
    }

    /// Returns the unit vector of the slope, if a slope explains the angles.
    fn direction(&self) -> Option<DVec2> {
        if self.count < MIN_POINTS {
            return None;
        }
        let mean = self.offset / self.count;
        let xx = self.xx - mean.x * self.offset.x;
        let xy = self.xy - mean.x * self.offset.y;
        let yy = self.yy - mean.y * self.offset.y;
        let covariance = self.offset_angle - mean * self.angle;
        let variance = self.angle_squared - self.angle * self.angle / self.count;
        let determinant = xx * yy - xy * xy;
        let slope = DVec2::new(
            yy * covariance.x - xy * covariance.y,
            xx * covariance.y - xy * covariance.x,
        ) / determinant;
        // NaN, as of points on a line, fails this test too.
        let is_explained = MIN_EXPLAINED * variance < slope.dot(covariance) && 0.0 < variance;
        if is_explained { slope.try_normalize() } else { None }
    }
}

#[cfg(test)]
mod tests {
    //! Lines of sight of a virtual survey, and of columns that tell nothing.

    use super::*;
    use crate::math::{Random, Vec3};
    use crate::points::Scalar;
    use crate::progress::NoProgress;

    fn sights(cloud: &PointCloud) -> Option<SightLines<'_>> {
        SightLines::new(cloud, &NoProgress).unwrap()
    }

    /// Returns points of two flights 300 m over rough ground, the first to the north and the second to the north-east,
    /// in random order, and the position of the scanner at each.
    fn flights() -> (PointCloud, Vec<DVec3>) {
        let mut random = Random::new(1, 0);
        let (mut positions, mut scanners) = (Vec::new(), Vec::new());
        let (mut angles, mut sources) = (Vec::new(), Vec::new());
        for _ in 0..20_000 {
            let line = random.below(2);
            let ahead = [DVec3::Y, DVec3::new(1.0, 1.0, 0.0).normalize()][line as usize];
            let scanner = DVec3::Z * 300.0 + (200.0 * random.next_f64() - 100.0) * ahead;
            let angle_deg = 40.0 * random.next_f64() - 20.0;
            let height = 300.0 - 15.0 * random.next_f64();
            let side = height * angle_deg.to_radians().tan();
            positions.push((scanner - DVec3::Z * height + side * ahead.cross(DVec3::Z)).as_vec3());
            scanners.push(scanner);
            angles.push(angle_deg as f32);
            sources.push(line as u16);
        }
        let scalar = |name: &str, values| Scalar { name: name.to_owned(), values };
        let angles = scalar(SCAN_ANGLE, Values::F32(angles));
        let sources = scalar(POINT_SOURCE, Values::U16(sources));
        let cloud = PointCloud::from_positions(positions);
        (PointCloud { scalars: vec![angles, sources], ..cloud }, scanners)
    }

    #[test]
    fn lines_of_sight_point_to_the_flight_line_whatever_the_order_of_the_points() {
        let (cloud, scanners) = flights();
        let sights = sights(&cloud).unwrap();
        for (point, scanner) in scanners.iter().enumerate() {
            let expected = (scanner - cloud.positions[point].as_dvec3()).normalize();
            let found = sights.toward_scanner(point);
            assert!(0.995 < found.dot(expected), "{point}: {found} is not {expected}");
        }
    }

    fn with_angles(angles: Vec<f32>) -> PointCloud {
        let position = |i: usize| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
        PointCloud {
            scalars: vec![Scalar { name: SCAN_ANGLE.into(), values: Values::F32(angles) }],
            ..PointCloud::from_positions((0..400).map(position).collect())
        }
    }

    #[test]
    fn scan_angles_without_a_slope_tell_nothing() {
        assert!(sights(&with_angles(vec![0.0; 400])).is_none());
        assert!(sights(&with_angles(vec![f32::NAN; 400])).is_none());
        let noise = (0..400).map(|i| ((i * 7919) % 13) as f32).collect();
        assert!(sights(&with_angles(noise)).is_none());
        let cloud = with_angles((0..400).map(|i| (i % 20) as f32).collect());
        assert!(sights(&cloud).is_some());
        assert!(sights(&PointCloud::default()).is_none());
        let coincident = PointCloud { positions: vec![Vec3::ONE; 400], ..cloud };
        assert!(sights(&coincident).is_none());
    }
}
