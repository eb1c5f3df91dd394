//! Several clouds as one: a common origin, and the columns that all of them have.

use super::{PointCloud, Scalar, Values};

/// The clouds one after another, and the names of the columns that were left out.
///
/// Points of empty clouds ask for no column. Scalars of different types meet in f64.
pub fn merge(clouds: Vec<PointCloud>) -> (PointCloud, Vec<String>) {
    let mut clouds: Vec<PointCloud> =
        clouds.into_iter().filter(|cloud| !cloud.is_empty()).collect();
    if clouds.len() < 2 {
        return (clouds.pop().unwrap_or_default(), Vec::new());
    }
    let origin = common_origin(&clouds);
    clouds.iter_mut().for_each(|cloud| cloud.rebase(origin));
    let mut dropped = Vec::new();
    let merged = PointCloud {
        origin,
        positions: clouds.iter().flat_map(|cloud| &cloud.positions).copied().collect(),
        normals: column("normals", &clouds, |cloud| cloud.normals.as_ref(), &mut dropped),
        radii: column("radii", &clouds, |cloud| cloud.radii.as_ref(), &mut dropped),
        colors: column("colors", &clouds, |cloud| cloud.colors.as_ref(), &mut dropped),
        intensity: column("intensity", &clouds, |cloud| cloud.intensity.as_ref(), &mut dropped),
        classification: column(
            "classification",
            &clouds,
            |cloud| cloud.classification.as_ref(),
            &mut dropped,
        ),
        scalars: scalars(&clouds, &mut dropped),
    };
    (merged, dropped)
}

/// That of the largest cloud: the most points then keep their positions to the bit.
fn common_origin(clouds: &[PointCloud]) -> crate::math::DVec3 {
    let largest = clouds.iter().rev().max_by_key(|cloud| cloud.len());
    largest.map(|cloud| cloud.origin).unwrap_or_default()
}

fn column<'a, T: Copy + 'a>(
    name: &str,
    clouds: &'a [PointCloud],
    of: impl Fn(&'a PointCloud) -> Option<&'a Vec<T>>,
    dropped: &mut Vec<String>,
) -> Option<Vec<T>> {
    let columns: Vec<&Vec<T>> = clouds.iter().filter_map(of).collect();
    if columns.len() == clouds.len() {
        return Some(columns.into_iter().flatten().copied().collect());
    }
    if !columns.is_empty() {
        dropped.push(name.to_owned());
    }
    None
}

fn scalars(clouds: &[PointCloud], dropped: &mut Vec<String>) -> Vec<Scalar> {
    let mut names: Vec<&str> = Vec::new();
    for name in clouds.iter().flat_map(|cloud| &cloud.scalars).map(|scalar| scalar.name.as_str()) {
        if !names.iter().any(|known| known.eq_ignore_ascii_case(name)) {
            names.push(name);
        }
    }
    let mut kept = Vec::new();
    for name in names {
        let columns: Vec<&Values> = clouds.iter().filter_map(|cloud| cloud.scalar(name)).collect();
        if columns.len() == clouds.len() {
            kept.push(Scalar { name: name.to_owned(), values: concatenate(&columns) });
        } else {
            dropped.push(name.to_owned());
        }
    }
    kept
}

fn concatenate(columns: &[&Values]) -> Values {
    macro_rules! same_type {
        ($($kind:ident),*) => {
            $(if columns.iter().all(|values| matches!(values, Values::$kind(_))) {
                let all = columns.iter().flat_map(|values| match values {
                    Values::$kind(values) => values.as_slice(),
                    _ => &[],
                });
                return Values::$kind(all.copied().collect());
            })*
        };
    }
    same_type!(U8, U16, I32, F32, F64);
    let values = |values: &&Values| (0..values.len()).map(|i| values.get(i)).collect::<Vec<_>>();
    Values::F64(columns.iter().flat_map(values).collect())
}

#[cfg(test)]
mod tests {
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
    fn world_positions_stay() {
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
    fn columns_that_one_lacks_are_named() {
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
    fn scalars_of_different_types_meet_in_f64() {
        let bytes = cloud(0.0, Some(Values::U8(vec![1, 2])));
        let floats = cloud(0.0, Some(Values::F32(vec![0.5, 3.0])));
        let (merged, _) = merge(vec![bytes.clone(), floats]);
        assert_eq!(merged.scalar("time"), Some(&Values::F64(vec![1.0, 2.0, 0.5, 3.0])));
        let (merged, _) = merge(vec![bytes.clone(), bytes]);
        assert_eq!(merged.scalar("time"), Some(&Values::U8(vec![1, 2, 1, 2])));
    }
}
