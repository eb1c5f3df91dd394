//! Orientation of normals, which decides the front side of a surface.

use super::spanning_tree::flips_by_spanning_tree;
use crate::error::{Error, Result};
use crate::math::{DVec3, Vec3};
use crate::points::scan::scan_angle::SightLines;
use crate::points::up::is_terrain;
use crate::points::{PointCloud, is_valid_position};
use crate::progress::Progress;
use rayon::prelude::*;
use std::str::FromStr;

/// Minimum fraction of the points whose station is known.
const MIN_WITH_STATION: f64 = 0.99;

/// The rule that decides the sign of estimated normals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Orientation {
    /// No rule: the sign has no meaning.
    #[default]
    None,
    /// The first of these that the cloud tells enough for: its stations, scan angles, up if it is terrain, else a
    /// spanning tree.
    Auto,
    /// Toward a point in world coordinates, as a scanner's position.
    Viewpoint(DVec3),
    /// Toward the station of each point's scan. Normals of points whose station is not known stay.
    Station,
    /// Along the line of sight that the scan angles of an airborne scan tell. Without them, up.
    ScanAngle,
    /// Toward +Z, as for airborne scans.
    Up,
    /// Propagated along a minimum spanning tree from neighbour to neighbour, the most parallel first (Hoppe et al.
    /// 1992), but not between parts for which rays tell otherwise: they get farther outside than inside. Where rays
    /// tell nothing, as for a wall alone, the normal of the highest point of each connected component points up or, if
    /// it is nearly level, outward.
    SpanningTree,
}

/// Flips the normals of the points of `cloud` as needed.
///
/// # Errors
///
/// Returns [`Error::TooManyPoints`] beyond 32-bit indices and [`Error::Cancelled`] if `progress` is cancelled.
pub fn orient(
    cloud: &PointCloud,
    normals: Vec<Vec3>,
    orientation: Orientation,
    progress: &dyn Progress,
) -> Result<Vec<Vec3>> {
    match orientation {
        Orientation::None => Ok(normals),
        Orientation::Auto => {
            let (chosen, sights) = choose_orientation(cloud, &normals, progress)?;
            progress.choice(&format!("front sides {}", chosen.reason()), &["orient"]);
            match chosen {
                Orientation::ScanAngle => Ok(turn_to_scanner(normals, sights.as_ref())),
                _ => orient(cloud, normals, chosen, progress),
            }
        }
        Orientation::Viewpoint(world_viewpoint) => {
            let viewpoint = world_viewpoint - cloud.origin;
            Ok(flip_if(normals, |i, normal| {
                (viewpoint - cloud.positions[i].as_dvec3()).dot(normal.as_dvec3()) < 0.0
            }))
        }
        Orientation::Station => Ok(turn_to_stations(cloud, normals)),
        Orientation::ScanAngle => {
            Ok(turn_to_scanner(normals, SightLines::new(cloud, progress)?.as_ref()))
        }
        Orientation::Up => Ok(flip_if(normals, |_, normal| normal.z < 0.0)),
        Orientation::SpanningTree => {
            let flips = flips_by_spanning_tree(&cloud.positions, &normals, progress)?;
            Ok(flip_if(normals, |i, _| flips[i]))
        }
    }
}

/// Flips the normals that point away from the known station of their point: no scanner sees a surface from behind.
fn turn_to_stations(cloud: &PointCloud, normals: Vec<Vec3>) -> Vec<Vec3> {
    let Some(scan_of) = cloud.scan_of_point() else { return normals };
    flip_if(normals, |i, normal| {
        let station = cloud.stations.get(scan_of.get(i)).and_then(|station| station.position);
        let offset = station.map_or(DVec3::ZERO, |station| station - cloud.world_position(i));
        offset.dot(normal.as_dvec3()) < 0.0
    })
}

/// Flips the normals that point away from an airborne scanner, or down if its lines of sight are not known.
fn turn_to_scanner(normals: Vec<Vec3>, sights: Option<&SightLines>) -> Vec<Vec3> {
    let toward = |i: usize| sights.map_or(DVec3::Z, |sights| sights.toward_scanner(i));
    flip_if(normals, |i, normal| toward(i).dot(normal.as_dvec3()) < 0.0)
}

/// Returns true if the positions of all stations of a cloud are known, and the station of nearly all points.
pub(crate) fn has_stations(cloud: &PointCloud) -> bool {
    let is_known = cloud.stations.iter().all(|station| station.position.is_some());
    let Some(scan_of) = cloud.scan_of_point().filter(|_| is_known && !cloud.is_empty()) else {
        return false;
    };
    let has_station = |point: &usize| scan_of.get(*point) < cloud.stations.len();
    let n_with_station = (0..cloud.len()).into_par_iter().filter(has_station).count();
    MIN_WITH_STATION * cloud.len() as f64 <= n_with_station as f64
}

/// Returns the most trusted orientation that the columns and the shape of a cloud allow, with its lines of sight if it goes
/// by these.
fn choose_orientation<'a>(
    cloud: &'a PointCloud,
    normals: &[Vec3],
    progress: &dyn Progress,
) -> Result<(Orientation, Option<SightLines<'a>>)> {
    if has_stations(cloud) {
        return Ok((Orientation::Station, None));
    }
    let sights = SightLines::new(cloud, progress)?;
    let chosen = if sights.is_some() {
        Orientation::ScanAngle
    } else if is_terrain(&cloud.positions) && is_mostly_level(cloud, normals) {
        Orientation::Up
    } else {
        Orientation::SpanningTree
    };
    Ok((chosen, sights))
}

/// Returns true if more than half of the normals are within 60 degrees of the vertical. Terrestrial scans are mostly
/// walls and trunks.
fn is_mostly_level(cloud: &PointCloud, normals: &[Vec3]) -> bool {
    const MIN_VERTICAL_COSINE: f32 = 0.5;
    let valid = cloud.positions.par_iter().zip(normals).filter(|(p, _)| is_valid_position(**p));
    let n_level = valid.clone().filter(|(_, n)| MIN_VERTICAL_COSINE < n.z.abs()).count();
    valid.count() < 2 * n_level
}

fn flip_if(mut normals: Vec<Vec3>, is_backward: impl Fn(usize, Vec3) -> bool + Sync) -> Vec<Vec3> {
    normals.par_iter_mut().enumerate().for_each(|(i, normal)| {
        if is_backward(i, *normal) {
            *normal = -*normal;
        }
    });
    normals
}

impl Orientation {
    /// Returns the rule in words, as the end of "front sides ...".
    fn reason(self) -> &'static str {
        match self {
            Self::None | Self::Auto | Self::Viewpoint(_) => "as they are",
            Self::Station => "toward the station of each scan",
            Self::ScanAngle => "toward the scanner, by scan angles",
            Self::Up => "up, as the cloud is terrain",
            Self::SpanningTree => "from neighbour to neighbour, outward",
        }
    }
}

impl FromStr for Orientation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let viewpoint = |numbers: &str| {
            let numbers: Vec<f64> =
                numbers.split(',').map(|x| x.trim().parse().ok()).collect::<Option<_>>()?;
            let [x, y, z] = numbers.try_into().ok()?;
            let viewpoint = DVec3::new(x, y, z);
            viewpoint.is_finite().then_some(Self::Viewpoint(viewpoint))
        };
        let orientation = match text.split_once(':').unwrap_or((text, "")) {
            ("none", "") => Some(Self::None),
            ("auto", "") => Some(Self::Auto),
            ("scan-angle", "") => Some(Self::ScanAngle),
            ("station", "") => Some(Self::Station),
            ("up", "") => Some(Self::Up),
            ("mst", "") => Some(Self::SpanningTree),
            ("viewpoint", numbers) => viewpoint(numbers),
            _ => None,
        };
        orientation.ok_or_else(|| Error::Setting {
            name: "orientation",
            found: text.to_owned(),
            expected: "auto, none, station, scan-angle, up, mst or viewpoint:x,y,z",
        })
    }
}

#[cfg(test)]
mod tests {
    //! Signs of normals.

    use super::*;
    use crate::math::Random;
    use crate::points::{SCAN_ANGLE, STATION, Scalar, ScanStation, Values};
    use crate::progress::NoProgress;

    /// Two separate balls, with a third of their outward normals flipped.
    fn balls() -> (PointCloud, Vec<Vec3>) {
        let mut random = Random::new(1, 0);
        let outward: Vec<Vec3> = (0..4000)
            .map(|_| Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32)))
            .map(Vec3::normalize)
            .collect();
        let center = |i: usize| if i < 2000 { Vec3::ZERO } else { Vec3::new(0.0, 9.0, 30.0) };
        let positions = outward.iter().enumerate().map(|(i, &n)| center(i) + n).collect();
        let mixed = outward.iter().map(|&n| if random.below(3) == 0 { -n } else { n }).collect();
        let mut cloud = PointCloud::from_positions(positions);
        cloud.normals = Some(outward);
        (cloud, mixed)
    }

    #[test]
    fn a_spanning_tree_orients_closed_surfaces_outward() {
        let (cloud, mixed) = balls();
        let found = orient(&cloud, mixed, Orientation::SpanningTree, &NoProgress).unwrap();
        assert_eq!(Some(found), cloud.normals);
    }

    #[test]
    fn a_spanning_tree_orients_ground_of_any_shape_upward() {
        for curvature in [-0.05f32, 0.0, 0.05] {
            let height = |x: f32, y: f32| curvature * (x * x + y * y);
            let position_of = |i: usize| ((i % 40) as f32 - 20.0, (i / 40) as f32 - 20.0);
            let points = (0..1600).map(|i| {
                let (x, y) = position_of(i);
                Vec3::new(x, y, height(x, y))
            });
            let cloud = PointCloud::from_positions(points.collect());
            let normals: Vec<Vec3> = (0..1600)
                .map(|i| {
                    let (x, y) = position_of(i);
                    let sign = if i % 7 < 3 { -1.0 } else { 1.0 };
                    sign * Vec3::new(-2.0 * curvature * x, -2.0 * curvature * y, 1.0).normalize()
                })
                .collect();
            let found = orient(&cloud, normals, Orientation::SpanningTree, &NoProgress).unwrap();
            assert!(found.iter().all(|normal| 0.0 < normal.z), "curvature {curvature}");
        }
    }

    #[test]
    fn boxes_on_the_ground_are_oriented_outward_beyond_their_sharp_edges() {
        let mut random = Random::new(2, 0);
        let mut next = || random.next_f32();
        let (mut positions, mut outward) = (Vec::new(), Vec::new());
        let corners: Vec<Vec3> =
            (0..9).map(|i| 5.0 * Vec3::new((i % 3) as f32, (i / 3) as f32, 0.0)).collect();
        while positions.len() < 60_000 {
            let ground = Vec3::new(20.0 * next() - 4.0, 20.0 * next() - 4.0, 0.0);
            let is_under = |corner: &Vec3| {
                let offset = ground - *corner;
                0.0 < offset.min_element() + 1e-6 && offset.max_element() < 1.5
            };
            if !corners.iter().any(is_under) {
                positions.push(ground);
                outward.push(Vec3::Z);
            }
            // The bottom of a box is not seen.
            let corner = corners[(9.0 * next()) as usize];
            let axis = (3.0 * next()) as usize;
            let is_high = axis == 2 || next() < 0.5;
            let mut on_box = Vec3::new(next(), next(), next());
            on_box[axis] = if is_high { 1.0 } else { 0.0 };
            positions.push(corner + 1.5 * on_box);
            outward.push(if is_high { Vec3::AXES[axis] } else { -Vec3::AXES[axis] });
        }
        let mixed = outward.iter().map(|&n| if next() < 0.4 { -n } else { n }).collect();
        let cloud = PointCloud::from_positions(positions);
        let found = orient(&cloud, mixed, Orientation::SpanningTree, &NoProgress).unwrap();
        let n_wrong = found.iter().zip(&outward).filter(|(a, b)| a.dot(**b) < 0.0).count();
        assert!(n_wrong < 60, "{n_wrong}");
    }

    #[test]
    fn a_viewpoint_is_given_in_world_coordinates() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::ZERO, Vec3::X * 10.0]);
        cloud.origin = DVec3::new(1e6, 0.0, 0.0);
        let viewpoint = Orientation::Viewpoint(DVec3::new(1e6 + 5.0, 0.0, 0.0));
        let found = orient(&cloud, vec![Vec3::X; 2], viewpoint, &NoProgress).unwrap();
        assert_eq!(found, [Vec3::X, -Vec3::X]);
        let found = orient(&cloud, vec![-Vec3::Z, Vec3::Z], Orientation::Up, &NoProgress).unwrap();
        assert_eq!(found, [Vec3::Z; 2]);
    }

    #[test]
    fn normals_point_to_the_station_of_their_scan() {
        let station =
            |x: f64| ScanStation { position: Some(DVec3::X * x), ..ScanStation::default() };
        let unknown = ScanStation { position: None, ..ScanStation::default() };
        let indices = Values::U16(vec![0, 1, 2]);
        let cloud = PointCloud {
            origin: DVec3::new(1e6, 0.0, 0.0),
            stations: vec![station(0.0), station(2e6), unknown],
            scalars: vec![Scalar { name: STATION.into(), values: indices }],
            ..PointCloud::from_positions(vec![Vec3::ZERO; 3])
        };
        let found = orient(&cloud, vec![Vec3::X; 3], Orientation::Station, &NoProgress).unwrap();
        assert_eq!(found, [-Vec3::X, Vec3::X, Vec3::X]);
    }

    #[test]
    fn the_most_trusted_orientation_is_chosen() {
        let chosen = |cloud: &PointCloud, normals: &[Vec3]| {
            choose_orientation(cloud, normals, &NoProgress).unwrap().0
        };
        let ground = |i: usize| Vec3::new((i % 100) as f32, (i / 100) as f32, 0.0);
        let terrain = PointCloud::from_positions((0..10_000).map(ground).collect());
        let normals = vec![Vec3::NEG_Z; terrain.len()];
        assert_eq!(chosen(&terrain, &normals), Orientation::Up);
        let walls = vec![Vec3::X; terrain.len()];
        assert_eq!(chosen(&terrain, &walls), Orientation::SpanningTree);
        let mut flight = terrain.clone();
        let angles = Values::F32((0..10_000).map(|i| (i % 100) as f32 - 50.0).collect());
        flight.scalars.push(Scalar { name: SCAN_ANGLE.into(), values: angles });
        assert_eq!(chosen(&flight, &normals), Orientation::ScanAngle);
        let station = |position| ScanStation { position, ..ScanStation::default() };
        let scan = PointCloud { stations: vec![station(Some(DVec3::Z))], ..flight.clone() };
        assert_eq!(chosen(&scan, &normals), Orientation::Station);
        // A point without a station comes first.
        let of_point = |i: usize| if i == 0 { u16::MAX } else { 0 };
        let indices = Values::U16((0..scan.len()).map(of_point).collect());
        let mut merged = scan;
        merged.stations.push(station(Some(DVec3::X)));
        merged.scalars.push(Scalar { name: STATION.into(), values: indices });
        assert_eq!(chosen(&merged, &normals), Orientation::Station);
        let unposed = PointCloud { stations: vec![station(None)], ..flight };
        assert_eq!(chosen(&unposed, &normals), Orientation::ScanAngle);
        let (balls, mixed) = balls();
        assert_eq!(chosen(&balls, &mixed), Orientation::SpanningTree);
        let found = orient(&balls, mixed, Orientation::Auto, &NoProgress).unwrap();
        assert_eq!(Some(found), balls.normals);
    }

    #[test]
    fn walls_face_the_scanner_that_the_scan_angle_tells() {
        let position = |i: usize| Vec3::new((i % 100) as f32 - 50.0, (i / 100) as f32, 0.0);
        let angle = |i: usize| (position(i).x / 100.0).atan().to_degrees();
        let cloud = PointCloud {
            scalars: vec![Scalar {
                name: SCAN_ANGLE.into(),
                values: Values::F32((0..2000).map(angle).collect()),
            }],
            ..PointCloud::from_positions((0..2000).map(position).collect())
        };
        let found = orient(&cloud, vec![Vec3::X; 2000], Orientation::ScanAngle, &NoProgress);
        for (position, normal) in cloud.positions.iter().zip(found.unwrap()) {
            assert!(position.x.abs() < 1.0 || normal.x * position.x < 0.0, "{position}");
        }
        let unknown = PointCloud::from_positions(vec![Vec3::ZERO]);
        let found = orient(&unknown, vec![Vec3::NEG_Z], Orientation::ScanAngle, &NoProgress);
        assert_eq!(found.unwrap(), [Vec3::Z]);
    }

    #[test]
    fn few_or_equal_points_are_oriented() {
        for positions in [vec![], vec![Vec3::X], vec![Vec3::X; 40], vec![Vec3::NAN, Vec3::X]] {
            let normals = vec![-Vec3::Z; positions.len()];
            let cloud = PointCloud::from_positions(positions);
            let found = orient(&cloud, normals, Orientation::SpanningTree, &NoProgress).unwrap();
            assert!(found.iter().all(|&normal| normal == Vec3::Z), "{found:?}");
        }
    }

    #[test]
    fn orientations_are_parsed() {
        let viewpoint = Orientation::Viewpoint(DVec3::new(1.0, -2.5, 3e5));
        assert_eq!("viewpoint:1, -2.5,3e5".parse::<Orientation>().unwrap(), viewpoint);
        assert_eq!("mst".parse::<Orientation>().unwrap(), Orientation::SpanningTree);
        for text in ["", "up:1", "viewpoint", "viewpoint:1,2", "viewpoint:1,2,nan", "down"] {
            assert!(text.parse::<Orientation>().is_err(), "{text}");
        }
    }
}
