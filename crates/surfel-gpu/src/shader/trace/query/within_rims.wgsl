// The edge of the surface at the rims of the discs.

fn is_within_edge(ray: Ray, found: SurfaceHit) -> bool {
    return true;
}
