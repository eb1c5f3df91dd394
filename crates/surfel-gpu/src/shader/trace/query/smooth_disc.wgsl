// The hit of a ray on the smooth surface near a disc.

// The surface may lie before the disc, and even before discs that were rejected.
fn hit_near_disc(ray: Ray, disc_distance: f32, disc_slot: u32) -> SurfaceHit {
    let disc = slot_surfel(disc_slot);
    nearest_slot = disc_slot;
    let found = find_surface(ray, disc_distance, disc);
    if !found.is_hit {
        return missed_surface();
    }
    let of_nearest = slot_surfel(nearest_slot);
    let color = mean_color(colors, of_nearest.color);
    let is_backface = 0.0 < dot(of_nearest.normal, ray.direction);
    return point_hit(found.distance, nearest_slot, disc.radius, found.normal, color, is_backface);
}
