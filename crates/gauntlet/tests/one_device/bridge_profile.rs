//! The glove's profile in a bridge on a chip, from the command line: given only to a bridge whose sensors it is of, shown, taken away.
//! The far side speaks the host protocol and keeps what it is given.

use crate::support;

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::{Output, Stdio};
use std::sync::{Arc, Mutex};

use host::bridge::State;
use host::bridge::calibration::{CalibrationState, Refusal as NotTaken, Try};
use host::bridge::clutch::Position;
use host::bridge::protocol::frame::{self, Decoder};
use host::bridge::protocol::message::{
    Answer, Call, Counters, FromBridge, Health, Hello, PROFILE_CHUNK, ProfilePart, Refusal, Reply,
    Request, Restart, SensorIds, SlotContents, Slots, Status, VERSION,
};
use host::bridge::store::profile::Error;
use host::calibration::Kept;
use host::calibration::profile_file::{MadeBy, Quality};
use host::glove::calibration::{Bound, Profile};
use host::glove::hand::Side;
use host::glove::imu::UniqueId;

use support::{command, finish, json, refusal, text};

/// What the bridge keeps and has been asked.
#[derive(Default)]
struct Chip {
    ids: [Option<UniqueId>; 16],
    incoming: Vec<u8>,
    kept: Option<Vec<u8>>,
    written: u32,
    /// Flat poses refused.
    ended: u16,
    session: bool,
}

fn health(ended: u16) -> Health {
    Health {
        clutch: Position::Open,
        calibration: CalibrationState {
            newest: Try::Refused(NotTaken::NoProfile),
            ended,
            ..CalibrationState::default()
        },
        restart: Restart::Power,
        stalls: 0,
    }
}

impl Chip {
    fn answer(&mut self, call: &Call<'_>) -> Result<Answer, Refusal> {
        Ok(match call {
            Call::Hello { .. } => {
                self.session = true;
                Answer::Hello(Hello {
                    version: VERSION,
                    shape: [25, 300, 4],
                    joint_order: 1,
                    capacity: 100_000,
                    chunk: 512,
                })
            }
            _ if !self.session => return Err(Refusal::NoSession),
            Call::Status | Call::Release => Answer::Status(Status {
                now_us: 1_000_000,
                state: State::Idle,
                engaged: false,
                heartbeat: false,
                glove_answers: true,
                gripper: None,
                active_slot: None,
                transfer: None,
            }),
            Call::Health => Answer::Health(health(self.ended)),
            Call::Counters => Answer::Counters(Counters::default()),
            Call::Slots => Answer::Slots(Slots {
                active: None,
                contents: [SlotContents::Empty; 2],
            }),
            Call::SensorIds => Answer::SensorIds(SensorIds(self.ids)),
            Call::ProfileGet { offset } => {
                let kept = self.kept.as_ref();
                let kept = kept.ok_or(Refusal::Profile(Error::NoProfile))?;
                let rest = &kept[(*offset as usize).min(kept.len())..];
                Answer::Profile(ProfilePart {
                    length: kept.len() as u16,
                    offset: *offset as u16,
                    bytes: rest.iter().take(PROFILE_CHUNK).copied().collect(),
                })
            }
            Call::ProfileChunk { offset, bytes } => {
                self.written += 1;
                self.incoming.truncate(*offset as usize);
                self.incoming.extend_from_slice(bytes);
                Answer::Received {
                    bytes: self.incoming.len() as u32,
                }
            }
            Call::ProfileCommit { .. } => {
                self.kept = Some(self.incoming.clone());
                Answer::Done
            }
            Call::ProfileErase => {
                self.written += 1;
                self.kept = None;
                Answer::Done
            }
            Call::CalibrateFlatHand => {
                self.ended += 1;
                Answer::Done
            }
            _ => Answer::Done,
        })
    }
}

fn serve(chip: &Mutex<Chip>, mut stream: UnixStream) {
    let mut decoder = Decoder::new();
    let mut byte = [0];
    while stream.read(&mut byte).unwrap_or(0) == 1 {
        let reply = decoder.push(byte[0], |message| {
            let request: Request<'_> = postcard::from_bytes(message).unwrap();
            // As of before that call.
            let answers = request.call != Call::Devices;
            answers.then(|| Reply {
                session: request.session,
                sequence: request.sequence,
                answer: chip.lock().unwrap().answer(&request.call),
            })
        });
        if let Some(Some(reply)) = reply {
            // A host that has gone hears nothing.
            let _ = stream.write_all(&framed(&FromBridge::Reply(reply)));
        }
    }
}

fn framed(message: &FromBridge) -> Vec<u8> {
    let mut scratch = [0; frame::SCRATCH];
    let room = &mut scratch[..frame::MAX_MESSAGE];
    let length = postcard::to_slice(message, room).unwrap().len();
    let mut out = [0; frame::MAX_FRAME];
    let mut bytes = vec![0];
    bytes.extend_from_slice(frame::encode(&mut scratch, length, &mut out).unwrap());
    bytes
}

/// A profile made with sensors that `glove` names.
fn kept(glove: u8) -> Kept {
    let id = |k: usize| std::array::from_fn(|i| (16 * k + i) as u8 ^ glove);
    Kept {
        bound: Bound {
            profile: Profile::straight(Side::Left),
            ids: std::array::from_fn(id),
        },
        calibrated: "2026-11-29T11:30:00Z".to_owned(),
        quality: Quality {
            verdict: "good".to_owned(),
            fit_deg: 1.0,
            ratio: 0.1,
            tilt_deg: 1.0,
            heading_deg: 1.0,
            findings: Vec::new(),
        },
        made_by: MadeBy::Calibrate,
    }
}

#[test]
fn a_bridge_is_given_only_the_profile_of_its_own_sensors_shows_it_and_forgets_it() {
    let folder = tempfile::tempdir().unwrap();
    let chip = Arc::new(Mutex::new(Chip::default()));
    let socket = folder.path().join("bridge");
    let listener = UnixListener::bind(&socket).unwrap();
    std::thread::spawn({
        let chip = Arc::clone(&chip);
        move || {
            listener
                .incoming()
                .flatten()
                .for_each(|stream| serve(&chip, stream))
        }
    });
    let (own, other) = (kept(1), kept(2));
    let gloves = folder.path().join("gloves");
    std::fs::create_dir(&gloves).unwrap();
    let [own_file, other_file] = ["own.toml", "other.toml"].map(|name| gloves.join(name));
    own.write(&own_file).unwrap();
    other.write(&other_file).unwrap();
    chip.lock().unwrap().ids = own.bound.ids.map(Some);
    chip.lock().unwrap().ids[3] = None;

    let given = bridge(
        folder.path(),
        &["calibrate", "--profile", path(&other_file)],
    );
    let said = refusal(&given, 1);
    assert!(
        said.contains("other.toml") && said.contains("another glove"),
        "{said}"
    );
    assert_eq!(chip.lock().unwrap().written, 0, "nothing was written");

    // The hand is not taken by this bridge; the profile is.
    let given = bridge(folder.path(), &["calibrate", "--profile", path(&own_file)]);
    assert!(
        text(&given.stdout).contains("is kept by the bridge"),
        "{}",
        text(&given.stderr)
    );
    assert_eq!(
        chip.lock().unwrap().kept.as_deref(),
        Some(&own.bound.to_bytes()[..])
    );

    let shown = bridge(folder.path(), &["status"]);
    let line = text(&shown.stdout);
    let line = line
        .lines()
        .find(|line| line.starts_with("profile"))
        .unwrap();
    for words in ["left hand", "2026-11-29T11:30:00Z", "good", "15 of 15"] {
        assert!(line.contains(words), "{words}: {line}");
    }
    let shown = json(&bridge(folder.path(), &["status", "--json"]));
    assert_eq!(shown["profile"]["ids_read"], 15);
    assert_eq!(shown["profile"]["fits"], true);

    let gone = bridge(folder.path(), &["calibrate", "--forget"]);
    assert_eq!(gone.status.code(), Some(0), "{}", text(&gone.stderr));
    assert_eq!(chip.lock().unwrap().kept, None);
    let shown = bridge(folder.path(), &["status"]);
    assert!(text(&shown.stdout).contains("profile    none is kept"));
}

#[test]
fn the_hand_of_a_glove_that_is_not_calibrated_is_not_written_down() {
    let folder = tempfile::tempdir().unwrap();
    let chip = Mutex::new(Chip::default());
    let listener = UnixListener::bind(folder.path().join("bridge")).unwrap();
    std::thread::spawn(move || {
        let streams = listener.incoming().flatten();
        streams.for_each(|stream| serve(&chip, stream));
    });
    let file = folder.path().join("hand.csv");
    let refused = bridge(
        folder.path(),
        &["log", "--out", path(&file), "--seconds", "1"],
    );
    assert!(refusal(&refused, 1).contains("is not calibrated"));
    let next = "gauntlet bridge calibrate --bridge unix:";
    assert!(text(&refused.stderr).contains(next));
    assert!(!file.exists());
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn bridge(folder: &Path, words: &[&str]) -> Output {
    let address = format!("unix:{}", folder.join("bridge").display());
    let child = command(&[&["bridge"], words, &["--bridge", &address]].concat())
        .env("GAUNTLET_CONFIG", folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    finish(child.unwrap())
}
