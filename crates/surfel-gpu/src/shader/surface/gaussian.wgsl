// Trained Gaussians: where a ray is densest, alpha and spherical harmonics (Moenne-Loccoz et al. 2024).

struct Densest {
    // Distances along the ray at which the Gaussians are densest.
    distances: vec4<f32>,
    // Squares of the distances from their centres there, in deviations.
    squares: vec4<f32>,
}

// Returns where a ray of this unit direction is densest in each of four Gaussians.
fn intersect_gaussians(four: FourGaussians, direction: vec3<f32>) -> Densest {
    let c = four.center;
    // The position of the ray nearest to the centre comes first: from far away, that of the ray's origin would drown the
    // distance from the centre in rounding.
    let nearest = c[0] * direction.x + c[1] * direction.y + c[2] * direction.z;
    let x = direction.x * nearest - c[0];
    let y = direction.y * nearest - c[1];
    let z = direction.z * nearest - c[2];
    let r = four.rows;
    let offset = array<vec4<f32>, 3>(
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
    );
    let along = array<vec4<f32>, 3>(
        r[0] * direction.x + r[1] * direction.y + r[2] * direction.z,
        r[3] * direction.x + r[4] * direction.y + r[5] * direction.z,
        r[6] * direction.x + r[7] * direction.y + r[8] * direction.z,
    );
    let squared_length = along[0] * along[0] + along[1] * along[1] + along[2] * along[2];
    // Unused lanes have no length.
    let per_length = 1.0 / select(vec4<f32>(1.0), squared_length, vec4<f32>(0.0) < squared_length);
    let across_x = offset[1] * along[2] - offset[2] * along[1];
    let across_y = offset[2] * along[0] - offset[0] * along[2];
    let across_z = offset[0] * along[1] - offset[1] * along[0];
    let dots = offset[0] * along[0] + offset[1] * along[1] + offset[2] * along[2];
    let squares = across_x * across_x + across_y * across_y + across_z * across_z;
    return Densest(nearest - dots * per_length, squares * per_length);
}

// Returns the alpha of a Gaussian that a ray passes at this squared distance from its centre, in deviations.
fn gaussian_alpha(max_squared: f32, squared: f32) -> f32 {
    return min(MIN_ALPHA * exp(0.5 * (max_squared - squared)), MAX_ALPHA);
}

// Returns the real spherical harmonics of degrees 0 to 3 in a unit direction.
fn spherical_harmonics(direction: vec3<f32>) -> array<f32, 16> {
    let x = direction.x;
    let y = direction.y;
    let z = direction.z;
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    return array<f32, 16>(
        HARMONIC_0,
        -HARMONIC_1 * y,
        HARMONIC_1 * z,
        -HARMONIC_1 * x,
        HARMONIC_2_A * x * y,
        -HARMONIC_2_A * y * z,
        HARMONIC_2_B * (2.0 * zz - xx - yy),
        -HARMONIC_2_A * x * z,
        HARMONIC_2_C * (xx - yy),
        -HARMONIC_3_A * y * (3.0 * xx - yy),
        HARMONIC_3_B * x * y * z,
        -HARMONIC_3_C * y * (4.0 * zz - xx - yy),
        HARMONIC_3_D * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -HARMONIC_3_C * x * (4.0 * zz - xx - yy),
        HARMONIC_3_E * z * (xx - yy),
        -HARMONIC_3_A * x * (xx - 3.0 * yy),
    );
}
