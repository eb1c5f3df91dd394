//! A client's picture: a draft while things move, then sample by sample, a few rows at a time.

use crate::client::Sight;
use crate::encode::{self, Pixels};
use crate::frame::Frame;
use crate::hurry::{Hurry, LONG};
use crate::pace::Pace;
use crate::studio::Stage;
use std::sync::Arc;
use std::time::Instant;
use surfel::Result;
use surfel::flat::FlatScene;
use surfel::progress::Progress;
use surfel::render::{Piece, RenderStats, Renderer, Settings};

#[derive(Default)]
pub struct Canvas {
    /// Of the sight that the draft was made of.
    version: u64,
    /// The stage's, with the client's camera.
    scene: Option<(Arc<Stage>, FlatScene)>,
    pace: Pace,
    /// Linear colours, summed over the samples that each row has.
    sum: Vec<[f32; 4]>,
    /// Samples that all rows have.
    n_samples: u32,
    /// Rows that have one more.
    n_rows: u32,
    secs_per_row: f64,
    /// What was painted last took so long.
    secs: f64,
    /// Whether something worth showing has not been sent.
    is_due: bool,
    work: Work,
}

/// What painting took since something was last sent.
#[derive(Clone, Copy, Default)]
struct Work {
    trace_secs: f64,
    n_rays: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    Draft,
    Better,
    Finished,
}

/// Rays toward the sky a pixel while things move.
const DRAFT_LIGHT_SAMPLES: u32 = 1;
/// Of JPEG, while things move and while they get better.
const DRAFT_QUALITY: u8 = 80;
const BETTER_QUALITY: u8 = 92;
/// What is painted at once while nothing moves.
const PIECE_SECS: f64 = 0.015;
/// Least rows of a piece, unless they take long: each piece has its own cost.
const LEAST_ROWS: u32 = 8;

impl Canvas {
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Whether even the least that can be painted takes long.
    pub fn is_slow(&self) -> bool {
        2.0 * LONG.as_secs_f64() < self.secs
    }

    /// What was given up would have taken longer: it does not make one quick who was slow.
    fn took(&mut self, secs: f64, is_done: bool) {
        self.secs = if is_done { secs } else { secs.max(self.secs) };
    }

    /// A picture as large as there is time for.
    pub fn draft(
        &mut self,
        renderer: &dyn Renderer,
        sight: &Sight,
        secs: f64,
        progress: &dyn Progress,
    ) -> Result<Option<Frame>> {
        let Some(stage) = sight.stage.clone() else { return Ok(None) };
        let of_samples = stage.quality.samples_per_pixel;
        let (width, height) = self.pace.size(sight.size, secs);
        let light_samples = stage.quality.light_samples.min(DRAFT_LIGHT_SAMPLES);
        let settings =
            Settings { width, height, samples_per_pixel: 1, light_samples, ..stage.quality };
        let n_pixels = u64::from(width) * u64::from(height);
        let Some(scene) = self.scene(stage, sight) else { return Ok(None) };
        let hurry = Hurry::new(progress, Pace::is_least((width, height)));
        let start = Instant::now();
        let rendered = renderer.render(scene, &settings, &hurry);
        self.took(start.elapsed().as_secs_f64(), rendered.is_ok());
        self.pace.learn(n_pixels, self.secs);
        let (image, stats) = rendered?;
        let pixels =
            Pixels { width: width as u16, height: height as u16, sum: &image.color, weight: 1.0 };
        Ok(Some(frame(pixels, Quality::Draft, of_samples, Work::of(&stats))))
    }

    /// Starts the finished picture of the sight that a draft was made of.
    pub fn begin(&mut self, version: u64) {
        self.version = version;
        (self.n_samples, self.n_rows, self.is_due) = (0, 0, false);
        self.work = Work::default();
    }

    /// Adds a piece; returns whether there was one to add.
    pub fn refine(
        &mut self,
        renderer: &dyn Renderer,
        sight: &Sight,
        progress: &dyn Progress,
    ) -> Result<bool> {
        let Some(stage) = sight.stage.clone() else { return Ok(false) };
        let (width, height) = sight.size;
        let settings = Settings { width, height, ..stage.quality };
        if self.n_samples == settings.samples_per_pixel || self.is_due {
            return Ok(false);
        }
        let piece = self.next_piece(height);
        let n_rows = piece.rows.1 - piece.rows.0;
        let Some(scene) = self.scene(stage, sight) else { return Ok(false) };
        let hurry = Hurry::new(progress, n_rows == 1);
        let start = Instant::now();
        let rendered = renderer.render_piece(scene, &settings, piece, &hurry);
        self.took(start.elapsed().as_secs_f64(), rendered.is_ok());
        self.secs_per_row = self.secs / f64::from(n_rows);
        let (image, stats) = rendered?;
        self.work += Work::of(&stats);
        self.add(&image.color, piece, width as usize * height as usize);
        if self.n_rows == height {
            (self.n_samples, self.n_rows) = (self.n_samples + 1, 0);
            // Each picture twice as good as the one before.
            let is_last = self.n_samples == settings.samples_per_pixel;
            self.is_due = self.n_samples.is_power_of_two() || is_last;
        }
        Ok(true)
    }

    /// The picture so far, if it should be seen.
    pub fn due(&mut self, sight: &Sight) -> Option<Frame> {
        if !std::mem::take(&mut self.is_due) {
            return None;
        }
        let of_samples = sight.stage.as_ref()?.quality.samples_per_pixel;
        let (width, height) = sight.size;
        let is_finished = self.n_samples == of_samples;
        let quality = if is_finished { Quality::Finished } else { Quality::Better };
        let pixels = Pixels {
            width: width as u16,
            height: height as u16,
            sum: &self.sum,
            weight: self.n_samples as f32,
        };
        Some(frame(pixels, quality, of_samples, std::mem::take(&mut self.work)))
    }

    fn next_piece(&self, height: u32) -> Piece {
        let affordable = PIECE_SECS / self.secs_per_row.max(1e-6);
        let is_slow = LONG.as_secs_f64() <= f64::from(LEAST_ROWS) * self.secs_per_row;
        let n_rows = (affordable as u32).max(if is_slow { 1 } else { LEAST_ROWS });
        let rows = (self.n_rows, height.min(self.n_rows.saturating_add(n_rows)));
        Piece { rows, samples: (self.n_samples, self.n_samples + 1) }
    }

    fn add(&mut self, color: &[[f32; 4]], piece: Piece, n_pixels: usize) {
        if piece.rows.0 == 0 && piece.samples.0 == 0 {
            self.sum.clear();
            self.sum.resize(n_pixels, [0.0; 4]);
        }
        let width = color.len() / (piece.rows.1 - piece.rows.0) as usize;
        let sums = &mut self.sum[piece.rows.0 as usize * width..];
        for (sum, color) in sums.iter_mut().zip(color) {
            for (sum, channel) in sum.iter_mut().zip(color) {
                *sum += channel;
            }
        }
        self.n_rows = piece.rows.1;
    }

    /// The stage's scene, seen by the client's camera.
    fn scene(&mut self, stage: Arc<Stage>, sight: &Sight) -> Option<&FlatScene> {
        if !self.scene.as_ref().is_some_and(|(known, _)| Arc::ptr_eq(known, &stage)) {
            let flat = stage.flat.clone();
            self.scene = Some((stage, flat));
        }
        let (_, scene) = self.scene.as_mut()?;
        scene.camera = sight.camera?;
        Some(scene)
    }
}

fn frame(pixels: Pixels, quality: Quality, of_samples: u32, work: Work) -> Frame {
    let start = Instant::now();
    let file = match quality {
        Quality::Draft => encode::jpeg(pixels, DRAFT_QUALITY),
        Quality::Better => encode::jpeg(pixels, BETTER_QUALITY),
        Quality::Finished => encode::png(pixels),
    };
    Frame {
        quality,
        width: pixels.width,
        height: pixels.height,
        samples: pixels.weight as u32,
        of_samples,
        file,
        trace_secs: work.trace_secs,
        encode_secs: start.elapsed().as_secs_f64(),
        mrays_per_s: work.n_rays as f64 / work.trace_secs.max(1e-9) / 1e6,
    }
}

impl Work {
    fn of(stats: &RenderStats) -> Self {
        Self { trace_secs: stats.frame_secs, n_rays: stats.rays.all() }
    }
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.trace_secs += other.trace_secs;
        self.n_rays += other.n_rays;
    }
}
