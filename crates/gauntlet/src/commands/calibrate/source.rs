//! The glove that is calibrated: at a port of this computer, or of a bridge on a chip.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use host::glove::hand::{SEGMENT_COUNT, SEGMENT_NAMES};
use host::glove::imu::UniqueId;
use host::glove::scan::Health;

use crate::commands::glove::GloveAt;
use crate::line_log::LineLog;
use crate::results::gloves;
use crate::tell::Tell;
use host::calibration::virtual_person::VirtualPerson;
use host::chip::link::{Address, Error, HostLink};
use host::chip::scans::Scans;
use host::clock::Clock;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::Command;
use host::scanning::{Scanned, Scanning};
use host::words;

/// For the sensors of a chip that has just started.
const SENSORS_WAIT: Duration = Duration::from_secs(15);

/// Where it is.
pub(in crate::commands) enum Place<'a> {
    Port(GloveAt),
    Chip(&'a Address),
}

impl Place<'_> {
    /// As it was named.
    pub fn name(&self) -> String {
        match self {
            Self::Port(at) => at.glove.display().to_string(),
            Self::Chip(address) => address.to_string(),
        }
    }

    /// A command for it.
    pub fn command(&self, verb: &str) -> Command {
        match self {
            Self::Port(at) => Command::gauntlet(verb).path("--glove", &at.glove),
            Self::Chip(address) => Command::gauntlet(verb).option("--bridge", address),
        }
    }

    /// The command that looks at it.
    pub fn doctor(&self) -> Command {
        match self {
            Self::Port(_) => self.command("doctor"),
            Self::Chip(_) => self.command("bridge status"),
        }
    }

    /// Its virtual person, where there is one.
    pub fn person(&self) -> Option<VirtualPerson> {
        match self {
            Self::Port(at) => VirtualPerson::at(&at.glove),
            Self::Chip(Address::Serial(path) | Address::Unix(path)) => VirtualPerson::at(path),
            Self::Chip(Address::Tcp(_)) => None,
        }
    }

    /// Opens it and says how it is; how many sensors give no orientation.
    ///
    /// # Errors
    /// A failure that names the layer that fails, and what to try.
    pub fn open(
        &self,
        tell: &Tell,
        log: &mut LineLog,
        interrupt: &Interrupt,
    ) -> Result<(Source, usize)> {
        let address = match self {
            Self::Port(at) => {
                let clock = Clock::start();
                let (scanning, missing) = at.read(tell, clock, log.trace(), interrupt)?;
                log.begin(clock)?;
                return Ok((Source::Port { scanning, clock }, missing));
            }
            Self::Chip(address) => *address,
        };
        let told = |error: Error| error.at(address);
        let link = HostLink::connect(address).map_err(told)?;
        let mut scans = Scans::start(link).map_err(told)?;
        let good = scans.wait(SENSORS_WAIT, interrupt).map_err(told)?;
        if interrupt.asked() {
            return Err(Failure::interrupted("while the glove's sensors were waited for").into());
        }
        tell.say(format_args!(
            "bridge   {address}  answers, {} of 16 sensors give orientations",
            good.count_ones()
        ));
        let lacks: Vec<&str> = (0..SEGMENT_COUNT)
            .filter(|k| good >> k & 1 == 0)
            .map(|k| SEGMENT_NAMES[k])
            .collect();
        if !lacks.is_empty() {
            tell.say(format_args!(
                "warning: no orientation from {}",
                lacks.join(", ")
            ));
        }
        let source = Source::Chip {
            scans: Box::new(scans),
            address: address.clone(),
        };
        Ok((source, lacks.len()))
    }
}

/// Where the scans come from.
pub(in crate::commands) enum Source {
    /// A glove at a port of this computer, read with stamps of this clock.
    Port { scanning: Scanning, clock: Clock },
    /// That of a bridge on a chip, with stamps of the chip's clock.
    Chip { scans: Box<Scans>, address: Address },
}

impl Source {
    /// The time, on the clock of the scans' stamps.
    pub fn now(&self) -> host::glove::Instant {
        match self {
            Self::Port { clock, .. } => clock.now(),
            Self::Chip { scans, .. } => scans.now(),
        }
    }

    /// Forgets the scans that wait, which are of before, and what was counted.
    ///
    /// # Errors
    /// As [`Source::next`].
    pub fn begin(&mut self) -> Result<()> {
        match self {
            Self::Port { scanning, .. } => {
                scanning.waiting().for_each(drop);
                scanning.begin();
                Ok(())
            }
            Self::Chip { scans, address } => Ok(scans.begin().map_err(|e| e.at(address))?),
        }
    }

    /// The next scan, waited for by `time`.
    ///
    /// # Errors
    /// What ended the reading.
    pub fn next(&mut self, time: Duration) -> Result<Option<Scanned>> {
        match self {
            Self::Port { scanning, .. } => match scanning.next(time) {
                None if !scanning.running() => Err(scanning.ended()),
                scanned => Ok(scanned),
            },
            Self::Chip { scans, address } => Ok(scans.next(time).map_err(|e| e.at(address))?),
        }
    }

    /// The sensors' unique ids, as they are wired.
    pub fn ids(&self) -> [Option<UniqueId>; SEGMENT_COUNT] {
        match self {
            Self::Port { scanning, .. } => scanning
                .snapshot()
                .map(|seen| seen.ids())
                .unwrap_or_default(),
            Self::Chip { scans, .. } => *scans.ids(),
        }
    }

    /// How it is read now, in a line.
    pub fn line(&self) -> String {
        match self {
            Self::Port { scanning, .. } => scanning.snapshot().map_or_else(String::new, |seen| {
                format!(
                    "{} of 16 sensors, {:.1} scans/s, {}",
                    seen.good(),
                    seen.rate,
                    words::line_speed(seen.baud)
                )
            }),
            Self::Chip { scans, .. } => {
                let seen = scans.counted();
                format!(
                    "{} of 16 sensors, {:.1} scans/s, {} lost",
                    seen.good.count_ones(),
                    seen.rate,
                    seen.lost
                )
            }
        }
    }

    /// How each sensor is; `None` where nobody tells.
    pub fn health(&self) -> [Option<Health>; SEGMENT_COUNT] {
        match self {
            Self::Port { scanning, .. } => match scanning.snapshot() {
                Some(seen) => seen.health().map(Some),
                None => [None; SEGMENT_COUNT],
            },
            // A bridge says which are good, and of the others nothing.
            Self::Chip { scans, .. } => {
                let good = scans.counted().good;
                std::array::from_fn(|k| (good >> k & 1 == 1).then_some(Health::Good))
            }
        }
    }

    /// Scans in the last second, and those that were lost.
    pub fn rates(&self) -> (f64, u64) {
        match self {
            Self::Port { scanning, .. } => {
                let seen = scanning.snapshot();
                seen.map_or((0.0, 0), |seen| (seen.rate, seen.not_taken))
            }
            Self::Chip { scans, .. } => {
                let counted = scans.counted();
                (counted.rate, counted.lost)
            }
        }
    }

    /// How often it was read.
    pub fn scanned(&self) -> gloves::Scanned {
        match self {
            Self::Port { scanning, .. } => scanning
                .snapshot()
                .as_ref()
                .map(gloves::Scanned::from)
                .unwrap_or_default(),
            Self::Chip { scans, .. } => gloves::Scanned::from(&scans.counted()),
        }
    }

    /// Ends the reading; the line to the chip, where there is one.
    pub fn end(self) -> Option<Result<HostLink, Error>> {
        match self {
            Self::Port { mut scanning, .. } => {
                // What ended it before was told.
                let _ = scanning.stop();
                None
            }
            Self::Chip { scans, .. } => Some(scans.stop()),
        }
    }
}

/// What a person does by hand where the bridge did not take the profile.
pub(super) fn give_by_hand(profile: &Path, bridge: &Address) -> Command {
    Command::gauntlet("bridge calibrate")
        .option("--bridge", bridge)
        .path("--profile", profile)
}
