//! A scene made ready once and shown at one time after another: what moves is moved, all else stays.

use crate::args::SceneArgs;
use crate::eye::Eye;
use crate::report::Report;
use crate::sequence::Sequence;
use crate::{light, picture};
use surfel::flat::{FlatLamp, FlatScene};
use surfel::image::Image;
use surfel::math::{DQuat, Vec3};
use surfel::progress::Progress;
use surfel::render::{CpuRenderer, RenderStats, Renderer, Settings};
use surfel::scene::{Graph, Light, Scene};
use surfel::trace::Simd;

/// A scene as it is at second 0, prepared, and what is to happen in it.
pub struct Prepared<'a> {
    pub scene: Scene,
    pub sequences: Vec<Sequence<'a>>,
    pub eye: Eye,
    pub up: Vec3,
}

pub struct Playback<'a> {
    pub flat: FlatScene,
    renderer: CpuRenderer,
    graph: Graph,
    sequences: Vec<Sequence<'a>>,
    eye: Eye,
    up: Vec3,
    /// Before a turntable turns them.
    lights: Vec<Light>,
    lamps: Vec<FlatLamp>,
    /// By which all light was made brighter.
    stops: f32,
    settings: Settings,
}

impl<'a> Playback<'a> {
    /// Builds the trees, after which the graph's own points are forgotten.
    pub fn new(
        prepared: Prepared<'a>,
        settings: Settings,
        report: &Report,
    ) -> anyhow::Result<Self> {
        let Prepared { scene, sequences, eye, up } = prepared;
        let flat = FlatScene::new(&scene, report)?;
        report.end_stage();
        let mut graph = scene.graph;
        graph.forget_static();
        let renderer = CpuRenderer { simd: Simd::detect() };
        let (lights, lamps, stops) = (flat.lights.clone(), flat.lamps.clone(), 0.0);
        Ok(Self { flat, renderer, graph, sequences, eye, up, lights, lamps, stops, settings })
    }

    /// Sets how bright all light is, by the options or by what is seen at second 0, where it stands at first.
    pub fn expose(&mut self, args: &SceneArgs, report: &Report) -> anyhow::Result<()> {
        let stops = picture::exposure(&self.renderer, &self.flat, &self.settings, args, report)?;
        light::expose(&mut self.flat, stops);
        self.stops = stops;
        self.lights.clone_from(&self.flat.lights);
        self.lamps.clone_from(&self.flat.lamps);
        Ok(())
    }

    pub fn simd(&self) -> Simd {
        self.renderer.simd
    }

    /// Goes to a time, forward or back.
    pub fn seek(&mut self, time_secs: f64, report: &Report) -> anyhow::Result<()> {
        for sequence in &mut self.sequences {
            if !sequence.seek(time_secs, &mut self.graph, self.up, report)? {
                continue;
            }
            for geometry_idx in sequence.slots.geometries.iter().copied() {
                self.flat.replace(geometry_idx, &self.graph.geometries[geometry_idx], report)?;
            }
            self.flat.materials.clone_from(&self.graph.materials);
            self.flat.textures.clone_from(&self.graph.textures);
            report.end_stage();
        }
        if !self.graph.animation.channels.is_empty() || !self.sequences.is_empty() {
            self.graph.pose(time_secs);
            self.flat.update(&self.graph, report)?;
            self.graph.forget_static();
            light::expose_lamps(&mut self.flat.lamps, self.stops);
            self.lamps.clone_from(&self.flat.lamps);
        }
        self.flat.camera = self.eye.at(time_secs, &self.graph);
        Ok(())
    }

    /// Turns everything before the camera, under light that stays, from how the last `seek` left it.
    pub fn turn(&mut self, turn_rad: f64) {
        // Camera and light go round together: to turn everything else would move every tree.
        let turn = DQuat::from_axis_angle(self.up.as_dvec3(), turn_rad);
        let camera = self.flat.camera;
        let center = (camera.focal_point - self.flat.origin).as_vec3();
        self.flat.camera = camera.turned(turn);
        self.flat.lights = self.lights.iter().map(|light| light.turned(turn)).collect();
        self.flat.lamps = self.lamps.iter().map(|lamp| lamp.turned(turn, center)).collect();
    }

    pub fn tell_threads(&self, report: &Report) {
        let (n_threads, simd) = (rayon::current_num_threads(), self.simd().name());
        report.choice(&format!("{n_threads} threads, {simd}"), "--threads");
    }

    pub fn render(&self, progress: &dyn Progress) -> surfel::Result<(Image, RenderStats)> {
        self.renderer.render(&self.flat, &self.settings, progress)
    }
}
