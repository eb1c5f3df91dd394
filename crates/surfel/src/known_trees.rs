//! Trees that were built before, found again by what they were built of.

use crate::error::Result;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use surfel_core::flat::{FlatGeometry, FlatScene};
use surfel_core::progress::Progress;
use surfel_core::scene::Scene;

/// The trees of geometries by the hashes of their content, for as long as a scene has them.
#[derive(Debug, Default)]
pub struct KnownTrees(Mutex<BTreeMap<u64, Weak<FlatGeometry>>>);

impl KnownTrees {
    /// Builds the trees of a scene, except those that another scene has.
    ///
    /// # Errors
    ///
    /// Fails for geometries that cannot be built, and if cancelled.
    pub fn build(&self, scene: &Scene, progress: &dyn Progress) -> Result<FlatScene> {
        let hashes: Vec<u64> =
            scene.graph.geometries.iter().map(|geometry| geometry.content_hash()).collect();
        progress.check()?;
        let known = |i: usize| self.lock().get(&hashes[i]).and_then(Weak::upgrade);
        let flat = FlatScene::with_known(scene, &known, progress)?;
        let mut trees = self.lock();
        trees.retain(|_, tree| 0 < tree.strong_count());
        for (i, hash) in hashes.into_iter().enumerate() {
            if let Some(tree) = flat.undeformed(i) {
                trees.insert(hash, Arc::downgrade(tree));
            }
        }
        Ok(flat)
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Weak<FlatGeometry>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
