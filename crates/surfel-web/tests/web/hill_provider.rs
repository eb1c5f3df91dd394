//! A provider of a small hill, whose settings make it slow, blocked or faulty on demand.

use crate::test_page::{camera, camera_of};
use serde_json::{Value, json};
use std::io::{Cursor, Read};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};
use surfel_core::flat::FlatScene;
use surfel_core::image::{Image, encode_srgb8};
use surfel_core::math::Vec3;
use surfel_core::points::{PointCloud, Preparation, prepare};
use surfel_core::progress::{NoProgress, Progress};
use surfel_core::render::{CpuRenderer, RenderRegion, RenderStats, Renderer, Settings};
use surfel_core::scene::{
    Background, Camera, CameraFit, CloudGeometry, Geometry, Graph, Light, Material, Projection,
    Scene, fit_camera,
};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::Simd;
use surfel_web::{
    AddedFile, Error, Export, MovieRequest, PictureOverlay, PicturePart, PreparedScene, Result,
    SceneProvider, SentFile, SettingsMap, WrittenFile,
};

/// Size of a page's picture in pixels.
pub const PICTURE_SIZE: (u32, u32) = (64, 48);
/// Samples per pixel of a finished picture.
pub const N_SAMPLES: u32 = 4;

/// A gate that tasks wait at until the test opens it.
#[derive(Default)]
pub struct Gate {
    is_open: Mutex<bool>,
    /// Number of preparations that have reached the gate.
    pub n_arrived: AtomicU32,
    opened: Condvar,
}

impl Gate {
    pub fn open(&self) {
        *self.is_open.lock().unwrap() = true;
        self.opened.notify_all();
    }

    pub fn wait(&self) {
        self.n_arrived.fetch_add(1, Ordering::Relaxed);
        let is_open = self.is_open.lock().unwrap();
        drop(self.opened.wait_while(is_open, |is_open| !*is_open).unwrap());
    }
}

/// The provider. Each key of the settings has an effect of its own:
///
/// | key | effect |
/// |---|---|
/// | `slow` | preparation takes this many seconds, unless it is cancelled |
/// | `slow_render` | rendering for `/render` and saves takes this many seconds, unless it is cancelled |
/// | `slow_export` | export takes this many seconds, unless it is cancelled |
/// | `gated` | preparation waits for the gate and cannot be cancelled |
/// | `locked` | preparation takes this many seconds in a thread pool, with a lock held |
/// | `panic` | preparation panics |
/// | `fault` | the seed of the render settings, which tells the `FaultyRenderer` its fault |
/// | `camera_angle` | the scene animates its camera, which is at this angle |
/// | `points` | points are rasterised |
/// | `samples` | a finished picture has this many samples |
/// | `goes_on` | finished pictures go on at rest |
/// | `preview` | there is a preview |
/// | `stamp` | pictures have an overlay |
/// | `tint`, `added_files` | none |
pub struct HillProvider {
    flat: FlatScene,
    /// The hill as rasterised points.
    rasterized: FlatScene,
    pool: rayon::ThreadPool,
    lock: Mutex<()>,
    /// The gate at which preparation with `gated` waits.
    pub gate: Gate,
    /// Number of slow tasks that were started.
    pub n_started: AtomicU32,
    /// Number of slow tasks that were cancelled.
    pub n_cancelled: AtomicU32,
    /// Number of times that memory was freed.
    pub n_released: AtomicU32,
}

impl HillProvider {
    /// The initial settings of a page of this width make the provider panic.
    pub const FAULTY_WIDTH: u32 = 13;

    pub fn new() -> Self {
        let hill = |i: u32| {
            let (x, y) = ((i % 50) as f32 / 25.0 - 1.0, (i / 50) as f32 / 25.0 - 1.0);
            Vec3::new(x, y, 0.5 * (-2.0 * (x * x + y * y)).exp())
        };
        let cloud = PointCloud::from_positions((0..2500).map(hill).collect());
        let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let camera = fit_camera(&cloud, &CameraFit { aspect: 4.0 / 3.0, ..CameraFit::default() });
        let colors = vec![[200, 180, 150]; cloud.len()];
        let hill = CloudGeometry::new(cloud, colors).unwrap();
        let flat = |hill: CloudGeometry| {
            let scene = Scene {
                graph: Graph::from_geometry(Geometry::Points(hill), Material::PLASTIC),
                lights: vec![Light::Headlight(1.0)],
                background: Background::Transparent,
                camera,
            };
            FlatScene::new(&scene, &NoProgress).unwrap()
        };
        let mut points = hill.clone();
        points.surface = SurfaceKind::Points;
        Self {
            flat: flat(hill),
            rasterized: flat(points),
            pool: rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap(),
            lock: Mutex::default(),
            gate: Gate::default(),
            n_started: AtomicU32::new(0),
            n_cancelled: AtomicU32::new(0),
            n_released: AtomicU32::new(0),
        }
    }

    /// The finished picture of this size, as a page or a program should get it.
    pub fn finished_picture(&self, size: (u32, u32)) -> image::RgbaImage {
        self.picture(size, N_SAMPLES)
    }

    /// The picture of this size with this number of samples.
    pub fn picture(&self, (width, height): (u32, u32), samples_per_pixel: u32) -> image::RgbaImage {
        let settings = Settings { width, height, samples_per_pixel, ..render_settings(0) };
        let (image, _) = cpu_renderer().render(&self.flat, &settings, &NoProgress).unwrap();
        to_rgba8(&image)
    }

    /// Works for this many seconds, in steps, unless it is cancelled.
    fn work(&self, secs: f64, progress: &dyn Progress) -> Result<()> {
        self.n_started.fetch_add(1, Ordering::Relaxed);
        progress.begin("slow", 100);
        for _ in 0..100 {
            if progress.is_cancelled() {
                self.n_cancelled.fetch_add(1, Ordering::Relaxed);
                return Err(Error::Cancelled);
            }
            std::thread::sleep(Duration::from_secs_f64(secs / 100.0));
            progress.advance(1);
        }
        Ok(())
    }
}

/// Left and upper edge, width and height of the overlay.
pub const STAMP: [u32; 4] = [3, 5, 8, 6];

/// An overlay that is a red rectangle.
struct Stamp;

impl PictureOverlay for Stamp {
    fn draw(&self, image: &mut Image, _: &Camera) {
        let [x, y, width, height] = STAMP;
        for row in y..y + height {
            let start = (row * image.width + x) as usize;
            image.color[start..][..width as usize].fill(RED);
        }
    }

    fn patches(&self, _: &Image, size: (u32, u32), _: &Camera, _: bool) -> Vec<PicturePart> {
        assert_eq!(size, PICTURE_SIZE);
        let [x, y, width, height] = STAMP;
        let mut image = Image::new(width, height);
        image.color.fill(RED);
        vec![PicturePart { x, y, image }]
    }
}

const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];

/// A file of a million bytes.
struct HillPoints;

impl WrittenFile for HillPoints {
    fn n_items(&self) -> u64 {
        7
    }

    fn n_bytes(&self) -> u64 {
        1_000_000
    }

    fn open(&self) -> std::io::Result<Box<dyn Read + Send>> {
        Ok(Box::new(std::io::repeat(b'x').take(1_000_000)))
    }
}

/// A file that takes as much memory as it has bytes.
struct HillFile {
    name: String,
    n_bytes: u64,
}

impl AddedFile for HillFile {
    fn name(&self) -> &str {
        &self.name
    }

    fn description(&self) -> Value {
        json!({ "name": self.name, "points": self.n_bytes })
    }

    fn n_bytes(&self) -> u64 {
        self.n_bytes
    }
}

impl SceneProvider for HillProvider {
    fn info(&self) -> Value {
        json!({ "name": "hill" })
    }

    fn initial_settings(&self, width: u32, _height: u32) -> SettingsMap {
        assert_ne!(width, Self::FAULTY_WIDTH, "requested by a test");
        let Camera { position, focal_point, view_up, projection } = self.flat.camera;
        let Projection::Perspective { view_angle_deg } = projection else { unreachable!() };
        settings_map(json!({
            "tint": 0,
            "camera": {
                "position": position.to_array(),
                "focal_point": focal_point.to_array(),
                "view_up": view_up.to_array(),
                "view_angle": view_angle_deg,
            },
        }))
    }

    fn startup_settings(&self) -> SettingsMap {
        settings_map(json!({ "tint": 7 }))
    }

    fn camera(&self, settings: &Value) -> Result<Camera> {
        camera_of(settings)
    }

    fn preview(
        &self,
        settings: &SettingsMap,
        _progress: &dyn Progress,
    ) -> Option<Result<PreparedScene>> {
        settings.contains_key("preview").then(|| {
            let mut scene = self.prepare(&SettingsMap::new(), &NoProgress)?;
            scene.legend = "preview".into();
            Ok(scene)
        })
    }

    fn prepare(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<PreparedScene> {
        let mut complete = self.initial_settings(0, 0);
        let (mut seed, mut animated_camera) = (0, None);
        let mut flat = self.flat.clone();
        let mut samples = N_SAMPLES;
        let mut goes_on_at_rest = false;
        for (key, value) in settings {
            let secs = value.as_f64().unwrap_or(0.0);
            match key.as_str() {
                "slow" => self.work(secs, progress)?,
                "gated" => self.gate.wait(),
                "locked" => {
                    let _guard = self.lock.lock().unwrap();
                    self.pool.install(|| std::thread::sleep(Duration::from_secs_f64(secs)));
                }
                "panic" => panic!("requested by a test"),
                "fault" => seed = value.as_u64().unwrap_or(0),
                "samples" => samples = value.as_u64().unwrap() as u32,
                "goes_on" => goes_on_at_rest = true,
                "points" => flat = self.rasterized.clone(),
                "camera_angle" => animated_camera = value.as_f64().map(camera),
                "camera" | "tint" | "added_files" | "stamp" | "preview" | "resolution"
                | "slow_render" | "slow_export" => {}
                _ => return Err(Error::invalid_value(key, "unknown key")),
            }
            complete.insert(key.clone(), value.clone());
        }
        let camera_settings = animated_camera.as_ref().unwrap_or(&complete["camera"]);
        flat.camera = camera_of(camera_settings)?;
        Ok(PreparedScene {
            settings: complete,
            animated_camera,
            flat,
            render_settings: Settings { samples_per_pixel: samples, ..render_settings(seed) },
            goes_on_at_rest,
            legend: Value::Null,
            overlay: settings.contains_key("stamp").then(|| Box::new(Stamp) as _),
            describe: Arc::new(
                |_, point| json!({ "index": point.primitive_idx, "position": point.position.to_array() }),
            ),
            locate: Arc::new(|_, points| vec![None; points.len()]),
        })
    }

    fn render_png(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<Vec<u8>> {
        let scene = self.prepare(settings, progress)?;
        if let Some(secs) = settings.get("slow_render").and_then(Value::as_f64) {
            self.work(secs, progress)?;
        }
        let resolution = settings.get("resolution").and_then(Value::as_str).unwrap_or("64x48");
        let (width, height) = resolution.split_once('x').unwrap();
        let (width, height) = (width.parse().unwrap(), height.parse().unwrap());
        let settings = Settings { width, height, ..scene.render_settings };
        let (image, _) = cpu_renderer().render(&scene.flat, &settings, progress)?;
        let mut png = Cursor::new(Vec::new());
        to_rgba8(&image).write_to(&mut png, image::ImageFormat::Png).unwrap();
        Ok(png.into_inner())
    }

    fn release(&self) {
        self.n_released.fetch_add(1, Ordering::Relaxed);
    }

    fn histogram(&self, column: &str) -> Result<Value> {
        match column {
            "z" => Ok(json!({ "low": 0, "high": 2, "width": 1, "counts": [3, 0, 1] })),
            _ => Err(Error::invalid_request(format!("no column {column}"))),
        }
    }

    fn write_points(
        &self,
        settings: &SettingsMap,
        format: &str,
        progress: &dyn Progress,
    ) -> Result<Arc<dyn WrittenFile>> {
        if let Some(secs) = settings.get("slow_render").and_then(Value::as_f64) {
            self.work(secs, progress)?;
        }
        match format {
            "laz" => Ok(Arc::new(HillPoints)),
            _ => Err(Error::invalid_request("expected laz")),
        }
    }

    fn write_movie(
        &self,
        settings: &SettingsMap,
        options: &MovieRequest,
        progress: &dyn Progress,
    ) -> Result<Arc<dyn WrittenFile>> {
        self.write_points(settings, if options.format == "gif" { "laz" } else { "" }, progress)
    }

    fn stated_bytes(&self, file: &SentFile) -> Result<u64> {
        Ok(if file.bytes.starts_with(b"slow") { 25_000_000 } else { 0 })
    }

    fn read_added_file(
        &self,
        file: &SentFile,
        progress: &dyn Progress,
    ) -> Result<Arc<dyn AddedFile>> {
        if file.bytes.starts_with(b"slow") {
            self.work(60.0, progress)?;
        }
        if file.bytes.starts_with(b"broken") {
            return Err(Error::invalid_request(format!("{}: is broken", file.name)));
        }
        let name = format!("{}{}", file.name, "'".repeat(file.taken.len()));
        // A file may take more memory than it has bytes.
        let factor = if file.bytes.starts_with(b"dense") { 1000 } else { 1 };
        Ok(Arc::new(HillFile { name, n_bytes: factor * file.bytes.len() as u64 }))
    }

    fn export(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<Export> {
        if let Some(secs) = settings.get("slow_export").and_then(Value::as_f64) {
            self.work(secs, progress)?;
        }
        let json = Value::Object(settings.clone()).to_string();
        Ok(Export { command: "surfel render hill".into(), toml: String::new(), json, movie: None })
    }

    fn read_scene_file(&self, name: &str, text: &str) -> Result<SettingsMap> {
        serde_json::from_str(text)
            .map_err(|error| Error::invalid_request(format!("{name}: {error}")))
    }
}

fn render_settings(seed: u64) -> Settings {
    Settings {
        width: PICTURE_SIZE.0,
        height: PICTURE_SIZE.1,
        samples_per_pixel: N_SAMPLES,
        noise_threshold: 0.0,
        light_samples: 1,
        max_depth: 2,
        seed,
        point_size: 1.0,
        with_aovs: false,
    }
}

fn settings_map(value: Value) -> SettingsMap {
    value.as_object().unwrap().clone()
}

fn to_rgba8(image: &Image) -> image::RgbaImage {
    image::RgbaImage::from_fn(image.width, image.height, |x, y| {
        let [r, g, b, a] = image.color[(y * image.width + x) as usize];
        let opacity = if 0.0 < a { a } else { 1.0 };
        let [r, g, b] = [r, g, b].map(|channel| encode_srgb8(channel / opacity));
        image::Rgba([r, g, b, (255.0 * a).round() as u8])
    })
}

fn cpu_renderer() -> CpuRenderer {
    CpuRenderer { simd: Simd::detect() }
}

/// A renderer whose faults the seed of the render settings selects; otherwise the renderer of the CPU.
pub struct FaultyRenderer;

impl FaultyRenderer {
    /// Rendering takes 20 microseconds a pixel.
    pub const SLOW: u64 = 1001;
    /// Even the smallest draft takes longer than a slice may.
    pub const VERY_SLOW: u64 = 1004;
    /// Rendering panics.
    pub const PANIC: u64 = 1002;
    /// Rendering fails.
    pub const FAIL: u64 = 1003;

    /// Layers take a hundred times as long as the picture: all of them at once take longer than a slice may.
    pub const SLOW_LAYERS: u64 = 1005;

    /// Rendering takes 60 milliseconds, and fails for a part of the rows.
    pub const WHOLE: u64 = 1006;

    const SECS_PER_PIXEL: f64 = 2e-5;
}

impl Renderer for FaultyRenderer {
    fn render_region(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        region: RenderRegion,
        progress: &dyn Progress,
    ) -> surfel_core::Result<(Image, RenderStats)> {
        match settings.seed {
            Self::SLOW | Self::VERY_SLOW | Self::SLOW_LAYERS => {
                let n_pixels = settings.width * (region.rows.1 - region.rows.0);
                let factor = match settings.seed {
                    Self::VERY_SLOW => 20.0,
                    Self::SLOW_LAYERS if settings.with_aovs => 100.0,
                    Self::SLOW_LAYERS => 0.0,
                    _ => 1.0,
                };
                let secs = factor * Self::SECS_PER_PIXEL * f64::from(n_pixels);
                let start = Instant::now();
                while start.elapsed().as_secs_f64() < secs {
                    progress.check()?;
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
            Self::WHOLE => {
                if region.rows != (0, settings.height) {
                    return Err(surfel_core::Error::EmptyCloud);
                }
                std::thread::sleep(Duration::from_millis(60));
            }
            Self::PANIC => panic!("requested by a test"),
            Self::FAIL => return Err(surfel_core::Error::EmptyCloud),
            _ => {}
        }
        cpu_renderer().render_region(scene, settings, region, progress)
    }
}
