//! Files in and out: real scans, files made by the tests, and broken ones.

#[path = "formats/common.rs"]
mod common;
#[path = "formats/bin.rs"]
mod bin;
#[path = "formats/broken.rs"]
mod broken;
#[path = "formats/movies.rs"]
mod movies;
#[path = "formats/environments.rs"]
mod environments;
#[path = "formats/meshes.rs"]
mod meshes;
#[path = "formats/broken_meshes.rs"]
mod broken_meshes;
#[path = "formats/materials.rs"]
mod materials;
#[path = "formats/gltf.rs"]
mod gltf;
#[path = "formats/gltf_geometry.rs"]
mod gltf_geometry;
#[path = "formats/gltf_scene.rs"]
mod gltf_scene;
#[path = "formats/gltf_asset.rs"]
mod gltf_asset;
#[path = "formats/gltf_broken.rs"]
mod gltf_broken;
#[path = "formats/gltf_broken_files.rs"]
mod gltf_broken_files;
#[path = "formats/ply.rs"]
mod ply;
#[path = "formats/pictures.rs"]
mod pictures;
#[path = "formats/point_formats.rs"]
mod point_formats;
#[path = "formats/round_trip.rs"]
mod round_trip;
#[path = "formats/scans.rs"]
mod scans;
#[path = "formats/text.rs"]
mod text;
