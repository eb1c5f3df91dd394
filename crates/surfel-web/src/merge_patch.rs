//! JSON merge patches (RFC 7396): one applied to settings, and two combined into one.

use crate::scene_provider::SettingsMap;
use serde_json::Value;

/// Applies a patch to settings: null removes a key.
pub fn apply_merge_patch(settings: &mut SettingsMap, patch: &SettingsMap) {
    combine_patches(settings, patch);
    remove_nulls(settings);
}

/// Combines `patch` with a newer one that is applied after it. Nulls stay, so that no removal is lost.
pub fn combine_patches(patch: &mut SettingsMap, newer: &SettingsMap) {
    for (key, value) in newer {
        match (value, patch.get_mut(key)) {
            (Value::Object(inner), Some(Value::Object(table))) => combine_patches(table, inner),
            (value, _) => drop(patch.insert(key.clone(), value.clone())),
        }
    }
}

fn remove_nulls(table: &mut SettingsMap) {
    table.retain(|_, value| !value.is_null());
    table.values_mut().filter_map(Value::as_object_mut).for_each(remove_nulls);
}

#[cfg(test)]
mod tests {
    //! Keys that a patch changes, adds and removes, and removals in combined patches.

    use super::*;
    use serde_json::json;

    fn settings(value: Value) -> SettingsMap {
        value.as_object().unwrap().clone()
    }

    #[test]
    fn a_patch_changes_adds_and_removes_keys() {
        let mut patched = settings(json!({ "a": 1, "b": { "c": 2, "d": 3 } }));
        let patch = settings(json!({ "a": null, "b": { "c": 4, "d": null }, "e": { "f": null } }));
        apply_merge_patch(&mut patched, &patch);
        assert_eq!(Value::Object(patched), json!({ "b": { "c": 4 }, "e": {} }));
    }

    #[test]
    fn combined_patches_keep_removals() {
        let mut patch = settings(json!({ "a": 1, "b": { "c": null } }));
        combine_patches(&mut patch, &settings(json!({ "a": null, "b": { "d": 2 } })));
        assert_eq!(Value::Object(patch.clone()), json!({ "a": null, "b": { "c": null, "d": 2 } }));
        let mut patched = settings(json!({ "a": 5, "b": { "c": 6 } }));
        apply_merge_patch(&mut patched, &patch);
        assert_eq!(Value::Object(patched), json!({ "b": { "d": 2 } }));
    }
}
