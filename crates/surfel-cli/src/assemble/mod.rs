//! From files to a graph: what they hold, side by side, prepared, coloured, of the materials asked for.

mod contents;
mod looks;

pub use looks::shine_in_the_dark;

use crate::args::SceneArgs;
use crate::light;
use crate::report::Report;
use crate::scene_file::{CameraMotion, Line};
use crate::sequence::Sequence;
use std::borrow::Cow;
use std::iter::successors;
use std::ops::Range;
use std::path::{Path, PathBuf};
use surfel::points::PointCloud;
use surfel::progress::Progress;
use surfel::scene::{Environment, Geometry, Graph, Points, Transform};
use surfel_formats::Source;

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
