//! From files to a graph: what they hold, side by side, prepared, coloured, of the materials asked for.

use crate::args::{ColorArgs, LightArgs, LightKind, MaterialArgs, PreparationArgs, SurfaceArgs};
use crate::report::Report;
use anyhow::Context;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use surfel::math::Vec3;
use surfel::points::{self, PointCloud, prepare};
use surfel::progress::Progress;
use surfel::scene::color::colorize;
use surfel::scene::{Geometry, Graph, Material, Node, Part, Points};
use surfel_formats::{ColumnChoice, Loaded, Source};

/// What files hold, before it is prepared.
pub struct Assembly {
    pub graph: Graph,
    /// Of all files together.
    pub source: Source,
    /// Each file with the nodes that came from it.
    pub files: Vec<(PathBuf, std::ops::Range<usize>)>,
}

/// How points become surfaces.
pub struct Making<'a> {
    pub surface: &'a SurfaceArgs,
    pub preparation: &'a PreparationArgs,
    pub color: &'a ColorArgs,
    pub material: &'a MaterialArgs,
    pub light: &'a LightArgs,
    pub seed: u64,
    pub up: Vec3,
}

impl Assembly {
    /// Reads all files. Clouds that have no material of their own become one, whose points lie among each
    /// other; everything else stands beside it.
    pub fn load(
        files: &[PathBuf],
        columns: ColumnChoice,
        preparation: &PreparationArgs,
        material: &MaterialArgs,
        report: &Report,
    ) -> anyhow::Result<Self> {
        let options = preparation.load_options(columns);
        let mut assembly =
            Self { graph: Graph::default(), source: Source::default(), files: Vec::new() };
        let (mut merging, mut merged_files, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        for file in files {
            let (graph, source) = if preparation.vertices {
                let Loaded { cloud, source } = surfel_formats::load(file, &options, report)?;
                let points = Points { cloud, ..Points::default() };
                (Graph::of(Geometry::Points(points), Material::MATTE), source)
            } else {
                surfel_formats::load_graph(file, &options, report)?
            };
            report.end_stage();
            let is_alone = material.of_file(file).is_some();
            match into_cloud(graph, is_alone) {
                Ok(cloud) => {
                    merging.push(Loaded { cloud, source: source.clone() });
                    merged_files.push(file.clone());
                }
                Err(graph) => {
                    let first = assembly.graph.append(graph);
                    assembly.files.push((file.clone(), first..assembly.graph.nodes.len()));
                }
            }
            sources.push(source);
        }
        assembly.source = surfel_formats::common_source(&sources);
        if !merging.is_empty() {
            let cloud = surfel_formats::merge_loaded(merging, &merged_files, report).cloud;
            if cloud.is_empty() && files.len() == merged_files.len() {
                return Err(surfel::Error::EmptyCloud).context(name_files(files));
            }
            assembly.add_cloud(cloud, merged_files);
        }
        let told = what_is_told(&assembly.graph);
        report.note(&format!("{}: {told}, {}", name_files(files), assembly.source.format));
        Ok(assembly)
    }

    fn add_cloud(&mut self, cloud: PointCloud, files: Vec<PathBuf>) {
        let points = Points { cloud, ..Points::default() };
        let name = files.first().map_or_else(String::new, |file| file_name(file));
        let mut graph = Graph::of(Geometry::Points(points), Material::MATTE);
        graph.nodes[0].name = name;
        let first = self.graph.append(graph);
        self.files.extend(files.into_iter().map(|file| (file, first..first + 1)));
    }

    /// Points that show where everything is.
    pub fn outline(&self) -> Cow<'_, PointCloud> {
        match (&self.graph.geometries[..], &self.graph.nodes[..]) {
            ([Geometry::Points(points)], [_]) => Cow::Borrowed(&points.cloud),
            _ => Cow::Owned(self.graph.outline()),
        }
    }

    pub fn clouds(&self) -> impl Iterator<Item = &PointCloud> {
        self.graph.geometries.iter().filter_map(|geometry| match geometry {
            Geometry::Points(points) => Some(&points.cloud),
            Geometry::Triangles(_) => None,
        })
    }

    /// Prepares and colours all clouds, and gives everything its material.
    pub fn make(mut self, making: &Making, report: &Report) -> anyhow::Result<Graph> {
        let files: Vec<PathBuf> = self.files.iter().map(|(file, _)| file.clone()).collect();
        for geometry in &mut self.graph.geometries {
            if let Geometry::Points(points) = geometry {
                make_points(points, making, report).with_context(|| name_files(&files))?;
            }
        }
        self.give_materials(making)?;
        Ok(self.graph)
    }

    fn give_materials(&mut self, making: &Making) -> anyhow::Result<()> {
        let Self { graph, files, .. } = self;
        making.material.check_files(files.iter().map(|(file, _)| file.as_path()))?;
        for (file, nodes) in files {
            let Some(material) = making.material.of(file) else { continue };
            let material_idx = graph.materials.len();
            graph.materials.push(material);
            for node in &mut graph.nodes[nodes.clone()] {
                node.parts.iter_mut().for_each(|part: &mut Part| part.material = material_idx);
            }
        }
        if making.light.has(LightKind::None) {
            let lit = graph.materials.iter_mut().filter(|material| **material == Material::MATTE);
            lit.for_each(|material| material.is_unlit = true);
        }
        Ok(())
    }
}

/// The cloud of a graph that holds nothing else and is not to stand alone.
fn into_cloud(mut graph: Graph, is_alone: bool) -> Result<PointCloud, Graph> {
    let is_plain = |node: &Node| node.transform == surfel::scene::Transform::IDENTITY;
    let is_cloud = matches!(graph.geometries[..], [Geometry::Points(_)])
        && graph.nodes.len() == 1
        && graph.nodes.iter().all(is_plain);
    if is_alone || !is_cloud {
        return Err(graph);
    }
    match graph.geometries.pop() {
        Some(Geometry::Points(points)) => Ok(points.cloud),
        Some(other) => {
            graph.geometries.push(other);
            Err(graph)
        }
        None => Err(graph),
    }
}

fn make_points(points: &mut Points, making: &Making, report: &Report) -> anyhow::Result<()> {
    let Making { surface, preparation, color, seed, up, .. } = *making;
    let wanted = color.color.as_ref();
    let cloud = std::mem::take(&mut points.cloud);
    let (cloud, prepared) = prepare(cloud, &preparation.preparation(seed, wanted), report)?;
    report.end_stage();
    tell_prepared(&prepared, preparation, report);
    let report = report.with_flag("--color, --cmap, --range");
    let colors = colorize(&cloud, &color.coloring(up), &report)?;
    let has_outward_normals = preparation.orients_outward();
    *points = Points {
        cloud,
        colors,
        surface: surface.surface,
        boundary: surface.boundary,
        has_outward_normals,
    };
    Ok(())
}

fn tell_prepared(prepared: &points::Report, preparation: &PreparationArgs, report: &Report) {
    if prepared.normals.is_none() {
        report.choice("normals as in the file", "--normals-k");
    }
    preparation.tell_normals(prepared, report);
    if prepared.radii.is_none() {
        report.choice("radii as in the file", "--radius");
    }
    preparation.tell_radii(prepared, report);
}

fn what_is_told(graph: &Graph) -> String {
    let (n_points, n_triangles) = graph.counts();
    match (n_points, n_triangles) {
        (points, 0) => format!("{points} points"),
        (0, triangles) => format!("{triangles} triangles"),
        (points, triangles) => format!("{points} points and {triangles} triangles"),
    }
}

pub fn file_name(file: &Path) -> String {
    file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
}

pub fn name_files(files: &[PathBuf]) -> String {
    match files {
        [] => String::new(),
        [only] => only.display().to_string(),
        [first, more @ ..] => format!("{} and {} more", first.display(), more.len()),
    }
}
