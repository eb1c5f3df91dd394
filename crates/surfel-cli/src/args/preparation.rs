//! Options of the preparation of points.

use crate::report::Report;
use clap::{ArgAction, Args};
use surfel::points::neighbors::{Method, Query};
use surfel::points::{
    self, Orientation, PointCloud, Preparation, Radius, SURFACE_VARIATION, Select,
};
use surfel::scene::color::ColorSource;
use surfel_formats::{Column, ColumnChoice, LoadOptions, TextColumn};

#[derive(Args)]
#[command(next_help_heading = "Preparation")]
pub struct PreparationArgs {
    /// Fewer points: first:N, random:N, stride:S or spacing:LENGTH.
    #[arg(long, value_name = "CHOICE", value_parser = select)]
    pub select: Option<Select>,
    /// How neighbours are found: knn, grid or scan-line.
    #[arg(long, value_name = "METHOD", default_value = "knn")]
    neighbors: Method,
    /// Neighbours that a normal is estimated from [default: 16].
    #[arg(long, value_name = "K", conflicts_with = "normals_radius",
        value_parser = clap::value_parser!(u32).range(2..=10_000))]
    normals_k: Option<u32>,
    /// Estimate normals from all neighbours within this distance.
    #[arg(long, value_name = "LENGTH", value_parser = super::parse::positive)]
    normals_radius: Option<f64>,
    /// Which side of the surface is its front: none, up, mst or viewpoint:X,Y,Z.
    #[arg(long, value_name = "RULE", default_value = "none")]
    pub orient: Orientation,
    /// How far each point's surface reaches: a length, adaptive[:K] or median[:N] [default: adaptive:12].
    #[arg(long, value_name = "RADIUS")]
    pub radius: Option<Radius>,
    /// Take the vertices of meshes as points.
    #[arg(long, action = ArgAction::Set, num_args = 0..=1, require_equals = true, value_name = "BOOL",
        default_value = "false", default_missing_value = "true", hide_default_value = true,
        hide_possible_values = true)]
    pub vertices: bool,
    /// Columns of a text file, as in x,y,z,-,r,g,b; found out from the file if not given.
    #[arg(long, value_name = "NAMES")]
    columns: Option<String>,
    /// Whether columns are kept that no picture needs.
    #[arg(skip)]
    pub keeps_all: bool,
}

impl PreparationArgs {
    /// `color` may ask for a column that only the preparation makes.
    pub fn preparation(&self, seed: u64, color: Option<&ColorSource>) -> Preparation {
        let default = Preparation::default();
        let within = self.normals_radius.map(|radius| Query::Within(radius as f32));
        let nearest = self.normals_k.map(|k| Query::Nearest(k as usize));
        Preparation {
            select: self.select,
            neighbors: self.neighbors,
            normals: within.or(nearest).unwrap_or(default.normals),
            orientation: self.orient,
            radius: self.radius.unwrap_or(default.radius),
            keep_variation: matches!(color, Some(ColorSource::Column(name)) if name == SURFACE_VARIATION),
            seed,
        }
    }

    pub fn load_options(&self, columns: ColumnChoice) -> LoadOptions {
        let text_columns = self.columns.as_deref().map(TextColumn::parse_list);
        LoadOptions { columns, text_columns, ..LoadOptions::default() }
    }

    /// Only the columns that a picture of these colours needs.
    pub fn columns(&self, color: Option<&ColorSource>) -> ColumnChoice {
        if self.keeps_all {
            return ColumnChoice::All;
        }
        let mut columns = self.geometry();
        match color {
            None => columns.extend([Column::Colors, Column::Intensity]),
            Some(ColorSource::Rgb) => columns.push(Column::Colors),
            Some(ColorSource::Intensity) => columns.push(Column::Intensity),
            Some(ColorSource::Class) => columns.push(Column::Classification),
            Some(ColorSource::Column(name)) => columns.push(Column::Scalar(name.clone())),
            Some(ColorSource::Elevation | ColorSource::Normal | ColorSource::Constant(_)) => {}
        }
        ColumnChoice::Only(columns)
    }

    /// The columns that say where the surface is, but for those that are to be estimated in a given way.
    pub fn geometry(&self) -> Vec<Column> {
        let normals = (!self.names_normals()).then_some(Column::Normals);
        let radii = self.radius.is_none().then_some(Column::Radii);
        normals.into_iter().chain(radii).collect()
    }

    /// Whether it is said how normals are to be estimated.
    pub fn names_normals(&self) -> bool {
        self.normals_k.is_some() || self.normals_radius.is_some()
    }

    /// Tells how normals were estimated.
    pub fn tell_normals(&self, prepared: &points::Report, report: &Report) {
        if let (Some(found), Some(query)) = (&prepared.normals, prepared.normals_from) {
            let flag = match query {
                Query::Nearest(_) => "--normals-k",
                Query::Within(_) => "--normals-radius",
            };
            report.choice(&found.line(query), flag);
        }
    }

    /// Tells how radii were chosen, if that was not asked for in numbers.
    pub fn tell_radii(&self, prepared: &points::Report, report: &Report) {
        let radius = self.radius.unwrap_or_default();
        if let (Some(found), false) = (&prepared.radii, matches!(radius, Radius::Fixed(_))) {
            report.choice(&found.line(radius), "--radius");
        }
    }

    /// Whether the orientation tells inside and outside of what the points enclose.
    pub fn orients_outward(&self) -> bool {
        self.orient == Orientation::SpanningTree
    }

    /// Drops the normals and radii that are to be estimated in a given way.
    pub fn forget(&self, cloud: &mut PointCloud) {
        if self.names_normals() {
            cloud.normals = None;
        }
        if self.radius.is_some() {
            cloud.radii = None;
        }
    }
}

/// Refuses a selection of nothing, which the library takes at its word.
fn select(text: &str) -> Result<Select, String> {
    match text.parse() {
        Ok(Select::First(0) | Select::Random(0)) => Err("expected at least one point".into()),
        Ok(choice) => Ok(choice),
        Err(error) => Err(error.to_string()),
    }
}
