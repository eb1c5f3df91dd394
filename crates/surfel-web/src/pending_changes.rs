//! Settings changes of a page that wait until the scene before them is prepared; they wait merged into one.

use crate::lock::lock;
use crate::merge_patch::combine_patches;
use crate::scene_provider::{Error, Result, SettingsMap};
use std::sync::{Mutex, MutexGuard};
use tokio::sync::Notify;

/// A change of the settings; several changes are merged into one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SettingsChange {
    /// A JSON merge patch.
    pub patch: SettingsMap,
    /// True if the patch applies to the startup settings, false if to the current ones.
    pub from_startup: bool,
    /// Sequence number of the last message that is part of the change.
    pub seq: u32,
    /// True if the user is still dragging.
    pub is_moving: bool,
    /// Id of the `LoadScene` that is part of the change, until a scene has answered it.
    pub load_id: Option<u32>,
}

impl SettingsChange {
    fn n_bytes(&self) -> usize {
        serde_json::to_string(&self.patch).map_or(0, |text| text.len())
    }

    fn append(&mut self, newer: Self) {
        if newer.from_startup {
            *self = newer;
            return;
        }
        combine_patches(&mut self.patch, &newer.patch);
        (self.seq, self.is_moving) = (self.seq.max(newer.seq), newer.is_moving);
    }
}

/// The changes that wait, merged into one, up to a number of bytes.
pub struct PendingChanges {
    change: Mutex<Option<SettingsChange>>,
    added: Notify,
    max_bytes: usize,
}

impl PendingChanges {
    /// No changes; at most `max_bytes` may wait.
    pub fn new(max_bytes: usize) -> Self {
        Self { change: Mutex::default(), added: Notify::new(), max_bytes }
    }

    /// Merges a newer change into those that wait.
    ///
    /// # Errors
    ///
    /// Fails if more bytes would wait than the limit allows; the change is then dropped.
    pub fn add(&self, newer: SettingsChange) -> Result<()> {
        self.append(&mut self.lock(), newer)?;
        self.added.notify_one();
        Ok(())
    }

    /// Takes the changes that wait, once there are any.
    pub async fn take(&self) -> SettingsChange {
        loop {
            if let Some(change) = self.lock().take() {
                return change;
            }
            self.added.notified().await;
        }
    }

    /// Adds a change that applies before those that wait, as one that was taken and then cancelled.
    pub fn requeue(&self, older: SettingsChange) {
        let mut pending = self.lock();
        if let Some(newer) = pending.replace(older) {
            // Beyond the limit, the older change stays and the newer ones are dropped.
            let _ = self.append(&mut pending, newer);
        }
        self.added.notify_one();
    }

    /// Returns whether no change waits.
    pub fn is_empty(&self) -> bool {
        self.lock().is_none()
    }

    fn append(&self, pending: &mut Option<SettingsChange>, newer: SettingsChange) -> Result<()> {
        let n_bytes = newer.n_bytes() + pending.as_ref().map_or(0, SettingsChange::n_bytes);
        if self.max_bytes < n_bytes {
            return Err(Error::invalid_request(format!(
                "settings: {n_bytes} bytes of changes are pending, expected at most {}",
                self.max_bytes
            )));
        }
        match pending {
            Some(change) => change.append(newer),
            none => *none = Some(newer),
        }
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, Option<SettingsChange>> {
        lock(&self.change)
    }
}

#[cfg(test)]
mod tests {
    //! The order in which changes that wait are merged, and how many bytes of them may wait.

    use super::*;
    use crate::limits::Limits;
    use serde_json::{Value, json};

    fn settings(value: Value) -> SettingsMap {
        value.as_object().unwrap().clone()
    }

    fn change(patch: Value, seq: u32) -> SettingsChange {
        SettingsChange { patch: settings(patch), seq, ..SettingsChange::default() }
    }

    fn no_changes() -> PendingChanges {
        PendingChanges::new(Limits::default().max_pending_bytes)
    }

    #[test]
    fn a_requeued_change_applies_before_newer_ones() {
        let pending = no_changes();
        pending.add(change(json!({ "a": 2 }), 8)).unwrap();
        pending.requeue(change(json!({ "a": 1, "b": 1 }), 7));
        let expected = change(json!({ "a": 2, "b": 1 }), 8);
        assert_eq!(pending.lock().take(), Some(expected));
        assert!(pending.is_empty());
        pending.requeue(change(json!({ "a": 1 }), 7));
        let from_startup =
            SettingsChange { from_startup: true, load_id: Some(1), ..change(json!({ "c": 3 }), 9) };
        pending.add(from_startup.clone()).unwrap();
        pending.add(change(json!({ "d": 4 }), 10)).unwrap();
        let patch = settings(json!({ "c": 3, "d": 4 }));
        let expected = SettingsChange { patch, seq: 10, ..from_startup };
        assert_eq!(pending.lock().take(), Some(expected));
    }

    #[test]
    fn changes_beyond_the_limit_are_rejected() {
        let pending = no_changes();
        let large = |i: u32| change(json!({ i.to_string(): "x".repeat(200_000) }), i);
        let n_added = (0..100).filter(|&i| pending.add(large(i)).is_ok()).count();
        assert_eq!(n_added, pending.max_bytes / 200_000);
    }
}
