//! An independent peer: tokio-modbus as client of the virtual gripper, over its terminal and over TCP.
#![allow(clippy::unwrap_used)]

use std::time::Duration;

use rig::gripper::{Config, Family, VirtualGripper, tcp};
use rig::pty::PtyDevice;
use tokio::time::{sleep, timeout};
use tokio_modbus::client::{Context, Reader, Writer};
use tokio_modbus::prelude::*;
use tokio_serial::SerialStream;

const LIMIT: Duration = Duration::from_secs(2);

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap()
}

async fn status(client: &mut Context, registers: u16) -> Vec<u16> {
    // The gripper refreshes every 5 ms and leaves a sooner request unanswered.
    sleep(Duration::from_millis(6)).await;
    let answer = timeout(LIMIT, client.read_holding_registers(0x07D0, registers)).await;
    answer.unwrap().unwrap().unwrap()
}

async fn command(client: &mut Context, registers: &[u16]) {
    sleep(Duration::from_millis(6)).await;
    let answer = timeout(LIMIT, client.write_multiple_registers(0x03E8, registers)).await;
    answer.unwrap().unwrap().unwrap();
}

async fn wait_for(client: &mut Context, what: &str, registers: u16, seen: impl Fn(&[u16]) -> bool) {
    for _ in 0..1_000 {
        if seen(&status(client, registers).await) {
            return;
        }
        sleep(Duration::from_millis(10)).await;
    }
    panic!("never {what}");
}

fn serial(path: &std::path::Path, unit: u8) -> Context {
    let builder = tokio_serial::new(path.to_string_lossy(), 115_200);
    rtu::attach_slave(SerialStream::open(&builder).unwrap(), Slave(unit))
}

#[test]
fn tokio_modbus_activates_moves_and_reads_the_gripper_over_its_terminal() {
    let gripper = VirtualGripper::new(Config::default());
    let handle = PtyDevice::spawn(Box::new(gripper.clone()), None).unwrap();
    runtime().block_on(async {
        let mut client = serial(handle.path(), 9);
        assert_eq!(status(&mut client, 8).await[0], 0x0000);
        command(&mut client, &[0x0100]).await;
        wait_for(&mut client, "activating", 1, |r| r[0] == 0x1100).await;
        wait_for(&mut client, "active", 1, |r| r[0] == 0x3100).await;
        // rGTO, rICF and rICS; 30, 40, 50 and 140 at full speed.
        let moved = [
            0x090C, 0x001E, 0xFF64, 0x28FF, 0x6432, 0xFF64, 0x8CFF, 0x6400,
        ];
        sleep(Duration::from_millis(6)).await;
        let cycle = client.read_write_multiple_registers(0x07D0, 8, 0x03E8, &moved);
        assert_eq!(
            timeout(LIMIT, cycle).await.unwrap().unwrap().unwrap().len(),
            8
        );
        wait_for(&mut client, "there", 8, |r| r[0] == 0xF9FF).await;
        let registers = status(&mut client, 8).await;
        // gPRA; gPOA gCUA; gPRB gPOB; gCUB gPRC; gPOC gCUC; gPRS gPOS.
        assert_eq!(
            registers[1..7],
            [0x001E, 0x1E00, 0x2828, 0x0032, 0x3200, 0x8C8C]
        );
    });
    assert_eq!(gripper.positions(), [30.0, 40.0, 50.0, 140.0]);
}

#[test]
fn tokio_modbus_reads_a_2f_by_both_read_functions() {
    let gripper = VirtualGripper::new(Config::of(Family::TwoFinger85));
    let handle = PtyDevice::spawn(Box::new(gripper.clone()), None).unwrap();
    runtime().block_on(async {
        let mut client = serial(handle.path(), 9);
        command(&mut client, &[0x0100]).await;
        wait_for(&mut client, "active", 3, |r| r[0] == 0x3100).await;
        command(&mut client, &[0x0900, 0x0064, 0xFF40]).await;
        wait_for(&mut client, "there", 3, |r| r[0] == 0xF900).await;
        sleep(Duration::from_millis(6)).await;
        let answer = timeout(LIMIT, client.read_input_registers(0x07D0, 3)).await;
        assert_eq!(answer.unwrap().unwrap().unwrap(), [0xF900, 0x0064, 0x6400]);
    });
    assert_eq!(gripper.positions()[0], 100.0);
}

#[test]
fn tokio_modbus_moves_the_gripper_over_tcp() {
    let gripper = VirtualGripper::new(Config::default());
    let server = tcp::serve(&gripper, "127.0.0.1:0", &rig::Clock::system()).unwrap();
    runtime().block_on(async {
        let connect = tokio_modbus::client::tcp::connect_slave(server.address(), Slave(tcp::UNIT));
        let mut client = timeout(LIMIT, connect).await.unwrap().unwrap();
        command(&mut client, &[0x0100]).await;
        wait_for(&mut client, "active", 1, |r| r[0] == 0x3100).await;
        command(&mut client, &[0x0900, 0x0050, 0xFF40]).await;
        wait_for(&mut client, "there", 1, |r| r[0] == 0xF9FF).await;
        let answer = timeout(LIMIT, client.read_input_registers(0x07D0, 8)).await;
        assert_eq!(answer.unwrap().unwrap().unwrap()[2] >> 8, 0x50);
    });
}
