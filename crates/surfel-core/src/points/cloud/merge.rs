//! Merging of clouds: a common origin, and the columns that all of them have; classes and flags that some of them have.

use super::flags::is_flag;
use crate::points::{PointCloud, STATION, Scalar, ScanStation, Values};

/// Merges clouds in their order. Returns the merged cloud and the names of the columns that were left out.
///
/// The origin is that of the largest cloud. Empty clouds are ignored. Scalar columns of different types become f64.
/// Classes and flags that only some clouds have are 0 for the points of the others. A merged cloud has no
/// morph targets and joints. Columns are moved one by one to save memory.
pub fn merge(mut clouds: Vec<PointCloud>) -> (PointCloud, Vec<String>) {
    clouds.retain(|cloud| !cloud.is_empty());
    if clouds.len() < 2 {
        return (clouds.pop().unwrap_or_default(), Vec::new());
    }
    let origin = common_origin(&clouds);
    for cloud in clouds.iter_mut().filter(|cloud| cloud.origin != origin) {
        cloud.rebase(origin);
    }
    let mut dropped = Vec::new();
    let (stations, has_dropped_stations) = merge_stations(&mut clouds);
    if has_dropped_stations {
        dropped.push("stations".to_owned());
    }
    if clouds.iter().any(|cloud| cloud.classification.is_some()) {
        for cloud in &mut clouds {
            cloud.classification.get_or_insert_with(|| vec![0; cloud.positions.len()]);
        }
    }
    let n_points: Vec<usize> = clouds.iter().map(PointCloud::len).collect();
    let positions = clouds.iter_mut().map(|cloud| std::mem::take(&mut cloud.positions)).collect();
    if clouds.iter().any(|cloud| !cloud.morphs.is_empty() || cloud.skin.is_some()) {
        dropped.push("morph targets and joints".to_owned());
    }
    let merged = PointCloud {
        origin,
        positions: concatenate(positions),
        normals: column("normals", &mut clouds, |cloud| cloud.normals.take(), &mut dropped),
        radii: column("radii", &mut clouds, |cloud| cloud.radii.take(), &mut dropped),
        colors: column("colors", &mut clouds, |cloud| cloud.colors.take(), &mut dropped),
        intensity: column("intensity", &mut clouds, |cloud| cloud.intensity.take(), &mut dropped),
        classification: column(
            "classification",
            &mut clouds,
            |cloud| cloud.classification.take(),
            &mut dropped,
        ),
        source_indices: None,
        scalars: scalars(&mut clouds, &n_points, &mut dropped),
        stations,
        morphs: Vec::new(),
        skin: None,
    };
    (merged, dropped)
}

/// Returns the origin of the largest cloud, whose points then keep the bits of their positions.
fn common_origin(clouds: &[PointCloud]) -> crate::math::DVec3 {
    let largest = clouds.iter().rev().max_by_key(|cloud| cloud.len());
    largest.map(|cloud| cloud.origin).unwrap_or_default()
}

/// Merges the stations of clouds, and renumbers those of their points. If one of the clouds has none, all are dropped.
/// Points whose station is unknown get an index that no station has.
///
/// Returns the stations and true if any were dropped.
fn merge_stations(clouds: &mut [PointCloud]) -> (Vec<ScanStation>, bool) {
    let n_stations: usize = clouds.iter().map(|cloud| cloud.stations.len()).sum();
    let has_none = |cloud: &PointCloud| cloud.stations.is_empty();
    if clouds.iter().any(has_none) || usize::from(u16::MAX) < n_stations {
        clouds.iter_mut().for_each(|cloud| cloud.stations.clear());
        return (Vec::new(), 0 < n_stations);
    }
    let mut stations = Vec::new();
    for cloud in clouds {
        let first = stations.len() as u16;
        let (n_points, n_stations) = (cloud.len(), cloud.stations.len());
        let is_station = |scalar: &Scalar| scalar.name.eq_ignore_ascii_case(STATION);
        let indices = match cloud.scalars.iter_mut().find(|scalar| is_station(scalar)) {
            Some(Scalar { values: Values::U16(indices), .. }) => indices,
            _ => {
                cloud.scalars.retain(|scalar| !is_station(scalar));
                let index = if n_stations == 1 { 0 } else { u16::MAX };
                let values = Values::U16(vec![index; n_points]);
                cloud.scalars.push(Scalar { name: STATION.into(), values });
                let Some(Scalar { values: Values::U16(indices), .. }) = cloud.scalars.last_mut()
                else {
                    unreachable!("the column was just added")
                };
                indices
            }
        };
        for index in indices {
            let is_known = usize::from(*index) < n_stations;
            *index = if is_known { *index + first } else { u16::MAX };
        }
        stations.append(&mut cloud.stations);
    }
    (stations, false)
}

fn column<T>(
    name: &str,
    clouds: &mut [PointCloud],
    take: impl Fn(&mut PointCloud) -> Option<Vec<T>>,
    dropped: &mut Vec<String>,
) -> Option<Vec<T>> {
    let columns: Vec<Vec<T>> = clouds.iter_mut().filter_map(take).collect();
    if columns.len() == clouds.len() {
        return Some(concatenate(columns));
    }
    if !columns.is_empty() {
        dropped.push(name.to_owned());
    }
    None
}

fn scalars(
    clouds: &mut [PointCloud],
    n_points: &[usize],
    dropped: &mut Vec<String>,
) -> Vec<Scalar> {
    let mut names: Vec<String> = Vec::new();
    for Scalar { name, .. } in clouds.iter().flat_map(|cloud| &cloud.scalars) {
        if !names.iter().any(|known| known.eq_ignore_ascii_case(name)) {
            names.push(name.clone());
        }
    }
    let mut kept = Vec::new();
    for name in names {
        let is_named = |scalar: &Scalar| scalar.name.eq_ignore_ascii_case(&name);
        let take = |(cloud, n_points): (&mut PointCloud, &usize)| {
            let Some(at) = cloud.scalars.iter().position(is_named) else {
                return is_flag(&name).then(|| Values::U8(vec![0; *n_points]));
            };
            Some(cloud.scalars.swap_remove(at).values)
        };
        let columns: Vec<Values> = clouds.iter_mut().zip(n_points).filter_map(take).collect();
        if columns.len() == clouds.len() {
            kept.push(Scalar { name, values: concatenate_values(columns) });
        } else {
            dropped.push(name);
        }
    }
    kept
}

/// Concatenates columns. Each is freed as soon as it is copied behind the first.
fn concatenate<T>(columns: Vec<Vec<T>>) -> Vec<T> {
    let n: usize = columns.iter().map(Vec::len).sum();
    let mut columns = columns.into_iter();
    let mut all = columns.next().unwrap_or_default();
    all.reserve_exact(n - all.len());
    columns.for_each(|column| all.extend(column));
    all
}

fn concatenate_values(columns: Vec<Values>) -> Values {
    macro_rules! same_type {
        ($($kind:ident),*) => {
            $(if columns.iter().all(|values| matches!(values, Values::$kind(_))) {
                let columns = columns.into_iter().filter_map(|values| match values {
                    Values::$kind(values) => Some(values),
                    _ => None,
                });
                return Values::$kind(concatenate(columns.collect()));
            })*
        };
    }
    same_type!(U8, U16, I32, F32, F64);
    let mut all = Vec::with_capacity(columns.iter().map(Values::len).sum());
    for values in columns {
        all.extend((0..values.len()).map(|i| values.get(i)));
    }
    Values::F64(all)
}

#[cfg(test)]
mod tests {
    //! Merged columns.

    use super::*;
    use crate::math::{DVec3, Vec3};

    fn cloud(origin: f64, scalar: Option<Values>) -> PointCloud {
        let scalar = scalar.map(|values| Scalar { name: "Time".to_owned(), values });
        PointCloud {
            origin: DVec3::splat(origin),
            scalars: scalar.into_iter().collect(),
            ..PointCloud::from_positions(vec![Vec3::ONE, Vec3::X])
        }
    }

    #[test]
    fn merging_keeps_world_positions() {
        let clouds = vec![cloud(1000.0, None), cloud(2000.0, None)];
        let (merged, dropped) = merge(clouds.clone());
        assert!(dropped.is_empty());
        for (i, expected) in
            clouds.iter().flat_map(|c| [c.world_position(0), c.world_position(1)]).enumerate()
        {
            assert_eq!(merged.world_position(i), expected);
        }
    }

    #[test]
    fn columns_that_a_cloud_lacks_are_dropped_and_named() {
        let mut with = cloud(0.0, Some(Values::U8(vec![1, 2])));
        with.radii = Some(vec![1.0; 2]);
        let (merged, dropped) = merge(vec![with.clone(), cloud(0.0, None)]);
        assert_eq!(dropped, ["radii", "Time"]);
        assert!(merged.radii.is_none() && merged.scalars.is_empty());
        let (merged, dropped) = merge(vec![PointCloud::default(), with.clone()]);
        assert_eq!((merged, dropped.len()), (with, 0));
        assert_eq!(merge(Vec::new()).0, PointCloud::default());
    }

    #[test]
    fn classes_and_flags_that_a_cloud_lacks_are_zero() {
        let mut with = cloud(0.0, None);
        with.classification = Some(vec![2, 6]);
        with.scalars = vec![Scalar { name: "Overlap".into(), values: Values::U8(vec![0, 1]) }];
        let (merged, dropped) = merge(vec![cloud(0.0, None), with]);
        assert!(dropped.is_empty(), "{dropped:?}");
        assert_eq!(merged.classification, Some(vec![0, 0, 2, 6]));
        assert_eq!(merged.scalar("overlap"), Some(&Values::U8(vec![0, 0, 0, 1])));
    }

    #[test]
    fn scalars_of_different_types_become_f64() {
        let bytes = cloud(0.0, Some(Values::U8(vec![1, 2])));
        let floats = cloud(0.0, Some(Values::F32(vec![0.5, 3.0])));
        let (merged, _) = merge(vec![bytes.clone(), floats]);
        assert_eq!(merged.scalar("time"), Some(&Values::F64(vec![1.0, 2.0, 0.5, 3.0])));
        let (merged, _) = merge(vec![bytes.clone(), bytes]);
        assert_eq!(merged.scalar("time"), Some(&Values::U8(vec![1, 2, 1, 2])));
    }

    #[test]
    fn columns_are_moved_without_spare_capacity() {
        let single = cloud(1000.0, None);
        let before = single.positions.as_ptr();
        assert_eq!(merge(vec![single]).0.positions.as_ptr(), before);
        let several = vec![cloud(0.0, None), cloud(0.0, None), cloud(0.0, None)];
        let (merged, _) = merge(several);
        assert_eq!((merged.len(), merged.positions.capacity()), (6, 6));
    }

    fn scan(names: &[&str], indices: Option<Vec<u16>>) -> PointCloud {
        let stations = names.iter().enumerate().map(|(i, name)| ScanStation {
            name: (*name).into(),
            position: Some(DVec3::splat(i as f64)),
            ..ScanStation::default()
        });
        let column =
            indices.map(|indices| Scalar { name: STATION.into(), values: Values::U16(indices) });
        PointCloud {
            stations: stations.collect(),
            scalars: column.into_iter().collect(),
            ..PointCloud::from_positions(vec![Vec3::ZERO; 2])
        }
    }

    fn names(cloud: &PointCloud) -> Vec<Option<&str>> {
        (0..cloud.len()).map(|i| Some(cloud.station_of(i)?.name.as_str())).collect()
    }

    #[test]
    fn points_know_their_station() {
        assert_eq!(names(&scan(&["a"], None)), [Some("a"); 2]);
        assert_eq!(names(&scan(&["a", "b"], Some(vec![1, 0]))), [Some("b"), Some("a")]);
        assert_eq!(names(&scan(&[], None)), [None; 2]);
        assert_eq!(names(&scan(&["a", "b"], None)), [None; 2]);
    }

    #[test]
    fn merging_keeps_the_station_of_each_point() {
        let (merged, dropped) =
            merge(vec![scan(&["a", "b"], Some(vec![1, 0])), scan(&["c"], None)]);
        assert_eq!(names(&merged), [Some("b"), Some("a"), Some("c"), Some("c")]);
        assert!(dropped.is_empty());
        let (merged, dropped) = merge(vec![scan(&["a"], None), scan(&[], None)]);
        assert_eq!((names(&merged), dropped), (vec![None; 4], vec!["stations".to_owned()]));
    }

    #[test]
    fn points_of_unknown_station_have_none_after_merging() {
        let unknown = scan(&["a"], Some(vec![5, u16::MAX]));
        let (merged, _) = merge(vec![scan(&["b"], None), unknown, scan(&["c", "d"], None)]);
        let expected = [Some("b"), Some("b"), None, None, None, None];
        assert_eq!((merged.stations.len(), names(&merged)), (4, expected.to_vec()));
    }
}
