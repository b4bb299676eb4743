//! Fuzz targets as plain functions: any bytes in, a panic only when something is wrong. Run by
//! `tests/fuzz.rs` on stable; a coverage-guided fuzzer may call the same functions.

use super::{Line, Slave, at};
use gripper::driver::{Config, Control, ThreeFinger, TwoFinger};
use gripper::link::{self, LateReply, Link};
use gripper::registers::STATUS;
use gripper::registers::three_finger::Mode;
use gripper::registers::two_finger::Model;
use gripper::rtu::{Frame, Registers, Request, Response};
use gripper::{Gripper, Motion, timing};

/// Frames of both sides: nothing panics, and what parses is written back byte for byte.
pub fn frames(data: &[u8]) {
    let mut out = [0; 300];
    if let Ok((unit, request)) = Request::parse(data) {
        let length = request.emit(unit, &mut out).unwrap();
        assert_eq!(&out[..length], data);
        assert_eq!(Request::frame_len(data), Ok(Some(data.len())));
        assert_eq!(request.buffer_len(), data.len());
    }
    if let Ok((unit, response)) = Response::parse(data) {
        let length = response.emit(unit, &mut out).unwrap();
        assert_eq!(&out[..length], data);
    }
    if let Ok(request) = Request::parse_pdu(data) {
        let length = request.emit_pdu(&mut out).unwrap();
        assert_eq!(&out[..length], data);
    }
    if let Ok(response) = Response::parse_pdu(data) {
        let length = response.emit_pdu(&mut out).unwrap();
        assert_eq!(&out[..length], data);
    }
    let _ = (
        Request::frame_len(data),
        Frame::new_checked(data).map(|frame| frame.pdu().len()),
    );
    if let Some(registers) = Registers::from_bytes(data) {
        assert_eq!(registers.iter().count(), registers.len());
    }
}

/// Operations taken from bytes, one after the other.
struct Script<'d>(&'d [u8]);

impl Script<'_> {
    fn byte(&mut self) -> u8 {
        match self.0.split_first() {
            Some((&first, rest)) => {
                self.0 = rest;
                first
            }
            None => 0,
        }
    }

    fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.byte()).collect()
    }
}

const BLOCK: [u8; 16] = [9, 12, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0];

/// What a link has been through, for a test that wants to know whether the fuzzing reaches deep.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen {
    pub answers: u32,
    pub failures: u32,
    pub late_replies: u32,
}

/// A bare link under a list of operations. The reply to an earlier request that went unanswered is
/// never taken for the answer; whatever happens, the link becomes free again.
pub fn link(data: &[u8]) -> Seen {
    let mut script = Script(data);
    let line = Line::default();
    let mut link = Link::new(line.clone(), link::Config::new(9, 115_200));
    let mut slave = Slave::three_finger();
    let mut seen = Seen::default();
    // The reply to the request under way; the one to an unanswered request before it, and since when.
    let mut current: Option<Vec<u8>> = None;
    let mut outstanding: Option<(Vec<u8>, u64)> = None;
    // Whether anything but the outstanding reply has been put on the line since the request.
    let (mut waiting, mut fresh, mut broken) = (false, true, false);
    while !script.0.is_empty() {
        let now = at(line.now());
        match script.byte() % 12 {
            0 | 1 => match link.poll(now) {
                Some(Ok(_)) => {
                    assert!(waiting, "an answer without a request");
                    assert!(fresh, "an earlier reply taken for the answer");
                    seen.answers += 1;
                    (waiting, outstanding) = (false, None);
                }
                Some(Err(link::Error::Noise(_) | link::Error::Port(_))) => waiting = false,
                Some(Err(error)) => {
                    assert!(waiting, "a failure without a request");
                    seen.failures += 1;
                    waiting = false;
                    if matches!(error, link::Error::Timeout { .. }) {
                        outstanding = current.take().map(|reply| (reply, line.now()));
                    }
                }
                None => {}
            },
            2 => line.set_now(line.now() + 17 * u64::from(script.byte())),
            3 => line.set_now(
                link.next_due()
                    .as_ticks()
                    .clamp(line.now(), line.now() + 10_000_000),
            ),
            4 => line.set_now(line.now() + 5_000 * u64::from(script.byte())),
            5 => {
                let count = usize::from(script.byte() % 48);
                let noise = script.bytes(count);
                line.send(line.now(), u64::from(script.byte()), &noise);
                fresh = true;
            }
            6 | 7 => {
                let (quantity, kind) = (u16::from(script.byte() % 9), script.byte());
                let values = Registers::from_bytes(&BLOCK).unwrap();
                let (read_address, write_address) = (STATUS, gripper::registers::COMMAND);
                let request = match kind % 4 {
                    0 => Request::ReadInput {
                        address: STATUS,
                        quantity,
                    },
                    1 => Request::ReadWrite {
                        read_address,
                        read_quantity: quantity,
                        write_address,
                        values,
                    },
                    _ => Request::ReadHolding {
                        address: STATUS,
                        quantity,
                    },
                };
                if !waiting && !broken && line.next_byte().is_none() {
                    super::settle(&line, &mut link);
                }
                // A superseded signature would be safe only against replies in order.
                let settled = matches!(
                    link.late_reply(&request, at(line.now())),
                    LateReply::Superseded { .. }
                );
                if !settled && link.start(&request, &[], at(line.now())).is_ok() {
                    let (_, bytes) = line.take_written().pop().unwrap();
                    current = Some(slave.answer(&bytes));
                    (waiting, fresh) = (true, false);
                }
            }
            8 => {
                // Every reply comes once.
                let spacing = u64::from(script.byte());
                if let Some(reply) = current.take() {
                    line.send(line.now(), spacing, &reply);
                    fresh = true;
                }
            }
            9 => {
                let spacing = u64::from(script.byte());
                // It comes once.
                if let Some((reply, since)) = outstanding.take()
                    && line.now() + 21 * spacing < since + timing::MEMORY.as_ticks()
                {
                    line.send(line.now(), spacing, &reply);
                    seen.late_replies += 1;
                }
            }
            10 => {
                broken = script.byte().is_multiple_of(8);
                line.break_port(broken);
            }
            _ => {}
        }
    }
    line.break_port(false);
    // Whatever is still on its way ends, and so does every wait.
    let limit = line.now() + 20_000_000;
    while !link.is_free(at(line.now())) || line.next_byte().is_some() {
        let _ = link.poll(at(line.now()));
        let due = link.next_due().as_ticks().max(line.now() + 1);
        line.set_now(
            line.next_byte()
                .map_or(due, |byte| byte.clamp(line.now() + 1, due)),
        );
        assert!(line.now() < limit, "a wait that does not end");
    }
    seen
}

/// A driver under a list of operations. It writes nothing it was not told to, nothing that is too
/// old, and no rACT = 0 but for a reset or an activation. Returns requests and writes served.
pub fn driver(data: &[u8]) -> (u32, u32) {
    let mut seen = (0, 0);
    let mut script = Script(data);
    let line = Line::default();
    let mut driver = ThreeFinger::new(line.clone(), Config::default());
    let mut slave = Slave::three_finger();
    let mut motion: Option<(Motion<4>, u64)> = None;
    let (mut told_to_clear, mut told_a_task) = (false, false);
    while !script.0.is_empty() {
        match script.byte() % 12 {
            0..=3 => {
                let _ = driver.poll(at(line.now()));
            }
            4 => line.set_now(
                driver
                    .next_due()
                    .as_ticks()
                    .clamp(line.now(), line.now() + 5_000_000),
            ),
            5 => line.set_now(line.now() + 100 * u64::from(script.byte())),
            6 => {
                let position = [script.byte(), script.byte(), script.byte(), script.byte()];
                let asked = Motion {
                    position,
                    speed: [script.byte(); 4],
                    force: [7; 4],
                };
                motion = (script.byte() % 4 != 0).then_some((asked, line.now()));
                driver.set_motion(motion.map(|(motion, _)| motion), at(line.now()));
            }
            7 => {
                let count = usize::from(script.byte() % 64);
                let noise = script.bytes(count);
                line.send(line.now(), u64::from(script.byte()), &noise);
            }
            8 => match script.byte() % 8 {
                0 => (driver.activate(), told_to_clear = true).0,
                1 => (driver.reset(), told_to_clear = true).0,
                2 => driver.automatic_release(),
                3 => driver.set_mode(Mode::from_bits(script.byte())),
                4 => driver.set_control(Control {
                    fingers: script.byte().is_multiple_of(2),
                    scissor: script.byte().is_multiple_of(2),
                }),
                _ => continue,
            },
            9 => {
                // The gripper says something else of itself from now on.
                let at = usize::from(script.byte() % 16);
                slave.status[at] = script.byte();
            }
            10 => line.break_port(script.byte().is_multiple_of(4)),
            _ => {
                // A stretch of ordinary running.
                let end = line.now() + 30_000;
                while line.now() < end {
                    let _ = driver.poll(at(line.now()));
                    for (sent, bytes) in line.take_written() {
                        check_written(
                            &bytes,
                            sent,
                            motion,
                            told_to_clear,
                            told_a_task || driver.task().is_some(),
                        );
                        slave.serve(&line, sent + bytes.len() as u64 * super::CHARACTER, &bytes);
                        seen.0 += 1;
                        seen.1 += u32::from(bytes[1] == 0x17);
                    }
                    let due = driver.next_due().as_ticks().max(line.now() + 1);
                    line.set_now(
                        line.next_byte()
                            .map_or(due, |byte| byte.clamp(line.now() + 1, due)),
                    );
                }
            }
        }
        told_a_task |= driver.task().is_some();
        for (sent, bytes) in line.take_written() {
            check_written(&bytes, sent, motion, told_to_clear, told_a_task);
            if script.byte() % 8 != 0 {
                slave.serve(&line, sent + bytes.len() as u64 * super::CHARACTER, &bytes);
            }
        }
    }
    seen
}

fn check_written(
    bytes: &[u8],
    sent: u64,
    motion: Option<(Motion<4>, u64)>,
    may_clear: bool,
    task: bool,
) {
    let (unit, request) = Request::parse(bytes).unwrap();
    assert_eq!(unit, 9);
    let block = match request {
        Request::ReadHolding { .. } => return,
        Request::ReadWrite { values, .. } => values.bytes(),
        other => panic!("{other:?}"),
    };
    assert!(motion.is_some() || task, "written without being told");
    assert!(
        block[0] & 1 == 1 || may_clear,
        "rACT cleared without being told"
    );
    if block[0] & 0x08 != 0 {
        let (motion, stamp) = motion.unwrap();
        assert!(
            sent - stamp <= timing::STALE_MOTION.as_ticks(),
            "a motion {} µs old",
            sent - stamp
        );
        assert_eq!(block[3], motion.position[0]);
    }
}

/// A 2-Finger driver under a list of operations, on a gripper of its own family or on a 3-Finger one,
/// which answers at least every other long read. It writes nothing to the latter, and to the former
/// nothing it was not told to. Returns requests served, and writes to a gripper of its own.
pub fn family(data: &[u8]) -> (u32, u32) {
    let mut script = Script(data);
    let line = Line::default();
    let mut driver = TwoFinger::new(line.clone(), Model::TwoFinger85, Config::default());
    let foreign = script.byte().is_multiple_of(2);
    let mut slave = if foreign {
        let mut slave = Slave::three_finger();
        // At rest, following nothing: in three registers it looks like one of the others.
        (slave.status[0], slave.status[1]) = (0x31, 0);
        slave
    } else {
        Slave::two_finger()
    };
    let (mut told, mut requests, mut dropped) = (false, 0, false);
    while !script.0.is_empty() {
        match script.byte() % 8 {
            0 => {
                let asked = Motion {
                    position: [script.byte()],
                    speed: [1],
                    force: [1],
                };
                driver.set_motion(Some(asked), at(line.now()));
                told = true;
            }
            1 => match script.byte() % 8 {
                0 => driver.activate(),
                1 => driver.reset(),
                2 => driver.automatic_release(),
                3 => driver.identify(),
                _ => driver.set_motion(None, at(line.now())),
            },
            2 => {
                let count = usize::from(script.byte() % 32);
                let noise = script.bytes(count);
                line.send(line.now(), u64::from(script.byte()), &noise);
            }
            3 => line.set_now(line.now() + 100 * u64::from(script.byte())),
            _ => {
                let end = line.now() + 20_000;
                while line.now() < end {
                    let _ = driver.poll(at(line.now()));
                    told |= driver.task().is_some();
                    for (sent, bytes) in line.take_written() {
                        requests += 1;
                        let (_, request) = Request::parse(&bytes).unwrap();
                        let quantity = (request.reply_len() - 5) / 2;
                        let mut lost = script.byte().is_multiple_of(8);
                        if quantity > 3 {
                            lost &= !dropped;
                            dropped = lost;
                        }
                        // The 3-Finger gripper has no FC04, the others no fourth register.
                        let unknown = match foreign {
                            true => matches!(request, Request::ReadInput { .. }),
                            false => quantity > 3,
                        };
                        if !lost && !unknown {
                            let end = sent + bytes.len() as u64 * super::CHARACTER;
                            slave.serve(&line, end, &bytes);
                        }
                        assert!(
                            slave.writes == 0 || told && !foreign,
                            "written to a gripper of another family, or untold"
                        );
                    }
                    let due = driver.next_due().as_ticks().max(line.now() + 1);
                    line.set_now(
                        line.next_byte()
                            .map_or(due, |byte| byte.clamp(line.now() + 1, due)),
                    );
                }
            }
        }
    }
    (requests, slave.writes)
}
