//! Changes of settings that a page asks for, gathered until there is time to make them.

use crate::limits::MOST_WISHED_BYTES;
use crate::studio::Keys;
use serde_json::Value;
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// Several changes as one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wish {
    pub patch: Keys,
    /// Whether the patch is of what the program was started with, not of what is seen.
    pub is_anew: bool,
    /// Number of the last message in it.
    pub input: u32,
    pub is_moving: bool,
}

impl Wish {
    fn n_bytes(&self) -> usize {
        serde_json::to_string(&self.patch).map_or(0, |text| text.len())
    }

    fn add(&mut self, newer: Self) {
        if newer.is_anew {
            *self = newer;
            return;
        }
        merge_patch(&mut self.patch, &newer.patch);
        (self.input, self.is_moving) = (newer.input, newer.is_moving);
    }
}

#[derive(Default)]
pub struct Wishes {
    wish: Mutex<Option<Wish>>,
    called: Notify,
}

impl Wishes {
    /// Says why not if too much is wished for already.
    pub fn add(&self, newer: Wish) -> Result<(), String> {
        join(&mut self.wish(), newer)?;
        self.called.notify_one();
        Ok(())
    }

    /// What is wished for now, once there is something.
    pub async fn take(&self) -> Wish {
        loop {
            if let Some(wish) = self.wish().take() {
                return wish;
            }
            self.called.notified().await;
        }
    }

    /// A wish that was taken and given up for what came after it.
    pub fn put_back(&self, older: Wish) {
        let mut wish = self.wish();
        if let Some(newer) = wish.replace(older) {
            // Of too much, the older half stays.
            let _ = join(&mut wish, newer);
        }
        self.called.notify_one();
    }

    pub fn is_empty(&self) -> bool {
        self.wish().is_none()
    }

    fn wish(&self) -> MutexGuard<'_, Option<Wish>> {
        self.wish.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn join(wish: &mut Option<Wish>, newer: Wish) -> Result<(), String> {
    let n_bytes = newer.n_bytes() + wish.as_ref().map_or(0, Wish::n_bytes);
    if MOST_WISHED_BYTES < n_bytes {
        return Err(format!(
            "settings: {n_bytes} bytes wait to be seen, expected at most {MOST_WISHED_BYTES}"
        ));
    }
    match wish {
        Some(wish) => wish.add(newer),
        none => *none = Some(newer),
    }
    Ok(())
}

/// Puts one patch over another: unlike settings, patches keep nulls.
fn merge_patch(patch: &mut Keys, newer: &Keys) {
    for (key, value) in newer {
        match (value, patch.get_mut(key)) {
            (Value::Object(inner), Some(Value::Object(table))) => merge_patch(table, inner),
            (value, _) => drop(patch.insert(key.clone(), value.clone())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studio::merge;
    use serde_json::json;

    fn keys(value: Value) -> Keys {
        value.as_object().unwrap().clone()
    }

    fn wish(patch: Value, input: u32) -> Wish {
        Wish { patch: keys(patch), input, ..Wish::default() }
    }

    #[test]
    fn patches_add_up_and_keep_what_they_remove() {
        let mut patch = keys(json!({ "a": 1, "b": { "c": null } }));
        merge_patch(&mut patch, &keys(json!({ "a": null, "b": { "d": 2 } })));
        assert_eq!(Value::Object(patch.clone()), json!({ "a": null, "b": { "c": null, "d": 2 } }));
        let mut settings = keys(json!({ "a": 5, "b": { "c": 6 } }));
        merge(&mut settings, &patch);
        assert_eq!(Value::Object(settings), json!({ "b": { "d": 2 } }));
    }

    #[test]
    fn a_wish_put_back_stands_before_newer_ones() {
        let wishes = Wishes::default();
        wishes.add(wish(json!({ "a": 2 }), 8)).unwrap();
        wishes.put_back(wish(json!({ "a": 1, "b": 1 }), 7));
        let expected = wish(json!({ "a": 2, "b": 1 }), 8);
        assert_eq!(wishes.wish().take(), Some(expected));
        assert!(wishes.is_empty());
        wishes.put_back(wish(json!({ "a": 1 }), 7));
        let anew = Wish { is_anew: true, ..wish(json!({ "c": 3 }), 9) };
        wishes.add(anew.clone()).unwrap();
        assert_eq!(wishes.wish().take(), Some(anew));
    }

    #[test]
    fn wishes_do_not_pile_up() {
        let wishes = Wishes::default();
        let large = |i: u32| wish(json!({ i.to_string(): "x".repeat(200_000) }), i);
        let n_added = (0..100).filter(|&i| wishes.add(large(i)).is_ok()).count();
        assert_eq!(n_added, MOST_WISHED_BYTES / 200_000);
    }
}
