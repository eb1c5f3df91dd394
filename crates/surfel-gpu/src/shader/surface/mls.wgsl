// Moving least squares: at each position a plane is fitted to the weighted points around it, and over the plane a
// polynomial (Levin 2003; Adamson and Alexa 2003).

// The intersection of a ray with a fitted plane or polynomial.
struct FitHit {
    is_hit: bool,
    // Distance along the ray from the position of the fit.
    step: f32,
    // Unit normal, facing the ray's origin.
    normal: vec3<f32>,
    // Distance of a plane from the position.
    height: f32,
}

// Weighted sums over the points around a position.
struct PlaneSums {
    weight: f32,
    offset: vec3<f32>,
    covariance: Covariance,
}

// Sums of the least squares fit of a polynomial over a plane through a position.
struct PolynomialSums {
    normal: vec3<f32>,
    tangent: vec3<f32>,
    bitangent: vec3<f32>,
    // Weighted sums of the monomials of up to twice the polynomial's degree: 1, u, v, u^2, uv, v^2 and so on.
    moments: array<f32, 28>,
    right: array<f32, 10>,
}

// Coefficients of a polynomial of degree 3; those of higher degrees than the fit's are 0.
alias Polynomial = array<f32, 10>;

const N_COEFFICIENTS: u32 = (DEGREE + 1u) * (DEGREE + 2u) / 2u;
// A slope less than this fraction of a height has no intersection that counts.
const MIN_SLOPE: f32 = 1e-6;

fn no_plane_points() -> PlaneSums {
    return PlaneSums(0.0, vec3<f32>(0.0), Covariance(vec3<f32>(0.0), vec3<f32>(0.0)));
}

fn with_plane_point(sums: PlaneSums, offset: vec3<f32>, weight: f32) -> PlaneSums {
    let covariance = with_outer(sums.covariance, offset, weight);
    return PlaneSums(sums.weight + weight, sums.offset + weight * offset, covariance);
}

// Intersects the fitted plane with a ray through the position.
fn intersect_plane(sums: PlaneSums, direction: vec3<f32>) -> FitHit {
    let mean = sums.offset * (1.0 / max(sums.weight, 1e-30));
    let found = smallest_eigenvector(with_outer(sums.covariance, mean, -sums.weight));
    let normal = facing(found.vector, direction);
    let height = dot(normal, mean);
    let along = dot(normal, direction);
    let is_hit = found.is_plane && MLS_MIN_WEIGHT < sums.weight && MIN_SLOPE * abs(height) < abs(along);
    return FitHit(is_hit, height / select(1.0, along, is_hit), normal, height);
}

fn no_polynomial_points(normal: vec3<f32>) -> PolynomialSums {
    let basis = tangent_basis(normal);
    var sums: PolynomialSums;
    sums.normal = normal;
    sums.tangent = basis.tangent;
    sums.bitangent = basis.bitangent;
    return sums;
}

// Adds a point at `offset` from the position. There are no loops, which would keep the sums in memory.
fn add_polynomial_point(sums: ptr<function, PolynomialSums>, offset: vec3<f32>, weight: f32) {
    let u = dot((*sums).tangent, offset) * (1.0 / MLS_SUPPORT);
    let v = dot((*sums).bitangent, offset) * (1.0 / MLS_SUPPORT);
    let height = dot((*sums).normal, offset);
    let linear = weight * vec2<f32>(u, v);
    let square = vec3<f32>(linear.x * u, linear.x * v, linear.y * v);
    let cube = vec4<f32>(square.x * u, square.xyz * v);
    let fourth = vec4<f32>(cube.xyz * u, cube.z * v);
    let last_fourth = cube.w * v;
    (*sums).moments[0] += weight;
    (*sums).moments[1] += linear.x;
    (*sums).moments[2] += linear.y;
    (*sums).moments[3] += square.x;
    (*sums).moments[4] += square.y;
    (*sums).moments[5] += square.z;
    (*sums).moments[6] += cube.x;
    (*sums).moments[7] += cube.y;
    (*sums).moments[8] += cube.z;
    (*sums).moments[9] += cube.w;
    (*sums).moments[10] += fourth.x;
    (*sums).moments[11] += fourth.y;
    (*sums).moments[12] += fourth.z;
    (*sums).moments[13] += fourth.w;
    (*sums).moments[14] += last_fourth;
    (*sums).right[0] += weight * height;
    (*sums).right[1] += linear.x * height;
    (*sums).right[2] += linear.y * height;
    (*sums).right[3] += square.x * height;
    (*sums).right[4] += square.y * height;
    (*sums).right[5] += square.z * height;
    if DEGREE == 3u {
        add_cubic_point(sums, vec2<f32>(u, v), height, cube, vec3<f32>(fourth.x, fourth.y, fourth.z), vec2<f32>(fourth.w, last_fourth));
    }
}

// Adds what the fit of a polynomial of degree 3 needs beside that of one of degree 2.
fn add_cubic_point(
    sums: ptr<function, PolynomialSums>,
    uv: vec2<f32>,
    height: f32,
    cube: vec4<f32>,
    first_fourth: vec3<f32>,
    last_fourth: vec2<f32>,
) {
    (*sums).right[6] += cube.x * height;
    (*sums).right[7] += cube.y * height;
    (*sums).right[8] += cube.z * height;
    (*sums).right[9] += cube.w * height;
    let fifth = array<f32, 6>(
        first_fourth.x * uv.x,
        first_fourth.x * uv.y,
        first_fourth.y * uv.y,
        first_fourth.z * uv.y,
        last_fourth.x * uv.y,
        last_fourth.y * uv.y,
    );
    (*sums).moments[15] += fifth[0];
    (*sums).moments[16] += fifth[1];
    (*sums).moments[17] += fifth[2];
    (*sums).moments[18] += fifth[3];
    (*sums).moments[19] += fifth[4];
    (*sums).moments[20] += fifth[5];
    (*sums).moments[21] += fifth[0] * uv.x;
    (*sums).moments[22] += fifth[0] * uv.y;
    (*sums).moments[23] += fifth[1] * uv.y;
    (*sums).moments[24] += fifth[2] * uv.y;
    (*sums).moments[25] += fifth[3] * uv.y;
    (*sums).moments[26] += fifth[4] * uv.y;
    (*sums).moments[27] += fifth[5] * uv.y;
}

// Intersects the fitted polynomial with a ray through the position.
fn intersect_polynomial(sums: PolynomialSums, direction: vec3<f32>) -> FitHit {
    let missed = FitHit(false, 0.0, sums.normal, 0.0);
    if sums.moments[0] <= MLS_MIN_WEIGHT {
        return missed;
    }
    let c = solve(sums);
    let du = dot(sums.tangent, direction) * (1.0 / MLS_SUPPORT);
    let dv = dot(sums.bitangent, direction) * (1.0 / MLS_SUPPORT);
    // Along the ray the height above the polynomial is itself a polynomial of the distance.
    let start = -c[0];
    let slope = dot(sums.normal, direction) - (c[1] * du + c[2] * dv);
    let k2 = c[3] * du * du + c[4] * du * dv + c[5] * dv * dv;
    let k3 = c[6] * du * du * du + c[7] * du * du * dv + c[8] * du * dv * dv + c[9] * dv * dv * dv;
    var step = 0.0;
    for (var i = 0u; i <= MLS_STEPS; i++) {
        let value = start + (slope - (k2 + k3 * step) * step) * step;
        let rate = slope - (2.0 * k2 + 3.0 * k3 * step) * step;
        if abs(rate) <= MIN_SLOPE * abs(value) {
            return missed;
        }
        step -= value / rate;
    }
    let normal = polynomial_normal(sums, c, step * du, step * dv);
    return FitHit(true, step, facing(normal, direction), 0.0);
}

fn polynomial_normal(sums: PolynomialSums, c: Polynomial, u: f32, v: f32) -> vec3<f32> {
    var by_u = c[1] + 2.0 * c[3] * u + c[4] * v;
    var by_v = c[2] + c[4] * u + 2.0 * c[5] * v;
    by_u += 3.0 * c[6] * u * u + 2.0 * c[7] * u * v + c[8] * v * v;
    by_v += c[7] * u * u + 2.0 * c[8] * u * v + 3.0 * c[9] * v * v;
    let tilt = by_u * sums.tangent + by_v * sums.bitangent;
    return normalize(sums.normal - tilt * (1.0 / MLS_SUPPORT));
}

// Returns the degree of the monomial at an index, and of that the degree in v.
fn degrees(monomial_idx: u32) -> vec2<u32> {
    let degree = select(select(select(0u, 1u, 1u <= monomial_idx), 2u, 3u <= monomial_idx), 3u, 6u <= monomial_idx);
    return vec2<u32>(degree, monomial_idx - degree * (degree + 1u) / 2u);
}

// Returns an entry of the matrix of the fit, with the penalty of its coefficient.
fn matrix_entry(sums: PolynomialSums, row: u32, column: u32) -> f32 {
    let both = degrees(row) + degrees(column);
    let entry = sums.moments[both.x * (both.x + 1u) / 2u + both.y];
    let penalty = select(BEND_PENALTY, SLOPE_PENALTY, row < 3u);
    return entry + select(0.0, penalty * sums.moments[0], row == column);
}

// Solves the symmetric positive definite system of the fit (LDL^T).
fn solve(sums: PolynomialSums) -> Polynomial {
    var lower: array<array<f32, N_COEFFICIENTS>, N_COEFFICIENTS>;
    var solution: Polynomial;
    for (var i = 0u; i < N_COEFFICIENTS; i++) {
        solution[i] = sums.right[i];
        for (var j = 0u; j <= i; j++) {
            lower[i][j] = matrix_entry(sums, i, j);
        }
    }
    // The diagonal becomes that of D.
    for (var j = 0u; j < N_COEFFICIENTS; j++) {
        var scaled: array<f32, N_COEFFICIENTS>;
        for (var k = 0u; k < j; k++) {
            scaled[k] = lower[j][k] * lower[k][k];
            lower[j][j] -= lower[j][k] * scaled[k];
            solution[j] -= lower[j][k] * solution[k];
        }
        let per_pivot = 1.0 / lower[j][j];
        for (var i = j + 1u; i < N_COEFFICIENTS; i++) {
            for (var k = 0u; k < j; k++) {
                lower[i][j] -= lower[i][k] * scaled[k];
            }
            lower[i][j] *= per_pivot;
        }
    }
    for (var j = N_COEFFICIENTS; 0u < j; j--) {
        let row = j - 1u;
        solution[row] /= lower[row][row];
        for (var i = j; i < N_COEFFICIENTS; i++) {
            solution[row] -= lower[i][row] * solution[i];
        }
    }
    return solution;
}
