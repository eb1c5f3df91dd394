//! The records that Rust and the kernels share, field by field as in `shader/records.wgsl`.

use bytemuck::{Pod, Zeroable};
use surfel_core::surface::SurfaceKind;

/// Maximum number of planes that limit camera rays.
pub const MAX_PLANES: usize = 8;
/// The distance beyond which there is nothing, instead of infinity.
pub const NO_LIMIT: f32 = 3e38;
/// The index that no instance and no slot has.
pub const NONE: u32 = u32::MAX;

/// The picture, the camera, and the part of both that one pass renders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct FrameRecord {
    /// Position of the camera.
    pub position: [f32; 3],
    /// Number of the camera's [`lens`].
    pub lens: u32,
    /// Unit direction of the view.
    pub forward: [f32; 3],
    /// Width of a pixel in world units at distance 1, in world units, or in radians.
    pub pixel_width: f32,
    /// Unit direction to the right of the picture.
    pub right: [f32; 3],
    /// Height of a pixel in the unit of its width.
    pub pixel_height: f32,
    /// Unit direction to the top of the picture.
    pub up: [f32; 3],
    /// Number of planes.
    pub n_planes: u32,
    /// The picture's centre in pixels from its upper left corner.
    pub center: [f32; 2],
    /// Seed of all random numbers: its lower and its upper half.
    pub seed: [u32; 2],
    /// Width of the picture in pixels.
    pub width: u32,
    /// Index in the picture of the pixel of the first ray.
    pub first_pixel: u32,
    /// Number of rays: one for each pixel.
    pub n_rays: u32,
    /// Index of the sample among those of its pixel.
    pub sample_idx: u32,
    /// Number of samples of a pixel.
    pub samples_per_pixel: u32,
    /// 1 if rays go through the centres of pixels.
    pub is_centered: u32,
    /// 1 if the sample is the first one that is summed up.
    pub is_first: u32,
    /// Zero.
    pub reserved_a: u32,
    /// Normals of planes, and their distances from the scene's origin along these.
    pub planes: [[f32; 4]; MAX_PLANES],
}

/// An instance of a tree.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Visit {
    /// Columns of the transform from world to object coordinates.
    pub object_from_world: [[f32; 4]; 4],
    /// Columns of the matrix that transforms normals to world coordinates.
    pub world_from_normal: [[f32; 4]; 3],
    /// Index of the instance.
    pub instance: u32,
    /// Index of the material.
    pub material: u32,
    /// 1 if object and world coordinates are the same.
    pub is_identity: u32,
    /// Number of the surface kind, as [`surface_number`] gives it.
    pub surface: u32,
    /// Largest scale factor along the object's axes.
    pub max_scale: f32,
    /// Maximum distance between a ray's nearest disc and the discs that decide about its hit.
    pub max_blend_distance: f32,
    /// Factor on the radius of the neighbourhood of hits that the nearest points do not enclose.
    pub edge_retest_factor: f32,
    /// 1 if the angular-gap test rejects hits.
    pub has_edge_test: u32,
    /// 1 if normals point to the side from which the surface was seen.
    pub has_front_sides: u32,
    /// 1 if colours may be blended.
    pub blends_colors: u32,
    /// Vectors of four words that a block of triangles takes with the attributes of its vertices.
    pub block_vectors: u32,
    /// 1 if triangles have the normals of their vertices, 2 if they have colours, 3 for both.
    pub attributes: u32,
}

/// One of the samples of a light.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct LightSample {
    /// Unit vector toward the sun or a sky's zenith, or in which a spot shines.
    pub direction: [f32; 3],
    /// Number of the [`light_kind`].
    pub kind: u32,
    /// Linear colour of a sun, a headlight or a lamp, or radiance from a sky's zenith.
    pub color: [f32; 3],
    /// Cosine of half the sun's angular diameter.
    pub cos_max: f32,
    /// Radiance of a sky from straight below.
    pub ground: [f32; 3],
    /// Distance beyond which occluders have no effect on a sky.
    pub ao_distance: f32,
    /// Index of the sample among those of the light at a hit.
    pub sample_idx: u32,
    /// Number of samples of the light at a hit.
    pub n_samples: u32,
    /// Index of a lamp.
    pub light: u32,
    /// Distance that a lamp reaches.
    pub range: f32,
    /// Position of a lamp.
    pub position: [f32; 3],
    /// Radius of a lamp's luminous ball.
    pub radius: f32,
    /// Cosine of the angle from a spot's axis up to which the light has full strength.
    pub inner_cos: f32,
    /// Cosine of the angle from a spot's axis beyond which there is no light.
    pub outer_cos: f32,
    /// Zero.
    pub reserved_a: u32,
    /// Zero.
    pub reserved_b: u32,
}

/// A material.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct MaterialRecord {
    /// Linear base colour.
    pub base_color: [f32; 3],
    /// 1 if the colours of points are ignored.
    pub ignores_vertex_colors: u32,
    /// Emitted radiance.
    pub emissive: [f32; 3],
    /// Emitted radiance as a multiple of the base colour.
    pub emissive_strength: f32,
    /// 1 if the surface shows its base colour whatever the light.
    pub is_unlit: u32,
    /// Zero.
    pub reserved_a: u32,
    /// Zero.
    pub reserved_b: u32,
    /// Zero.
    pub reserved_c: u32,
}

/// The nearest hit of a ray.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct HitRecord {
    /// Unit normal in world space, facing the ray's origin.
    pub normal: [f32; 3],
    /// Distance along the ray.
    pub distance: f32,
    /// Linear colour.
    pub color: [f32; 3],
    /// Radius of the point in world units; 0 for triangles.
    pub radius: f32,
    /// Unit normal of the surface itself, which differs from the shading normal on triangles.
    pub geometric_normal: [f32; 3],
    /// Zero.
    pub reserved_c: f32,
    /// Slot of the point or triangle in its tree.
    pub slot: u32,
    /// Index of the instance, [`NONE`] for a miss.
    pub instance: u32,
    /// Index of the material.
    pub material: u32,
    /// Number of the surface kind.
    pub surface: u32,
    /// Number of points within one radius of the hit.
    pub support_count: u32,
    /// Distance from the hit to the nearest point in radii.
    pub support_distance: f32,
    /// Zero.
    pub reserved_a: u32,
    /// Zero.
    pub reserved_b: u32,
}

/// A ray toward a light.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ShadowRay {
    /// The ray.
    pub ray: surfel_core::math::Ray,
    /// Radiance that reaches the pixel if nothing blocks the ray.
    pub contribution: [f32; 3],
    /// 1 until something blocks the ray.
    pub is_open: u32,
}

/// The light of a pixel.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Pixel {
    /// Radiance of the current sample.
    pub radiance: [f32; 3],
    /// 1 if the current sample hits a surface.
    pub alpha: f32,
    /// Sum of radiance and alpha over all samples.
    pub sum: [f32; 4],
}

/// Numbers of lenses.
pub mod lens {
    /// A perspective projection.
    pub const PERSPECTIVE: u32 = 0;
    /// A parallel projection.
    pub const ORTHOGRAPHIC: u32 = 1;
    /// An equirectangular projection.
    pub const PANORAMA: u32 = 2;
}

/// Numbers of the kinds of lights.
pub mod light_kind {
    /// A sun without extent.
    pub const POINT_SUN: u32 = 0;
    /// A sun with soft shadows.
    pub const SUN: u32 = 1;
    /// A sky.
    pub const SKY: u32 = 2;
    /// A light at the camera.
    pub const HEADLIGHT: u32 = 3;
    /// A lamp that shines to all sides.
    pub const POINT: u32 = 4;
    /// A lamp that shines in a cone.
    pub const SPOT: u32 = 5;
}

/// Indices of the numbers of rays.
pub mod ray_kind {
    /// Camera rays.
    pub const PRIMARY: usize = 0;
    /// Rays toward suns.
    pub const SHADOW: usize = 1;
    /// Rays toward the sky.
    pub const SKY: usize = 2;
    /// Number of kinds.
    pub const N_KINDS: usize = 4;
}

/// The surface kinds, at the numbers that stand for them in the kernels.
pub const SURFACES: [SurfaceKind; 8] = [
    SurfaceKind::Points,
    SurfaceKind::Sphere,
    SurfaceKind::Disc,
    SurfaceKind::SplatMean,
    SurfaceKind::Splat,
    SurfaceKind::SplatFit,
    SurfaceKind::Smooth,
    SurfaceKind::Capsule,
];

/// The number that stands for triangles beside those of surface kinds.
pub const TRIANGLE: u32 = SURFACES.len() as u32;

/// Returns the number that stands for a surface kind in the kernels.
pub fn surface_number(kind: SurfaceKind) -> u32 {
    SURFACES.iter().position(|known| *known == kind).map_or(0, |number| number as u32)
}
