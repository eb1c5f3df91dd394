//! The program from the outside: what it writes, what it says, how it ends.

#[path = "../../surfel-tests/src/skipped.rs"]
mod skipped;
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
#[path = "cli/gpu.rs"]
mod gpu;
#[path = "cli/help.rs"]
mod help;
#[path = "cli/inputs.rs"]
mod inputs;
#[path = "cli/materials.rs"]
mod materials;
#[path = "cli/pictures.rs"]
mod pictures;
#[path = "cli/plans.rs"]
mod plans;
#[path = "cli/prepare.rs"]
mod prepare;
#[path = "cli/scenes.rs"]
mod scenes;
#[path = "cli/deformation.rs"]
mod deformation;
#[path = "cli/sequences.rs"]
mod sequences;
#[path = "cli/splats.rs"]
mod splats;
#[path = "cli/viewer.rs"]
mod viewer;
#[path = "cli/salvage.rs"]
mod salvage;
#[path = "cli/invalid_input.rs"]
mod invalid_input;
#[path = "cli/invalid_scenes.rs"]
mod invalid_scenes;
#[path = "cli/invalid_options.rs"]
mod invalid_options;
#[path = "cli/without_effect.rs"]
mod without_effect;
#[cfg(unix)]
#[path = "cli/interrupt.rs"]
mod interrupt;
#[cfg(unix)]
#[path = "cli/resume.rs"]
mod resume;
