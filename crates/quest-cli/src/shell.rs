//! `quest-cli completions` and `quest-cli man`: what a shell wants to know of the tool, made of its own arguments.

use std::io;
use std::path::PathBuf;

use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;
use quest_io::Output;

use crate::{Failure, Outcome};

const COMPLETIONS: &str = "\
Examples:
  quest-cli completions bash > ~/.local/share/bash-completion/completions/quest-cli
  quest-cli completions zsh > ~/.zfunc/_quest-cli                        with fpath+=~/.zfunc before compinit
  quest-cli completions fish > ~/.config/fish/completions/quest-cli.fish
  quest-cli completions powershell >> $PROFILE

Exit status: 0 the script, 2 bad arguments.";

const MAN: &str = "\
Examples:
  quest-cli man ~/.local/share/man/man1        then man quest-cli, man quest-cli-estimate
  quest-cli man /tmp && man /tmp/quest-cli.1

Exit status: 0 the pages, 2 bad arguments.";

/// A script that completes commands and options in a shell.
#[derive(Args, Debug)]
#[command(after_help = COMPLETIONS)]
pub(crate) struct Completions {
    /// The shell.
    shell: Shell,
}

/// Manual pages, one a command.
#[derive(Args, Debug)]
#[command(after_help = MAN)]
pub(crate) struct Manual {
    /// Write the pages into this folder, which must be there.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

/// Writes the script to standard output.
pub(crate) fn completions(arguments: &Completions, mut tool: Command) -> Result<Outcome, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut tool, "quest-cli", &mut script);
    let mut script = String::from_utf8_lossy(&script).into_owned();
    if arguments.shell == Shell::Bash {
        // clap_complete 4.6 takes the dash of our name for a command below it in one of two places, and bash then finds no options.
        script = script.replace("quest__subcmd__cli", "quest__cli");
    }
    let mut output = Output::open(None)?;
    output.write(|writer| writer.write_all(script.as_bytes()))?;
    output.finish()?;
    Ok(Outcome::Answer)
}

/// Writes the pages, each whole or not at all.
pub(crate) fn manual(arguments: &Manual, tool: Command) -> Result<Outcome, Failure> {
    let mut tool = tool.disable_help_subcommand(true);
    tool.build();
    let mut pages = Vec::new();
    collect(&tool, &mut pages)
        .map_err(|error| Failure::Arguments(format!("a page could not be made: {error}")))?;
    for (name, page) in pages {
        let mut output = Output::open(Some(&arguments.folder.join(name)))?;
        output.write(|writer| writer.write_all(&page))?;
        output.finish()?;
    }
    Ok(Outcome::Answer)
}

/// The pages of a command and of those below it, by their file names.
fn collect(command: &Command, pages: &mut Vec<(String, Vec<u8>)>) -> io::Result<()> {
    for below in command.get_subcommands().filter(|c| !c.is_hide_set()) {
        collect(below, pages)?;
    }
    let man = Man::new(command.clone());
    let mut page = Vec::new();
    man.render(&mut page)?;
    pages.push((man.get_filename(), page));
    Ok(())
}
