//! The program from the outside: what it writes, what it says, how it ends.

#[path = "cli/common.rs"]
mod common;
#[path = "cli/animate.rs"]
mod animate;
#[path = "cli/bench.rs"]
mod bench;
#[path = "cli/cameras.rs"]
mod cameras;
#[path = "cli/clips.rs"]
mod clips;
#[path = "cli/commands.rs"]
mod commands;
#[path = "cli/materials.rs"]
mod materials;
#[path = "cli/pictures.rs"]
mod pictures;
#[path = "cli/scenes.rs"]
mod scenes;
#[path = "cli/bending.rs"]
mod bending;
#[path = "cli/sequences.rs"]
mod sequences;
#[path = "cli/viewer.rs"]
mod viewer;
#[path = "cli/wrong_input.rs"]
mod wrong_input;
#[path = "cli/wrong_scenes.rs"]
mod wrong_scenes;
#[path = "cli/wrong_use.rs"]
mod wrong_use;
#[cfg(unix)]
#[path = "cli/interrupt.rs"]
mod interrupt;
#[cfg(unix)]
#[path = "cli/resume.rs"]
mod resume;
