//! Triangles with their materials, as the readers of mesh files return them.

use surfel_core::math::{DVec3, Vec3};
use surfel_core::progress::Progress;
use surfel_core::scene::{Material, Mesh, Texture};
use surfel_core::words::counted;

use super::repair::{DroppedTriangles, drop_invalid_triangles, repair_normals};
use crate::error::{Location, Result};
use crate::file::Input;
use crate::options::LoadOptions;
use crate::table::{Tolerance, choose_origin};

/// The content of a mesh file: one mesh for each material in use.
#[derive(Default)]
pub(crate) struct Model {
    /// Meshes with their materials.
    pub parts: Vec<(Mesh, Material)>,
    /// Textures that the materials refer to.
    pub textures: Vec<Texture>,
}

/// Drops triangles that no ray can hit, and repairs normals; returns the model and its number of triangles.
///
/// Repairs are noted; a model without triangles is an error. The faces begin at `location`, and `n_short` of them
/// had fewer than three corners.
pub(crate) fn repair_model(
    input: &Input,
    mut model: Model,
    n_short: u64,
    location: Location,
    progress: &dyn Progress,
) -> Result<(Model, u64)> {
    let (mut dropped, mut n_repaired) = (DroppedTriangles::default(), 0);
    for (mesh, _) in &mut model.parts {
        progress.check()?;
        let DroppedTriangles { n_degenerate, n_invalid } = drop_invalid_triangles(mesh);
        dropped.n_degenerate += n_degenerate;
        dropped.n_invalid += n_invalid;
        n_repaired += repair_normals(mesh);
    }
    model.parts.retain(|(mesh, _)| !mesh.triangles.is_empty());
    let reasons = describe(dropped, n_short);
    if model.parts.is_empty() {
        let found = if reasons.is_empty() { "none".into() } else { format!("only some {reasons}") };
        let advice = "the mesh holds no triangles: write it again from its source";
        return Err(input.malformed(location, found, "triangles with an area", advice));
    }
    if !reasons.is_empty() {
        progress.note(&format!("{}: triangles dropped: {reasons}", input.name));
    }
    if 0 < n_repaired {
        progress.note(&format!(
            "{}: {} without a direction replaced",
            input.name,
            counted(n_repaired, "normal")
        ));
    }
    let n_triangles = model.parts.iter().map(|(mesh, _)| mesh.triangles.len() as u64).sum();
    Ok((model, n_triangles))
}

/// Describes the triangles and faces that were dropped.
fn describe(dropped: DroppedTriangles, n_short: u64) -> String {
    let kinds = [
        (dropped.n_degenerate, "without an area"),
        (dropped.n_invalid, "with a corner that is not finite or beyond 1e15"),
        (n_short, "of fewer than three corners"),
    ];
    let present = kinds.iter().filter(|(count, _)| 0 < *count);
    let reasons: Vec<String> = present.map(|(count, kind)| format!("{count} {kind}")).collect();
    reasons.join(", ")
}

/// Returns positions as f32 relative to an origin: that of `options` if there is one, else one that keeps their
/// resolution.
pub(crate) fn relative_to_origin<P: Copy + Into<DVec3>>(
    positions: &[P],
    tolerance: Tolerance,
    options: &LoadOptions,
) -> (DVec3, Vec<Vec3>) {
    let origin = options.origin.unwrap_or_else(|| {
        let step = positions.len().div_ceil(4096).max(1);
        let sample: Vec<DVec3> = positions.iter().step_by(step).map(|p| (*p).into()).collect();
        choose_origin(&sample, DVec3::splat(tolerance.0))
    });
    (origin, positions.iter().map(|p| ((*p).into() - origin).as_vec3()).collect())
}
