//! The content of all files of a description, side by side in one graph, before it is prepared.

mod add_content;
mod checks;
mod filtered;
mod shown_points;
mod up_parts;
mod without_effect;

pub(crate) use without_effect::{report_unused_of_files, report_unused_structure};

use super::camera::{camera_motion, keep_named_camera};
use super::check_files::check_files;
use super::cloud::{check_empty, filter_cloud, prepare_cloud};
use super::environment::load_environment;
use super::sequence::Sequence;
use crate::description::{
    CameraMotion, Invalid, ObjectMotion, ObjectSettings, SceneDescription, twins,
};
use crate::error::{Error, Result};
use crate::file_names::list_files;
use std::collections::BTreeMap;
use std::iter::successors;
use std::ops::Range;
use std::path::{Path, PathBuf};
use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, PreparedCloud};
use surfel_core::progress::Progress;
use surfel_core::scene::color::{ColorSource, choose_source};
use surfel_core::scene::{Environment, Geometry, Graph, Track, Transform};
use surfel_core::words::counted;
use surfel_formats::FileInfo;
use up_parts::UpParts;

/// The content of the files of a description, before it is prepared.
///
/// Further descriptions of the same files and objects, with other settings, can be resolved from it.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// All geometries, as they were read.
    pub graph: Graph<PointCloud>,
    /// Facts that each file states about itself.
    pub file_infos: Vec<FileInfo>,
    /// The files that were read, as they were read.
    pub read_files: Vec<LoadedFile>,
    /// Movement of the camera.
    pub(super) camera_motion: Option<CameraMotion>,
    /// The environment map, upright.
    pub(super) environment: Option<Environment>,
    /// Each file without an object, with the nodes that came from it.
    pub(super) files: Vec<(PathBuf, Range<usize>)>,
    /// Objects of the description, in their order.
    pub(super) objects: Vec<ObjectNodes>,
    /// Index of the object of each geometry; none for files without an object.
    owners: Vec<Option<usize>>,
    /// Sequences whose files are read one by one.
    pub(super) sequences: Vec<Sequence>,
    /// For each cloud of several files, by its geometry, the number of points up to the end of each file.
    file_ends: BTreeMap<usize, Vec<usize>>,
    keeps_all_columns: bool,
    /// True if points that the description does not keep were dropped.
    is_filtered: bool,
    /// Parts of the graph that depend on up.
    pub(super) up_parts: UpParts,
}

/// The content of a file, and what was unusual about it.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Number of points.
    pub n_points: usize,
    /// Number of triangles.
    pub n_triangles: usize,
    /// Least and greatest coordinates in the file's own coordinate system, outliers aside.
    pub bounds: [DVec3; 2],
    /// Lines of the reader, as of what was repaired or left out.
    pub notes: Vec<String>,
}

/// Data of the files that are kept besides those that a picture needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KeepOptions {
    /// Keeps all columns of clouds; otherwise only those that the picture needs.
    pub all_columns: bool,
    /// Keeps the index that each point has among those that were read.
    pub source_indices: bool,
}

/// The nodes of an object.
#[derive(Clone, Debug)]
pub(super) struct ObjectNodes {
    pub node: usize,
    /// Nodes of its files, without those of its instances.
    content: Range<usize>,
    /// Nodes of its files and instances.
    pub all: Range<usize>,
}

impl LoadedScene {
    /// Reads all files of a description, if memory suffices and they have what is asked for, and moves everything to
    /// where it is at second 0.
    ///
    /// Clouds without an object and a material of their own become one, whose points lie among each other; everything
    /// else stands beside it, meshes before clouds: a material changes no order.
    ///
    /// # Errors
    ///
    /// Fails for missing and broken files, for columns that are not there, and past the memory limit.
    pub fn read(
        description: &SceneDescription,
        keep: KeepOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        check_files(description)?;
        let mut scene = Self {
            graph: Graph::default(),
            file_infos: Vec::new(),
            read_files: Vec::new(),
            camera_motion: camera_motion(description)?,
            environment: load_environment(description, progress)?,
            files: Vec::new(),
            objects: Vec::new(),
            owners: Vec::new(),
            sequences: Vec::new(),
            file_ends: BTreeMap::new(),
            keeps_all_columns: keep.all_columns,
            is_filtered: !keep.all_columns,
            up_parts: UpParts::default(),
        };
        let motions = object_motions(description)?;
        scene.add_files(description, progress)?;
        for (object, twin) in description.objects.iter().zip(twins(&description.objects)) {
            scene.add_object(object, twin, description, &motions, progress)?;
        }
        for lamp in &description.lamps {
            let node = scene.add_animated(lamp.node()?, &motions);
            if lamp.shines_from_above() {
                scene.up_parts.lamps.push(node);
            }
        }
        let summary = content_summary(&scene.graph);
        let names = list_files(&scene.all_files(description));
        progress.note(&format!("{names}: {summary}, {}", scene.file_info().format));
        scene.check_memory(description)?;
        scene.check_colors(description)?;
        scene.report_unused(description, progress);
        if keep.source_indices {
            scene.number_points();
        }
        scene.graph.evaluate_at(0.0);
        if let Some(name) = &description.camera.name {
            keep_named_camera(&mut scene.graph, name)?;
        }
        Ok(scene)
    }

    /// Returns a copy with the objects of a description that this scene lacks, which stand behind those that it has. All
    /// points keep the indices that they have among those that were read.
    ///
    /// # Errors
    ///
    /// Fails as reading does.
    pub(crate) fn with_further_objects(
        &self,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut scene = self.clone();
        let objects = description.objects.iter().zip(twins(&description.objects));
        for (object, twin) in objects.skip(self.objects.len()) {
            scene.add_object(object, twin, description, &[], progress)?;
        }
        scene.check_memory(description)?;
        scene.check_colors(description)?;
        scene.number_points();
        scene.graph.evaluate_at(0.0);
        Ok(scene)
    }

    fn number_points(&mut self) {
        for geometry in &mut self.graph.geometries {
            if let Geometry::Points(cloud) = geometry {
                cloud.source_indices = Some((0..cloud.len() as u32).collect());
            }
        }
    }

    /// Returns what all files together say about themselves.
    pub fn file_info(&self) -> FileInfo {
        surfel_formats::common_file_info(&self.file_infos)
    }

    /// Returns the time of the last movement in seconds.
    pub fn duration_secs(&self) -> f64 {
        let camera = self.camera_motion.as_ref().map_or(0.0, CameraMotion::duration_secs);
        let sequences = self.sequences.iter().map(Sequence::duration_secs);
        sequences.fold(self.graph.animation.duration_secs().max(camera), f64::max)
    }

    /// Returns the index of the file that each streamed sequence shows at a time.
    pub fn sequence_frames_at(&self, time_secs: f64) -> Vec<usize> {
        self.sequences.iter().map(|sequence| sequence.file_at(time_secs)).collect()
    }

    /// Returns true if anything in the scene moves, or the camera.
    pub(super) fn moves(&self) -> bool {
        !self.sequences.is_empty()
            || self.camera_motion.is_some()
            || !self.graph.animation.channels.is_empty()
    }

    /// Returns true if a node of the graph, or one of its parents, moves.
    pub fn is_animated(&self, node: usize) -> bool {
        let above = successors(Some(node), |node| self.graph.nodes[*node].parent);
        let channels = &self.graph.animation.channels;
        above.into_iter().any(|node| channels.iter().any(|channel| channel.node == node))
    }

    fn all_files(&self, description: &SceneDescription) -> Vec<PathBuf> {
        let files = self.files.iter().map(|(file, _)| file);
        files.chain(description.objects.iter().flat_map(|object| &object.files)).cloned().collect()
    }

    /// Returns true if objects show files of a sequence one after the other.
    pub fn has_sequences(&self) -> bool {
        !self.sequences.is_empty()
    }

    /// Returns true if the content of a geometry of the graph is that of the first file of a sequence.
    pub fn is_of_sequence(&self, geometry_idx: usize) -> bool {
        self.sequences.iter().any(|sequence| sequence.slots.geometries.contains(&geometry_idx))
    }

    /// Returns the files without an object; those together that became one cloud.
    pub fn file_groups(&self) -> impl Iterator<Item = Vec<&Path>> {
        let groups = self.files.chunk_by(|(_, a), (_, b)| a == b);
        groups.map(|group| group.iter().map(|(file, _)| file.as_path()).collect())
    }

    /// Returns the number of what a node belongs to: 0 is all files without an object, if there are any; the objects follow
    /// in their order.
    pub(crate) fn content_of(&self, node: usize) -> Option<usize> {
        if self.files.iter().any(|(_, nodes)| nodes.contains(&node)) {
            return Some(0);
        }
        let object_idx = self.objects.iter().position(|object| object.all.contains(&node))?;
        Some(object_idx + usize::from(!self.files.is_empty()))
    }

    /// Returns the nodes of objects in the scene's graph, and whether each is visible under another description of the
    /// same objects. Movements decide about nodes that appear and vanish.
    pub(super) fn visibility<C>(
        &self,
        graph: &Graph<C>,
        description: &SceneDescription,
    ) -> Vec<(usize, bool)> {
        let vanishes = |node: usize| {
            let mut channels = graph.animation.channels.iter();
            channels
                .any(|channel| channel.node == node && matches!(channel.track, Track::Visible(_)))
        };
        let objects = self.objects.iter().zip(&description.objects);
        let visible = objects.map(|(nodes, object)| (nodes.node, object.visible()));
        visible.filter(|(node, _)| !vanishes(*node)).collect()
    }

    /// Returns points that show where an object of the description is at second 0.
    pub fn sample_points_of_object(&self, object_idx: usize) -> PointCloud {
        let is_chosen = |node: usize| self.objects[object_idx].all.contains(&node);
        let chosen: Vec<bool> = (0..self.graph.nodes.len()).map(is_chosen).collect();
        self.graph.sample_points_of(&chosen)
    }

    /// Returns the cloud of a scene that has nothing else, if it is in the coordinates of its files.
    pub(super) fn single_cloud(&self) -> Option<&PointCloud> {
        match (&self.graph.geometries[..], &self.graph.nodes[..]) {
            ([Geometry::Points(cloud)], [node]) if node.transform == Transform::IDENTITY => {
                Some(cloud)
            }
            _ => None,
        }
    }

    /// Returns the clouds with the index of their geometry.
    pub fn clouds(&self) -> impl Iterator<Item = (usize, &PointCloud)> {
        let geometries = self.graph.geometries.iter().enumerate();
        geometries.filter_map(|(i, geometry)| match geometry {
            Geometry::Points(cloud) => Some((i, cloud)),
            Geometry::Triangles(_) => None,
        })
    }

    /// Returns the settings of a geometry: those of its object over those of the scene.
    pub fn settings_of(&self, geometry: usize, description: &SceneDescription) -> ObjectSettings {
        let scene = &description.objects_default;
        match self.owners[geometry] {
            Some(object) => description.objects[object].settings.over(scene),
            None => scene.clone(),
        }
    }

    /// Returns the index of the object of a geometry; none for files without an object.
    pub(super) fn owner(&self, geometry: usize) -> Option<usize> {
        self.owners[geometry]
    }

    /// Returns true if a cloud has normals, those of its file or those that its settings need.
    pub(super) fn has_normals(&self, description: &SceneDescription) -> bool {
        let is_wanted = |i| self.settings_of(i, description).needs_normals();
        self.clouds().any(|(i, cloud)| cloud.normals.is_some() || is_wanted(i))
    }

    /// Returns the source of colours that is chosen for the first cloud if none is set.
    pub fn color_source(&self) -> Option<ColorSource> {
        self.clouds().next().map(|(_, cloud)| choose_source(cloud).0)
    }

    /// Returns true if a description shows a geometry: it hides objects only.
    pub(super) fn is_shown(&self, geometry: usize, description: &SceneDescription) -> bool {
        self.owners[geometry].is_none_or(|object| description.objects[object].visible())
    }

    /// Returns the files that a geometry came from.
    pub(super) fn files_of<'d>(
        &self,
        geometry: usize,
        description: &'d SceneDescription,
    ) -> &'d [PathBuf] {
        match self.owners[geometry] {
            Some(object) => &description.objects[object].files,
            None => &description.files,
        }
    }

    /// Returns the number of geometries.
    pub(super) fn n_geometries(&self) -> usize {
        self.owners.len()
    }

    /// Prepares all clouds; the points that were read are freed as it goes on.
    pub(super) fn take_prepared(
        &mut self,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<Vec<PreparedCloud>> {
        let mut clouds = Vec::new();
        for i in 0..self.n_geometries() {
            if let Geometry::Points(cloud) = &mut self.graph.geometries[i] {
                let cloud = std::mem::take(cloud);
                clouds.push(self.prepare(i, cloud, description, progress)?);
            }
        }
        Ok(clouds)
    }

    /// Prepares copies of the clouds that `is_meant` accepts, by the index of their object; files have none.
    pub(crate) fn prepared(
        &self,
        description: &SceneDescription,
        is_meant: impl Fn(Option<usize>) -> bool,
        progress: &dyn Progress,
    ) -> Result<Vec<PreparedCloud>> {
        let meant = self.clouds().filter(|(i, _)| is_meant(self.owners[*i]));
        let prepared = meant.map(|(i, cloud)| {
            let mut cloud = cloud.clone();
            self.settings_of(i, description).preparation.drop_estimated(&mut cloud);
            self.prepare(i, cloud, description, progress)
        });
        prepared.collect()
    }

    fn prepare(
        &self,
        geometry: usize,
        cloud: PointCloud,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<PreparedCloud> {
        let settings = self.settings_of(geometry, description);
        let cloud = match self.is_filtered {
            true => cloud,
            false => {
                let file_from_cloud = self.file_from_geometry(geometry);
                filter_cloud(cloud, &file_from_cloud, &settings.preparation, progress)?
            }
        };
        if cloud.is_empty() {
            check_empty(self.files_of(geometry, description), &settings.preparation)?;
        }
        let prepared = prepare_cloud(cloud, &settings, description.picture.seed(), progress);
        let mut prepared =
            prepared.map_err(|cause| self.content_error(geometry, description, cause))?;
        if !self.keeps_all_columns {
            prepared.drop_scalars(&settings.columns_of_preparation());
        }
        Ok(prepared)
    }

    /// Adds the files of a geometry to an error of the renderer.
    pub(super) fn content_error(
        &self,
        geometry: usize,
        description: &SceneDescription,
        cause: surfel_core::Error,
    ) -> Error {
        Error::Content { files: self.files_of(geometry, description).to_vec(), cause }
    }

    /// Returns the graph with clouds that have no points.
    pub(crate) fn graph_without_points(&self) -> Graph<PointCloud> {
        let geometries = self.graph.geometries.iter().map(|geometry| match geometry {
            Geometry::Points(cloud) => {
                Geometry::Points(PointCloud { origin: cloud.origin, ..PointCloud::default() })
            }
            Geometry::Triangles(mesh) => Geometry::Triangles(mesh.clone()),
        });
        Graph {
            geometries: geometries.collect(),
            nodes: self.graph.nodes.clone(),
            materials: self.graph.materials.clone(),
            textures: self.graph.textures.clone(),
            animation: self.graph.animation.clone(),
        }
    }

    /// Returns the streamed sequences under the settings of another description of the same objects.
    pub(super) fn sequences_under(&self, description: &SceneDescription) -> Vec<Sequence> {
        let under = |sequence: &Sequence| {
            let geometry = sequence.slots.geometries[0];
            let settings = self.settings_of(geometry, description);
            sequence.under(settings, self.import_options(description))
        };
        self.sequences.iter().map(under).collect()
    }
}

fn object_motions(description: &SceneDescription) -> Result<Vec<ObjectMotion>, Invalid> {
    let of_objects = description.animations.iter().filter(|animation| !animation.is_of_camera());
    of_objects.map(|animation| animation.object_motion()).collect()
}

fn content_summary(graph: &Graph<PointCloud>) -> String {
    match graph.n_points_and_triangles() {
        (points, 0) => counted(points, "point"),
        (0, triangles) => counted(triangles, "triangle"),
        (points, triangles) => {
            format!("{} and {}", counted(points, "point"), counted(triangles, "triangle"))
        }
    }
}
