//! What a viewer keeps between two settings: prepared clouds, and trees over them.

use crate::args::SceneArgs;
use crate::assemble::Assembly;
use crate::cloud::prepare_points;
use crate::report::Report;
use serde_json::Value;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;
use surfel::flat::FlatScene;
use surfel::math::{Aabb, Vec3};
use surfel::points::{PointCloud, Scalar, Values};
use surfel::progress::Progress;
use surfel::scene::{Background, Camera, Geometry, Graph, Projection, Scene, usual_bounds};
use surfel::surface::SurfaceKind;

/// Column of a point's index among those that were read. No file's column has a name like it.
pub const INDEX: &str = "\u{0}index";

/// The last few things made, by what they were made from.
pub struct Recent<T>(Mutex<Known<T>>);

type Known<T> = VecDeque<(String, Arc<T>)>;

/// Two: who compares settings goes back and forth.
const MOST: usize = 2;

impl<T> Default for Recent<T> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<T> Recent<T> {
    /// What `key` stands for, made now if it is not known. One thing is made at a time: several who want the
    /// same wait for one of them.
    pub fn get(
        &self,
        key: String,
        progress: &dyn Progress,
        make: impl FnOnce() -> anyhow::Result<T>,
    ) -> anyhow::Result<Arc<T>> {
        let mut known = self.lock(progress)?;
        if let Some(place) = known.iter().position(|(other, _)| *other == key)
            && let Some(found) = known.remove(place)
        {
            known.push_back(found.clone());
            return Ok(found.1);
        }
        // Before the new one takes as much memory.
        while MOST <= known.len() {
            known.pop_front();
        }
        let made = Arc::new(make()?);
        known.push_back((key, made.clone()));
        Ok(made)
    }

    /// Unlike `Mutex::lock`, stops waiting when nobody waits for it any more.
    fn lock(&self, progress: &dyn Progress) -> surfel::Result<MutexGuard<'_, Known<T>>> {
        loop {
            match self.0.try_lock() {
                Ok(known) => return Ok(known),
                Err(TryLockError::Poisoned(error)) => return Ok(PoisonError::into_inner(error)),
                Err(TryLockError::WouldBlock) => {
                    progress.check()?;
                    std::thread::sleep(Duration::from_millis(2));
                }
            }
        }
    }
}

/// Gives each point of the graph its index.
pub fn number_points(graph: &mut Graph) {
    for geometry in &mut graph.geometries {
        if let Geometry::Points(points) = geometry {
            let indices = (0..points.cloud.len()).map(|i| i as i32).collect();
            let scalar = Scalar { name: INDEX.to_owned(), values: Values::I32(indices) };
            points.cloud.scalars.push(scalar);
        }
    }
}

/// The clouds of `base`, prepared as `assembly` asks.
pub fn prepared(
    base: &Assembly,
    assembly: &Assembly,
    report: &Report,
) -> anyhow::Result<Vec<PointCloud>> {
    let asked = assembly.clouds().map(|(_, args, _)| args);
    let clouds = base.clouds().map(|(cloud, ..)| cloud).zip(asked);
    let prepare = |(cloud, args): (&PointCloud, &SceneArgs)| {
        let mut cloud = cloud.clone();
        args.preparation.forget(&mut cloud);
        prepare_points(cloud, args, report)
    };
    clouds.map(prepare).collect()
}

/// Discs of points over each other on average.
const MOST_LAYERS: f32 = 200.0;

/// Trees, and what tells which point is which.
pub struct Made {
    /// Without the points.
    pub graph: Graph,
    /// Without light.
    pub flat: FlatScene,
    /// Of each geometry's points, their indices among those that were read; empty for triangles.
    pub indices: Vec<Vec<i32>>,
    pub legend: Value,
}

impl Made {
    pub fn new(
        assembly: Assembly,
        clouds: &[PointCloud],
        legend: Value,
        (time, up): (f64, Vec3),
        report: &Report,
    ) -> anyhow::Result<Self> {
        let (mut graph, mut sequences) = assembly.dress(clouds.to_vec(), up, report)?;
        for sequence in &mut sequences {
            sequence.seek(time, &mut graph, up, report)?;
        }
        check_layers(&graph)?;
        let indices = graph.geometries.iter().map(|geometry| match geometry {
            Geometry::Points(points) => match points.cloud.scalar(INDEX) {
                Some(Values::I32(indices)) => indices.clone(),
                _ => Vec::new(),
            },
            Geometry::Triangles(_) => Vec::new(),
        });
        let indices = indices.collect();
        let scene = Scene {
            graph,
            lights: Vec::new(),
            background: Background::Transparent,
            camera: NOBODY,
        };
        let flat = FlatScene::new(&scene, report)?;
        report.end_stage();
        let mut graph = scene.graph;
        graph.forget_static();
        Ok(Self { graph, flat, indices, legend })
    }
}

/// Fails for points so large that each ray meets thousands of them: others would wait for this page's
/// pictures, and nothing could be seen on them.
fn check_layers(graph: &Graph) -> anyhow::Result<()> {
    for geometry in &graph.geometries {
        let Geometry::Points(points) = geometry else { continue };
        // Pixels are drawn, not traced.
        if points.surface == SurfaceKind::Points {
            continue;
        }
        let n_layers = n_layers(&points.cloud);
        if MOST_LAYERS < n_layers {
            let advice = "choose a smaller radius or radius_scale";
            anyhow::bail!(
                "points lie {n_layers:.0} over each other, at most {MOST_LAYERS} can be viewed; {advice}"
            );
        }
    }
    Ok(())
}

/// How many discs lie over each other, about: their area as a share of that of a box around them.
fn n_layers(cloud: &PointCloud) -> f32 {
    let radii = cloud.radii.as_deref().unwrap_or_default();
    let n = radii.len().max(1) as f64;
    let sum = |power: i32| radii.iter().map(|radius| f64::from(*radius).powi(power)).sum::<f64>();
    let Aabb { min, max } = usual_bounds(cloud);
    let size = (max - min).as_dvec3() + 2.0 * sum(1) / n;
    let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    (std::f64::consts::PI * sum(2) / area) as f32
}

/// A camera for a scene that is not looked at yet.
const NOBODY: Camera = Camera {
    position: surfel::math::DVec3::ZERO,
    focal_point: surfel::math::DVec3::Y,
    view_up: surfel::math::DVec3::Z,
    projection: Projection::Panorama,
};
