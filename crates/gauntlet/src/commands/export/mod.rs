//! `gauntlet export`: a model's weights as the image a bridge takes, or a session log as tables.

mod args;
mod image;
mod log;

use anyhow::Result;

use host::interrupt::Interrupt;
use host::recording::export;

pub use args::Export;

/// Writes the image, or the tables.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(crate) fn run(options: &Export, interrupt: &Interrupt) -> Result<()> {
    let tables = options.poses.is_some() || options.commands.is_some() || options.openxr.is_some();
    if tables || (options.out.is_none() && export::is_log(&options.file)) {
        return log::run(options, interrupt);
    }
    image::run(options)
}
