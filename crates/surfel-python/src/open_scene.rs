//! Scenes whose files are read, and their views.

use std::sync::{Arc, Mutex, PoisonError};
use surfel::SceneDescription;
use surfel::live_scene::{LiveScene, UseCase};
use surfel::live_view::LiveView;
use surfel::progress_log::{Choice, ProgressLog};
use surfel::resolve::check_files;
use surfel_core::locks::lock_unless_cancelled;
use surfel_core::progress::Progress;

/// A scene, or none until it is needed.
pub type SceneSlot = Arc<Mutex<Option<Arc<OpenScene>>>>;

/// A scene whose files are read.
pub struct OpenScene {
    /// The files' content.
    pub scene: LiveScene,
    /// The choices that were made while the files were read.
    choices: Vec<Choice>,
    /// Held by those who work on the scene's own threads. One does at a time: a thread that waits inside its work would take
    /// up another's, which may wait for a lock that the first holds.
    turn: Mutex<()>,
    /// The view of the last description.
    last: Mutex<Option<Arc<ChosenView>>>,
}

/// A view with its description and all choices that were made for it.
pub struct ChosenView {
    description: SceneDescription,
    pub view: LiveView,
    /// The choices, with those that were made while the files were read.
    pub choices: Vec<Choice>,
}

impl OpenScene {
    /// Reads the files of a description.
    pub fn open(description: &SceneDescription, progress: &dyn Progress) -> surfel::Result<Self> {
        let log = ProgressLog::new(progress);
        let scene = LiveScene::open(description, UseCase::Pictures, &log)?;
        let choices = log.into_records().choices;
        Ok(Self { scene, choices, turn: Mutex::default(), last: Mutex::default() })
    }

    /// Returns the view under a description, which is made unless it is the last one.
    pub fn view(
        &self,
        description: SceneDescription,
        progress: &dyn Progress,
    ) -> surfel::Result<Arc<ChosenView>> {
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(last) = last.filter(|last| last.description == description) {
            return Ok(last);
        }
        let log = ProgressLog::after(self.choices.clone(), progress);
        let mut applied = description.clone();
        applied.apply_object_settings()?;
        if applied.materials != self.scene.startup().materials {
            check_files(&applied)?;
        }
        let view = self.install(progress, |scene| scene.view(&applied, &log))?;
        let choices = log.into_records().choices;
        let view = Arc::new(ChosenView { description, view, choices });
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(view.clone());
        Ok(view)
    }

    /// Runs `work` on the scene's threads, if it has a number of its own.
    pub fn install<T: Send>(
        &self,
        progress: &dyn Progress,
        work: impl FnOnce(&LiveScene) -> surfel::Result<T> + Send,
    ) -> surfel::Result<T> {
        let has_threads = self.scene.startup().run.threads.is_some();
        let _turn = has_threads.then(|| lock_unless_cancelled(&self.turn, progress)).transpose()?;
        self.scene.install(|| work(&self.scene))
    }
}

/// Returns the scene of a description, which is read unless it is there.
pub fn opened(
    slot: &SceneSlot,
    description: &SceneDescription,
    progress: &dyn Progress,
) -> surfel::Result<Arc<OpenScene>> {
    let mut slot = lock_unless_cancelled(slot, progress)?;
    if let Some(scene) = &*slot {
        return Ok(scene.clone());
    }
    let scene = Arc::new(OpenScene::open(description, progress)?);
    *slot = Some(scene.clone());
    Ok(scene)
}

/// True if a scene that was read under one description can be shown under another. Files are checked and environment maps
/// are read when a scene is opened, and threads are started.
pub fn is_read_alike(startup: &SceneDescription, description: &SceneDescription) -> bool {
    let [was, is] = [startup, description].map(|it| &it.objects_default.preparation);
    was.reads_like(is)
        && startup.light.environment == description.light.environment
        && startup.camera.name == description.camera.name
        && startup.run == description.run
}
