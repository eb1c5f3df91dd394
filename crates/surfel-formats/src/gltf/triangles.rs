//! How the corners of a primitive become triangles, and which vertices these use.

/// The modes that are surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    List,
    Strip,
    Fan,
}

/// The triangles over `corners`; those with a corner twice, by which strips are stitched together, are
/// left out.
pub(super) fn assemble(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    let is_one = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
    let windows = corners.windows(3).enumerate();
    match mode {
        Mode::List => corners.as_chunks().0.iter().copied().filter(is_one).collect(),
        // Every other triangle of a strip goes round the other way.
        Mode::Strip => windows
            .map(|(i, corners)| match (i % 2, corners) {
                (0, &[a, b, c]) => [a, b, c],
                (_, &[a, b, c]) => [a, c, b],
                _ => [0; 3],
            })
            .filter(is_one)
            .collect(),
        Mode::Fan => {
            let Some((&center, rim)) = corners.split_first() else { return Vec::new() };
            rim.windows(2).map(|pair| [pair[0], pair[1], center]).filter(is_one).collect()
        }
    }
}

/// Numbers anew the vertices that `triangles` use, if these are few of the `n_vertices` that there are: many
/// meshes may lie in one buffer. Returns the old numbers by the new ones; nothing where all are kept.
pub(super) fn compact(triangles: &mut [[u32; 3]], n_vertices: usize) -> Option<Vec<u32>> {
    if n_vertices <= 3 * triangles.len() {
        return None;
    }
    let mut used = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    for corner in triangles.as_flattened_mut() {
        // All of them are there.
        *corner = used.partition_point(|vertex| vertex < corner) as u32;
    }
    Some(used)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_the_winding() {
        let corners = [0, 1, 2, 3, 4];
        assert_eq!(assemble(Mode::List, &corners), [[0, 1, 2]]);
        assert_eq!(assemble(Mode::Strip, &corners), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(assemble(Mode::Fan, &corners), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        for mode in [Mode::List, Mode::Strip, Mode::Fan] {
            assert!(assemble(mode, &[]).is_empty() && assemble(mode, &[5, 6]).is_empty());
        }
    }

    #[test]
    fn stitches_of_a_strip_are_left_out() {
        let strip = [0, 1, 2, 2, 3, 3, 4, 5];
        assert_eq!(assemble(Mode::Strip, &strip), [[0, 1, 2], [3, 5, 4]]);
    }

    #[test]
    fn few_of_many_vertices_are_numbered_anew() {
        let mut triangles = [[7, 100, 9], [9, 7, 5]];
        assert_eq!(compact(&mut triangles, 6), None);
        assert_eq!(compact(&mut triangles, 101), Some(vec![5, 7, 9, 100]));
        assert_eq!(triangles, [[1, 3, 2], [2, 1, 0]]);
    }
}
