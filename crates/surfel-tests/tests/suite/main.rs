//! Tests across crates: known answers, fast against plain, the same bytes everywhere.

mod batches;
mod bending;
mod build;
mod crowds;
mod furnace;
mod glass;
mod groups;
mod instances;
mod lamps;
mod light;
mod materials;
mod modes;
mod moving;
mod plain;
mod quality;
mod reference;
mod refit;
mod repeatable;
mod shapes;
mod statistics;
mod textures;
mod trace;
mod triangles;
