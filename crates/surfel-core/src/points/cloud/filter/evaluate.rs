//! Evaluates conditions column by column, on blocks of points.

use super::condition::{Condition, Operand, Relation};
use crate::error::{Error, Result};
use crate::points::{COLOR_8_TO_16, KnownColumn, PointCloud, Values, name_of_pdal, plain_name};
use std::iter::repeat;
use std::ops::Range;

/// The greatest channel of a colour of 8 bits. A channel that is compared with a greater number has 16 bits.
const MAX_8_BITS: f64 = 255.0;

/// The columns of a cloud that a condition compares.
pub(super) struct Evaluation<'a> {
    cloud: &'a PointCloud,
    columns: Vec<(&'a str, ColumnValues<'a>)>,
}

/// A column of a cloud.
#[derive(Clone, Copy)]
enum ColumnValues<'a> {
    Known(KnownColumn),
    Scalar(&'a Values),
}

/// The values of an operand.
enum OperandValues {
    /// One number for all points.
    Number(f64),
    /// A number for each point.
    Column(Vec<f64>),
}

impl<'a> Evaluation<'a> {
    /// Finds the columns of a condition; fails if the cloud lacks one.
    pub fn new(condition: &'a Condition, cloud: &'a PointCloud) -> Result<Self> {
        let mut names = Vec::new();
        condition.collect_columns(&mut names);
        let columns = names.into_iter().map(|name| Ok((name, find_column(name, cloud)?)));
        Ok(Self { cloud, columns: columns.collect::<Result<_>>()? })
    }

    /// Writes for each point from `start` on whether it meets the condition.
    pub fn run(&self, condition: &Condition, start: usize, matches: &mut [bool]) {
        match condition {
            Condition::All(parts) => {
                matches.fill(true);
                self.join(parts, start, matches, |all, part| *all &= part);
            }
            Condition::Any(parts) => {
                matches.fill(false);
                self.join(parts, start, matches, |any, part| *any |= part);
            }
            Condition::Not(inner) => {
                self.run(inner, start, matches);
                matches.iter_mut().for_each(|is_match| *is_match = !*is_match);
            }
            Condition::Within(polygons) => {
                let positions = &self.cloud.positions[start..start + matches.len()];
                for (is_match, position) in matches.iter_mut().zip(positions) {
                    let position = self.cloud.origin + position.as_dvec3();
                    *is_match = polygons.contain([position.x, position.y]);
                }
            }
            Condition::Compare(left, relation, right) => {
                let values = |operand, other| self.values(operand, other, start, matches.len());
                match (values(left, right), values(right, left)) {
                    (OperandValues::Number(a), OperandValues::Number(b)) => {
                        compare(matches, repeat((a, b)), *relation);
                    }
                    (OperandValues::Column(left), OperandValues::Number(b)) => {
                        compare(matches, left.into_iter().map(|a| (a, b)), *relation);
                    }
                    (OperandValues::Number(a), OperandValues::Column(right)) => {
                        compare(matches, right.into_iter().map(|b| (a, b)), *relation);
                    }
                    (OperandValues::Column(left), OperandValues::Column(right)) => {
                        compare(matches, left.into_iter().zip(right), *relation);
                    }
                }
            }
        }
    }

    fn join(
        &self,
        parts: &[Condition],
        start: usize,
        matches: &mut [bool],
        join: impl Fn(&mut bool, bool),
    ) {
        let mut of_part = vec![false; matches.len()];
        for part in parts {
            self.run(part, start, &mut of_part);
            matches.iter_mut().zip(&of_part).for_each(|(all, part)| join(all, *part));
        }
    }

    /// Returns the values of an operand, which is compared with the `other`, for `n` points from `start` on.
    fn values(&self, operand: &Operand, other: &Operand, start: usize, n: usize) -> OperandValues {
        let name = match operand {
            Operand::Number(number) => return OperandValues::Number(*number),
            Operand::Column(name) => name,
        };
        let column = self.columns.iter().find(|(known, _)| known == name).map(|(_, column)| column);
        let column = column.expect("columns were found before");
        let has_16_bits = has_16_bits(other);
        let color_unit = if has_16_bits { 1 } else { COLOR_8_TO_16 };
        OperandValues::Column(column.values(self.cloud, color_unit, start..start + n))
    }
}

/// Writes for each pair of values whether it has a relation.
fn compare(matches: &mut [bool], pairs: impl Iterator<Item = (f64, f64)>, relation: Relation) {
    // Each arm is a loop of its own, so that the relation is examined once, not once a point.
    match relation {
        Relation::Equal => fill(matches, pairs, f64::eq),
        Relation::NotEqual => fill(matches, pairs, f64::ne),
        Relation::Less => fill(matches, pairs, f64::lt),
        Relation::LessOrEqual => fill(matches, pairs, f64::le),
        Relation::Greater => fill(matches, pairs, f64::gt),
        Relation::GreaterOrEqual => fill(matches, pairs, f64::ge),
    }
}

fn fill(
    matches: &mut [bool],
    pairs: impl Iterator<Item = (f64, f64)>,
    holds: impl Fn(&f64, &f64) -> bool,
) {
    matches.iter_mut().zip(pairs).for_each(|(is_match, (a, b))| *is_match = holds(&a, &b));
}

/// Returns true if a channel of a colour that is compared with `other` has 16 bits.
fn has_16_bits(other: &Operand) -> bool {
    matches!(other, Operand::Number(number) if MAX_8_BITS < *number)
}

/// Returns the greatest channel of a colour that is compared with a number; `None` for all other operands.
pub(super) fn color_range(operand: &Operand, other: &Operand) -> Option<u16> {
    let Operand::Column(name) = operand else { return None };
    let is_color = matches!(KnownColumn::from_name(name), Some(KnownColumn::Color(_)));
    let is_number = matches!(other, Operand::Number(_));
    let max = if has_16_bits(other) { u16::MAX } else { MAX_8_BITS as u16 };
    (is_color && is_number).then_some(max)
}

impl ColumnValues<'_> {
    /// Returns the values of a range of points of the cloud that has the column, channels of colours in multiples of
    /// `color_unit`.
    fn values(self, cloud: &PointCloud, color_unit: u16, range: Range<usize>) -> Vec<f64> {
        match self {
            ColumnValues::Known(column) => known_values(column, cloud, color_unit, range),
            ColumnValues::Scalar(values) => match values {
                Values::U8(values) => widen(&values[range]),
                Values::U16(values) => widen(&values[range]),
                Values::I32(values) => widen(&values[range]),
                Values::F32(values) => widen(&values[range]),
                Values::F64(values) => values[range].to_vec(),
            },
        }
    }
}

fn known_values(
    column: KnownColumn,
    cloud: &PointCloud,
    color_unit: u16,
    range: Range<usize>,
) -> Vec<f64> {
    let absent = "a column is there if it was found";
    match column {
        KnownColumn::Position(axis) => {
            let zero = cloud.origin[axis];
            cloud.positions[range].iter().map(|p| zero + f64::from(p[axis])).collect()
        }
        KnownColumn::Normal(axis) => {
            let normals = &cloud.normals.as_ref().expect(absent)[range];
            normals.iter().map(|normal| normal[axis].into()).collect()
        }
        KnownColumn::Color(channel) => {
            let colors = &cloud.colors.as_ref().expect(absent)[range];
            let unit = f64::from(color_unit);
            colors.iter().map(|color| f64::from(color[channel]) / unit).collect()
        }
        KnownColumn::Radius => widen(&cloud.radii.as_ref().expect(absent)[range]),
        KnownColumn::Intensity => widen(&cloud.intensity.as_ref().expect(absent)[range]),
        KnownColumn::Classification => widen(&cloud.classification.as_ref().expect(absent)[range]),
    }
}

/// Number of values of a column that are held at once.
const MAX_VALUES_AT_ONCE: usize = 1 << 16;

/// Calls `visit` with the values of a column, block by block. The column has a name that a filter may use; `x`, `y` and
/// `z` are world coordinates, and colours go from 0 to 255.
///
/// # Errors
///
/// Returns [`Error::UnknownName`] if the cloud lacks the column.
pub fn visit_column(cloud: &PointCloud, name: &str, mut visit: impl FnMut(&[f64])) -> Result<()> {
    let column = find_column(name, cloud)?;
    for start in (0..cloud.len()).step_by(MAX_VALUES_AT_ONCE) {
        let end = cloud.len().min(start + MAX_VALUES_AT_ONCE);
        visit(&column.values(cloud, COLOR_8_TO_16, start..end));
    }
    Ok(())
}

fn widen<T: Copy + Into<f64>>(values: &[T]) -> Vec<f64> {
    values.iter().map(|value| (*value).into()).collect()
}

fn find_column<'a>(name: &str, cloud: &'a PointCloud) -> Result<ColumnValues<'a>> {
    let wanted = plain_name(name);
    let scalars = cloud.scalars.iter();
    let scalar = |wanted: &str| scalars.clone().find(|scalar| plain_name(&scalar.name) == wanted);
    let found = scalar(&wanted).or_else(|| scalar(&plain_name(name_of_pdal(name)?)));
    if let Some(scalar) = found {
        return Ok(ColumnValues::Scalar(&scalar.values));
    }
    let known = KnownColumn::from_name(name).filter(|column| is_present(*column, cloud));
    known.map(ColumnValues::Known).ok_or_else(|| {
        let present = KnownColumn::ALL.into_iter().filter(|column| is_present(*column, cloud));
        let mut known: Vec<&str> = present.map(KnownColumn::name).collect();
        known.extend(scalars.map(|scalar| scalar.name.as_str()));
        let found = name.to_owned();
        Error::UnknownName { kind: "column of the filter", found, known: known.join(", ") }
    })
}

fn is_present(column: KnownColumn, cloud: &PointCloud) -> bool {
    match column {
        KnownColumn::Position(_) => true,
        KnownColumn::Normal(_) => cloud.normals.is_some(),
        KnownColumn::Color(_) => cloud.colors.is_some(),
        KnownColumn::Radius => cloud.radii.is_some(),
        KnownColumn::Intensity => cloud.intensity.is_some(),
        KnownColumn::Classification => cloud.classification.is_some(),
    }
}
