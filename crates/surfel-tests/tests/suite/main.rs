//! Tests across crates: known answers, fast against plain, the same bytes everywhere.

mod light;
mod quality;
mod reference;
mod repeatable;
mod shapes;
mod trace;
