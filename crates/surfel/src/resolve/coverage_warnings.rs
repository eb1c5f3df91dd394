//! Warnings of pictures that show almost nothing, or things out of shape.

use surfel_core::image::Image;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;

/// Fraction of the picture below which its coverage is reported.
const MIN_COVERAGE: f64 = 0.005;
/// Minimum gap between two parts of a scene that is reported, in multiples of both parts' lengths together.
const MIN_GAP_RATIO: f64 = 10.0;
/// Minimum number of points of a part: fewer are outliers.
const MIN_POINTS: usize = 20;

/// Warns of a picture that is almost empty.
pub fn report_coverage(image: &Image, progress: &dyn Progress) {
    let n_pixels = image.coverage.len().max(1) as f64;
    let covered =
        image.coverage.iter().map(|coverage| f64::from(*coverage)).sum::<f64>() / n_pixels;
    if covered < MIN_COVERAGE {
        let share = match 100.0 * covered {
            0.0 => "no part".to_owned(),
            ..0.01 => "less than 0.01 %".to_owned(),
            percent => format!("only {percent:.2} %"),
        };
        let line = format!(
            "{share} of the picture is covered; move the camera nearer, keep a part of the points alone, or give them a \
             larger radius"
        );
        let keys = ["camera.zoom_factor", "camera.focal_point", "crop", "radius"];
        progress.warning(&line, &keys);
    }
}

/// Warns of objects that lie farther apart than their sizes explain, as files of different coordinate systems do.
pub fn report_gaps(points: &PointCloud, progress: &dyn Progress) {
    let step = points.len().div_ceil(200_000).max(1);
    let gaps = (0..3).filter_map(|axis| {
        let positions = points.positions.iter().step_by(step);
        largest_gap(positions.map(|p| f64::from(p[axis])).filter(|x| x.is_finite()).collect())
    });
    let Some((gap, size)) = gaps.max_by(|a, b| a.0.total_cmp(&b.0)) else { return };
    let line = format!(
        "parts of the scene lie {gap:.4} apart, but are only {size:.4} long; are they in one coordinate system?"
    );
    progress.warning(&line, &["clip_box", "crop"]);
}

/// Returns the largest gap between coordinates and the length of the longer part beside it, if the gap is out of
/// proportion.
fn largest_gap(mut values: Vec<f64>) -> Option<(f64, f64)> {
    values.sort_unstable_by(f64::total_cmp);
    let n_parts = values.len().checked_sub(2 * MIN_POINTS)?;
    let upper = (MIN_POINTS..=MIN_POINTS + n_parts).filter(|i| *i < values.len());
    let at = upper
        .max_by(|a, b| (values[*a] - values[*a - 1]).total_cmp(&(values[*b] - values[*b - 1])))?;
    let gap = values[at] - values[at - 1];
    let (lower, upper) = (values[at - 1] - values[0], values[values.len() - 1] - values[at]);
    (0.0 < gap && MIN_GAP_RATIO * (lower + upper) < gap).then_some((gap, lower.max(upper)))
}

#[cfg(test)]
mod tests {
    //! Gaps and empty pictures are reported, others are not.

    use super::*;
    use crate::SceneDescription;
    use crate::progress_log::{ProgressLog, Warning};
    use surfel_core::math::Vec3;
    use surfel_core::progress::NoProgress;

    fn reported(offset: f32) -> Vec<Warning> {
        let part = |x: f32| (0..100).map(move |i| Vec3::new(x + 0.01 * i as f32, 0.0, 0.0));
        let cloud = PointCloud::from_positions(part(0.0).chain(part(offset)).collect());
        let log = ProgressLog::new(&NoProgress);
        report_gaps(&cloud, &log);
        log.into_records().warnings
    }

    #[test]
    fn parts_far_apart_are_reported() {
        assert_eq!(reported(1000.0).len(), 1);
        assert_eq!(reported(10.0), []);
        assert_eq!(reported(0.0), []);
    }

    #[test]
    fn the_warning_names_keys_of_the_description() {
        let known = SceneDescription::keys();
        for key in &reported(1000.0)[0].keys {
            assert!(known.iter().any(|(path, ..)| path == key), "{key}");
        }
    }

    #[test]
    fn few_points_have_no_gap() {
        assert_eq!(largest_gap(vec![]), None);
        assert_eq!(largest_gap(vec![1.0; 60]), None);
        let mut with_outliers = vec![0.0; 60];
        with_outliers.extend([1e6; 5]);
        assert_eq!(largest_gap(with_outliers), None);
    }

    #[test]
    fn an_almost_empty_picture_is_reported() {
        let lines = |coverage: f32| {
            let image = Image { coverage: vec![coverage; 100], ..Image::new(10, 10) };
            let log = ProgressLog::new(&NoProgress);
            report_coverage(&image, &log);
            log.into_records().warnings
        };
        assert_eq!((lines(0.001).len(), lines(0.01).len()), (1, 0));
        assert!(lines(0.001)[0].line.starts_with("only 0.10 % of the picture"));
        assert!(lines(1e-5)[0].line.starts_with("less than 0.01 % of the picture"));
        assert!(lines(0.0)[0].line.starts_with("no part of the picture"));
    }
}
