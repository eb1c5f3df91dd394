// The records that the kernels share with Rust, and the buffers that hold them.

// The picture, the camera, and the part of both that one pass renders.
struct FrameRecord {
    position: vec3<f32>,
    lens: u32,
    forward: vec3<f32>,
    pixel_width: f32,
    right: vec3<f32>,
    pixel_height: f32,
    up: vec3<f32>,
    n_planes: u32,
    center: vec2<f32>,
    seed: vec2<u32>,
    width: u32,
    first_pixel: u32,
    n_rays: u32,
    sample_idx: u32,
    samples_per_pixel: u32,
    is_centered: u32,
    is_first: u32,
    reserved_a: u32,
    // Normals of planes, and their distances from the scene's origin along these.
    planes: array<vec4<f32>, MAX_PLANES>,
}

// An instance of a tree.
struct Visit {
    object_from_world: mat4x3<f32>,
    world_from_normal: mat3x3<f32>,
    instance: u32,
    material: u32,
    is_identity: u32,
    surface: u32,
    max_scale: f32,
    max_blend_distance: f32,
    edge_retest_factor: f32,
    has_edge_test: u32,
    has_front_sides: u32,
    blends_colors: u32,
    block_vectors: u32,
    attributes: u32,
}

// One of the samples of a light.
struct LightSample {
    direction: vec3<f32>,
    kind: u32,
    color: vec3<f32>,
    cos_max: f32,
    ground: vec3<f32>,
    ao_distance: f32,
    sample_idx: u32,
    n_samples: u32,
    light: u32,
    range: f32,
    position: vec3<f32>,
    radius: f32,
    inner_cos: f32,
    outer_cos: f32,
    reserved_a: u32,
    reserved_b: u32,
}

struct MaterialRecord {
    base_color: vec3<f32>,
    ignores_vertex_colors: u32,
    emissive: vec3<f32>,
    emissive_strength: f32,
    is_unlit: u32,
    reserved_a: u32,
    reserved_b: u32,
    reserved_c: u32,
}

// The nearest hit of a ray; `instance` is NONE for a miss.
struct HitRecord {
    normal: vec3<f32>,
    distance: f32,
    color: vec3<f32>,
    radius: f32,
    geometric_normal: vec3<f32>,
    reserved_c: f32,
    slot: u32,
    instance: u32,
    material: u32,
    surface: u32,
    // The points behind the hit, once they are asked for.
    support_count: u32,
    support_distance: f32,
    reserved_a: u32,
    reserved_b: u32,
}

// A ray toward a light, and the radiance that it adds to its pixel if nothing blocks it.
struct ShadowRay {
    ray: Ray,
    contribution: vec3<f32>,
    is_open: u32,
}

// The radiance of a pixel's current sample, and the sum over all samples.
struct Pixel {
    radiance: vec3<f32>,
    alpha: f32,
    sum: vec4<f32>,
}

const NONE: u32 = 0xffffffffu;
// The distance beyond which there is nothing, instead of infinity.
const NO_LIMIT: f32 = 3e38;
const EPSILON: f32 = 1.1920929e-7;

@group(0) @binding(0) var<uniform> frame: FrameRecord;
@group(1) @binding(0) var<storage, read_write> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> hits: array<HitRecord>;
@group(1) @binding(2) var<storage, read_write> shadow_rays: array<ShadowRay>;
@group(1) @binding(3) var<storage, read_write> pixels: array<Pixel>;
@group(1) @binding(4) var<storage, read> materials: array<MaterialRecord>;
// Numbers of primary, shadow and sky rays.
@group(1) @binding(5) var<storage, read_write> n_traced: array<atomic<u32>, 4>;
