// Shading parameters at a hit: the material with its textures and the geometry's colours applied.

struct Shading {
    position: vec3<f32>,
    // Shading normal: unit, facing the viewer.
    normal: vec3<f32>,
    // Geometric normal, along which new rays are offset.
    geometric_normal: vec3<f32>,
    base_color: vec3<f32>,
    alpha: f32,
    metallic: f32,
    roughness: f32,
    ior: f32,
    transmission: f32,
    is_thin: bool,
    emission: vec3<f32>,
    is_unlit: bool,
    // Distance by which new rays are offset, where they begin, and the reciprocal of the cosine to the normal from which on
    // those toward lights begin at once.
    spawn_offset: f32,
    spawn_t_min: f32,
    light_steepness: f32,
}

fn shading_at(ray: Ray, hit: HitRecord) -> Shading {
    let material_idx = instances[hit.instance].material;
    let material = materials[material_idx];
    let color = select(hit_color(hit), vec3<f32>(1.0), material.ignores_vertex_colors == 1u);
    var shading = Shading(
        ray_at(ray, hit.distance),
        hit.normal,
        hit.geometric_normal,
        material.base_color * color,
        material.alpha * hit.alpha,
        material.metallic,
        material.roughness,
        material.ior,
        material.transmission,
        // A leaf has no inside.
        material.is_thin == 1u || hit.surface == LEAVES,
        material.emissive,
        material.is_unlit == 1u,
        0.0,
        0.0,
        0.0,
    );
    apply_textures(&shading, material_idx, hit);
    shading.emission += material.emissive_strength * shading.base_color;
    if material.alpha_mode == ALPHA_MASK {
        shading.alpha = select(0.0, 1.0, material.alpha_cutoff <= shading.alpha);
    } else if material.alpha_mode == ALPHA_BLEND {
        shading.alpha = clamp(shading.alpha, 0.0, 1.0);
    } else {
        shading.alpha = 1.0;
    }
    shading.normal = faceforward(shading.normal, hit.geometric_normal, ray.direction);
    set_spawn(&shading, ray, hit);
    return shading;
}

// Returns the colour of the geometry, or that of the hit's support.
fn hit_color(hit: HitRecord) -> vec3<f32> {
    let first = instances[hit.instance].first_support_color;
    if first == NONE {
        return hit.color;
    }
    let low = instances[hit.instance].support_low;
    let range = instances[hit.instance].support_high - low;
    let above = hit.support_distance - low;
    var position = 0.5;
    if range != 0.0 {
        position = clamp(above / range, 0.0, 1.0);
    } else if above != 0.0 {
        position = select(0.0, 1.0, 0.0 < above);
    }
    let color = words[first + u32(round(position * f32(N_SUPPORT_COLORS - 1u)))];
    return vec3<f32>(decode(color & 0xffu), decode((color >> 8u) & 0xffu), decode((color >> 16u) & 0xffu));
}

fn apply_textures(shading: ptr<function, Shading>, material_idx: u32, hit: HitRecord) {
    if is_textured(material_idx, BASE_COLOR_TEXTURE, hit) {
        let texel = sample_texture(materials[material_idx].textures[BASE_COLOR_TEXTURE], hit.uvs, true);
        (*shading).base_color *= texel.xyz;
        (*shading).alpha *= texel.w;
    }
    if is_textured(material_idx, ROUGHNESS_TEXTURE, hit) {
        let texel = sample_texture(materials[material_idx].textures[ROUGHNESS_TEXTURE], hit.uvs, false);
        (*shading).roughness *= texel.y;
        (*shading).metallic *= texel.z;
    }
    if is_textured(material_idx, EMISSIVE_TEXTURE, hit) {
        let texel = sample_texture(materials[material_idx].textures[EMISSIVE_TEXTURE], hit.uvs, true);
        (*shading).emission *= texel.xyz;
    }
    if is_textured(material_idx, TRANSMISSION_TEXTURE, hit) {
        let texel = sample_texture(materials[material_idx].textures[TRANSMISSION_TEXTURE], hit.uvs, false);
        (*shading).transmission *= texel.x;
    }
    if is_textured(material_idx, NORMAL_TEXTURE, hit) {
        let texel = sample_texture(materials[material_idx].textures[NORMAL_TEXTURE], hit.uvs, false);
        let scale = materials[material_idx].normal_scale;
        (*shading).normal = normal_mapped(hit, (2.0 * texel.xyz - 1.0) * vec3<f32>(scale, scale, 1.0));
    }
}

// Returns the normal of a hit with the tangent-space normal `local` of a normal map applied.
fn normal_mapped(hit: HitRecord, local: vec3<f32>) -> vec3<f32> {
    let has_tangent = any(hit.tangent.xyz != vec3<f32>(0.0));
    let tangent = select(basis_around(hit.normal).tangent, hit.tangent.xyz, has_tangent);
    let bitangent = hit.tangent.w * cross(hit.normal, tangent);
    let mapped = local.x * tangent + local.y * bitangent + local.z * hit.normal;
    let squared = dot(mapped, mapped);
    return select(hit.normal, mapped / sqrt(max(squared, 1e-30)), 1e-30 < squared);
}

// Returns true if a material has a texture, and the hit the coordinates for it.
fn is_textured(material_idx: u32, texture: u32, hit: HitRecord) -> bool {
    let flags = materials[material_idx].textures[texture].flags;
    let needed = select(HAS_FIRST_UVS, HAS_SECOND_UVS, (flags & TEXTURE_SECOND_UV_SET) != 0u);
    return (flags & TEXTURE_IS_PRESENT) != 0u && (instances[hit.instance].attributes & needed) != 0u;
}

fn largest(vector: vec3<f32>) -> f32 {
    return max(max(vector.x, vector.y), vector.z);
}

// Returns a shading normal that faces away from the viewer tilted until it just faces the viewer.
fn faceforward(normal: vec3<f32>, geometric_normal: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    let away = dot(normal, direction);
    if away <= -MIN_FACING_COS {
        return normal;
    }
    let tilted = normal - (away + MIN_FACING_COS) * direction;
    let squared = dot(tilted, tilted);
    return select(geometric_normal, tilted / sqrt(max(squared, 1e-30)), 1e-30 < squared);
}

fn is_solid_dielectric(shading: Shading) -> bool {
    return 0.0 < shading.transmission && !shading.is_thin;
}

fn set_spawn(shading: ptr<function, Shading>, ray: Ray, hit: HitRecord) {
    let position = (*shading).position;
    // The position is wrong by a few roundings of the coordinates that it was computed from.
    let magnitude = max(largest(abs(position)), largest(abs(ray.origin)));
    if hit.surface == TRIANGLE {
        (*shading).spawn_offset = 32.0 * EPSILON * magnitude;
        return;
    }
    var rounding = 4.0 * EPSILON * largest(abs(position));
    let is_solid = hit.surface == SPHERE || hit.surface == CAPSULE || hit.surface == LEAVES;
    if is_solid {
        rounding = SOLID_ROUNDING * magnitude;
    }
    var offset = SOLID_SPAWN_OFFSET;
    var t_min = 0.0;
    var radius = hit.radius;
    if !is_solid {
        radius *= instances[hit.instance].spawn_factor;
    }
    if hit.surface == SMOOTH || hit.surface == IMPLICIT {
        offset = SMOOTH_SPAWN_OFFSET;
        t_min = SMOOTH_SPAWN_T_MIN;
        (*shading).light_steepness = SMOOTH_LIGHT_STEEPNESS;
    } else if hit.surface == MLS {
        offset = MLS_SPAWN_OFFSET;
        t_min = MLS_SPAWN_T_MIN;
    } else if !is_solid {
        offset = DISC_SPAWN_OFFSET;
        t_min = DISC_SPAWN_T_MIN;
    }
    (*shading).spawn_offset = offset * radius + rounding;
    (*shading).spawn_t_min = t_min * radius;
}

// Returns a ray in `direction`, offset to that side so that it does not hit the surface again.
fn spawn(shading: Shading, direction: vec3<f32>) -> Ray {
    let normal = shading.geometric_normal;
    let side = select(-normal, normal, 0.0 <= dot(normal, direction));
    let origin = shading.position + shading.spawn_offset * side;
    return Ray(origin, shading.spawn_t_min, direction, NO_LIMIT);
}
