//! Structure: which points form a surface, which a line, and which neither, and discs that suit it.
//!
//! `find_structures` is the search, in which each of the other files is a step or a tool of several steps; walls that an
//! aircraft sees (`sparse_walls`, `below_roofs`) are looked for after it. A file uses only those above it.

pub mod point_shape;
pub mod edge_planes;
pub mod neighborhood_stats;
pub mod octants;
pub mod plan_cells;
pub mod elevation_grid;
pub mod solids;
pub mod vegetation;
pub mod above_land;
pub mod structure_votes;
pub mod wall_faces;
pub mod junctions;
pub mod wide_discs;
pub mod stray_points;
pub mod see_through;
pub mod scan_lines;
pub mod ring_surfaces;
pub mod stated_normals;
pub mod connected_parts;
pub mod crown_patches;
pub mod find_structures;
pub mod thin_parts;
pub mod sparse_walls;
pub mod below_roofs;
