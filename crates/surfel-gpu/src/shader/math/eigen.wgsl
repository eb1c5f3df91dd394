// Eigenvectors of symmetric 3x3 matrices.

// A symmetric positive semidefinite matrix: a sum of outer products.
struct Covariance {
    // Entries xx, yy and zz.
    diagonal: vec3<f32>,
    // Entries xy, xz and yz.
    mixed: vec3<f32>,
}

// A unit eigenvector of the smallest eigenvalue, of either sign.
struct SmallestEigenvector {
    vector: vec3<f32>,
    // False if the vectors of the matrix span no plane.
    is_plane: bool,
}

// Returns the matrix plus weight * v * v^T.
fn with_outer(matrix: Covariance, v: vec3<f32>, weight: f32) -> Covariance {
    let weighted = weight * v;
    return Covariance(matrix.diagonal + weighted * v, matrix.mixed + weighted.xxy * v.yzz);
}

fn smallest_eigenvector(matrix: Covariance) -> SmallestEigenvector {
    let none = SmallestEigenvector(vec3<f32>(0.0, 0.0, 1.0), false);
    let trace = matrix.diagonal.x + matrix.diagonal.y + matrix.diagonal.z;
    if trace <= 1e-37 {
        return none;
    }
    let per_trace = 1.0 / trace;
    let d = matrix.diagonal * per_trace;
    let m = matrix.mixed * per_trace;
    let minor = d.yxx * d.zzy - m.zyx * m.zyx;
    let minors = minor.x + minor.y + minor.z;
    if minors <= MIN_SPREAD {
        return none;
    }
    let determinant = d.x * minor.x - m.x * (m.x * d.z - m.z * m.y) + m.y * (m.x * m.z - d.y * m.y);
    let value = smallest_root(minors, determinant);
    let first = vec3<f32>(d.x - value, m.x, m.y);
    let second = vec3<f32>(m.x, d.y - value, m.z);
    let third = vec3<f32>(m.y, m.z, d.z - value);
    // All rows are perpendicular to the vector. The longest cross product has the most digits.
    var best = cross(first, second);
    best = longer(best, cross(first, third));
    best = longer(best, cross(second, third));
    let squared = dot(best, best);
    if squared <= MIN_CROSS {
        return none;
    }
    return SmallestEigenvector(best * (1.0 / sqrt(squared)), true);
}

// Rounds a unit vector a little: a component that is zero but for rounding becomes a positive zero.
fn rounded_normal(normal: vec3<f32>) -> vec3<f32> {
    var rounded = round(normal * NORMAL_STEPS);
    // Compilers drop sums and conversions that turn negative zeros into positive ones.
    rounded = select(rounded, abs(rounded), abs(rounded) < vec3<f32>(0.5));
    return rounded * (1.0 / sqrt(dot(rounded, rounded)));
}

fn longer(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return select(a, b, dot(a, a) < dot(b, b));
}

// Returns the smallest root of x^3 - x^2 + minors x - determinant, all of whose roots are between 0 and 1: left of it the
// cubic is concave, so that Newton's method approaches it from zero and never passes it.
fn smallest_root(minors: f32, determinant: f32) -> f32 {
    var root = 0.0;
    for (var i = 0u; i < N_EIGEN_STEPS; i++) {
        let value = ((root - 1.0) * root + minors) * root - determinant;
        let slope = (3.0 * root - 2.0) * root + minors;
        if slope <= 1e-12 {
            return root;
        }
        root -= value / slope;
    }
    return root;
}
