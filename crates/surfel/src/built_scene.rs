//! A scene with its trees, shown at one time after another: what moves is moved, everything else stays.

use crate::crs::{CoordinateSystem, georeference};
use crate::description::{Exposure, SceneDescription};
use crate::error::Result;
use crate::overlay::Overlay;
use crate::picture::RenderedImage;
use crate::progress_log::{CancelOnly, Choice, ProgressLog, Warning};
use crate::renderer::SceneRenderer;
use crate::resolve::{
    Metering, Resolved, SceneCamera, Sequence, automatic_exposure, expose, expose_lamps,
    expose_materials,
};
use surfel_core::flat::{FlatPunctualLight, FlatScene, Instance};
use surfel_core::math::{Aabb, DQuat, Vec3};
use surfel_core::progress::{NoProgress, Progress};
use surfel_core::render::{RenderStats, Renderer, Settings};
use surfel_core::scene::{Camera, ClipPlane, Geometry, Graph, Light, Room};
use surfel_core::trace::Simd;
use surfel_formats::Georeference;

/// A scene with its trees: it renders, casts rays, and moves to any time.
#[derive(Debug)]
pub struct BuiltScene {
    flat: FlatScene,
    renderer: SceneRenderer,
    graph: Graph,
    sequences: Vec<Sequence>,
    camera: SceneCamera,
    /// The room on a turntable, whose walls before the camera are hidden.
    turned_room: Option<Room>,
    overlay: Overlay,
    system: Option<CoordinateSystem>,
    up: Vec3,
    metering: Metering,
    /// Lights before a turntable turns them.
    lights: Vec<Light>,
    /// Lamps before a turntable turns them.
    lamps: Vec<FlatPunctualLight>,
    /// Stops by which all lights were made brighter.
    stops: f32,
    /// Size and quality of pictures.
    pub settings: Settings,
    description: SceneDescription,
    choices: Vec<Choice>,
    warnings: Vec<Warning>,
    /// For each geometry, the index that each point had when it was read; empty where none is kept.
    source_indices: Vec<Vec<u32>>,
}

impl Resolved {
    /// Builds the trees, and chooses the exposure from a preview unless the description gives it.
    ///
    /// # Errors
    ///
    /// Fails for scenes that no picture can be made of, and if cancelled.
    pub fn build(self, progress: &dyn Progress) -> Result<BuiltScene> {
        let mut scene = self.build_trees(progress)?;
        scene.choose_exposure(progress)?;
        Ok(scene)
    }

    /// Builds the trees, after which the graph's own points are freed.
    ///
    /// # Errors
    ///
    /// Fails for scenes that no picture can be made of, and if cancelled.
    pub fn build_trees(self, progress: &dyn Progress) -> Result<BuiltScene> {
        let Self { scene, settings, description, choices, warnings, .. } = self;
        let Self { sequences, camera, turned_room, overlay, system, up, metering, .. } = self;
        let renderer = SceneRenderer::new(&description.run)?;
        let mut flat = FlatScene::new(&scene, progress)?;
        flat.camera_planes = planes_before(turned_room.as_ref(), &flat.camera);
        progress.end();
        let mut graph = scene.graph;
        let source_indices = source_indices(&graph);
        graph.release_static();
        let (lights, lamps) = (flat.lights.clone(), flat.punctual_lights.clone());
        Ok(BuiltScene {
            flat,
            renderer,
            graph,
            sequences,
            camera,
            turned_room,
            overlay,
            system,
            up,
            metering,
            lights,
            lamps,
            stops: 0.0,
            settings,
            description,
            choices,
            warnings,
            source_indices,
        })
    }
}

/// Turns everything in front of the camera about `up`, under lights that stay. Of a `room`, the walls before the camera are
/// hidden.
pub(crate) fn turn(flat: &mut FlatScene, up: Vec3, room: Option<&Room>, turn_rad: f64) {
    // Camera and lights go round together: turning everything else would move every tree.
    let turn = DQuat::from_axis_angle(up.as_dvec3(), turn_rad);
    let center = (flat.camera.focal_point - flat.origin).as_vec3();
    flat.camera = flat.camera.rotated_about_focal_point(turn);
    flat.camera_planes = planes_before(room, &flat.camera);
    flat.lights.iter_mut().for_each(|light| *light = light.rotated(turn));
    flat.punctual_lights.iter_mut().for_each(|lamp| *lamp = lamp.rotated_about(turn, center));
}

/// Returns the planes that hide from a camera the walls of a room that it looks through.
pub(crate) fn planes_before(room: Option<&Room>, camera: &Camera) -> Vec<ClipPlane> {
    room.map_or(Vec::new(), |room| room.planes_before(camera))
}

/// Returns for each geometry the index that each of its points had when it was read.
pub(crate) fn source_indices(graph: &Graph) -> Vec<Vec<u32>> {
    graph.geometries.iter().map(source_indices_of).collect()
}

fn source_indices_of(geometry: &Geometry) -> Vec<u32> {
    match geometry {
        Geometry::Points(points) => points.cloud().source_indices.clone().unwrap_or_default(),
        Geometry::Triangles(_) => Vec::new(),
    }
}

/// Returns for each instance the index that each of its points had when it was read, of the indices for each geometry.
pub(crate) fn sources_of<'s>(flat: &FlatScene, source_indices: &'s [Vec<u32>]) -> Vec<&'s [u32]> {
    let source = |instance: &Instance| source_indices.get(instance.graph_geometry_idx as usize);
    let sources = flat.instances.iter().map(source);
    sources.map(|source| source.map_or(&[][..], Vec::as_slice)).collect()
}

/// Returns the corners of a box around all instances, in world coordinates: least and greatest.
pub(crate) fn world_bounds(flat: &FlatScene) -> [[f64; 3]; 2] {
    let boxes = flat.instances.iter().map(|instance| instance.bounds);
    let all = boxes.fold(Aabb::EMPTY, Aabb::union);
    [all.min, all.max].map(|corner| (flat.origin + corner.as_dvec3()).to_array())
}

impl BuiltScene {
    /// Sets the brightness of all lights: by the description, or from a preview of second 0.
    ///
    /// # Errors
    ///
    /// Fails if cancelled.
    pub fn choose_exposure(&mut self, progress: &dyn Progress) -> Result<()> {
        let log = ProgressLog::new(progress);
        let exposure = self.description.light.exposure();
        let picture = (&self.flat, &self.settings);
        let stops = exposure_stops(exposure, &self.renderer, picture, &self.metering, &log)?;
        self.choices.extend(log.into_records().choices);
        expose(&mut self.flat, stops);
        self.stops = stops;
        self.lights.clone_from(&self.flat.lights);
        self.lamps.clone_from(&self.flat.punctual_lights);
        Ok(())
    }

    /// Keeps the legend in one corner from now on, as the frames of a movie need it.
    pub(crate) fn fix_overlay(&mut self) {
        self.overlay.is_fixed = true;
    }

    /// Returns the arrays that rays are traced against.
    pub fn flat(&self) -> &FlatScene {
        &self.flat
    }

    /// Returns the complete description: with everything that was chosen from the data.
    pub fn description(&self) -> &SceneDescription {
        &self.description
    }

    /// Returns what was chosen from the data, in the order of the work.
    pub fn choices(&self) -> &[Choice] {
        &self.choices
    }

    /// Returns hints at what is probably not meant, in the order of the work.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Returns the SIMD level of the kernels.
    pub fn simd(&self) -> Simd {
        self.renderer.simd()
    }

    /// Returns the name of the GPU that rendered the last picture; none if the CPU did.
    pub fn gpu_name(&self) -> Option<&str> {
        self.renderer.gpu_name()
    }

    /// Returns for each instance the index that each of its points had when it was read; empty for triangles.
    pub(crate) fn sources(&self) -> Vec<&[u32]> {
        sources_of(&self.flat, &self.source_indices)
    }

    /// Returns the corners of a box around everything, in world coordinates: least and greatest.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        world_bounds(&self.flat)
    }

    /// Moves everything to a time in seconds, forward or back.
    ///
    /// # Errors
    ///
    /// Fails if a file of a sequence cannot be read, and if cancelled.
    pub fn seek(&mut self, time_secs: f64, progress: &dyn Progress) -> Result<()> {
        for sequence in &mut self.sequences {
            if !sequence.seek(time_secs, &mut self.graph, self.up, progress)? {
                continue;
            }
            self.source_indices.resize(self.graph.geometries.len(), Vec::new());
            for geometry_idx in sequence.slots.geometries.iter().copied() {
                let geometry = &self.graph.geometries[geometry_idx];
                self.source_indices[geometry_idx] = source_indices_of(geometry);
                if let Err(error) = self.flat.replace(geometry_idx, geometry, progress) {
                    sequence.forget_file();
                    return Err(error.into());
                }
            }
            self.flat.materials.clone_from(&self.graph.materials);
            expose_materials(&mut self.flat.materials, self.stops);
            self.flat.textures.clone_from(&self.graph.textures);
            progress.end();
        }
        if !self.graph.animation.channels.is_empty() || !self.sequences.is_empty() {
            self.graph.evaluate_at(time_secs);
            self.flat.update(&self.graph, progress)?;
            self.graph.release_static();
            expose_lamps(&mut self.flat.punctual_lights, self.stops);
            self.lamps.clone_from(&self.flat.punctual_lights);
        }
        self.flat.camera = self.camera.at(time_secs, &self.graph);
        Ok(())
    }

    /// Turns everything in front of the camera, under lights that stay, from where the last [`BuiltScene::seek`] left it.
    pub fn turn(&mut self, turn_rad: f64) {
        self.flat.lights.clone_from(&self.lights);
        self.flat.punctual_lights.clone_from(&self.lamps);
        turn(&mut self.flat, self.up, self.turned_room.as_ref(), turn_rad);
    }

    /// Returns where the pixels of the picture lie, if the camera looks straight down without perspective.
    pub fn georeference(&self) -> Option<Georeference> {
        let size = (self.settings.width, self.settings.height);
        georeference(&self.flat.camera, size, self.system.as_ref())
    }

    /// Renders the picture of the current time.
    ///
    /// # Errors
    ///
    /// Fails if the settings make no picture.
    pub fn render(&self) -> Result<RenderedImage> {
        Ok(self.render_with(&NoProgress)?.0)
    }

    /// Renders with progress and cancellation; returns the picture and what it took.
    ///
    /// # Errors
    ///
    /// Fails if the settings make no picture, and if cancelled.
    pub fn render_with(&self, progress: &dyn Progress) -> Result<(RenderedImage, RenderStats)> {
        let (image, stats) = self.renderer.render(&self.flat, &self.settings, progress)?;
        let scene = (&self.flat, &self.description);
        Ok((RenderedImage::finish(image, &self.overlay, scene, self.georeference()), stats))
    }
}

/// Returns the stops of an exposure; an automatic one is chosen from a preview and reported.
pub(crate) fn exposure_stops(
    exposure: Exposure,
    renderer: &dyn Renderer,
    (flat, settings): (&FlatScene, &Settings),
    metering: &Metering,
    progress: &dyn Progress,
) -> Result<f32> {
    match exposure {
        Exposure::Stops(stops) => Ok(stops as f32),
        Exposure::Auto if flat.lights.is_empty() && flat.punctual_lights.is_empty() => Ok(0.0),
        Exposure::Auto => {
            let stops =
                automatic_exposure(renderer, flat, settings, metering, &CancelOnly(progress))?;
            progress.choice(&format!("exposure {stops:+.2} stops"), &["exposure"]);
            Ok(stops)
        }
    }
}

#[cfg(test)]
mod tests {
    //! The choices that a built scene lists.

    use super::*;
    use crate::description::ObjectDescription;
    use crate::memory_files::MemoryContent;
    use crate::resolve;
    use std::path::Path;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicI64, Ordering};
    use surfel_core::points::PointCloud;

    #[test]
    fn an_exposure_is_listed_only_where_one_was_chosen() {
        let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
        let cloud = Arc::new(PointCloud::from_positions((0..400).map(corner).collect()));
        let n_choices = |light: &str, exposure: &str| {
            let mut description = SceneDescription::of_files(["memory:plane"]);
            description.memory.insert("memory:plane", MemoryContent::Points(cloud.clone(), None));
            for (key, value) in [("light", light), ("exposure", exposure)] {
                description.set(key, &value.into(), Path::new("")).unwrap();
            }
            let scene = resolve(&description, &NoProgress).unwrap().build(&NoProgress).unwrap();
            scene.choices().iter().filter(|choice| choice.keys == ["exposure"]).count()
        };
        assert_eq!(n_choices("sun", "auto"), 1);
        assert_eq!(n_choices("none", "auto"), 0);
        assert_eq!(n_choices("sun", "1"), 0);
    }

    /// Cancels work at one of its checks.
    struct CancelAt(AtomicI64);

    impl Progress for CancelAt {
        fn is_cancelled(&self) -> bool {
            self.0.fetch_sub(1, Ordering::Relaxed) <= 0
        }
    }

    /// A sequence of a plane of points, and of the same points in reverse order.
    fn sequence() -> BuiltScene {
        let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
        let mut object = ObjectDescription::new("memory:a");
        object.files.push("memory:b".into());
        object.fps = Some(1.0);
        let mut description = SceneDescription::default();
        description.objects.push(object);
        let positions: Vec<Vec3> = (0..400).map(corner).collect();
        let reversed = positions.iter().rev().copied().collect();
        for (name, positions) in [("memory:a", positions), ("memory:b", reversed)] {
            let cloud = Arc::new(PointCloud::from_positions(positions));
            description.memory.insert(name, MemoryContent::Points(cloud, None));
        }
        resolve(&description, &NoProgress).unwrap().build(&NoProgress).unwrap()
    }

    fn point_at(scene: &BuiltScene, [x, y]: [f64; 2]) -> Option<u32> {
        let ray = [x, y, 5.0, 0.0, 0.0, -1.0];
        scene.cast_rays(&[ray]).unwrap()[0].as_ref()?.point
    }

    #[test]
    fn points_of_each_file_of_a_sequence_have_their_own_indices() {
        let mut scene = sequence();
        for (time_secs, expected) in [(0.0, 43), (1.0, 356), (0.0, 43)] {
            scene.seek(time_secs, &NoProgress).unwrap();
            assert_eq!(point_at(&scene, [3.0, 2.0]), Some(expected), "{time_secs}");
        }
    }

    #[test]
    fn a_file_of_a_sequence_whose_reading_was_cancelled_is_read_again() {
        let mut scene = sequence();
        let n_enough = i64::MAX;
        let all = CancelAt(AtomicI64::new(n_enough));
        scene.seek(1.0, &all).unwrap();
        let n_checks = n_enough - all.0.load(Ordering::Relaxed);
        // The last checks are those of the tree.
        for n_passed in [0, n_checks / 2, n_checks - 3, n_checks - 2, n_checks - 1] {
            scene.seek(0.0, &NoProgress).unwrap();
            assert!(scene.seek(1.0, &CancelAt(AtomicI64::new(n_passed))).is_err(), "{n_passed}");
            scene.seek(1.0, &NoProgress).unwrap();
            assert_eq!(point_at(&scene, [3.0, 2.0]), Some(356), "{n_passed}");
        }
    }
}
