//! The picture: its size, quality and background, and the instant that it shows.

use super::Invalid;
use super::color_rule::{BackgroundRule, default_background};
use super::keys::settings;
use super::rule::{Checked, Flag, OneOf, Resolution, Text, as_number, count, number};
use super::rule::{POSITIVE, Rule};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use surfel_core::render::{MAX_SAMPLES, POINT_SIZE_RANGE, Settings};
use surfel_core::scene::Background;
use surfel_formats::BitDepth;

settings! {
    /// Size, quality and background of a picture.
    pub struct PictureSettings {
        /// Width and height in pixels.
        resolution: (u32, u32) = default_resolution(), Resolution, "WxH", common;
        /// Camera rays per pixel.
        spp: u32 = Settings::default().samples_per_pixel, count(1, MAX_SAMPLES as u64), "N", common;
        /// Noise at which a block of pixels takes no further camera rays, on the CPU: 0.01 is about one of 255 steps of
        /// brightness. 0 traces all --spp rays everywhere.
        noise_threshold: f64 = 0.0, number(0.0, 1.0), "ERROR";
        /// Rays per pixel toward the sky or environment, and toward each light with soft shadows.
        light_samples: u32 = Settings::default().light_samples, count(1, MAX_SAMPLES as u64), "N";
        /// Maximum number of reflections and refractions of a ray.
        max_depth: u32 = Settings::default().max_depth, count(0, 64), "N";
        /// Diameter of the points of `--surface points` in pixels [default: chosen so that most of them touch].
        point_size: f64, number(POINT_SIZE_RANGE.0 as f64, POINT_SIZE_RANGE.1 as f64), "PX";
        /// Background: a colour, two colours (top, bottom), gradient, transparent, or environment (the sky or
        /// environment map that lights the scene).
        background: Background = default_background(), BackgroundRule, "COLOR", common;
        /// Seed of the random numbers; another seed gives other noise.
        seed: u64 = Settings::default().seed, count(0, u64::MAX), "N";
        /// Draws a legend: the classes that are there with their colours, or the colour map with its values.
        legend: bool = false, Flag, "BOOL";
        /// Draws a bar of a round length; for pictures without perspective, as by --camera-orthographic or --gsd.
        scale_bar: bool = false, Flag, "BOOL";
        /// Draws an arrow to the north, which is +Y if +Z is up; for pictures without perspective, as by
        /// --camera-orthographic or --gsd.
        north: bool = false, Flag, "BOOL";
        /// Writes a line of text at the lower left.
        caption: String, Text, "TEXT";
        /// Bits per channel of a PNG or TIFF.
        bit_depth: BitDepth = BitDepth::Eight, BIT_DEPTH, "BITS";
    }
}

fn default_resolution() -> (u32, u32) {
    let Settings { width, height, .. } = Settings::default();
    (width, height)
}

/// A number of bits, also as text.
struct BitDepthRule;
const BIT_DEPTH: BitDepthRule = BitDepthRule;

impl Rule<BitDepth> for BitDepthRule {
    fn read(&self, value: &Value, _: &Path) -> Result<BitDepth, Invalid> {
        match as_number(value) {
            Some(8.0) => Ok(BitDepth::Eight),
            Some(16.0) => Ok(BitDepth::Sixteen),
            _ => Err(Invalid::new("expected 8 or 16")),
        }
    }

    fn write(&self, value: &BitDepth) -> Value {
        json!(if *value == BitDepth::Sixteen { 16 } else { 8 })
    }
}

settings! {
    /// File of the picture or movie, and the time that it shows.
    pub struct OutputSettings {
        /// File of the picture (.png, .jpg, .webp, .tif, .exr) or movie, from the folder where the program runs.
        output: PathBuf, OutputPath, "PATH";
        /// Second of the animation that a picture shows.
        time: f64 = 0.0, number(0.0, 1e6), "SECONDS";
        /// Number of frames of a movie [default: as many as the animation lasts].
        frames: u32, count(1, 1_000_000), "N";
        /// Frames per second of a movie.
        fps: f64 = 25.0, number(1.0, 240.0), "N";
        /// Turns everything in front of the camera once in this many seconds, under lights that stay.
        turntable: f64, POSITIVE, "SECONDS";
    }
}

/// A path that starts where the program runs, not where the scene file lies.
pub(super) struct OutputPath;

impl Rule<PathBuf> for OutputPath {
    fn read(&self, value: &Value, _: &Path) -> Result<PathBuf, Invalid> {
        let name = value.as_str().filter(|name| !name.is_empty());
        name.map(PathBuf::from).ok_or_else(|| Invalid::new("expected the name of a file"))
    }

    fn write(&self, value: &PathBuf) -> Value {
        json!(value.display().to_string())
    }
}

/// The processor or device that does the work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// The fastest that this build and this machine have.
    #[default]
    Auto,
    /// All cores of the processor.
    Cpu,
    /// A graphics processor.
    Gpu,
}

settings! {
    /// The machine's resources that the work may take.
    pub struct RunSettings {
        /// Number of threads [default: one for each core].
        threads: u32, count(1, 1024), "N";
        /// Refuse work that needs more memory than this, as in 8G.
        memory_limit: u64, MemorySize, "SIZE";
        /// Device that does the work: auto (a GPU for large pictures, if it can render them), cpu or gpu.
        backend: Backend = Backend::Auto,
            OneOf(&[("auto", Backend::Auto), ("cpu", Backend::Cpu), ("gpu", Backend::Gpu)]), "NAME";
        /// GPU that does the work, by its index or a part of its name as `surfel devices` lists them [default: the
        /// first]. Naming one demands it, as the backend gpu does; with the backend auto it is taken where it is likely to
        /// be faster.
        device: String, Text, "NAME|INDEX";
    }
}

impl RunSettings {
    /// Returns the backend that is set; without one a named device demands the GPU.
    pub fn chosen_backend(&self) -> Backend {
        let of_device = self.device.as_ref().map(|_| Backend::Gpu);
        self.backend.or(of_device).unwrap_or_default()
    }

    /// Fails if a device is named for work on the CPU.
    pub(super) fn check(&self) -> Result<(), Invalid> {
        if self.backend == Some(Backend::Cpu) && self.device.is_some() {
            let message = "names a GPU, and the backend is cpu; leave out one of them";
            return Err(Invalid::at("device", message));
        }
        Ok(())
    }

    /// Unsets a device that the backend of other settings excludes, or a backend that their device excludes.
    pub(super) fn unset_excluded_by(&mut self, over: &Self) {
        self.device.take_if(|_| over.backend == Some(Backend::Cpu));
        self.backend.take_if(|backend| *backend == Backend::Cpu && over.device.is_some());
    }
}

/// Bytes: a number with K, M, G or T of 1024 each, or without.
struct MemorySize;

impl Rule<u64> for MemorySize {
    fn read(&self, value: &Value, _: &Path) -> Result<u64, Invalid> {
        let text = match value {
            Value::String(text) => text.to_uppercase(),
            other => other.to_string(),
        };
        let short = text.trim_end_matches('B').trim_end_matches('I');
        let (number, power) = match short.char_indices().last() {
            Some((last, unit)) => match "KMGT".find(unit) {
                Some(power) => (&short[..last], power + 1),
                None => (short, 0),
            },
            None => (short, 0),
        };
        let number: Option<f64> = number.trim().parse().ok();
        let bytes = number.map(|number| number * 1024f64.powi(power as i32));
        match bytes {
            Some(bytes) if 1.0 <= bytes && bytes.is_finite() => Ok(bytes as u64),
            _ => Err(Invalid::new("expected a size as in 800M or 8G")),
        }
    }

    fn write(&self, value: &u64) -> Value {
        json!(value)
    }
}

/// Exposure in stops, or the choice from the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// Makes the brightest parts of the scene nearly white.
    #[default]
    Auto,
    /// Multiplies all light by 2 to this power.
    Stops(f64),
}

/// `auto` or stops.
pub(super) struct ExposureRule;

impl Rule<Exposure> for ExposureRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<Exposure, Invalid> {
        if value.as_str() == Some("auto") {
            return Ok(Exposure::Auto);
        }
        let stops = number(-20.0, 20.0).read(value, folder);
        stops
            .map(Exposure::Stops)
            .map_err(|_| Invalid::new("expected auto or a number from -20 to 20"))
    }

    fn write(&self, value: &Exposure) -> Value {
        match value {
            Exposure::Auto => json!("auto"),
            Exposure::Stops(stops) => json!(stops),
        }
    }
}

/// A number from 0 to 1000 that multiplies light.
pub(super) const GAIN: Checked =
    Checked { allows: |x| (0.0..=1000.0).contains(&x), expected: "a number from 0 to 1000" };

#[cfg(test)]
mod tests {
    //! Sizes of memory in all spellings.

    use super::*;

    #[test]
    fn memory_sizes_take_binary_units() {
        let read = |text: &str| MemorySize.read(&json!(text), Path::new("")).ok();
        assert_eq!((read("8G"), read("1.5KiB"), read("70")), (Some(8 << 30), Some(1536), Some(70)));
        for text in ["", "G", "-1G", "NaN", "1e400", "8 potatoes"] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
