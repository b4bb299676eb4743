//! Options that several verbs have.

use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, SystemTime};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};

use host::clock::rfc3339;
use host::failure::Failure;
use host::glove::imu;
use host::lines::glove::{RAISED, Reading};
use host::lines::{Model, Settings};
use host::session::Driving;

/// How a gripper's line differs from that of a gripper as delivered.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct LineOptions {
    /// The gripper's Modbus unit (slave id), if not 9 on a serial line (1 to 247) or 2 over TCP (0 to 255).
    #[arg(long, value_name = "N")]
    pub unit: Option<u8>,
    /// Speed of the gripper's serial line, if not 115200.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1_200..=1_000_000))]
    pub baud: Option<u32>,
    /// Wait so much longer for the gripper's answers, milliseconds (1 to 1000): for a serial tunnel or a slow network.
    #[arg(long, value_name = "MS", value_parser = host::lines::patience)]
    pub patience: Option<Duration>,
}

impl LineOptions {
    /// The same for a line, if it fits `path`.
    ///
    /// # Errors
    /// A failure of usage: a speed for a line that has none.
    pub fn settings(&self, path: &Path) -> Result<Settings, Failure> {
        let settings = self.given();
        settings.check(path)?;
        Ok(settings)
    }

    /// The same as it was given, for whoever checks it elsewhere.
    pub fn given(&self) -> Settings {
        Settings {
            unit: self.unit,
            baud: self.baud,
            patience: self.patience,
        }
    }
}

/// How the glove is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Args)]
pub struct ReadingOptions {
    /// Highest speed of the glove's serial line: it is raised to the highest up to this one that answers without errors.
    #[arg(long, value_name = "BAUD", value_parser = raised(), default_value_t = Reading::default().baud)]
    pub glove_baud: u32,
    /// Whether the glove's serial bridge is asked after each read how it went.
    #[arg(long, value_enum, value_name = "WHETHER", default_value_t = OnOff::On)]
    pub status_check: OnOff,
    /// Which fusion the glove's sensors run: ndof has a compass, and is worse near metal.
    #[arg(long, value_enum, value_name = "MODE", default_value_t = SensorMode::Imu)]
    pub sensor_mode: SensorMode,
}

/// On or off: an option that can say both wins over a settings file that says either.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum OnOff {
    /// It is so.
    On,
    /// It is not.
    Off,
}

/// Which fusion the sensors run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SensorMode {
    /// Accelerometer and gyroscope.
    Imu,
    /// All nine axes.
    Ndof,
}

impl Default for ReadingOptions {
    fn default() -> Self {
        Self {
            glove_baud: Reading::default().baud,
            status_check: OnOff::On,
            sensor_mode: SensorMode::Imu,
        }
    }
}

impl ReadingOptions {
    /// The same for whoever reads it.
    pub fn given(&self) -> Reading {
        Reading {
            baud: self.glove_baud,
            status_checks: self.status_check == OnOff::On,
            mode: match self.sensor_mode {
                SensorMode::Imu => imu::Mode::Imu,
                SensorMode::Ndof => imu::Mode::Ndof,
            },
        }
    }
}

/// Takes one of the speeds a glove's line may be raised to.
fn raised() -> clap::builder::ValueParser {
    let one = |text: &str| match text.parse::<u32>() {
        Ok(baud) if RAISED.contains(&baud) => Ok(baud),
        _ => Err(format!(
            "one of {}",
            RAISED.map(|baud| baud.to_string()).join(", ")
        )),
    };
    clap::builder::ValueParser::new(one)
}

/// How the gripper is driven, where that is not as usual.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct DrivingOptions {
    /// How fast the fingers go, 0 to 255, if not 255.
    #[arg(long, value_name = "N")]
    pub speed: Option<u8>,
    /// How hard they press, 0 (weakest, which is not none) to 255, if not 64.
    #[arg(long, value_name = "N")]
    pub force: Option<u8>,
    /// Fastest change of a commanded position, counts a second (10 to 2000), if not 400.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(10..=2_000))]
    pub rate: Option<u16>,
    /// After half a second without data or a heartbeat: hold, or open slowly; if not hold.
    #[arg(long, value_enum, value_name = "ACTION")]
    pub safe_action: Option<SafeAction>,
}

/// What a hold becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SafeAction {
    /// Stay: what is grasped stays grasped.
    Hold,
    /// Open the fingers slowly.
    OpenSlowly,
}

impl DrivingOptions {
    /// The same for a session.
    pub fn given(&self) -> Driving {
        Driving {
            speed: self.speed,
            force: self.force,
            rate: self.rate.map(f32::from),
            safe_action: self.safe_action.map(|action| match action {
                SafeAction::Hold => host::bridge::SafeAction::Hold,
                SafeAction::OpenSlowly => host::bridge::SafeAction::OpenSlowly,
            }),
        }
    }
}

/// The command line as it was typed, the program by its name.
pub fn typed() -> Vec<String> {
    let words = std::env::args_os().skip(1);
    let words = words.map(|word| word.to_string_lossy().into_owned());
    std::iter::once("gauntlet".to_owned())
        .chain(words)
        .collect()
}

/// The name of a session's log where none is said: of this second.
pub fn log_name() -> &'static str {
    static NAME: LazyLock<String> = LazyLock::new(|| {
        let now = rfc3339(SystemTime::now());
        // A colon is no character of a file's name on some systems.
        format!("gauntlet-{}.mcap", now.replace(':', "-"))
    });
    &NAME
}

/// Takes a gripper's name on the command line.
pub fn model_parser() -> impl TypedValueParser<Value = Model> {
    let names = Model::ALL.map(|model| {
        let help = match model {
            Model::ThreeFinger => "3-Finger Adaptive Gripper",
            Model::TwoFinger85 | Model::TwoFinger140 | Model::HandE => model.name(),
        };
        PossibleValue::new(model.option()).help(help)
    });
    PossibleValuesParser::new(names).try_map(|name: String| name.parse::<Model>())
}

/// Whole or broken seconds from 1 to a day.
///
/// # Errors
/// What is wrong with the text.
pub fn run_time(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text
        .parse()
        .map_err(|_| format!("{text} is not a number of seconds"))?;
    if (1.0..=86_400.0).contains(&seconds) {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err(format!("{text} is not between 1 and 86400 seconds"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_out_of_range_are_refused() {
        for text in ["0", "-1", "nan", "inf", "1e9", "soon"] {
            assert!(run_time(text).is_err(), "{text}");
        }
        assert_eq!(run_time("2.5"), Ok(Duration::from_millis(2500)));
    }
}
