//! Columns of labels, each of which has a colour of its own.

use super::coloring::Coloring;
use super::source::ColorSource;
use crate::image::{is_data, label_color};
use crate::points::{PointCloud, Values, is_label};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Returns the labels of a cloud's points, if the source is a column of whole numbers with the name of labels, and
/// neither a colour map nor a range asks for colours in order.
pub(super) fn labels<'c>(
    cloud: &'c PointCloud,
    coloring: &Coloring,
    source: &ColorSource,
) -> Option<&'c Values> {
    let ColorSource::Column(name) = source else { return None };
    if !is_label(name) || coloring.colormap.is_some() || coloring.range.is_some() {
        return None;
    }
    let values = cloud.scalar(name)?;
    let may_be_label = |value: f64| !is_data(value) || value.fract() == 0.0;
    (0..values.len()).into_par_iter().all(|i| may_be_label(values.get(i))).then_some(values)
}

/// Returns the sRGB-encoded colour of a value of a column of labels; grey where it is missing.
pub(super) fn color_of(value: f64) -> [u8; 3] {
    label_color(if is_data(value) { value as i64 } else { -1 })
}

/// Returns the first `n` labels that occur, in ascending order.
pub(super) fn first_labels(values: &Values, n: usize) -> Vec<i64> {
    let mut found = BTreeSet::new();
    for value in (0..values.len()).map(|i| values.get(i)).filter(|value| is_data(*value)) {
        let label = value as i64;
        if found.len() < n || found.last().is_some_and(|last| label < *last) {
            found.insert(label);
        }
        if n < found.len() {
            found.pop_last();
        }
    }
    found.into_iter().collect()
}
