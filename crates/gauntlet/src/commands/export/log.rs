//! A session log as tables.

use std::path::{Path, PathBuf};

use anyhow::Result;
use host::trainer::whole_file;

use super::args::Export;
use crate::outputs;
use crate::progress::Progress;
use crate::results::{self, recordings};
use crate::tell::Tell;
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::next::Command;
use host::recording::export::{self, Exported};

/// Where the tables go.
struct Tables {
    poses: Option<PathBuf>,
    commands: Option<PathBuf>,
    openxr: Option<PathBuf>,
}

impl Tables {
    /// Those that are named; of none all three, beside the log.
    fn of(options: &Export) -> Self {
        let named = Self {
            poses: options.poses.clone(),
            commands: options.commands.clone(),
            openxr: options.openxr.clone(),
        };
        if named.all().next().is_some() {
            return named;
        }
        let beside = |what: &str| Some(options.file.with_extension(what));
        Self {
            poses: beside("poses.csv"),
            commands: beside("commands.csv"),
            openxr: beside("openxr.csv"),
        }
    }

    fn all(&self) -> impl Iterator<Item = &Path> {
        let all = [&self.poses, &self.commands, &self.openxr];
        all.into_iter().flatten().map(PathBuf::as_path)
    }
}

pub(super) fn run(options: &Export, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let tables = Tables::of(options);
    let mut taken: Vec<&Path> = Vec::new();
    for path in tables.all() {
        outputs::check_new(path, "a table")?;
        if taken.contains(&path) {
            return Err(Failure::usage(
                format!("two tables would be written to {}", path.display()),
                Command::gauntlet("export").word(options.file.display().to_string()),
            )
            .into());
        }
        taken.push(path);
    }
    let log = read(options, interrupt)?;
    // Asked for by name, an empty one is none.
    if options.poses.is_some() || options.openxr.is_some() {
        log.require_poses(&options.file)?;
    }
    let mut hand = match &tables.openxr {
        Some(_) => Some(openxr(&log, options, interrupt)?),
        None => None,
    };
    let mut error = None;
    let mut written = Vec::new();
    let (poses, commands) = (log.poses.len(), log.commands.len());
    let mut make = |table, path: &Option<PathBuf>, rows, text: &mut dyn FnMut() -> String| {
        let Some(file) = path.clone() else {
            return Ok(());
        };
        write(&file, &text())?;
        written.push(recordings::Table { table, file, rows });
        anyhow::Ok(())
    };
    make("poses", &tables.poses, poses, &mut || log.poses_csv())?;
    make("commands", &tables.commands, commands, &mut || {
        log.commands_csv()
    })?;
    make("openxr", &tables.openxr, poses, &mut || {
        let (text, worst) = hand.take().unwrap_or_default();
        error = Some(worst.to_degrees());
        text
    })?;
    let exported = recordings::ExportedLog {
        log: &options.file,
        tables: written,
        openxr_angle_error_deg: error,
        finished: log.finished,
        notes: log.notes(),
    };
    if options.json {
        return results::print("export", exported);
    }
    for note in &exported.notes {
        tell.say(format_args!("note: {}: {note}", options.file.display()));
    }
    for recordings::Table { table, file, rows } in &exported.tables {
        tell.say(format_args!("{table:<10} {}, {rows} rows", file.display()));
    }
    if let Some(error) = exported.openxr_angle_error_deg {
        tell.say(format_args!(
            "           the joint angles that follow from it differ by {error:.4}° at most"
        ));
    }
    Ok(())
}

/// Reads the log, under a bar.
fn read(options: &Export, interrupt: &Interrupt) -> Result<Exported> {
    let mut bar = None;
    export::read_while(&options.file, |behind, of| {
        bar.get_or_insert_with(|| Progress::start("reading", of, options.json))
            .at(behind, || {
                format!("{:.0} MB of the log", behind as f64 / 1e6)
            });
        !interrupt.asked()
    })
}

/// The hand as OpenXR has it, under a bar, since of a long log that takes a while; and how far its angles are from the log's, radians.
fn openxr(log: &Exported, options: &Export, interrupt: &Interrupt) -> Result<(String, f32)> {
    let mut bar = Progress::start("openxr", log.poses.len() as u64, options.json);
    let made = log.openxr_csv_while(|row| {
        bar.at(row as u64, || format!("{row} poses"));
        !interrupt.asked()
    });
    made.ok_or_else(|| Failure::interrupted("before any table was written").into())
}

fn write(path: &Path, text: &str) -> Result<()> {
    whole_file::write(path, text.as_bytes()).or_fail(
        || format!("{} is not written", path.display()),
        "a folder with room that you may write in",
    )
}
