//! Clouds and meshes of which one is seen at a time, as 4-D scans: each is read when its time comes.

use crate::args::SceneArgs;
use crate::assemble::shine_in_the_dark;
use crate::cloud::{into_cloud, load, make_points};
use crate::report::Report;
use crate::scene_file::Object;
use anyhow::{Context, bail};
use std::ops::Range;
use std::path::{Path, PathBuf};
use surfel::math::{DAffine3, Vec3};
use surfel::scene::{Geometry, Graph, Material, Mesh, Part, Texture};
use surfel_formats::is_scene;

/// Whether an object is such a sequence. Scenes are all held instead, each under its own node.
pub fn is_read_in_turn(object: &Object, args: &SceneArgs) -> surfel_formats::Result<bool> {
    if object.is_merged || object.files.len() < 2 {
        return Ok(false);
    }
    for file in &object.files {
        if !args.preparation.vertices && is_scene(file)? {
            return Ok(false);
        }
    }
    Ok(true)
}

pub struct Sequence<'a> {
    files: &'a [PathBuf],
    fps: f64,
    /// Options that its clouds are made by, and its meshes clipped.
    args: SceneArgs,
    pub slots: Slots,
    /// From the files' coordinates to the world's, where they are clipped.
    pub world_from_file: DAffine3,
    /// Nodes that show it, with the material that each has instead of the files' own.
    shown_at: Vec<(usize, Option<usize>)>,
    /// Whether there is no light: then what needs some shows its colours as they are.
    is_dark: bool,
    file_idx: usize,
}

/// Where the parts of a file stand among those of a graph. One that has more than those before gets more.
#[derive(Clone, Debug)]
pub struct Slots {
    pub geometries: Vec<usize>,
    pub materials: Vec<usize>,
    pub textures: Vec<usize>,
}

impl Slots {
    /// Of what was put at the end of a graph that had so many of each before.
    pub fn behind(before: [usize; 3], graph: &Graph) -> Self {
        let after = counts(graph);
        let [geometries, materials, textures] =
            [0, 1, 2].map(|kind| Range { start: before[kind], end: after[kind] }.collect());
        Self { geometries, materials, textures }
    }
}

/// Geometries, materials and textures.
pub fn counts(graph: &Graph) -> [usize; 3] {
    [graph.geometries.len(), graph.materials.len(), graph.textures.len()]
}

impl<'a> Sequence<'a> {
    /// One whose first file is in the graph already.
    pub fn new(files: &'a [PathBuf], fps: f64, args: SceneArgs, slots: Slots) -> Self {
        let world_from_file = DAffine3::IDENTITY;
        let (shown_at, is_dark, file_idx) = (Vec::new(), false, 0);
        Self { files, fps, args, slots, world_from_file, shown_at, is_dark, file_idx }
    }

    pub fn duration_secs(&self) -> f64 {
        self.files.len() as f64 / self.fps
    }

    /// Finds the nodes of a graph that show its first file, as they are in the end.
    pub fn settle(&mut self, graph: &Graph, is_dark: bool) {
        let Slots { geometries, materials, .. } = &self.slots;
        let nodes = graph.nodes.iter().enumerate();
        let shown_at = nodes.filter_map(|(node_idx, node)| {
            let part = node.parts.iter().find(|part| geometries.contains(&part.geometry))?;
            let is_own = materials.contains(&part.material);
            Some((node_idx, (!is_own).then_some(part.material)))
        });
        self.shown_at = shown_at.collect();
        self.is_dark = is_dark;
    }

    /// Puts the file of a time into the graph, ready, if it is another than before.
    pub fn seek(
        &mut self,
        time_secs: f64,
        graph: &mut Graph,
        up: Vec3,
        report: &Report,
    ) -> anyhow::Result<bool> {
        let file_idx = self.file_at(time_secs);
        if file_idx == self.file_idx {
            return Ok(false);
        }
        let content = self.read(&self.files[file_idx], up, report)?;
        self.show(content, graph);
        self.file_idx = file_idx;
        Ok(true)
    }

    /// The last one stays.
    pub fn file_at(&self, time_secs: f64) -> usize {
        let has_begun = |file_idx: &usize| *file_idx as f64 / self.fps <= time_secs;
        (1..self.files.len()).take_while(has_begun).count()
    }

    /// What a file holds, ready for its trees: parts of one node.
    fn read(&self, file: &Path, up: Vec3, report: &Report) -> anyhow::Result<Graph> {
        let (graph, _) = load(file, &self.args, report)?;
        let mut content = match into_cloud(graph) {
            Ok(cloud) => {
                let points = make_points(cloud, &self.args, up, report);
                let points = points.with_context(|| file.display().to_string())?;
                Graph::of(Geometry::Points(points), Material::MATTE)
            }
            Err(graph) if graph.nodes.len() == 1 => graph,
            Err(_) => bail!("{}: is a scene now, and was none before", file.display()),
        };
        let clip = self.args.clip.clip();
        for geometry in &mut content.geometries {
            geometry.clip(&clip, &self.world_from_file);
        }
        if self.is_dark {
            shine_in_the_dark(&mut content.materials);
        }
        let name = file.file_stem().unwrap_or_default();
        content.nodes[0].name = name.to_string_lossy().into_owned();
        Ok(content)
    }

    /// Puts what a file holds in place of what was seen before.
    fn show(&mut self, content: Graph, graph: &mut Graph) {
        let Slots { geometries, materials, textures } = &mut self.slots;
        put(content.textures, textures, &mut graph.textures, no_texture);
        let with_its_textures = content.materials.into_iter().map(|mut material| {
            material.textures.each_mut(|reference| reference.texture = textures[reference.texture]);
            material
        });
        put(with_its_textures.collect(), materials, &mut graph.materials, || Material::MATTE);
        let no_geometry = || Geometry::Triangles(Mesh::default());
        put(content.geometries, geometries, &mut graph.geometries, no_geometry);
        let shown = &content.nodes[0];
        for (node_idx, material) in &self.shown_at {
            let parts = shown.parts.iter().map(|part| Part {
                geometry: geometries[part.geometry],
                material: material.unwrap_or(materials[part.material]),
            });
            graph.nodes[*node_idx].parts = parts.collect();
            graph.nodes[*node_idx].name.clone_from(&shown.name);
        }
    }
}

/// Puts things into the slots of those before, and more at the end if these are too few; slots that are left
/// over hold nothing.
fn put<T>(things: Vec<T>, slots: &mut Vec<usize>, all: &mut Vec<T>, nothing: impl Fn() -> T) {
    let mut things = things.into_iter();
    for slot in slots.iter() {
        all[*slot] = things.next().unwrap_or_else(&nothing);
    }
    slots.extend(all.len()..all.len() + things.len());
    all.extend(things);
}

fn no_texture() -> Texture {
    Texture { width: 1, height: 1, texels: [[255; 4]].into() }
}
