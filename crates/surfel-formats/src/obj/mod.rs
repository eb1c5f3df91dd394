//! OBJ: meshes as text, with their materials in MTL files, read as meshes or as points (their vertices).

mod lines;
mod points;
mod parse;
mod build;
mod mtl;
mod textures;
mod mesh;

pub(crate) use mesh::{has_faces, read_mesh};
pub(crate) use points::{inspect, read};
