//! The size of rasterised points: as small as shows a closed surface where the scan is as dense as usual.

use super::loaded::LoadedScene;
use crate::description::SceneDescription;
use surfel_core::math::median;
use surfel_core::points::{PointCloud, Subsample};
use surfel_core::progress::Progress;
use surfel_core::scene::{Camera, View};
use surfel_core::surface::SurfaceKind;
use surfel_core::words::counted;

/// Side of a cell in pixels.
const CELL: f32 = 16.0;
/// Maximum number of points that are looked at.
const MAX_SAMPLE: usize = 100_000;
/// Diameter of a point in mean distances between points. Discs on a square lattice close at 1.42; scans are less even.
const OVERLAP: f32 = 2.0;
/// Least and greatest size that is chosen: larger points hide what they show.
const LIMITS: (f32, f32) = (1.0, 8.0);

/// Writes the size of points into `description` if it is open and there are any to draw.
pub fn choose_point_size(
    scene: &LoadedScene,
    description: &mut SceneDescription,
    points: &PointCloud,
    camera: &Camera,
    progress: &dyn Progress,
) {
    let is_raster =
        |(i, _)| scene.settings_of(i, description).surface.surface() == SurfaceKind::Points;
    if description.picture.point_size.is_some() || !scene.clouds().any(is_raster) {
        return;
    }
    let drawn = |(i, cloud): (usize, &PointCloud)| {
        n_drawn(cloud.len(), scene.settings_of(i, description).preparation.subsample)
    };
    let n_points: usize = scene.clouds().map(drawn).sum();
    let (width, height) = description.picture.resolution();
    let view = camera.view(points.origin, width, height);
    let spacing = median_spacing(points, n_points, &view, (width, height));
    let size = (2.0 * OVERLAP * spacing).round() / 2.0;
    let size = f64::from(size.clamp(LIMITS.0, LIMITS.1));
    let pixels = counted(size, "pixel");
    let line = format!("point size {pixels}: the points are about {spacing:.2} pixels apart");
    progress.choice(&line, &["point_size"]);
    description.picture.point_size = Some(size);
}

/// Returns the number of points that a subsample leaves, where it says so.
fn n_drawn(n_points: usize, subsample: Option<Subsample>) -> usize {
    match subsample {
        Some(Subsample::First(n) | Subsample::Random(n)) => n_points.min(n),
        Some(Subsample::Stride(stride)) => (n_points as f64 / stride.max(1.0)).ceil() as usize,
        Some(Subsample::Spacing(_)) | None => n_points,
    }
}

/// Returns the median over the parts of the picture that show points of the mean distance between these, in pixels; 0 if
/// nothing is seen. `n_points` is the number of points of which `points` are a sample.
fn median_spacing(
    points: &PointCloud,
    n_points: usize,
    view: &View,
    (width, height): (u32, u32),
) -> f32 {
    let stride = points.len().div_ceil(MAX_SAMPLE).max(1);
    let sample = points.positions.iter().step_by(stride);
    let per_sample = n_points as f32 / sample.len().max(1) as f32;
    let n_columns = (width as f32 / CELL).ceil() as usize;
    let n_rows = (height as f32 / CELL).ceil() as usize;
    let mut counts = vec![0u32; n_columns * n_rows];
    for (x, y, _) in sample.filter_map(|position| view.project(*position)) {
        if (0.0..width as f32).contains(&x) && (0.0..height as f32).contains(&y) {
            counts[(y / CELL) as usize * n_columns + (x / CELL) as usize] += 1;
        }
    }
    let median = median(counts.into_iter().filter(|count| 0 < *count));
    median.map_or(0.0, |median| CELL / (median as f32 * per_sample).sqrt())
}

#[cfg(test)]
mod tests {
    //! The spacing is that of the points in the picture.

    use super::*;
    use surfel_core::math::{DVec3, Vec3};
    use surfel_core::scene::Projection;

    /// A view of 320 x 160 pixels, ten pixels for each unit.
    fn view() -> View {
        let camera = Camera {
            position: DVec3::new(0.0, 0.0, 10.0),
            focal_point: DVec3::ZERO,
            view_up: DVec3::Y,
            projection: Projection::Orthographic { height: 16.0 },
        };
        camera.view(DVec3::ZERO, 320, 160)
    }

    fn lattice(spacing: f32) -> PointCloud {
        let n = (20.0 / spacing) as i32;
        let points =
            (-n..=n).flat_map(|x| (-n..=n).map(move |y| Vec3::new(x as f32, y as f32, 0.0)));
        PointCloud::from_positions(points.map(|point| spacing * point).collect())
    }

    #[test]
    fn the_spacing_of_a_lattice_is_found() {
        for spacing in [0.05, 0.1, 0.4] {
            let cloud = lattice(spacing);
            let found = median_spacing(&cloud, cloud.len(), &view(), (320, 160));
            assert!((0.8..1.25).contains(&(found / (10.0 * spacing))), "{spacing}: {found}");
            // Four times as many points stand half as far apart.
            let denser = median_spacing(&cloud, 4 * cloud.len(), &view(), (320, 160));
            assert!((2.0 * denser - found).abs() < 1e-4);
        }
    }

    #[test]
    fn nothing_in_view_has_no_spacing() {
        assert_eq!(median_spacing(&PointCloud::default(), 0, &view(), (320, 160)), 0.0);
        let behind = PointCloud::from_positions(vec![Vec3::new(0.0, 0.0, 50.0)]);
        assert_eq!(median_spacing(&behind, 1, &view(), (320, 160)), 0.0);
    }

    #[test]
    fn subsamples_leave_fewer_points() {
        assert_eq!(n_drawn(100, None), 100);
        assert_eq!(n_drawn(100, Some(Subsample::First(30))), 30);
        assert_eq!(n_drawn(100, Some(Subsample::Random(300))), 100);
        assert_eq!(n_drawn(100, Some(Subsample::Stride(30.0))), 4);
    }
}
