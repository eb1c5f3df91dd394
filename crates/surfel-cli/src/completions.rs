//! `surfel completions`, and the manual page.

use clap::Command;
use clap_complete::Shell;
use std::io::Write;

/// Arguments of `surfel completions`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The shell.
    shell: Shell,
}

const EXAMPLES: &str = "\
Examples:
  surfel completions bash > ~/.local/share/bash-completion/completions/surfel
  surfel completions zsh > ~/.zfunc/_surfel
  surfel completions fish > ~/.config/fish/completions/surfel.fish";

/// Prints completions.
pub fn run(args: &Args, mut command: Command) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "surfel", &mut text);
    print(&text)
}

/// Prints the manual page of the program and its commands.
pub fn man(command: Command) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut text)?;
    for command in command.get_subcommands().filter(|command| !command.is_hide_set()) {
        let named = command.clone().display_name(format!("surfel {}", command.get_name()));
        let page = clap_mangen::Man::new(named);
        page.render_description_section(&mut text)?;
        page.render_options_section(&mut text)?;
    }
    print(&text)
}

fn print(text: &[u8]) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => Ok(result?),
    }
}
