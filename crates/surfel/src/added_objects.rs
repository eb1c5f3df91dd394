//! Objects that a live scene was not opened with: they show content in memory, and stand behind all others.

use crate::description::{ObjectDescription, SceneDescription};

/// Returns the index of the first object of a description whose content is in its memory, but not in that of `startup`;
/// the number of objects if there is none.
pub fn first_added(description: &SceneDescription, startup: &SceneDescription) -> usize {
    let is_added = |object: &ObjectDescription| {
        let mut files = object.files.iter();
        files.any(|file| description.memory.contains(file) && !startup.memory.contains(file))
    };
    let first = description.objects.iter().position(is_added);
    first.unwrap_or(description.objects.len())
}

/// Returns a description without the objects from `first` on, and without their materials.
pub fn without_added(description: &SceneDescription, first: usize) -> SceneDescription {
    let mut base = description.clone();
    let added = base.objects.split_off(first);
    let names = added.iter().flat_map(ObjectDescription::names).collect::<Vec<_>>();
    if let Some(choices) = &mut base.materials.material {
        choices.retain(|choice| !names.iter().any(|name| choice.names(name)));
    }
    base
}

#[cfg(test)]
mod tests {
    //! Added objects are told from those of the start.

    use super::*;
    use crate::memory_files::MemoryContent;
    use serde_json::{Value, json};
    use std::path::{Path, PathBuf};
    use std::sync::Arc;
    use surfel_core::points::PointCloud;

    fn object(file: &str) -> ObjectDescription {
        ObjectDescription::new(PathBuf::from(file))
    }

    #[test]
    fn objects_in_memory_that_the_start_lacks_are_added() {
        let content = || MemoryContent::Points(Arc::new(PointCloud::default()), None);
        let objects = vec![object("a.ply"), object("memory-b")];
        let mut startup = SceneDescription { objects, ..SceneDescription::default() };
        startup.memory.insert("memory-b", content());
        assert_eq!(first_added(&startup, &startup), 2);
        let mut more = startup.clone();
        more.objects.push(object("memory-c"));
        more.memory.insert("memory-c", content());
        let materials = json!(["memory-c=metal", "a.ply=glass", "matte"]);
        more.set("material", &materials, Path::new("")).unwrap();
        assert_eq!(first_added(&more, &startup), 2);
        let base = without_added(&more, 2);
        assert_eq!(base.objects, startup.objects);
        let kept = base.get("material").map(|list| list.as_array().map(Vec::len));
        assert_eq!(kept, Some(Some(2)), "{:?}", base.get("material").unwrap_or(Value::Null));
    }
}
