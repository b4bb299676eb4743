//! `gauntlet doctor`: every layer that can fail is named, with what to do about it.

use crate::pasted;
use crate::support;

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::TcpListener;

use rig::gripper::{Config, Family, VirtualGripper};
use support::devices::{Echoing, Scripted, behind_pty, glove, gripper, silent_port};
use support::{command, finish, interrupt, run, text};

/// Exit code and the JSON it prints.
fn doctor(option: &str, path: &str) -> (Option<i32>, serde_json::Value) {
    let output = run(&["doctor", option, path, "--json"]);
    let said = serde_json::from_slice(&output.stdout).unwrap();
    (output.status.code(), said)
}

/// The findings that are wrong, one a line: `layer: what try: next`.
fn wrongs(said: &serde_json::Value) -> Vec<String> {
    let findings = said["devices"][0]["findings"].as_array().unwrap();
    pasted::can_be_typed(findings);
    let wrong = findings.iter().filter(|f| f["verdict"] == "wrong");
    let word = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
    wrong
        .map(|f| {
            format!(
                "{}: {} try: {}",
                word(&f["layer"]),
                word(&f["what"]),
                word(&f["try"])
            )
        })
        .collect()
}

/// What is the one thing that is wrong?
fn the_wrong_thing(option: &str, path: &str) -> String {
    let (code, said) = doctor(option, path);
    let wrong = wrongs(&said);
    assert_eq!((code, wrong.len()), (Some(1), 1), "{said:#}");
    println!("{}", wrong[0]);
    wrong[0].clone()
}

fn contains(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "no {word:?} in: {text}");
    }
}

#[test]
fn it_is_content_with_a_healthy_gripper_of_either_family_and_moves_nothing() {
    for (family, name) in [
        (Family::ThreeFinger, "3-Finger"),
        (Family::HandE, "2-Finger gripper or Hand-E"),
    ] {
        let (gripper, _handle, path) = gripper(Config::of(family));
        let (code, said) = doctor("--gripper", &path);
        assert_eq!((code, &said["wrong"]), (Some(0), &0.into()), "{said:#}");
        contains(&said.to_string(), &[name, "unit 9 answers at 115200 baud"]);
        assert_eq!((gripper.writes(), gripper.motions()), (0, 0));
    }
}

#[test]
fn a_port_that_is_not_there_is_the_port() {
    let wrong = the_wrong_thing("--gripper", "/dev/ttyUSB_none");
    contains(&wrong, &["port: ", "does not exist"]);
    let wrong = the_wrong_thing("--glove", "/dev/ttyUSB_none");
    contains(&wrong, &["port: ", "does not exist"]);
}

#[test]
fn a_gripper_that_is_silent_everywhere_is_no_byte() {
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.mute(u32::MAX);
    let wrong = the_wrong_thing("--gripper", &path);
    contains(&wrong, &["line: no byte comes", "24 V", "A against B"]);
    contains(&wrong, &["5 other speeds", "units 1 to 247 at 115200"]);
    assert_eq!(gripper.writes(), 0);
}

#[test]
fn bytes_that_are_no_frames_are_told_as_such() {
    let babble = Scripted::new(|_: &[u8]| vec![0x5A; 11]);
    let (_handle, path) = behind_pty(babble);
    let wrong = the_wrong_thing("--gripper", &path);
    contains(&wrong, &["line: bytes come but no Modbus frame", "glove's"]);
}

#[test]
fn an_adapter_that_only_hears_itself_is_told_and_one_with_a_gripper_behind_it_works() {
    let deaf = VirtualGripper::new(Config::default());
    deaf.mute(u32::MAX);
    let (_handle, path) = behind_pty(Echoing(deaf, VecDeque::new()));
    let wrong = the_wrong_thing("--gripper", &path);
    contains(&wrong, &["line: only the adapter's own echo"]);
    let heard = VirtualGripper::new(Config::default());
    let (_handle, path) = behind_pty(Echoing(heard, VecDeque::new()));
    let (code, said) = doctor("--gripper", &path);
    assert_eq!(code, Some(0), "{said:#}");
    contains(&said.to_string(), &["gives back what it is given"]);
}

#[test]
fn a_device_that_refuses_is_told_with_its_exception() {
    let refusal = Scripted::new(|asked: &[u8]| {
        let mut reply = vec![asked[0], asked[1] | 0x80, 2];
        reply.extend(host::gripper::rtu::crc16(&reply).to_le_bytes());
        reply
    });
    let (_handle, path) = behind_pty(refusal);
    let wrong = the_wrong_thing("--gripper", &path);
    contains(&wrong, &["unit: ", "exception 02", "Robotiq"]);
}

#[test]
fn another_unit_is_found() {
    let config = Config {
        unit: 12,
        ..Config::default()
    };
    let (_gripper, _handle, path) = gripper(config);
    let wrong = the_wrong_thing("--gripper", &path);
    contains(&wrong, &["unit: unit 12 answers", "--unit 12"]);
}

#[test]
fn what_is_to_be_typed_for_another_unit_names_the_gripper_that_answers() {
    for (family, asked, other) in [
        (Family::ThreeFinger, "2f85", "--gripper-model 2f85"),
        (Family::HandE, "3f", "--gripper-model 3f"),
    ] {
        let (_gripper, _handle, path) = gripper(Config::of(family));
        let output = run(&[
            "doctor",
            "--gripper",
            &path,
            "--unit",
            "5",
            "--gripper-model",
            asked,
            "--json",
        ]);
        let said = serde_json::from_slice(&output.stdout).unwrap();
        let wrong = wrongs(&said);
        contains(&wrong[0], &["unit 9 answers", "gauntlet gripper status"]);
        assert!(!wrong[0].contains(other), "{}", wrong[0]);
        assert_eq!(wrong.len(), 2, "unit and kind: {wrong:#?}");
    }
}

#[test]
fn another_baud_is_found() {
    let config = Config {
        baud: 19_200,
        ..Config::default()
    };
    let (_gripper, _handle, path) = gripper(config);
    let wrong = the_wrong_thing("--gripper", &path);
    contains(&wrong, &["line: it answers at 19200 baud", "--baud 19200"]);
}

#[test]
fn another_unit_at_another_baud_is_found() {
    let config = Config {
        unit: 5,
        baud: 57_600,
        ..Config::default()
    };
    let (gripper, _handle, path) = gripper(config);
    let (code, said) = doctor("--gripper", &path);
    assert_eq!(code, Some(1));
    let wrong = wrongs(&said).join("\n");
    contains(
        &wrong,
        &["line: it answers at 57600 baud", "unit: unit 5 answers"],
    );
    contains(&wrong, &["--baud 57600 --unit 5"]);
    assert_eq!(gripper.writes(), 0);
    // What it advises works.
    let output = run(&[
        "gripper",
        "status",
        "--gripper",
        &path,
        "--baud",
        "57600",
        "--unit",
        "5",
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn every_fault_of_either_family_is_told_with_its_meaning_and_what_to_do() {
    use host::gripper::Fault;
    type Meaning = fn(u8) -> Fault;
    for (family, codes, meaning) in [
        (
            Family::ThreeFinger,
            [0x0A, 0x0D],
            Fault::three_finger as Meaning,
        ),
        (
            Family::TwoFinger85,
            [0x08, 0x0E],
            Fault::two_finger as Meaning,
        ),
    ] {
        let (gripper, _handle, path) = gripper(Config::of(family));
        gripper.preset_active();
        for code in codes {
            gripper.set_fault(Some(code));
            let wrong = the_wrong_thing("--gripper", &path);
            let fault = meaning(code);
            contains(&wrong, &["gripper: ", &format!("fault {code:02X}")]);
            contains(&wrong, &[fault.sentence(), fault.action()]);
        }
    }
}

#[test]
fn ctrl_c_ends_the_search_and_claims_nothing() {
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.mute(u32::MAX);
    let child = command(&["doctor", "--gripper", &path, "--json"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let end = std::time::Instant::now() + std::time::Duration::from_secs(60);
    while gripper.requests().0 < 2 {
        assert!(std::time::Instant::now() < end, "the search did not begin");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    interrupt(&child);
    let output = finish(child);
    let said = text(&output.stdout);
    contains(&said, &["interrupted"]);
    assert!(!said.contains("no byte comes"), "{said}");
    assert_eq!(
        output.status.code(),
        Some(1),
        "an unfinished search is no health"
    );
}

/// A Modbus TCP server that knows one unit and answers its reads with zeros.
fn network_unit(unit: u8) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            std::thread::spawn(move || {
                let mut request = [0; 12];
                while stream.read_exact(&mut request).is_ok() {
                    if request[6] == unit {
                        let mut reply = request[..4].to_vec();
                        reply.extend([0, 19, unit, request[7], 16]);
                        reply.extend([0; 16]);
                        stream.write_all(&reply).unwrap();
                    }
                }
            });
        }
    });
    format!("tcp:{address}")
}

#[test]
fn on_the_network_nobody_another_unit_and_a_fault_are_told_apart() {
    let free = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let wrong = the_wrong_thing("--gripper", &format!("tcp:{free}"));
    contains(&wrong, &["connection: ", "refused"]);
    let (code, said) = doctor("--gripper", &network_unit(9));
    assert_eq!(code, Some(1));
    contains(
        &wrongs(&said).join("\n"),
        &["unit: unit 9 answers, not unit 2", "--unit 9"],
    );
    let wrong = the_wrong_thing("--gripper", &network_unit(77));
    contains(&wrong, &["gripper: ", "no answer", "asked unit 2, then 9"]);
    let gripper = VirtualGripper::new(Config::default());
    gripper.preset_active();
    let clock = rig::Clock::system();
    let server = rig::gripper::tcp::serve(&gripper, "127.0.0.1:0", &clock).unwrap();
    let place = format!("tcp:{}", server.address());
    assert_eq!(doctor("--gripper", &place).0, Some(0));
    gripper.set_fault(Some(0x0E));
    let wrong = the_wrong_thing("--gripper", &place);
    contains(&wrong, &["fault 0E"]);
}

#[test]
fn it_is_content_with_a_whole_glove_and_names_the_sensors_that_are_missing() {
    let (_whole, _handle, whole) = glove(115_200);
    let (one, _handle_one, without_one) = glove(115_200);
    one.unplug(5, true);
    let (two, _handle_two, without_two) = glove(115_200);
    two.unplug(4, true);
    two.unplug(5, true);
    let (none, _handle_none, without_all) = glove(115_200);
    (0..16).for_each(|index| none.unplug(index, true));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let (code, said) = doctor("--glove", &whole);
            assert_eq!(code, Some(0), "{said:#}");
        });
        scope.spawn(|| {
            let wrong = the_wrong_thing("--glove", &without_one);
            contains(
                &wrong,
                &["sensors: index_middle (channel 2, address 0x29)", "COM3"],
            );
        });
        scope.spawn(|| {
            let wrong = the_wrong_thing("--glove", &without_two);
            contains(&wrong, &["both sensors of channel 2", "index_proximal"]);
            contains(&wrong, &["index_middle", "that channel's cable"]);
        });
        scope.spawn(|| {
            let wrong = the_wrong_thing("--glove", &without_all);
            contains(&wrong, &["sensors: none of the 16", "power"]);
        });
    });
}

#[test]
fn a_multiplexer_that_is_missing_or_elsewhere_is_named() {
    let (glove, _handle, path) = glove(115_200);
    glove.unplug_mux(true);
    let wrong = the_wrong_thing("--glove", &path);
    contains(
        &wrong,
        &["multiplexer: ", "TCA9548A) is missing", "I2CStat F1"],
    );
    glove.unplug_mux(false);
    glove.set_mux_address(0x73);
    let wrong = the_wrong_thing("--glove", &path);
    contains(
        &wrong,
        &["multiplexer: ", "answers at 0x73, not at 0x70", "A0"],
    );
}

#[test]
fn a_bus_that_hangs_is_named_and_not_taken_for_a_missing_multiplexer() {
    let (glove, _handle, path) = glove(115_200);
    glove.dead_bus(true);
    let wrong = the_wrong_thing("--glove", &path);
    contains(&wrong, &["bus: ", "SDA or SCL is held low"]);
}

#[test]
fn a_glove_fresh_from_power_on_is_no_fault() {
    let (_glove, _handle, path) = glove(9_600);
    let (code, said) = doctor("--glove", &path);
    assert_eq!(code, Some(0), "{said:#}");
    contains(&said.to_string(), &["9600 baud, as after power-on"]);
}

#[test]
fn no_glove_and_something_that_is_no_glove_are_told_apart() {
    let (_master, path) = silent_port();
    let wrong = the_wrong_thing("--glove", &path);
    contains(&wrong, &["bridge: no byte comes", "TX against RX"]);
    let (_handle, path) = behind_pty(Scripted::new(|_: &[u8]| vec![0x12, 0x34, 0x56]));
    let wrong = the_wrong_thing("--glove", &path);
    contains(
        &wrong,
        &["bridge: 3 bytes come at 115200 baud, but no I2CStat"],
    );
}

#[test]
fn swapped_ports_are_told() {
    let (_glove, _handle, path) = glove(115_200);
    let wrong = the_wrong_thing("--gripper", &path);
    contains(
        &wrong,
        &["line: this is the glove's port", "gauntlet ports"],
    );
    let (gripper, _handle, path) = gripper(Config::default());
    let wrong = the_wrong_thing("--glove", &path);
    contains(&wrong, &["bridge: this is the gripper's port"]);
    assert_eq!(gripper.writes(), 0);
}
