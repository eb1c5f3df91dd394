//! Pictures of point clouds, meshes and glTF scenes, ray traced from the points themselves.
//!
//! [`load`] opens a file and makes every choice from the data: up axis, camera, normals, radii, colours, light, exposure.
//!
//! ```no_run
//! let scene = surfel::load("scan.laz")?;
//! scene.render()?.save("scan.png")?;
//!
//! // Rays are [x, y, z, dx, dy, dz] in the coordinates of the file.
//! let rays = [[562330.0, 4183200.0, 160.0, 0.0, 0.0, -1.0]];
//! for hit in scene.cast_rays(&rays)?.into_iter().flatten() {
//!     println!("point {:?} at {:?}", hit.point, hit.position);
//! }
//! # Ok::<(), surfel::Error>(())
//! ```
//!
//! A [`SceneDescription`] says what the choices leave open. Its fields are the keys of scene files and the options of the
//! program `surfel`; `None` is a default or an automatic choice. [`resolve()`] opens the files, [`Resolved::build`]
//! builds the trees:
//!
//! ```
//! use surfel::description::{MaterialDescription, ObjectDescription};
//! use surfel::{SceneDescription, resolve};
//! use surfel_core::progress::NoProgress;
//!
//! # let folder = std::env::temp_dir().join(format!("surfel-tutorial-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! # let file = folder.join("hill.xyz");
//! let hill = |i: i32| {
//!     let (x, y) = (f64::from(i % 50) / 25.0 - 1.0, f64::from(i / 50) / 25.0 - 1.0);
//!     format!("{x} {y} {}\n", 0.5 * (-2.0 * (x * x + y * y)).exp())
//! };
//! std::fs::write(&file, (0..2500).map(hill).collect::<String>())?;
//!
//! let mut description = SceneDescription::default();
//! description.objects.push(ObjectDescription {
//!     material: Some(MaterialDescription {
//!         kind: Some("plastic".into()),
//!         ..MaterialDescription::default()
//!     }),
//!     ..ObjectDescription::new(&file)
//! });
//! description.picture.resolution = Some((64, 48));
//! description.sun.elevation = Some(25.0);
//!
//! let scene = resolve(&description, &NoProgress)?.build(&NoProgress)?;
//! for choice in scene.choices() {
//!     println!("{choice}");
//! }
//! let image = scene.render()?;
//! assert_eq!(image.coverage[24 * 64 + 32], 1.0);
//! image.save(folder.join("hill.png"))?;
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The renderer itself is the crate [`surfel_core`], the readers and writers are [`surfel_formats`].

pub mod file_names;
pub mod crs;
pub mod memory_files;
pub mod description;
mod error;
mod scene_file;
pub mod progress_log;
pub mod overlay;
pub mod resolve;
pub mod picture;
mod cache;
#[cfg(not(feature = "gpu"))]
mod no_gpu;
mod renderer;
mod built_scene;
pub mod ray_query;
pub mod animate;
mod point_source;
pub mod prepare;
mod scene_keys;
mod known_trees;
mod added_objects;
mod point_overlap;
mod thread_pools;
pub mod live_view;
mod live_trees;
mod height_map;
pub mod live_scene;
pub mod live_movie;

pub use built_scene::BuiltScene;
pub use description::SceneDescription;
pub use error::{Error, Result};
pub use picture::RenderedImage;
pub use progress_log::{Choice, Warning};
pub use ray_query::RayHit;
pub use renderer::SceneRenderer;
pub use resolve::{Resolved, resolve};
pub use thread_pools::{RendererOnThreads, start_global_threads, start_threads};

/// The crates that this one stands on.
#[cfg(feature = "gpu")]
pub use surfel_gpu;
pub use {surfel_core, surfel_formats};

use std::path::Path;
use surfel_core::progress::NoProgress;

/// Loads a file with every choice made from the data: a point cloud, a mesh, a glTF scene, or a scene file.
///
/// # Errors
///
/// Fails for missing and broken files and for scene files with wrong values.
pub fn load(path: impl AsRef<Path>) -> Result<BuiltScene> {
    let path = path.as_ref();
    let description = match description::is_scene_file(path) {
        true => SceneDescription::read(path)?,
        false => SceneDescription::of_files([path]),
    };
    resolve(&description, &NoProgress)?.build(&NoProgress)
}
