//! Lines and servers that spoil answers: `doctor` tells each as what it is, with a next step that can be pasted, and ends
//! by itself whatever comes.

use crate::pasted;
use crate::support;

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use rig::gripper::{Config, VirtualGripper};
use support::devices::{Echoing, Scripted, behind_pty, glove, gripper};
use support::lines::{Babble, Both, Pieces, Shaped, answering, at_once, network, right_answer};
use support::{run, text};

/// Exit code, what is wrong (a line each), and all that was said.
fn doctor(arguments: &[&str]) -> (Option<i32>, Vec<String>, String) {
    let output = run(&[&["doctor", "--json"], arguments].concat());
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let findings = said["devices"][0]["findings"].as_array().unwrap();
    pasted::can_be_typed(findings);
    let wrong = findings
        .iter()
        .filter(|finding| finding["verdict"] == "wrong");
    let wrong = wrong.map(|f| format!("{}: {} try: {}", f["layer"], f["what"], f["try"]));
    (output.status.code(), wrong.collect(), said.to_string())
}

/// The one thing that is wrong.
fn the_wrong_thing(option: &str, path: &str) -> String {
    let (code, wrong, said) = doctor(&[option, path]);
    assert_eq!((code, wrong.len()), (Some(1), 1), "{said}");
    println!("{}", wrong[0]);
    wrong[0].clone()
}

fn contains(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "no {word:?} in: {text}");
    }
}

/// A healthy gripper behind a line that gives its replies this shape.
fn shaped(
    shape: impl FnMut(Vec<u8>) -> Pieces + Send + 'static,
) -> (VirtualGripper, rig::pty::Handle, String) {
    let gripper = VirtualGripper::new(Config::default());
    gripper.preset_active();
    let (handle, path) = behind_pty(Shaped::new(gripper.clone(), shape));
    (gripper, handle, path)
}

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// The command between the first backticks, run as it is but for the program's name.
fn pasted(wrong: &str) -> std::process::Output {
    let command = wrong.split('`').nth(1).unwrap();
    let words: Vec<&str> = command.split(' ').collect();
    assert_eq!(words[0], "gauntlet", "{wrong}");
    run(&words[1..])
}

#[test]
fn answers_that_come_late_are_told_with_the_patience_that_helps() {
    let (gripper, _handle, path) = shaped(|frame| vec![(ms(60), frame)]);
    let wrong = the_wrong_thing("--gripper", &path);
    contains(
        &wrong,
        &["answers come late", "25 ms are waited for", "8 of 8"],
    );
    let output = pasted(&wrong);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let (code, wrong, said) = doctor(&["--gripper", &path, "--patience", "200"]);
    assert_eq!((code, wrong.len()), (Some(0), 0), "{said}");
    assert_eq!(gripper.writes(), 0);
}

#[test]
fn a_byte_before_each_frame_is_a_bus_without_bias() {
    for extra in [0x00, 0xFF] {
        let (_gripper, _handle, path) =
            shaped(move |frame| at_once([&[extra][..], &frame].concat()));
        let wrong = the_wrong_thing("--gripper", &path);
        contains(
            &wrong,
            &["one extra byte", "8 of 8 good answers", "shifted", "bias"],
        );
        contains(&wrong, &[&format!("({extra:02X})")]);
    }
}

#[test]
fn bytes_after_each_frame_are_told_and_do_no_harm() {
    let (_gripper, _handle, path) = shaped(|frame| at_once([&frame[..], &[0, 0, 0]].concat()));
    let (code, _, said) = doctor(&["--gripper", &path]);
    assert_eq!(code, Some(0), "{said}");
    contains(
        &said,
        &["3 bytes (00 00 00) follow 8 of 8 answers", "it works"],
    );
}

#[test]
fn what_is_missing_from_each_answer_is_named() {
    let (_gripper, _handle, path) = shaped(|frame| at_once(frame[1..].to_vec()));
    contains(
        &the_wrong_thing("--gripper", &path),
        &["the first byte of each answer is missing", "direction"],
    );
    let (_gripper, _handle, path) = shaped(|mut frame| {
        frame.truncate(frame.len() - 3);
        at_once(frame)
    });
    contains(
        &the_wrong_thing("--gripper", &path),
        &["ended after 8 of 11 bytes"],
    );
    let (_gripper, _handle, path) = shaped(|mut frame| {
        frame[4] ^= 0x20;
        at_once(frame)
    });
    contains(
        &the_wrong_thing("--gripper", &path),
        &["with a wrong CRC", "ground"],
    );
}

#[test]
fn one_bad_answer_in_eight_is_no_fault_and_one_good_one_is_no_health() {
    let mut count = 0;
    let (_gripper, _handle, path) = shaped(move |mut frame| {
        count += 1;
        frame[3] ^= u8::from(count % 8 == 3);
        at_once(frame)
    });
    let (code, _, said) = doctor(&["--gripper", &path]);
    assert_eq!(code, Some(0), "{said}");
    let mut count = 0;
    let (_gripper, _handle, path) = shaped(move |mut frame| {
        count += 1;
        frame[3] ^= u8::from(count % 8 != 1);
        at_once(frame)
    });
    let (code, wrong, said) = doctor(&["--gripper", &path]);
    assert_eq!(code, Some(1), "{said}");
    contains(&wrong.join("\n"), &["only 1 of ", "with a wrong CRC"]);
}

#[test]
fn two_devices_that_answer_to_one_question_are_told() {
    // One after the other, as on a bus where the second waits for the first.
    let (_gripper, _handle, path) = shaped(|frame| at_once([&frame[..], &frame].concat()));
    contains(
        &the_wrong_thing("--gripper", &path),
        &["two devices answer as unit 9", "8 of 8"],
    );
    // One that answers whatever unit is asked.
    let other = Scripted::new(|asked: &[u8]| {
        let count = 2 * asked.get(5).copied().unwrap_or(0);
        let mut reply = vec![7, 3, count];
        reply.resize(3 + usize::from(count), 0);
        reply.extend(host::gripper::rtu::crc16(&reply).to_le_bytes());
        reply
    });
    let gripper = VirtualGripper::new(Config::default());
    let late = Shaped::new(other, |frame| vec![(ms(8), frame)]);
    let (_handle, path) = behind_pty(Both(gripper, late));
    let (_, wrong, said) = doctor(&["--gripper", &path]);
    assert!(!wrong.is_empty(), "{said}");
    contains(&wrong[0], &["unit 7 answers too, although unit 9 is asked"]);
}

#[test]
fn a_line_that_never_falls_silent_is_told_by_a_doctor_that_ends_before_it_does() {
    let cases: [(&[u8], Duration, &str); 3] = [
        (b"I (1234) wifi: connected\r\n", ms(3), "wifi"),
        (&[0x5A, 0xA5, 0x13], ms(2), "5A A5 13"),
        // A byte now and then keeps a silence from ever coming.
        (&[0x41], ms(15), "without being asked"),
    ];
    for (bytes, pause, words) in cases {
        let babble = Babble::new(bytes, pause);
        let said = Arc::clone(&babble.said);
        let (_handle, path) = behind_pty(babble);
        for option in ["--gripper", "--glove"] {
            let wrong = the_wrong_thing(option, &path);
            contains(&wrong, &["bytes come without being asked", words]);
            // It still talks: no silence is what the doctor waited for.
            let before = said.load(Ordering::Relaxed);
            std::thread::sleep(ms(500));
            assert!(said.load(Ordering::Relaxed) > before, "{option}");
        }
    }
}

#[test]
fn a_glove_line_that_echoes_is_told() {
    let echo = Scripted::new(|asked: &[u8]| asked.to_vec());
    let (_handle, path) = behind_pty(echo);
    let wrong = the_wrong_thing("--glove", &path);
    contains(
        &wrong,
        &["only the adapter's own echo comes back", "TX and RX"],
    );
    let (glove, _own, _) = glove(115_200);
    let (_handle, path) = behind_pty(Echoing(glove, VecDeque::new()));
    let (code, wrong, said) = doctor(&["--glove", &path]);
    assert_eq!(code, Some(1), "{said}");
    contains(&wrong[0], &["the adapter gives back what it is given"]);
}

#[test]
fn the_options_of_the_line_are_asked_with_and_named_in_the_next_step() {
    let config = Config {
        unit: 12,
        baud: 57_600,
        ..Config::default()
    };
    let (_gripper, _handle, path) = gripper(config);
    let line = ["--gripper", &path, "--unit", "12", "--baud", "57600"];
    let (code, _, said) = doctor(&line);
    assert_eq!(code, Some(0), "{said}");
    contains(
        &said,
        &[&format!(
            "gauntlet gripper activate --gripper {path} --baud 57600 --unit 12"
        )],
    );
    let (code, wrong, said) = doctor(&[&line[..], &["--gripper-model", "2f85"]].concat());
    assert_eq!((code, wrong.len()), (Some(1), 1), "{said}");
    contains(&wrong[0], &["a 3-Finger gripper answers, not a 2F-85"]);
}

#[test]
fn a_speed_for_a_network_and_a_unit_that_no_line_has_are_wrong_usage() {
    let refused = |arguments: &[&str]| {
        let output = run(&[&["doctor"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
        text(&output.stderr)
    };
    let said = refused(&["--gripper", "tcp:127.0.0.1:1", "--baud", "9600"]);
    contains(&said, &["--baud 9600", "no baud rate", "without --baud"]);
    let said = refused(&["--gripper", "/dev/ttyUSB_none", "--unit", "0"]);
    contains(&said, &["--unit 0", "1 to 247"]);
}

/// What `doctor` finds wrong with a server whose every answer has this shape.
fn over_network(answer: fn(&[u8; 12]) -> Pieces) -> String {
    let place = network(move |_, stream| answering(stream, answer));
    the_wrong_thing("--gripper", &place)
}

#[test]
fn a_server_without_transaction_numbers_is_told_by_several_exchanges_on_one_connection() {
    let wrong = over_network(|request| {
        let mut reply = right_answer(request);
        reply[..2].copy_from_slice(&[0, 1]);
        at_once(reply)
    });
    contains(
        &wrong,
        &["keeps no transaction numbers", "6 of 6", "(1 for "],
    );
    // The first answer of each connection is right.
    let place = network(|_, stream| {
        let first = std::cell::Cell::new(None);
        answering(stream, |request| {
            let number = first.get().unwrap_or([request[0], request[1]]);
            first.set(Some(number));
            let mut reply = right_answer(request);
            reply[..2].copy_from_slice(&number);
            at_once(reply)
        });
    });
    let (code, wrong, said) = doctor(&["--gripper", &place]);
    assert_eq!(code, Some(1), "{said}");
    assert!(!said.contains("no fault, "), "{said}");
    println!("{wrong:?}");
}

#[test]
fn a_server_of_one_client_is_told_as_such() {
    let served = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let counter = served.clone();
    let place = network(move |_, stream| {
        use std::sync::atomic::Ordering;
        if counter.fetch_add(1, Ordering::SeqCst) == 0 {
            answering(stream, |request| at_once(right_answer(request)));
        } else {
            answering(stream, |_| Vec::new());
        }
        counter.fetch_sub(1, Ordering::SeqCst);
    });
    let (code, _, said) = doctor(&["--gripper", &place]);
    assert_eq!(code, Some(0), "{said}");
    contains(&said, &["serves one program at a time"]);
    // While somebody else has it, nothing else is blamed.
    let mut address = place.trim_start_matches("tcp:").split(':');
    let (host, port) = (address.next().unwrap(), address.next().unwrap());
    let being_served = |count: usize| {
        let end = std::time::Instant::now() + ms(60_000);
        while served.load(std::sync::atomic::Ordering::SeqCst) != count {
            assert!(std::time::Instant::now() < end, "never {count} served");
            std::thread::sleep(ms(1));
        }
    };
    being_served(0);
    let _other = std::net::TcpStream::connect((host, port.parse().unwrap())).unwrap();
    being_served(1);
    let wrong = the_wrong_thing("--gripper", &place);
    contains(
        &wrong,
        &[
            "it accepts, but no answer comes",
            "one at a time",
            "ss -tnp",
        ],
    );
}

#[test]
fn headers_without_bodies_foreign_frames_and_late_answers_are_told_apart() {
    let header_alone =
        |request: &[u8; 12]| at_once([&request[..4], &[0, 1], &request[6..7]].concat());
    contains(
        &over_network(header_alone),
        &["a header without a body (length 1)"],
    );
    let endless = |request: &[u8; 12]| {
        at_once([&request[..4], &[0xFF, 0xFF], &request[6..8], &[0; 9]].concat())
    };
    contains(&over_network(endless), &["promises 65535 bytes"]);
    let cut = |request: &[u8; 12]| at_once(right_answer(request)[..12].to_vec());
    contains(
        &over_network(cut),
        &["only a part of an answer", "of the 19 bytes"],
    );
    let refused = |request: &[u8; 12]| {
        at_once([&request[..4], &[0, 3], &request[6..7], &[0x84, 0x0B]].concat())
    };
    contains(&over_network(refused), &["exception 0B"]);
    let late = |request: &[u8; 12]| vec![(ms(400), right_answer(request))];
    contains(
        &over_network(late),
        &["answers come late", "200 ms are waited for", "--patience"],
    );
    let very_late = |request: &[u8; 12]| vec![(ms(1_300), right_answer(request))];
    contains(
        &over_network(very_late),
        &["answers come late: more than a second"],
    );
    let other_unit = |request: &[u8; 12]| {
        let mut reply = right_answer(request);
        reply[6] = 0;
        at_once(reply)
    };
    contains(
        &over_network(other_unit),
        &["come from unit 0, not from unit 2"],
    );
}

#[test]
fn a_serial_device_server_is_no_modbus_tcp_and_told_as_such() {
    use std::io::{Read, Write};
    let place = network(|_, mut stream| {
        let mut bytes = [0; 64];
        while let Ok(count @ 1..) = stream.read(&mut bytes) {
            let asked = &bytes[..count];
            let crc = host::gripper::rtu::crc16(&asked[..count - 2]).to_le_bytes();
            if asked[0] != 9 || asked[count - 2..] != crc {
                continue;
            }
            let mut reply = vec![9, 3, 2, 0x31, 0];
            reply.extend(host::gripper::rtu::crc16(&reply).to_le_bytes());
            stream.write_all(&reply).unwrap();
        }
    });
    let wrong = the_wrong_thing("--gripper", &place);
    contains(&wrong, &["serial device server", "socat pty,link="]);
}

#[test]
fn teleop_and_doctor_say_the_same_of_a_late_line_and_of_exchanged_ports() {
    let (_gripper, _handle, path) = shaped(|frame| vec![(ms(300), frame)]);
    let (glove, _own, glove_path) = glove(115_200);
    let teleop = |gripper: &str, glove: &str| {
        let model = support::model().to_str().unwrap();
        let output = run(&[
            "teleop",
            "--glove",
            glove,
            "--gripper",
            gripper,
            "--model",
            model,
        ]);
        assert_eq!(output.status.code(), Some(1));
        text(&output.stderr)
    };
    contains(
        &teleop(&path, &glove_path),
        &["answers come late", "--patience"],
    );
    contains(&teleop(&glove_path, &path), &["this is the glove's port"]);
    drop(glove);
}

#[test]
fn a_register_of_the_glove_that_reads_back_otherwise_is_named_by_doctor_and_teleop() {
    let odd = || {
        Scripted::new(|asked: &[u8]| match asked {
            [0x52, 0x0A, 0x50] => vec![0xF0],
            [0x57, 0x07, ..] => vec![0x05, 0x13, 0x07],
            _ => Vec::new(),
        })
    };
    let (_handle, path) = behind_pty(odd());
    let words = [
        "I2CClkH (0x08) reads back otherwise",
        "wrote 0x05, read 0x13",
    ];
    contains(&the_wrong_thing("--glove", &path), &words);
    let (_gripper, _own, gripper_path) = shaped(at_once);
    let model = support::model().to_str().unwrap();
    let ports = ["teleop", "--glove", &path, "--gripper", &gripper_path];
    let output = run(&[&ports[..], &["--model", model]].concat());
    assert_eq!(output.status.code(), Some(1));
    contains(&text(&output.stderr), &words);
}

#[test]
fn teleop_refuses_a_map_that_does_not_fit_the_gripper_before_it_opens_a_port() {
    let model = support::model().to_str().unwrap();
    let options = ["--model", model, "--gripper-model", "hande"];
    let ports = ["teleop", "--glove", "/dev/a", "--gripper", "/dev/b"];
    let output = run(&[&ports[..], &options].concat());
    assert_eq!(output.status.code(), Some(1));
    contains(
        &text(&output.stderr),
        &["gives 4 positions", "Hand-E", "--gripper-model 3f"],
    );
}
