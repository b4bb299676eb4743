//! A session log as tables.

use std::path::{Path, PathBuf};

use anyhow::Result;
use trainer::whole_file;

use super::Export;
use crate::outputs;
use crate::results::{self, recordings};
use crate::tell::Tell;
use host::failure::{Failure, OrFail};
use host::next::Command;
use host::recording::export;

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

pub(super) fn run(options: &Export) -> Result<()> {
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
    let log = export::read(&options.file)?;
    let rows = |path: &Option<PathBuf>, count: usize, text: &dyn Fn() -> String| {
        path.as_ref()
            .map(|path| write(path, &text()).map(|()| count))
            .transpose()
    };
    let mut worst = 0.0;
    let (poses, commands) = (log.poses.len(), log.commands.len());
    let openxr = match &tables.openxr {
        None => None,
        Some(path) => {
            let (text, difference) = log.openxr_csv();
            worst = difference;
            write(path, &text)?;
            Some(poses)
        }
    };
    let poses = rows(&tables.poses, poses, &|| log.poses_csv())?;
    let commands = rows(&tables.commands, commands, &|| log.commands_csv())?;
    let table = |file: &Option<PathBuf>, rows: Option<usize>| {
        let file = file.clone()?;
        Some(recordings::Table { file, rows: rows? })
    };
    let exported = recordings::ExportedLog {
        log: &options.file,
        poses: table(&tables.poses, poses),
        commands: table(&tables.commands, commands),
        openxr: table(&tables.openxr, openxr),
        openxr_angle_error_deg: openxr.map(|_| worst.to_degrees()),
        finished: log.finished,
        notes: log.notes(),
    };
    if options.json {
        return results::print("export", exported);
    }
    for note in &exported.notes {
        tell.say(format_args!("note: {}: {note}", options.file.display()));
    }
    for (what, table) in [
        ("poses", &exported.poses),
        ("commands", &exported.commands),
        ("openxr", &exported.openxr),
    ] {
        if let Some(table) = table {
            let file = table.file.display();
            tell.say(format_args!("{what:<10} {file}, {} rows", table.rows));
        }
    }
    if let Some(error) = exported.openxr_angle_error_deg {
        tell.say(format_args!(
            "           the joint angles that follow from it differ by {error:.4}° at most"
        ));
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<()> {
    whole_file::write(path, text.as_bytes()).or_fail(
        || format!("{} is not written", path.display()),
        "a folder with room that you may write in",
    )
}
