// Any hit of a ray on the finest cells of an octree.

fn is_occluded(ray: Ray) -> bool {
    return octree_hit(ray, 0.0, 0.0).cell_idx != NONE;
}
