//! Adds files, objects, sequences and movements to the content of a scene.

use super::super::cloud::{ImportOptions, check_empty, graph_of, import, into_cloud};
use super::super::sequence::{GeometrySlots, Sequence, element_counts, is_streamed};
use super::{LoadedFile, LoadedScene, ObjectNodes};
use crate::description::{
    ObjectDescription, ObjectMotion, ObjectSettings, PreparationSettings, SceneDescription,
};
use crate::error::{Error, Result};
use crate::file_names::file_name;
use crate::progress_log::ProgressLog;
use std::ops::Range;
use std::path::{Path, PathBuf};
use surfel_core::math::Aabb;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::color::choose_source;
use surfel_core::scene::{
    Channel, Graph, Interpolation, Keyframes, Node, Track, Transform, inlier_bounds,
};
use surfel_core::words::counted;
use surfel_formats::{FileInfo, Loaded};

impl LoadedScene {
    pub(super) fn import_options(&self, description: &SceneDescription) -> ImportOptions {
        ImportOptions {
            keeps_all_columns: self.keeps_all_columns,
            seed: description.picture.seed(),
            memory: description.memory.clone(),
            coordinate_system: self
                .file_infos
                .iter()
                .find_map(|info| info.coordinate_system.clone()),
            crs: description.world.crs.clone(),
        }
    }

    /// Adds the files without an object.
    pub(super) fn add_files(
        &mut self,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<()> {
        let (mut separate, mut merging) = (Vec::new(), (Vec::new(), Vec::new()));
        for file in &description.files {
            let (graph, info) =
                self.import(file, &description.objects_default, description, progress)?;
            let has_material =
                description.materials.choices().iter().any(|choice| choice.names(file));
            match into_cloud(graph) {
                Ok(cloud) if has_material || cloud.has_gaussians() => {
                    separate.push((vec![Loaded { cloud, info }], vec![file.clone()]));
                }
                Ok(cloud) => {
                    merging.0.push(Loaded { cloud, info });
                    merging.1.push(file.clone());
                }
                Err(graph) => {
                    let nodes = self.append(*graph, None);
                    self.files.push((file.clone(), nodes));
                }
            }
        }
        for (clouds, files) in separate.into_iter().chain([merging]) {
            if clouds.is_empty() {
                continue;
            }
            let preparation = &description.objects_default.preparation;
            let ends = file_ends(&clouds);
            let graph = merged(clouds, &files, preparation, progress)?;
            self.file_ends.insert(self.graph.geometries.len(), ends);
            let nodes = self.append(graph, None);
            self.files.extend(files.into_iter().map(|file| (file, nodes.clone())));
        }
        Ok(())
    }

    /// Reads a file, and keeps what is to be known about it.
    fn import(
        &mut self,
        file: &Path,
        settings: &ObjectSettings,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<(Graph<PointCloud>, FileInfo)> {
        let options = self.import_options(description);
        let log = ProgressLog::new(progress);
        let (graph, info) = import(file, settings, &options, &log)?;
        let (n_points, n_triangles) = graph.n_points_and_triangles();
        let notes = log.into_records().into_lines();
        let points = graph.sample_points();
        let Aabb { min, max } = inlier_bounds(&points);
        let bounds = [min, max].map(|corner| points.origin + corner.as_dvec3());
        let path = file.to_owned();
        self.read_files.push(LoadedFile { path, n_points, n_triangles, bounds, notes });
        self.file_infos.push(info.clone());
        Ok((graph, info))
    }

    /// Adds a graph to what is here; returns its nodes.
    fn append(&mut self, graph: Graph<PointCloud>, owner: Option<usize>) -> Range<usize> {
        let first = self.graph.append(graph);
        self.owners.resize(self.graph.geometries.len(), owner);
        first..self.graph.nodes.len()
    }

    /// Adds an object with its instances. `twin` is the index of one before it that holds the same.
    pub(super) fn add_object(
        &mut self,
        object: &ObjectDescription,
        twin: Option<usize>,
        description: &SceneDescription,
        motions: &[ObjectMotion],
        progress: &dyn Progress,
    ) -> Result<()> {
        let object_idx = self.objects.len();
        let before = &description.objects[..object_idx];
        let parent = object.parent.as_ref();
        let parent = parent.and_then(|name| before.iter().position(|other| other.name() == *name));
        let node = Node {
            parent: parent.map(|object_idx| self.objects[object_idx].node),
            transform: object.placement.transform()?,
            is_visible: object.visible(),
            ..Node::new(object.name())
        };
        let node = self.add_animated(node, motions);
        let first = self.graph.nodes.len();
        if let Some(twin) = twin {
            self.graph.add_instance(self.objects[twin].content.clone(), node);
        } else {
            self.add_content(node, object, description, progress)?;
        }
        let content = first..self.graph.nodes.len();
        for instance in &object.instances {
            let instance = Node {
                parent: Some(node),
                transform: instance.transform()?,
                ..Node::new(object.name())
            };
            let instance = self.graph.add_node(instance);
            self.graph.add_instance(content.clone(), instance);
        }
        self.objects.push(ObjectNodes { node, content, all: first..self.graph.nodes.len() });
        Ok(())
    }

    /// Puts what an object's files hold under its node.
    fn add_content(
        &mut self,
        node: usize,
        object: &ObjectDescription,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<()> {
        let owner = self.objects.len();
        let settings = object.settings.over(&description.objects_default);
        if is_streamed(object, &settings, &description.memory)? {
            return self.add_sequence(node, object, settings, description, progress);
        }
        let mut merging = Vec::new();
        for (file_idx, file) in object.files.iter().enumerate() {
            let (graph, info) = self.import(file, &settings, description, progress)?;
            if object.merge() {
                let cloud = into_cloud(graph).map_err(|_| {
                    Error::Unfit(format!(
                        "{}: is not a point cloud; `merge` is for point clouds",
                        file.display()
                    ))
                })?;
                merging.push(Loaded { cloud, info });
                continue;
            }
            let above = Node { parent: Some(node), ..Node::new(file_name(file)) };
            let above = self.graph.add_node(above);
            if 1 < object.files.len() {
                self.show_in_turn(above, file_idx, object);
            }
            self.append_below(above, graph, owner);
        }
        if object.merge() {
            self.file_ends.insert(self.graph.geometries.len(), file_ends(&merging));
            let graph = merged(merging, &object.files, &settings.preparation, progress)?;
            self.append_below(node, graph, owner);
        }
        Ok(())
    }

    /// Puts the first file of a sequence under an object's node; the others take its place.
    fn add_sequence(
        &mut self,
        node: usize,
        object: &ObjectDescription,
        settings: ObjectSettings,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<()> {
        let first = &object.files[0];
        let (graph, _) = self.import(first, &settings, description, progress)?;
        let options = self.import_options(description);
        let above = Node { parent: Some(node), ..Node::new(file_name(first)) };
        let above = self.graph.add_node(above);
        let before = element_counts(&self.graph);
        self.append_below(above, graph, self.objects.len());
        let slots = GeometrySlots::behind(before, &self.graph);
        let sequence = Sequence::new(object.files.clone(), object.fps(), settings, options, slots);
        self.sequences.push(sequence);
        Ok(())
    }

    fn append_below(&mut self, above: usize, graph: Graph<PointCloud>, owner: usize) {
        let nodes = self.append(graph, Some(owner));
        for node in &mut self.graph.nodes[nodes] {
            node.parent.get_or_insert(above);
        }
    }

    /// Shows a file of a sequence for its time; the last one stays.
    fn show_in_turn(&mut self, node: usize, file_idx: usize, object: &ObjectDescription) {
        let fps = object.fps();
        let (start, end) = (file_idx as f64 / fps, (file_idx + 1) as f64 / fps);
        let is_last = file_idx + 1 == object.files.len();
        let mut keys = vec![(start, true), (end, is_last)];
        if 0 < file_idx {
            keys.insert(0, (0.0, false));
        }
        let keys = Keyframes {
            times_secs: keys.iter().map(|(time, _)| *time).collect(),
            values: keys.iter().map(|(_, visible)| *visible).collect(),
            interpolation: Interpolation::Step,
        };
        self.graph.animation.channels.push(Channel { node, track: Track::Visible(keys) });
    }

    /// Adds a node with its movements. One that orbits hangs on another that stands in the middle.
    pub(super) fn add_animated(&mut self, mut node: Node, motions: &[ObjectMotion]) -> usize {
        let name = node.name.clone();
        let motions = motions.iter().filter(|motion| motion.object == name);
        for motion in motions.clone().filter(|motion| motion.is_orbit) {
            let center = motion.pivot.unwrap_or(node.transform.matrix().translation);
            let mut middle = Node { parent: node.parent, ..Node::new("") };
            middle.transform = Transform::from_translation(center);
            let middle = self.graph.add_node(middle);
            if motion.is_about_up {
                self.up_parts.orbits.push(self.graph.animation.channels.len());
            }
            self.add_tracks(middle, motion);
            // Back again, so that the node's own keys count from where they always do.
            let mut back = Node { parent: Some(middle), ..Node::new("") };
            back.transform = Transform::from_translation(-center);
            node.parent = Some(self.graph.add_node(back));
        }
        let node = self.graph.add_node(node);
        for motion in motions.filter(|motion| !motion.is_orbit) {
            self.add_tracks(node, motion);
        }
        node
    }

    fn add_tracks(&mut self, node: usize, motion: &ObjectMotion) {
        let channels = motion.tracks.iter().map(|track| Channel { node, track: track.clone() });
        self.graph.animation.channels.extend(channels);
    }
}

/// Returns the number of points up to the end of each cloud, as they follow each other once they are one.
fn file_ends(clouds: &[Loaded]) -> Vec<usize> {
    let mut end = 0;
    let ends = clouds.iter().map(|part| {
        end += part.cloud.len();
        end
    });
    ends.collect()
}

/// Clouds as one, whose points lie among each other.
fn merged(
    clouds: Vec<Loaded>,
    files: &[PathBuf],
    settings: &PreparationSettings,
    progress: &dyn Progress,
) -> Result<Graph<PointCloud>> {
    if let Some(line) = colorless_line(&clouds, files) {
        progress.note(&line);
    }
    let cloud = surfel_formats::merge_loaded(clouds, files, progress).cloud;
    if cloud.is_empty() {
        check_empty(files, settings)?;
        let cause = surfel_core::Error::EmptyCloud;
        return Err(Error::Content { files: files.to_vec(), cause });
    }
    let mut graph = graph_of(cloud);
    graph.nodes[0].name = file_name(&files[0]);
    Ok(graph)
}

/// Returns a line that names a file without colours, if others have some, and the option that keeps it apart from them.
fn colorless_line(clouds: &[Loaded], files: &[PathBuf]) -> Option<String> {
    clouds.iter().find(|part| part.cloud.colors.is_some())?;
    let lacks_colors = |cloud: &PointCloud| !cloud.is_empty() && cloud.colors.is_none();
    let mut colorless = clouds.iter().zip(files).filter(|(part, _)| lacks_colors(&part.cloud));
    let (part, file) = colorless.next()?;
    let (file, source) = (file.display(), choose_source(&part.cloud).0);
    let option = format!("--object-settings {file}:color={source}");
    Some(match colorless.count() {
        0 => format!("no colours in {file}: {option} keeps it apart and the others coloured"),
        n => format!(
            "no colours in {file} and {} more: {option}, once for each of them, keeps the others coloured",
            counted(n, "file")
        ),
    })
}
