//! `gauntlet settings`: what a person prefers, where it lies, and every key with its default.

use anyhow::Result;
use clap::Args;

use crate::results::{self, settings as result};
use crate::{note, say};
use host::failure::Failure;
use host::next::Command;
use host::settings::{self, KEYS, Settings as Preferred};
use host::words;

/// Options of `settings`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet settings                  every key with its meaning and what counts now
  gauntlet settings --write          a file with all of that, where there is none, to be edited
  gauntlet settings --json

The settings are defaults for the options of every verb; what is typed wins. They lie in settings.toml in \
$XDG_CONFIG_HOME/gauntlet, or ~/.config/gauntlet where that is not set; GAUNTLET_CONFIG names another folder. \
A key that there is not is refused by name. Exit code 2 where the file is wrong.")]
pub struct Settings {
    /// Write the file, with everything that is printed, where there is none.
    #[arg(long)]
    pub write: bool,
    /// Print it as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

/// Prints them.
///
/// # Errors
/// The file is wrong, cannot be read, or is there already and was to be written.
pub(crate) fn run(options: &Settings) -> Result<()> {
    let path = settings::path()?;
    let there = path.exists();
    let preferred = Preferred::read(&path)?;
    if options.write {
        if there {
            let what = format!("{} is there, and is never written over", path.display());
            return Err(Failure::usage(what, "an editor").into());
        }
        let folder = path.parent().unwrap_or(&path);
        std::fs::create_dir_all(folder)
            .and_then(|()| host::trainer::whole_file::write(&path, preferred.to_toml().as_bytes()))
            .map_err(|error| {
                let what = format!("{} is not written: {}", path.display(), words::disk(&error));
                Failure::new(
                    what,
                    format!("another folder, named by {}", settings::place::OVERRIDE),
                )
            })?;
    }
    let there = path.exists();
    if options.json {
        let keys = KEYS.iter().map(|key| result::Setting {
            key: key.name,
            value: preferred.value(key.name),
            default: key.default(),
            given: preferred.given(key.name).is_some(),
            means: key.help,
        });
        let settings = keys.collect();
        let result = result::Settings {
            path: path.display().to_string(),
            is_there: there,
            settings,
        };
        return results::print("settings", result);
    }
    if there {
        note!("in {}", path.display());
    } else {
        let write = Command::gauntlet("settings").word("--write");
        note!(
            "{} is not there: these are the defaults; `{write}` makes it",
            path.display()
        );
    }
    say!("{}", preferred.to_toml().trim_end());
    Ok(())
}
