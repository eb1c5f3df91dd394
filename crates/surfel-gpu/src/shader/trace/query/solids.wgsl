// Points as solids: spheres and capsules.

fn surface_hit(ray: Ray) -> SurfaceHit {
    let nearest = closest_hit(ray);
    if nearest.slot == NONE {
        return missed_surface();
    }
    let surfel = slot_surfel(nearest.slot);
    let position = ray_at(ray, nearest.distance);
    var outward = position - surfel.center;
    if SHAPE == CAPSULE {
        outward = capsule_normal(position, surfel);
    }
    let squared = dot(outward, outward);
    outward = select(-ray.direction, outward * inverseSqrt(max(squared, 1e-37)), 1e-37 < squared);
    let along = dot(outward, ray.direction);
    let normal = select(-outward, outward, along < 0.0);
    return point_hit(nearest.distance, nearest.slot, surfel.radius, normal, surfel.color, 0.0 < along);
}
