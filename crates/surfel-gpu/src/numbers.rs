//! The numbers that stand for kinds of things in the kernels, and the limits that kernels have.

use surfel_core::surface::{Align, SurfaceKind};

/// Number of invocations of a workgroup.
pub const WORKGROUP_SIZE: u32 = 64;
/// Number of rows of a band, in which pixels are numbered column by column.
pub const BAND_HEIGHT: u32 = 4;
/// Maximum number of entries of a queue: devices start at most 65,535 workgroups along an axis.
pub const MAX_QUEUE_ENTRIES: u32 = 65_535 * WORKGROUP_SIZE;
/// Maximum number of planes that limit camera rays.
pub const MAX_PLANES: usize = 8;
/// Bytes of a vector of four words.
pub const VECTOR_BYTES: usize = 16;
/// Vectors of four words that a node takes.
pub const NODE_VECTORS: usize = 5;
/// Maximum number of pages of the nodes of a tree.
pub const N_NODE_PAGES: usize = 2;
/// Maximum number of pages of the blocks of a tree.
pub const N_BLOCK_PAGES: usize = 4;
/// The distance beyond which there is nothing, instead of infinity.
pub const NO_LIMIT: f32 = 3e38;
/// The index that no instance and no slot has.
pub const NONE: u32 = u32::MAX;

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
    /// An environment map.
    pub const ENVIRONMENT: u32 = 6;
}

/// Numbers of the kinds of rays.
pub mod ray_kind {
    /// Camera rays.
    pub const PRIMARY: u32 = 0;
    /// Rays toward suns and lamps.
    pub const SHADOW: u32 = 1;
    /// Rays toward the sky and environment maps.
    pub const SKY: u32 = 2;
    /// Reflected and refracted rays, and those behind an alpha-blended layer.
    pub const SECONDARY: u32 = 3;
    /// Rays and points that are not counted.
    pub const UNCOUNTED: u32 = 4;
}

/// Numbers of the queues.
pub mod queue {
    /// Paths whose next rays are traced.
    pub const PATHS: u32 = 0;
    /// Points at which direct light is computed.
    pub const POINTS: u32 = 1;
    /// Rays toward a light.
    pub const LIGHT_RAYS: u32 = 2;
    /// Rays that the tests of discs leave undecided.
    pub const UNDECIDED: u32 = 3;
    /// Number of queues.
    pub const N_QUEUES: u32 = 4;
}

/// Indices of lengths of queues and numbers of rays.
pub mod count {
    use super::queue::N_QUEUES;
    use super::ray_kind::UNCOUNTED;

    /// Number of entries that were added to the first queue since it was taken.
    pub const FIRST_ADDED: u32 = 0;
    /// Number of entries of the first queue when it was taken.
    pub const FIRST_TAKEN: u32 = FIRST_ADDED + N_QUEUES;
    /// Number of rays traced of the first kind.
    pub const FIRST_TRACED: u32 = FIRST_TAKEN + N_QUEUES;
    /// The upper word of the number of rays traced of the first kind.
    pub const FIRST_TRACED_UPPER: u32 = FIRST_TRACED + UNCOUNTED + 1;
    /// Number of rays toward a light that are still on their way.
    pub const N_ACTIVE: u32 = FIRST_TRACED_UPPER + UNCOUNTED + 1;
    /// Greatest number of entries that were added to a queue. If it is more than the queue holds, some were lost.
    pub const MAX_ADDED: u32 = N_ACTIVE + 1;
    /// Number of counts.
    pub const N_COUNTS: u32 = MAX_ADDED + 1;
}

/// Numbers of backgrounds.
pub mod background {
    /// Nothing.
    pub const TRANSPARENT: u32 = 0;
    /// The environment or sky.
    pub const ENVIRONMENT: u32 = 1;
    /// A gradient over the picture.
    pub const GRADIENT: u32 = 2;
}

/// Numbers of the radiances that a path finds if its ray leaves the scene.
pub mod miss {
    /// The pixel's background.
    pub const BACKGROUND: u32 = 0;
    /// The pixel's background, or the sky where it is transparent.
    pub const THROUGH_GLASS: u32 = 1;
    /// The environment or sky.
    pub const SKY: u32 = 2;
    /// The environment or sky with the discs of suns.
    pub const SKY_WITH_SUN: u32 = 3;
}

/// The state of a path in one word: the number of its bounces and of the alpha-blended layers behind it, eight bits each,
/// and the number of the radiance that it finds if its ray leaves the scene.
pub mod path_state {
    /// A bounce.
    pub const BOUNCE: u32 = 1;
    /// An alpha-blended layer.
    pub const ALPHA_LAYER: u32 = 1 << 8;
    /// Number of the lowest bit of the number of the radiance.
    pub const MISS: u32 = 16;
    /// Maximum number of bounces, and of layers.
    pub const MAX_COUNT: u32 = 255;
}

/// Numbers of interpretations of alpha.
pub mod alpha_mode {
    /// Alpha is ignored.
    pub const OPAQUE: u32 = 0;
    /// The surface is cut out where alpha is low.
    pub const MASK: u32 = 1;
    /// The surface is blended with what is behind.
    pub const BLEND: u32 = 2;
}

/// Numbers of the textures of a material, and the bits of their flags.
pub mod texture {
    /// Base colour and alpha.
    pub const BASE_COLOR: u32 = 0;
    /// Roughness and metalness.
    pub const ROUGHNESS: u32 = 1;
    /// Normal map.
    pub const NORMAL: u32 = 2;
    /// Emission.
    pub const EMISSIVE: u32 = 3;
    /// Transmission.
    pub const TRANSMISSION: u32 = 4;
    /// Number of textures.
    pub const N_TEXTURES: usize = 5;
    /// The material has the texture.
    pub const IS_PRESENT: u32 = 1;
    /// The nearest texel is taken.
    pub const IS_NEAREST: u32 = 2;
    /// The second set of coordinates is used.
    pub const SECOND_UV_SET: u32 = 4;
    /// Lowest of the two bits of the horizontal continuation.
    pub const WRAP_X: u32 = 4;
    /// Lowest of the two bits of the vertical continuation.
    pub const WRAP_Y: u32 = 6;
    /// The texture repeats, mirrored every other time.
    pub const WRAP_MIRRORED: u32 = 1;
    /// The texels at the edge continue.
    pub const WRAP_CLAMP: u32 = 2;
}

/// Bits of the attributes that the vertices of triangles have, in the order of their columns.
pub mod attribute {
    /// Normals.
    pub const NORMALS: u32 = 1;
    /// Colours with alpha.
    pub const COLORS: u32 = 2;
    /// The first set of texture coordinates.
    pub const FIRST_UVS: u32 = 4;
    /// The second set of texture coordinates.
    pub const SECOND_UVS: u32 = 8;
    /// Tangents.
    pub const TANGENTS: u32 = 16;
    /// The material's normal map uses the second set of texture coordinates.
    pub const TANGENTS_OF_SECOND_UVS: u32 = 32;
}

/// The surface kinds in the order of their numbers.
pub const SURFACES: [SurfaceKind; 15] = [
    SurfaceKind::Points,
    SurfaceKind::Sphere,
    SurfaceKind::Disc,
    SurfaceKind::SplatMean,
    SurfaceKind::Splat,
    SurfaceKind::SplatFit,
    SurfaceKind::Cylinder,
    SurfaceKind::Mls,
    SurfaceKind::Implicit,
    SurfaceKind::Octree,
    SurfaceKind::OctreeSplat,
    SurfaceKind::Gaussian,
    SurfaceKind::Smooth,
    SurfaceKind::Capsule,
    SurfaceKind::Leaves,
];

/// The number that stands for triangles beside those of surface kinds.
pub const TRIANGLE: u32 = SURFACES.len() as u32;

/// Returns the number that stands for a surface kind in the kernels.
pub fn surface_number(kind: SurfaceKind) -> u32 {
    match kind {
        SurfaceKind::Points => 0,
        SurfaceKind::Sphere => 1,
        SurfaceKind::Disc => 2,
        SurfaceKind::SplatMean => 3,
        SurfaceKind::Splat => 4,
        SurfaceKind::SplatFit => 5,
        SurfaceKind::Cylinder => 6,
        SurfaceKind::Mls => 7,
        SurfaceKind::Implicit => 8,
        SurfaceKind::Octree => 9,
        SurfaceKind::OctreeSplat => 10,
        SurfaceKind::Gaussian => 11,
        SurfaceKind::Smooth => 12,
        SurfaceKind::Capsule => 13,
        SurfaceKind::Leaves => 14,
    }
}

/// Returns the number that stands for a rule by which normals are turned.
pub fn align_number(align: Align) -> u32 {
    match align {
        Align::Each => 0,
        Align::Nearest => 1,
        Align::Both => 2,
    }
}

#[cfg(test)]
mod tests {
    //! Each surface kind has one number.

    use super::*;

    #[test]
    fn surfaces_are_found_by_their_numbers() {
        for (number, kind) in SURFACES.into_iter().enumerate() {
            assert_eq!(surface_number(kind), number as u32);
        }
        for (name, kind) in SurfaceKind::ALL {
            assert!(SURFACES.contains(&kind), "{name}");
        }
    }
}
