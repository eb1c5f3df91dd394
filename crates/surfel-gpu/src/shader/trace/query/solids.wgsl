// Points as solids: spheres, capsules and clusters of leaves.

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
    } else if SHAPE == LEAVES {
        outward = leaf_normal(position, surfel);
    }
    let squared = dot(outward, outward);
    outward = select(-ray.direction, outward * inverseSqrt(max(squared, 1e-37)), 1e-37 < squared);
    let along = dot(outward, ray.direction);
    let normal = select(-outward, outward, along < 0.0);
    return point_hit(nearest.distance, nearest.slot, surfel.radius, normal, surfel.color, SHAPE != LEAVES && 0.0 < along);
}
