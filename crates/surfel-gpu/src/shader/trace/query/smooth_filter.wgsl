// The filter by which discs count near which the ray hits the smooth surface.

fn accepts_hit(ray: Ray, distance: f32, slot: u32) -> bool {
    return find_surface(ray, distance, slot_surfel(slot)).is_hit;
}
