//! What the readers of meshes share: places about an origin, and triangles that no ray can hit.

use surfel::math::{DVec3, Vec3};
use surfel::progress::Progress;
use surfel::scene::{Material, Mesh, Texture};

use crate::error::{Place, Result};
use crate::input::Input;
use crate::mend::{Dropped, drop_unusable, mend_normals};
use crate::options::LoadOptions;
use crate::records::{Tolerance, choose_origin};

/// What a file of triangles holds: a mesh for each material that is used.
#[derive(Default)]
pub(crate) struct Model {
    pub parts: Vec<(Mesh, Material)>,
    pub textures: Vec<Texture>,
}

/// Takes out what no ray can hit and mends normals; returns how many triangles are left.
///
/// What was done is noted; that no triangle is left is an error. The faces begin at `place`, and
/// `n_short` of them had fewer than three corners.
pub(crate) fn finish(
    input: &Input,
    mut model: Model,
    n_short: u64,
    place: Place,
    progress: &dyn Progress,
) -> Result<(Model, u64)> {
    let (mut dropped, mut n_mended) = (Dropped::default(), 0);
    for (mesh, _) in &mut model.parts {
        progress.check()?;
        let Dropped { n_flat, n_lost } = drop_unusable(mesh);
        dropped.n_flat += n_flat;
        dropped.n_lost += n_lost;
        n_mended += mend_normals(mesh);
    }
    model.parts.retain(|(mesh, _)| !mesh.triangles.is_empty());
    let words = words(dropped, n_short);
    if model.parts.is_empty() {
        let found = if words.is_empty() { "none".into() } else { format!("only some {words}") };
        let advice = "the mesh holds no triangles: write it again from its source";
        return Err(input.malformed(place, found, "triangles with an area", advice));
    }
    if !words.is_empty() {
        progress.note(&format!("{}: triangles dropped: {words}", input.name));
    }
    if 0 < n_mended {
        progress.note(&format!("{}: {n_mended} normals without a direction made anew", input.name));
    }
    let n_triangles = model.parts.iter().map(|(mesh, _)| mesh.triangles.len() as u64).sum();
    Ok((model, n_triangles))
}

/// What was left out, in words.
fn words(dropped: Dropped, n_short: u64) -> String {
    let kinds = [
        (dropped.n_flat, "without an area"),
        (dropped.n_lost, "with a corner that is not finite or beyond 1e15"),
        (n_short, "of fewer than three corners"),
    ];
    let there = kinds.iter().filter(|(count, _)| 0 < *count);
    let words: Vec<String> = there.map(|(count, kind)| format!("{count} {kind}")).collect();
    words.join(", ")
}

/// Positions as f32 about an origin that keeps their resolution.
pub(crate) fn about_origin<P: Copy + Into<DVec3>>(
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
