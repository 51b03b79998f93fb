//! `yarnray completions` and `yarnray man`: what shells and manual pages know of the command line.

use std::{io::Write as _, path::PathBuf};

use clap::{Args, Command};
use clap_complete::Shell;

use super::{Failure, log, terminal::print};
use crate::image::whole_file;

const COMPLETIONS: &str = "Examples:
  yarnray completions bash      into ~/.local/share/bash-completion/completions/yarnray
  yarnray completions zsh       into ~/.zfunc/_yarnray
  yarnray completions fish      into ~/.config/fish/completions/yarnray.fish";

#[derive(Args, Debug)]
#[command(after_help = COMPLETIONS)]
pub(super) struct CompletionsArgs {
    /// Whose completions to print.
    shell: Shell,
}

const MAN: &str = "Examples:
  yarnray man man1      for ~/.local/share/man/man1; then: man yarnray, man yarnray-render, man yarnray-make-knit";

#[derive(Args, Debug)]
#[command(after_help = MAN)]
pub(super) struct ManArgs {
    /// The folder for the pages; it is made if it is not there.
    folder: PathBuf,
}

pub(super) fn completions(args: &CompletionsArgs, mut command: Command) -> Result<(), Failure> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "yarnray", &mut text);
    print(&String::from_utf8_lossy(&text))
}

/// One page for the program and one for each command, those of `make` among them.
pub(super) fn man(args: &ManArgs, mut command: Command) -> Result<(), Failure> {
    command.build();
    let mut pages = Vec::new();
    add_pages("yarnray".to_owned(), command, &mut pages);
    for (name, page) in pages {
        let path = args.folder.join(format!("{name}.1"));
        whole_file::check_target(&path)?;
        whole_file::write(&path, |file| {
            let mut text = Vec::new();
            clap_mangen::Man::new(page).title(&name).render(&mut text)?;
            file.write_all(&text)
        })?;
        log::say(&format!("wrote {}", path.display()));
    }
    Ok(())
}

fn add_pages(name: String, command: Command, pages: &mut Vec<(String, Command)>) {
    let own: Vec<Command> = command.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect();
    pages.push((name.clone(), command));
    for below in own {
        add_pages(format!("{name}-{}", below.get_name()), below, pages);
    }
}
