//! What files and objects hold, put into the graph.

use super::{Added, Assembly, file_name, name_files};
use crate::cloud::{graph_of, into_cloud, load};
use crate::report::Report;
use crate::scene_file::{Motion, Object, is_scene_file};
use crate::sequence::{Sequence, Slots, counts, is_read_in_turn};
use anyhow::Context;
use std::ops::Range;
use std::path::PathBuf;
use surfel::scene::{Channel, Graph, Interpolation, Keys, Node, Track, Transform};
use surfel_formats::Loaded;

impl<'a> Assembly<'a> {
    /// Adds the files of the command line.
    pub(super) fn add_files(&mut self, report: &Report) -> anyhow::Result<()> {
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

    /// Adds an object with its copies.
    pub(super) fn add_object(&mut self, object: &'a Object, report: &Report) -> anyhow::Result<()> {
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
    pub(super) fn add_moving(&mut self, mut node: Node, motions: &[Motion]) -> usize {
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
