//! The number of points over each other, which a viewer of several pages limits.

use crate::description::Invalid;
use crate::error::Result;
use surfel_core::points::mean_overlap;
use surfel_core::scene::{Geometry, Graph, inlier_bounds};
use surfel_core::surface::SurfaceKind;

/// Maximum number of discs of points over each other, on average.
const MAX_OVERLAP: f32 = 200.0;

/// Checks that points are not so large that each ray meets thousands of them: other viewers would wait for this one's
/// pictures, and nothing could be seen on them.
///
/// # Errors
///
/// Fails, with the key at fault, if they are.
pub fn check_overlap(graph: &Graph) -> Result<()> {
    for geometry in &graph.geometries {
        let Geometry::Points(points) = geometry else { continue };
        // Pixels are drawn, not traced.
        if points.surface == SurfaceKind::Points {
            continue;
        }
        let (radii, bounds) = (points.cloud().radii(), inlier_bounds(points.cloud()));
        let overlap = mean_overlap(radii.len(), radii.iter().copied(), bounds);
        if MAX_OVERLAP < overlap {
            let message = format!(
                "found {overlap:.0} points over each other, expected at most {MAX_OVERLAP}; \
                 choose a smaller radius or radius_scale"
            );
            return Err(Invalid::at("radius_scale", message).into());
        }
    }
    Ok(())
}
