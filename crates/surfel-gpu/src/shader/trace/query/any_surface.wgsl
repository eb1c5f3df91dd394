// Any hit of a ray on a surface whose hits need more than one disc: its first hit.

fn is_occluded(ray: Ray) -> bool {
    return surface_hit(ray).is_hit;
}
