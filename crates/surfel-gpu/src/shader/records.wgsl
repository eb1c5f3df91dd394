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
    n_columns: u32,
    first_pixel: u32,
    n_rays: u32,
    sample_idx: u32,
    n_samples: u32,
    is_centered: u32,
    is_first: u32,
    capacity: u32,
    background_top: vec3<f32>,
    background: u32,
    background_bottom: vec3<f32>,
    height: u32,
    background_up: vec3<f32>,
    n_lights: u32,
    max_depth: u32,
    n_light_samples: u32,
    // The least size of an octree's cells along a ray.
    pixel_at_origin: f32,
    pixel_per_distance: f32,
    // The rows and columns that are rendered.
    first_row: u32,
    n_rows: u32,
    first_column: u32,
    reserved: u32,
    // Normals of planes, and their distances from the scene's origin along these.
    planes: array<vec4<f32>, MAX_PLANES>,
}

// An instance of a tree.
struct Visit {
    object_from_world: mat4x3<f32>,
    world_from_normal: mat3x3<f32>,
    world_from_object: mat3x3<f32>,
    instance: u32,
    align: u32,
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
    gathers_to_nearest: u32,
    has_outward_normals: u32,
    min_discs: u32,
    is_mirrored: u32,
    // Bounding box in world coordinates.
    lower: vec3<f32>,
    radius_factor: f32,
    upper: vec3<f32>,
    reserved_a: f32,
    root_node: u32,
    first_vector: u32,
    n_harmonics: u32,
    reserved_b: u32,
}

// The work of a pass: the sample of a light, the queue that it works on and the kind of its rays, or the instances of a
// tree.
struct Task {
    light: u32,
    sample_idx: u32,
    max_samples: u32,
    queue: u32,
    ray_kind: u32,
    first_visit: u32,
    n_visits: u32,
    // Index of the round of a search.
    round: u32,
}

struct LightRecord {
    direction: vec3<f32>,
    kind: u32,
    color: vec3<f32>,
    cos_max: f32,
    ground: vec3<f32>,
    ao_distance: f32,
    position: vec3<f32>,
    radius: f32,
    inner_cos: f32,
    outer_cos: f32,
    range: f32,
    lamp: u32,
    size: vec2<u32>,
    first_word: u32,
    strength: f32,
}

struct TextureRecord {
    first_word: u32,
    width: u32,
    height: u32,
    // Bits, as `TEXTURE_*` gives them.
    flags: u32,
    offset: vec2<f32>,
    scale: vec2<f32>,
    cos: f32,
    sin: f32,
    reserved_a: u32,
    reserved_b: u32,
}

struct MaterialRecord {
    base_color: vec3<f32>,
    ignores_vertex_colors: u32,
    emissive: vec3<f32>,
    emissive_strength: f32,
    attenuation_color: vec3<f32>,
    attenuation_distance: f32,
    is_unlit: u32,
    alpha: f32,
    alpha_mode: u32,
    alpha_cutoff: f32,
    metallic: f32,
    roughness: f32,
    ior: f32,
    transmission: f32,
    is_thin: u32,
    normal_scale: f32,
    reserved_a: u32,
    reserved_b: u32,
    textures: array<TextureRecord, N_TEXTURES>,
}

struct InstanceRecord {
    lower: vec3<f32>,
    material: u32,
    upper: vec3<f32>,
    max_scale: f32,
    has_outward_normals: u32,
    attributes: u32,
    first_support_color: u32,
    support_low: f32,
    support_high: f32,
    spawn_factor: f32,
    reserved_a: u32,
    reserved_b: u32,
}

// The nearest hit of a ray; `instance` is NONE for a miss.
struct HitRecord {
    normal: vec3<f32>,
    distance: f32,
    color: vec3<f32>,
    radius: f32,
    geometric_normal: vec3<f32>,
    alpha: f32,
    slot: u32,
    instance: u32,
    is_backface: u32,
    surface: u32,
    // The points behind the hit, once they are asked for.
    support_count: u32,
    support_distance: f32,
    // Barycentric coordinates of the second and third corners of a triangle.
    barycentrics: vec2<f32>,
    // Both sets of texture coordinates.
    uvs: vec4<f32>,
    // Tangent of a normal map, and the sign of its bitangent; 0 without one.
    tangent: vec4<f32>,
    // The light of the Gaussians before the hit; the distance is NO_LIMIT without any.
    gaussian_radiance: vec3<f32>,
    gaussian_transmittance: f32,
    gaussian_distance: f32,
    reserved_a: u32,
    reserved_b: u32,
    reserved_c: u32,
}

// A path's next ray, or a ray toward a light.
struct Path {
    ray: Ray,
    // Throughput from the ray's end to the camera, or the radiance that a light adds if nothing blocks the ray.
    weight: vec3<f32>,
    // Index of the pixel in its part of the picture.
    pixel: u32,
    // The light that has passed all surfaces so far, of a ray toward a light.
    transmittance: vec3<f32>,
    // Distance from the surface that the ray left to its origin, along the ray.
    origin_offset: f32,
    // Instances that the ray is inside of; the one entered last comes first.
    media: vec4<u32>,
    // Random key, and the index of the path among those with the same key.
    key: vec2<u32>,
    index: u32,
    // Depth, number of alpha-blended layers and `MISS_*`, eight bits each; of a ray toward a light 1 until it is done.
    state: u32,
}

// The state of a search along a ray: the disc near which a round tests whether the ray hits the surface.
struct SearchState {
    // NONE without a disc.
    slot: u32,
    distance: f32,
    // The first disc that the ray passed, from its front where front sides are known; NONE without one.
    passed_slot: u32,
    passed_distance: f32,
    // Queues of undecided rays, one for even and one for odd rounds: the indices of other rays.
    undecided: vec2<u32>,
    reserved_a: u32,
    reserved_b: u32,
}

// A point at which direct light is computed.
struct ShadingPointRecord {
    position: vec3<f32>,
    spawn_offset: f32,
    normal: vec3<f32>,
    spawn_t_min: f32,
    geometric_normal: vec3<f32>,
    roughness: f32,
    to_viewer: vec3<f32>,
    pixel: u32,
    // Reflectances times the throughput of the path to the camera.
    diffuse: vec3<f32>,
    index: u32,
    glossy: vec3<f32>,
    n_light_samples: u32,
    media: vec4<u32>,
    key: vec2<u32>,
    light_steepness: f32,
    reserved: u32,
}

struct Tables {
    // Linear values of 8-bit sRGB values.
    srgb: array<vec4<f32>, 64>,
    // Directional albedo of rough mirrors, by roughness and cosine.
    albedo: array<vec4<f32>, N_ALBEDO_VECTORS>,
}


// The upper word of a sum of a pixel from which on the sum stays as it is.
const FULL_SUM: u32 = 0x80000000u;

@group(0) @binding(0) var<uniform> frame: FrameRecord;
@group(0) @binding(1) var<uniform> task: Task;
@group(0) @binding(2) var<uniform> tables: Tables;
@group(1) @binding(0) var<storage, read_write> paths: array<Path>;
@group(1) @binding(1) var<storage, read_write> hits: array<HitRecord>;
@group(1) @binding(2) var<storage, read_write> next_paths: array<Path>;
@group(1) @binding(3) var<storage, read_write> points: array<ShadingPointRecord>;
// Sums of radiance and alpha over all samples of each pixel, in fixed point: the lower words come first.
@group(1) @binding(4) var<storage, read_write> pixels: array<array<atomic<u32>, 8>>;
// Lengths of queues and numbers of rays, at the indices `FIRST_*`, `N_ACTIVE` and `MAX_ADDED`.
@group(1) @binding(5) var<storage, read_write> counts: array<atomic<u32>, N_COUNTS>;
@group(1) @binding(6) var<storage, read_write> search_states: array<SearchState>;
