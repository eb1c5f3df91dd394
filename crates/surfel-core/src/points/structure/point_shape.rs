//! Structure: which points form a surface, which a line, and which neither, as leaves do.

use crate::error::{Error, Result};
use crate::math::Vec3;
use crate::points::normals::planes::PlaneFit;
use crate::points::{PointCloud, Scalar, Values};
use crate::words::counted;
use rayon::prelude::*;
use std::str::FromStr;

/// Name of the scalar column of structures: 0 surface, 1 line, 2 scatter, 3 redundant.
pub const STRUCTURE: &str = "structure";

/// Maximum surface variation of a surface's neighbourhood.
const MAX_SURFACE_VARIATION: f32 = 0.06;
/// Minimum width of a surface's neighbourhood, as the ratio of its eigenvalues. Below it, it is a line.
const MIN_SURFACE_WIDTH: f32 = 0.25;

/// The shape that a point is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Structure {
    /// The point is part of a surface.
    #[default]
    Surface = 0,
    /// The point is part of a line: a wire, a pole, a rail.
    Line = 1,
    /// The point stands for itself: a leaf, a stray point.
    Scatter = 2,
    /// The point lies on a densely sampled scan line of a surface that fewer of its points describe as well.
    Redundant = 3,
}

/// The choice of structures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum StructureChoice {
    /// Each point's structure is found from its neighbours.
    #[default]
    Auto,
    /// All points form a surface.
    Surface,
    /// All points stand for themselves.
    Scatter,
}

impl FromStr for StructureChoice {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "auto" => Ok(Self::Auto),
            "surface" => Ok(Self::Surface),
            "scatter" => Ok(Self::Scatter),
            _ => Err(Error::Setting {
                name: "structure",
                found: text.to_owned(),
                expected: "auto, surface or scatter",
            }),
        }
    }
}

impl std::fmt::Display for StructureChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Surface => "surface",
            Self::Scatter => "scatter",
        })
    }
}

/// Numbers of points by their structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StructureReport {
    /// Number of points of surfaces.
    pub n_surface: usize,
    /// Number of points of lines.
    pub n_lines: usize,
    /// Number of points that stand for themselves.
    pub n_scatter: usize,
    /// True if these are shown as leaves; false if each is a ball.
    pub has_leaves: bool,
    /// Number of points of surfaces that are left out, as others cover them.
    pub n_redundant: usize,
}

impl StructureReport {
    pub(crate) fn of(shapes: &[PointShape]) -> Self {
        let count = |kind| shapes.par_iter().filter(|shape| shape.structure == kind).count();
        Self {
            n_surface: count(Structure::Surface),
            n_lines: count(Structure::Line),
            n_scatter: count(Structure::Scatter),
            has_leaves: false,
            n_redundant: count(Structure::Redundant),
        }
    }

    /// Returns a line about the structures for the user.
    pub fn line(&self) -> String {
        let Self { n_surface, n_lines, n_scatter, n_redundant, has_leaves } = *self;
        let n_points = (n_surface + n_lines + n_scatter + n_redundant).max(1);
        let percent = |count: usize| 100.0 * count as f64 / n_points as f64;
        let shown = match (n_scatter, has_leaves) {
            (0, _) => "",
            (_, true) => ", shown as leaves",
            (_, false) => ", shown as balls",
        };
        let line = format!(
            "structure: {:.1} % surface, {:.1} % lines, {:.1} % scattered points{shown}",
            percent(n_surface + n_redundant),
            percent(n_lines),
            percent(n_scatter)
        );
        match n_redundant {
            0 => line,
            _ => {
                let points = counted(n_redundant, "point");
                format!(
                    "{line}; {points} of dense surfaces not drawn, as others cover the same place"
                )
            }
        }
    }
}

/// The shape of a point: the normal of a surface or the direction of a line, and the reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointShape {
    /// The structure.
    pub structure: Structure,
    /// Unit normal of a surface, unit direction of a line; zero if unknown.
    pub normal: Vec3,
    /// Radius of a disc, half the length of a capsule, or radius of a ball or of a cluster of leaves.
    pub radius: f32,
}

impl PointShape {
    /// Returns true for the disc of a surface, whether it is left out or not.
    pub(crate) fn is_disc(&self) -> bool {
        matches!(self.structure, Structure::Surface | Structure::Redundant)
    }
}

impl PointCloud {
    /// Returns the structure of each point; `None` without a column of structures. A column with other numbers merely has
    /// this name.
    pub fn structures(&self) -> Option<Vec<Structure>> {
        let of_code = |code: &u8| match code {
            0 => Some(Structure::Surface),
            1 => Some(Structure::Line),
            2 => Some(Structure::Scatter),
            3 => Some(Structure::Redundant),
            _ => None,
        };
        match self.scalar(STRUCTURE)? {
            Values::U8(codes) => codes.iter().map(of_code).collect(),
            _ => None,
        }
    }

    /// Adds or replaces the column of structures.
    pub fn set_structures(&mut self, structures: &[Structure]) {
        let values = Values::U8(structures.iter().map(|structure| *structure as u8).collect());
        self.scalars.retain(|scalar| !scalar.name.eq_ignore_ascii_case(STRUCTURE));
        self.scalars.push(Scalar { name: STRUCTURE.to_owned(), values });
    }
}

/// True if a plane describes a neighbourhood.
pub(crate) fn is_surface(fit: &PlaneFit) -> bool {
    fit.normal != Vec3::ZERO
        && fit.variation < MAX_SURFACE_VARIATION
        && MIN_SURFACE_WIDTH < fit.width
}

/// True if a neighbourhood is a line, whatever its thickness.
pub(crate) fn is_line(fit: &PlaneFit) -> bool {
    fit.width <= MIN_SURFACE_WIDTH
}

#[cfg(test)]
mod tests {
    //! Names of choices, and the line of a report.

    use super::*;

    #[test]
    fn the_line_says_what_scattered_points_are_shown_as() {
        let report = StructureReport { n_surface: 3, n_scatter: 1, ..StructureReport::default() };
        let line = "structure: 75.0 % surface, 0.0 % lines, 25.0 % scattered points, shown as";
        assert_eq!(report.line(), format!("{line} balls"));
        let leafy = StructureReport { has_leaves: true, ..report };
        assert_eq!(leafy.line(), format!("{line} leaves"));
        let plain = StructureReport { n_scatter: 0, ..leafy };
        assert!(plain.line().ends_with("0.0 % scattered points"), "{}", plain.line());
    }

    #[test]
    fn choices_are_parsed() {
        for choice in [StructureChoice::Auto, StructureChoice::Surface, StructureChoice::Scatter] {
            assert_eq!(choice.to_string().parse::<StructureChoice>().unwrap(), choice);
        }
        assert!("line".parse::<StructureChoice>().is_err());
    }
}
