//! Hints at areas that are probably not meant: rings that cross, and polygons far from the points.

use crate::description::{Crop, PreparationSettings};
use std::path::PathBuf;
use surfel_core::progress::Progress;

/// Least and greatest coordinates along X and Y.
type Bounds = [[f64; 2]; 2];

/// Warns once of polygons whose rings cross.
pub fn report_crossing_rings<'a>(
    all: impl IntoIterator<Item = &'a PreparationSettings>,
    progress: &dyn Progress,
) {
    let mut crops = all.into_iter().filter_map(|settings| settings.crop.as_ref());
    if crops.any(|crop| crop.crosses().unwrap_or(false)) {
        let line = "rings of a polygon cross; areas inside of an even number of rings are left out (even-odd rule)";
        progress.warning(line, &["crop"]);
    }
}

/// Returns where an area and the points of files lie if they are apart; empty otherwise, and where the headers do not tell.
pub fn outside_hint(crop: Option<&Crop>, files: &[PathBuf]) -> String {
    let area = crop.and_then(|crop| crop.xy_bounds().ok());
    let infos = files.iter().filter_map(|file| surfel_formats::inspect(file).ok()?.bounds);
    let bounds = infos.map(|[low, high]| [[low.x, high.x], [low.y, high.y]]);
    let points = bounds.reduce(|a, b| [0, 1].map(|i| [a[i][0].min(b[i][0]), a[i][1].max(b[i][1])]));
    area.zip(points).map_or_else(String::new, |(area, points)| apart_hint(area, points))
}

fn apart_hint(area: Bounds, points: Bounds) -> String {
    let is_apart = |i: usize| area[i][1] < points[i][0] || points[i][1] < area[i][0];
    if !(0..2).any(is_apart) {
        return String::new();
    }
    let are_degrees = |bounds: Bounds| {
        let is_within = |i: usize, limit: f64| -limit <= bounds[i][0] && bounds[i][1] <= limit;
        is_within(0, 180.0) && is_within(1, 90.0)
    };
    let advice = match (are_degrees(area), are_degrees(points)) {
        (true, false) => "; it looks like degrees: convert it to the coordinates of the points",
        _ => "",
    };
    let [area, points] = [area, points].map(|[[x0, x1], [y0, y1]]| {
        format!("({},{}) to ({},{})", short(x0), short(y0), short(x1), short(y1))
    });
    format!("; the area spans {area}, the points {points}{advice}")
}

/// Writes a coordinate with up to six decimals.
fn short(coordinate: f64) -> String {
    let rounded = (1e6 * coordinate).round() / 1e6;
    if rounded.is_finite() { rounded.to_string() } else { coordinate.to_string() }
}

#[cfg(test)]
mod tests {
    //! Areas apart from the points are shown beside them.

    use super::*;
    use crate::progress_log::ProgressLog;
    use surfel_core::progress::NoProgress;

    const METRES: Bounds = [[484_649.36, 484_999.99], [6_632_629.73, 6_632_999.99]];

    #[test]
    fn areas_in_degrees_are_named_so() {
        let degrees = [[6.1, 6.2], [45.1, 45.2]];
        assert_eq!(
            apart_hint(degrees, METRES),
            "; the area spans (6.1,45.1) to (6.2,45.2), the points (484649.36,6632629.73) to \
             (484999.99,6632999.99); it looks like degrees: convert it to the coordinates of the points"
        );
        let elsewhere = [[6.3, 6.4], [45.1, 45.2]];
        assert!(apart_hint(degrees, elsewhere).ends_with("the points (6.3,45.1) to (6.4,45.2)"));
        assert!(
            apart_hint([[0.0, 1e6], [0.0, 1e6]], METRES).contains("(0,0) to (1000000,1000000)")
        );
        assert_eq!(apart_hint([[484_700.0, 484_800.0], METRES[1]], METRES), "");
    }

    #[test]
    fn crossing_rings_are_reported_once() {
        let settings = |text: &str| PreparationSettings {
            crop: Some(Crop::Wkt(text.to_owned())),
            ..PreparationSettings::default()
        };
        let bow = settings("POLYGON ((0 0, 2 2, 2 0, 0 2, 0 0))");
        let square = settings("POLYGON ((0 0, 2 0, 2 2, 0 2, 0 0))");
        let n_warnings = |all: &[&PreparationSettings]| {
            let log = ProgressLog::new(&NoProgress);
            report_crossing_rings(all.iter().copied(), &log);
            log.into_records().warnings.len()
        };
        assert_eq!(n_warnings(&[&square]), 0);
        assert_eq!(n_warnings(&[&bow, &square, &bow]), 1);
    }
}
