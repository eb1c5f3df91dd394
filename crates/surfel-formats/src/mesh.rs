//! What the readers of meshes share: places about an origin, and triangles that no ray can hit.

use surfel::math::{DVec3, Vec3};
use surfel::progress::Progress;
use surfel::scene::{Material, Mesh, Texture};

use crate::error::{Place, Result};
use crate::input::Input;
use crate::options::LoadOptions;
use crate::records::{Tolerance, choose_origin};

/// What a file of triangles holds: a mesh for each material that is used.
#[derive(Default)]
pub(crate) struct Model {
    pub parts: Vec<(Mesh, Material)>,
    pub textures: Vec<Texture>,
}

/// Faces and triangles that were left out.
#[derive(Clone, Copy, Default)]
struct Dropped {
    /// Faces of fewer than three corners.
    n_short: u64,
    /// Triangles without an area.
    n_flat: u64,
    /// Triangles with a corner that is nowhere.
    n_lost: u64,
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
    let mut dropped = Dropped { n_short, ..Dropped::default() };
    let mut n_mended = 0;
    for (mesh, _) in &mut model.parts {
        progress.check()?;
        drop_unusable(mesh, &mut dropped);
        n_mended += mend_normals(mesh);
    }
    model.parts.retain(|(mesh, _)| !mesh.triangles.is_empty());
    dropped.tell(input, model.parts.is_empty(), place, progress)?;
    if 0 < n_mended {
        progress.note(&format!("{}: {n_mended} normals without a direction made anew", input.name));
    }
    let n_triangles = model.parts.iter().map(|(mesh, _)| mesh.triangles.len() as u64).sum();
    Ok((model, n_triangles))
}

impl Dropped {
    /// Notes what was left out; an error if that is all.
    fn tell(
        self,
        input: &Input,
        is_all: bool,
        place: Place,
        progress: &dyn Progress,
    ) -> Result<()> {
        let kinds = [
            (self.n_flat, "without an area"),
            (self.n_lost, "with a corner that is not finite"),
            (self.n_short, "of fewer than three corners"),
        ];
        let words: Vec<String> = kinds
            .iter()
            .filter(|(count, _)| 0 < *count)
            .map(|(count, kind)| format!("{count} {kind}"))
            .collect();
        let words = words.join(", ");
        if is_all {
            let found = if words.is_empty() { "none".into() } else { format!("only some {words}") };
            let advice = "the mesh holds no triangles: write it again from its source";
            return Err(input.malformed(place, found, "triangles with an area", advice));
        }
        if !words.is_empty() {
            progress.note(&format!("{}: triangles dropped: {words}", input.name));
        }
        Ok(())
    }
}

/// Takes triangles that no ray can hit out of `mesh`.
fn drop_unusable(mesh: &mut Mesh, dropped: &mut Dropped) {
    let positions = &mesh.positions;
    mesh.triangles.retain(|triangle| {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            dropped.n_lost += 1;
            return false;
        }
        // In f64, where no product of the smallest and largest f32 becomes zero or infinite.
        let normal = (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3());
        dropped.n_flat += u64::from(normal == DVec3::ZERO);
        normal != DVec3::ZERO
    });
}

/// Makes normals unit; those without a direction become the smooth ones of their places.
///
/// Where triangles use none but such, they are flat. Returns how many they use.
fn mend_normals(mesh: &mut Mesh) -> usize {
    let Some(mut normals) = mesh.normals.take() else { return 0 };
    let mut is_used = vec![false; normals.len()];
    mesh.triangles.as_flattened().iter().for_each(|vertex| is_used[*vertex as usize] = true);
    let mut lost = Vec::new();
    for (vertex, normal) in normals.iter_mut().enumerate() {
        // To divide by a length of almost one would change the last bits only.
        if normal.is_normalized() {
            continue;
        }
        match normal.as_dvec3().try_normalize() {
            Some(unit) => *normal = unit.as_vec3(),
            None => lost.push(vertex),
        }
    }
    let n_lost = lost.iter().filter(|vertex| is_used[**vertex]).count();
    if n_lost == is_used.iter().filter(|is_used| **is_used).count() {
        return n_lost;
    }
    if !lost.is_empty() {
        mesh.smooth_normals();
        let smooth = mesh.normals.take().unwrap_or_default();
        lost.iter().for_each(|vertex| normals[*vertex] = smooth[*vertex]);
    }
    mesh.normals = Some(normals);
    n_lost
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
