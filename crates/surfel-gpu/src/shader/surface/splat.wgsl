// Splats: the discs close behind the nearest one, blended into a smooth surface (Wiesmeier 2011, 'multi').

// The weighted sums over the discs of a ray.
struct SplatSums {
    direction: vec3<f32>,
    // Normal of the nearest disc, flipped toward the ray's origin.
    nearest: vec3<f32>,
    // Centre of the nearest disc.
    center: vec3<f32>,
    normal: vec3<f32>,
    color: vec3<f32>,
    total_weight: f32,
}

fn no_discs(nearest: Surfel, direction: vec3<f32>) -> SplatSums {
    let none = vec3<f32>(0.0);
    let normal = flip_to_hemisphere(nearest.normal, -direction);
    return SplatSums(direction, normal, nearest.center, none, none, 0.0);
}

// Returns true if a disc's normal is to be turned around.
fn is_opposed(sums: SplatSums, disc: Surfel) -> bool {
    let cosine = dot(disc.normal, sums.nearest);
    if MIN_ALIGNED_COSINE < abs(cosine) {
        return cosine < 0.0;
    }
    let chord = disc.center - sums.center;
    let squared = dot(chord, chord);
    let bent = cosine * squared - 2.0 * dot(sums.nearest, chord) * dot(disc.normal, chord);
    if MIN_BENT_COSINE * squared < abs(bent) {
        return bent < 0.0;
    }
    return 0.0 < dot(disc.normal, sums.direction);
}

// Adds a disc, which the ray hits at `offset` from its centre.
fn with_disc(sums: SplatSums, disc: Surfel, offset: vec3<f32>) -> SplatSums {
    let weight = max(1.0 - sqrt(dot(offset, offset)) / disc.radius, 1e-4);
    let turns = visits[visit_idx].surface == SPLAT && is_opposed(sums, disc);
    return SplatSums(
        sums.direction,
        sums.nearest,
        sums.center,
        sums.normal + select(weight, -weight, turns) * disc.normal,
        sums.color + weight * disc.color,
        sums.total_weight + weight,
    );
}

// Returns the unit normal, which faces the ray's origin.
fn splat_normal(sums: SplatSums, direction: vec3<f32>) -> vec3<f32> {
    // Opposite normals may cancel in splat-mean; the normal of the nearest disc is then as good as any.
    let normal = normalize_or(sums.normal, sums.nearest);
    if visits[visit_idx].surface == SPLAT {
        return clamp_to_visible(normal, direction);
    }
    return flip_to_hemisphere(normal, -direction);
}

// Returns `normal` or its negative, whichever lies in the hemisphere of `guide`.
fn flip_to_hemisphere(normal: vec3<f32>, guide: vec3<f32>) -> vec3<f32> {
    return select(normal, -normal, dot(normal, guide) < 0.0);
}

// Returns `vector` at unit length, or `fallback` if its length is close to zero.
fn normalize_or(vector: vec3<f32>, fallback: vec3<f32>) -> vec3<f32> {
    let squared = dot(vector, vector);
    return select(fallback, vector / sqrt(max(squared, 1e-30)), 1e-30 < squared);
}

// Returns the nearest normal that does not face away from the ray.
fn clamp_to_visible(normal: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    let along = dot(normal, direction);
    if along <= 0.0 {
        return normal;
    }
    return normalize_or(normal - along * direction, -direction);
}
