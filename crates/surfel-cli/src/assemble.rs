//! From files to a graph: what they hold, side by side, prepared, coloured, of the materials asked for.

use crate::args::{LightKind, SceneArgs};
use crate::report::Report;
use crate::scene_file::{CameraMotion, Line, Motion, Object, is_scene_file};
use anyhow::Context;
use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};
use surfel::math::{DAffine3, Vec3};
use surfel::points::{self, PointCloud, prepare};
use surfel::progress::Progress;
use surfel::scene::color::colorize;
use surfel::scene::{
    Channel, Geometry, Graph, Interpolation, Keys, Material, Node, Points, Track, Transform,
};
use surfel_formats::{Loaded, Source};

/// What files hold, before it is prepared.
pub struct Assembly<'a> {
    pub graph: Graph,
    /// Of all files together.
    pub source: Source,
    pub camera_motion: Option<CameraMotion>,
    args: &'a SceneArgs,
    /// Each file of the command line with the nodes that came from it.
    files: Vec<(PathBuf, Range<usize>)>,
    /// Options of their own that objects have.
    object_args: Vec<SceneArgs>,
    /// Of each geometry, the index in `object_args`; none for the scene's own options.
    args_of: Vec<Option<usize>>,
    materials: Vec<(Range<usize>, Material)>,
    sources: Vec<Source>,
}

impl<'a> Assembly<'a> {
    /// Reads all files of the command line and of scene files.
    ///
    /// Clouds of the command line that have no material of their own become one, whose points lie among
    /// each other; everything else stands beside it.
    pub fn load(args: &'a SceneArgs, line: &Line, report: &Report) -> anyhow::Result<Self> {
        let mut assembly = Self {
            graph: Graph::default(),
            source: Source::default(),
            camera_motion: line.scene.camera_motion.clone(),
            args,
            files: Vec::new(),
            object_args: Vec::new(),
            args_of: Vec::new(),
            materials: Vec::new(),
            sources: Vec::new(),
        };
        let files = args.files.iter().filter(|file| !is_scene_file(file));
        let names = line.scene.objects.iter().map(|object| Path::new(&object.name));
        args.material.check_names(files.map(PathBuf::as_path).chain(names))?;
        assembly.add_files(report)?;
        for (object_idx, object) in line.scene.objects.iter().enumerate() {
            assembly.add_object(&line.scene.objects[..object_idx], object, line, report)?;
        }
        for lamp in &line.scene.lamps {
            let transform = lamp.transform;
            let node = Node { transform, ..lamp.clone() };
            assembly.add_moving(node, &line.scene.motions);
        }
        assembly.source = surfel_formats::common_source(&assembly.sources);
        let told = what_is_told(&assembly.graph);
        let names = name_files(&assembly.all_files(line));
        report.note(&format!("{names}: {told}, {}", assembly.source.format));
        Ok(assembly)
    }

    fn all_files(&self, line: &Line) -> Vec<PathBuf> {
        let files = self.files.iter().map(|(file, _)| file);
        files.chain(line.scene.objects.iter().flat_map(|object| &object.files)).cloned().collect()
    }

    fn add_files(&mut self, report: &Report) -> anyhow::Result<()> {
        let (mut merging, mut merged_files) = (Vec::new(), Vec::new());
        let files: Vec<&PathBuf> =
            self.args.files.iter().filter(|file| !is_scene_file(file)).collect();
        for &file in &files {
            let (graph, source) = load(file, self.args, report)?;
            match into_cloud(graph, self.args.material.of_file(file).is_some()) {
                Ok(cloud) => {
                    merging.push(Loaded { cloud, source: source.clone() });
                    merged_files.push(file.clone());
                }
                Err(graph) => {
                    let nodes = self.append(graph, None);
                    self.files.push((file.clone(), nodes));
                }
            }
            self.sources.push(source);
        }
        if merging.is_empty() {
            return Ok(());
        }
        let cloud = surfel_formats::merge_loaded(merging, &merged_files, report).cloud;
        if cloud.is_empty() {
            return Err(surfel::Error::EmptyCloud).context(name_files(&merged_files));
        }
        let mut graph = Graph::of(Geometry::Points(of_cloud(cloud)), Material::MATTE);
        graph.nodes[0].name = file_name(&merged_files[0]);
        let nodes = self.append(graph, None);
        self.files.extend(merged_files.into_iter().map(|file| (file, nodes.clone())));
        Ok(())
    }

    /// Puts a graph beside what is here; returns its nodes.
    fn append(&mut self, graph: Graph, object_args: Option<usize>) -> Range<usize> {
        let first = self.graph.append(graph);
        self.args_of.resize(self.graph.geometries.len(), object_args);
        first..self.graph.nodes.len()
    }

    fn add_object(
        &mut self,
        before: &[Object],
        object: &Object,
        line: &Line,
        report: &Report,
    ) -> anyhow::Result<()> {
        let node = Node {
            parent: object.parent.as_ref().and_then(|name| self.node_named(name)),
            transform: object.transform,
            is_visible: object.is_visible,
            ..Node::new(&object.name)
        };
        let node = self.add_moving(node, &line.scene.motions);
        let first = self.graph.nodes.len();
        let twin = before
            .iter()
            .find(|other| other.files == object.files && other.look.options == object.look.options);
        if let Some(content) = twin.and_then(|twin| self.content_of(&twin.name)) {
            // The same file made in the same way: held once.
            self.graph.add_copy(content, node);
        } else {
            let args = line.for_object(&object.name, &object.look.options)?;
            self.object_args.push(args);
            for (file_idx, file) in object.files.iter().enumerate() {
                let object_args = self.object_args.len() - 1;
                let (graph, source) = load(file, &self.object_args[object_args], report)?;
                self.sources.push(source);
                let above =
                    self.graph.add(Node { parent: Some(node), ..Node::new(file_name(file)) });
                if 1 < object.files.len() {
                    self.show_in_turn(above, file_idx, object);
                }
                let nodes = self.append(graph, Some(object_args));
                for node in &mut self.graph.nodes[nodes] {
                    node.parent.get_or_insert(above);
                }
            }
        }
        let content = first..self.graph.nodes.len();
        for copy in &object.copies {
            let place = Node { parent: Some(node), transform: *copy, ..Node::new(&object.name) };
            let place = self.graph.add(place);
            self.graph.add_copy(content.clone(), place);
        }
        let nodes = first..self.graph.nodes.len();
        // One for this very object before its own, its own before one for all.
        let asked = &self.args.material;
        let material = asked.of_name(&object.name).or_else(|| object.look.material.clone());
        let material = material.or_else(|| asked.of_all());
        self.materials.extend(material.map(|material| (nodes, material)));
        Ok(())
    }

    /// Shows a file of a sequence for its time; the last one stays.
    fn show_in_turn(&mut self, node: usize, file_idx: usize, object: &Object) {
        let (start, end) = (file_idx as f64 / object.fps, (file_idx + 1) as f64 / object.fps);
        let is_last = file_idx + 1 == object.files.len();
        let mut keys = vec![(start, true), (end, is_last)];
        if 0 < file_idx {
            keys.insert(0, (0.0, false));
        }
        let keys = Keys {
            times_secs: keys.iter().map(|(time, _)| *time).collect(),
            values: keys.iter().map(|(_, visible)| *visible).collect(),
            interpolation: Interpolation::Step,
        };
        self.graph.animation.channels.push(Channel { node, track: Track::Visible(keys) });
    }

    /// Adds a node with what moves it. One that orbits hangs on another that stands in the middle.
    fn add_moving(&mut self, mut node: Node, motions: &[Motion]) -> usize {
        let name = node.name.clone();
        let motions = motions.iter().filter(|motion| motion.object == name);
        for motion in motions.clone().filter(|motion| motion.is_orbit) {
            let matrix = node.transform.matrix();
            let center = motion.pivot.unwrap_or(matrix.translation);
            let mut middle = Node { parent: node.parent, ..Node::new("") };
            middle.transform = Transform::translated(center);
            let middle = self.graph.add(middle);
            node.parent = Some(middle);
            node.transform = Transform::Matrix(DAffine3::from_translation(-center) * matrix);
            self.add_tracks(middle, motion);
        }
        let node = self.graph.add(node);
        for motion in motions.filter(|motion| !motion.is_orbit) {
            self.add_tracks(node, motion);
        }
        node
    }

    fn add_tracks(&mut self, node: usize, motion: &Motion) {
        let channels = motion.tracks.iter().map(|track| Channel { node, track: track.clone() });
        self.graph.animation.channels.extend(channels);
    }

    fn node_named(&self, name: &str) -> Option<usize> {
        self.graph.nodes.iter().position(|node| node.name == name)
    }

    /// The nodes of an object's files, without those of its copies.
    fn content_of(&self, name: &str) -> Option<Range<usize>> {
        let node = self.node_named(name)?;
        let is_below = |mut i: usize| loop {
            match self.graph.nodes[i].parent {
                Some(parent) if parent == node => return true,
                Some(parent) => i = parent,
                None => return false,
            }
        };
        let end = (node + 1..self.graph.nodes.len()).find(|&i| {
            !is_below(i) || (self.graph.nodes[i].parent == Some(node) && self.is_copy(i, name))
        });
        Some(node + 1..end.unwrap_or(self.graph.nodes.len()))
    }

    fn is_copy(&self, node: usize, name: &str) -> bool {
        self.graph.nodes[node].name == name
    }

    /// Points that show where everything is.
    pub fn outline(&self) -> Cow<'_, PointCloud> {
        match (&self.graph.geometries[..], &self.graph.nodes[..]) {
            ([Geometry::Points(points)], [node]) if node.transform == Transform::IDENTITY => {
                Cow::Borrowed(&points.cloud)
            }
            _ => Cow::Owned(self.graph.outline()),
        }
    }

    /// Clouds, with the options that they are made by.
    pub fn clouds(&self) -> impl Iterator<Item = (&PointCloud, &SceneArgs)> {
        self.graph.geometries.iter().zip(&self.args_of).filter_map(
            |(geometry, args)| match geometry {
                Geometry::Points(points) => Some((&points.cloud, self.args(*args))),
                Geometry::Triangles(_) => None,
            },
        )
    }

    fn args(&self, object_args: Option<usize>) -> &SceneArgs {
        object_args.map_or(self.args, |i| &self.object_args[i])
    }

    /// Prepares and colours all clouds, and gives everything its material.
    pub fn make(mut self, up: Vec3, report: &Report) -> anyhow::Result<Graph> {
        let mut geometries = std::mem::take(&mut self.graph.geometries);
        for (geometry, args) in geometries.iter_mut().zip(&self.args_of) {
            if let Geometry::Points(points) = geometry {
                let args = self.args(*args);
                make_points(points, args, self.args.picture.seed, up, report)
                    .with_context(|| name_files(&self.args.files))?;
            }
        }
        self.graph.geometries = geometries;
        self.give_materials()?;
        Ok(self.graph)
    }

    fn give_materials(&mut self) -> anyhow::Result<()> {
        let Self { graph, files, args, materials, .. } = self;
        let of_files = files.iter().filter_map(|(file, nodes)| {
            args.material.of(file).map(|material| (nodes.clone(), material))
        });
        let of_files: Vec<_> = of_files.collect();
        for (nodes, material) in of_files.into_iter().chain(materials.drain(..)) {
            let material_idx = graph.materials.len();
            graph.materials.push(material);
            for node in &mut graph.nodes[nodes] {
                node.parts.iter_mut().for_each(|part| part.material = material_idx);
            }
        }
        let has_lamps = graph.nodes.iter().any(|node| node.lamp.is_some());
        if args.light.has(LightKind::None) && !has_lamps {
            let lit = graph.materials.iter_mut().filter(|material| **material == Material::MATTE);
            lit.for_each(|material| material.is_unlit = true);
        }
        Ok(())
    }
}

fn load(file: &Path, args: &SceneArgs, report: &Report) -> anyhow::Result<(Graph, Source)> {
    let columns = args.preparation.columns(args.color.color.as_ref());
    let options = args.preparation.load_options(columns);
    let loaded = if args.preparation.vertices {
        let Loaded { cloud, source } = surfel_formats::load(file, &options, report)?;
        (Graph::of(Geometry::Points(of_cloud(cloud)), Material::MATTE), source)
    } else {
        surfel_formats::load_graph(file, &options, report)?
    };
    report.end_stage();
    Ok(loaded)
}

fn of_cloud(cloud: PointCloud) -> Points {
    Points { cloud, ..Points::default() }
}

/// The cloud of a graph that holds nothing else and is not to stand alone.
fn into_cloud(mut graph: Graph, is_alone: bool) -> Result<PointCloud, Graph> {
    let is_in_place = matches!(&graph.nodes[..], [node] if node.transform == Transform::IDENTITY);
    let is_cloud = matches!(graph.geometries[..], [Geometry::Points(_)]);
    if is_alone || !is_cloud || !is_in_place {
        return Err(graph);
    }
    match graph.geometries.pop() {
        Some(Geometry::Points(points)) => Ok(points.cloud),
        _ => Err(graph),
    }
}

fn make_points(
    points: &mut Points,
    args: &SceneArgs,
    seed: u64,
    up: Vec3,
    report: &Report,
) -> anyhow::Result<()> {
    let cloud = std::mem::take(&mut points.cloud);
    let preparation = args.preparation.preparation(seed, args.color.color.as_ref());
    let (cloud, prepared) = prepare(cloud, &preparation, report)?;
    report.end_stage();
    tell_prepared(&prepared, args, report);
    let report = report.with_flag("--color, --cmap, --range");
    let colors = colorize(&cloud, &args.color.coloring(up), &report)?;
    *points = Points {
        cloud,
        colors,
        surface: args.surface.surface,
        boundary: args.surface.boundary,
        has_outward_normals: args.preparation.orients_outward(),
    };
    Ok(())
}

fn tell_prepared(prepared: &points::Report, args: &SceneArgs, report: &Report) {
    if prepared.normals.is_none() {
        report.choice("normals as in the file", "--normals-k");
    }
    args.preparation.tell_normals(prepared, report);
    if prepared.radii.is_none() {
        report.choice("radii as in the file", "--radius");
    }
    args.preparation.tell_radii(prepared, report);
}

fn what_is_told(graph: &Graph) -> String {
    match graph.counts() {
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
