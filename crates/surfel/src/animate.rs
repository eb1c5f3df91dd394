//! Movies: one frame after another, with a turntable if one is asked for.

use crate::built_scene::BuiltScene;
use crate::description::{Invalid, SceneDescription, ViewSettings};
use crate::error::{Error, Result};
use crate::memory_files::MemoryFiles;
use crate::picture::{RenderedImage, image_options};
use crate::progress_log::CancelOnly;
use crate::resolve::{AutoSettings, KeepOptions, LoadedScene, MemoryEstimate};
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use surfel_core::math::DVec3;
use surfel_core::progress::Progress;
use surfel_core::words::counted;
use surfel_formats::{Movie, MovieOptions};

/// Maximum number of frames that follows from the length of the movements.
const MAX_FRAMES: f64 = 1e6;

/// Returns the number of frames of a description's movie.
///
/// # Errors
///
/// Fails if nothing moves and no number is given, and for movements that take very long.
pub(crate) fn frame_count(
    description: &SceneDescription,
    animated_secs: f64,
) -> Result<u32, Invalid> {
    let output = &description.output;
    if let Some(frames) = output.frames {
        return Ok(frames);
    }
    let duration = animated_secs.max(output.turntable.unwrap_or(0.0));
    if duration <= 0.0 {
        let text = "nothing moves; set turntable, or frames for a still movie";
        return Err(Invalid::at("frames", text));
    }
    let n_frames = (duration * output.fps()).round().max(1.0);
    if MAX_FRAMES < n_frames {
        let text = format!(
            "the movements take {duration} s, which are {n_frames} frames, expected at most {MAX_FRAMES}; set frames, or \
             times in seconds"
        );
        return Err(Invalid::at("frames", text));
    }
    Ok(n_frames as u32)
}

/// Returns how a description's movie becomes a file; the number of frames and the fingerprint follow later.
pub(crate) fn movie_options(description: &SceneDescription) -> MovieOptions {
    let (width, height) = description.picture.resolution();
    MovieOptions {
        width,
        height,
        fps: description.output.fps(),
        n_frames: 1,
        image: image_options(description, DVec3::ZERO),
        fingerprint: String::new(),
    }
}

/// Checks that the movie of a description can be written to a file, before any other file is read.
///
/// # Errors
///
/// Fails if the format is unknown or has no such frames, if the folder does not exist, and for video if ffmpeg is missing
/// or refuses such frames.
pub fn check_movie(output: &Path, description: &SceneDescription) -> Result<()> {
    Ok(surfel_formats::check_movie(output, &movie_options(description))?)
}

/// Returns a text that changes with everything that frames depend on: the complete description, the sizes and times of
/// all files, and the clouds and meshes in memory. Threads, memory limit, output file and saved views change no frame.
fn fingerprint(
    complete: &SceneDescription,
    description: &SceneDescription,
    loaded: &LoadedScene,
) -> String {
    let external = loaded.file_infos.iter().flat_map(|info| &info.external_files);
    let files: BTreeSet<&PathBuf> = description.named_files().chain(external).collect();
    let stamps: Vec<_> = files.iter().map(|file| stamp(file, &description.memory)).collect();
    let mut frames = complete.clone();
    (frames.run.threads, frames.run.memory_limit, frames.output.output) = Default::default();
    frames.views = ViewSettings::default();
    let table = serde_json::Value::Object(frames.to_table());
    let text = format!("{} {table} {stamps:?}", env!("CARGO_PKG_VERSION"));
    let hash = text.bytes().fold(0, |hash, byte| surfel_core::math::hash(hash ^ u64::from(byte)));
    format!("{hash:016x}")
}

/// Returns a text that changes with the content of a file; `None` if it cannot be read.
fn stamp(file: &Path, memory: &MemoryFiles) -> Option<String> {
    if let Some(content) = memory.get(file) {
        return Some(format!("{file:?} {}", content.fingerprint()));
    }
    let data = std::fs::metadata(file).ok()?;
    Some(format!("{file:?} {} {:?}", data.len(), data.modified().ok()?))
}

/// A function that adds a finished frame, by its index from 0, as the bytes of a file.
pub type AddFrame<'f> = dyn FnMut(u32, &[u8]) -> Result<()> + 'f;

/// A movie whose files are read and whose choices are made.
#[derive(Debug)]
pub struct PlannedMovie {
    /// The content of the files.
    pub loaded: LoadedScene,
    /// The complete description, with everything that was chosen.
    pub complete: SceneDescription,
    description: SceneDescription,
    auto: AutoSettings,
    options: MovieOptions,
}

impl PlannedMovie {
    /// Reads the files of a description and chooses what it leaves open.
    ///
    /// # Errors
    ///
    /// Fails for missing and broken files, if nothing moves and no number of frames is given, and if cancelled.
    pub fn new(description: &SceneDescription, progress: &dyn Progress) -> Result<Self> {
        let mut description = description.clone();
        description.apply_object_settings()?;
        let mut options = movie_options(&description);
        let loaded = LoadedScene::read(&description, KeepOptions::default(), progress)?;
        options.n_frames = frame_count(&description, loaded.duration_secs())?;
        let auto = AutoSettings::choose(&loaded, &description, progress)?;
        let mut complete = auto.complete_description(&loaded);
        // The pixels of a plan are chosen from the data.
        (options.width, options.height) = complete.picture.resolution();
        complete.output.frames = Some(options.n_frames);
        complete.output.fps = Some(options.fps);
        Ok(Self { loaded, complete, description, auto, options })
    }

    /// Returns about how many bytes the scene takes once it is built.
    pub fn memory_estimate(&self) -> u64 {
        let subsample = self.description.objects_default.preparation.subsample;
        MemoryEstimate::from_graph(&self.loaded.graph, subsample, 0).held()
    }

    /// Renders the movie to a file.
    ///
    /// # Errors
    ///
    /// Fails if a frame cannot be rendered or written, and if cancelled; the message says how many frames are kept.
    pub fn render(self, output: &Path, resumes: bool, progress: &dyn Progress) -> Result<()> {
        let BuiltMovie { mut scene, options } = self.build(progress)?;
        let quiet = CancelOnly(progress);
        let frame = |time_secs: f64| frame_at(&mut scene, time_secs, &quiet);
        write_movie(output, &options, resumes, progress, frame)
    }

    /// Completes the movie with frames that are rendered elsewhere: `render` gets the indices of those that are missing
    /// and the extension of their files, and adds them.
    ///
    /// # Errors
    ///
    /// Fails as `render` does, if a frame is missing in the end or cannot be written, and if cancelled; the message says
    /// how many frames are kept.
    pub fn collect(
        &self,
        output: &Path,
        resumes: bool,
        progress: &dyn Progress,
        render: impl FnOnce(&[u32], &str, &mut AddFrame<'_>) -> Result<()>,
    ) -> Result<()> {
        let options = self.options();
        let mut movie = open(output, &options, resumes, progress)?;
        progress.advance(movie.n_done().into());
        let missing: Vec<u32> =
            (0..options.n_frames).filter(|frame| !movie.has_frame(*frame)).collect();
        let format = movie.frame_format();
        let rendered = render(&missing, &format, &mut |frame, bytes| {
            movie.add_encoded_frame(frame, bytes)?;
            progress.advance(1);
            Ok(())
        });
        rendered.map_err(|error| unfinished(error, movie.n_done(), options.n_frames))?;
        finish(movie, options.n_frames, progress)
    }

    /// Returns how the movie becomes a file, with the fingerprint of all that its frames depend on.
    fn options(&self) -> MovieOptions {
        let fingerprint = fingerprint(&self.complete, &self.description, &self.loaded);
        MovieOptions { fingerprint, ..self.options.clone() }
    }

    /// Builds the trees of the scene, whose frames are rendered one by one.
    ///
    /// # Errors
    ///
    /// Fails for scenes that no picture can be made of, and if cancelled.
    pub fn build(self, progress: &dyn Progress) -> Result<BuiltMovie> {
        let mut options = self.options();
        let Self { loaded, description, auto, .. } = self;
        let scene = loaded.into_resolved(auto, progress)?.build(progress)?;
        options.image = image_options(&description, scene.flat().origin);
        Ok(BuiltMovie { scene, options })
    }
}

/// A movie with the trees of its scene.
#[derive(Debug)]
pub struct BuiltMovie {
    scene: BuiltScene,
    options: MovieOptions,
}

impl BuiltMovie {
    /// Returns the number of frames.
    pub fn n_frames(&self) -> u32 {
        self.options.n_frames
    }

    /// Returns the zero of the positions of frames, in world coordinates.
    pub fn origin(&self) -> DVec3 {
        self.scene.flat().origin
    }

    /// Renders a frame, by its index from 0, as [`PlannedMovie::render`] does.
    ///
    /// # Errors
    ///
    /// Fails if the frame cannot be rendered, and if cancelled.
    pub fn render_frame(&mut self, frame: u32, progress: &dyn Progress) -> Result<RenderedImage> {
        frame_at(&mut self.scene, f64::from(frame) / self.options.fps, progress)
    }
}

/// Renders the frames that a movie lacks, each at a time in seconds, and finishes it.
///
/// # Errors
///
/// Fails if a frame cannot be rendered or written, and if cancelled; the message says how many frames are kept.
pub(crate) fn write_movie(
    output: &Path,
    options: &MovieOptions,
    resumes: bool,
    progress: &dyn Progress,
    mut frame_at: impl FnMut(f64) -> Result<RenderedImage>,
) -> Result<()> {
    let mut movie = open(output, options, resumes, progress)?;
    let n_frames = options.n_frames;
    for frame in 0..n_frames {
        if !movie.has_frame(frame) {
            let image = frame_at(f64::from(frame) / options.fps);
            let added = image.and_then(|image| Ok(movie.add_frame(frame, &image)?));
            added.map_err(|error| unfinished(error, movie.n_done(), n_frames))?;
        }
        progress.advance(1);
    }
    finish(movie, n_frames, progress)
}

/// Opens a movie, and says which of its frames are there.
fn open(
    output: &Path,
    options: &MovieOptions,
    resumes: bool,
    progress: &dyn Progress,
) -> Result<Movie> {
    let movie = Movie::open(output, options, resumes)?;
    let n_frames = options.n_frames;
    if 0 < movie.n_done() {
        progress.note(&format!(
            "{} of {} already done",
            movie.n_done(),
            counted(n_frames, "frame")
        ));
    }
    progress.begin("animate", u64::from(n_frames));
    Ok(movie)
}

/// Encodes a movie whose frames are all there.
fn finish(movie: Movie, n_frames: u32, progress: &dyn Progress) -> Result<()> {
    progress.end();
    let n_done = movie.n_done();
    let finished = movie.finish(progress).map_err(Error::from);
    finished.map_err(|error| unfinished(error, n_done, n_frames))?;
    progress.end();
    Ok(())
}

/// Renders the frame of a movie at a time in seconds.
fn frame_at(
    scene: &mut BuiltScene,
    time_secs: f64,
    progress: &dyn Progress,
) -> Result<RenderedImage> {
    scene.fix_overlay();
    seek(scene, time_secs, progress)?;
    Ok(scene.render_with(progress)?.0)
}

/// Moves everything to a time in seconds, and turns it if the description has a turntable.
///
/// # Errors
///
/// Fails if a file of a sequence cannot be read, and if cancelled.
pub fn seek(scene: &mut BuiltScene, time_secs: f64, progress: &dyn Progress) -> Result<()> {
    scene.seek(time_secs, progress)?;
    if let Some(seconds) = scene.description().output.turntable {
        scene.turn(TAU * time_secs / seconds);
    }
    Ok(())
}

/// Says that the finished frames are not lost.
fn unfinished(error: Error, n_done: u32, n_frames: u32) -> Error {
    if n_done == 0 {
        return error;
    }
    Error::Unfinished { cause: Box::new(error), n_done, n_frames }
}

#[cfg(test)]
mod tests {
    //! Frames of other data have another fingerprint.

    use super::*;
    use crate::description::Crop;
    use crate::memory_files::MemoryContent;
    use std::sync::Arc;
    use surfel_core::math::Vec3;
    use surfel_core::points::PointCloud;
    use surfel_core::progress::NoProgress;

    #[test]
    fn movements_of_gps_seconds_are_no_movie_of_a_million_frames() {
        let description = SceneDescription::default();
        assert_eq!(frame_count(&description, 2.0).unwrap(), 50);
        let error = frame_count(&description, 400_000.0).unwrap_err().to_string();
        assert!(error.contains("10000000 frames, expected at most 1000000"), "{error}");
    }

    /// Returns the description of a square of points in memory, whose colours have this brightness.
    fn square(brightness: u16) -> SceneDescription {
        let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
        let mut cloud = PointCloud::from_positions((0..400).map(corner).collect());
        cloud.colors = Some(vec![[brightness; 3]; 400]);
        let mut description = SceneDescription::of_files(["memory:square"]);
        let content = MemoryContent::Points(Arc::new(cloud), None);
        description.memory.insert("memory:square", content);
        description
    }

    fn fingerprint_of(description: &SceneDescription) -> String {
        let loaded = LoadedScene::read(description, KeepOptions::default(), &NoProgress).unwrap();
        fingerprint(description, description, &loaded)
    }

    #[test]
    fn the_fingerprint_changes_with_points_in_memory() {
        assert_eq!(fingerprint_of(&square(7)), fingerprint_of(&square(7)));
        assert_ne!(fingerprint_of(&square(7)), fingerprint_of(&square(8)));
    }

    #[test]
    fn the_fingerprint_is_that_of_frames_alone() {
        let fingerprint_with = |key: &str, value: &str| {
            let mut description = square(7);
            description.set(key, &value.into(), Path::new("")).unwrap();
            fingerprint_of(&description)
        };
        let plain = fingerprint_of(&square(7));
        for (key, value) in [("threads", "1"), ("memory_limit", "2G"), ("output", "./movie.gif")] {
            assert_eq!(fingerprint_with(key, value), plain, "{key}");
        }
        for (key, value) in [("backend", "gpu"), ("spp", "5"), ("fps", "3")] {
            assert_ne!(fingerprint_with(key, value), plain, "{key}");
        }
    }

    #[test]
    fn the_fingerprint_changes_with_the_file_of_an_area() {
        let file = std::env::temp_dir().join(format!("surfel-area-{}.wkt", std::process::id()));
        let mut description = square(7);
        description.objects_default.preparation.crop = Some(Crop::File(file.clone()));
        let fingerprints = ["9", "9.25"].map(|end| {
            let area = format!("POLYGON ((0 0, {end} 0, {end} {end}, 0 {end}, 0 0))");
            std::fs::write(&file, area).unwrap();
            fingerprint_of(&description)
        });
        std::fs::remove_file(&file).unwrap();
        assert_ne!(fingerprints[0], fingerprints[1]);
    }
}
