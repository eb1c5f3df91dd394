// Whitted ray tracing: mirrors reflect and glass splits rays (Whitted 1980), one wavefront of rays a bounce.

// Fractions of light that a surface reflects, refracts and scatters toward the viewer.
struct Lobes {
    reflected: vec3<f32>,
    refracted: vec3<f32>,
    diffuse: vec3<f32>,
}

// A normal that a ray is reflected about; `cos_view` is 0 for that of a smooth surface.
struct Microfacet {
    normal: vec3<f32>,
    cos_view: f32,
}

// Adds the radiance that a surface emits at the end of a path's ray, queues the point for direct light, and the rays
// that continue the path.
@compute @workgroup_size(WORKGROUP_SIZE)
fn shade(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local_idx: u32) {
    var point: ShadingPointRecord;
    let is_added = id.x < atomicLoad(&counts[FIRST_TAKEN + PATHS]) && shade_path(paths[id.x], hits[id.x], &point);
    let slot = queue_slot(POINTS, local_idx, is_added);
    if slot < frame.capacity {
        points[slot] = point;
    }
}

// Shades the end of a path's ray. Returns true if it is a point that receives direct light.
fn shade_path(arriving: Path, hit: HitRecord, point: ptr<function, ShadingPointRecord>) -> bool {
    var path = arriving;
    if hit.gaussian_distance < NO_LIMIT {
        path = behind_gaussians(path, hit);
        if hit.gaussian_transmittance <= 0.0 {
            return false;
        }
    }
    if hit.instance == NONE {
        shade_miss(path);
        return false;
    }
    let shading = shading_at(path.ray, hit);
    let interface_media = interface_at(path, shading, hit);
    let coverage = shading.alpha * largest(path.weight);
    path.weight *= interface_media.transmittance;
    if shading.alpha < 1.0 {
        continue_through_alpha(path, shading);
        path.weight *= shading.alpha;
        if shading.alpha <= 0.0 {
            return false;
        }
    }
    if miss_behavior(path) == MISS_BACKGROUND {
        add_alpha(path.pixel, coverage);
    }
    if shading.is_unlit {
        add_radiance(path.pixel, path.weight * shading.base_color);
        return false;
    }
    add_radiance(path.pixel, path.weight * shading.emission);
    let lobes = lobes_of(shading, path.ray.direction, interface_media.eta);
    let is_rough = MIN_ROUGHNESS <= shading.roughness;
    let glossy = select(vec3<f32>(0.0), lobes.reflected, is_rough);
    if n_bounces(path) < frame.max_depth {
        add_branches(path, shading, interface_media, lobes.reflected, REFLECTED);
        add_branches(path, shading, interface_media, lobes.refracted, REFRACTED);
    }
    *point = shading_point(path, shading, interface_media.near, lobes.diffuse, glossy);
    return any(lobes.diffuse != vec3<f32>(0.0)) || any(glossy != vec3<f32>(0.0));
}

// Adds the light of the Gaussians before the end of a path's ray, and returns the path behind them.
fn behind_gaussians(path: Path, hit: HitRecord) -> Path {
    let attenuation = medium_transmittance(path, path.media, hit.gaussian_distance);
    add_radiance(path.pixel, path.weight * attenuation * hit.gaussian_radiance);
    if miss_behavior(path) == MISS_BACKGROUND {
        add_alpha(path.pixel, (1.0 - hit.gaussian_transmittance) * largest(path.weight));
    }
    var behind = path;
    behind.weight *= hit.gaussian_transmittance;
    return behind;
}

fn n_bounces(path: Path) -> u32 {
    return path.state & MAX_PATH_COUNT;
}

fn n_alpha_layers(path: Path) -> u32 {
    return path.state / PATH_ALPHA_LAYER & MAX_PATH_COUNT;
}

fn miss_behavior(path: Path) -> u32 {
    return path.state >> PATH_MISS;
}

// Returns the state of a path that finds another radiance if its ray leaves the scene.
fn with_miss_behavior(path: Path, behavior: u32) -> u32 {
    return extractBits(path.state, 0u, PATH_MISS) | behavior << PATH_MISS;
}

fn shading_point(
    path: Path,
    shading: Shading,
    media: vec4<u32>,
    diffuse: vec3<f32>,
    glossy: vec3<f32>,
) -> ShadingPointRecord {
    return ShadingPointRecord(
        shading.position,
        shading.spawn_offset,
        shading.normal,
        shading.spawn_t_min,
        shading.geometric_normal,
        shading.roughness,
        -path.ray.direction,
        path.pixel,
        path.weight * diffuse,
        path.index,
        path.weight * glossy,
        n_samples_of(path.weight),
        media,
        path.key,
        shading.light_steepness,
        0u,
    );
}

// Returns the number of light samples of a path with this weight: all branches of a camera ray share its samples in
// proportion to their weights.
fn n_samples_of(weight: vec3<f32>) -> u32 {
    let n_samples = f32(frame.n_light_samples) * largest(weight);
    return clamp(u32(ceil(n_samples)), 1u, frame.n_light_samples);
}

// Queues the branches of a path into a lobe that receives `fraction` of its weight: one into a mirror's lobe, one for
// each light sample into a rough lobe.
fn add_branches(path: Path, shading: Shading, interface_media: Interface, fraction: vec3<f32>, lobe: u32) {
    let weight = path.weight * fraction;
    if all(weight == vec3<f32>(0.0)) {
        return;
    }
    let is_rough = MIN_ROUGHNESS <= shading.roughness;
    let n_branches = select(1u, n_samples_of(weight), is_rough);
    var branch = path;
    branch.weight = weight / f32(n_branches);
    branch.key = hash(path.key ^ vec2<u32>(lobe, 0u));
    branch.state += PATH_BOUNCE;
    for (var i = 0u; i < n_branches; i++) {
        branch.index = path.index * n_branches + i;
        if lobe == REFLECTED {
            add_reflection(branch, shading, interface_media.near);
        } else {
            add_refraction(branch, shading, interface_media);
        }
    }
}

// Adds the radiance that a path finds where its ray leaves the scene.
fn shade_miss(path: Path) {
    let behavior = miss_behavior(path);
    let weight = path.weight * transmittance_to_end(path);
    if behavior == MISS_BACKGROUND {
        // Other backgrounds are composited with the finished picture.
        if frame.background == BACKGROUND_ENVIRONMENT {
            add_radiance(path.pixel, weight * background_radiance(path.ray.direction, false));
        }
        return;
    }
    if behavior == MISS_THROUGH_GLASS && frame.background == GRADIENT {
        add_radiance(path.pixel, weight * pixel_background(path.pixel));
        return;
    }
    let with_sun = behavior == MISS_SKY_WITH_SUN;
    add_radiance(path.pixel, weight * background_radiance(path.ray.direction, with_sun));
}

// Queues the part of a path that an alpha-blended surface lets pass.
fn continue_through_alpha(path: Path, shading: Shading) {
    if MAX_ALPHA_LAYERS <= n_alpha_layers(path) {
        return;
    }
    var next = from_surface(path, shading, spawn(shading, path.ray.direction), path.media);
    next.weight *= 1.0 - shading.alpha;
    next.key = hash(path.key ^ vec2<u32>(ALPHA_LAYER, 0u));
    next.state += PATH_ALPHA_LAYER;
    add_path(next);
}

fn add_reflection(branch: Path, shading: Shading, media: vec4<u32>) {
    let facet = sample_microfacet(branch, shading);
    var direction = reflection(branch.ray.direction, facet.normal);
    if dot(direction, shading.geometric_normal) <= 0.0 {
        // The reflection points into the surface: a rough one is lost, one about a shading normal is reflected at the
        // geometric surface.
        if facet.cos_view != 0.0 {
            return;
        }
        direction = reflection(direction, shading.geometric_normal);
    }
    var next = from_surface(branch, shading, spawn(shading, direction), media);
    if facet.cos_view != 0.0 {
        let cos_light = max(dot(shading.normal, direction), MIN_GGX_COS);
        next.weight *= smith_g2_over_g1(facet.cos_view, cos_light, shading.roughness)
            / directional_albedo(facet.cos_view, shading.roughness);
    }
    let behavior = select(MISS_SKY, MISS_SKY_WITH_SUN, facet.cos_view == 0.0);
    next.state = with_miss_behavior(branch, behavior);
    add_path(next);
}

fn add_refraction(branch: Path, shading: Shading, interface_media: Interface) {
    let incident = branch.ray.direction;
    let facet = sample_microfacet(branch, shading);
    var refracted = Refraction(false, incident);
    if shading.is_thin {
        // A thin slab transmits straight on, as blurred as its reflection.
        let mirrored = reflection(incident, facet.normal);
        refracted.direction = mirrored - 2.0 * dot(mirrored, shading.normal) * shading.normal;
    } else {
        refracted = refraction(incident, facet.normal, interface_media.eta);
        if refracted.is_total {
            // A microfacet can reflect totally where the surface as a whole does not.
            refracted = refraction(incident, shading.normal, interface_media.eta);
        }
    }
    if refracted.is_total {
        return;
    }
    let is_behind = dot(refracted.direction, shading.geometric_normal) < 0.0;
    let direction = select(incident, refracted.direction, is_behind);
    var next = from_surface(branch, shading, spawn(shading, direction), interface_media.far);
    if miss_behavior(branch) == MISS_BACKGROUND {
        next.state = with_miss_behavior(branch, MISS_THROUGH_GLASS);
    }
    add_path(next);
}

// Adds a path to the next wavefront, subject to Russian roulette.
fn add_path(added: Path) {
    var path = added;
    let survival = largest(path.weight) / MIN_WEIGHT;
    if survival < 1.0 {
        let random = owen_sobol_2d(path.index, hash(path.key ^ vec2<u32>(ROULETTE, 0u))).x;
        if survival <= random {
            return;
        }
        path.weight /= survival;
    }
    // The count of a full queue stays, as it would wrap around in the end.
    if frame.capacity < atomicLoad(&counts[FIRST_ADDED + PATHS]) {
        return;
    }
    let slot = atomicAdd(&counts[FIRST_ADDED + PATHS], 1u);
    if slot < frame.capacity {
        next_paths[slot] = path;
    }
}

fn lobes_of(shading: Shading, direction: vec3<f32>, eta: f32) -> Lobes {
    let cos = -dot(shading.normal, direction);
    let dielectric = interface_fresnel(shading, cos, eta);
    let entering = (1.0 - shading.metallic) * (1.0 - dielectric);
    return Lobes(
        (1.0 - shading.metallic) * vec3<f32>(dielectric) + shading.metallic * schlick_fresnel(cos, shading.base_color),
        entering * shading.transmission * shading.base_color,
        entering * (1.0 - shading.transmission) * shading.base_color,
    );
}

// Samples a visible microfacet normal of a rough surface, or returns the shading normal of a smooth one.
fn sample_microfacet(path: Path, shading: Shading) -> Microfacet {
    if shading.roughness < MIN_ROUGHNESS {
        return Microfacet(shading.normal, 0.0);
    }
    let basis = basis_around(shading.normal);
    let to_viewer = -path.ray.direction;
    let cos_view = max(dot(to_viewer, basis.normal), MIN_GGX_COS);
    let view = vec3<f32>(dot(to_viewer, basis.tangent), dot(to_viewer, basis.bitangent), cos_view);
    let uv = owen_sobol_2d(path.index, hash(path.key ^ vec2<u32>(LOBE_DIRECTION, 0u)));
    let local = sample_ggx_vndf(normalize(view), shading.roughness, uv);
    return Microfacet(basis_to_world(basis, local), cos_view);
}
