//! Tips for command lines that cannot be read: options by words of other programs, and files without a command.

use crate::shell::quoted;
use clap::Command;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::ffi::OsString;
use std::path::Path;
use surfel::description::{option_name, synonym};

/// Adds a tip to the error of a command line, if there is one. It takes the place of what is only spelled alike.
pub fn with_tip(mut error: clap::Error, words: &[OsString], program: &Command) -> clap::Error {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.as_str(),
        _ => "",
    };
    let tip = match error.kind() {
        ErrorKind::UnknownArgument => option_tip(text(ContextKind::InvalidArg), words, program),
        ErrorKind::InvalidSubcommand => file_tip(text(ContextKind::InvalidSubcommand)),
        _ => None,
    };
    if let Some(tip) = tip {
        error.remove(ContextKind::SuggestedArg);
        error.remove(ContextKind::SuggestedSubcommand);
        let tips = ContextValue::StyledStrs(vec![StyledStr::from(tip)]);
        error.insert(ContextKind::Suggested, tips);
    }
    error
}

/// Names the option of the command that other programs call `word`.
fn option_tip(word: &str, words: &[OsString], program: &Command) -> Option<String> {
    let name = word.trim_start_matches('-').split('=').next()?;
    let option = option_name(synonym(name)?);
    let is_typed = |command: &&Command| words.iter().any(|word| word == command.get_name());
    let command = program.get_subcommands().find(is_typed)?;
    let mut known = command.get_arguments().filter_map(|argument| argument.get_long());
    known.any(|long| long == option).then(|| format!("here it is '--{option}'"))
}

/// Names the commands that show a file.
fn file_tip(word: &str) -> Option<String> {
    let file = quoted(word);
    Path::new(word).exists().then(|| {
        format!(
            "`surfel render {file} -o picture.png` makes a picture of it, `surfel view {file}` shows it"
        )
    })
}
