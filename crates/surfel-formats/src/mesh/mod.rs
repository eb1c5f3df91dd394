//! Meshes of any file format: welding, repairs and textures.

mod weld;
mod repair;
mod model;
mod vertex_colors;
mod texture;
mod texture_loader;

pub(crate) use model::{Model, relative_to_origin, repair_model};
pub(crate) use repair::{drop_invalid_triangles, repair_normals};
pub(crate) use texture::decode_texture;
pub(crate) use texture_loader::TextureLoader;
pub(crate) use vertex_colors::linear_colors;
pub(crate) use weld::weld;
