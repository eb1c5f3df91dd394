//! Longitudes and latitudes in metres: in degrees, a scan is a needle as high as its heights.

use super::{CoordinateSystem, Place, Unit};
use rayon::prelude::*;
use std::collections::BTreeMap;
use surfel_core::Result;
use surfel_core::math::{Aabb, DVec3, Vec3, quantile};
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_formats::{FileInfo, LasProfile};

/// Maximum extent of a scan in degrees, if no coordinate system is stated.
const MAX_DEGREES: f64 = 2.0;
/// Minimum height in metres of a scan in degrees, as a multiple of its extent: 1 km is 0.01 degrees wide.
const MIN_NEEDLE_RATIO: f64 = 100.0;
/// Minimum height as such a multiple of a scan that may stand upright: a pole in metres is less high, if not a wire.
const MIN_UPRIGHT_RATIO: f64 = 1000.0;
/// Minimum ratio of the interquartile range of the heights above a place to the height of all, at which a scan stands
/// upright. It is a half for a pole; land is flat or sloping.
const MIN_UPRIGHT_RANGE: f64 = 0.35;
/// Minimum ratio of the distance from longitude and latitude zero to the extent of a scan. Coordinates of objects start
/// near zero.
const MIN_OFFSET_RATIO: f64 = 100.0;

/// Warns of points that stay in degrees, if they do. `keys` are those of settings that move them; there may be none.
pub fn report_degrees(cloud: &PointCloud, info: &FileInfo, keys: &[&str], progress: &dyn Progress) {
    if is_in_degrees(cloud, info) {
        let line = "x and y look like degrees of longitude and latitude; normals, radii and distances need metres: \
                    move the points to a coordinate system in metres";
        progress.warning(line, keys);
    }
}

/// Moves the points and stations of a cloud in degrees to metres, to the coordinate system of `others` if these have one,
/// and reports it. Everything else stays as it is.
///
/// # Errors
///
/// Fails if cancelled.
pub fn move_to_metres(
    cloud: &mut PointCloud,
    info: &mut FileInfo,
    others: Option<&str>,
    progress: &dyn Progress,
) -> Result<()> {
    if let Some(line) = metres_from_degrees(cloud, info, others, progress)? {
        progress.choice(&line, &["reproject"]);
    }
    Ok(())
}

/// Moves the points and stations of a cloud from degrees to the coordinate system of `others` if that has a unit of
/// length, or to their zone of the Universal Transverse Mercator (UTM) system. Heights stay.
///
/// Returns a line about it for the user, or `None` if the coordinates are no degrees: the format of the file prescribes
/// metres, the file states no geographic system, and none without a statement look like it.
fn metres_from_degrees(
    cloud: &mut PointCloud,
    info: &mut FileInfo,
    others: Option<&str>,
    progress: &dyn Progress,
) -> Result<Option<String>> {
    let Some(reprojection) = Reprojection::of(cloud, info, others) else { return Ok(None) };
    let Some(positions) = reprojection.positions(cloud, progress)? else { return Ok(None) };
    for station in &mut cloud.stations {
        station.position = station.position.and_then(|position| reprojection.moved(position));
    }
    cloud.positions = positions;
    cloud.origin = reprojection.origin;
    let Reprojection { middle, name, .. } = reprojection;
    let line = format!(
        "longitudes and latitudes around {:.4}, {:.4} moved to metres of {name}",
        middle.longitude_deg, middle.latitude_deg
    );
    // The records of the file describe the degrees.
    let las = info.las.take().map(|las| LasProfile { projection: Vec::new(), ..las });
    *info = FileInfo {
        coordinate_system: Some(name),
        bounds: None,
        resolution: None,
        las,
        ..std::mem::take(info)
    };
    Ok(Some(line))
}

/// The way of coordinates from degrees to metres.
struct Reprojection {
    source: CoordinateSystem,
    target: CoordinateSystem,
    /// Name of the target.
    name: String,
    /// Middle of the points.
    middle: Place,
    /// World coordinates that become the zero of the positions.
    origin: DVec3,
}

impl Reprojection {
    /// Returns the way for a cloud, or `None` if its coordinates are no degrees.
    fn of(cloud: &PointCloud, info: &FileInfo, others: Option<&str>) -> Option<Self> {
        let source = info.coordinate_system.as_deref().and_then(CoordinateSystem::parse);
        let extent = Extent::of(cloud);
        if !extent.is_in_degrees(cloud, info, source.as_ref()) {
            return None;
        }
        let source = source.or_else(|| CoordinateSystem::parse("EPSG:4326"))?;
        let middle = source.place(0.5 * (extent.low + extent.high))?;
        let is_metric = |system: &CoordinateSystem| {
            !system.projection.is_geocent() && system.unit() != Unit::Degrees
        };
        let of_others =
            others.and_then(|text| Some((text.to_owned(), CoordinateSystem::parse(text)?)));
        let (name, target) = match of_others.filter(|(_, system)| is_metric(system)) {
            Some(found) => found,
            None => {
                let name = format!("EPSG:{}", utm_code(middle));
                let system = CoordinateSystem::parse(&name)?;
                (name, system)
            }
        };
        let origin = target.position(middle)?.round().with_z(cloud.origin.z);
        Some(Self { source, target, name, middle, origin })
    }

    /// Returns a world position in metres, or `None` outside of what the target describes. One that is not finite stays.
    fn moved(&self, degrees: DVec3) -> Option<DVec3> {
        if !degrees.is_finite() {
            return Some(degrees);
        }
        let metres = self.target.position(self.source.place(degrees)?)?;
        Some(metres.with_z(degrees.z))
    }

    /// Returns the positions of a cloud in metres, or `None` if one lies outside of what the target describes.
    fn positions(&self, cloud: &PointCloud, progress: &dyn Progress) -> Result<Option<Vec<Vec3>>> {
        const POINTS_PER_TASK: usize = 1 << 16;
        progress.begin("move to metres", cloud.len() as u64);
        let moved = |position: &Vec3| {
            let metres = self.moved(cloud.origin + position.as_dvec3())?;
            Some((metres - self.origin).as_vec3())
        };
        let tasks = cloud.positions.par_chunks(POINTS_PER_TASK).map(|positions| {
            progress.check()?;
            progress.advance(positions.len() as u64);
            Ok(positions.iter().map(moved).collect::<Option<Vec<Vec3>>>())
        });
        let parts = tasks.collect::<Result<Vec<_>>>()?;
        progress.end();
        Ok(parts.into_iter().collect::<Option<Vec<_>>>().map(|parts| parts.concat()))
    }
}

/// Returns true if the coordinates of a cloud are degrees: its system is geographic, or it has none and they look like
/// degrees beside heights in metres; and its format does not prescribe metres.
pub fn is_in_degrees(cloud: &PointCloud, info: &FileInfo) -> bool {
    let system = info.coordinate_system.as_deref().and_then(CoordinateSystem::parse);
    Extent::of(cloud).is_in_degrees(cloud, info, system.as_ref())
}

/// The least and greatest coordinates of a cloud.
struct Extent {
    low: DVec3,
    high: DVec3,
}

impl Extent {
    fn of(cloud: &PointCloud) -> Self {
        let bounds = Aabb::of_points(cloud.positions.iter().copied().filter(|p| p.is_finite()));
        let [low, high] = [bounds.min, bounds.max].map(|corner| cloud.origin + corner.as_dvec3());
        Self { low, high }
    }

    fn is_in_degrees(
        &self,
        cloud: &PointCloud,
        info: &FileInfo,
        system: Option<&CoordinateSystem>,
    ) -> bool {
        let is_stated = system.map(|system| system.unit() == Unit::Degrees);
        !info.is_in_metres
            && self.is_on_earth()
            && is_stated.unwrap_or_else(|| self.is_needle(cloud))
    }

    /// Returns false for a cloud without points, too.
    fn is_on_earth(&self) -> bool {
        let Self { low, high } = self;
        let is_longitude = -180.0 <= low.x && low.x <= high.x && high.x <= 360.0;
        is_longitude && -90.0 <= low.y && high.y <= 90.0
    }

    /// True if a scan is far higher than wide, as land is in degrees but not a pole in metres, and far from zero.
    fn is_needle(&self, cloud: &PointCloud) -> bool {
        let size = self.high - self.low;
        let side = size.x.max(size.y);
        let offset = self.low.x.abs().max(self.low.y.abs());
        0.0 < side
            && side < MAX_DEGREES
            && MIN_NEEDLE_RATIO * side < size.z
            && MIN_OFFSET_RATIO * side < offset
            && (MIN_UPRIGHT_RATIO * side < size.z || !self.stands_upright(cloud))
    }

    /// True if there are points at all heights above most places of a scan.
    fn stands_upright(&self, cloud: &PointCloud) -> bool {
        const MAX_SAMPLES: usize = 10_000;
        const MAX_CELLS: f64 = 8.0;
        let step = cloud.len().div_ceil(MAX_SAMPLES).max(1);
        let sample = (0..cloud.len()).step_by(step).map(|i| cloud.world_position(i));
        let sample: Vec<DVec3> = sample.filter(|position| position.is_finite()).collect();
        let n_cells = (sample.len() as f64 / 16.0).sqrt().clamp(1.0, MAX_CELLS).floor();
        let size = self.high - self.low;
        let cell = |position: &DVec3| {
            let at = n_cells * (*position - self.low) / size.max(DVec3::splat(f64::MIN_POSITIVE));
            [at.x, at.y].map(|along| along.min(n_cells - 1.0) as u8)
        };
        let mut heights: BTreeMap<[u8; 2], Vec<f64>> = BTreeMap::new();
        sample.iter().for_each(|at| heights.entry(cell(at)).or_default().push(at.z));
        let range = |heights: &Vec<f64>| {
            let quartile = |fraction| quantile(heights.iter().copied(), fraction);
            let range =
                quartile(0.75).zip(quartile(0.25)).map_or(0.0, |(upper, lower)| upper - lower);
            range * heights.len() as f64
        };
        let mean = heights.values().map(range).sum::<f64>() / sample.len().max(1) as f64;
        MIN_UPRIGHT_RANGE * size.z < mean
    }
}

/// Returns the EPSG code of the UTM zone of a place.
fn utm_code(place: Place) -> u16 {
    let zone = (((place.longitude_deg + 180.0) / 6.0).floor() as i32).rem_euclid(60) + 1;
    let first = if place.latitude_deg < 0.0 { 32_700 } else { 32_600 };
    first + zone as u16
}

#[cfg(test)]
mod tests {
    //! Degrees that are moved, and lengths that are not.

    use super::*;
    use surfel_core::points::ScanStation;
    use surfel_core::progress::NoProgress;

    /// Returns points 1e-4 `scale` apart at an origin.
    fn points(scale: f32, origin: DVec3) -> PointCloud {
        let position = |i: i32| {
            Vec3::new(
                (i % 30) as f32 * 1e-4 * scale,
                (i / 30) as f32 * 1e-4 * scale,
                (i % 17) as f32,
            )
        };
        let mut cloud = PointCloud::from_positions((0..900).map(position).collect());
        cloud.origin = origin;
        cloud
    }

    fn stated(system: &str) -> FileInfo {
        FileInfo { coordinate_system: Some(system.to_owned()), ..FileInfo::default() }
    }

    fn moved(cloud: &mut PointCloud, info: &mut FileInfo, others: Option<&str>) -> Option<String> {
        metres_from_degrees(cloud, info, others, &NoProgress).unwrap()
    }

    const MUNICH: DVec3 = DVec3::new(11.57, 48.13, 520.0);

    #[test]
    fn degrees_become_metres_of_their_utm_zone() {
        for mut info in [FileInfo::default(), stated("EPSG:4326")] {
            let mut cloud = points(1.0, MUNICH);
            let line = moved(&mut cloud, &mut info, None).unwrap();
            assert!(line.ends_with("moved to metres of EPSG:32632"), "{line}");
            assert_eq!(info.coordinate_system.as_deref(), Some("EPSG:32632"));
            let size = Aabb::of_points(cloud.positions.iter().copied()).size();
            // 0.0029 degrees of latitude are 322 m, of longitude two thirds of it.
            assert!((size.y - 329.0).abs() < 3.0 && (size.x - 228.0).abs() < 3.0, "{size}");
            assert_eq!(size.z, 16.0);
            let first = cloud.origin + cloud.positions[0].as_dvec3();
            let system = CoordinateSystem::parse("EPSG:32632").unwrap();
            let place = system.place(first).unwrap();
            assert!((place.longitude_deg - MUNICH.x).abs() < 1e-8, "{place:?}");
            assert!((place.latitude_deg - MUNICH.y).abs() < 1e-8, "{place:?}");
        }
    }

    #[test]
    fn degrees_follow_the_system_of_other_files() {
        let mut cloud = points(1.0, MUNICH);
        let mut info = stated("EPSG:4326");
        moved(&mut cloud, &mut info, Some("EPSG:25833")).unwrap();
        assert_eq!(info.coordinate_system.as_deref(), Some("EPSG:25833"));
        moved(&mut points(1.0, MUNICH), &mut stated("EPSG:4326"), Some("EPSG:4326"));
    }

    #[test]
    fn stations_move_with_their_points() {
        let station = ScanStation { position: Some(MUNICH), ..ScanStation::default() };
        let mut cloud = PointCloud { stations: vec![station], ..points(1.0, MUNICH) };
        moved(&mut cloud, &mut stated("EPSG:4326"), None).unwrap();
        let [first, station] = [cloud.world_position(0), cloud.stations[0].position.unwrap()];
        assert!(first.with_z(0.0).distance(station.with_z(0.0)) < 0.01, "{first}, {station}");
        assert_eq!(station.z, MUNICH.z);
    }

    #[test]
    fn records_of_degrees_are_not_kept() {
        let records = vec![(2112, b"GEOGCS[\"WGS 84\"]\0".to_vec())];
        let las = LasProfile { point_format: 6, projection: records, ..LasProfile::default() };
        let mut info = FileInfo { las: Some(las), ..stated("EPSG:4326") };
        moved(&mut points(1.0, MUNICH), &mut info, None).unwrap();
        let las = info.las.unwrap();
        assert_eq!((las.point_format, las.projection), (6, vec![]));
    }

    #[test]
    fn clouds_without_points_are_not_in_degrees() {
        assert!(is_in_degrees(&points(1.0, MUNICH), &stated("EPSG:4326")));
        assert!(!is_in_degrees(&PointCloud::default(), &stated("EPSG:4326")));
    }

    #[test]
    fn lengths_stay() {
        for (scale, origin, mut info) in [
            (1e4, MUNICH, FileInfo::default()),
            (1.0, DVec3::new(691_000.0, 48.13, 520.0), FileInfo::default()),
            (1.0, DVec3::ZERO, FileInfo::default()),
            (1.0, MUNICH, stated("EPSG:25832")),
            (1.0, DVec3::new(691_000.0, 5_334_000.0, 520.0), stated("EPSG:4326")),
            (1.0, MUNICH, FileInfo { is_in_metres: true, ..stated("EPSG:4326") }),
        ] {
            let mut cloud = points(scale, origin);
            let before = cloud.clone();
            assert_eq!(moved(&mut cloud, &mut info, None), None);
            assert!(cloud == before);
        }
    }

    #[test]
    fn poles_are_no_land() {
        let random = |i: u32, salt: f64| (f64::from(i) * salt).fract();
        let cloud = |position: &dyn Fn(u32) -> DVec3| {
            let positions = (0..3000).map(|i| position(i).as_vec3()).collect();
            PointCloud {
                origin: DVec3::new(10.0, 5.0, 0.0),
                ..PointCloud::from_positions(positions)
            }
        };
        let pole = cloud(&|i| {
            let (sin, cos) = (std::f64::consts::TAU * random(i, 0.618_034)).sin_cos();
            DVec3::new(0.025 * cos, 0.025 * sin, 6.0 * random(i, 0.754_878))
        });
        assert!(!is_in_degrees(&pole, &FileInfo::default()));
        // A plain that slopes by 6 m, and one with houses, both 5.5 km wide.
        let [slope, town] = [false, true].map(|has_houses| {
            cloud(&|i| {
                let (x, y) = (random(i, 0.618_034), random(i, 0.754_878));
                let house =
                    if random(i, 0.569_84) < 0.2 { 6.0 * random(i, 0.414_214) } else { 0.0 };
                DVec3::new(0.05 * x, 0.05 * y, if has_houses { house } else { 6.0 * x })
            })
        });
        assert!([slope, town].iter().all(|land| is_in_degrees(land, &FileInfo::default())));
    }

    #[test]
    fn zones_are_six_degrees_wide() {
        let code = |longitude_deg, latitude_deg| utm_code(Place { latitude_deg, longitude_deg });
        assert_eq!(code(-180.0, 10.0), 32_601);
        assert_eq!(code(179.9, -10.0), 32_760);
        assert_eq!(code(180.0, 10.0), 32_601);
        assert_eq!(code(11.57, 48.13), 32_632);
    }
}
