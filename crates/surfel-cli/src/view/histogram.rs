//! Histograms of columns, as the page shows them.

use serde_json::{Value, json};
use surfel_core::image::is_data;
use surfel_core::points::{PointCloud, visit_column};

/// Maximum number of ranges.
const MAX_BINS: usize = 64;

/// Returns the least and greatest value of a column of clouds, and the numbers of points in ranges of equal width
/// between them. Whole numbers have ranges of whole width. Clouds without the column are left out. The memory that this
/// takes does not grow with the clouds: they are gone through twice.
///
/// # Errors
///
/// Fails if no cloud has values of the column.
pub fn histogram(clouds: &[&PointCloud], column: &str) -> surfel_core::Result<Value> {
    let (mut low, mut high, mut is_whole) = (f64::INFINITY, f64::NEG_INFINITY, true);
    let missing = visit_values(clouds, column, |value| {
        (low, high) = (low.min(value), high.max(value));
        is_whole &= value.fract() == 0.0;
    });
    if high < low {
        return Err(missing.unwrap_or(surfel_core::Error::EmptyCloud));
    }
    let width = match is_whole {
        true => ((high - low + 1.0) / MAX_BINS as f64).ceil(),
        false => (high - low) / MAX_BINS as f64,
    };
    let n_bins = match is_whole {
        true => ((high - low + 1.0) / width).ceil() as usize,
        false => MAX_BINS,
    };
    let mut counts = vec![0u64; n_bins];
    visit_values(clouds, column, |value| {
        counts[(((value - low) / width) as usize).min(n_bins - 1)] += 1;
    });
    Ok(json!({ "low": low, "high": high, "width": width, "counts": counts }))
}

/// Calls `visit` with each value that counts; returns the error of the last cloud without the column.
fn visit_values(
    clouds: &[&PointCloud],
    column: &str,
    mut visit: impl FnMut(f64),
) -> Option<surfel_core::Error> {
    let mut missing = None;
    for cloud in clouds {
        let visit_block = |values: &[f64]| {
            values.iter().filter(|value| is_data(**value)).for_each(|value| visit(*value));
        };
        if let Err(error) = visit_column(cloud, column, visit_block) {
            missing = Some(error);
        }
    }
    missing
}

#[cfg(test)]
mod tests {
    //! Ranges of whole and of other numbers.

    use super::*;
    use surfel_core::math::{DVec3, Vec3};
    use surfel_core::points::{Scalar, Values};

    fn cloud() -> PointCloud {
        let positions = (0..=128).map(|i| Vec3::new(0.0, 0.0, 0.5 * i as f32));
        let mut cloud = PointCloud::from_positions(positions.collect());
        cloud.classification = Some((0..=128).map(|i| if i < 100 { 2 } else { 6 }).collect());
        cloud.origin = DVec3::new(0.0, 0.0, 100.0);
        cloud
    }

    fn counts(column: &str) -> Value {
        histogram(&[&cloud()], column).unwrap()
    }

    #[test]
    fn whole_numbers_have_ranges_of_whole_width() {
        let expected =
            json!({ "low": 2.0, "high": 6.0, "width": 1.0, "counts": [100, 0, 0, 0, 29] });
        assert_eq!(counts("classification"), expected);
    }

    #[test]
    fn other_numbers_have_ranges_of_equal_width() {
        let found = counts("z");
        assert_eq!((&found["low"], &found["high"]), (&json!(100.0), &json!(164.0)));
        let mut expected = vec![2; MAX_BINS];
        expected[MAX_BINS - 1] = 3;
        assert_eq!(found["counts"], json!(expected));
        let flat = counts("x");
        assert_eq!((&flat["width"], &flat["counts"]), (&json!(1.0), &json!([129])));
    }

    #[test]
    fn values_that_stand_for_no_data_do_not_count() {
        let mut cloud = cloud();
        let values = (0..=128).map(|i| [f64::MAX, -f64::MAX, f64::NAN, 7.0][i % 4]).collect();
        let column = Scalar { name: "tree".to_owned(), values: Values::F64(values) };
        cloud.scalars.push(column);
        let found = histogram(&[&cloud], "tree").unwrap();
        assert_eq!((&found["low"], &found["counts"]), (&json!(7.0), &json!([32])));
    }

    #[test]
    fn clouds_without_the_column_are_left_out() {
        let other = PointCloud::from_positions(vec![Vec3::ZERO]);
        let found = histogram(&[&cloud(), &other], "class").unwrap();
        assert_eq!(found["counts"], counts("class")["counts"]);
        assert!(histogram(&[&other], "class").unwrap_err().to_string().contains("class"));
    }
}
