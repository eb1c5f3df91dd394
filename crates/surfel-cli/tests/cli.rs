//! The program from the outside: what it writes, what it says, how it ends.

#[path = "cli/common.rs"]
mod common;
#[path = "cli/bench.rs"]
mod bench;
#[path = "cli/commands.rs"]
mod commands;
#[path = "cli/pictures.rs"]
mod pictures;
#[path = "cli/wrong_input.rs"]
mod wrong_input;
#[path = "cli/wrong_use.rs"]
mod wrong_use;
#[cfg(unix)]
#[path = "cli/interrupt.rs"]
mod interrupt;
