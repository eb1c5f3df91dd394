//! Gaps between discs: those that a scanner saw through stay open, others are closed.
//!
//! A file uses only those above it.

pub mod seen_scan;
pub mod free_space;
pub mod close_gaps;
