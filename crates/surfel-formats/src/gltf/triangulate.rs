//! Conversion of indexed primitives to triangles, and compaction of their vertices.

/// The primitive modes that form triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TriangleTopology {
    List,
    Strip,
    Fan,
}

/// Returns the triangles of a primitive without those that use a vertex twice, which join the pieces of
/// strips.
pub(super) fn triangulate(mode: TriangleTopology, corners: &[u32]) -> Vec<[u32; 3]> {
    let is_nondegenerate = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
    let windows = corners.windows(3).enumerate();
    match mode {
        TriangleTopology::List => {
            corners.as_chunks().0.iter().copied().filter(is_nondegenerate).collect()
        }
        // Every other triangle of a strip has the opposite winding.
        TriangleTopology::Strip => windows
            .map(|(i, corners)| match (i % 2, corners) {
                (0, &[a, b, c]) => [a, b, c],
                (_, &[a, b, c]) => [a, c, b],
                _ => [0; 3],
            })
            .filter(is_nondegenerate)
            .collect(),
        TriangleTopology::Fan => {
            let Some((&center, rim)) = corners.split_first() else { return Vec::new() };
            rim.windows(2).map(|pair| [pair[0], pair[1], center]).filter(is_nondegenerate).collect()
        }
    }
}

/// Renumbers the vertices of `triangles` if they use few of the `n_vertices`, as when many meshes share one
/// buffer. Returns the old index of each new vertex, or `None` if all vertices are kept.
pub(super) fn compact_vertices(triangles: &mut [[u32; 3]], n_vertices: usize) -> Option<Vec<u32>> {
    if n_vertices <= 3 * triangles.len() {
        return None;
    }
    let mut used = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    for corner in triangles.as_flattened_mut() {
        // `used` contains every corner.
        *corner = used.partition_point(|vertex| vertex < corner) as u32;
    }
    Some(used)
}

#[cfg(test)]
mod tests {
    //! Tests of triangulation and vertex compaction.

    use super::*;

    #[test]
    fn strips_and_fans_keep_the_winding() {
        let corners = [0, 1, 2, 3, 4];
        assert_eq!(triangulate(TriangleTopology::List, &corners), [[0, 1, 2]]);
        assert_eq!(
            triangulate(TriangleTopology::Strip, &corners),
            [[0, 1, 2], [1, 3, 2], [2, 3, 4]]
        );
        assert_eq!(triangulate(TriangleTopology::Fan, &corners), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        for mode in [TriangleTopology::List, TriangleTopology::Strip, TriangleTopology::Fan] {
            assert!(triangulate(mode, &[]).is_empty() && triangulate(mode, &[5, 6]).is_empty());
        }
    }

    #[test]
    fn degenerate_triangles_of_a_strip_are_dropped() {
        let strip = [0, 1, 2, 2, 3, 3, 4, 5];
        assert_eq!(triangulate(TriangleTopology::Strip, &strip), [[0, 1, 2], [3, 5, 4]]);
    }

    #[test]
    fn vertices_are_renumbered_if_few_of_them_are_used() {
        let mut triangles = [[7, 100, 9], [9, 7, 5]];
        assert_eq!(compact_vertices(&mut triangles, 6), None);
        assert_eq!(compact_vertices(&mut triangles, 101), Some(vec![5, 7, 9, 100]));
        assert_eq!(triangles, [[1, 3, 2], [2, 1, 0]]);
    }
}
