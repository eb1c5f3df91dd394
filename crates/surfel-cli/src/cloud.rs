//! Clouds from the file to a surface: read, prepared, coloured.

use crate::args::{PreparationArgs, SceneArgs};
use crate::report::Report;
use std::path::Path;
use surfel::math::Vec3;
use surfel::points::{self, PointCloud, prepare};
use surfel::scene::color::colorize;
use surfel::scene::{Geometry, Graph, Material, Points, Transform};
use surfel_formats::{LoadOptions, Loaded, Source};

/// What a file holds, before it is prepared.
pub fn load(file: &Path, args: &SceneArgs, report: &Report) -> anyhow::Result<(Graph, Source)> {
    let columns = args.preparation.columns(args.color.color.as_ref());
    let animation = args.animation_name.clone();
    let options = LoadOptions { animation, ..args.preparation.load_options(columns) };
    let loaded = if args.preparation.vertices {
        let Loaded { cloud, source } = surfel_formats::load(file, &options, report)?;
        (graph_of(cloud), source)
    } else {
        surfel_formats::load_graph(file, &options, report)?
    };
    report.end_stage();
    Ok(loaded)
}

pub fn graph_of(cloud: PointCloud) -> Graph {
    Graph::of(Geometry::Points(Points { cloud, ..Points::default() }), Material::MATTE)
}

/// The cloud of a graph that holds nothing else.
pub fn into_cloud(mut graph: Graph) -> Result<PointCloud, Graph> {
    let is_in_place = matches!(&graph.nodes[..], [node] if node.transform == Transform::IDENTITY);
    let is_cloud = matches!(graph.geometries[..], [Geometry::Points(_)]);
    if !is_cloud || !is_in_place {
        return Err(graph);
    }
    match graph.geometries.pop() {
        Some(Geometry::Points(points)) => Ok(points.cloud),
        _ => Err(graph),
    }
}

/// Prepares a cloud, and gives it its surface and colours.
pub fn make_points(
    cloud: PointCloud,
    args: &SceneArgs,
    up: Vec3,
    report: &Report,
) -> anyhow::Result<Points> {
    dress(prepare_points(cloud, args, report)?, args, up, report)
}

/// Cleans a cloud, and adds the normals and radii that are missing.
pub fn prepare_points(
    cloud: PointCloud,
    args: &SceneArgs,
    report: &Report,
) -> anyhow::Result<PointCloud> {
    let preparation = args.preparation.preparation(args.picture.seed, args.color.color.as_ref());
    let (cloud, prepared) = prepare(cloud, &preparation, report)?;
    report.end_stage();
    tell_prepared(&prepared, &args.preparation, report);
    Ok(cloud)
}

/// Gives a prepared cloud its surface and colours.
pub fn dress(
    mut cloud: PointCloud,
    args: &SceneArgs,
    up: Vec3,
    report: &Report,
) -> anyhow::Result<Points> {
    args.surface.scale_radii(&mut cloud);
    let report = report.with_flag("--color, --cmap, --range");
    Ok(Points {
        colors: colorize(&cloud, &args.color.coloring(up), &report)?,
        cloud,
        surface: args.surface.surface,
        boundary: args.surface.boundary,
        has_outward_normals: args.preparation.orients_outward(),
    })
}

/// Tells where normals and radii come from.
pub fn tell_prepared(prepared: &points::Report, args: &PreparationArgs, report: &Report) {
    if prepared.normals.is_none() {
        report.choice("normals as in the file", "--normals-k");
    }
    args.tell_normals(prepared, report);
    if prepared.radii.is_none() {
        report.choice("radii as in the file", "--radius");
    }
    args.tell_radii(prepared, report);
}
