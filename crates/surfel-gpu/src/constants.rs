//! The declarations of the constants that the kernels share with Rust.

use crate::field_arrays::{
    CORNER_CELL_VECTORS, KD_HEAD_VECTORS, OCTREE_HEAD_VECTORS, PLANE_VECTORS,
};
use crate::numbers::alpha_mode;
use crate::numbers::attribute;
use crate::numbers::background;
use crate::numbers::count;
use crate::numbers::lens;
use crate::numbers::light_kind;
use crate::numbers::miss;
use crate::numbers::path_state;
use crate::numbers::queue;
use crate::numbers::texture;
use crate::numbers::{
    BAND_HEIGHT, MAX_PLANES, NO_LIMIT, NODE_VECTORS, NONE, TRIANGLE, WORKGROUP_SIZE, align_number,
    surface_number,
};
use surfel_core::bvh::MAX_DEPTH;
use surfel_core::flat::{MAX_KD_DEPTH, MAX_OCTREE_DEPTH};
use surfel_core::integrator::constants as integrator;
use surfel_core::math::eigen_lanes as eigen;
use surfel_core::math::{MIN_DIRECTION, Vec3};
use surfel_core::points::{CAPSULE_ASPECT, HARMONIC_0};
use surfel_core::surface::align;
use surfel_core::surface::capsule;
use surfel_core::surface::disc;
use surfel_core::surface::edge_test;
use surfel_core::surface::gaussian;
use surfel_core::surface::leaves::{self, LEAF_CENTERS, LEAF_NORMALS};
use surfel_core::surface::mls;
use surfel_core::surface::smooth;
use surfel_core::surface::{
    Align, FIELD_SUPPORT, FIT_REACH, MAX_GATHERED, MIN_DISC_WEIGHT, MIN_FIELD_WEIGHT,
    NEIGHBORHOOD_RADIUS_FACTOR, SOLID_ROUNDING, SOLID_SPAWN_OFFSET, SUPPORT_FACTOR, SurfaceKind,
};
use surfel_core::trace::constants as trace;

/// Number of colours by support, from the first to the last.
pub const N_SUPPORT_COLORS: u32 = 1 << 16;

/// Returns the declarations of the constants that the kernels share with Rust.
pub fn constants() -> String {
    let integers = [numbers(), kinds(), limits(), dimensions()].concat();
    let integers =
        integers.into_iter().map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
    let floats =
        floats().into_iter().map(|(name, value)| format!("const {name}: f32 = {value:?}f;\n"));
    integers.chain(floats).chain(leaf_arrays()).collect()
}

/// Returns the declarations of the centres and normals of the leaves of a cluster.
fn leaf_arrays() -> [String; 3] {
    let n_leaves = LEAF_CENTERS.len();
    let array = |name: &str, vectors: &[Vec3]| {
        let vectors: Vec<String> = vectors
            .iter()
            .map(|Vec3 { x, y, z }| format!("vec3<f32>({x:?}, {y:?}, {z:?})"))
            .collect();
        format!("const {name} = array<vec3<f32>, {n_leaves}>({});\n", vectors.join(", "))
    };
    [
        format!("const N_LEAVES: u32 = {n_leaves}u;\n"),
        array("LEAF_CENTERS", &LEAF_CENTERS),
        array("LEAF_NORMALS", &LEAF_NORMALS),
    ]
}

fn kinds() -> Vec<(&'static str, u32)> {
    let kinds = [
        ("SPHERE", SurfaceKind::Sphere),
        ("SPLAT", SurfaceKind::Splat),
        ("SPLAT_FIT", SurfaceKind::SplatFit),
        ("CYLINDER", SurfaceKind::Cylinder),
        ("MLS", SurfaceKind::Mls),
        ("IMPLICIT", SurfaceKind::Implicit),
        ("OCTREE", SurfaceKind::Octree),
        ("SMOOTH", SurfaceKind::Smooth),
        ("CAPSULE", SurfaceKind::Capsule),
        ("LEAVES", SurfaceKind::Leaves),
    ];
    kinds.into_iter().map(|(name, kind)| (name, surface_number(kind))).collect()
}

fn numbers() -> Vec<(&'static str, u32)> {
    vec![
        ("PERSPECTIVE", lens::PERSPECTIVE),
        ("PANORAMA", lens::PANORAMA),
        ("POINT_SUN", light_kind::POINT_SUN),
        ("SUN", light_kind::SUN),
        ("SKY", light_kind::SKY),
        ("HEADLIGHT", light_kind::HEADLIGHT),
        ("POINT", light_kind::POINT),
        ("SPOT", light_kind::SPOT),
        ("ENVIRONMENT", light_kind::ENVIRONMENT),
        ("TRIANGLE", TRIANGLE),
        ("ALIGN_EACH", align_number(Align::Each)),
        ("ALIGN_NEAREST", align_number(Align::Nearest)),
        ("PATHS", queue::PATHS),
        ("POINTS", queue::POINTS),
        ("LIGHT_RAYS", queue::LIGHT_RAYS),
        ("UNDECIDED", queue::UNDECIDED),
        ("N_QUEUES", queue::N_QUEUES),
        ("FIRST_ADDED", count::FIRST_ADDED),
        ("FIRST_TAKEN", count::FIRST_TAKEN),
        ("FIRST_TRACED", count::FIRST_TRACED),
        ("FIRST_TRACED_UPPER", count::FIRST_TRACED_UPPER),
        ("N_ACTIVE", count::N_ACTIVE),
        ("MAX_ADDED", count::MAX_ADDED),
        ("N_COUNTS", count::N_COUNTS),
        ("BACKGROUND_ENVIRONMENT", background::ENVIRONMENT),
        ("GRADIENT", background::GRADIENT),
        ("MISS_BACKGROUND", miss::BACKGROUND),
        ("MISS_THROUGH_GLASS", miss::THROUGH_GLASS),
        ("MISS_SKY", miss::SKY),
        ("MISS_SKY_WITH_SUN", miss::SKY_WITH_SUN),
        ("PATH_BOUNCE", path_state::BOUNCE),
        ("PATH_ALPHA_LAYER", path_state::ALPHA_LAYER),
        ("PATH_MISS", path_state::MISS),
        ("MAX_PATH_COUNT", path_state::MAX_COUNT),
        ("ALPHA_MASK", alpha_mode::MASK),
        ("ALPHA_BLEND", alpha_mode::BLEND),
        ("BASE_COLOR_TEXTURE", texture::BASE_COLOR),
        ("ROUGHNESS_TEXTURE", texture::ROUGHNESS),
        ("NORMAL_TEXTURE", texture::NORMAL),
        ("EMISSIVE_TEXTURE", texture::EMISSIVE),
        ("TRANSMISSION_TEXTURE", texture::TRANSMISSION),
        ("N_TEXTURES", texture::N_TEXTURES as u32),
        ("TEXTURE_IS_PRESENT", texture::IS_PRESENT),
        ("TEXTURE_IS_NEAREST", texture::IS_NEAREST),
        ("TEXTURE_SECOND_UV_SET", texture::SECOND_UV_SET),
        ("TEXTURE_WRAP_X", texture::WRAP_X),
        ("TEXTURE_WRAP_Y", texture::WRAP_Y),
        ("WRAP_MIRRORED", texture::WRAP_MIRRORED),
        ("WRAP_CLAMP", texture::WRAP_CLAMP),
        ("HAS_NORMALS", attribute::NORMALS),
        ("HAS_COLORS_OF_VERTICES", attribute::COLORS),
        ("HAS_FIRST_UVS", attribute::FIRST_UVS),
        ("HAS_SECOND_UVS", attribute::SECOND_UVS),
        ("HAS_TANGENTS", attribute::TANGENTS),
        ("TANGENTS_OF_SECOND_UVS", attribute::TANGENTS_OF_SECOND_UVS),
    ]
}

fn limits() -> Vec<(&'static str, u32)> {
    vec![
        ("NONE", NONE),
        ("WORKGROUP_SIZE", WORKGROUP_SIZE),
        ("BAND_HEIGHT", BAND_HEIGHT),
        ("MAX_PLANES", MAX_PLANES as u32),
        ("MAX_DEPTH", MAX_DEPTH as u32),
        ("NODE_VECTORS", NODE_VECTORS as u32),
        ("MAX_GATHERED", MAX_GATHERED as u32),
        ("MAX_REJECTED_HITS", trace::MAX_REJECTED_HITS as u32),
        ("MAX_FITS", trace::MAX_FITS as u32),
        ("KD_DEPTH", MAX_KD_DEPTH as u32 + 1),
        ("KD_HEAD_VECTORS", KD_HEAD_VECTORS as u32),
        ("N_SAMPLES", trace::field::N_SAMPLES as u32),
        ("OCTREE_DEPTH", MAX_OCTREE_DEPTH as u32),
        ("OCTREE_HEAD_VECTORS", OCTREE_HEAD_VECTORS as u32),
        ("PLANE_VECTORS", PLANE_VECTORS as u32),
        ("CORNER_CELL_VECTORS", CORNER_CELL_VECTORS as u32),
        ("N_PARTS", trace::octree::N_PARTS as u32),
        ("BUFFER_SIZE", trace::gaussian::BUFFER_SIZE as u32),
        ("MAX_TRIED_BALLS", trace::mls::MAX_TRIED_BALLS as u32),
        ("MLS_MAX_FITS", trace::mls::MAX_FITS as u32),
        ("N_PLANES", trace::mls::N_PLANES as u32),
        ("MLS_STEPS", mls::N_STEPS as u32),
        ("N_EIGEN_STEPS", eigen::N_STEPS as u32),
        ("MAX_ALPHA_LAYERS", integrator::MAX_ALPHA_LAYERS),
        ("MIN_DENSE", edge_test::MIN_DENSE),
        ("MIN_NEIGHBORS", edge_test::MIN_NEIGHBORS),
        ("ALBEDO_STEPS", integrator::ALBEDO_STEPS as u32),
        ("N_ALBEDO_VECTORS", (integrator::ALBEDO_STEPS.pow(2) / 4) as u32),
        ("N_SUPPORT_COLORS", N_SUPPORT_COLORS),
    ]
}

/// Returns the random dimensions, all of which are below 2^32.
fn dimensions() -> Vec<(&'static str, u32)> {
    let dimensions = [
        ("SKY_DIRECTION", integrator::SKY_DIRECTION),
        ("SKY_DISTANCE", integrator::SKY_DISTANCE),
        ("SUN_DIRECTION", integrator::SUN_DIRECTION),
        ("ENVIRONMENT_DIRECTION", integrator::ENVIRONMENT_DIRECTION),
        ("PUNCTUAL_LIGHT_POSITION", integrator::PUNCTUAL_LIGHT_POSITION),
        ("LOBE_DIRECTION", integrator::LOBE_DIRECTION),
        ("ROULETTE", integrator::ROULETTE),
        ("REFLECTED", integrator::REFLECTED),
        ("REFRACTED", integrator::REFRACTED),
        ("ALPHA_LAYER", integrator::ALPHA_LAYER),
    ];
    dimensions.into_iter().map(|(name, value)| (name, value as u32)).collect()
}

fn floats() -> Vec<(&'static str, f32)> {
    vec![
        ("NO_LIMIT", NO_LIMIT),
        ("EPSILON", f32::EPSILON),
        ("ROUNDING", trace::ROUNDING),
        ("MIN_DIRECTION", MIN_DIRECTION),
        ("CAPSULE_ASPECT", CAPSULE_ASPECT),
        ("MIN_ACROSS", capsule::MIN_ACROSS),
        ("LEAF_RADIUS", leaves::LEAF_RADIUS),
        ("LEAVES_REACH", leaves::REACH),
        ("MIN_DISC_WEIGHT", MIN_DISC_WEIGHT),
        ("MIN_ALIGNED_COSINE", align::MIN_ALIGNED_COSINE),
        ("MIN_BENT_COSINE", align::MIN_BENT_COSINE),
        ("MIN_SPREAD", eigen::MIN_SPREAD),
        ("NORMAL_STEPS", eigen::NORMAL_STEPS),
        ("MIN_CROSS", eigen::MIN_CROSS),
        ("SOLID_ROUNDING", SOLID_ROUNDING),
        ("SOLID_SPAWN_OFFSET", SOLID_SPAWN_OFFSET),
        ("DISC_SPAWN_OFFSET", disc::SPAWN_OFFSET),
        ("DISC_SPAWN_T_MIN", disc::SPAWN_T_MIN),
        ("SMOOTH_SPAWN_OFFSET", smooth::SPAWN_OFFSET),
        ("SMOOTH_SPAWN_T_MIN", smooth::SPAWN_T_MIN),
        ("SMOOTH_LIGHT_STEEPNESS", smooth::LIGHT_STEEPNESS),
        ("LEAVING_DISTANCE", smooth::LEAVING_DISTANCE),
        ("FIELD_SUPPORT", FIELD_SUPPORT),
        ("MIN_FIELD_WEIGHT", MIN_FIELD_WEIGHT),
        ("FIELD_OVERLAP", trace::field::OVERLAP),
        ("FIELD_MIN_COLOR_WEIGHT", trace::field::MIN_COLOR_WEIGHT),
        ("BRACKET_MARGIN", trace::field::BRACKET_MARGIN),
        ("LINEAR_STEP", trace::field::LINEAR_STEP),
        ("MAX_CELL_MARGIN", trace::octree::MAX_CELL_MARGIN),
        ("CORNER_MARGIN", trace::octree::CORNER_MARGIN),
        ("MIN_ALPHA", gaussian::MIN_ALPHA),
        ("MAX_ALPHA", gaussian::MAX_ALPHA),
        ("MIN_GAUSSIAN_TRANSMITTANCE", gaussian::MIN_GAUSSIAN_TRANSMITTANCE),
        ("HARMONIC_0", HARMONIC_0 as f32),
        ("HARMONIC_1", gaussian::D1),
        ("HARMONIC_2_A", gaussian::D2[0]),
        ("HARMONIC_2_B", gaussian::D2[1]),
        ("HARMONIC_2_C", gaussian::D2[2]),
        ("HARMONIC_3_A", gaussian::D3[0]),
        ("HARMONIC_3_B", gaussian::D3[1]),
        ("HARMONIC_3_C", gaussian::D3[2]),
        ("HARMONIC_3_D", gaussian::D3[3]),
        ("HARMONIC_3_E", gaussian::D3[4]),
        ("MLS_SPAWN_OFFSET", mls::SPAWN_OFFSET),
        ("MLS_SPAWN_T_MIN", mls::SPAWN_T_MIN),
        ("MLS_SUPPORT", mls::SUPPORT_FACTOR),
        ("MLS_MIN_WEIGHT", mls::MIN_WEIGHT),
        ("SLOPE_PENALTY", mls::SLOPE_PENALTY),
        ("BEND_PENALTY", mls::BEND_PENALTY),
        ("LIST_MARGIN", trace::mls::LIST_MARGIN),
        ("MAX_DISTANCE_FROM_BALL", trace::mls::MAX_DISTANCE_FROM_BALL),
        ("MLS_MAX_STEP", trace::mls::MAX_STEP),
        ("MLS_TOLERANCE", trace::mls::TOLERANCE),
        ("MLS_MIN_COLOR_WEIGHT", trace::mls::MIN_COLOR_WEIGHT),
        ("MLS_RESTART_OFFSET", trace::mls::RESTART_OFFSET),
        ("RESTART_FRACTION", trace::mls::RESTART_FRACTION),
        ("NEIGHBORHOOD_RADIUS_FACTOR", NEIGHBORHOOD_RADIUS_FACTOR),
        ("EDGE_MAX_PLANE_DISTANCE", edge_test::MAX_PLANE_DISTANCE),
        ("MIN_PASSED_DISTANCE", edge_test::MIN_PASSED_DISTANCE),
        ("MAX_BACKFACE_COSINE", edge_test::MAX_BACKFACE_COSINE),
        ("MIN_SQUARED_OFFSET", edge_test::MIN_SQUARED_OFFSET),
        ("HEIGHT_STEPS", edge_test::HEIGHT_STEPS),
        ("TIE_BREAK_ANGLE", edge_test::TIE_BREAK_ANGLE),
        ("RETRY_RADIUS_FACTOR", trace::RETRY_RADIUS_FACTOR),
        ("RESTART_OFFSET", trace::RESTART_OFFSET),
        ("SMOOTH_RESTART_OFFSET", trace::SMOOTH_RESTART_OFFSET),
        ("MIN_SLIT_DEPTH", trace::MIN_SLIT_DEPTH),
        ("MIN_SLIT_COSINE", trace::MIN_SLIT_COSINE),
        ("MAX_DISTANCE_FROM_DISC", trace::MAX_DISTANCE_FROM_DISC),
        ("FIT_TOLERANCE", trace::TOLERANCE),
        ("MAX_LAST_STEP", trace::MAX_LAST_STEP),
        ("SUPPORT_FACTOR", SUPPORT_FACTOR),
        ("FIT_REACH", FIT_REACH),
        ("MIN_GRADIENT", smooth::MIN_GRADIENT),
        ("FIT_STEPS", smooth::STEPS),
        ("FIT_MIN_WEIGHT", smooth::MIN_WEIGHT),
        ("NEAREST_COLOR_WEIGHT", smooth::NEAREST_COLOR_WEIGHT),
        ("NORMAL_FALLOFF", smooth::NORMAL_FALLOFF),
        ("MAX_CURVATURE", smooth::MAX_CURVATURE),
        ("FLAT_SPREAD", smooth::FLAT_SPREAD),
        ("CURVED_SPREAD", smooth::CURVED_SPREAD),
        ("FIT_MAX_PLANE_DISTANCE", smooth::MAX_PLANE_DISTANCE),
        ("MAX_EDGE_COSINE", smooth::MAX_EDGE_COSINE),
        ("MIN_EDGE_WEIGHT", smooth::MIN_EDGE_WEIGHT),
        ("MAX_OVERHANG", smooth::MAX_OVERHANG),
        ("MAX_STEP", smooth::MAX_STEP),
        ("MIN_FACING_COS", integrator::MIN_FACING_COS),
        ("MIN_OFFSET_COS", integrator::MIN_OFFSET_COS),
        ("MIN_GGX_ALPHA", integrator::MIN_GGX_ALPHA),
        ("MIN_GGX_COS", integrator::MIN_GGX_COS),
        ("MIN_MASKING_COS", integrator::MIN_MASKING_COS),
        ("MIN_ROUGHNESS", integrator::MIN_ROUGHNESS),
        ("MIN_WEIGHT", integrator::MIN_WEIGHT),
        ("MIN_TRANSMITTANCE", integrator::MIN_TRANSMITTANCE),
        ("MAX_SUN_RADIANCE", integrator::MAX_SUN_RADIANCE),
    ]
}
