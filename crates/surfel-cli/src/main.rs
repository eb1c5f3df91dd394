//! The program `surfel`.

fn main() {}
