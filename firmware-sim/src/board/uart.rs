//! The CMSDK APB UARTs (Arm DDI 0479, chapter 4.3): interrupts move bytes between the lines and bounded queues.
//!
//! Nothing here waits. A full transmit queue takes what fits; a byte that finds the receive queue full is counted and
//! dropped. Queues are used only inside critical sections, so they are never borrowed twice; the borrows are tried all the
//! same, so that no panic is linked.

use bridge::glove::sc18im::{BaudRefused, SetBaud};
use core::cell::{Cell, RefCell};
use critical_section::{CriticalSection, Mutex};
use heapless::Deque;

/// Bytes a line's receive queue holds.
pub const RECEIVE_QUEUE: usize = 2048;
/// Bytes a line's transmit queue holds.
pub const TRANSMIT_QUEUE: usize = 1024;

const DATA: usize = 0x00;
const STATE: usize = 0x04;
const CONTROL: usize = 0x08;
const INTERRUPT: usize = 0x0C;
const BAUD_DIVIDER: usize = 0x10;

const STATE_TRANSMIT_FULL: u32 = 1 << 0;
const STATE_RECEIVE_FULL: u32 = 1 << 1;
const STATE_RECEIVE_OVERRUN: u32 = 1 << 3;
const CONTROL_ALL: u32 = 0b1111; // transmitter, receiver and an interrupt for each
const INTERRUPT_TRANSMIT: u32 = 1 << 0;
const INTERRUPT_RECEIVE: u32 = 1 << 1;

const BAUD: u32 = 115_200;
/// Least value of the divider (Arm DDI 0479, chapter 4.3).
const SMALLEST_DIVIDER: u32 = 16;

/// Which line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Uart {
    /// UART 0: the host protocol.
    Host,
    /// UART 1: the glove's serial multiplexer.
    Glove,
    /// UART 2: the gripper.
    Gripper,
}

struct Line {
    received: RefCell<Deque<u8, RECEIVE_QUEUE>>,
    to_send: RefCell<Deque<u8, TRANSMIT_QUEUE>>,
    /// Bytes lost because the queue or the receiver was full.
    lost: Cell<u32>,
}

impl Line {
    const fn new() -> Self {
        Self {
            received: RefCell::new(Deque::new()),
            to_send: RefCell::new(Deque::new()),
            lost: Cell::new(0),
        }
    }

    fn lose(&self) {
        self.lost.set(self.lost.get().saturating_add(1));
    }
}

static LINES: [Mutex<Line>; 3] = [
    Mutex::new(Line::new()),
    Mutex::new(Line::new()),
    Mutex::new(Line::new()),
];
/// Bytes have come since [`bytes_came`] was asked.
static CAME: Mutex<Cell<bool>> = Mutex::new(Cell::new(false));
static OPENED: Mutex<Cell<[bool; 3]>> = Mutex::new(Cell::new([false; 3]));

impl Uart {
    const fn index(self) -> usize {
        self as usize
    }

    fn line(self, section: CriticalSection<'_>) -> &Line {
        let [host, glove, gripper] = &LINES;
        match self {
            Self::Host => host,
            Self::Glove => glove,
            Self::Gripper => gripper,
        }
        .borrow(section)
    }

    const fn base(self) -> usize {
        match self {
            Self::Host => 0x4000_4000,
            Self::Glove => 0x4000_5000,
            Self::Gripper => 0x4000_6000,
        }
    }

    fn read(self, register: usize) -> u32 {
        // SAFETY: the address is a register of a UART that this board has (Arm AN386, memory map); reading it has no
        // effect on memory.
        unsafe { core::ptr::read_volatile((self.base() + register) as *const u32) }
    }

    fn write(self, register: usize, value: u32) {
        // SAFETY: as for `read`; the register is not memory that Rust owns.
        unsafe { core::ptr::write_volatile((self.base() + register) as *mut u32, value) }
    }

    /// Moves bytes while the line lets it; called by the line's interrupts and after a write.
    pub(super) fn service(self) {
        critical_section::with(|section| {
            let line = self.line(section);
            self.write(INTERRUPT, INTERRUPT_TRANSMIT | INTERRUPT_RECEIVE);
            if self.take_received(line) {
                CAME.borrow(section).set(true);
            }
            self.give_to_send(line);
        });
    }

    /// Returns whether there were bytes.
    fn take_received(self, line: &Line) -> bool {
        // Bounded: a line that never ends must not keep the processor.
        for taken in 0..16 {
            let state = self.read(STATE);
            if state & STATE_RECEIVE_OVERRUN != 0 {
                self.write(STATE, STATE_RECEIVE_OVERRUN);
                line.lose();
            }
            if state & STATE_RECEIVE_FULL == 0 {
                return taken > 0;
            }
            let byte = self.read(DATA) as u8;
            let kept = line
                .received
                .try_borrow_mut()
                .is_ok_and(|mut queue| queue.push_back(byte).is_ok());
            if !kept {
                line.lose();
            }
        }
        true
    }

    fn give_to_send(self, line: &Line) {
        let Ok(mut queue) = line.to_send.try_borrow_mut() else {
            return;
        };
        while self.read(STATE) & STATE_TRANSMIT_FULL == 0 {
            let Some(byte) = queue.pop_front() else {
                return;
            };
            self.write(DATA, u32::from(byte));
        }
    }
}

/// One line as the drivers see it: `embedded-io`, and it never waits.
pub struct Port {
    uart: Uart,
}

impl Port {
    /// Sets `uart` up at 115200 baud. `None` if it is open already.
    pub(super) fn open(uart: Uart) -> Option<Self> {
        let first = critical_section::with(|section| {
            let opened = OPENED.borrow(section);
            let mut flags = opened.get();
            let first = !core::mem::replace(&mut flags[uart.index()], true);
            opened.set(flags);
            first
        });
        if !first {
            return None;
        }
        uart.write(BAUD_DIVIDER, super::clock::CLOCK_HZ / BAUD);
        uart.write(CONTROL, CONTROL_ALL);
        Some(Self { uart })
    }
}

impl SetBaud for Port {
    /// What is queued goes out at the new speed: the caller waits until it has left. What came at the old one is thrown away.
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused> {
        let divider = super::clock::CLOCK_HZ / baud.max(1);
        // The receiver samples each bit at one of 16 ticks of the divider.
        if divider < SMALLEST_DIVIDER {
            return Err(BaudRefused::Unsupported(baud));
        }
        critical_section::with(|section| {
            self.uart.write(BAUD_DIVIDER, divider);
            if let Ok(mut received) = self.uart.line(section).received.try_borrow_mut() {
                received.clear();
            }
        });
        Ok(())
    }
}

impl embedded_io::ErrorType for Port {
    type Error = core::convert::Infallible;
}

impl embedded_io::ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(critical_section::with(|section| {
            self.uart
                .line(section)
                .received
                .try_borrow()
                .is_ok_and(|queue| !queue.is_empty())
        }))
    }
}

impl embedded_io::Read for Port {
    /// Takes what has arrived, which may be nothing: it never waits.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        Ok(critical_section::with(|section| {
            let Ok(mut received) = self.uart.line(section).received.try_borrow_mut() else {
                return 0;
            };
            let mut count = 0;
            for place in buffer.iter_mut() {
                let Some(byte) = received.pop_front() else {
                    break;
                };
                *place = byte;
                count += 1;
            }
            count
        }))
    }
}

impl embedded_io::Write for Port {
    /// Queues what fits, which may be nothing: it never waits.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        let queued = critical_section::with(|section| {
            let Ok(mut to_send) = self.uart.line(section).to_send.try_borrow_mut() else {
                return 0;
            };
            bytes
                .iter()
                .take_while(|&&byte| to_send.push_back(byte).is_ok())
                .count()
        });
        self.uart.service();
        Ok(queued)
    }

    /// The queue drains by itself; there is nothing to wait for.
    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// Whether bytes have come since the last call.
pub(super) fn bytes_came(section: CriticalSection<'_>) -> bool {
    CAME.borrow(section).replace(false)
}

/// Bytes that each line has lost since the start: host, glove, gripper.
pub fn bytes_lost() -> [u32; 3] {
    critical_section::with(|section| LINES.each_ref().map(|line| line.borrow(section).lost.get()))
}
