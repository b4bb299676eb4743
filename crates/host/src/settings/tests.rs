use super::*;

fn parse(text: &str) -> Result<Settings, Failure> {
    Settings::parse(Path::new("s.toml"), text)
}

fn told(text: &str) -> (String, String) {
    let failure = parse(text).unwrap_err();
    assert_eq!(failure.exit_code(), crate::failure::EXIT_USAGE);
    (failure.to_string(), failure.next_step())
}

#[test]
fn the_whole_is_a_file_that_gives_nothing_and_with_every_line_taken_in_gives_every_key() {
    let text = Settings::default().to_toml();
    assert_eq!(parse(&text).unwrap(), Settings::default());
    let full: String = text
        .lines()
        .map(|line| {
            let bare = line
                .strip_prefix("# ")
                .filter(|bare| bare.contains(" = ") && !bare.contains("hand = \"left\""));
            format!("{}\n", bare.unwrap_or(line))
        })
        .collect();
    let full = parse(&full).unwrap();
    for key in KEYS {
        assert!(full.given(key.name).is_some(), "{}", key.name);
        let default = key.default();
        assert!(
            default.is_none() || full.value(key.name) == default,
            "{}",
            key.name
        );
        assert!(text.contains(key.help) && SECTIONS.contains(&key.section()));
    }
    assert_eq!(parse(&full.to_toml()).unwrap(), full);
}

#[test]
fn what_the_file_gives_counts_and_the_rest_is_the_default() {
    let settings =
        parse("[gripper]\nport = \"tcp:10.0.0.7\"\nspeed = 100\n[keys]\nend = \"x\"").unwrap();
    assert_eq!(settings.value("gripper.speed"), Some(Value::Whole(100)));
    assert_eq!(settings.value("gripper.force"), Some(Value::Whole(64)));
    assert_eq!(settings.value("glove.port"), None);
    assert!(settings.is_network());
    assert_eq!(parse("").unwrap(), Settings::default());
}

#[test]
fn a_key_that_there_is_not_is_refused_by_name_with_the_nearest_one() {
    for (text, what, next) in [
        (
            "[glove]\nprot = \"a\"",
            "`glove.prot`",
            "glove.port, if that is meant",
        ),
        ("[gripper]\nspede = 1", "`gripper.spede`", "gripper.speed,"),
        ("[glove]\nspeed = 1", "`glove.speed`", "gripper.speed,"),
        ("[grippper]\nspeed = 1", "[grippper]", "[gripper],"),
        ("speed = 1", "`speed` stands outside", "below [gripper]"),
        (
            "[glove]\nentirely_else = 1",
            "`glove.entirely_else`",
            "`gauntlet settings`",
        ),
    ] {
        let (told, step) = told(text);
        assert!(
            told.starts_with("s.toml: ") && told.contains(what),
            "{told}"
        );
        assert!(step.contains(next), "{step}");
    }
}

#[test]
fn a_value_out_of_its_range_is_refused_with_key_value_and_range() {
    for (text, what) in [
        (
            "[gripper]\nspeed = 256",
            "gripper.speed = 256 is out of range: 0 to 255",
        ),
        (
            "[gripper]\nspeed = 1.5",
            "gripper.speed = 1.5 is no whole number",
        ),
        (
            "[gripper]\nmodel = \"4f\"",
            "gripper.model = \"4f\" is none of 3f, 2f85",
        ),
        (
            "[glove]\nbaud = 57600",
            "glove.baud = 57600 is none of 115200, 230400, 460800",
        ),
        ("[glove]\nport = \"\"", "glove.port = \"\" is no text"),
        ("[glove]\nport = 7", "glove.port = 7 is no text"),
        ("[keys]\nend = \"qq\"", "keys.end = \"qq\" is no key"),
        (
            "[gripper]\nport = \"tcp:a\"\nbaud = 9600",
            "gripper.baud = 9600 is of no use",
        ),
        (
            "[keys]\nend = \"c\"",
            "keys.calibrate and keys.end are one key",
        ),
        ("[gripper]\nspeed = ", "line 2: "),
        ("[gripper\nspeed = 1", "line 1: "),
    ] {
        let (told, step) = told(text);
        assert!(told.contains(what), "{told}");
        assert!(!step.is_empty());
    }
}

#[test]
fn no_file_means_the_defaults() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("settings.toml");
    assert_eq!(Settings::read(&path).unwrap(), Settings::default());
    std::fs::write(&path, "[glove]\nport = \"/dev/g\"").unwrap();
    let read = Settings::read(&path).unwrap();
    assert_eq!(
        read.given("glove.port"),
        Some(&Value::Text("/dev/g".to_owned()))
    );
}
