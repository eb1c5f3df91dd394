//! Tests across crates: known answers, fast against plain, the same bytes everywhere.

mod batches;
mod build;
mod light;
mod modes;
mod plain;
mod quality;
mod reference;
mod refit;
mod repeatable;
mod shapes;
mod trace;
