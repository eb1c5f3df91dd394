//! Summary of a glTF file from its JSON alone.

use super::container;
use super::json::Json;
use crate::error::Result;
use crate::file::Input;
use crate::options::FileInfo;

/// Counts the points and triangles of all meshes, independent of their instances. Defects are reported only
/// when the file is read.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    let container = container::open(input)?;
    let root = Json::root(&input.name, &container.json);
    container::check_version(&root)?;
    let (mut n_points, mut n_triangles) = (0, 0);
    for mesh in root.array_or_empty("meshes")? {
        for primitive in mesh.array_or_empty("primitives")? {
            let n_vertices = count_vertices(&root, &primitive).unwrap_or(0);
            match primitive.unsigned_or("mode", 4)? {
                0 => n_points += n_vertices,
                4 => n_triangles += n_vertices / 3,
                // A strip or fan.
                5 | 6 => n_triangles += n_vertices.saturating_sub(2),
                _ => {}
            }
        }
    }
    Ok(FileInfo {
        format: container.format_name(),
        is_in_metres: true,
        n_points: (0 < n_points).then_some(n_points),
        n_triangles: (0 < n_triangles).then_some(n_triangles),
        ..FileInfo::default()
    })
}

/// Returns the number of indices of a primitive, or of its positions if it has none.
fn count_vertices(root: &Json, primitive: &Json) -> Option<u64> {
    let position = || primitive.get("attributes")?.get("POSITION");
    let accessor = primitive.get("indices").or_else(position)?;
    let count = root.resolve("accessors", &accessor).ok()?.get("count")?.unsigned().ok()?;
    // The limit keeps the sums from overflowing.
    Some(count.min(u64::from(u32::MAX)))
}
