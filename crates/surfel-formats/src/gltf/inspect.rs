//! What a glTF file says about itself, without its numbers.

use super::json::Json;
use super::{check_version, container, format_name};
use crate::error::Result;
use crate::input::Input;
use crate::options::Source;

/// Points and triangles of all meshes, each once. What is wrong with them is told when they are read.
pub(crate) fn inspect(input: &Input) -> Result<Source> {
    let container = container::open(input)?;
    let root = Json::root(&input.name, &container.json);
    check_version(&root)?;
    let (mut n_points, mut n_triangles) = (0, 0);
    for mesh in root.list("meshes")? {
        for primitive in mesh.list("primitives")? {
            let n_corners = n_corners(&root, &primitive).unwrap_or(0);
            match primitive.unsigned_or("mode", 4)? {
                0 => n_points += n_corners,
                4 => n_triangles += n_corners / 3,
                // Strips and fans.
                5 | 6 => n_triangles += n_corners.saturating_sub(2),
                _ => {}
            }
        }
    }
    Ok(Source {
        format: format_name(&container),
        n_points: (0 < n_points).then_some(n_points),
        n_triangles: (0 < n_triangles).then_some(n_triangles),
        ..Source::default()
    })
}

fn n_corners(root: &Json, primitive: &Json) -> Option<u64> {
    let position = || primitive.get("attributes")?.get("POSITION");
    let accessor = primitive.get("indices").or_else(position)?;
    let count = root.referred("accessors", &accessor).ok()?.get("count")?.unsigned().ok()?;
    // No file has more.
    Some(count.min(u64::from(u32::MAX)))
}
