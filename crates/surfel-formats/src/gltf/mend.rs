//! Repairs of meshes that are wrong in places: the rest of them shall be seen.

use surfel::math::Vec3;
use surfel::scene::Mesh;

/// Leaves out the triangles with a corner that is nowhere, and returns their number. The corner itself stays,
/// at the origin, where nothing uses it.
pub(super) fn drop_lost_vertices(mesh: &mut Mesh) -> usize {
    let is_found = |i: usize| {
        let at = [mesh.positions[i]].into_iter();
        at.chain(mesh.morphs.iter().map(|morph| morph.positions[i])).all(Vec3::is_finite)
    };
    let lost: Vec<usize> = (0..mesh.positions.len()).filter(|&i| !is_found(i)).collect();
    if lost.is_empty() {
        return 0;
    }
    let before = mesh.triangles.len();
    let is_lost = |corner: &u32| lost.binary_search(&(*corner as usize)).is_ok();
    mesh.triangles.retain(|triangle| !triangle.iter().any(is_lost));
    for &vertex in &lost {
        mesh.positions[vertex] = Vec3::ZERO;
        mesh.morphs.iter_mut().for_each(|morph| morph.positions[vertex] = Vec3::ZERO);
    }
    before - mesh.triangles.len()
}

/// Gives normals without a direction that of the triangles around; returns their number. A mesh without any
/// direction has none.
pub(super) fn mend_normals(mesh: &mut Mesh) -> usize {
    let Mesh { positions, triangles, normals: Some(normals), .. } = mesh else { return 0 };
    let has_none = |normal: Vec3| normal == Vec3::ZERO;
    let n_without = normals.iter().filter(|normal| has_none(**normal)).count();
    if n_without == normals.len() {
        mesh.normals = None;
    } else if 0 < n_without {
        let mut sums = vec![Vec3::ZERO; normals.len()];
        for triangle in triangles {
            let [a, b, c] = triangle.map(|corner| positions[corner as usize]);
            let normal = (b - a).cross(c - a);
            for corner in triangle.iter().filter(|corner| has_none(normals[**corner as usize])) {
                sums[*corner as usize] += normal;
            }
        }
        for (normal, sum) in normals.iter_mut().zip(sums) {
            if has_none(*normal) {
                *normal = sum.normalize_or(Vec3::Z);
            }
        }
    }
    n_without
}

#[cfg(test)]
mod tests {
    use super::*;
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
        assert_eq!(drop_lost_vertices(&mut mesh), 0);
        mesh.positions[1].y = f32::NAN;
        assert_eq!(drop_lost_vertices(&mut mesh), 1);
        assert_eq!(mesh.triangles, [[0, 2, 3]]);
        assert!(mesh.positions.iter().all(|position| position.is_finite()));
        let lost = vec![Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, Vec3::INFINITY];
        mesh.morphs = vec![Morph { positions: lost, normals: None }];
        assert_eq!(drop_lost_vertices(&mut mesh), 1);
        assert!(mesh.triangles.is_empty());
    }

    #[test]
    fn normals_without_direction_follow_the_triangles() {
        let mut mesh = square();
        mesh.normals = Some(vec![Vec3::X, Vec3::ZERO, Vec3::X, Vec3::ZERO]);
        assert_eq!(mend_normals(&mut mesh), 2);
        assert_eq!(mesh.normals, Some(vec![Vec3::X, Vec3::Z, Vec3::X, Vec3::Z]));
        assert_eq!(mend_normals(&mut mesh), 0);
        mesh.normals = Some(vec![Vec3::ZERO; 4]);
        assert_eq!(mend_normals(&mut mesh), 4);
        assert_eq!(mesh.normals, None);
    }
}
