//! A scene whose settings change: after a change only what it touches is made again.

use crate::added_objects::{first_added, without_added};
use crate::built_scene::{exposure_stops, planes_before};
use crate::cache::Lru2;
use crate::crs::Unit;
use crate::description::{Exposure, Interior, SceneDescription};
use crate::error::Result;
use crate::live_trees::{BuildCache, TreeSource};
use crate::live_view::{LiveView, SceneTrees};
use crate::picture::RenderedImage;
use crate::renderer::SceneRenderer;
use crate::resolve::{
    AutoSettings, KeepOptions, LoadedScene, MemoryEstimate, Metering, coordinate_system, expose,
    render_settings,
};
use crate::scene_keys::{filter_key, grouping_key, preparation_key, tree_key};
use crate::thread_pools::{lower_priority, start_threads};
use rayon::ThreadPool;
use std::sync::{Arc, OnceLock};
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::points::PreparedCloud;
use surfel_core::progress::Progress;
use surfel_core::render::{self, RenderRegion, RenderStats, Renderer, Settings};
use surfel_core::scene::ClipPlane;
use surfel_core::scene::color::Legend;
use surfel_core::trace::Simd;

/// A loaded scene that is shown under one description after another. Threads share it.
#[derive(Debug)]
pub struct LiveScene {
    startup: SceneDescription,
    /// The content of the files as the startup groups them.
    loaded: Arc<LoadedScene>,
    /// The content with other files apart, as those that have settings of their own.
    regrouped: Lru2<LoadedScene>,
    /// The content with objects that were added.
    extended: Lru2<LoadedScene>,
    /// The content without the points that a description drops.
    filtered: Lru2<LoadedScene>,
    cache: BuildCache,
    /// Apart, so that previews leave what was made of all points.
    preview_cache: BuildCache,
    renderer: SceneRenderer,
    /// Walls that the first camera hides; they stay hidden while it moves, so that no tree is built again.
    hidden_walls: OnceLock<Vec<ClipPlane>>,
    /// Threads beside those that draw: preparation for one viewer must not hold up another's picture.
    preparation_threads: ThreadPool,
    /// Threads for whole pictures, which take long, once one is rendered. They run when the others leave processors idle.
    picture_threads: OnceLock<ThreadPool>,
    use_case: UseCase,
}

/// The callers of a live scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UseCase {
    /// Several viewers. Walls that the first camera hides stay hidden while it moves, and points so large that each ray
    /// meets thousands of them are refused, as others would wait.
    Viewers,
    /// A program that makes one picture after another, each as `surfel render` would.
    Pictures,
}

impl LiveScene {
    /// Reads the files of a description. All later descriptions have the same files, objects, lamps and animations. Behind
    /// these objects they may have others, whose content is in memory.
    ///
    /// # Errors
    ///
    /// Fails as reading does, and if threads cannot be started.
    pub fn open(
        description: &SceneDescription,
        use_case: UseCase,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut startup = description.clone();
        startup.apply_object_settings()?;
        let preparation_threads = start_threads(&description.run, |_| ())?;
        let read = || LoadedScene::read(&startup, KEEP, progress);
        let loaded = match description.run.threads {
            Some(_) => preparation_threads.install(read),
            None => read(),
        }?;
        Ok(Self {
            startup,
            loaded: Arc::new(loaded),
            regrouped: Lru2::default(),
            extended: Lru2::default(),
            filtered: Lru2::default(),
            cache: BuildCache::default(),
            preview_cache: BuildCache::default(),
            renderer: SceneRenderer::new(&description.run)?,
            hidden_walls: OnceLock::new(),
            preparation_threads,
            picture_threads: OnceLock::new(),
            use_case,
        })
    }

    /// Returns the number of threads that prepare and render.
    pub fn n_threads(&self) -> usize {
        self.preparation_threads.current_num_threads()
    }

    /// Runs `work` on the threads of preparation if the settings state their number, or else on the caller's.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match self.startup.run.threads {
            Some(_) => self.preparation_threads.install(work),
            None => work(),
        }
    }

    /// Frees everything that can be made again from the files' content. Views that are still held stay whole.
    pub fn release(&self) {
        self.regrouped.clear();
        self.extended.clear();
        self.filtered.clear();
        self.cache.clear();
        self.preview_cache.clear();
    }

    /// Returns the description of the start, in which files with settings of their own are objects.
    pub fn startup(&self) -> &SceneDescription {
        &self.startup
    }

    /// Returns the content of the files, grouped as at the start.
    pub fn loaded(&self) -> &LoadedScene {
        &self.loaded
    }

    /// Returns the content of the files, those apart that have settings or a material of their own, and of added objects.
    /// Reads the files again unless a description grouped them like this lately.
    ///
    /// # Errors
    ///
    /// Fails as reading does.
    pub fn loaded_for(
        &self,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<Arc<LoadedScene>> {
        let first = first_added(description, &self.startup);
        if first == description.objects.len() {
            return self.regrouped_for(description, progress);
        }
        self.extended.get_or_make(grouping_key(description), progress, |progress| {
            let base = self.regrouped_for(&without_added(description, first), progress)?;
            base.with_further_objects(description, progress)
        })
    }

    fn regrouped_for(
        &self,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<Arc<LoadedScene>> {
        let key = grouping_key(description);
        if key == grouping_key(&self.startup) {
            return Ok(self.loaded.clone());
        }
        self.regrouped.get_or_make(key, progress, |progress| {
            let startup = SceneDescription {
                objects_default: self.startup.objects_default.clone(),
                picture: self.startup.picture.clone(),
                ..description.clone()
            };
            LoadedScene::read(&startup, KEEP, progress)
        })
    }

    /// Makes the choices that a description leaves open, of the points that it keeps; also returns the content with those
    /// points alone.
    ///
    /// # Errors
    ///
    /// Fails for settings that do not fit the data, and if cancelled.
    pub fn choose(
        &self,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<(Arc<LoadedScene>, AutoSettings)> {
        self.choose_of(self.loaded_for(description, progress)?, description, progress)
    }

    fn choose_of(
        &self,
        loaded: Arc<LoadedScene>,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<(Arc<LoadedScene>, AutoSettings)> {
        let kept = match loaded.has_more_than(description) {
            false => loaded,
            true => self.filtered.get_or_make(filter_key(description), progress, |progress| {
                loaded.filtered(description, progress)
            })?,
        };
        kept.check_colors(description)?;
        let auto = AutoSettings::choose(&kept, description, progress)?;
        Ok((kept, auto))
    }

    /// Returns about how many bytes the scene takes once it is prepared.
    pub fn memory_estimate(&self) -> u64 {
        let subsample = self.startup.objects_default.preparation.subsample;
        MemoryEstimate::from_graph(&self.loaded.graph, subsample, 0).held()
    }

    /// Returns the SIMD level of the kernels.
    pub fn simd(&self) -> Simd {
        self.renderer.simd()
    }

    /// Returns true if the clouds were prepared under a description lately.
    pub fn is_prepared(&self, description: &SceneDescription) -> bool {
        let first = first_added(description, &self.startup);
        let has_added = first < description.objects.len();
        let base = preparation_key(&without_added(description, first));
        let is_added_prepared =
            !has_added || self.cache.prepared_added.contains(preparation_key(description));
        is_added_prepared && self.cache.prepared.contains(base)
    }

    /// Returns the scene under a description at the description's time.
    ///
    /// # Errors
    ///
    /// Fails for settings that do not fit the data, and if cancelled.
    pub fn view(
        &self,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<LiveView> {
        self.view_of(&self.cache, description, progress)
    }

    /// Returns the scene under a description that keeps few points, to be shown for a moment.
    ///
    /// # Errors
    ///
    /// Fails as [`view`](Self::view) does.
    pub fn preview(
        &self,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<LiveView> {
        self.view_of(&self.preview_cache, description, progress)
    }

    fn view_of(
        &self,
        cache: &BuildCache,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<LiveView> {
        let loaded = self.loaded_for(description, progress)?;
        let (kept, mut auto) = self.choose_of(loaded.clone(), description, progress)?;
        let description = &auto.with_color(description);
        if self.use_case == UseCase::Viewers {
            let first = self.hidden_walls.get_or_init(|| auto.hidden_walls.clone());
            let is_open = description.camera.interior() != Interior::Off;
            auto.hidden_walls = if is_open { first.clone() } else { Vec::new() };
        }
        let mut complete = auto.complete_description(&kept);
        let settings = Settings { with_aovs: false, ..render_settings(&complete) };
        let time_secs = description.output.time();
        let exposure = description.light.exposure();
        // An automatic exposure is chosen at second 0, as for a movie. Otherwise the first file of a sequence is not read.
        let metered_at = if exposure == Exposure::Auto { 0.0 } else { time_secs };
        let at = |secs| self.flat_at(cache, &kept, secs, description, &auto, progress);
        let (mut trees, mut flat) = at(metered_at)?;
        let has_legend = trees.legend != Legend::None;
        let metering = Metering { plan: auto.whole_plan, has_legend };
        let picture = (&flat, &settings);
        let meter = || exposure_stops(exposure, &self.renderer, picture, &metering, progress);
        let stops = self.preparation_threads.install(meter)?;
        if metered_at != time_secs {
            (trees, flat) = at(time_secs)?;
        }
        expose(&mut flat, stops);
        complete.light.exposure = Some(Exposure::Stops(stops.into()));
        let moves_camera = auto.moves_camera(&kept);
        let system = coordinate_system(&loaded, description);
        let unit = system.map_or(Unit::Unknown, |system| system.unit());
        Ok(LiveView {
            loaded,
            flat,
            settings,
            description: complete,
            color_source: kept.color_source(),
            moves_camera,
            unit,
            turned_room: auto.turned_room,
            trees,
        })
    }

    /// Renders the picture of a view with its overlay, on the caller's threads.
    ///
    /// # Errors
    ///
    /// Fails if the settings make no picture, and if cancelled.
    pub fn picture(
        &self,
        view: &LiveView,
        with_aovs: bool,
        progress: &dyn Progress,
    ) -> Result<(RenderedImage, RenderStats)> {
        let settings = Settings { with_aovs, ..view.settings };
        let (image, stats) = self.renderer.render(&view.flat, &settings, progress)?;
        Ok((view.finished(image), stats))
    }

    /// Renders a region of the picture of a view, without layers and overlay.
    ///
    /// # Errors
    ///
    /// Fails if the picture has no such region, and if cancelled.
    pub fn region(
        &self,
        view: &LiveView,
        (columns, rows): ((u32, u32), (u32, u32)),
        progress: &dyn Progress,
    ) -> Result<Image> {
        let region = RenderRegion { columns, rows, ..RenderRegion::whole(&view.settings) };
        Ok(self.renderer.render_region(&view.flat, &view.settings, region, progress)?.0)
    }

    /// Renders a view on threads of the lowest priority, however many others wait for their preparation.
    ///
    /// # Errors
    ///
    /// Fails if the settings make no picture, if threads cannot be started, and if cancelled.
    pub fn render(&self, view: &LiveView, progress: &dyn Progress) -> Result<Image> {
        let rendered = || self.renderer.render(&view.flat, &view.settings, progress);
        Ok(self.picture_threads()?.install(rendered)?.0)
    }

    /// Returns the threads for whole pictures, which are started unless they are there.
    fn picture_threads(&self) -> Result<&ThreadPool> {
        if let Some(threads) = self.picture_threads.get() {
            return Ok(threads);
        }
        let threads = start_threads(&self.startup.run, |_| lower_priority())?;
        Ok(self.picture_threads.get_or_init(|| threads))
    }

    fn flat_at(
        &self,
        cache: &BuildCache,
        loaded: &LoadedScene,
        time_secs: f64,
        description: &SceneDescription,
        auto: &AutoSettings,
        progress: &dyn Progress,
    ) -> Result<(Arc<SceneTrees>, FlatScene)> {
        let trees = self.trees_at(cache, loaded, time_secs, description, auto, progress)?;
        let mut flat = trees.flat.clone();
        flat.lights.clone_from(&auto.lights);
        flat.background = description.picture.background();
        // What would fail while it is drawn is refused as a whole.
        render::check(&flat)?;
        if trees.graph.animation.channels.is_empty() {
            flat.camera = auto.camera.at(time_secs, &trees.graph);
        } else {
            let mut graph = trees.graph.clone();
            graph.evaluate_at(time_secs);
            flat.update(&graph, progress)?;
            flat.camera = auto.camera.at(time_secs, &graph);
        }
        flat.camera_planes = planes_before(auto.turned_room.as_ref(), &flat.camera);
        Ok((trees, flat))
    }

    /// Everything but lights and camera, which change without any tree.
    fn trees_at(
        &self,
        cache: &BuildCache,
        loaded: &LoadedScene,
        time_secs: f64,
        description: &SceneDescription,
        auto: &AutoSettings,
        progress: &dyn Progress,
    ) -> Result<Arc<SceneTrees>> {
        let preparation = preparation_key(description);
        let frames = loaded.sequence_frames_at(time_secs);
        let trees = tree_key(description, preparation, auto, &frames);
        cache.trees.get_or_make(trees, progress, |progress| {
            let clouds = self.prepared(cache, loaded, description, progress)?;
            let limits_overlap = self.use_case == UseCase::Viewers;
            let source = TreeSource { loaded, time_secs, description, auto, limits_overlap };
            let build = || source.build(clouds, &cache.known_trees, progress);
            self.preparation_threads.install(build)
        })
    }

    /// The prepared clouds of all files and objects.
    fn prepared(
        &self,
        cache: &BuildCache,
        loaded: &LoadedScene,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<Vec<PreparedCloud>> {
        let (first, n_objects) =
            (first_added(description, &self.startup), description.objects.len());
        let prepare = |added: bool, progress: &dyn Progress| {
            let is_meant =
                |object: Option<usize>| object.is_some_and(|object| first <= object) == added;
            self.preparation_threads.install(|| loaded.prepared(description, is_meant, progress))
        };
        let base = preparation_key(&without_added(description, first));
        let mut clouds = cache
            .prepared
            .get_or_make(base, progress, |progress| prepare(false, progress))?
            .to_vec();
        if first < n_objects {
            let key = preparation_key(description);
            let added = cache
                .prepared_added
                .get_or_make(key, progress, |progress| prepare(true, progress))?;
            clouds.extend_from_slice(&added);
        }
        Ok(clouds)
    }
}

/// The parts of files that are kept: the viewer shows all columns of a point, which is told by its index.
const KEEP: KeepOptions = KeepOptions { all_columns: true, source_indices: true };

#[cfg(test)]
mod tests;
