//! A bridge on a chip that does what a test says: it speaks the host protocol over a socket, and holds nothing.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use bridge::calibration::{CalibrationState, ProfileState, Try};
use bridge::clutch::{HeartbeatRefusal, Position};
use bridge::protocol::frame::{self, Decoder};
use bridge::protocol::message::{
    Answer, AxisDetail, Call, Counters, Devices, FromBridge, GripperDetail, GripperStatus,
    Headings, Health, Hello, PerAxis, Refusal, Replies, Reply, Request, Restart, Sample, Status,
    VERSION,
};
use bridge::{Epoch, HoldReason, State};
use gripper::{Activation, Contact, Fault};

use crate::chip::link::Address;

/// What the script says the bridge does.
pub struct Script {
    /// When it started.
    started: Instant,
    /// A host said hello since.
    session: bool,
    epoch: Option<Epoch>,
    closings: Epoch,
    /// The supervisor's state under a closed clutch.
    pub engaged: State,
    /// Where the gripper says that it is; `None`: it does not answer.
    pub gripper: Option<[u8; 4]>,
    /// What it says of its activation.
    pub activation: Activation,
    /// What it repeats of what it is told.
    pub echo: [u8; 4],
    /// What it is told.
    pub command: Vec<u8>,
    pub counters: Counters,
    /// An axis that stands although it is told to move.
    pub stands: Option<u8>,
    pub calibration: CalibrationState,
    /// Calls that are refused, by name.
    pub refused: Option<(&'static str, Refusal)>,
    /// Call whose next reply is lost on the way, by name.
    pub lost: Option<&'static str>,
    /// Call that never arrives, by name.
    pub unheard: Option<&'static str>,
    /// Samples to be sent.
    pub samples: VecDeque<Sample>,
    /// Whether a sample goes out every 50 ms by itself.
    pub samples_flow: bool,
    /// Neither heard nor heard of any more.
    pub cut: bool,
    /// Names of the calls that came, without those that come all the time.
    pub calls: Vec<String>,
}

impl Script {
    /// µs since it started.
    pub fn now_us(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_micros()).unwrap()
    }

    /// The power was off for a moment.
    pub fn restart(&mut self) {
        self.started = Instant::now();
        (self.session, self.epoch) = (false, None);
        self.counters = Counters::default();
        self.calibration = CalibrationState::default();
    }

    /// Another host says hello, and this session is over.
    pub fn taken(&mut self) {
        (self.session, self.epoch) = (false, None);
        self.refused = Some(("Hello", Refusal::Busy { session: 7 }));
    }

    /// Another host opens the clutch.
    pub fn open(&mut self) {
        self.epoch = None;
    }

    fn state(&self) -> State {
        self.epoch.map_or(State::Idle, |_| self.engaged)
    }

    /// A sample of now.
    pub fn sample(&self) -> Sample {
        Sample {
            now_us: self.now_us(),
            state: self.state(),
            frame_sequence: self.counters.frames,
            angles: [0.0; glove::hand::JOINT_COUNT],
            target: PerAxis::new(),
            command: PerAxis::from_slice(&self.command).unwrap(),
            position: PerAxis::from_slice(&self.gripper.map_or(vec![], Vec::from)).unwrap(),
            latency_us: None,
            not_shown: None,
        }
    }

    fn status(&self) -> Status {
        let axes = |counts: &[u8]| PerAxis::from_slice(counts).unwrap();
        Status {
            now_us: self.now_us(),
            state: self.state(),
            engaged: self.epoch.is_some(),
            heartbeat: self.epoch.is_some(),
            glove_answers: true,
            gripper: self.gripper.map(|position| GripperStatus {
                activation: self.activation,
                fault: Fault::None,
                echo: axes(&self.echo),
                position: axes(&position),
            }),
            active_slot: Some(0),
            transfer: None,
        }
    }

    fn health(&self) -> Health {
        Health {
            clutch: self.epoch.map_or(Position::Open, |_| Position::Closed),
            calibration: self.calibration,
            restart: Restart::Power,
            stalls: 0,
        }
    }

    fn devices(&self) -> Devices {
        let axis = AxisDetail {
            contact: Contact::Moving,
            current: 0,
        };
        Devices {
            now_us: self.now_us(),
            glove_age_ms: Some(0),
            missing: 0,
            sensors: Default::default(),
            distrusted: 0,
            impossible: 0,
            gripper: self.gripper.map(|axes| GripperDetail {
                age_ms: 0,
                going_to: true,
                axes: axes.iter().map(|_| axis).collect(),
            }),
            stands: self.stands,
            replies: Replies::default(),
        }
    }

    fn answer(&mut self, call: &Call<'_>) -> Result<Answer, Refusal> {
        let name = format!("{call:?}");
        let name = name.split([' ', '(']).next().unwrap().to_owned();
        if let Some((_, refusal)) = self.refused.filter(|(refused, _)| *refused == name) {
            return Err(refusal);
        }
        if !matches!(
            call,
            Call::Heartbeat { .. }
                | Call::Status
                | Call::Counters
                | Call::Health
                | Call::Devices
                | Call::Headings
        ) {
            self.calls.push(name);
        }
        if !self.session && !matches!(call, Call::Hello { .. } | Call::Release) {
            return Err(Refusal::NoSession);
        }
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
            Call::Engage => {
                self.closings += 1;
                self.epoch = Some(self.closings);
                Answer::Engaged {
                    epoch: self.closings,
                    status: self.status(),
                }
            }
            Call::Heartbeat { epoch } if self.epoch != Some(*epoch) => {
                return Err(Refusal::Heartbeat(HeartbeatRefusal::Open));
            }
            Call::Release => {
                self.epoch = None;
                Answer::Status(self.status())
            }
            Call::Status | Call::Heartbeat { .. } => Answer::Status(self.status()),
            Call::Counters => {
                // Statuses of the gripper go on.
                self.counters.statuses += u32::from(self.gripper.is_some());
                Answer::Counters(self.counters)
            }
            Call::Health => Answer::Health(self.health()),
            Call::Devices => Answer::Devices(self.devices()),
            Call::Headings => Answer::Headings(Headings {
                profile: ProfileState::default(),
                sigma: [0.0; 16],
                drift: [0.0; 16],
                degraded: 0,
                unknown: 0,
                held: 0,
                poses: 0,
                pose: None,
            }),
            _ => Answer::Done,
        })
    }
}

/// The bridge, until it is dropped.
pub struct Scripted {
    script: Arc<Mutex<Script>>,
    folder: tempfile::TempDir,
}

impl Scripted {
    /// Calibrated, with a ready gripper at 10 that repeats what it is told; under a closed clutch it follows.
    pub fn start() -> Self {
        let script = Arc::new(Mutex::new(Script {
            started: Instant::now(),
            session: false,
            epoch: None,
            closings: 0,
            engaged: State::Following,
            gripper: Some([10; 4]),
            activation: Activation::Ready,
            echo: [10; 4],
            command: vec![10; 4],
            counters: Counters {
                commands: 1,
                ..Counters::default()
            },
            stands: None,
            calibration: CalibrationState {
                is_calibrated: true,
                newest: Try::Taken,
                ended: 1,
            },
            refused: None,
            lost: None,
            unheard: None,
            samples: VecDeque::new(),
            samples_flow: true,
            cut: false,
            calls: Vec::new(),
        }));
        let folder = tempfile::tempdir().unwrap();
        let listener = UnixListener::bind(folder.path().join("s")).unwrap();
        let served = Arc::clone(&script);
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                serve(stream.unwrap(), &served);
                if served.lock().unwrap().cut {
                    return;
                }
            }
        });
        Self { script, folder }
    }

    /// Where it is.
    pub fn address(&self) -> Address {
        Address::Unix(self.folder.path().join("s"))
    }

    /// To look at, and to change.
    pub fn script(&self) -> MutexGuard<'_, Script> {
        self.script.lock().unwrap()
    }

    /// Holds for this reason under a closed clutch.
    pub fn holds(&self, reason: HoldReason) {
        self.script().engaged = State::Holding(reason);
    }
}

fn serve(mut stream: UnixStream, script: &Mutex<Script>) {
    let look = Duration::from_millis(2);
    stream.set_read_timeout(Some(look)).unwrap();
    let mut decoder = Decoder::new();
    let mut sampled = Instant::now();
    loop {
        let mut now = script.lock().unwrap();
        if now.cut {
            return;
        }
        let mut out: Vec<FromBridge> = now.samples.drain(..).map(FromBridge::Sample).collect();
        if now.samples_flow && now.session && sampled.elapsed() >= Duration::from_millis(50) {
            sampled = Instant::now();
            out.push(FromBridge::Sample(now.sample()));
        }
        drop(now);
        let mut bytes = [0; 256];
        match stream.read(&mut bytes) {
            Ok(0) => return,
            Ok(count) => out.extend(replies(&bytes[..count], &mut decoder, script)),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => return,
        }
        for message in out {
            if send(&mut stream, &message).is_err() {
                return;
            }
        }
    }
}

fn replies(bytes: &[u8], decoder: &mut Decoder, script: &Mutex<Script>) -> Vec<FromBridge> {
    let reply = |message: &[u8]| {
        let request: Request<'_> = postcard::from_bytes(message).unwrap();
        let mut script = script.lock().unwrap();
        let name = format!("{:?}", request.call);
        if script
            .unheard
            .is_some_and(|unheard| name.starts_with(unheard))
        {
            return None;
        }
        let answer = script.answer(&request.call);
        let lost = script.lost.take_if(|lost| name.starts_with(*lost));
        lost.is_none().then_some(FromBridge::Reply(Reply {
            session: request.session,
            sequence: request.sequence,
            answer,
        }))
    };
    bytes
        .iter()
        .filter_map(|byte| decoder.push(*byte, reply).flatten())
        .collect()
}

fn send(stream: &mut UnixStream, message: &FromBridge) -> std::io::Result<()> {
    let mut scratch = [0; frame::SCRATCH];
    let length = postcard::to_slice(message, &mut scratch[..frame::MAX_MESSAGE])
        .unwrap()
        .len();
    let mut out = [0; frame::MAX_FRAME];
    let coded = frame::encode(&mut scratch, length, &mut out).unwrap();
    stream.write_all(&[0])?;
    stream.write_all(coded)
}
