//! A studio over a small hill, with settings that are slow, wrong or fatal on demand.

use crate::page::camera;
use serde_json::{Value, json};
use std::io::Cursor;
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use surfel::flat::FlatScene;
use surfel::image::{Image, encode_srgb8};
use surfel::math::Vec3;
use surfel::points::{PointCloud, Preparation, prepare};
use surfel::progress::{Progress, Silent};
use surfel::render::{CpuRenderer, Piece, RenderStats, Renderer, Settings};
use surfel::scene::{
    Background, Camera, Framing, Geometry, Graph, Light, Material, Points, Projection, Scene, frame,
};
use surfel::trace::Simd;
use surfel_web::{Error, Keys, Place, Result, Stage, Studio, Written};

pub const PICTURE: (u32, u32) = (64, 48);
pub const SAMPLES: u32 = 4;

/// Seeds that tell the renderer to be slow, to panic, or to fail.
const SLOW: u64 = 1001;
const SLOWER: u64 = 1004;
const PANIC: u64 = 1002;
const FAIL: u64 = 1003;
/// Of a slow renderer.
const SECS_PER_PIXEL: f64 = 2e-5;

pub struct HillStudio {
    flat: FlatScene,
    /// Works while `stage` holds the lock, as where trees are kept for all pages.
    workshop: rayon::ThreadPool,
    lock: Mutex<()>,
    /// Long work that noticed its end.
    pub n_cancelled: AtomicU32,
}

impl HillStudio {
    pub fn new() -> Self {
        let hill = |i: u32| {
            let (x, y) = ((i % 50) as f32 / 25.0 - 1.0, (i / 50) as f32 / 25.0 - 1.0);
            Vec3::new(x, y, 0.5 * (-2.0 * (x * x + y * y)).exp())
        };
        let cloud = PointCloud::from_positions((0..2500).map(hill).collect());
        let (cloud, _) = prepare(cloud, &Preparation::default(), &Silent).unwrap();
        let camera = frame(&cloud, &Framing::automatic(Vec3::Z, 4.0 / 3.0));
        let colors = vec![[200, 180, 150]; cloud.len()];
        let hill = Points { cloud, colors, ..Points::default() };
        let scene = Scene {
            graph: Graph::of(Geometry::Points(hill), Material::PLASTIC),
            lights: vec![Light::Headlight(1.0)],
            background: Background::Transparent,
            camera,
        };
        Self {
            flat: FlatScene::new(&scene, &Silent).unwrap(),
            workshop: rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap(),
            lock: Mutex::default(),
            n_cancelled: AtomicU32::new(0),
        }
    }

    /// The picture that a page should get in the end.
    pub fn finished(&self, (width, height): (u32, u32)) -> image::RgbaImage {
        let settings = Settings { width, height, ..quality(0) };
        let (image, _) = hill_renderer().render(&self.flat, &settings, &Silent).unwrap();
        straight(&image)
    }

    /// Works for so long, in steps, unless it is told to stop.
    fn work(&self, secs: f64, progress: &dyn Progress) -> Result<()> {
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

impl Studio for HillStudio {
    fn info(&self) -> Value {
        json!({ "name": "hill" })
    }

    fn opening(&self, _width: u32, _height: u32) -> Keys {
        let Camera { position, focal_point, view_up, projection } = self.flat.camera;
        let Projection::Perspective { view_angle_deg } = projection else { unreachable!() };
        keys(json!({
            "tint": 0,
            "camera": {
                "position": position.to_array(),
                "focal_point": focal_point.to_array(),
                "view_up": view_up.to_array(),
                "view_angle": view_angle_deg,
            },
        }))
    }

    fn given(&self) -> Keys {
        keys(json!({ "tint": 7 }))
    }

    fn sketch(&self, settings: &Keys, _progress: &dyn Progress) -> Option<Result<Stage>> {
        settings.contains_key("sketched").then(|| {
            let mut stage = self.stage(&Keys::new(), &Silent)?;
            stage.legend = "sketch".into();
            Ok(stage)
        })
    }

    fn stage(&self, settings: &Keys, progress: &dyn Progress) -> Result<Stage> {
        let mut complete = self.opening(0, 0);
        let (mut seed, mut moved_camera) = (0, None);
        for (key, value) in settings {
            let secs = Duration::from_secs_f64(value.as_f64().unwrap_or(0.0));
            match key.as_str() {
                "slow" => self.work(secs.as_secs_f64(), progress)?,
                "stubborn" => std::thread::sleep(secs),
                "shared" => {
                    let _one = self.lock.lock().unwrap();
                    self.workshop.install(|| std::thread::sleep(secs));
                }
                "panics" => panic!("asked for by a test"),
                "paint" => seed = value.as_u64().unwrap_or(0),
                "led" => moved_camera = value.as_f64().map(camera),
                "camera" | "tint" | "sketched" | "resolution" => {}
                _ => return Err(Error::Refused(format!("{key}: not known"))),
            }
            complete.insert(key.clone(), value.clone());
        }
        Ok(Stage {
            settings: complete,
            moved_camera,
            flat: self.flat.clone(),
            quality: quality(seed),
            legend: Value::Null,
            source: Arc::new(()),
        })
    }

    fn describe(&self, _stage: &Stage, place: &Place) -> Value {
        json!({ "index": place.id, "position": place.position.to_array() })
    }

    fn picture(&self, settings: &Keys, progress: &dyn Progress) -> Result<Vec<u8>> {
        let stage = self.stage(settings, progress)?;
        let resolution = settings.get("resolution").and_then(Value::as_str).unwrap_or("64x48");
        let (width, height) = resolution.split_once('x').unwrap();
        let (width, height) = (width.parse().unwrap(), height.parse().unwrap());
        let settings = Settings { width, height, ..stage.quality };
        let (image, _) = hill_renderer().render(&stage.flat, &settings, progress)?;
        let mut png = Cursor::new(Vec::new());
        straight(&image).write_to(&mut png, image::ImageFormat::Png).unwrap();
        Ok(png.into_inner())
    }

    fn written(&self, settings: &Keys) -> Result<Written> {
        let json = Value::Object(settings.clone()).to_string();
        Ok(Written { command: "surfel render hill".into(), toml: String::new(), json })
    }

    fn read(&self, name: &str, text: &str) -> Result<Keys> {
        serde_json::from_str(text).map_err(|error| Error::Refused(format!("{name}: {error}")))
    }
}

fn quality(seed: u64) -> Settings {
    Settings {
        width: PICTURE.0,
        height: PICTURE.1,
        samples_per_pixel: SAMPLES,
        light_samples: 1,
        max_depth: 2,
        seed,
        with_layers: false,
    }
}

fn keys(value: Value) -> Keys {
    value.as_object().unwrap().clone()
}

fn straight(image: &Image) -> image::RgbaImage {
    image::RgbaImage::from_fn(image.width, image.height, |x, y| {
        let [r, g, b, a] = image.color[(y * image.width + x) as usize];
        let opacity = if 0.0 < a { a } else { 1.0 };
        let [r, g, b] = [r, g, b].map(|channel| encode_srgb8(channel / opacity));
        image::Rgba([r, g, b, (255.0 * a).round() as u8])
    })
}

fn hill_renderer() -> CpuRenderer {
    CpuRenderer { simd: Simd::detect() }
}

/// Obeys the seed, else the renderer of the CPU.
pub struct MoodyRenderer;

impl MoodyRenderer {
    pub const SLOW: u64 = SLOW;
    /// Not even a small draft is done soon.
    pub const SLOWER: u64 = SLOWER;
    pub const PANIC: u64 = PANIC;
    pub const FAIL: u64 = FAIL;
}

impl Renderer for MoodyRenderer {
    fn name(&self) -> &'static str {
        "moody"
    }

    fn render_piece(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        piece: Piece,
        progress: &dyn Progress,
    ) -> surfel::Result<(Image, RenderStats)> {
        match settings.seed {
            SLOW | SLOWER => {
                let n_pixels = settings.width * (piece.rows.1 - piece.rows.0);
                let factor = if settings.seed == SLOWER { 20.0 } else { 1.0 };
                let secs = factor * SECS_PER_PIXEL * f64::from(n_pixels);
                let start = Instant::now();
                while start.elapsed().as_secs_f64() < secs {
                    progress.check()?;
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
            PANIC => panic!("asked for by a test"),
            FAIL => return Err(surfel::Error::EmptyCloud),
            _ => {}
        }
        hill_renderer().render_piece(scene, settings, piece, progress)
    }
}
