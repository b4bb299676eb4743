//! Whatever a device does, a step of the loop does a bounded amount of work and the supervisor keeps its period.

mod common;

use bridge::app::expected;
use bridge::{App, Board, Config, HoldReason, Instant, Platform, State, WeightsStore};
use common::Flash;
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};
use gripper::driver::ThreeFinger;
use rig::flash::Power;
use std::cell::Cell;
use std::rc::Rc;

/// What a broken device does.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Broken {
    /// Takes every byte and never answers.
    Silent,
    /// Its port fails at every call.
    Failing,
    /// Takes no byte: the queue is full for ever.
    Full,
    /// Sends zeros without end.
    Zeros,
    /// Sends ever changing bytes without end.
    Babble,
    /// Says it has bytes, then has none.
    Liar,
    /// Answers every byte with itself.
    Echo,
}

const ALL: [Broken; 7] = [
    Broken::Silent,
    Broken::Failing,
    Broken::Full,
    Broken::Zeros,
    Broken::Babble,
    Broken::Liar,
    Broken::Echo,
];

#[derive(Debug)]
struct Fault;

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("broken")
    }
}

impl core::error::Error for Fault {}

impl embedded_io::Error for Fault {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

/// A port to a broken device; counts every call, and every byte that passes.
#[derive(Clone)]
struct Port {
    broken: Broken,
    work: Rc<Cell<u64>>,
    echo: Vec<u8>,
    noise: u32,
}

impl Port {
    fn new(broken: Broken) -> Self {
        Self {
            broken,
            work: Rc::default(),
            echo: Vec::new(),
            noise: 1,
        }
    }

    fn call(&self, bytes: usize) -> Result<(), Fault> {
        self.work.set(self.work.get() + 1 + bytes as u64);
        if self.broken == Broken::Failing {
            Err(Fault)
        } else {
            Ok(())
        }
    }
}

impl ErrorType for Port {
    type Error = Fault;
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, Fault> {
        self.call(0)?;
        Ok(match self.broken {
            Broken::Zeros | Broken::Babble | Broken::Liar => true,
            Broken::Echo => !self.echo.is_empty(),
            _ => false,
        })
    }
}

impl Read for Port {
    fn read(&mut self, buf: &mut [u8]) -> Result<usize, Fault> {
        self.call(buf.len())?;
        match self.broken {
            Broken::Zeros => buf.fill(0),
            Broken::Babble => {
                for byte in buf.iter_mut() {
                    self.noise = self
                        .noise
                        .wrapping_mul(1_664_525)
                        .wrapping_add(1_013_904_223);
                    *byte = (self.noise >> 24) as u8;
                }
            }
            Broken::Echo => {
                let count = buf.len().min(self.echo.len());
                buf[..count].copy_from_slice(&self.echo[..count]);
                self.echo.drain(..count);
                return Ok(count);
            }
            _ => return Ok(0),
        }
        Ok(buf.len())
    }
}

impl Write for Port {
    fn write(&mut self, buf: &[u8]) -> Result<usize, Fault> {
        self.call(buf.len())?;
        match self.broken {
            Broken::Full => return Ok(0),
            Broken::Echo => self.echo.extend(buf),
            _ => {}
        }
        Ok(buf.len())
    }

    fn flush(&mut self) -> Result<(), Fault> {
        panic!("a flush waits");
    }
}

/// Time stands still within a step; each costs 50 µs.
struct Counted {
    now: u64,
}

impl Platform for Counted {
    fn now(&mut self) -> Instant {
        Instant::from_ticks(self.now)
    }

    fn wait_until(&mut self, due: Instant) {
        self.now = (self.now + 50).max(due.as_ticks());
    }
}

impl Board<4> for Counted {
    type Glove = glove::sc18im::Sc18im<Port>;
    type Gripper = ThreeFinger<Port>;
    type Flash = Flash<4096>;
}

#[test]
fn no_dead_or_babbling_device_makes_a_step_long_or_the_supervisor_late() {
    for (glove_port, gripper_port) in ALL
        .into_iter()
        .flat_map(|glove| ALL.map(|gripper| (glove, gripper)))
    {
        let (glove, gripper) = (Port::new(glove_port), Port::new(gripper_port));
        let (glove_work, gripper_work) = (glove.work.clone(), gripper.work.clone());
        let power = Power::new();
        let slots = [
            Flash::<4096>::new(64 * 1024, &power),
            Flash::new(64 * 1024, &power),
        ];
        let mut app = App::<_, 4>::new(
            Counted { now: 0 },
            glove::scan::Scanner::new(glove, glove::scan::Config::default()),
            ThreeFinger::new(gripper, gripper::driver::Config::default()),
            WeightsStore::new(slots, expected(4)),
            Config::default(),
        );
        let mut greatest = 0;
        let mut before = 0;
        let mut steps = 0;
        while app.platform_mut().now < 3_000_000 {
            app.engage();
            let due = app.step();
            let work = glove_work.get() + gripper_work.get();
            greatest = greatest.max(work - before);
            before = work;
            steps += 1;
            assert!(
                steps < 200_000,
                "{glove_port:?} {gripper_port:?}: it never waits"
            );
            app.platform_mut().wait_until(due);
            while app.next_event().is_some() {}
        }
        let telemetry = app.telemetry();
        // Calls and bytes in one step: a few buffers, whatever the device sends.
        assert!(
            greatest < 4_000,
            "{glove_port:?} {gripper_port:?}: {greatest}"
        );
        assert_eq!(
            telemetry.counters.late_steps, 0,
            "{glove_port:?} {gripper_port:?}"
        );
        assert!(
            telemetry.counters.steps >= 299,
            "{glove_port:?} {gripper_port:?}: {}",
            telemetry.counters.steps
        );
        assert_eq!(telemetry.sent_sequence, 0);
        assert_eq!(telemetry.state, State::Holding(HoldReason::GripperSilent));
    }
}
