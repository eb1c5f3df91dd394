//! Repairs of meshes that are wrong in places: the rest of them shall be seen.

use surfel::math::{DVec3, Vec3};
use surfel::points;
use surfel::scene::Mesh;

/// Triangles that were left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Dropped {
    /// Without an area.
    pub n_flat: u64,
    /// With a corner that is nowhere.
    pub n_lost: u64,
}

/// Takes out the triangles that no ray can hit. Corners that are nowhere stay, at the origin, where nothing
/// uses them.
pub(crate) fn drop_unusable(mesh: &mut Mesh) -> Dropped {
    let is_somewhere = |i: usize| {
        let at = [mesh.positions[i]].into_iter();
        at.chain(mesh.morphs.iter().map(|morph| morph.positions[i])).all(points::is_somewhere)
    };
    let is_lost: Vec<bool> = (0..mesh.positions.len()).map(|i| !is_somewhere(i)).collect();
    // What bends may have an area at another time.
    let stays = mesh.morphs.is_empty() && mesh.skin.is_none();
    let Mesh { positions, triangles, morphs, .. } = mesh;
    let mut dropped = Dropped::default();
    triangles.retain(|triangle| {
        if triangle.iter().any(|vertex| is_lost[*vertex as usize]) {
            dropped.n_lost += 1;
            return false;
        }
        // In f64, where no product of the smallest and largest f32 becomes zero or infinite.
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize].as_dvec3());
        let is_flat = stays && (b - a).cross(c - a) == DVec3::ZERO;
        dropped.n_flat += u64::from(is_flat);
        !is_flat
    });
    for vertex in (0..is_lost.len()).filter(|vertex| is_lost[*vertex]) {
        positions[vertex] = Vec3::ZERO;
        morphs.iter_mut().for_each(|morph| morph.positions[vertex] = Vec3::ZERO);
    }
    dropped
}

/// Makes normals unit; those without a direction become the smooth ones of their places.
///
/// Where triangles use none but such, they are flat. Returns how many they use.
pub(crate) fn mend_normals(mesh: &mut Mesh) -> usize {
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
        let tangents = mesh.tangents.take();
        mesh.smooth_normals();
        mesh.tangents = tangents;
        let smooth = mesh.normals.take().unwrap_or_default();
        lost.iter().for_each(|vertex| normals[*vertex] = smooth[*vertex]);
    }
    mesh.normals = Some(normals);
    n_lost
}

#[cfg(test)]
mod tests {
    use super::*;
    use surfel::math::Vec4;
    use surfel::scene::Morph;

    fn square() -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    #[test]
    fn triangles_with_a_lost_corner_are_dropped() {
        let mut mesh = square();
        assert_eq!(drop_unusable(&mut mesh), Dropped::default());
        mesh.positions[1].y = f32::NAN;
        assert_eq!(drop_unusable(&mut mesh), Dropped { n_flat: 0, n_lost: 1 });
        assert_eq!(mesh.triangles, [[0, 2, 3]]);
        assert!(mesh.positions.iter().all(|position| position.is_finite()));
        // As files write where nothing was measured.
        let mut mesh = Mesh { triangles: square().triangles, ..mesh };
        mesh.positions[1] = Vec3::splat(1e30);
        assert_eq!(drop_unusable(&mut mesh), Dropped { n_flat: 0, n_lost: 1 });
        let lost = vec![Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, Vec3::INFINITY];
        mesh.morphs = vec![Morph { positions: lost, ..Morph::default() }];
        assert_eq!(drop_unusable(&mut mesh).n_lost, 1);
        assert!(mesh.triangles.is_empty());
    }

    #[test]
    fn flat_triangles_are_dropped_unless_they_bend() {
        let mut mesh = square();
        mesh.triangles.push([0, 1, 1]);
        let mut bending = mesh.clone();
        bending.morphs = vec![Morph { positions: vec![Vec3::ZERO; 4], ..Morph::default() }];
        assert_eq!(drop_unusable(&mut mesh), Dropped { n_flat: 1, n_lost: 0 });
        assert_eq!(mesh.triangles.len(), 2);
        assert_eq!(drop_unusable(&mut bending), Dropped::default());
    }

    #[test]
    fn normals_without_direction_follow_the_triangles() {
        let mut mesh = square();
        mesh.normals = Some(vec![2.0 * Vec3::X, Vec3::ZERO, Vec3::X, Vec3::NAN]);
        mesh.tangents = Some(vec![Vec4::W; 4]);
        assert_eq!(mend_normals(&mut mesh), 2);
        assert_eq!(mesh.normals, Some(vec![Vec3::X, Vec3::Z, Vec3::X, Vec3::Z]));
        assert_eq!(mesh.tangents, Some(vec![Vec4::W; 4]));
        assert_eq!(mend_normals(&mut mesh), 0);
        mesh.normals = Some(vec![Vec3::ZERO; 4]);
        assert_eq!(mend_normals(&mut mesh), 4);
        assert_eq!(mesh.normals, None);
    }
}
