//! The settings file as defaults of the command line: what is typed wins.

use std::ffi::OsString;

use clap::{Arg, ArgAction};
use host::settings::Settings;

/// The setting behind an option.
const BEHIND: [(&str, &str); 13] = [
    ("glove", "glove.port"),
    ("hand", "glove.hand"),
    ("gripper", "gripper.port"),
    ("gripper-model", "gripper.model"),
    ("unit", "gripper.unit"),
    ("baud", "gripper.baud"),
    ("patience", "gripper.patience_ms"),
    ("speed", "gripper.speed"),
    ("force", "gripper.force"),
    ("rate", "gripper.rate"),
    ("safe-action", "gripper.safe_action"),
    ("model", "teleop.model"),
    ("find-flat", "teleop.find_flat"),
];

/// The verbs whose options they are: those that talk to devices at real ports.
const VERBS: [&str; 6] = [
    "teleop",
    "calibrate",
    "record",
    "glove",
    "gripper",
    "doctor",
];

/// Whether a command line uses settings.
pub fn uses(words: &[OsString]) -> bool {
    let verb = words.get(1).and_then(|word| word.to_str());
    verb.is_some_and(|verb| VERBS.contains(&verb))
        && !words.iter().any(|word| word == "--help" || word == "-h")
}

/// The command line `command` with the settings as its defaults, for what was typed.
pub fn with(mut command: clap::Command, settings: &Settings, typed: &[OsString]) -> clap::Command {
    for verb in VERBS {
        command = command.mut_subcommand(verb, |verb| below(verb, settings, typed));
    }
    command
}

fn below(command: clap::Command, settings: &Settings, typed: &[OsString]) -> clap::Command {
    let names: Vec<String> = command
        .get_subcommands()
        .map(|sub| sub.get_name().to_owned())
        .collect();
    let doctor = command.get_name() == "doctor";
    let mut command = command.mut_args(|arg| match preferred(&arg, settings, typed, doctor) {
        Some(value) => arg.default_value(value).required(false),
        None => arg,
    });
    for name in names {
        command = command.mut_subcommand(name, |sub| below(sub, settings, typed));
    }
    command
}

/// What the file gives for an option of these words.
fn preferred(arg: &Arg, settings: &Settings, typed: &[OsString], doctor: bool) -> Option<String> {
    let long = arg.get_long()?;
    // A flag takes no value; what a positional word means is the verb's own.
    if !matches!(arg.get_action(), ArgAction::Set) {
        return None;
    }
    let (_, key) = BEHIND.iter().find(|(option, _)| *option == long)?;
    let named = |option: &str| {
        let is = |word: &OsString| {
            let word = word.to_string_lossy();
            word == option || word.starts_with(&format!("{option}="))
        };
        typed.iter().any(is)
    };
    // Who names one device to `doctor` asks about that one alone; about a named gripper's family it is asked to find out.
    if doctor && (named("--glove") || named("--gripper")) && matches!(long, "glove" | "gripper") {
        return None;
    }
    let gripper_is_there = settings.given("gripper.port").is_some() || named("--gripper");
    if doctor && !gripper_is_there && long == "gripper-model" {
        return None;
    }
    // Unit and speed of a serial line are none of one on the network, and the other way round.
    if matches!(long, "unit" | "baud") && named("--gripper") {
        let network = typed
            .iter()
            .any(|word| word.to_string_lossy().contains("tcp:"));
        if network != settings.is_network() {
            return None;
        }
    }
    Some(settings.given(key)?.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::{Cli, Verb};
    use super::*;
    use clap::{CommandFactory, FromArgMatches};
    use std::path::Path;

    const FILE: &str = "\
[glove]
port = \"/dev/g\"
hand = \"left\"
[gripper]
port = \"/dev/r\"
model = \"2f85\"
unit = 12
baud = 57600
patience_ms = 40
[teleop]
model = \"mine.safetensors\"
";

    fn parse(file: &str, line: &str) -> Result<Verb, clap::Error> {
        let settings = Settings::parse(Path::new("s.toml"), file).unwrap();
        let typed: Vec<OsString> = line.split_whitespace().map(OsString::from).collect();
        let command = with(Cli::command(), &settings, &typed);
        command.clone().debug_assert();
        let matches = command.try_get_matches_from(&typed)?;
        Ok(Cli::from_arg_matches(&matches)?.verb.unwrap())
    }

    #[test]
    fn the_file_gives_what_is_not_typed_and_what_is_typed_wins() {
        let Verb::Teleop(teleop) = parse(FILE, "gauntlet teleop").unwrap() else {
            panic!("teleop");
        };
        assert_eq!(teleop.glove, Path::new("/dev/g"));
        assert_eq!(teleop.gripper, Path::new("/dev/r"));
        assert_eq!(teleop.model, Path::new("mine.safetensors"));
        assert_eq!(teleop.hand, crate::commands::teleop::Hand::Left);
        assert_eq!(
            (teleop.line.unit, teleop.line.baud),
            (Some(12), Some(57_600))
        );
        assert_eq!(teleop.line.patience.unwrap().as_millis(), 40);
        let typed = "gauntlet teleop --glove /dev/x --hand right --baud 9600 --unit=3";
        let Verb::Teleop(teleop) = parse(FILE, typed).unwrap() else {
            panic!("teleop");
        };
        assert_eq!(teleop.glove, Path::new("/dev/x"));
        assert_eq!(teleop.hand, crate::commands::teleop::Hand::Right);
        assert_eq!((teleop.line.unit, teleop.line.baud), (Some(3), Some(9_600)));
        assert_eq!(teleop.gripper, Path::new("/dev/r"));
    }

    #[test]
    fn without_a_file_the_ports_must_be_typed_as_ever() {
        let error = parse("", "gauntlet teleop").unwrap_err();
        assert_eq!(
            error.kind(),
            clap::error::ErrorKind::MissingRequiredArgument
        );
        let Verb::Calibrate(calibrate) = parse("", "gauntlet calibrate").unwrap() else {
            panic!("calibrate");
        };
        assert_eq!(calibrate.glove, None, "refused by itself");
        assert!(parse("", "gauntlet calibrate --list").is_ok());
    }

    #[test]
    fn every_verb_below_has_them_and_virtual_devices_have_not() {
        let Verb::Gripper(gripper) = parse(FILE, "gauntlet gripper status").unwrap() else {
            panic!("gripper");
        };
        assert_eq!(gripper.verb.target().gripper, Path::new("/dev/r"));
        assert_eq!(gripper.verb.target().model, host::lines::Model::TwoFinger85);
        let Verb::Calibrate(calibrate) = parse(FILE, "gauntlet calibrate").unwrap() else {
            panic!("calibrate");
        };
        assert_eq!(calibrate.glove.as_deref(), Some(Path::new("/dev/g")));
        assert!(calibrate.hand.is_some());
        let Verb::Simulate(simulate) = parse(FILE, "gauntlet simulate").unwrap() else {
            panic!("simulate");
        };
        assert_eq!((simulate.glove, simulate.gripper), (None, None));
    }

    #[test]
    fn doctor_looks_at_both_or_at_the_one_that_is_named() {
        let doctor = |line: &str| {
            let Verb::Doctor(doctor) = parse(FILE, line).unwrap() else {
                panic!("doctor");
            };
            [doctor.glove, doctor.gripper].map(|path| path.is_some())
        };
        assert_eq!(doctor("gauntlet doctor"), [true, true]);
        assert_eq!(doctor("gauntlet doctor --glove /dev/x"), [true, false]);
        assert_eq!(doctor("gauntlet doctor --gripper=/dev/x"), [false, true]);
    }

    #[test]
    fn a_gripper_of_another_kind_of_line_does_not_get_the_unit_and_speed_of_the_usual_one() {
        let Verb::Gripper(gripper) =
            parse(FILE, "gauntlet gripper status --gripper tcp:10.0.0.2").unwrap()
        else {
            panic!("gripper");
        };
        let line = gripper.verb.target().line;
        assert_eq!((line.unit, line.baud), (None, None));
    }

    #[test]
    fn settings_are_read_for_the_verbs_that_use_them() {
        let words = |line: &str| {
            line.split_whitespace()
                .map(OsString::from)
                .collect::<Vec<_>>()
        };
        assert!(uses(&words("gauntlet teleop --glove a")));
        for other in [
            "gauntlet",
            "gauntlet settings",
            "gauntlet simulate",
            "gauntlet teleop --help",
        ] {
            assert!(!uses(&words(other)), "{other}");
        }
    }
}
