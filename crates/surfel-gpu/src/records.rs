//! The records that Rust and the kernels share, field by field as in `shader/records.wgsl`.

use crate::numbers::{MAX_PLANES, texture};
use bytemuck::{Pod, Zeroable};

/// The picture, the camera, and the part of both that one pass renders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct FrameRecord {
    /// Position of the camera.
    pub position: [f32; 3],
    /// Number of the camera's [`lens`](crate::numbers::lens).
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
    /// Number of columns that are rendered.
    pub n_columns: u32,
    /// Number of the pixel of the first ray among those that are rendered, in bands of rows, column by column.
    pub first_pixel: u32,
    /// Number of rays: one for each pixel.
    pub n_rays: u32,
    /// Index of the sample among those of its pixel.
    pub sample_idx: u32,
    /// Number of samples of a pixel that are summed up.
    pub n_samples: u32,
    /// 1 if rays go through the centres of pixels.
    pub is_centered: u32,
    /// 1 if the sample is the first one that is summed up.
    pub is_first: u32,
    /// Number of entries that each queue holds.
    pub capacity: u32,
    /// Linear colour of the background at the top of the picture.
    pub background_top: [f32; 3],
    /// Number of the [`background`](crate::numbers::background).
    pub background: u32,
    /// Linear colour of the background at the bottom of the picture.
    pub background_bottom: [f32; 3],
    /// Height of the picture in pixels.
    pub height: u32,
    /// Unit vector from the bottom to the top of the background.
    pub background_up: [f32; 3],
    /// Number of lights.
    pub n_lights: u32,
    /// Maximum number of reflections and refractions along a path.
    pub max_depth: u32,
    /// Number of rays toward each extended light from a hit of a camera ray.
    pub n_light_samples: u32,
    /// Size of a pixel at the origins of rays.
    pub pixel_at_origin: f32,
    /// Growth of a pixel with the distance.
    pub pixel_per_distance: f32,
    /// The first row that is rendered.
    pub first_row: u32,
    /// Number of rows that are rendered.
    pub n_rows: u32,
    /// The first column that is rendered.
    pub first_column: u32,
    /// Zero.
    pub reserved: u32,
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
    /// Columns of the matrix that transforms vectors to world coordinates.
    pub world_from_object: [[f32; 4]; 3],
    /// Index of the instance.
    pub instance: u32,
    /// Number of the rule by which normals are turned before they are blended, see
    /// [`align_number`](crate::numbers::align_number).
    pub align: u32,
    /// 1 if object and world coordinates are the same.
    pub is_identity: u32,
    /// Number of the surface kind, as [`surface_number`](crate::numbers::surface_number) gives it.
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
    /// Vectors of four words that a block of triangles takes with the attributes of its vertices, or a block of trained
    /// Gaussians with the coefficients of their colours.
    pub block_vectors: u32,
    /// The [`attribute`](crate::numbers::attribute)s of the vertices of triangles.
    pub attributes: u32,
    /// 1 if the radius of the nearest disc alone decides which discs are blended.
    pub gathers_to_nearest: u32,
    /// 1 if normals point out of the body, so that a back face is seen from inside.
    pub has_outward_normals: u32,
    /// Minimum number of discs of a hit.
    pub min_discs: u32,
    /// 1 if the transform mirrors.
    pub is_mirrored: u32,
    /// Lower corner of the bounding box in world coordinates.
    pub lower: [f32; 3],
    /// Factor that multiplied the radii of the points.
    pub radius_factor: f32,
    /// Upper corner of the bounding box in world coordinates.
    pub upper: [f32; 3],
    /// Zero.
    pub reserved_a: f32,
    /// Index of the root of the tree of trained Gaussians.
    pub root_node: u32,
    /// Index of the first vector of four words of the blocks of trained Gaussians, or of the structure behind the nodes of
    /// a field's points.
    pub first_vector: u32,
    /// Number of spherical harmonics of each channel of trained Gaussians.
    pub n_harmonics: u32,
    /// Zero.
    pub reserved_b: u32,
}

/// The task of a pass: the sample of a light, the queue that it works on and the kind of its rays, or the instances of a
/// tree.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Task {
    /// Index of the light.
    pub light: u32,
    /// Index of the sample among those of the light at a hit.
    pub sample_idx: u32,
    /// Maximum number of samples of the light at a hit.
    pub max_samples: u32,
    /// Number of the [`queue`](crate::numbers::queue).
    pub queue: u32,
    /// Number of the [`ray_kind`](crate::numbers::ray_kind) of the rays in the queue.
    pub ray_kind: u32,
    /// Index of the first [`Visit`].
    pub first_visit: u32,
    /// Number of visits.
    pub n_visits: u32,
    /// Index of the round of a search.
    pub round: u32,
}

/// A light.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct LightRecord {
    /// Unit vector toward the sun or a sky's zenith, or in which a spot shines; to the right of the middle of an
    /// environment map.
    pub direction: [f32; 3],
    /// Number of the [`light_kind`](crate::numbers::light_kind).
    pub kind: u32,
    /// Linear colour of a sun, a headlight or a lamp, or radiance from a sky's zenith; unit vector to the middle of an
    /// environment map.
    pub color: [f32; 3],
    /// Cosine of half the sun's angular diameter.
    pub cos_max: f32,
    /// Radiance of a sky from straight below; unit vector to the top of an environment map.
    pub ground: [f32; 3],
    /// Distance beyond which occluders have no effect on a sky.
    pub ao_distance: f32,
    /// Position of a lamp.
    pub position: [f32; 3],
    /// Radius of a lamp's luminous ball.
    pub radius: f32,
    /// Cosine of the angle from a spot's axis up to which the light has full strength.
    pub inner_cos: f32,
    /// Cosine of the angle from a spot's axis beyond which there is no light.
    pub outer_cos: f32,
    /// Distance that a lamp reaches.
    pub range: f32,
    /// Index of a lamp among the lamps, [`NONE`](crate::numbers::NONE) for other lights.
    pub lamp: u32,
    /// Width and height of an environment map.
    pub size: [u32; 2],
    /// Index of the first word of an environment map.
    pub first_word: u32,
    /// Factor of the radiance of an environment map.
    pub strength: f32,
}

/// A material's reference to a texture.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct TextureRecord {
    /// Index of the first texel.
    pub first_word: u32,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// The bits of [`texture`].
    pub flags: u32,
    /// Offset of the coordinates.
    pub offset: [f32; 2],
    /// Scale of the coordinates.
    pub scale: [f32; 2],
    /// Cosine of the rotation of the coordinates.
    pub cos: f32,
    /// Sine of the rotation of the coordinates.
    pub sin: f32,
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
    /// Colour of white light after `attenuation_distance` inside of the body.
    pub attenuation_color: [f32; 3],
    /// Distance in object units, [`NO_LIMIT`](crate::numbers::NO_LIMIT) if nothing is absorbed.
    pub attenuation_distance: f32,
    /// 1 if the surface shows its base colour whatever the light.
    pub is_unlit: u32,
    /// Opacity from 0 to 1.
    pub alpha: f32,
    /// Number of the [`alpha_mode`](crate::numbers::alpha_mode).
    pub alpha_mode: u32,
    /// Opacity below which a mask cuts the surface out.
    pub alpha_cutoff: f32,
    /// Metalness from 0 to 1.
    pub metallic: f32,
    /// Perceptual roughness from 0 to 1.
    pub roughness: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Fraction of the entering light that is transmitted.
    pub transmission: f32,
    /// 1 if the surface is a thin slab without an interior.
    pub is_thin: u32,
    /// Scale of the x and y of a normal map.
    pub normal_scale: f32,
    /// Zero.
    pub reserved_a: u32,
    /// Zero.
    pub reserved_b: u32,
    /// Textures at the numbers of [`texture`].
    pub textures: [TextureRecord; texture::N_TEXTURES],
}

/// An instance as shading sees it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct InstanceRecord {
    /// Lower corner of the bounding box in world coordinates.
    pub lower: [f32; 3],
    /// Index of the material.
    pub material: u32,
    /// Upper corner of the bounding box in world coordinates.
    pub upper: [f32; 3],
    /// Largest scale factor along the object's axes.
    pub max_scale: f32,
    /// 1 if normals point out of the body, so that a back face is seen from inside.
    pub has_outward_normals: u32,
    /// The [`attribute`](crate::numbers::attribute)s of the vertices of triangles.
    pub attributes: u32,
    /// Index of the first word of the colours by support, [`NONE`](crate::numbers::NONE) without them.
    pub first_support_color: u32,
    /// Distance in radii of the first colour.
    pub support_low: f32,
    /// Distance in radii of the last colour.
    pub support_high: f32,
    /// Factor on the radius of a hit of the surface, from which the distance follows that new rays skip.
    pub spawn_factor: f32,
    /// Zero.
    pub reserved_a: u32,
    /// Zero.
    pub reserved_b: u32,
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
    /// Alpha of the geometry.
    pub alpha: f32,
    /// Slot of the point or triangle in its tree.
    pub slot: u32,
    /// Index of the instance, [`NONE`](crate::numbers::NONE) for a miss.
    pub instance: u32,
    /// 1 if the ray hits the back of the surface, as far as its orientation is known.
    pub is_backface: u32,
    /// Number of the surface kind.
    pub surface: u32,
    /// Number of points within one radius of the hit.
    pub support_count: u32,
    /// Distance from the hit to the nearest point in radii.
    pub support_distance: f32,
    /// Barycentric coordinates of the triangle's second and third corners.
    pub barycentrics: [f32; 2],
    /// Both sets of texture coordinates.
    pub uvs: [f32; 4],
    /// Unit tangent of a normal map in world space, zero without one, and the sign of its bitangent.
    pub tangent: [f32; 4],
    /// Radiance of the trained Gaussians before the hit.
    pub gaussian_radiance: [f32; 3],
    /// Fraction of the light from the hit that the Gaussians let pass.
    pub gaussian_transmittance: f32,
    /// Distance along the ray to the Gaussians, [`NO_LIMIT`](crate::numbers::NO_LIMIT) without any.
    pub gaussian_distance: f32,
    /// Zero.
    pub reserved_a: u32,
    /// Zero.
    pub reserved_b: u32,
    /// Zero.
    pub reserved_c: u32,
}

/// A path's next ray, or a ray toward a light.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Path {
    /// The ray.
    pub ray: surfel_core::math::Ray,
    /// Throughput from the ray's end to the camera, or the radiance that a light adds if nothing blocks the ray.
    pub weight: [f32; 3],
    /// Index of the pixel in its part of the picture.
    pub pixel: u32,
    /// The light that has passed all surfaces so far, of a ray toward a light.
    pub transmittance: [f32; 3],
    /// Distance from the surface that the ray left to its origin, along the ray.
    pub origin_offset: f32,
    /// Instances that the ray is inside of; the one entered last comes first.
    pub media: [u32; 4],
    /// Random key.
    pub key: [u32; 2],
    /// Index of the path among those with the same random key.
    pub index: u32,
    /// Depth, number of alpha-blended layers and [`miss`](crate::numbers::miss), from the lowest bits; of a ray toward a
    /// light 1 until it is done.
    pub state: u32,
}

/// A point at which direct light is computed.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ShadingPointRecord {
    /// Position of the point.
    pub position: [f32; 3],
    /// Distance by which new rays are offset.
    pub spawn_offset: f32,
    /// Unit shading normal.
    pub normal: [f32; 3],
    /// Distance at which new rays begin.
    pub spawn_t_min: f32,
    /// Unit normal along which new rays are offset.
    pub geometric_normal: [f32; 3],
    /// Perceptual roughness from 0 to 1.
    pub roughness: f32,
    /// Unit direction toward the viewer.
    pub to_viewer: [f32; 3],
    /// Index of the pixel in its part of the picture.
    pub pixel: u32,
    /// Diffuse albedo times the throughput of the path to the camera.
    pub diffuse: [f32; 3],
    /// Index of the path among those with the same random key.
    pub index: u32,
    /// Specular reflectance of a rough surface times the throughput of the path to the camera.
    pub glossy: [f32; 3],
    /// Number of rays toward each extended light.
    pub n_light_samples: u32,
    /// The media on the viewer's side of the surface.
    pub media: [u32; 4],
    /// Random key of the path.
    pub key: [u32; 2],
    /// Reciprocal of the cosine to the normal from which on rays toward lights begin at once.
    pub light_steepness: f32,
    /// Zero.
    pub reserved: u32,
}

/// The state of a search along a ray: the disc near which a round tests whether the ray hits the surface.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct SearchState {
    /// Slot of the disc, [`NONE`](crate::numbers::NONE) without one.
    pub slot: u32,
    /// Distance to it along the ray.
    pub distance: f32,
    /// Slot of the first disc that the ray passed, from its front where front sides are known;
    /// [`NONE`](crate::numbers::NONE) without one.
    pub passed_slot: u32,
    /// Distance to that disc.
    pub passed_distance: f32,
    /// Entries in the queues of undecided rays, one for even and one for odd rounds: the indices of other rays.
    pub undecided: [u32; 2],
    /// Zero.
    pub reserved_a: u32,
    /// Zero.
    pub reserved_b: u32,
}

/// Sums of radiance and alpha over all samples of a pixel, in fixed point of 32 bits before and 32 behind the point: the
/// lower words come first.
pub type Pixel = [u32; 8];
