//! Sequences of clouds and meshes, such as 4-D scans: each file is read when its time comes.

use super::cloud::{
    ImportOptions, apply_surface_and_color, filter_cloud, graph_of, import, into_cloud,
    prepare_cloud,
};
use super::unlit::unlit_without_lights;
use crate::description::{ObjectDescription, ObjectSettings};
use crate::error::{Error, Result};
use crate::memory_files::MemoryFiles;
use std::ops::Range;
use std::path::{Path, PathBuf};
use surfel_core::math::{DAffine3, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::{Geometry, Graph, Material, Mesh, Primitive, Texture};
use surfel_formats::is_scene;

/// Returns true if the files of an object are a sequence that is read one by one. Scenes are all held instead, each
/// under its own node.
pub fn is_streamed(
    object: &ObjectDescription,
    settings: &ObjectSettings,
    memory: &MemoryFiles,
) -> surfel_formats::Result<bool> {
    if object.merge() || object.files.len() < 2 {
        return Ok(false);
    }
    for file in &object.files {
        let holds_scene = match memory.get(file) {
            Some(content) => content.is_scene(),
            None => !settings.preparation.vertices() && is_scene(file)?,
        };
        if holds_scene {
            return Ok(false);
        }
    }
    Ok(true)
}

/// A sequence of which one file is held at a time.
#[derive(Clone, Debug)]
pub struct Sequence {
    files: Vec<PathBuf>,
    fps: f64,
    settings: ObjectSettings,
    options: ImportOptions,
    /// Slots of its content in the graph.
    pub slots: GeometrySlots,
    /// Transform from the files' coordinates to the world's, where they are clipped.
    pub world_from_file: DAffine3,
    /// Nodes that show it, with the material that each has instead of the files' own.
    shown_at: Vec<(usize, Option<usize>)>,
    /// True without light: then what needs some shows its colours as they are.
    is_dark: bool,
    file_idx: usize,
}

/// Indices of a file's content in a graph. A file that has more than those before gets more.
#[derive(Clone, Debug)]
pub struct GeometrySlots {
    /// Indices of geometries.
    pub geometries: Vec<usize>,
    /// Indices of materials.
    pub materials: Vec<usize>,
    /// Indices of textures.
    pub textures: Vec<usize>,
}

impl GeometrySlots {
    /// The slots of what was added at the end of a graph that had so many elements before.
    pub fn behind<C>(before: [usize; 3], graph: &Graph<C>) -> Self {
        let after = element_counts(graph);
        let [geometries, materials, textures] =
            [0, 1, 2].map(|kind| Range { start: before[kind], end: after[kind] }.collect());
        Self { geometries, materials, textures }
    }
}

/// Returns the numbers of geometries, materials and textures.
pub fn element_counts<C>(graph: &Graph<C>) -> [usize; 3] {
    [graph.geometries.len(), graph.materials.len(), graph.textures.len()]
}

impl Sequence {
    /// A sequence whose first file is in the graph already.
    pub fn new(
        files: Vec<PathBuf>,
        fps: f64,
        settings: ObjectSettings,
        options: ImportOptions,
        slots: GeometrySlots,
    ) -> Self {
        let world_from_file = DAffine3::IDENTITY;
        let (shown_at, is_dark, file_idx) = (Vec::new(), false, 0);
        Self { files, fps, settings, options, slots, world_from_file, shown_at, is_dark, file_idx }
    }

    /// Returns the sequence with its first file shown under other settings. Its coordinates stay where they were moved.
    pub fn under(&self, settings: ObjectSettings, options: ImportOptions) -> Self {
        let options = ImportOptions { crs: self.options.crs.clone(), ..options };
        Self::new(self.files.clone(), self.fps, settings, options, self.slots.clone())
    }

    /// Returns the time after the last file in seconds.
    pub fn duration_secs(&self) -> f64 {
        self.files.len() as f64 / self.fps
    }

    /// Finds the nodes of a finished graph that show the first file.
    pub fn bind_nodes(&mut self, graph: &Graph, is_dark: bool) {
        let GeometrySlots { geometries, materials, .. } = &self.slots;
        let nodes = graph.nodes.iter().enumerate();
        let shown_at = nodes.filter_map(|(node_idx, node)| {
            let primitive = node
                .primitives
                .iter()
                .find(|primitive| geometries.contains(&primitive.geometry))?;
            let is_own = materials.contains(&primitive.material);
            Some((node_idx, (!is_own).then_some(primitive.material)))
        });
        self.shown_at = shown_at.collect();
        self.is_dark = is_dark;
    }

    /// Puts the file of a time into the graph, unless it is there. Returns true if the graph changed.
    pub fn seek(
        &mut self,
        time_secs: f64,
        graph: &mut Graph,
        up: Vec3,
        progress: &dyn Progress,
    ) -> Result<bool> {
        let file_idx = self.file_at(time_secs);
        if file_idx == self.file_idx {
            return Ok(false);
        }
        let content = self.read(&self.files[file_idx], up, progress)?;
        self.show(content, graph);
        self.file_idx = file_idx;
        Ok(true)
    }

    /// Makes the next [`Sequence::seek`] read the file of its time, whichever is in the graph.
    pub fn forget_file(&mut self) {
        self.file_idx = usize::MAX;
    }

    /// Returns the index of the file of a time; the last one stays.
    pub fn file_at(&self, time_secs: f64) -> usize {
        let has_begun = |file_idx: &usize| *file_idx as f64 / self.fps <= time_secs;
        (1..self.files.len()).take_while(has_begun).count()
    }

    /// Reads a file and prepares it, as primitives of one node.
    fn read(&self, file: &Path, up: Vec3, progress: &dyn Progress) -> Result<Graph> {
        let (graph, _) = import(file, &self.settings, &self.options, progress)?;
        let graph = match into_cloud(graph) {
            Ok(cloud) => graph_of(cloud),
            Err(graph) if graph.nodes.len() == 1 => *graph,
            Err(_) => {
                let text = "holds a scene now; when the run began it held one cloud or mesh";
                return Err(Error::Unfit(format!("{}: {text}", file.display())));
            }
        };
        let mut content = graph.try_map_clouds(|cloud: PointCloud| {
            let cloud = self.numbered(cloud, progress)?;
            let prepared = prepare_cloud(cloud, &self.settings, self.options.seed, progress);
            let colored = prepared
                .and_then(|cloud| apply_surface_and_color(cloud, &self.settings, up, progress));
            colored.map_err(|cause| Error::Content { files: vec![file.to_owned()], cause })
        })?;
        let clip = self.settings.surface.clip();
        for geometry in &mut content.geometries {
            geometry.clip(&clip, &self.world_from_file);
        }
        if self.is_dark {
            unlit_without_lights(&mut content.materials);
        }
        let name = file.file_stem().unwrap_or_default();
        content.nodes[0].name = name.to_string_lossy().into_owned();
        Ok(content)
    }

    /// Numbers the points. Drops the points and columns that the settings do not keep, if all of the file was read.
    fn numbered(&self, mut cloud: PointCloud, progress: &dyn Progress) -> Result<PointCloud> {
        cloud.source_indices = Some((0..cloud.len() as u32).collect());
        if !self.options.keeps_all_columns {
            return Ok(cloud);
        }
        let settings = &self.settings.preparation;
        let mut cloud = filter_cloud(cloud, &DAffine3::IDENTITY, settings, progress)?;
        settings.drop_estimated(&mut cloud);
        Ok(cloud)
    }

    /// Puts what a file holds in place of what was shown before.
    fn show(&mut self, content: Graph, graph: &mut Graph) {
        let GeometrySlots { geometries, materials, textures } = &mut self.slots;
        fill_slots(content.textures, textures, &mut graph.textures, no_texture);
        let with_its_textures = content.materials.into_iter().map(|mut material| {
            material
                .textures
                .for_each_mut(|reference| reference.texture = textures[reference.texture]);
            material
        });
        fill_slots(with_its_textures.collect(), materials, &mut graph.materials, || {
            Material::MATTE
        });
        let no_geometry = || Geometry::Triangles(Mesh::default());
        fill_slots(content.geometries, geometries, &mut graph.geometries, no_geometry);
        let shown = &content.nodes[0];
        for (node_idx, material) in &self.shown_at {
            let primitives = shown.primitives.iter().map(|primitive| Primitive {
                geometry: geometries[primitive.geometry],
                material: material.unwrap_or(materials[primitive.material]),
            });
            graph.nodes[*node_idx].primitives = primitives.collect();
            graph.nodes[*node_idx].name.clone_from(&shown.name);
        }
    }
}

/// Puts things into the slots of those before, and more at the end if these are too few; slots that are left over hold
/// nothing.
fn fill_slots<T>(
    things: Vec<T>,
    slots: &mut Vec<usize>,
    all: &mut Vec<T>,
    nothing: impl Fn() -> T,
) {
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
