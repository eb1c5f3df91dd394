//! How what was read is to look: points prepared and coloured, parts hidden, materials given.

use super::{Assembly, name_files};
use crate::args::{LightKind, Usage};
use crate::cloud::{dress, prepare_points};
use crate::report::Report;
use crate::sequence::Sequence;
use anyhow::Context;
use surfel::math::Vec3;
use surfel::points::PointCloud;
use surfel::scene::{Clip, Geometry, Graph, Material};

impl<'a> Assembly<'a> {
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

    /// Hides what the options cut away, but not everything.
    fn clip(&mut self) -> anyhow::Result<()> {
        let places = self.graph.world_from_geometries();
        for sequence in &mut self.sequences {
            sequence.world_from_file = places[sequence.slots.geometries[0]];
        }
        let args = self.args_of.iter().map(|object_args| self.args(*object_args).0);
        let clips: Vec<Clip> = args.map(|args| args.clip.clip()).collect();
        self.graph.clip(&clips);
        let with_box = clips.iter().any(|clip| clip.bounds.is_some()).then_some("--clip-box");
        let with_plane = clips.iter().any(|clip| clip.plane.is_some()).then_some("--clip-plane");
        let options: Vec<&str> = with_box.into_iter().chain(with_plane).collect();
        if !options.is_empty() && self.graph.counts() == (0, 0) {
            let advice = "nothing is left to be seen; `surfel info` tells where the points lie";
            return Err(Usage(format!("{}: {advice}", options.join(", "))).into());
        }
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

/// Whether something is black without light: it neither shines nor shows what is around or behind it.
fn needs_light(material: &Material) -> bool {
    let reflects = 0.5 < material.metallic && material.roughness < 1.0;
    let shines = 0.0 < material.glow || material.emissive != Vec3::ZERO;
    !reflects && !shines && material.transmission == 0.0
}
