// Splats: the discs close behind the nearest one, blended into a smooth surface (Wiesmeier 2011, 'multi').

// The weighted sums over the discs of a ray.
struct SplatSums {
    direction: vec3<f32>,
    // Normal of the nearest disc, flipped toward the ray's origin.
    nearest: vec3<f32>,
    // Centre of the nearest disc.
    center: vec3<f32>,
    // Distance along the ray to the nearest disc.
    distance: f32,
    normal: vec3<f32>,
    color: vec3<f32>,
    // Distances behind the nearest disc.
    depth: f32,
    total_weight: f32,
}

fn no_discs(nearest: Surfel, distance: f32, direction: vec3<f32>) -> SplatSums {
    let none = vec3<f32>(0.0);
    let normal = flip_to_hemisphere(nearest.normal, -direction);
    return SplatSums(direction, normal, nearest.center, distance, none, none, 0.0, 0.0);
}

// Returns true if a disc's normal is to be turned around.
fn is_opposed(sums: SplatSums, disc: Surfel) -> bool {
    let align = visits[visit_idx].align;
    let along = dot(disc.normal, sums.direction);
    if SURFACE == CYLINDER || align == ALIGN_EACH {
        return 0.0 < along;
    }
    let cosine = dot(disc.normal, sums.nearest);
    if MIN_ALIGNED_COSINE < abs(cosine) || align == ALIGN_NEAREST {
        return cosine < 0.0;
    }
    let chord = disc.center - sums.center;
    let squared = dot(chord, chord);
    let bent = cosine * squared - 2.0 * dot(sums.nearest, chord) * dot(disc.normal, chord);
    if MIN_BENT_COSINE * squared < abs(bent) {
        return bent < 0.0;
    }
    return 0.0 < along;
}

// Adds a disc, which the ray hits at `distance` and at `offset` from its centre.
fn with_disc(sums: SplatSums, disc: Surfel, distance: f32, offset: vec3<f32>) -> SplatSums {
    let weight = max(1.0 - sqrt(dot(offset, offset)) / disc.radius, MIN_DISC_WEIGHT);
    let surface = visits[visit_idx].surface;
    let turns = (surface == SPLAT || surface == CYLINDER) && is_opposed(sums, disc);
    return SplatSums(
        sums.direction,
        sums.nearest,
        sums.center,
        sums.distance,
        sums.normal + select(weight, -weight, turns) * disc.normal,
        sums.color + weight * disc.color,
        sums.depth + weight * (distance - sums.distance),
        sums.total_weight + weight,
    );
}

// Returns the distance along the ray: that of the nearest disc, or the mean of all.
fn splat_distance(sums: SplatSums) -> f32 {
    if SURFACE == CYLINDER {
        return sums.distance + sums.depth / sums.total_weight;
    }
    return sums.distance;
}

// Returns the unit normal, which faces the ray's origin. That of a fitted plane replaces it where there is one.
fn splat_normal(sums: SplatSums, direction: vec3<f32>) -> vec3<f32> {
    if SURFACE == SPLAT_FIT {
        return sums.nearest;
    }
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
