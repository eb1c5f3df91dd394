//! Conditions as trees.

use super::polygon::Polygons;
use crate::words::counted;
use std::fmt;

/// A condition on a point.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Condition {
    /// All of these hold.
    All(Vec<Condition>),
    /// At least one of these holds.
    Any(Vec<Condition>),
    /// This does not hold.
    Not(Box<Condition>),
    /// Two numbers are in a relation.
    Compare(Operand, Relation, Operand),
    /// At least one of these contains the point.
    Within(Polygons),
}

/// A number of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Operand {
    /// A constant.
    Number(f64),
    /// The column of this name.
    Column(String),
}

/// The relation of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    Equal,
    NotEqual,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

/// All relations with their signs; a sign stands before those that it begins with.
pub(super) const RELATIONS: [(&str, Relation); 6] = [
    ("==", Relation::Equal),
    ("!=", Relation::NotEqual),
    ("<=", Relation::LessOrEqual),
    (">=", Relation::GreaterOrEqual),
    ("<", Relation::Less),
    (">", Relation::Greater),
];

impl Condition {
    /// The condition that a column has this value.
    pub fn equals(column: String, value: f64) -> Self {
        Self::Compare(Operand::Column(column), Relation::Equal, Operand::Number(value))
    }

    /// Appends the names of all columns.
    pub fn collect_columns<'a>(&'a self, columns: &mut Vec<&'a str>) {
        self.visit_comparisons(&mut |left, right| {
            columns.extend([left, right].into_iter().filter_map(|operand| match operand {
                Operand::Column(name) => Some(name.as_str()),
                Operand::Number(_) => None,
            }));
        });
    }

    /// Calls `visit` with the operands of each comparison.
    pub fn visit_comparisons<'a>(&'a self, visit: &mut dyn FnMut(&'a Operand, &'a Operand)) {
        match self {
            Self::All(parts) | Self::Any(parts) => {
                parts.iter().for_each(|part| part.visit_comparisons(visit));
            }
            Self::Not(inner) => inner.visit_comparisons(visit),
            Self::Within(_) => {}
            Self::Compare(left, _, right) => visit(left, right),
        }
    }

    fn fmt_parts(parts: &[Self], sign: &str, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, part) in parts.iter().enumerate() {
            if 0 < i {
                write!(f, " {sign} ")?;
            }
            part.fmt_single(f)?;
        }
        Ok(())
    }

    /// Writes the condition, in parentheses if it has parts.
    fn fmt_single(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All(parts) | Self::Any(parts) if 1 < parts.len() => write!(f, "({self})"),
            _ => write!(f, "{self}"),
        }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All(parts) => Self::fmt_parts(parts, "&&", f),
            Self::Any(parts) => Self::fmt_parts(parts, "||", f),
            Self::Not(inner) => {
                if matches!(**inner, Self::Not(_)) {
                    write!(f, "!{inner}")
                } else {
                    write!(f, "!({inner})")
                }
            }
            Self::Within(polygons) if polygons.len() == 1 => {
                f.write_str("(x, y) inside of a polygon")
            }
            Self::Within(polygons) => {
                write!(f, "(x, y) inside of {}", counted(polygons.len(), "polygon"))
            }
            Self::Compare(left, relation, right) => {
                let sign = RELATIONS.iter().find(|(_, known)| known == relation);
                write!(f, "{left} {} {right}", sign.map_or("", |(sign, _)| sign))
            }
        }
    }
}

impl fmt::Display for Operand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Column(name) => f.write_str(name),
        }
    }
}
