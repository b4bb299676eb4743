//! One request, one reply: a bare link on the test's line.

use super::{Line, at, frame_of, run_link, settle};
use gripper::link::{Config, Error, Link};
use gripper::registers::{COMMAND, STATUS};
use gripper::rtu::{Registers, Request, Response, crc16};

pub const STATUS_BYTES: [u8; 16] = [
    0x39, 0xC0, 0, 0xFF, 8, 15, 0, 8, 16, 0, 8, 15, 0, 0x89, 0, 0,
];
pub const BLOCK: [u8; 16] = [
    9, 12, 0, 128, 255, 150, 128, 255, 150, 128, 255, 150, 128, 255, 150, 0,
];
pub const RESERVED: &[u8] = &gripper::registers::three_finger::STATUS_RESERVED;
/// From the end of a request to the start of the reply, µs.
pub const TURNAROUND: u64 = 1_750;

pub fn read(quantity: u16) -> Request<'static> {
    Request::ReadHolding {
        address: STATUS,
        quantity,
    }
}

pub fn exchange(quantity: u16) -> Request<'static> {
    let values = Registers::from_bytes(&BLOCK).unwrap();
    Request::ReadWrite {
        read_address: STATUS,
        read_quantity: quantity,
        write_address: COMMAND,
        values,
    }
}

pub fn write() -> Request<'static> {
    Request::WriteMultiple {
        address: COMMAND,
        values: Registers::from_bytes(&BLOCK).unwrap(),
    }
}

pub fn status(quantity: usize) -> Vec<u8> {
    frame_of(&Response::ReadHolding(
        Registers::from_bytes(&STATUS_BYTES[..2 * quantity]).unwrap(),
    ))
}

pub fn exchanged() -> Vec<u8> {
    frame_of(&Response::ReadWrite(
        Registers::from_bytes(&STATUS_BYTES).unwrap(),
    ))
}

pub fn sealed(body: &[u8]) -> Vec<u8> {
    let mut frame = body.to_vec();
    frame.extend_from_slice(&crc16(body).to_le_bytes());
    frame
}

pub struct Bench {
    pub line: Line,
    pub link: Link<Line>,
}

impl Bench {
    pub fn new() -> Self {
        let line = Line::default();
        let mut link = Link::new(line.clone(), Config::new(9, 115_200));
        settle(&line, &mut link);
        Self { line, link }
    }

    /// Sends `request`; the line answers with `reply` after the turnaround, bytes `spacing` apart.
    pub fn ask(
        &mut self,
        request: Request<'_>,
        reply: &[u8],
        spacing: u64,
    ) -> Result<Vec<u8>, Error> {
        settle(&self.line, &mut self.link);
        assert_eq!(
            self.link.start(&request, RESERVED, at(self.line.now())),
            Ok(())
        );
        let until = self.line.now() + 200_000;
        let mut device = |line: &Line, end, _: &[u8]| line.send(end + TURNAROUND, spacing, reply);
        run_link(&self.line, &mut self.link, until, &mut device).expect("every wait ends")
    }
}
