//! `gauntlet doctor`: which layer fails, and what to do about it.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use crate::options::{LineOptions, ReadingOptions};
use crate::progress::Person;
use crate::results::{self, devices};
use crate::say;
use host::diagnose::{self, Asked, Findings, Verdict};
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::lines::Model;
use host::lines::list;
use host::next::{Command, advice};

/// Options of `doctor`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet doctor                                           the ports alone
  gauntlet doctor --gripper /dev/ttyUSB1 --glove /dev/ttyUSB0
  gauntlet doctor --gripper /dev/ttyUSB1 --unit 12 --baud 57600 --gripper-model 2f85
  gauntlet doctor --gripper tcp:192.168.1.11 --json

Nothing moves: a gripper is only read. A glove's sensors are brought up. A gripper that does not answer \
is looked for at other speeds and under every unit number, which takes up to half a minute (Ctrl-C ends it). \
It ends by itself whatever a line says, one that never falls silent too. \
Exit code 1 when something is wrong.")]
pub struct Doctor {
    /// The gripper's serial port, or `tcp:HOST[:PORT]`.
    #[arg(long, value_name = "PORT")]
    pub gripper: Option<PathBuf>,
    /// The glove's serial port, or `i2c:/dev/i2c-N`.
    #[arg(long, value_name = "PORT")]
    pub glove: Option<PathBuf>,
    /// How the glove is read.
    #[command(flatten)]
    pub reading: ReadingOptions,
    /// How the gripper's line differs from that of a gripper as delivered.
    #[command(flatten)]
    pub line: LineOptions,
    /// Which gripper it should be; without it, whichever answers.
    #[arg(long, value_enum, requires = "gripper")]
    pub gripper_model: Option<Model>,
    /// Print the findings as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Examines what is named; the ports, where nothing is.
///
/// # Errors
/// A failure (exit code 1) when something is wrong.
pub(crate) fn run(options: &Doctor, interrupt: &Interrupt) -> Result<()> {
    let mut all = Vec::new();
    let mut examine = |device: &'static str, place: String, findings: Findings| {
        if !options.json {
            show(device, &place, &findings);
        }
        all.push(devices::Examined {
            device,
            place,
            findings,
        });
    };
    if let Some(path) = &options.gripper {
        let asked = Asked {
            settings: options.line.settings(path)?,
            model: options.gripper_model,
            reporter: Some(&Person),
        };
        let findings = diagnose::gripper(path, asked, interrupt);
        examine("gripper", path.display().to_string(), findings);
    }
    if let Some(path) = &options.glove {
        let findings = diagnose::glove(path, options.reading.given(), interrupt);
        examine("glove", path.display().to_string(), findings);
    }
    if all.is_empty() {
        return only_ports(options.json);
    }
    let faults: usize = all.iter().map(|device| device.findings.faults()).sum();
    if options.json {
        let doctor = devices::Doctor {
            devices: &all,
            wrong: faults,
            ports: None,
        };
        results::print("doctor", doctor)?;
    }
    if interrupt.asked() {
        return Err(Failure::interrupted("before everything was examined").into());
    }
    match faults {
        0 => Ok(()),
        1 => {
            let next = all.iter().find_map(|device| device.findings.first_wrong());
            let next = next.and_then(|wrong| wrong.next.clone());
            Err(Failure::new("1 thing is wrong", next.unwrap_or_default()).into())
        }
        _ => {
            let what = format!("{faults} things are wrong");
            Err(Failure::new(
                what,
                "the first one marked WRONG first: what it says to try",
            )
            .into())
        }
    }
}

fn show(device: &str, place: &str, findings: &Findings) {
    say!("{device}  {place}");
    for finding in &findings.0 {
        let verdict = match finding.verdict {
            Verdict::Good => "ok",
            Verdict::Note => "note",
            Verdict::Wrong => "WRONG",
        };
        say!("  {verdict:<5}  {:<11}  {}", finding.layer, finding.what);
        if let Some(next) = &finding.next {
            say!("         {:<11}  try: {next}", "");
        }
    }
}

fn only_ports(as_json: bool) -> Result<()> {
    let ports = list::list().or_fail(
        || "the serial ports cannot be listed".to_owned(),
        Command::program("sh").option("-c", "ls /dev/tty*"),
    )?;
    if as_json {
        let doctor = devices::Doctor {
            devices: &[],
            wrong: 0,
            ports: Some(&ports),
        };
        results::print("doctor", doctor)?;
    } else {
        for port in &ports {
            say!("port  {}", port.path.display());
            for warning in &port.warnings {
                say!("  note   {warning}");
            }
        }
    }
    if ports.is_empty() {
        return Err(Failure::new(
            "no serial port found",
            advice("plugging the adapter in, and ")
                .then(Command::program("dmesg"))
                .then(" for what the system says about it"),
        )
        .into());
    }
    if !as_json {
        say!("for more, the same with --gripper or --glove and one of these ports");
    }
    Ok(())
}
