//! A glove of a bridge on a chip, calibrated over its line: the whole guided session in the chip's time, and what the line and the bridge
//! can do meanwhile. The far side speaks the host protocol; an honest virtual glove is behind it.
#![allow(missing_docs, clippy::unwrap_used)]

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use bridge::State;
use bridge::calibration::CalibrationState;
use bridge::clutch::Position;
use bridge::protocol::frame::{self, Decoder};
use bridge::protocol::message::{
    Answer, Call, FromBridge, Health, Hello, Refusal, Reply, Request, Restart, Scan, SensorIds,
    Status, VERSION,
};
use glove::Instant;
use glove::calibration::{Reads, Step, Verdict};
use host::calibration::Guide;
use host::calibration::guide::{News, Stage};
use host::chip::link::{Address, Error, HostLink};
use host::chip::scans::Scans;
use rig::PoseSource;
use rig::glove::{Honest, VirtualGlove};
use rig::person::{Person, Task, Traits};

const RATE: f64 = 35.0;
const SOON: Duration = Duration::from_secs(10);
const IDS: [Option<[u8; 16]>; 16] = [Some([7; 16]); 16];

/// What the bridge does.
#[derive(Default)]
struct Does {
    now_us: u64,
    engaged: bool,
    /// It is of before there were scans, and does not answer what it does not know.
    is_older: bool,
    session: bool,
    calls: Vec<String>,
}

fn answer(does: &mut Does, call: &Call<'_>) -> Option<Result<Answer, Refusal>> {
    let name = format!("{call:?}");
    does.calls
        .push(name.split([' ', '(']).next().unwrap().to_owned());
    let status = Status {
        now_us: does.now_us,
        state: State::Idle,
        engaged: does.engaged,
        heartbeat: does.engaged,
        glove_answers: true,
        gripper: None,
        active_slot: None,
        transfer: None,
    };
    Some(Ok(match call {
        Call::Hello { .. } => {
            does.session = true;
            Answer::Hello(Hello {
                version: VERSION,
                shape: [25, 300, 4],
                joint_order: 1,
                capacity: 100_000,
                chunk: 512,
            })
        }
        _ if !does.session => return Some(Err(Refusal::NoSession)),
        Call::Status => Answer::Status(status),
        Call::Health => Answer::Health(Health {
            clutch: Position::Open,
            calibration: CalibrationState::default(),
            restart: Restart::Power,
            stalls: 0,
        }),
        Call::SensorIds | Call::Scans { .. } | Call::ProfileGet { .. } if does.is_older => {
            return None;
        }
        Call::SensorIds => Answer::SensorIds(SensorIds(IDS)),
        Call::ProfileGet { .. } => {
            return Some(Err(Refusal::Profile(
                bridge::store::profile::Error::NoProfile,
            )));
        }
        _ => Answer::Done,
    }))
}

/// A bridge, which answers by itself and sends scans when it is told to.
struct Chip {
    does: Arc<Mutex<Does>>,
    line: Arc<Mutex<Option<UnixStream>>>,
    folder: tempfile::TempDir,
}

impl Chip {
    fn start() -> Self {
        let does = Arc::new(Mutex::new(Does::default()));
        let line = Arc::new(Mutex::new(None::<UnixStream>));
        let folder = tempfile::tempdir().unwrap();
        let listener = UnixListener::bind(folder.path().join("s")).unwrap();
        let (served, out) = (Arc::clone(&does), Arc::clone(&line));
        std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            *out.lock().unwrap() = Some(stream.try_clone().unwrap());
            let mut decoder = Decoder::new();
            let mut byte = [0];
            while stream.read(&mut byte).unwrap_or(0) == 1 {
                let reply = decoder.push(byte[0], |message| {
                    let request: Request<'_> = postcard::from_bytes(message).unwrap();
                    let answer = answer(&mut served.lock().unwrap(), &request.call)?;
                    Some(Reply {
                        session: request.session,
                        sequence: request.sequence,
                        answer,
                    })
                });
                if let Some(Some(reply)) = reply {
                    let bytes = framed(&FromBridge::Reply(reply));
                    let mut out = out.lock().unwrap();
                    // A host that has gone hears nothing.
                    let _ = out.as_mut().unwrap().write_all(&bytes);
                }
            }
        });
        Self { does, line, folder }
    }

    fn scans(&self) -> Result<Scans, Error> {
        let address = Address::Unix(self.folder.path().join("s"));
        Scans::start(HostLink::connect(&address).unwrap())
    }

    fn send(&self, bytes: &[u8]) {
        let mut line = self.line.lock().unwrap();
        line.as_mut().unwrap().write_all(bytes).unwrap();
    }
}

fn framed(message: &FromBridge) -> Vec<u8> {
    let mut scratch = [0; frame::SCRATCH];
    let length = postcard::to_slice(message, &mut scratch[..frame::MAX_MESSAGE])
        .unwrap()
        .len();
    let mut out = [0; frame::MAX_FRAME];
    let mut bytes = vec![0];
    bytes.extend_from_slice(frame::encode(&mut scratch, length, &mut out).unwrap());
    bytes
}

/// The person in the glove, whom the test asks.
#[derive(Clone)]
struct Shared(Arc<Mutex<Person>>);

impl PoseSource for Shared {
    fn pose_at(&mut self, time_s: f64) -> [f32; 25] {
        self.0.lock().unwrap().pose_at(time_s)
    }

    fn attitude_at(&mut self, time_s: f64) -> Option<[f64; 4]> {
        self.0.lock().unwrap().attitude_at(time_s)
    }
}

fn instant(seconds: f64) -> Instant {
    Instant::from_ticks((seconds * 1e6).round() as u64)
}

/// The chip's glove, read scan by scan.
struct Glove {
    glove: VirtualGlove,
    person: Shared,
    reads: Reads,
    scans: u32,
}

impl Glove {
    fn new() -> Self {
        let traits = Traits {
            seed: 3,
            ..Traits::default()
        };
        let person = Shared(Arc::new(Mutex::new(Person::new(traits))));
        let config = rig::glove::Config {
            honest: Some(Honest {
                seed: 503,
                ..Honest::default()
            }),
            ..rig::glove::Config::at_baud(115_200)
        };
        let glove = VirtualGlove::new(Box::new(person.clone()), config);
        glove.bring_up(usize::MAX, instant(2.9));
        Self {
            glove,
            person,
            reads: Reads::new(),
            scans: 0,
        }
    }

    fn now(&self) -> f64 {
        3.0 + f64::from(self.scans) / RATE
    }

    fn scan(&mut self) -> Scan {
        let at = self.now();
        self.scans += 1;
        let row = std::array::from_fn(|k| {
            let stamp = instant(at + 1.7e-3 * k as f64);
            (self.glove.read_sample(k, stamp), stamp)
        });
        let mut frame = self.reads.frame(&row);
        frame.sequence = self.scans;
        Scan::new(
            &frame,
            &std::array::from_fn(|k| k as u8),
            &self.reads.starts,
        )
    }
}

fn task(step: Step) -> Task {
    match step {
        Step::FirstFlat | Step::SecondFlat | Step::LastFlat => Task::Flat,
        Step::Turn => Task::Turn,
        Step::Alone(finger) => Task::Alone(finger.number()),
        Step::Fists => Task::Fists,
        Step::Thumb => Task::Thumb,
        Step::Free => Task::Free,
    }
}

#[test]
fn a_person_is_calibrated_from_a_chips_scans_over_a_line_that_loses_some() {
    let (chip, mut glove) = (Chip::start(), Glove::new());
    let mut scans = chip.scans().unwrap();
    assert_eq!(scans.ids(), &IDS);
    let mut guide = Guide::new(None);
    let mut damaged = 0;
    while guide.ended().is_none() {
        assert!(glove.now() < 200.0, "it does not end");
        let scan = glove.scan();
        chip.does.lock().unwrap().now_us = scan.began_us;
        let mut bytes = framed(&FromBridge::Scan(scan));
        // One in twenty is damaged, one is not sent for want of room.
        match glove.scans % 20 {
            5 => {
                bytes[40] ^= 0x10;
                chip.send(&bytes);
                damaged += 1;
            }
            12 => damaged += 1,
            _ => {
                chip.send(&bytes);
                let scanned = scans.next(SOON).unwrap().unwrap();
                assert_eq!(scanned.frame.sequence, glove.scans);
                assert!(scans.now() >= scanned.at);
                guide.take(&scanned.frame, &scanned.starts);
                // The time of the scan, since the test's machine may be slow.
                guide.pass(scanned.at);
                if guide.ask(scanned.at).stage == Stage::Waiting {
                    guide.go_on(scanned.at);
                }
            }
        }
        while let Some(news) = guide.next_news() {
            assert!(!matches!(news, News::Again(..)), "{news:?}");
            if let News::Asked(step) = news {
                let now = glove.now();
                glove.person.0.lock().unwrap().ask(task(step), now);
            }
        }
    }
    let judged = guide.ended().unwrap().as_ref().unwrap();
    assert_eq!(judged.verdict(), Verdict::Good, "{:?}", judged.findings());
    let counted = scans.counted();
    assert!(damaged > 100 && counted.lost.abs_diff(damaged) <= 2);
    assert_eq!(counted.good, u16::MAX);
    let stopped = scans.stop();
    assert!(stopped.is_ok(), "{stopped:?}");
    let calls = chip.does.lock().unwrap().calls.clone();
    assert_eq!(calls.last().map(String::as_str), Some("Scans"));
}

#[test]
fn a_closed_clutch_refuses_scans_before_and_in_the_middle_of_them() {
    let chip = Chip::start();
    chip.does.lock().unwrap().engaged = true;
    let refused = Error::Refused(Refusal::Engaged);
    assert_eq!(chip.scans().map(drop), Err(refused.clone()));
    let chip = Chip::start();
    let mut scans = chip.scans().unwrap();
    chip.does.lock().unwrap().engaged = true;
    assert_eq!(ended(&mut scans), refused);
}

#[test]
fn firmware_of_before_there_were_scans_is_told_by_name() {
    let chip = Chip::start();
    chip.does.lock().unwrap().is_older = true;
    let error = chip.scans().map(drop).unwrap_err();
    assert!(matches!(error, Error::Lacks { .. }), "{error:?}");
    let failure = error.at(&Address::Unix("b".into()));
    assert!(failure.to_string().contains("older than this tool"));
    assert!(failure.next_step().contains("cargo xtask firmware"));
}

#[test]
fn a_session_that_ended_is_begun_anew_and_a_restart_in_the_middle_is_an_end() {
    let (chip, mut glove) = (Chip::start(), Glove::new());
    let mut scans = chip.scans().unwrap();
    let first = framed(&FromBridge::Scan(glove.scan()));
    chip.send(&first);
    assert!(scans.next(SOON).unwrap().is_some());
    let forget = |now_us| {
        let mut does = chip.does.lock().unwrap();
        (does.session, does.now_us) = (false, now_us);
        does.calls.clear();
    };
    forget(9_000_000);
    let begun = || {
        chip.does
            .lock()
            .unwrap()
            .calls
            .contains(&"Scans".to_owned())
    };
    for _ in 0..100 {
        if begun() {
            break;
        }
        scans.next(Duration::from_millis(100)).unwrap();
    }
    assert!(begun());
    forget(100_000);
    assert_eq!(ended(&mut scans), Error::Restarted);
}

/// How the scans end.
fn ended(scans: &mut Scans) -> Error {
    for _ in 0..100 {
        if let Err(error) = scans.next(Duration::from_millis(100)) {
            return error;
        }
    }
    panic!("they go on")
}
