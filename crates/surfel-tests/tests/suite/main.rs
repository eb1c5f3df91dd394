//! Integration tests across crates: scenes with known answers, fast searches against brute force, and output
//! that is the same on every machine.

mod alignment;
mod animation;
mod backend_materials;
mod backends;
mod bad_clouds;
mod batches;
mod brute_force;
mod deformation;
mod determinism;
mod furnace;
mod gaussians;
mod glass;
mod implicit;
mod instances;
mod light;
mod many_instances;
mod materials;
mod neighbors;
mod octree;
mod orientation;
mod packet_groups;
mod punctual_lights;
mod quality;
mod rays;
mod reference;
mod refit;
mod searches;
mod shapes;
mod smooth;
mod statistics;
mod support;
mod textures;
mod traversal_paths;
mod triangle_meshes;
mod triangles;
