//! What comes before a glove can be used: its port, its serial bridge, its sensors.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use glove::scan::Health;

use super::{Scanning, Settings};
use crate::clock::Clock;
use crate::diagnose::{self, Findings};
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::probe;

/// Bring-up of 16 sensors: a reset of 650 ms, two mode changes each, and time to spare.
const FRAME_WAIT: Duration = Duration::from_secs(15);
/// For the others after the first that gives orientations.
const STRAGGLERS: Duration = Duration::from_secs(2);

/// A glove that gives orientations.
#[derive(Debug)]
pub struct BringUp {
    /// It is read.
    pub scanning: Scanning,
    /// The speed it spoke; `None` on an I²C port.
    pub found: Option<u32>,
    /// Sensors that give none, as `doctor` says it; empty where all 16 do.
    pub missing: Findings,
}

/// Opens the way to the glove (a serial port, or `i2c:/dev/i2c-N`), finds its serial bridge or its multiplexer, brings its sensors up
/// and reads them. Ends within a minute.
///
/// # Errors
/// A failure that names the layer that fails and what to try; that the end was asked for.
pub fn open(
    path: &Path,
    settings: Settings,
    clock: Clock,
    interrupt: &Interrupt,
) -> Result<BringUp> {
    let glove = probe::open_glove_line(path, interrupt)?;
    let mut scanning = Scanning::start(glove.line, settings, clock, interrupt)?;
    let framed = scanning.wait(FRAME_WAIT, interrupt, |seen| seen.frames > 0);
    if !framed {
        scanning.stop()?;
        if interrupt.asked() {
            return Err(Failure::interrupted("while the glove's sensors were brought up").into());
        }
        // The port is free now.
        let what = format!(
            "the glove's multiplexer on {} answers, but no sensor sent an orientation in {} s",
            path.display(),
            FRAME_WAIT.as_secs()
        );
        return Err(diagnose::no_sensors(&what, path, interrupt).into());
    }
    let all = |health: &[Health]| health.iter().all(|health| health.is_good());
    scanning.wait(STRAGGLERS, interrupt, |seen| all(&seen.health()));
    // One that is still being brought up says soon what it fails with.
    scanning.wait(2 * STRAGGLERS, interrupt, |seen| {
        !seen.health().contains(&Health::Starting)
    });
    let missing = match scanning.snapshot().map(|seen| seen.health()) {
        Some(health) if !all(&health) => diagnose::missing_sensors(&health),
        _ => Findings::default(),
    };
    Ok(BringUp {
        scanning,
        found: glove.found,
        missing,
    })
}
