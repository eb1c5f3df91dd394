//! Repairs meshes that are broken in places, so that the rest of them is rendered.

use surfel_core::math::{DVec3, Vec3};
use surfel_core::points;
use surfel_core::scene::Mesh;

/// Numbers of dropped triangles, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct DroppedTriangles {
    /// Triangles without an area.
    pub n_degenerate: u64,
    /// Triangles with a corner that is not finite or too far away.
    pub n_invalid: u64,
}

/// Drops the triangles that no ray can hit. Invalid vertices stay, moved to the origin, and no triangle uses them.
pub(crate) fn drop_invalid_triangles(mesh: &mut Mesh) -> DroppedTriangles {
    let is_valid = |i: usize| {
        let at = [mesh.positions[i]].into_iter();
        at.chain(mesh.morphs.iter().map(|morph| morph.positions[i])).all(points::is_valid_position)
    };
    let is_invalid: Vec<bool> = (0..mesh.positions.len()).map(|i| !is_valid(i)).collect();
    // A triangle that is deformed may have an area at another time.
    let is_rigid = mesh.morphs.is_empty() && mesh.skin.is_none();
    let Mesh { positions, triangles, morphs, .. } = mesh;
    let mut dropped = DroppedTriangles::default();
    triangles.retain(|triangle| {
        if triangle.iter().any(|vertex| is_invalid[*vertex as usize]) {
            dropped.n_invalid += 1;
            return false;
        }
        // The product is f64, in which no product of f32 becomes zero or infinite.
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize].as_dvec3());
        let is_degenerate = is_rigid && (b - a).cross(c - a) == DVec3::ZERO;
        dropped.n_degenerate += u64::from(is_degenerate);
        !is_degenerate
    });
    for vertex in (0..is_invalid.len()).filter(|vertex| is_invalid[*vertex]) {
        positions[vertex] = Vec3::ZERO;
        morphs.iter_mut().for_each(|morph| morph.positions[vertex] = Vec3::ZERO);
    }
    dropped
}

/// Normalizes normals, and replaces those without a direction by the smooth normals of their vertices.
///
/// If the triangles use only normals without a direction, the mesh loses its normals and is shaded flat. Returns the
/// number of such normals that triangles use.
pub(crate) fn repair_normals(mesh: &mut Mesh) -> usize {
    let Some(mut normals) = mesh.normals.take() else { return 0 };
    let mut is_used = vec![false; normals.len()];
    mesh.triangles.as_flattened().iter().for_each(|vertex| is_used[*vertex as usize] = true);
    let mut undirected = Vec::new();
    for (vertex, normal) in normals.iter_mut().enumerate() {
        // Division by a length of almost one would change the last bits only.
        if normal.is_normalized() {
            continue;
        }
        match normal.as_dvec3().try_normalize() {
            Some(unit) => *normal = unit.as_vec3(),
            None => undirected.push(vertex),
        }
    }
    let n_used = undirected.iter().filter(|vertex| is_used[**vertex]).count();
    if n_used == is_used.iter().filter(|is_used| **is_used).count() {
        return n_used;
    }
    if !undirected.is_empty() {
        let tangents = mesh.tangents.take();
        mesh.smooth_normals();
        mesh.tangents = tangents;
        let smooth = mesh.normals.take().unwrap_or_default();
        undirected.iter().for_each(|vertex| normals[*vertex] = smooth[*vertex]);
    }
    mesh.normals = Some(normals);
    n_used
}

#[cfg(test)]
mod tests {
    //! Triangles that a repair drops, and normals that it replaces.

    use super::*;
    use surfel_core::math::Vec4;
    use surfel_core::scene::Morph;

    fn square() -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    #[test]
    fn triangles_with_an_invalid_corner_are_dropped() {
        let mut mesh = square();
        assert_eq!(drop_invalid_triangles(&mut mesh), DroppedTriangles::default());
        mesh.positions[1].y = f32::NAN;
        assert_eq!(
            drop_invalid_triangles(&mut mesh),
            DroppedTriangles { n_degenerate: 0, n_invalid: 1 }
        );
        assert_eq!(mesh.triangles, [[0, 2, 3]]);
        assert!(mesh.positions.iter().all(|position| position.is_finite()));
        // Files write such values for points that were not measured.
        let mut mesh = Mesh { triangles: square().triangles, ..mesh };
        mesh.positions[1] = Vec3::splat(1e30);
        assert_eq!(
            drop_invalid_triangles(&mut mesh),
            DroppedTriangles { n_degenerate: 0, n_invalid: 1 }
        );
        let far = vec![Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, Vec3::INFINITY];
        mesh.morphs = vec![Morph { positions: far, ..Morph::default() }];
        assert_eq!(drop_invalid_triangles(&mut mesh).n_invalid, 1);
        assert!(mesh.triangles.is_empty());
    }

    #[test]
    fn degenerate_triangles_are_dropped_unless_they_are_deformed() {
        let mut mesh = square();
        mesh.triangles.push([0, 1, 1]);
        let mut deformed = mesh.clone();
        deformed.morphs = vec![Morph { positions: vec![Vec3::ZERO; 4], ..Morph::default() }];
        assert_eq!(
            drop_invalid_triangles(&mut mesh),
            DroppedTriangles { n_degenerate: 1, n_invalid: 0 }
        );
        assert_eq!(mesh.triangles.len(), 2);
        assert_eq!(drop_invalid_triangles(&mut deformed), DroppedTriangles::default());
    }

    #[test]
    fn normals_without_direction_are_replaced_by_smooth_ones() {
        let mut mesh = square();
        mesh.normals = Some(vec![2.0 * Vec3::X, Vec3::ZERO, Vec3::X, Vec3::NAN]);
        mesh.tangents = Some(vec![Vec4::W; 4]);
        assert_eq!(repair_normals(&mut mesh), 2);
        assert_eq!(mesh.normals, Some(vec![Vec3::X, Vec3::Z, Vec3::X, Vec3::Z]));
        assert_eq!(mesh.tangents, Some(vec![Vec4::W; 4]));
        assert_eq!(repair_normals(&mut mesh), 0);
        mesh.normals = Some(vec![Vec3::ZERO; 4]);
        assert_eq!(repair_normals(&mut mesh), 4);
        assert_eq!(mesh.normals, None);
    }
}
