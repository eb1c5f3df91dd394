//! From files to a graph: what they hold, side by side, prepared, coloured, of the materials asked for.

use crate::args::{LightKind, SceneArgs, Usage};
use crate::cloud::{dress, graph_of, into_cloud, load, prepare_points};
use crate::light;
use crate::report::Report;
use crate::scene_file::{CameraMotion, Line, Motion, Object, is_scene_file};
use crate::sequence::{Sequence, Slots, counts, is_read_in_turn};
use anyhow::Context;
use std::borrow::Cow;
use std::iter::successors;
use std::ops::Range;
use std::path::{Path, PathBuf};
use surfel::math::Vec3;
use surfel::points::PointCloud;
use surfel::progress::Progress;
use surfel::scene::{
    Channel, Clip, Environment, Geometry, Graph, Interpolation, Keys, Material, Node, Points,
    Track, Transform,
};
use surfel_formats::{Loaded, Source};

/// What files hold, before it is prepared.
pub struct Assembly<'a> {
    pub graph: Graph,
    /// Of each file.
    pub sources: Vec<Source>,
    pub camera_motion: Option<CameraMotion>,
    /// The picture that gives light, upright.
    pub environment: Option<Environment>,
    args: &'a SceneArgs,
    line: &'a Line,
    /// Each file of the command line with the nodes that came from it.
    files: Vec<(PathBuf, Range<usize>)>,
    /// Objects of scene files that were added.
    objects: Vec<Added>,
    /// Options of their own that objects have, and the index of the object.
    object_args: Vec<(SceneArgs, usize)>,
    /// Of each geometry, the index in `object_args`; none for the scene's own options.
    args_of: Vec<Option<usize>>,
    sequences: Vec<Sequence<'a>>,
}

/// What an object became.
#[derive(Clone)]
struct Added {
    node: usize,
    /// Nodes of its files, without those of its copies.
    content: Range<usize>,
    /// Nodes of its files and copies.
    all: Range<usize>,
}

impl<'a> Assembly<'a> {
    /// Reads all files of the command line and of scene files.
    ///
    /// Clouds of the command line that have no material of their own become one, whose points lie among
    /// each other; everything else stands beside it, meshes before clouds: a material changes no order.
    pub fn load(args: &'a SceneArgs, line: &'a Line, report: &Report) -> anyhow::Result<Self> {
        let mut assembly = Self {
            graph: Graph::default(),
            sources: Vec::new(),
            camera_motion: line.scene.camera_motion.clone(),
            environment: light::environment(&args.light, report)?,
            args,
            line,
            files: Vec::new(),
            objects: Vec::new(),
            object_args: Vec::new(),
            args_of: Vec::new(),
            sequences: Vec::new(),
        };
        assembly.add_files(report)?;
        for object in &line.scene.objects {
            assembly.add_object(object, report)?;
        }
        for lamp in &line.scene.lamps {
            assembly.add_moving(lamp.clone(), &line.scene.motions);
        }
        let told = what_is_told(&assembly.graph);
        let names = name_files(&assembly.all_files());
        report.note(&format!("{names}: {told}, {}", assembly.source().format));
        Ok(assembly)
    }

    /// Of all files together.
    pub fn source(&self) -> Source {
        surfel_formats::common_source(&self.sources)
    }

    /// Until when something moves.
    pub fn duration_secs(&self) -> f64 {
        let camera = self.camera_motion.as_ref().map_or(0.0, CameraMotion::duration_secs);
        let sequences = self.sequences.iter().map(Sequence::duration_secs);
        sequences.fold(self.graph.animation.duration_secs().max(camera), f64::max)
    }

    /// Of each sequence that is read in turn, the number of the file of a time.
    pub fn frames_at(&self, time_secs: f64) -> Vec<usize> {
        self.sequences.iter().map(|sequence| sequence.file_at(time_secs)).collect()
    }

    /// Whether a node of the graph, or one that it hangs on, moves.
    pub fn moves(&self, node: usize) -> bool {
        let above = successors(Some(node), |node| self.graph.nodes[*node].parent);
        let channels = &self.graph.animation.channels;
        above.into_iter().any(|node| channels.iter().any(|channel| channel.node == node))
    }

    /// Files as the command line names them, scene files among them.
    pub fn typed(&self) -> &[PathBuf] {
        &self.args.files
    }

    fn all_files(&self) -> Vec<PathBuf> {
        let files = self.files.iter().map(|(file, _)| file);
        files
            .chain(self.line.scene.objects.iter().flat_map(|object| &object.files))
            .cloned()
            .collect()
    }

    fn add_files(&mut self, report: &Report) -> anyhow::Result<()> {
        let (mut alone, mut merging) = (Vec::new(), (Vec::new(), Vec::new()));
        let files: Vec<&PathBuf> =
            self.args.files.iter().filter(|file| !is_scene_file(file)).collect();
        for &file in &files {
            let (graph, source) = load(file, self.args, report)?;
            self.sources.push(source.clone());
            let is_alone = self.args.material.of_file(file).is_some();
            match into_cloud(graph) {
                Ok(cloud) if is_alone => {
                    alone.push((vec![Loaded { cloud, source }], vec![file.clone()]));
                }
                Ok(cloud) => {
                    merging.0.push(Loaded { cloud, source });
                    merging.1.push(file.clone());
                }
                Err(graph) => {
                    let nodes = self.append(graph, None);
                    self.files.push((file.clone(), nodes));
                }
            }
        }
        for (clouds, files) in alone.into_iter().chain([merging]) {
            if clouds.is_empty() {
                continue;
            }
            let graph = merged(clouds, &files, report)?;
            let nodes = self.append(graph, None);
            self.files.extend(files.into_iter().map(|file| (file, nodes.clone())));
        }
        Ok(())
    }

    /// Puts a graph beside what is here; returns its nodes.
    fn append(&mut self, graph: Graph, object_args: Option<usize>) -> Range<usize> {
        let first = self.graph.append(graph);
        self.args_of.resize(self.graph.geometries.len(), object_args);
        first..self.graph.nodes.len()
    }

    fn add_object(&mut self, object: &'a Object, report: &Report) -> anyhow::Result<()> {
        let line = self.line;
        let before = &line.scene.objects[..self.objects.len()];
        let parent = object.parent.as_ref();
        let parent = parent.and_then(|name| before.iter().position(|other| other.name == *name));
        let node = Node {
            parent: parent.map(|object_idx| self.objects[object_idx].node),
            transform: object.transform,
            is_visible: object.is_visible,
            ..Node::new(&object.name)
        };
        let node = self.add_moving(node, &line.scene.motions);
        let first = self.graph.nodes.len();
        if let Some(twin) = before.iter().position(|other| other.holds_the_same_as(object)) {
            // The same file made in the same way: held once.
            self.graph.add_copy(self.objects[twin].content.clone(), node);
        } else {
            let args = line.for_object(&object.name, &object.options)?;
            self.object_args.push((args, self.objects.len()));
            self.add_content(node, object, report)?;
        }
        let content = first..self.graph.nodes.len();
        for copy in &object.copies {
            let place = Node { parent: Some(node), transform: *copy, ..Node::new(&object.name) };
            let place = self.graph.add(place);
            self.graph.add_copy(content.clone(), place);
        }
        self.objects.push(Added { node, content, all: first..self.graph.nodes.len() });
        Ok(())
    }

    /// Puts what an object's files hold under its node.
    fn add_content(
        &mut self,
        node: usize,
        object: &'a Object,
        report: &Report,
    ) -> anyhow::Result<()> {
        let object_args = self.object_args.len() - 1;
        if is_read_in_turn(object, &self.object_args[object_args].0)? {
            return self.add_sequence(node, object, report);
        }
        let mut merging = Vec::new();
        for (file_idx, file) in object.files.iter().enumerate() {
            let (graph, source) = load(file, &self.object_args[object_args].0, report)?;
            self.sources.push(source.clone());
            if object.is_merged {
                let Ok(cloud) = into_cloud(graph) else {
                    anyhow::bail!("{}: is no cloud, and `merge` is for clouds", file.display());
                };
                merging.push(Loaded { cloud, source });
                continue;
            }
            let above = self.graph.add(Node { parent: Some(node), ..Node::new(file_name(file)) });
            if 1 < object.files.len() {
                self.show_in_turn(above, file_idx, object);
            }
            self.append_below(above, graph, object_args);
        }
        if object.is_merged {
            let graph = merged(merging, &object.files, report)?;
            self.append_below(node, graph, object_args);
        }
        Ok(())
    }

    /// Puts the first file of a sequence under an object's node; the others come in its place.
    fn add_sequence(
        &mut self,
        node: usize,
        object: &'a Object,
        report: &Report,
    ) -> anyhow::Result<()> {
        let args = self.line.for_object(&object.name, &object.options)?;
        let first = &object.files[0];
        let (graph, source) = load(first, &args, report)?;
        self.sources.push(source);
        let above = self.graph.add(Node { parent: Some(node), ..Node::new(file_name(first)) });
        let before = counts(&self.graph);
        self.append_below(above, graph, self.object_args.len() - 1);
        let slots = Slots::behind(before, &self.graph);
        self.sequences.push(Sequence::new(&object.files, object.fps, args, slots));
        Ok(())
    }

    fn append_below(&mut self, above: usize, graph: Graph, object_args: usize) {
        let nodes = self.append(graph, Some(object_args));
        for node in &mut self.graph.nodes[nodes] {
            node.parent.get_or_insert(above);
        }
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
            let center = motion.pivot.unwrap_or(node.transform.matrix().translation);
            let mut middle = Node { parent: node.parent, ..Node::new("") };
            middle.transform = Transform::translated(center);
            let middle = self.graph.add(middle);
            self.add_tracks(middle, motion);
            // Back again, so that keys of the node's own count from where they always do.
            let mut back = Node { parent: Some(middle), ..Node::new("") };
            back.transform = Transform::translated(-center);
            node.parent = Some(self.graph.add(back));
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

    /// Files of the command line, those together that became one cloud.
    pub fn files(&self) -> impl Iterator<Item = Vec<&Path>> {
        let groups = self.files.chunk_by(|(_, a), (_, b)| a == b);
        groups.map(|group| group.iter().map(|(file, _)| file.as_path()).collect())
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

    /// Clouds, with the options that they are made by, and the files that they came from.
    pub fn clouds(&self) -> impl Iterator<Item = (&PointCloud, &SceneArgs, &[PathBuf])> {
        self.graph.geometries.iter().zip(&self.args_of).filter_map(|(geometry, object_args)| {
            match geometry {
                Geometry::Points(points) => {
                    let (args, files) = self.args(*object_args);
                    Some((&points.cloud, args, files))
                }
                Geometry::Triangles(_) => None,
            }
        })
    }

    fn args(&self, object_args: Option<usize>) -> (&SceneArgs, &[PathBuf]) {
        match object_args {
            Some(i) => {
                let (args, object_idx) = &self.object_args[i];
                (args, &self.line.scene.objects[*object_idx].files)
            }
            None => (self.args, &self.args.files),
        }
    }

    /// Prepares and colours all clouds, hides what is clipped, and gives everything its material.
    pub fn make(mut self, up: Vec3, report: &Report) -> anyhow::Result<(Graph, Vec<Sequence<'a>>)> {
        let mut clouds = Vec::new();
        for geometry_idx in 0..self.graph.geometries.len() {
            if let Geometry::Points(points) = &mut self.graph.geometries[geometry_idx] {
                let cloud = std::mem::take(&mut points.cloud);
                let (args, files) = self.args(self.args_of[geometry_idx]);
                let prepared = prepare_points(cloud, args, report);
                clouds.push(prepared.with_context(|| name_files(files))?);
            }
        }
        self.dress(clouds, up, report)
    }

    /// Colours clouds that are prepared, in the order of the graph, and gives everything its material.
    pub fn dress(
        mut self,
        clouds: Vec<PointCloud>,
        up: Vec3,
        report: &Report,
    ) -> anyhow::Result<(Graph, Vec<Sequence<'a>>)> {
        let mut clouds = clouds.into_iter();
        let mut geometries = std::mem::take(&mut self.graph.geometries);
        for (geometry, object_args) in geometries.iter_mut().zip(&self.args_of) {
            if let Geometry::Points(points) = geometry {
                let (args, files) = self.args(*object_args);
                let dressed = dress(clouds.next().unwrap_or_default(), args, up, report);
                *points = dressed.with_context(|| name_files(files))?;
            }
        }
        self.graph.geometries = geometries;
        self.clip()?;
        self.give_materials()?;
        Ok((self.graph, self.sequences))
    }

    /// The same files, which are read already, under other options; their points stay here.
    pub fn under<'o>(&self, args: &'o SceneArgs, line: &'o Line) -> anyhow::Result<Assembly<'o>> {
        let object_args = |(_, object_idx): &(SceneArgs, usize)| {
            let object = &line.scene.objects[*object_idx];
            Ok((line.for_object(&object.name, &object.options)?, *object_idx))
        };
        let sequence = |sequence: &Sequence| {
            let object_args = self.args_of[sequence.slots.geometries[0]];
            let object_idx = object_args.map_or(0, |i| self.object_args[i].1);
            let object = &line.scene.objects[object_idx];
            let args = line.for_object(&object.name, &object.options)?;
            Ok(Sequence::new(&object.files, object.fps, args, sequence.slots.clone()))
        };
        Ok(Assembly {
            graph: without_points(&self.graph),
            sources: self.sources.clone(),
            camera_motion: self.camera_motion.clone(),
            environment: self.environment.clone(),
            args,
            line,
            files: self.files.clone(),
            objects: self.objects.clone(),
            object_args: self.object_args.iter().map(object_args).collect::<anyhow::Result<_>>()?,
            args_of: self.args_of.clone(),
            sequences: self.sequences.iter().map(sequence).collect::<anyhow::Result<_>>()?,
        })
    }

    fn clip(&mut self) -> anyhow::Result<()> {
        let places = self.graph.world_from_geometries();
        for sequence in &mut self.sequences {
            sequence.world_from_file = places[sequence.slots.geometries[0]];
        }
        let args = self.args_of.iter().map(|object_args| self.args(*object_args).0);
        let clips: Vec<Clip> = args.map(|args| args.clip.clip()).collect();
        clip(&mut self.graph, &clips)?;
        Ok(())
    }

    fn give_materials(&mut self) -> anyhow::Result<()> {
        let Self { graph, files, args, objects, sequences, .. } = self;
        let of_files = files
            .iter()
            .map(|(file, nodes)| (nodes, args.material.of(file).map(|choice| &choice.material)));
        let of_objects = objects.iter().zip(&self.line.scene.objects);
        let of_objects =
            of_objects.map(|(added, object)| (&added.all, object.material(&args.material)));
        for (nodes, material) in of_files.chain(of_objects) {
            let Some(material) = material else { continue };
            let material_idx = graph.materials.len();
            graph.materials.push(material.clone());
            for node in &mut graph.nodes[nodes.clone()] {
                node.parts.iter_mut().for_each(|part| part.material = material_idx);
            }
        }
        let has_lamps = graph.nodes.iter().any(|node| node.lamp.is_some());
        let is_lit = !args.light.has(LightKind::None) || args.light.environment.is_some();
        let is_dark = !is_lit && !has_lamps;
        if is_dark {
            shine_in_the_dark(&mut graph.materials);
        }
        sequences.iter_mut().for_each(|sequence| sequence.settle(graph, is_dark));
        Ok(())
    }
}

/// Lets what would be black without light show its colours as they are.
pub fn shine_in_the_dark(materials: &mut [Material]) {
    let black = materials.iter_mut().filter(|material| needs_light(material));
    black.for_each(|material| material.is_unlit = true);
}

/// Hides a part of each geometry, as `Graph::clip` does, but not everything.
pub fn clip(graph: &mut Graph, clips: &[Clip]) -> anyhow::Result<Vec<Option<Vec<u32>>>> {
    let kept = graph.clip(clips);
    let with_box = clips.iter().any(|clip| clip.bounds.is_some()).then_some("--clip-box");
    let with_plane = clips.iter().any(|clip| clip.plane.is_some()).then_some("--clip-plane");
    let options: Vec<&str> = with_box.into_iter().chain(with_plane).collect();
    if !options.is_empty() && graph.counts() == (0, 0) {
        let advice = "nothing is left to be seen; `surfel info` tells where the points lie";
        return Err(Usage(format!("{}: {advice}", options.join(", "))).into());
    }
    Ok(kept)
}

/// Whether something is black without light: it neither shines nor shows what is around or behind it.
fn needs_light(material: &Material) -> bool {
    let reflects = 0.5 < material.metallic && material.roughness < 1.0;
    let shines = 0.0 < material.glow || material.emissive != Vec3::ZERO;
    !reflects && !shines && material.transmission == 0.0
}

fn without_points(graph: &Graph) -> Graph {
    let geometries = graph.geometries.iter().map(|geometry| match geometry {
        Geometry::Points(points) => {
            let cloud = PointCloud { origin: points.cloud.origin, ..PointCloud::default() };
            Geometry::Points(Points { cloud, ..Points::default() })
        }
        Geometry::Triangles(mesh) => Geometry::Triangles(mesh.clone()),
    });
    Graph {
        geometries: geometries.collect(),
        nodes: graph.nodes.clone(),
        materials: graph.materials.clone(),
        textures: graph.textures.clone(),
        animation: graph.animation.clone(),
    }
}

/// Clouds as one, whose points lie among each other.
fn merged(clouds: Vec<Loaded>, files: &[PathBuf], report: &Report) -> anyhow::Result<Graph> {
    let cloud = surfel_formats::merge_loaded(clouds, files, report).cloud;
    if cloud.is_empty() {
        return Err(surfel::Error::EmptyCloud).context(name_files(files));
    }
    let mut graph = graph_of(cloud);
    graph.nodes[0].name = file_name(&files[0]);
    Ok(graph)
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
