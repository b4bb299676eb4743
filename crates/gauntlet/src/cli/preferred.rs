//! The settings file as defaults of the command line: what is typed wins.

use std::ffi::OsString;

use clap::{Arg, ArgAction};
use host::settings::Settings;

/// An option, the setting behind it, and the verbs that have it from there.
type Behind = (&'static str, &'static str, &'static [&'static str]);

/// The verbs that read a glove at a port.
const GLOVES: &[&str] = &["teleop", "calibrate", "record", "glove", "doctor", "train"];
/// The same, and that of the virtual one.
const READ: &[&str] = &[
    "teleop",
    "calibrate",
    "record",
    "glove",
    "doctor",
    "demo",
    "train",
];
/// The verbs that talk to a gripper at a port.
const GRIPPERS: &[&str] = &["teleop", "gripper", "doctor"];
/// The verbs for which it matters what moves.
const MODELS: &[&str] = &["teleop", "gripper", "doctor", "train", "demo", "simulate"];

const BEHIND: &[Behind] = &[
    ("glove", "glove.port", GLOVES),
    ("glove-baud", "glove.baud", READ),
    ("status-check", "glove.status_check", READ),
    ("sensor-mode", "glove.mode", READ),
    (
        "hand",
        "glove.hand",
        &["teleop", "calibrate", "record", "glove", "train"],
    ),
    ("gripper", "gripper.port", GRIPPERS),
    ("gripper-model", "gripper.model", MODELS),
    ("unit", "gripper.unit", GRIPPERS),
    ("baud", "gripper.baud", GRIPPERS),
    ("patience", "gripper.patience_ms", GRIPPERS),
    ("speed", "gripper.speed", &["teleop", "gripper"]),
    ("force", "gripper.force", &["teleop", "gripper"]),
    ("rate", "gripper.rate", &["teleop"]),
    ("safe-action", "gripper.safe_action", &["teleop"]),
    ("bridge", "bridge.port", &["bridge", "flash"]),
    ("model", "teleop.model", &["teleop", "eval"]),
    ("find-flat", "teleop.find_flat", &["teleop"]),
];

/// What `gauntlet` alone does.
const ALONE: &str = "demo";

/// The command line with the verb that it stands for.
pub fn whole(words: &[OsString]) -> Vec<OsString> {
    let mut words = words.to_vec();
    if words.len() == 1 {
        words.push(ALONE.into());
    }
    words
}

/// Whether a command line uses settings.
pub fn uses(words: &[OsString]) -> bool {
    let verb = words.get(1).and_then(|word| word.to_str());
    let has = |verb: &str| BEHIND.iter().any(|(_, _, verbs)| verbs.contains(&verb));
    verb.is_some_and(has) && !words.iter().any(|word| word == "--help" || word == "-h")
}

/// The command line `command` with the settings as its defaults, for what was typed.
pub fn with(mut command: clap::Command, settings: &Settings, typed: &[OsString]) -> clap::Command {
    let verbs: Vec<String> = command
        .get_subcommands()
        .map(|verb| verb.get_name().to_owned())
        .collect();
    for verb in &verbs {
        let typed = Typed { verb, words: typed };
        command = command.mut_subcommand(verb, |command| below(command, settings, typed));
    }
    command
}

fn below(command: clap::Command, settings: &Settings, typed: Typed<'_>) -> clap::Command {
    let names: Vec<String> = command
        .get_subcommands()
        .map(|sub| sub.get_name().to_owned())
        .collect();
    let mut command = command.mut_args(|arg| match preferred(&arg, settings, typed) {
        Some(value) => arg.default_value(value).required(false),
        None => arg,
    });
    for name in names {
        command = command.mut_subcommand(name, |sub| below(sub, settings, typed));
    }
    command
}

/// What was typed, as a verb sees it.
#[derive(Debug, Clone, Copy)]
struct Typed<'a> {
    verb: &'a str,
    words: &'a [OsString],
}

impl Typed<'_> {
    /// Whether an option stands in it.
    fn names(&self, option: &str) -> bool {
        self.words.iter().any(|word| {
            let word = word.to_string_lossy();
            word == option || word.starts_with(&format!("{option}="))
        })
    }
}

/// What the file gives for an option of these words.
fn preferred(arg: &Arg, settings: &Settings, typed: Typed<'_>) -> Option<String> {
    let long = arg.get_long()?;
    // A flag takes no value; what a positional word means is the verb's own.
    if !matches!(arg.get_action(), ArgAction::Set) {
        return None;
    }
    let behind = |(option, _, verbs): &&Behind| *option == long && verbs.contains(&typed.verb);
    let (_, key, _) = BEHIND.iter().find(behind)?;
    let gripper = typed.names("--gripper");
    match (typed.verb, long) {
        // A glove is worn under --live alone, and may be one of a bridge.
        ("train", "glove" | "hand") if !typed.names("--live") || typed.names("--bridge") => {
            return None;
        }
        // Who names one device asks about that one alone.
        ("doctor", "glove" | "gripper") if typed.names("--glove") || gripper => return None,
        // About a named gripper's family it is asked to find out.
        ("doctor", "gripper-model") if settings.given("gripper.port").is_none() && !gripper => {
            return None;
        }
        // There is no gripper then.
        ("simulate", "gripper-model") if typed.names("--glove") && !gripper => return None,
        // The firmware is for one gripper.
        ("demo", "gripper-model") if typed.names("--on-chip") => return None,
        // Unit and speed of a serial line are none of one on the network, and the other way round.
        (_, "unit" | "baud") if gripper => {
            let mut words = typed.words.iter();
            let network = words.any(|word| word.to_string_lossy().contains("tcp:"));
            if network != settings.is_network() {
                return None;
            }
        }
        _ => {}
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
        let pair = Some(host::lines::Model::TwoFinger85);
        assert_eq!(simulate.gripper_model, pair, "as teleop expects it");
        for alone in [
            "--glove /tmp/g",
            "--gripper-model 3f --glove /tmp/g --gripper /tmp/r",
        ] {
            let Verb::Simulate(simulate) =
                parse(FILE, &format!("gauntlet simulate {alone}")).unwrap()
            else {
                panic!("simulate");
            };
            assert_ne!(simulate.gripper_model, pair, "{alone}");
        }
    }

    #[test]
    fn a_map_is_taught_with_this_person_s_glove_and_only_then_a_port_is_meant() {
        let glove = |line: &str| {
            let Verb::Train(train) = parse(FILE, line).unwrap() else {
                panic!("train");
            };
            train.worn.glove.clone()
        };
        assert_eq!(
            glove("gauntlet train --out m --live").as_deref(),
            Some(Path::new("/dev/g"))
        );
        assert_eq!(glove("gauntlet train --out m --live --bridge /dev/b"), None);
        assert_eq!(glove("gauntlet train --out m --poses p.csv"), None);
    }

    #[test]
    fn gauntlet_alone_is_the_demo_with_this_person_s_settings() {
        let typed = whole(&["gauntlet".into()]);
        assert_eq!(typed, ["gauntlet", "demo"]);
        let Verb::Demo(demo) = parse(FILE, "gauntlet demo").unwrap() else {
            panic!("demo");
        };
        assert_eq!(demo.gripper_model, host::lines::Model::TwoFinger85);
        let Verb::Demo(demo) = parse(FILE, "gauntlet demo --on-chip").unwrap() else {
            panic!("demo");
        };
        assert_eq!(demo.gripper_model, host::lines::Model::ThreeFinger);
    }

    /// Options that mean another thing than the setting of their name, or that a setting would only harm.
    const OTHERS: &[(&str, &str, &str)] = &[
        ("train", "rate", "the learning rate"),
        (
            "simulate",
            "glove",
            "where a virtual one is made, never a real port",
        ),
        (
            "simulate",
            "gripper",
            "where a virtual one is made, never a real port",
        ),
        (
            "calibrate",
            "bridge",
            "a glove at a port is meant where nothing is said",
        ),
        ("train", "bridge", "a port is opened by --live alone"),
        ("report", "model", "what the page is about"),
        ("replay", "speed", "of the replay, no gripper's"),
        ("replay", "model", "what the log is held against"),
        ("replay", "force", "what the log is held against"),
        ("replay", "rate", "what the log is held against"),
        ("replay", "safe-action", "what the log is held against"),
    ];

    /// Options that are nobody's preference: what a run is about, or how it is told.
    const NEVER: &[&str] = &[
        "activate",
        "alpha",
        "as-they-sit",
        "calibrate",
        "calibrate-flat",
        "checkpoint",
        "closing",
        "commands",
        "cost",
        "dim",
        "ends-with",
        "engage",
        "epochs",
        "epsilon",
        "finish",
        "firmware",
        "flat",
        "force",
        "forget",
        "gripper-speed",
        "gripper-tcp",
        "hidden",
        "hold-out",
        "ideal",
        "input",
        "int16",
        "json",
        "keep-anyway",
        "lambda",
        "left",
        "list",
        "live",
        "log",
        "no-start-pairs",
        "normal",
        "normalise",
        "on-chip",
        "open",
        "openxr",
        "out",
        "pairs",
        "pairs-file",
        "poses",
        "profile",
        "quick",
        "raw",
        "resume",
        "schedule",
        "seconds",
        "seed",
        "seeds",
        "show-on",
        "starts",
        "stop-at",
        "swap",
        "target",
        "threads",
        "to",
        "trust-model",
        "truth",
        "undo",
        "view",
        "view-address",
        "volume",
        "write",
    ];

    fn options(command: &clap::Command, into: &mut Vec<(String, bool)>) {
        for arg in command.get_arguments() {
            let valued = matches!(arg.get_action(), ArgAction::Set);
            into.extend(arg.get_long().map(|long| (long.to_owned(), valued)));
        }
        command.get_subcommands().for_each(|sub| options(sub, into));
    }

    #[test]
    fn every_option_of_every_verb_has_its_setting_or_is_known_to_have_none() {
        let command = Cli::command();
        let mut undecided = Vec::new();
        let mut had = std::collections::BTreeSet::new();
        for verb in command.get_subcommands() {
            let name = verb.get_name();
            let mut all = Vec::new();
            options(verb, &mut all);
            for (long, valued) in all.iter().filter(|(long, _)| long != "help") {
                let behind = BEHIND.iter().find(|(option, ..)| option == long);
                let from_file = behind.is_some_and(|(.., verbs)| verbs.contains(&name));
                let other = OTHERS.iter().any(|(v, o, _)| (*v, *o) == (name, long));
                let never = NEVER.contains(&long.as_str());
                assert!(!(from_file && other), "{name} --{long}");
                match (valued, behind) {
                    (true, Some(_)) if from_file || other => had.insert((name, long.clone())),
                    (_, None) if never => continue,
                    // A flag of an option's name: `train --force` against what presses.
                    (false, Some(_)) if never => continue,
                    _ => {
                        undecided.push(format!("{name} --{long}"));
                        continue;
                    }
                };
            }
        }
        assert!(undecided.is_empty(), "settings or not? {undecided:?}");
        // And none in the table that is no option.
        for (option, _, verbs) in BEHIND {
            for verb in *verbs {
                assert!(
                    had.contains(&(verb, (*option).to_owned())),
                    "{verb} --{option}"
                );
            }
        }
    }

    #[test]
    fn every_key_but_the_keyboard_s_is_behind_an_option_that_takes_all_its_values() {
        use host::settings::{KEYS, Kind};
        for key in KEYS.iter().filter(|key| key.kind != Kind::Key) {
            let (option, _, verbs) = BEHIND
                .iter()
                .find(|(_, behind, _)| *behind == key.name)
                .unwrap_or_else(|| panic!("{} is of no use", key.name));
            let values: Vec<String> = match key.kind {
                Kind::Whole(least, most) => vec![least.to_string(), most.to_string()],
                Kind::OneOf(numbers) => numbers.iter().map(i64::to_string).collect(),
                Kind::Choice(words) => words.iter().map(|word| format!("\"{word}\"")).collect(),
                _ if key.example.is_empty() => vec![key.default.to_owned()],
                _ => vec![key.example.to_owned()],
            };
            assert!(key.help.contains(&format!("--{option}")), "{}", key.name);
            for (verb, value) in verbs
                .iter()
                .flat_map(|v| values.iter().map(move |x| (v, x)))
            {
                let (section, name) = key.name.split_once('.').unwrap();
                let file = format!("[{section}]\n{name} = {value}\n");
                // About a family `doctor` asks where a gripper is named.
                let line = match (*verb, *option) {
                    ("doctor", "gripper-model") => "gauntlet doctor --gripper /dev/r".to_owned(),
                    // A port is opened by --live alone.
                    ("train", "glove" | "hand") => "gauntlet train --live".to_owned(),
                    _ => format!("gauntlet {verb}"),
                };
                let settings = Settings::parse(Path::new("s.toml"), &file).unwrap();
                let typed: Vec<OsString> = line.split_whitespace().map(OsString::from).collect();
                let command = with(Cli::command(), &settings, &typed);
                command.clone().debug_assert();
                let verb = command.find_subcommand(verb).unwrap();
                assert!(
                    takes(verb, option),
                    "{} --{option}: {file}",
                    verb.get_name()
                );
            }
        }
    }

    /// Whether an option of a verb, or of one below it, takes its default.
    fn takes(command: &clap::Command, option: &str) -> bool {
        let named = |arg: &&Arg| arg.get_long() == Some(option);
        let here = command.get_arguments().find(named).is_some_and(|arg| {
            let value = arg.get_default_values().first().cloned();
            let alone = Arg::new("alone")
                .value_parser(arg.get_value_parser().clone())
                .default_value(value.unwrap_or_default());
            let alone = clap::Command::new("alone").arg(alone);
            alone.try_get_matches_from(["alone"]).is_ok()
        });
        here || command.get_subcommands().any(|sub| takes(sub, option))
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
            "gauntlet ports",
            "gauntlet teleop --help",
        ] {
            assert!(!uses(&words(other)), "{other}");
        }
    }
}
