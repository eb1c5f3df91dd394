//! A client's picture: a draft while the view changes, then samples accumulated a few rows at a time.

use crate::deadline::Deadline;
use crate::dynamic_resolution::ResolutionController;
use crate::encode::{self, Pixels};
use crate::frame::{Frame, PlacedFile, Quality};
use crate::keyframe::{Keyframe, keyframe_size};
use crate::sample_counts::{Stage, after_pass, is_sent, of_samples, rest_samples};
use crate::scene_provider::{PicturePart, PreparedScene};
use crate::slice_timing::{SLICE_SECS, SliceTiming};
use crate::view::ViewState;
use std::sync::Arc;
use std::time::Instant;
use surfel_core::Result;
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::progress::Progress;
use surfel_core::render::{
    POINT_SIZE_RANGE, RenderRegion, RenderStats, Renderer, Settings, uses_rasterizer,
};
use surfel_core::scene::Camera;

/// The samples of a client's picture so far.
#[derive(Default)]
pub struct Accumulator {
    /// Version of the view that the last draft showed.
    version: u64,
    /// The prepared scene, and a copy of its flat scene with the client's camera.
    scene: Option<(Arc<PreparedScene>, FlatScene)>,
    resolution: ResolutionController,
    /// Linear colours, summed over the samples that each row has.
    sum: Vec<[f32; 4]>,
    /// Coverage, summed likewise; empty without an overlay.
    coverage_sum: Vec<f32>,
    /// Number of samples that all rows have.
    n_samples: u32,
    /// Number of rows, from the top, that have the samples of one more pass.
    n_rows: u32,
    /// Number of samples of that pass.
    n_pass_samples: u32,
    /// Sizes and durations of drafts and slices.
    timing: SliceTiming,
    /// True if there is a picture worth showing that has not been sent.
    has_frame: bool,
    /// The last picture at rest, from which drafts are drawn.
    keyframe: Option<KeyframeOf>,
    /// The keyframe of the picture that is being refined.
    next_keyframe: Option<KeyframeOf>,
    /// Duration of a row of the keyframe that is being made, in seconds.
    keyframe_secs_per_row: f64,
    /// Duration of drawing the keyframe and encoding the draft, in seconds.
    keyframe_secs: f64,
    /// The traced part of the last draft, which fills what the keyframe does not show in the next one, too.
    last_traced: Option<Image>,
    work: Work,
}

/// A keyframe with the picture that it is of.
struct KeyframeOf {
    keyframe: Keyframe,
    scene: Arc<PreparedScene>,
    /// Version of the view.
    version: u64,
    /// Number of rows, from the top, whose places are known.
    n_rows: u32,
    has_colors: bool,
}

/// Rendering work since the last picture was sent.
#[derive(Clone, Copy, Default)]
struct Work {
    trace_secs: f64,
    n_rays: u64,
}

/// Light samples a hit in drafts.
const DRAFT_LIGHT_SAMPLES: u32 = 1;
/// Fraction of the keyframe's width from which a draft is shown as it was traced.
const SHARP_DRAFT: f64 = 0.8;
/// Least fraction of the time of a draft that is spent tracing.
const MIN_TRACED: f64 = 0.3;
/// JPEG quality of drafts, from 1 to 100.
const DRAFT_JPEG_QUALITY: u8 = 80;
/// JPEG quality of refined pictures, from 1 to 100.
const REFINED_JPEG_QUALITY: u8 = 92;
impl Accumulator {
    /// Version of the view that the last draft showed.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Returns whether even the smallest slice takes long.
    pub fn is_slow(&self) -> bool {
        self.timing.is_slow()
    }

    /// Renders a draft as large as `secs` allow; none without a scene.
    ///
    /// # Errors
    ///
    /// Fails if rendering fails or is cancelled.
    pub fn draft(
        &mut self,
        renderer: &dyn Renderer,
        view: &ViewState,
        secs: f64,
        progress: &dyn Progress,
    ) -> Result<Option<Frame>> {
        let Some(prepared) = view.scene.clone() else { return Ok(None) };
        self.finish_keyframe(&prepared, view.size);
        // Between two drafts little comes into view, and tracing takes longest.
        let is_reusable = view.is_moving && self.keyframe.is_some();
        let (traced, stats) = match self.last_traced.take().filter(|_| is_reusable) {
            Some(traced) => (traced, RenderStats::default()),
            None => match self.trace_draft(renderer, view, &prepared, secs, progress)? {
                Some((traced, stats)) => (traced, stats),
                None => return Ok(None),
            },
        };
        let Some(camera) = view.camera else { return Ok(None) };
        let start = Instant::now();
        let image = match self.draw_keyframe(&traced, &camera, view.size) {
            Some(drawn) => {
                self.last_traced = (0 < stats.rays.total()).then_some(traced);
                drawn
            }
            None => traced,
        };
        let (width, height) = (image.width, image.height);
        let mut files = vec![placed_file(jpeg(&image, DRAFT_JPEG_QUALITY), (0, 0), view.size)];
        if let Some(overlay) = &prepared.overlay {
            let patches = overlay.patches(&image, view.size, &camera, view.is_moving);
            files.extend(patches.iter().map(|PicturePart { x, y, image }| {
                let file = jpeg(image, REFINED_JPEG_QUALITY);
                placed_file(file, (*x, *y), (image.width, image.height))
            }));
        }
        self.keyframe_secs = start.elapsed().as_secs_f64();
        Ok(Some(Frame {
            quality: Quality::Draft,
            width: width as u16,
            height: height as u16,
            samples: 1,
            of_samples: of_samples(&prepared),
            files,
            trace_secs: stats.frame_secs,
            encode_secs: start.elapsed().as_secs_f64(),
            mrays_per_s: Work::of(&stats).mrays_per_s(),
        }))
    }

    /// Traces a draft as large as `secs` allow; none without a camera.
    fn trace_draft(
        &mut self,
        renderer: &dyn Renderer,
        view: &ViewState,
        prepared: &Arc<PreparedScene>,
        secs: f64,
        progress: &dyn Progress,
    ) -> Result<Option<(Image, RenderStats)>> {
        let full = prepared.render_settings;
        let keyframe_secs = if self.keyframe.is_some() { self.keyframe_secs } else { 0.0 };
        let secs = (secs - keyframe_secs).max(MIN_TRACED * secs);
        let (width, height) = self.resolution.size(view.size, secs);
        let light_samples = full.light_samples.min(DRAFT_LIGHT_SAMPLES);
        // The page enlarges a draft to its own size, and the points with it.
        let point_size = full.point_size * width as f32 / view.size.0.max(1) as f32;
        let (min, max) = POINT_SIZE_RANGE;
        let settings = Settings {
            width,
            height,
            samples_per_pixel: 1,
            light_samples,
            point_size: point_size.clamp(min, max),
            ..full
        };
        let n_pixels = u64::from(width) * u64::from(height);
        let Some(scene) = self.scene(prepared.clone(), view) else { return Ok(None) };
        let deadline = Deadline::new(progress, ResolutionController::is_min_size((width, height)));
        let start = Instant::now();
        let rendered = renderer.render(scene, &settings, &deadline);
        self.timing.record(start.elapsed().as_secs_f64(), rendered.is_ok());
        self.resolution.record(n_pixels, self.timing.secs());
        rendered.map(Some)
    }

    /// Starts the finished picture of the view that a draft showed.
    pub fn begin(&mut self, version: u64) {
        self.version = version;
        (self.n_samples, self.n_rows, self.has_frame) = (0, 0, false);
        // A page that moves needs no memory for samples.
        (self.sum, self.coverage_sum) = (Vec::new(), Vec::new());
        self.work = Work::default();
    }

    /// Renders one slice and adds it; returns whether there was one to render.
    ///
    /// # Errors
    ///
    /// Fails if rendering fails or is cancelled.
    pub fn refine(
        &mut self,
        renderer: &dyn Renderer,
        view: &ViewState,
        stage: Stage,
        progress: &dyn Progress,
    ) -> Result<bool> {
        let Some(prepared) = view.scene.clone() else { return Ok(false) };
        let (width, height) = view.size;
        if 0 < self.n_samples && self.extend_keyframe(renderer, view, &prepared, progress)? {
            return Ok(true);
        }
        let of_samples = of_samples(&prepared);
        let is_begun = 0 < self.n_samples;
        let target = match stage {
            Stage::Finish => of_samples,
            Stage::Rest if is_begun => rest_samples(&prepared),
            Stage::Rest => 0,
        };
        if target <= self.n_samples || self.has_frame {
            return Ok(false);
        }
        let full = prepared.render_settings;
        let settings = Settings {
            width,
            height,
            samples_per_pixel: target,
            // As many for each sample.
            light_samples: full.light_samples.saturating_mul(target / of_samples),
            ..full
        };
        let is_rasterized = uses_rasterizer(&prepared.flat)?;
        let slice = self.next_slice((width, height), target, is_rasterized);
        let n_rows = slice.rows.1 - slice.rows.0;
        let Some(scene) = self.scene(prepared, view) else { return Ok(false) };
        let deadline = Deadline::new(progress, n_rows == 1 || is_rasterized);
        let start = Instant::now();
        let rendered = renderer.render_region(scene, &settings, slice, &deadline);
        self.timing.record_slice(n_rows, start.elapsed().as_secs_f64(), rendered.is_ok());
        let (image, stats) = rendered?;
        self.work += Work::of(&stats);
        let has_overlay = view.scene.as_ref().is_some_and(|scene| scene.overlay.is_some());
        self.add(&image, slice, width as usize * height as usize, has_overlay);
        if self.n_rows == height {
            (self.n_samples, self.n_rows) = (slice.samples.1, 0);
            self.has_frame = is_sent(self.n_samples, of_samples);
        }
        Ok(true)
    }

    /// Takes the picture so far, if it is worth showing and has not been taken.
    pub fn take_frame(&mut self, view: &ViewState) -> Option<Frame> {
        if !std::mem::take(&mut self.has_frame) {
            return None;
        }
        let prepared = view.scene.as_ref()?;
        let of_samples = of_samples(prepared);
        let (width, height) = view.size;
        let is_finished = of_samples <= self.n_samples;
        let start = Instant::now();
        let drawn = prepared.overlay.as_ref().zip(view.camera).map(|(overlay, camera)| {
            let mut image = self.mean(view.size);
            overlay.draw(&mut image, &camera);
            image
        });
        let pixels = match &drawn {
            Some(image) => pixels_of(image),
            None => Pixels {
                width: width as u16,
                height: height as u16,
                sum: &self.sum,
                weight: self.n_samples as f32,
            },
        };
        let file = match is_finished {
            true => encode::png(pixels),
            false => encode::jpeg(pixels, REFINED_JPEG_QUALITY),
        };
        self.release_samples(prepared, view.size);
        let work = std::mem::take(&mut self.work);
        Some(Frame {
            quality: if is_finished { Quality::Finished } else { Quality::Refined },
            width: width as u16,
            height: height as u16,
            samples: self.n_samples,
            of_samples,
            files: vec![placed_file(file, (0, 0), view.size)],
            trace_secs: work.trace_secs,
            encode_secs: start.elapsed().as_secs_f64(),
            mrays_per_s: work.mrays_per_s(),
        })
    }

    /// The mean of the samples so far.
    fn mean(&self, (width, height): (u32, u32)) -> Image {
        let scale = 1.0 / self.n_samples as f32;
        let color = self.sum.iter().map(|sum| sum.map(|channel| scale * channel)).collect();
        let coverage = self.coverage_sum.iter().map(|sum| scale * sum).collect();
        Image { width, height, color, coverage, aovs: None }
    }

    /// Finds what the next rows of the keyframe show; returns false if all are known.
    fn extend_keyframe(
        &mut self,
        renderer: &dyn Renderer,
        view: &ViewState,
        prepared: &Arc<PreparedScene>,
        progress: &dyn Progress,
    ) -> Result<bool> {
        let size = keyframe_size(view.size);
        let is_known = |known: &KeyframeOf| known.version == self.version;
        if self.keyframe.as_ref().is_some_and(is_known) || uses_rasterizer(&prepared.flat)? {
            return Ok(false);
        }
        let version = self.version;
        let n_known = self.next_keyframe.as_ref().filter(|next| next.version == version);
        let first = n_known.map_or(0, |next| next.n_rows);
        let secs_per_row = self.keyframe_secs_per_row.max(0.5 * self.timing.secs_per_row());
        let n_rows = ((SLICE_SECS / secs_per_row.max(1e-6)) as u32).max(1);
        let rows = (first, size.1.min(first.saturating_add(n_rows)));
        let settings = position_settings(prepared.render_settings, size);
        let region = RenderRegion { rows, columns: (0, size.0), samples: (0, 1) };
        let deadline = Deadline::new(progress, rows.1 - rows.0 == 1);
        let Some(scene) = self.scene(prepared.clone(), view) else { return Ok(false) };
        let start = Instant::now();
        let rendered = renderer.render_region(scene, &settings, region, &deadline);
        // A slice that was cancelled because it took too long is tried again with fewer rows.
        self.keyframe_secs_per_row = start.elapsed().as_secs_f64() / f64::from(rows.1 - rows.0);
        let (image, stats) = rendered?;
        self.work += Work::of(&stats);
        let next = self.next_keyframe.take().filter(|next| next.version == version);
        let mut next = next.unwrap_or_else(|| KeyframeOf {
            keyframe: Keyframe::new(size),
            scene: prepared.clone(),
            version,
            n_rows: 0,
            has_colors: false,
        });
        if let Some(aovs) = &image.aovs {
            next.keyframe.set_rows(rows.0, aovs);
        }
        next.n_rows = rows.1;
        if next.n_rows == size.1 {
            self.keyframe = Some(next);
            self.release_samples(prepared, view.size);
        } else {
            self.next_keyframe = Some(next);
        }
        Ok(true)
    }

    /// Frees the samples of a picture that has been taken and goes on to no more, once its keyframe has their colours: a
    /// page then keeps no more than its keyframe.
    fn release_samples(&mut self, prepared: &Arc<PreparedScene>, size: (u32, u32)) {
        if self.n_samples < rest_samples(prepared) || self.has_frame {
            return;
        }
        let has_none = uses_rasterizer(&prepared.flat).unwrap_or(false);
        let is_known = |known: &KeyframeOf| known.version == self.version;
        if has_none || self.keyframe.as_ref().is_some_and(is_known) {
            self.finish_keyframe(prepared, size);
            (self.sum, self.coverage_sum) = (Vec::new(), Vec::new());
            self.last_traced = None;
        }
    }

    /// Takes the colours of the keyframe from the samples so far. Forgets keyframes of other scenes and sizes.
    fn finish_keyframe(&mut self, prepared: &Arc<PreparedScene>, size: (u32, u32)) {
        let is_of = |known: &KeyframeOf| {
            let is_same_size = known.keyframe.size() == keyframe_size(size);
            Arc::ptr_eq(&known.scene, prepared) && is_same_size
        };
        let is_complete = self.sum.len() == size.0 as usize * size.1 as usize;
        let Some(known) = self.keyframe.as_mut().filter(|known| is_of(known)) else {
            self.keyframe = None;
            return;
        };
        if !known.has_colors && known.version == self.version && is_complete && 0 < self.n_samples {
            let (sum, n_samples, n_rows) = (&self.sum, self.n_samples, self.n_rows);
            let n_pass_samples = self.n_pass_samples;
            known.keyframe.set_colors(size, |x, y| {
                let n_more = if y < n_rows { n_pass_samples } else { 0 };
                let scale = 1.0 / (n_samples + n_more) as f32;
                let [r, g, b, _] = sum[(y * size.0 + x) as usize];
                [r, g, b].map(|channel| scale * channel)
            });
            known.has_colors = true;
        }
        self.keyframe.take_if(|known| !known.has_colors);
    }

    /// Draws the keyframe as the camera sees it, where that is sharper than the traced draft.
    fn draw_keyframe(&self, traced: &Image, camera: &Camera, full: (u32, u32)) -> Option<Image> {
        let KeyframeOf { keyframe, scene, .. } = self.keyframe.as_ref()?;
        let (width, height) = keyframe_size(full);
        if SHARP_DRAFT * f64::from(width) <= f64::from(traced.width) {
            return None;
        }
        let view = camera.view(scene.flat.origin, width, height);
        Some(keyframe.draw(&view, traced))
    }

    /// Returns the next rows and samples toward `target`. The rasterizer draws all points for any number of rows, so it gets
    /// all rows.
    fn next_slice(
        &self,
        (width, height): (u32, u32),
        target: u32,
        is_rasterized: bool,
    ) -> RenderRegion {
        let n_rows = if is_rasterized { height } else { self.timing.n_affordable_rows() };
        let rows = (self.n_rows, height.min(self.n_rows.saturating_add(n_rows)));
        let samples = (self.n_samples, after_pass(self.n_samples, target));
        RenderRegion { rows, columns: (0, width), samples }
    }

    fn add(&mut self, image: &Image, slice: RenderRegion, n_pixels: usize, has_overlay: bool) {
        if slice.rows.0 == 0 && slice.samples.0 == 0 {
            self.sum.clear();
            self.sum.resize(n_pixels, [0.0; 4]);
            self.coverage_sum.clear();
            self.coverage_sum.resize(if has_overlay { n_pixels } else { 0 }, 0.0);
        }
        let start = slice.rows.0 as usize * image.width as usize;
        let weight = slice.n_samples() as f32;
        for (sum, color) in self.sum[start..].iter_mut().zip(&image.color) {
            for (sum, channel) in sum.iter_mut().zip(color) {
                *sum += weight * channel;
            }
        }
        for (sum, coverage) in self.coverage_sum.iter_mut().skip(start).zip(&image.coverage) {
            *sum += weight * coverage;
        }
        (self.n_rows, self.n_pass_samples) = (slice.rows.1, slice.n_samples());
    }

    /// The flat scene with the client's camera; none without a camera.
    fn scene(&mut self, prepared: Arc<PreparedScene>, view: &ViewState) -> Option<&FlatScene> {
        if !self.scene.as_ref().is_some_and(|(known, _)| Arc::ptr_eq(known, &prepared)) {
            let flat = prepared.flat.clone();
            self.scene = Some((prepared, flat));
        }
        let (_, scene) = self.scene.as_mut()?;
        scene.camera = view.camera?;
        Some(scene)
    }
}

/// Returns settings of a picture of this size that shows the position of each pixel, for as few rays as there can be.
fn position_settings(full: Settings, (width, height): (u32, u32)) -> Settings {
    Settings {
        width,
        height,
        samples_per_pixel: 1,
        light_samples: 1,
        max_depth: 0,
        with_aovs: true,
        ..full
    }
}

fn jpeg(image: &Image, quality: u8) -> Vec<u8> {
    encode::jpeg(pixels_of(image), quality)
}

fn pixels_of(image: &Image) -> Pixels<'_> {
    let (width, height) = (image.width as u16, image.height as u16);
    Pixels { width, height, sum: &image.color, weight: 1.0 }
}

fn placed_file(file: Vec<u8>, (x, y): (u32, u32), (width, height): (u32, u32)) -> PlacedFile {
    let [x, y, width, height] = [x, y, width, height].map(|length| length as u16);
    PlacedFile { x, y, width, height, file }
}

impl Work {
    fn of(stats: &RenderStats) -> Self {
        Self { trace_secs: stats.frame_secs, n_rays: stats.rays.total() }
    }

    fn mrays_per_s(&self) -> f64 {
        self.n_rays as f64 / self.trace_secs.max(1e-9) / 1e6
    }
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.trace_secs += other.trace_secs;
        self.n_rays += other.n_rays;
    }
}
