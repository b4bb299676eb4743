//! The host's end against a scripted peer that speaks frames written by hand over a socket.

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::thread::JoinHandle;

use bridge::protocol::message::{Hello, Refusal, VERSION};

use super::*;
use crate::failure::Failure;
use crate::interrupt::Interrupt;

const HELLO: Hello = Hello {
    version: VERSION,
    shape: [25, 300, 4],
    joint_order: 1,
    capacity: 100_000,
    chunk: 512,
};

/// As a person is told it.
fn failure(error: Error) -> Failure {
    error.at(&Address::Unix("/tmp/a bridge".into()))
}

/// What the peer does with a request.
enum Do {
    Answer(Result<Answer, Refusal>),
    /// Noise first, then the answer.
    Noisy(Answer),
    Ignore,
    /// A whole frame with these bytes as its message.
    Say(&'static [u8]),
    HangUp,
}

/// Sequence number and name of each request that came.
type Heard = Vec<(u16, String)>;

fn peer(path: &Path, mut script: Vec<Do>) -> JoinHandle<Heard> {
    let listener = UnixListener::bind(path).unwrap();
    script.reverse();
    std::thread::spawn(move || {
        let mut heard = Vec::new();
        while !script.is_empty() {
            let (stream, _) = listener.accept().unwrap();
            serve(stream, &mut script, &mut heard);
        }
        heard
    })
}

fn serve(mut stream: UnixStream, script: &mut Vec<Do>, heard: &mut Heard) {
    let mut decoder = Decoder::new();
    let mut byte = [0];
    // After the script it listens on, until the other end goes.
    while stream.read(&mut byte).unwrap_or(0) == 1 {
        let request = decoder.push(byte[0], |message| {
            let request: Request<'_> = postcard::from_bytes(message).unwrap();
            let call = format!("{:?}", request.call);
            let name = call.split([' ', '(']).next().unwrap().to_owned();
            (request.session, request.sequence, name)
        });
        let Some((session, sequence, name)) = request else {
            continue;
        };
        let Some(what) = script.pop() else { continue };
        heard.push((sequence, name));
        let (noise, answer) = match what {
            Do::Answer(answer) => (false, answer),
            Do::Noisy(answer) => (true, Ok(answer)),
            Do::Ignore => continue,
            Do::Say(message) => {
                send(&mut stream, message);
                continue;
            }
            Do::HangUp => return,
        };
        if noise {
            stream.write_all(&[0x11, 0xFF, 0x00, 0x07]).unwrap();
        }
        let reply = FromBridge::Reply(Reply {
            session,
            sequence,
            answer,
        });
        send(
            &mut stream,
            postcard::to_slice(&reply, &mut [0; frame::MAX_MESSAGE]).expect("room"),
        );
    }
}

fn send(stream: &mut UnixStream, message: &[u8]) {
    let mut scratch = [0; frame::SCRATCH];
    scratch[..message.len()].copy_from_slice(message);
    let mut out = [0; frame::MAX_FRAME];
    let coded = frame::encode(&mut scratch, message.len(), &mut out).expect("room");
    stream.write_all(&[0]).expect("a peer");
    stream.write_all(coded).expect("a peer");
}

fn hello() -> Do {
    Do::Answer(Ok(Answer::Hello(HELLO)))
}

fn received(bytes: u32) -> Do {
    Do::Answer(Ok(Answer::Received { bytes }))
}

fn slots(crc: u32) -> Answer {
    let image = bridge::protocol::message::SlotContents::Image {
        model_id: 1,
        version: 1,
        length: 600,
        crc,
        weights: bridge::protocol::message::WeightsKind::Float32,
    };
    Answer::Slots(Slots {
        active: Some(1),
        contents: [bridge::protocol::message::SlotContents::Empty, image],
    })
}

/// CRC-32/ISO-HDLC bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg())
        })
    })
}

fn talk<T>(script: Vec<Do>, with: impl FnOnce(&Address) -> T) -> (T, Heard) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s");
    let peer = peer(&path, script);
    let result = with(&Address::Unix(path));
    (result, peer.join().unwrap())
}

#[test]
fn a_request_without_a_reply_is_sent_again_with_its_number() {
    let script = vec![hello(), Do::Ignore, Do::Ignore, Do::Noisy(Answer::Done)];
    let (result, heard) = talk(script, |address| {
        let mut link = HostLink::connect(address)?;
        link.activate()?;
        Ok::<_, Error>(link.repeats())
    });
    assert_eq!(result, Ok(2));
    let numbers: Vec<u16> = heard.iter().map(|(sequence, _)| *sequence).collect();
    assert_eq!(numbers, [1, 2, 2, 2]);
}

#[test]
fn an_answer_that_cannot_be_read_is_told_and_not_called_silence() {
    // A reply to this very request, with an answer of a number that no version has.
    let script = (0..5).map(|_| Do::Say(&[0, 0, 1, 0, 99])).collect();
    let (result, _) = talk(script, |address| HostLink::connect(address).map(|_| ()));
    let Err(Error::Silent { heard, .. }) = &result else {
        panic!("{result:?}")
    };
    assert_eq!((heard.unknown, heard.damaged, heard.foreign), (5, 0, 0));
    let failure = failure(result.unwrap_err());
    assert!(
        failure
            .to_string()
            .ends_with("5 whole frames with a message this tool does not know)"),
        "{failure}"
    );
    assert_eq!(
        failure.next_step(),
        "the tool and the firmware of the same release"
    );
}

#[test]
fn a_bridge_that_says_nothing_is_silent_after_five_requests() {
    let script = (0..5).map(|_| Do::Ignore).collect();
    let (result, heard) = talk(script, |address| HostLink::connect(address).map(|_| ()));
    assert!(
        matches!(&result, Err(Error::Silent { attempts: 5, heard, .. }) if heard.bytes == 0),
        "{result:?}"
    );
    assert_eq!(heard.len(), 5);
    // An emulator's socket takes a second host and never answers it.
    let failure = failure(result.unwrap_err());
    assert!(
        failure.next_step().contains("the other program"),
        "{}",
        failure.next_step()
    );
}

#[test]
fn a_flash_goes_on_over_a_new_line_where_the_bridge_says() {
    let image = [7u8; 600];
    let script = vec![
        hello(),
        received(0),
        received(512),
        Do::HangUp,
        hello(),
        received(512),
        received(600),
        Do::Answer(Ok(slots(crc32(&image)))),
        Do::Answer(Ok(slots(crc32(&image)))),
    ];
    let (result, heard) = talk(script, |address| {
        let never = Interrupt::never().unwrap();
        let mut seen = Vec::new();
        let mut link = HostLink::connect(address)?;
        let flashed = link.flash(&image, &never, &mut |done| seen.push(done))?;
        Ok::<_, Error>((flashed, seen))
    });
    let (flashed, seen) = result.unwrap();
    assert_eq!((flashed.slot, flashed.broken_lines), (1, 1));
    assert_eq!(flashed.crc, crc32(&image));
    assert_eq!(seen, [0, 512, 512, 600]);
    let names: Vec<&str> = heard.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(
        names,
        [
            "Hello",
            "WeightsBegin",
            "WeightsChunk",
            "WeightsChunk",
            "Hello",
            "WeightsBegin",
            "WeightsChunk",
            "WeightsCommit",
            "Slots"
        ]
    );
}

#[test]
fn a_line_that_breaks_a_hundred_times_and_once_more_is_given_up() {
    let image = [7u8; 600];
    let most = flash::MOST_BROKEN;
    let breaks = |times: u32| {
        let mut script = vec![hello(), received(0)];
        for _ in 0..times {
            // A chunk that is never answered: the far side hangs up.
            script.extend([Do::HangUp, hello(), received(0)]);
        }
        script
    };
    let flash = |address: &Address| {
        let never = Interrupt::never().unwrap();
        HostLink::connect(address)?.flash_with(&image, &never, &mut |_| {}, Duration::ZERO)
    };
    let mut script = breaks(most);
    script.push(Do::HangUp);
    let (result, heard) = talk(script, flash);
    let Err(error) = result else {
        panic!("{result:?}")
    };
    assert!(
        matches!(&error, Error::Breaking { times, done: 0, total: 600, .. } if *times == most + 1),
        "{error:?}"
    );
    assert!(error.to_string().contains("the line broke 101 times"));
    assert!(!failure(error).next_step().is_empty());
    let hellos = heard.iter().filter(|(_, name)| name == "Hello").count();
    assert_eq!(hellos as u32, most + 1);

    let crc = crc32(&image);
    let mut script = breaks(most);
    script.extend([received(512), received(600)]);
    script.extend([Do::Answer(Ok(slots(crc))), Do::Answer(Ok(slots(crc)))]);
    let (result, _) = talk(script, flash);
    assert_eq!(result.map(|flashed| flashed.broken_lines), Ok(most));
}

#[test]
fn another_image_in_the_flash_than_was_sent_is_an_error() {
    let script = vec![
        hello(),
        received(0),
        received(600 - 88),
        received(600),
        Do::Answer(Ok(slots(1))),
        Do::Answer(Ok(slots(1))),
    ];
    let (result, _) = talk(script, |address| {
        let never = Interrupt::never().unwrap();
        HostLink::connect(address)?.flash(&[7; 600], &never, &mut |_| {})
    });
    assert!(
        matches!(result, Err(Error::ReadBack { found: 1, .. })),
        "{result:?}"
    );
}

#[test]
fn a_refusal_is_told_in_one_line_with_its_next_step() {
    let script = vec![Do::Answer(Err(Refusal::Version { bridge: 9 }))];
    let (result, _) = talk(script, |address| HostLink::connect(address).map(|_| ()));
    let failure = failure(result.unwrap_err());
    assert_eq!(
        failure.to_string(),
        "the bridge refuses: it speaks version 9 of the host protocol, this tool version 3"
    );
    assert!(!failure.next_step().is_empty());
}

#[test]
fn an_image_that_did_not_end_is_told_with_commands_that_a_person_can_type() {
    let at = Address::Serial("/dev/b".into());
    let next = refusal_next(&Refusal::Store(bridge::store::Error::Busy), &at);
    let commands: Vec<String> = next.commands().map(ToString::to_string).collect();
    // Which file it was is not known here.
    assert!(next.to_string().starts_with("flashing the same file again"));
    assert_eq!(commands, ["gauntlet bridge reboot --bridge /dev/b"]);
}

#[test]
fn two_hosts_and_every_other_refusal_have_words_and_a_next_step() {
    use bridge::store::Error as Store;
    let refusals = [
        (Refusal::NoSession, "does not know this session"),
        (
            Refusal::Busy { session: 0xAB },
            "another host has it (session 000000ab)",
        ),
        (Refusal::Engaged, "clutch is closed"),
        (Refusal::Store(Store::Engaged), "clutch is closed"),
        (Refusal::Store(Store::NotBegun), "no weights image"),
        (
            Refusal::Store(Store::Older {
                found: 1,
                active: 2,
            }),
            "version 1",
        ),
        (Refusal::Period { least_ms: 20 }, "20 ms"),
        (
            Refusal::Configuration {
                key: 6,
                value: 41.0,
                least: 5.0,
                greatest: 40.0,
            },
            "lead is 41",
        ),
    ];
    for (refusal, word) in refusals {
        let what = refusal_words(&refusal);
        let next = refusal_next(&refusal, &Address::Serial("/dev/b".into()));
        assert!(what.contains(word), "{refusal:?}: {what}");
        assert!(!next.is_empty(), "{refusal:?}");
    }
}

#[test]
fn an_older_bridge_is_asked_and_flashed_and_never_engaged() {
    let older = Hello {
        version: 2,
        ..HELLO
    };
    let script = vec![
        Do::Answer(Err(Refusal::Version { bridge: 2 })),
        Do::Answer(Ok(Answer::Hello(older))),
        Do::Answer(Ok(slots(7))),
    ];
    let ((), heard) = talk(script, |address| {
        let mut link = HostLink::connect(address).unwrap();
        assert_eq!(link.slots().map(|slots| slots.active), Ok(Some(1)));
        let refused = Error::Older {
            what: "the clutch",
            bridge: 2,
        };
        assert_eq!(link.engage(), Err(refused));
        let health = link.health();
        assert!(matches!(health, Err(Error::Older { bridge: 2, .. })));
    });
    let names: Vec<&str> = heard.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(names, ["Hello", "Hello", "Slots"]);
}

#[test]
fn a_line_that_never_stops_sending_is_given_up_in_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bridge");
    let listener = UnixListener::bind(&path).unwrap();
    let flood = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        while stream.write_all(&[b'x'; 4096]).is_ok() {}
    });
    let Err(Error::Silent { heard, .. }) = HostLink::connect(&Address::Unix(path)) else {
        panic!("no bridge is there");
    };
    assert!(heard.bytes > 0);
    flood.join().unwrap();
}

#[test]
fn a_line_that_echoes_is_told_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bridge");
    let listener = UnixListener::bind(&path).unwrap();
    let echo = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut bytes = [0; 256];
        while let Ok(count @ 1..) = stream.read(&mut bytes) {
            if stream.write_all(&bytes[..count]).is_err() {
                break;
            }
        }
    });
    let error = HostLink::connect(&Address::Unix(path)).unwrap_err();
    let Error::Silent { heard, .. } = &error else {
        panic!("{error}");
    };
    assert_eq!(heard.echoes, ATTEMPTS);
    let failure = failure(error);
    assert!(
        format!("{failure:?}").contains("sends back what is sent"),
        "{failure:?}"
    );
    echo.join().unwrap();
}

#[test]
fn counters_that_do_not_come_cost_no_heartbeat() {
    use bridge::clutch::HeartbeatRefusal::Expired;
    let refused = Do::Answer(Err(Refusal::Heartbeat(Expired)));
    let ((), heard) = talk(vec![hello(), Do::Ignore, refused], |address| {
        let mut link = HostLink::connect(address).unwrap();
        let end = Instant::now() + Duration::from_millis(50);
        assert_eq!(link.counters_by(end), Ok(None));
        assert_eq!(link.heartbeat(3), Ok(Heartbeat::Refused(Expired)));
    });
    let names: Vec<&str> = heard.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(names, ["Hello", "Counters", "Heartbeat"], "asked once");
}

#[test]
fn a_profile_goes_over_in_chunks_and_comes_back_part_by_part() {
    let bound = glove::calibration::Bound {
        profile: glove::calibration::Profile::straight(glove::hand::Side::Left),
        ids: std::array::from_fn(|k| [k as u8; 16]),
    };
    let bytes = bound.to_bytes();
    let part = |offset: usize| {
        let rest = &bytes[offset..(offset + 256).min(bytes.len())];
        Do::Answer(Ok(Answer::Profile(
            bridge::protocol::message::ProfilePart {
                length: bytes.len() as u16,
                offset: offset as u16,
                bytes: rest.iter().copied().collect(),
            },
        )))
    };
    let none = Refusal::Profile(bridge::store::profile::Error::NoProfile);
    let script = vec![
        hello(),
        received(512),
        received(748),
        Do::Answer(Ok(Answer::Done)),
        part(0),
        part(256),
        part(512),
        Do::Answer(Ok(Answer::Done)),
        Do::Answer(Err(none)),
    ];
    let (back, heard) = talk(script, |address| {
        let mut link = HostLink::connect(address)?;
        link.set_profile(Some(&bound))?;
        let back = link.profile()?;
        link.set_profile(None)?;
        assert_eq!(link.profile()?, None);
        Ok::<_, Error>(back)
    });
    assert_eq!(back.expect("answers"), Some(bound));
    let names: Vec<&str> = heard.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(
        names[1..4],
        ["ProfileChunk", "ProfileChunk", "ProfileCommit"]
    );
    assert_eq!(names[7], "ProfileErase");
}
