//! Readers and writers: real scans, files made by the tests, and malformed files.

#[path = "../../surfel-tests/src/skipped.rs"]
mod skipped;
#[path = "../../surfel-tests/src/shared_data.rs"]
mod shared_data;
#[path = "formats/common.rs"]
mod common;
#[path = "formats/bin.rs"]
mod bin;
#[path = "formats/ply.rs"]
mod ply;
#[path = "formats/pcd.rs"]
mod pcd;
#[path = "formats/ptx.rs"]
mod ptx;
#[path = "formats/e57_writer.rs"]
mod e57_writer;
#[path = "formats/e57_scans.rs"]
mod e57_scans;
#[path = "formats/e57_images.rs"]
mod e57_images;
#[path = "formats/text.rs"]
mod text;
#[path = "formats/esri_grid.rs"]
mod esri_grid;
#[path = "formats/text_output.rs"]
mod text_output;
#[path = "formats/las_point_formats.rs"]
mod las_point_formats;
#[path = "formats/las_output.rs"]
mod las_output;
#[path = "formats/real_scans.rs"]
mod real_scans;
#[path = "formats/filters.rs"]
mod filters;
#[path = "formats/round_trip.rs"]
mod round_trip;
#[path = "formats/malformed.rs"]
mod malformed;
#[path = "formats/salvage.rs"]
mod salvage;
#[path = "formats/e57_salvage.rs"]
mod e57_salvage;
#[path = "formats/meshes.rs"]
mod meshes;
#[path = "formats/off.rs"]
mod off;
#[path = "formats/mesh_materials.rs"]
mod mesh_materials;
#[path = "formats/malformed_meshes.rs"]
mod malformed_meshes;
#[path = "formats/gltf_asset.rs"]
mod gltf_asset;
#[path = "formats/gltf.rs"]
mod gltf;
#[path = "formats/gltf_geometry.rs"]
mod gltf_geometry;
#[path = "formats/gltf_scene.rs"]
mod gltf_scene;
#[path = "formats/gltf_invalid_values.rs"]
mod gltf_invalid_values;
#[path = "formats/gltf_malformed_files.rs"]
mod gltf_malformed_files;
#[path = "formats/environment_maps.rs"]
mod environment_maps;
#[path = "formats/images.rs"]
mod images;
#[path = "formats/movies.rs"]
mod movies;
