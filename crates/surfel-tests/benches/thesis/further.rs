//! The further work of the thesis: surfaces from positions alone, and neighbourhoods that follow the curvature.

use super::kinds::{Sampled, compare, preparation, print_header, print_row};
use surfel_core::points::{Preparation, Radius};
use surfel_core::surface::SurfaceKind;
use surfel_tests::shapes;

/// Width and height of each of the four views.
const RESOLUTION: u32 = 384;

/// Prints figures of surfaces without normals, and of radii by curvature, each beside that which it replaces.
pub fn print_further_work() {
    print_header();
    for (cloud, mesh, n_points) in
        [("cube", shapes::cube(), 20_000), ("head", shapes::head(), 60_000)]
    {
        let sampled = Sampled::new(&mesh, n_points, RESOLUTION);
        for (label, kind, preparation) in rows() {
            print_row(cloud, &label, &compare(&sampled, kind, &preparation));
        }
    }
}

/// Returns labels, kinds and preparations.
fn rows() -> Vec<(String, SurfaceKind, Preparation)> {
    let with = |label: &str, kind: SurfaceKind, change: fn(&mut Preparation)| {
        let mut preparation = preparation(kind);
        change(&mut preparation);
        (format!("`{}`{label}", kind.name()), kind, preparation)
    };
    let bent = |preparation: &mut Preparation| preparation.radius = Radius::Curvature { k: 12 };
    let (fit, splat, smooth) = (SurfaceKind::SplatFit, SurfaceKind::Splat, SurfaceKind::Smooth);
    vec![
        with("", splat, |_| ()),
        with(", radii by curvature", splat, bent),
        with("", smooth, |_| ()),
        with(", radii by curvature", smooth, bent),
        with(", estimated normals", fit, |preparation| preparation.estimates_normals = true),
        with(", no normals", fit, |_| ()),
        with(", no normals", SurfaceKind::Mls, |_| ()),
    ]
}
