//! An independent peer: tokio-modbus as the slave, our link and driver as the master, over a
//! pseudo-terminal, in real time.
#![allow(clippy::unwrap_used)]

mod port;

use gripper::driver::{Config, ThreeFinger};
use gripper::link::{self, Error, Link};
use gripper::registers::{COMMAND, STATUS, three_finger};
use gripper::rtu::{Exception, Registers, Request, Response};
use gripper::{Activation, Duration, Gripper, Motion};
use port::{Port, Timer};
use std::future::{Ready, ready};
use std::sync::{Arc, Mutex};
use tokio_modbus::prelude::{ExceptionCode, SlaveRequest};
use tokio_modbus::server::Service;
use tokio_serial::SerialStream;

/// The peer's registers: a command block and a status block of 8.
#[derive(Default)]
struct Memory {
    command: [u16; 8],
    status: [u16; 8],
}

#[derive(Clone)]
struct Peer(Arc<Mutex<Memory>>);

impl Peer {
    fn read(&self, address: u16, count: u16) -> Result<Vec<u16>, ExceptionCode> {
        let from = usize::from(address.wrapping_sub(STATUS));
        let memory = self.0.lock().unwrap();
        let words = memory.status.get(from..from + usize::from(count));
        words
            .map(<[u16]>::to_vec)
            .ok_or(ExceptionCode::IllegalDataAddress)
    }

    fn write(&self, address: u16, values: &[u16]) -> Result<(), ExceptionCode> {
        let from = usize::from(address.wrapping_sub(COMMAND));
        let mut memory = self.0.lock().unwrap();
        let words = memory
            .command
            .get_mut(from..from + values.len())
            .ok_or(ExceptionCode::IllegalDataAddress)?;
        words.copy_from_slice(values);
        // gGTO and the position echoes, as the gripper gives them.
        let command: Vec<u8> = memory
            .command
            .iter()
            .flat_map(|word| word.to_be_bytes())
            .collect();
        let mut status: Vec<u8> = memory
            .status
            .iter()
            .flat_map(|word| word.to_be_bytes())
            .collect();
        status[0] = status[0] & !8 | command[0] & 8;
        for at in [3, 6, 9, 12] {
            status[at] = command[at];
        }
        for (word, pair) in memory.status.iter_mut().zip(status.chunks(2)) {
            *word = u16::from_be_bytes([pair[0], pair[1]]);
        }
        Ok(())
    }

    fn answer(
        &self,
        request: SlaveRequest<'static>,
    ) -> Result<Option<tokio_modbus::Response>, ExceptionCode> {
        use tokio_modbus::{Request as Asked, Response as Said};
        if request.slave != 9 {
            return Ok(None);
        }
        Ok(Some(match request.request {
            Asked::ReadHoldingRegisters(address, count) => {
                Said::ReadHoldingRegisters(self.read(address, count)?)
            }
            Asked::ReadInputRegisters(address, count) => {
                Said::ReadInputRegisters(self.read(address, count)?)
            }
            Asked::WriteSingleRegister(address, value) => {
                self.write(address, &[value])?;
                Said::WriteSingleRegister(address, value)
            }
            Asked::WriteMultipleRegisters(address, values) => {
                self.write(address, &values)?;
                Said::WriteMultipleRegisters(address, values.len() as u16)
            }
            Asked::ReadWriteMultipleRegisters(from, count, to, values) => {
                self.write(to, &values)?;
                Said::ReadWriteMultipleRegisters(self.read(from, count)?)
            }
            _ => return Err(ExceptionCode::IllegalFunction),
        }))
    }
}

impl Service for Peer {
    type Request = SlaveRequest<'static>;
    type Response = Option<tokio_modbus::Response>;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Self::Response, Self::Exception>>;

    fn call(&self, request: SlaveRequest<'static>) -> Self::Future {
        ready(self.answer(request))
    }
}

/// Runs `test` with our port and the peer's memory; the peer serves in the background.
fn with_peer<T, F: Future<Output = T>>(test: impl FnOnce(Port, Arc<Mutex<Memory>>) -> F) -> T {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let (ours, theirs) = SerialStream::pair().unwrap();
        let memory = Arc::new(Mutex::new(Memory::default()));
        let server = tokio_modbus::server::rtu::Server::new(theirs);
        let serving = tokio::spawn(server.serve_forever(Peer(memory.clone())));
        let outcome = test(Port::new(ours), memory).await;
        serving.abort();
        outcome
    })
}

/// Asks once; what comes back as a frame of slave 9.
async fn ask(link: &mut Link<Port>, timer: &Timer, request: Request<'_>) -> Result<Vec<u8>, Error> {
    loop {
        if link.poll(timer.now()).is_none() && link.start(&request, &[], timer.now()).is_ok() {
            break;
        }
        timer.rest().await;
    }
    loop {
        if let Some(outcome) = link.poll(timer.now()) {
            return outcome.map(|response| {
                let mut bytes = vec![0; response.buffer_len()];
                response.emit(9, &mut bytes).unwrap();
                bytes
            });
        }
        timer.rest().await;
    }
}

fn frame(response: Response<'_>) -> Vec<u8> {
    let mut bytes = vec![0; response.buffer_len()];
    response.emit(9, &mut bytes).unwrap();
    bytes
}

/// A busy machine answers late: patience for a test in real time.
const PATIENCE: Duration = Duration::from_millis(1_000);

#[test]
fn every_function_code_works_against_tokio_modbus() {
    with_peer(|port, memory| async move {
        let timer = Timer::start();
        let config = link::Config {
            response: PATIENCE,
            ..link::Config::new(9, 115_200)
        };
        let mut link = Link::new(port, config);
        memory.lock().unwrap().status = [
            0xF1FF, 0x0000, 0x0600, 0x0006, 0x0000, 0x0600, 0x0089, 0x0000,
        ];
        let status = [0xF1, 0xFF, 0, 0, 6, 0, 0, 6, 0, 0, 6, 0, 0, 0x89, 0, 0];
        let registers = |bytes: &'static [u8]| Registers::from_bytes(bytes).unwrap();
        let held = frame(Response::ReadHolding(
            Registers::from_bytes(&status).unwrap(),
        ));
        let read = Request::ReadHolding {
            address: STATUS,
            quantity: 8,
        };
        assert_eq!(ask(&mut link, &timer, read).await, Ok(held));
        let input = frame(Response::ReadInput(
            Registers::from_bytes(&status[..6]).unwrap(),
        ));
        let read_input = Request::ReadInput {
            address: STATUS,
            quantity: 3,
        };
        assert_eq!(ask(&mut link, &timer, read_input).await, Ok(input));
        let single = Request::WriteSingle {
            address: COMMAND,
            value: 0x0900,
        };
        let wrote = frame(Response::WriteSingle {
            address: COMMAND,
            value: 0x0900,
        });
        assert_eq!(ask(&mut link, &timer, single).await, Ok(wrote));
        let multiple = Request::WriteMultiple {
            address: COMMAND,
            values: registers(&[9, 0, 0, 255, 255, 255]),
        };
        let wrote = frame(Response::WriteMultiple {
            address: COMMAND,
            quantity: 3,
        });
        assert_eq!(ask(&mut link, &timer, multiple).await, Ok(wrote));
        assert_eq!(
            memory.lock().unwrap().command[..3],
            [0x0900, 0x00FF, 0xFFFF]
        );
        let exchange = Request::ReadWrite {
            read_address: STATUS,
            read_quantity: 2,
            write_address: COMMAND,
            values: registers(&[9, 12, 0, 0x80]),
        };
        let exchanged = frame(Response::ReadWrite(registers(&[0xF9, 0xFF, 0, 0x80])));
        assert_eq!(ask(&mut link, &timer, exchange).await, Ok(exchanged));
        let beyond = Request::ReadHolding {
            address: STATUS,
            quantity: 9,
        };
        assert_eq!(
            ask(&mut link, &timer, beyond).await,
            Err(Error::Exception(Exception::ILLEGAL_ADDRESS))
        );
        assert_eq!(link.counters().replies, 5);
    });
}

#[test]
fn the_driver_runs_its_cycle_against_tokio_modbus() {
    with_peer(|port, memory| async move {
        let timer = Timer::start();
        memory.lock().unwrap().status = [
            0xF1FF, 0x0000, 0x0600, 0x0006, 0x0000, 0x0600, 0x0089, 0x0000,
        ];
        let mut driver = ThreeFinger::new(
            port,
            Config {
                response: PATIENCE,
                ..Config::default()
            },
        );
        let (mut cycles, mut accepted) = (0, 0);
        while cycles < 30 {
            let position = [cycles as u8; 4];
            let motion = Motion {
                position,
                speed: [255; 4],
                force: [100; 4],
            };
            driver.set_motion(Some(motion), timer.now());
            while let Some(event) = driver.poll(timer.now()) {
                let Some(ended) = event.ended() else {
                    continue;
                };
                let status = ended.unwrap();
                assert_eq!(status.activation, Activation::Ready);
                cycles += 1;
                accepted += u32::from(driver.accepted());
            }
            timer.rest().await;
        }
        let command = memory.lock().unwrap().command;
        assert_eq!(command[0], 0x090C);
        let block: Vec<u8> = command.iter().flat_map(|word| word.to_be_bytes()).collect();
        let block: [u8; 16] = block.try_into().unwrap();
        assert!(
            three_finger::Command::decode(&block)
                .unwrap()
                .individual_scissor
        );
        assert!(accepted >= 25, "{accepted} of {cycles} accepted");
    });
}
