//! A glove at a port of this computer: how it is named, opened and known.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use host::glove::hand::Side;

use super::speed;
use crate::commands::teleop::Hand as WhichHand;
use crate::options::ReadingOptions;
use crate::tell::Tell;
use host::calibration::{may_be_ideal, profile_of};
use host::clock::Clock;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::lines::list;
use host::next::Command;
use host::scanning::{self, BringUp, Hand, Scanning, Settings};
use host::trace::TraceLog;
use host::words;

/// Where the glove is, and what is known of it.
#[derive(Debug, Clone, Args)]
pub struct GloveAt {
    /// The glove's serial port, or `i2c:/dev/i2c-N`.
    #[arg(long, value_name = "PORT")]
    pub glove: PathBuf,
    /// The glove's profile, if not the one that is found by its sensors' ids.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "ideal")]
    pub profile: Option<PathBuf>,
    /// Take the sensors as ideal: sewn on straight, with one heading. One flat pose then calibrates them. Virtual gloves only.
    #[arg(long)]
    pub ideal: bool,
    /// Which hand wears the glove, where no profile says.
    #[arg(long, value_enum, default_value_t = WhichHand::Right)]
    pub hand: WhichHand,
    /// How it is read.
    #[command(flatten)]
    pub reading: ReadingOptions,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

/// A glove that is read, and the hand in it.
pub(in crate::commands) struct Opened {
    pub scanning: Scanning,
    /// Else why nobody knows how its sensors sit.
    pub hand: Result<Hand, String>,
    /// Sensors that give no orientation.
    pub missing: usize,
}

impl GloveAt {
    /// Opens it and says how it is: the port, the speed, sensors that are missing.
    ///
    /// # Errors
    /// A failure that names the layer that fails, and what to try.
    pub(in crate::commands) fn open(
        &self,
        tell: &Tell,
        clock: Clock,
        trace: TraceLog,
        interrupt: &Interrupt,
    ) -> Result<Opened> {
        let (scanning, missing) = self.read(tell, clock, trace, interrupt)?;
        let hand = self.known(&scanning, tell)?;
        Ok(Opened {
            scanning,
            hand,
            missing,
        })
    }

    /// The same without looking for its profile; how many sensors give no orientation.
    ///
    /// # Errors
    /// As [`GloveAt::open`].
    pub(in crate::commands) fn read(
        &self,
        tell: &Tell,
        clock: Clock,
        trace: TraceLog,
        interrupt: &Interrupt,
    ) -> Result<(Scanning, usize)> {
        let place = self.glove.display();
        if let Some(warning) = list::latency_warning(&self.glove) {
            tell.say(format_args!("warning: {place}: {warning}"));
        }
        let reading = self.reading.given();
        let settings = Settings {
            reading,
            trace,
            ..Settings::default()
        };
        let BringUp {
            scanning,
            found,
            missing,
        } = scanning::open(&self.glove, settings, clock, interrupt)?;
        speed::found(tell, &self.glove, found);
        let seen = scanning.snapshot();
        let good = seen.as_ref().map_or(0, |seen| seen.good());
        let baud = seen.and_then(|seen| seen.baud);
        tell.say(format_args!(
            "glove    {place}  answers, {good} of 16 sensors give orientations, {}",
            words::line_speed(baud)
        ));
        speed::runs(tell, &self.glove, reading, baud);
        for finding in &missing.0 {
            tell.say(format_args!("warning: {}", finding.what));
            if let Some(next) = &finding.next {
                tell.say(format_args!("  try: {next}"));
            }
        }
        Ok((scanning, missing.faults()))
    }

    /// The hand in it, by ideal sensors or by a profile; else why there is none.
    fn known(&self, scanning: &Scanning, tell: &Tell) -> Result<Result<Hand, String>> {
        let ids = scanning.snapshot().map_or([None; 16], |seen| seen.ids());
        if self.ideal {
            may_be_ideal(&self.glove, &ids)?;
            return Ok(Ok(Hand::ideal(self.side())));
        }
        let (path, kept) = match profile_of(self.profile.as_deref(), &ids)? {
            Ok(found) => found,
            Err(why) => return Ok(Err(why)),
        };
        tell.say(format_args!(
            "profile  {}  of {}, {}",
            path.display(),
            kept.calibrated,
            kept.quality.verdict
        ));
        Ok(Ok(Hand::with_profile(&kept.bound)))
    }

    /// Which hand wears it.
    pub(in crate::commands) fn side(&self) -> Side {
        match self.hand {
            WhichHand::Right => Side::Right,
            WhichHand::Left => Side::Left,
        }
    }

    /// What to do about it: the command that looks at it.
    pub(in crate::commands) fn doctor(&self) -> Command {
        Command::gauntlet("doctor").path("--glove", &self.glove)
    }

    /// It no longer sends frames.
    pub(in crate::commands) fn silent(&self) -> Failure {
        let what = format!(
            "the glove on {} no longer sends frames",
            self.glove.display()
        );
        Failure::new(what, self.doctor())
    }
}
