//! Welds equal corners to one vertex.

use rayon::prelude::*;

/// Corners welded to vertices.
pub(crate) struct Welded {
    /// First corner of each vertex.
    pub first_corners: Vec<u32>,
    /// Vertex of each corner.
    pub vertex_of_corner: Vec<u32>,
}

/// Welds corners with equal keys. Vertices are numbered in the order of their first corners.
///
/// There must be fewer than 2^32 keys. It sorts them, because no choice of keys makes sorting slow, as some make a hash
/// table.
pub(crate) fn weld(keys: &[[u32; 3]]) -> Welded {
    let mut order: Vec<([u32; 3], u32)> =
        keys.par_iter().enumerate().map(|(corner, key)| (*key, corner as u32)).collect();
    order.par_sort_unstable();
    let mut vertex_of_corner = vec![0; keys.len()];
    for group in order.chunk_by(|a, b| a.0 == b.0) {
        let (_, first) = group[0];
        group.iter().for_each(|(_, corner)| vertex_of_corner[*corner as usize] = first);
    }
    let mut first_corners = Vec::new();
    for corner in 0..keys.len() {
        let first = vertex_of_corner[corner] as usize;
        vertex_of_corner[corner] = if first == corner {
            first_corners.push(corner as u32);
            first_corners.len() as u32 - 1
        } else {
            // The first corner precedes this one, so its vertex is numbered already.
            vertex_of_corner[first]
        };
    }
    Welded { first_corners, vertex_of_corner }
}

#[cfg(test)]
mod tests {
    //! Corners with equal keys become one vertex.

    use super::*;

    #[test]
    fn equal_keys_become_one_vertex_in_the_order_of_the_file() {
        let [a, b, c] = [[9, 0, 1], [0, 7, 7], [9, 0, 0]];
        let welded = weld(&[a, b, a, c, b, a]);
        assert_eq!(welded.first_corners, [0, 1, 3]);
        assert_eq!(welded.vertex_of_corner, [0, 1, 0, 2, 1, 0]);
        assert!(weld(&[]).vertex_of_corner.is_empty());
    }
}
