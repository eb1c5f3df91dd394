// The filter by which every hit counts.

fn accepts_hit(ray: Ray, distance: f32, slot: u32) -> bool {
    return true;
}
