//! Tests across crates: known answers, fast against plain, the same bytes everywhere.

mod trace;
