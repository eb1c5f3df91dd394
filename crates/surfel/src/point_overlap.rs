//! The number of points over each other, which a viewer of several pages limits.

use crate::description::Invalid;
use crate::error::Result;
use surfel_core::math::Aabb;
use surfel_core::points::PreparedCloud;
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
        let overlap = mean_overlap(points.cloud());
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

/// The number of discs over each other, about: their area as a fraction of that of a box around them.
fn mean_overlap(cloud: &PreparedCloud) -> f32 {
    let radii = cloud.radii();
    let n = radii.len().max(1) as f64;
    let sum = |power: i32| radii.iter().map(|radius| f64::from(*radius).powi(power)).sum::<f64>();
    let Aabb { min, max } = inlier_bounds(cloud);
    let size = (max - min).as_dvec3() + 2.0 * sum(1) / n;
    let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    (std::f64::consts::PI * sum(2) / area) as f32
}
