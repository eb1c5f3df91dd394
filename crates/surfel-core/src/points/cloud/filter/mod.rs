//! Filters: conditions on the columns of points, in the notation of PDAL.

mod condition;
mod parse;
mod evaluate;
mod polygon;
mod crossing;

use condition::{Condition, Operand, Relation};
pub use crossing::rings_cross;
pub use evaluate::visit_column;
use evaluate::{Evaluation, color_range};
pub(crate) use polygon::Polygon;
use polygon::Polygons;
use std::fmt;
use std::str::FromStr;

use crate::error::{Error, Result};
use crate::points::PointCloud;
use rayon::prelude::*;

/// Number of points that a task compares.
const POINTS_PER_TASK: usize = 1 << 14;
/// Number of points whose values are compared at once, so that these stay in the cache.
const POINTS_PER_BLOCK: usize = 1 << 11;

/// A condition on the columns of a point, as in `classification == 2 && z < 1200`.
///
/// Columns are compared with numbers and with each other by `==`, `!=`, `<`, `<=`, `>` and `>=`, and joined by `&&`,
/// `||`, `!` and parentheses. The classification is also compared with names, as in `class == ground`. PDAL's ranges are
/// understood too: `z[0:100)` means `z >= 0 && z < 100`, `z![0:100]` all other points, and in a list with commas a point
/// is within one range of each column. Names of columns are those of the file, or those of PDAL for LAS; case and
/// separators do not matter. `x`, `y` and `z` are world coordinates. Colours go from 0 to
/// 255; if a number above 255 is compared with them, they go from 0 to 65535.
#[derive(Clone, Debug, PartialEq)]
pub struct PointFilter {
    condition: Condition,
}

impl PointFilter {
    /// The filter that keeps points of these ASPRS classes.
    pub fn classes(classes: &[u8]) -> Self {
        let column = || "classification".to_owned();
        let is_class = |class: &u8| Condition::equals(column(), f64::from(*class));
        Self { condition: Condition::Any(classes.iter().map(is_class).collect()) }
    }

    /// The filter that keeps points within a box: at least `low` and at most `high` along the axes X, Y and Z. Infinite
    /// bounds keep all.
    pub fn within_box(low: [f64; 3], high: [f64; 3]) -> Self {
        let bound = |axis: usize, relation, bound: f64| {
            let column = Operand::Column(["x", "y", "z"][axis].to_owned());
            bound.is_finite().then_some(Condition::Compare(
                column,
                relation,
                Operand::Number(bound),
            ))
        };
        let both = |axis: usize| {
            let above = bound(axis, Relation::GreaterOrEqual, low[axis]);
            [above, bound(axis, Relation::LessOrEqual, high[axis])]
        };
        Self { condition: Condition::All((0..3).flat_map(both).flatten().collect()) }
    }

    /// The filter that keeps points above or below at least one of some polygons in the XY plane of the world. Each has
    /// an outline and holes, as rings of corners; where rings cross, areas inside of an even number are holes.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Setting`] for a polygon without rings, a ring of fewer than three corners, and corners that are
    /// not finite.
    pub fn within_polygons(polygons: &[Vec<Vec<[f64; 2]>>]) -> Result<Self> {
        let polygons: Result<Vec<Polygon>> =
            polygons.iter().map(|rings| Polygon::new(rings)).collect();
        Ok(Self { condition: Condition::Within(Polygons::new(polygons?)) })
    }

    /// The filter that keeps points that all of these keep.
    pub fn all(filters: impl IntoIterator<Item = Self>) -> Self {
        let conditions = filters.into_iter().map(|filter| filter.condition);
        Self { condition: Condition::All(conditions.collect()) }
    }

    /// Returns the names of the columns that the filter compares, as they were written.
    pub fn columns(&self) -> Vec<&str> {
        let mut columns = Vec::new();
        self.condition.collect_columns(&mut columns);
        columns
    }

    /// Returns the condition in words, with the range of the colours that it compares with numbers.
    pub fn describe(&self) -> String {
        let mut range = None;
        self.condition.visit_comparisons(&mut |left, right| {
            range = range.max(color_range(left, right)).max(color_range(right, left));
        });
        match range {
            Some(max) => format!("{self}, with colours from 0 to {max}"),
            None => self.to_string(),
        }
    }

    /// Returns true for each point of `cloud` from `start` on that the filter keeps.
    ///
    /// # Errors
    ///
    /// Fails if the cloud lacks a column of the filter.
    pub fn matches(&self, cloud: &PointCloud, start: usize) -> Result<Vec<bool>> {
        let evaluation = Evaluation::new(&self.condition, cloud)?;
        let mut matches = vec![false; cloud.len() - start];
        let tasks = matches.par_chunks_mut(POINTS_PER_TASK).enumerate();
        tasks.for_each(|(task, matches)| {
            for (block, matches) in matches.chunks_mut(POINTS_PER_BLOCK).enumerate() {
                let first = start + task * POINTS_PER_TASK + block * POINTS_PER_BLOCK;
                evaluation.run(&self.condition, first, matches);
            }
        });
        Ok(matches)
    }
}

impl FromStr for PointFilter {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Ok(Self { condition: parse::parse(text)? })
    }
}

impl fmt::Display for PointFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.condition)
    }
}

#[cfg(test)]
mod tests {
    //! Points that filters keep.

    use super::*;
    use crate::math::{DVec3, Vec3};
    use crate::points::{Scalar, Values};

    fn cloud() -> PointCloud {
        let scalar = |name: &str, values| Scalar { name: name.into(), values: Values::U8(values) };
        PointCloud {
            origin: DVec3::new(0.0, 0.0, 1000.0),
            classification: Some(vec![2, 6, 2, 5]),
            intensity: Some(vec![10.0, 20.0, f32::NAN, 40.0]),
            colors: Some(vec![[0, 0, 65535]; 4]),
            scalars: vec![
                scalar("return_number", vec![1, 2, 1, 3]),
                scalar("NumberOfReturns", vec![1, 2, 3, 3]),
            ],
            ..PointCloud::from_positions((0..4).map(|i| Vec3::splat(i as f32)).collect())
        }
    }

    fn kept(filter: &str) -> Vec<usize> {
        let matches = filter.parse::<PointFilter>().unwrap().matches(&cloud(), 0).unwrap();
        (0..4).filter(|i| matches[*i]).collect()
    }

    #[test]
    fn columns_are_compared() {
        assert_eq!(kept("classification == 2"), [0, 2]);
        assert_eq!(kept("Classification == 2 || class == 6"), [0, 1, 2]);
        assert_eq!(kept("return_number == number_of_returns"), [0, 1, 3]);
        assert_eq!(kept("ReturnNumber < NumberOfReturns"), [2]);
        assert_eq!(kept("z > 1001"), [2, 3]);
        assert_eq!(kept("altitude > 1001 && East < 3"), [2]);
        assert_eq!(kept("1001 <= z && !(x >= 3)"), [1, 2]);
        assert_eq!(kept("blue == 65535 && red != 65535"), [0, 1, 2, 3]);
        assert_eq!(kept("blue == 255 && red < 1"), [0, 1, 2, 3]);
        assert_eq!(kept("blue > 255"), []);
        assert_eq!(kept("blue > 65534 && green < blue"), [0, 1, 2, 3]);
        assert_eq!(kept("x > -1e0 and not y < .5 or intensity == 10"), [0, 1, 2, 3]);
    }

    #[test]
    fn the_range_of_colours_is_told() {
        let told = |filter: &str| filter.parse::<PointFilter>().unwrap().describe();
        assert_eq!(told("red > 200"), "red > 200, with colours from 0 to 255");
        assert_eq!(told("z > 900 && 300 < G"), "z > 900 && 300 < G, with colours from 0 to 65535");
        assert_eq!(told("red < blue || z > 300"), "red < blue || z > 300");
    }

    #[test]
    fn and_binds_tighter_than_or() {
        assert_eq!(kept("class == 6 || class == 2 && z > 1001"), [1, 2]);
        assert_eq!(kept("(class == 6 || class == 2) && z > 1001"), [2]);
    }

    #[test]
    fn columns_of_any_script_are_told_apart() {
        let mut cloud = cloud();
        for (name, values) in [("密度", vec![1, 1, 5, 5]), ("高度", vec![1, 9, 1, 9])] {
            cloud.scalars.push(Scalar { name: name.into(), values: Values::U8(values) });
        }
        let matches =
            |filter: &str| filter.parse::<PointFilter>().unwrap().matches(&cloud, 0).unwrap();
        assert_eq!(matches("密度[1:2],高度[0:5]"), [true, false, false, false]);
        assert_eq!(matches("密度[1:2],密度[5:5],高度[0:5]"), [true, false, true, false]);
    }

    #[test]
    fn ranges_are_those_of_pdal() {
        assert_eq!(kept("Classification[2:5]"), [0, 2, 3]);
        assert_eq!(kept("Z(1000:1002]"), [1, 2]);
        assert_eq!(kept("Z[1002:]"), [2, 3]);
        assert_eq!(kept("!Classification[:2]"), [1, 3]);
        assert_eq!(kept("Classification![2:2]"), [1, 3]);
        assert_eq!(kept("Z!(1000:1002]"), [0, 3]);
    }

    #[test]
    fn ranges_of_one_column_are_alternatives_and_others_hold_together() {
        assert_eq!(kept("Classification[2:2],Classification[6:6]"), [0, 1, 2]);
        assert_eq!(kept("Classification[2:2], class[6:6], Z[1001:]"), [1, 2]);
        assert_eq!(kept("Z[1001:], Classification[2:2], Z[:1000], Classification[6:6]"), [0, 1, 2]);
        // As in PDAL, each of two negated ranges lets through what the other excludes.
        assert_eq!(kept("Classification![2:2],Classification![6:6]"), [0, 1, 2, 3]);
        let filter: PointFilter = "Classification![7:7],Z(1:2)".parse().unwrap();
        let text = filter.to_string();
        assert_eq!(text, "!(Classification >= 7 && Classification <= 7) && (Z > 1 && Z < 2)");
    }

    #[test]
    fn negated_comparisons_are_written_in_parentheses() {
        let written = |filter: &str| filter.parse::<PointFilter>().unwrap().to_string();
        assert_eq!(written("!(z<3)"), "!(z < 3)");
        assert_eq!(written("!!z<3"), "!!(z < 3)");
        assert_eq!(written("not z[3:]"), "!(z >= 3)");
    }

    #[test]
    fn classes_are_compared_by_name() {
        assert_eq!(kept("class == ground"), [0, 2]);
        assert_eq!(kept("Building == Classification || class == high_vegetation"), [1, 3]);
        assert_eq!(kept("class != ground"), [1, 3]);
        let filter: PointFilter = "z == ground".parse().unwrap();
        assert!(filter.matches(&cloud(), 0).unwrap_err().to_string().contains("'ground'"));
    }

    #[test]
    fn columns_of_las_have_their_names_in_pdal() {
        let angles =
            Scalar { name: "scan_angle".into(), values: Values::F32(vec![-5.0, 0.0, 5.0, 9.0]) };
        let cloud = PointCloud { scalars: vec![angles], ..cloud() };
        let filter: PointFilter = "ScanAngleRank[0:5]".parse().unwrap();
        assert_eq!(filter.matches(&cloud, 0).unwrap(), [false, true, true, false]);
    }

    #[test]
    fn missing_values_match_nothing_but_inequality() {
        assert_eq!(kept("intensity > 0"), [0, 1, 3]);
        assert_eq!(kept("intensity != 10"), [1, 2, 3]);
    }

    #[test]
    fn filters_are_combined_and_written_back() {
        let classes = PointFilter::classes(&[2, 5]);
        let low = "z < 1003".parse().unwrap();
        let both = PointFilter::all([classes, low]);
        assert_eq!(both.matches(&cloud(), 1).unwrap(), [false, true, false]);
        let text = both.to_string();
        assert_eq!(text, "(classification == 2 || classification == 5) && z < 1003");
        assert_eq!(text.parse::<PointFilter>().unwrap().to_string(), text);
        assert_eq!(both.columns(), ["classification", "classification", "z"]);
    }

    #[test]
    fn boxes_and_polygons_are_in_world_coordinates() {
        let kept = |filter: PointFilter| filter.matches(&cloud(), 0).unwrap();
        let low = [f64::NEG_INFINITY, 1.0, 1001.0];
        let slab = PointFilter::within_box(low, [f64::INFINITY, f64::INFINITY, 1002.0]);
        assert_eq!(slab.to_string(), "y >= 1 && z >= 1001 && z <= 1002");
        assert_eq!(kept(slab), [false, true, true, false]);
        let triangle = |at: f64| vec![vec![[at - 0.5, at - 0.5], [at + 0.5, at], [at, at + 0.5]]];
        let two = PointFilter::within_polygons(&[triangle(0.0), triangle(2.0)]).unwrap();
        assert_eq!(two.to_string(), "(x, y) inside of 2 polygons");
        assert_eq!(kept(two), [true, false, true, false]);
    }

    #[test]
    fn unknown_columns_are_reported_with_the_known_ones() {
        let error = "clas == 2".parse::<PointFilter>().unwrap().matches(&cloud(), 0).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("'clas'") && message.contains("classification"), "{message}");
        assert!(message.contains("NumberOfReturns") && !message.contains("radius"), "{message}");
    }
}
