// Smooth surfaces: at each position a sphere is fitted to the weighted points around it (algebraic point set surfaces,
// Guennebaud and Gross 2007). Weights also fall with the angle between normals, which keeps edges.

// A point near the position of a fit.
struct FitPoint {
    // The point relative to the position.
    offset: vec3<f32>,
    // Unit normal.
    normal: vec3<f32>,
    // Reciprocal of the square of the support's radius.
    inverse_support_squared: f32,
}

// Weighted sums over the points around a position.
struct SphereSums {
    // Unit normal to which the points' normals are compared.
    guide: vec3<f32>,
    // Reciprocal of the radius of the disc that was hit: offsets are in radii.
    per_radius: f32,
    weight: f32,
    offset: vec3<f32>,
    normal: vec3<f32>,
    offset_dot_normal: f32,
    offset_squared: f32,
}

// The intersection of a ray with a fitted sphere.
struct SphereHit {
    is_hit: bool,
    // Distance along the ray from the position of the fit.
    step: f32,
    // Unit normal on the side of the guide.
    normal: vec3<f32>,
}

// Sums that tell whether a hit lies on the part of a surface that sticks out beyond a convex edge.
struct OverhangSums {
    normal: vec3<f32>,
    // Mean of the points on the side of the edge that was hit, relative to the hit.
    inside: vec3<f32>,
    per_radius: f32,
    weight: f32,
    height: f32,
}

// The sums of the colour at a position.
struct ColorSums {
    weight: f32,
    color: vec3<f32>,
}

fn fit_point(point: Point) -> FitPoint {
    let support = SUPPORT_FACTOR * point.radius;
    let squared = max(dot(point.normal, point.normal), 1.0);
    return FitPoint(point.center, point.normal / sqrt(squared), 1.0 / (support * support));
}

// Returns the weight of a point, which falls from 1 at the position to 0 at the support's radius.
fn point_weight(point: FitPoint) -> f32 {
    return support_weight(dot(point.offset, point.offset), point.inverse_support_squared);
}

fn is_within_reach(point: FitPoint, per_radius: f32) -> bool {
    let squared = dot(point.offset, point.offset);
    return squared * per_radius * per_radius < FIT_REACH * FIT_REACH;
}

// Rounds to a multiple of 1 / FIT_STEPS, scaled by FIT_STEPS, so that sums hardly depend on the order of points.
fn in_steps(value: f32) -> f32 {
    return round(value * FIT_STEPS);
}

fn in_steps_vector(vector: vec3<f32>) -> vec3<f32> {
    return round(vector * FIT_STEPS);
}

fn no_fit_points(guide: vec3<f32>, radius: f32) -> SphereSums {
    let none = vec3<f32>(0.0);
    return SphereSums(guide, 1.0 / radius, 0.0, none, none, 0.0, 0.0);
}

// Adds four points at a time, without branches but for blocks that are out of reach.
fn add_fit_points(sums: ptr<function, SphereSums>, four: FourPoints) {
    let per_radius = (*sums).per_radius;
    let squared = four.x * four.x + four.y * four.y + four.z * four.z;
    let support = SUPPORT_FACTOR * max(four.radius, vec4<f32>(1e-18));
    let in_support = squared * (1.0 / (support * support));
    let is_near = squared * per_radius * per_radius < vec4<f32>(FIT_REACH * FIT_REACH);
    let is_used = is_near & (in_support < vec4<f32>(1.0)) & (vec4<f32>(0.0) < four.radius);
    if !any(is_used) {
        return;
    }
    let length_squared =
        four.normal_x * four.normal_x + four.normal_y * four.normal_y + four.normal_z * four.normal_z;
    let per_length = 1.0 / sqrt(max(length_squared, vec4<f32>(1.0)));
    let normal_x = four.normal_x * per_length;
    let normal_y = four.normal_y * per_length;
    let normal_z = four.normal_z * per_length;
    let x = four.x * per_radius;
    let y = four.y * per_radius;
    let z = four.z * per_radius;
    let cosine = dot_four(normal_x, normal_y, normal_z, (*sums).guide);
    let height = (normal_x * x + normal_y * y + normal_z * z) * (1.0 / FIT_MAX_PLANE_DISTANCE);
    let closeness = max(1.0 - height * height, vec4<f32>(0.0));
    let inside = max(1.0 - in_support, vec4<f32>(0.0));
    let inside_squared = inside * inside;
    let full = inside_squared * inside_squared * alignment(abs(cosine)) * closeness * closeness;
    let weight = select(vec4<f32>(0.0), full, is_used);
    let signed_weight = select(weight, -weight, cosine < vec4<f32>(0.0));
    let weighted_x = x * weight;
    let weighted_y = y * weight;
    let weighted_z = z * weight;
    let turned_x = normal_x * signed_weight;
    let turned_y = normal_y * signed_weight;
    let turned_z = normal_z * signed_weight;
    (*sums).weight += sum_in_steps(weight);
    (*sums).offset += vec3<f32>(sum_in_steps(weighted_x), sum_in_steps(weighted_y), sum_in_steps(weighted_z));
    (*sums).normal += vec3<f32>(sum_in_steps(turned_x), sum_in_steps(turned_y), sum_in_steps(turned_z));
    (*sums).offset_dot_normal += sum_in_steps(x * turned_x + y * turned_y + z * turned_z);
    (*sums).offset_squared += sum_in_steps(x * weighted_x + y * weighted_y + z * weighted_z);
}

fn sum_in_steps(values: vec4<f32>) -> f32 {
    let steps = round(values * FIT_STEPS);
    return (steps.x + steps.y) + (steps.z + steps.w);
}

// Returns the weights of normals by the cosines of their angles to the guide: about exp(-|a - b|^2 / (2/3)^2).
fn alignment(cosine: vec4<f32>) -> vec4<f32> {
    let eighth = max(1.0 - (1.0 - cosine) * (NORMAL_FALLOFF / 8.0), vec4<f32>(0.0));
    let squared = eighth * eighth;
    let fourth = squared * squared;
    return fourth * fourth;
}

// Fits a sphere to the points and intersects it with a ray through the position along a unit vector.
fn intersect_fit(sums: SphereSums, direction: vec3<f32>) -> SphereHit {
    if sums.weight < FIT_MIN_WEIGHT * FIT_STEPS {
        return SphereHit(false, 0.0, sums.guide);
    }
    let per_weight = 1.0 / sums.weight;
    let spread = sums.offset_squared - dot(sums.offset, sums.offset) * per_weight;
    let bend = sums.offset_dot_normal - dot(sums.offset, sums.normal) * per_weight;
    let certainty = clamp((spread * per_weight - FLAT_SPREAD) / (CURVED_SPREAD - FLAT_SPREAD), 0.0, 1.0);
    var curvature = 0.0;
    if 0.0 < certainty {
        curvature = certainty * clamp(0.5 * bend / spread, -MAX_CURVATURE, MAX_CURVATURE);
    }
    let twice = curvature + curvature;
    let gradient = (sums.normal - sums.offset * twice) * per_weight;
    let value = -(dot(gradient, sums.offset) + curvature * sums.offset_squared) * per_weight;
    // The root of value + slope t + curvature t^2 that is nearest to zero, in a form without cancellation.
    let slope = dot(gradient, direction);
    let discriminant = slope * slope - 4.0 * curvature * value;
    let root = sqrt(max(discriminant, 0.0));
    let denominator = slope + select(root, -root, slope < 0.0);
    // A step beyond the limit is no hit: products are compared, as the denominator may be zero.
    if discriminant < 0.0 || MAX_STEP * abs(denominator) < abs(value + value) || denominator == 0.0 {
        return SphereHit(false, 0.0, sums.guide);
    }
    let step = -(value + value) / denominator;
    let normal = gradient + direction * (twice * step);
    let length = sqrt(dot(normal, normal));
    return SphereHit(MIN_GRADIENT < length, step / sums.per_radius, normal / max(length, MIN_GRADIENT));
}

// Returns the weighted mean of the points relative to the position.
fn mean_offset(sums: SphereSums) -> vec3<f32> {
    return sums.offset * (1.0 / (max(sums.weight, 1.0) * sums.per_radius));
}

fn no_overhang(normal: vec3<f32>, inside: vec3<f32>, radius: f32) -> OverhangSums {
    return OverhangSums(normal, inside, 1.0 / radius, 0.0, 0.0);
}

// Adds a point within reach. It counts if it is on the other side of an edge: its normal is far from that of the hit,
// and it lies below the hit's tangent plane.
fn add_overhang_point(sums: ptr<function, OverhangSums>, point: FitPoint) {
    let is_other_side = abs(dot(point.normal, (*sums).normal)) < MAX_EDGE_COSINE
        && dot((*sums).normal, point.offset) < 0.0;
    if !is_other_side {
        return;
    }
    let of_inside = dot(point.normal, (*sums).inside - point.offset);
    let below = dot(point.normal, point.offset);
    let height = select(below, -below, of_inside < 0.0) * (*sums).per_radius;
    let weight = point_weight(point);
    (*sums).weight += in_steps(weight);
    (*sums).height += in_steps(weight * height);
}

fn sticks_out(sums: OverhangSums) -> bool {
    return MIN_EDGE_WEIGHT * FIT_STEPS < sums.weight && MAX_OVERHANG * sums.weight < sums.height;
}

fn with_color(sums: ColorSums, point: FitPoint, color: vec3<f32>) -> ColorSums {
    let weight = point_weight(point);
    let cubed = weight * weight * weight;
    return ColorSums(sums.weight + in_steps(cubed), sums.color + in_steps_vector(cubed * color));
}

// Returns the mean colour, which is that of the nearest point where the points have hardly any weight.
fn mean_color(sums: ColorSums, nearest: vec3<f32>) -> vec3<f32> {
    let weight = NEAREST_COLOR_WEIGHT * FIT_STEPS;
    return (sums.color + nearest * weight) / (sums.weight + weight);
}
