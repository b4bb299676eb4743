//! Calibrates a glove from a recorded session and runs the rest of it: `calibrate_session FOLDER [--out OUT]`.
//!
//! FOLDER has `raw.csv` and `prompts.csv` ([`host::calibration::recorded`]). Prints what was found as JSON; with `--out`, the
//! angles of every scan go to `OUT/angles.csv`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use glove::headings::Config;
use host::calibration::report::{Report, angles_csv};
use host::calibration::{Recorded, replay};
use host::failure::{Failure, OrFail, report};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let (text, code) = report(&error);
            eprintln!("{text}");
            ExitCode::from(code)
        }
    }
}

fn run() -> anyhow::Result<()> {
    let (folder, out) = arguments()?;
    let recorded = Recorded::read(&folder)?;
    let replay = replay(&recorded, Config::default())?;
    if let Some(out) = &out {
        write(out, &angles_csv(&recorded, &replay))?;
    }
    println!("{}", serde_json::to_string_pretty(&Report::of(&replay))?);
    Ok(())
}

fn write(out: &Path, angles: &str) -> anyhow::Result<()> {
    let path = out.join("angles.csv");
    std::fs::create_dir_all(out)
        .and_then(|()| std::fs::write(&path, angles))
        .or_fail(
            || path.display().to_string(),
            "a folder that can be written",
        )
}

fn arguments() -> anyhow::Result<(PathBuf, Option<PathBuf>)> {
    let usage = |what: String| Failure::usage(what, "calibrate_session FOLDER [--out OUT]");
    let (mut folder, mut out) = (None, None);
    let mut arguments = std::env::args_os().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--out" {
            let value = arguments.next();
            out = Some(
                value
                    .ok_or_else(|| usage("--out without a folder".to_owned()))?
                    .into(),
            );
        } else if argument.to_string_lossy().starts_with('-') || folder.is_some() {
            let shown = argument.to_string_lossy();
            return Err(usage(format!("unexpected argument {shown}")).into());
        } else {
            folder = Some(PathBuf::from(argument));
        }
    }
    let folder = folder.ok_or_else(|| usage("no folder given".to_owned()))?;
    Ok((folder, out))
}
