//! Tips for command lines that cannot be read: options and commands by words of other programs, and files without a
//! command.

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
        ErrorKind::InvalidSubcommand => {
            let word = text(ContextKind::InvalidSubcommand);
            file_tip(word).or_else(|| command_tip(word))
        }
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

/// Commands by words of other programs, with the tip that answers them.
const COMMAND_TIPS: [(&[&str], &str); 5] = [
    (
        &["convert", "translate", "export", "save"],
        "`surfel prepare scan.laz -o scan.ply --duplicates keep` writes a cloud in another format",
    ),
    (
        &["clean", "filter", "merge", "subsample", "sample", "normals"],
        "here it is 'surfel prepare', as in `surfel prepare scan.laz -o ready.ply`",
    ),
    (
        &["show", "open", "display", "viewer", "serve"],
        "here it is 'surfel view', as in `surfel view scan.laz`",
    ),
    (
        &["image", "picture", "draw", "raytrace", "trace"],
        "here it is 'surfel render', as in `surfel render scan.laz -o scan.png`",
    ),
    (
        &["movie", "video", "turntable"],
        "here it is 'surfel animate', as in `surfel animate scan.laz -o turn.mp4 --turntable 8`",
    ),
];

/// Names the command that other programs call `word`.
fn command_tip(word: &str) -> Option<String> {
    let known = COMMAND_TIPS.iter().find(|(words, _)| words.contains(&word));
    known.map(|(_, tip)| (*tip).to_owned())
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
