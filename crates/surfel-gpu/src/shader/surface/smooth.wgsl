// Smooth surfaces: at each position a sphere is fitted to the weighted points around it (algebraic point set surfaces,
// Guennebaud and Gross 2007). Weights also fall with the angle between normals, which keeps edges.

// A point near the position of a fit.
struct FitPoint {
    // The point relative to the position.
    offset: vec3<f32>,
    // Unit normal.
    normal: vec3<f32>,
    // Reciprocal of the square of the support's radius.
    inverse_support: f32,
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
    // Centre of the disc that was hit, relative to the hit.
    center: vec3<f32>,
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
    let inside = max(1.0 - dot(point.offset, point.offset) * point.inverse_support, 0.0);
    let squared = inside * inside;
    return squared * squared;
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

fn add_fit_point(sums: ptr<private, SphereSums>, point: FitPoint) {
    let squared = dot(point.offset, point.offset);
    let per_radius = (*sums).per_radius;
    if !is_within_reach(point, per_radius) || 1.0 <= squared * point.inverse_support {
        return;
    }
    let offset = point.offset * per_radius;
    let cosine = dot(point.normal, (*sums).guide);
    let height = dot(point.normal, offset) * (1.0 / FIT_MAX_PLANE_DISTANCE);
    let closeness = max(1.0 - height * height, 0.0);
    let weight = point_weight(point) * alignment(abs(cosine)) * closeness * closeness;
    let normal = point.normal * select(weight, -weight, cosine < 0.0);
    let weighted_offset = offset * weight;
    (*sums).weight += in_steps(weight);
    (*sums).offset += in_steps_vector(weighted_offset);
    (*sums).normal += in_steps_vector(normal);
    (*sums).offset_dot_normal += in_steps(dot(offset, normal));
    (*sums).offset_squared += in_steps(dot(offset, weighted_offset));
}

// Returns the weight of a normal by the cosine of its angle to the guide: about exp(-|a - b|^2 / (2/3)^2).
fn alignment(cosine: f32) -> f32 {
    let eighth = max(1.0 - (1.0 - cosine) * (NORMAL_FALLOFF / 8.0), 0.0);
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
    return SphereHit(1e-3 < length, step / sums.per_radius, normal / max(length, 1e-3));
}

fn no_overhang(normal: vec3<f32>, center: vec3<f32>, radius: f32) -> OverhangSums {
    return OverhangSums(normal, center, 1.0 / radius, 0.0, 0.0);
}

// Adds a point within reach. It counts if it is on the other side of an edge: its normal is far from that of the hit,
// and it lies below the hit's tangent plane.
fn add_overhang_point(sums: ptr<private, OverhangSums>, point: FitPoint) {
    let is_other_side = abs(dot(point.normal, (*sums).normal)) < MAX_EDGE_COSINE
        && dot((*sums).normal, point.offset) < 0.0;
    if !is_other_side {
        return;
    }
    let of_center = dot(point.normal, (*sums).center - point.offset);
    let below = dot(point.normal, point.offset);
    let height = select(below, -below, of_center < 0.0) * (*sums).per_radius;
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
