//! A glove on a PC's port whose power is cut in mid-session, in real time.

use crate::support::devices::behind_pty;

use std::time::{Duration, Instant};

use host::clock::Clock;
use host::glove::scan::{Config, Scanner};
use host::interrupt::Interrupt;
use host::lines::port::{BAUD, Port};
use rig::glove::VirtualGlove;

#[test]
fn a_power_cycled_glove_comes_back_on_its_port_by_itself() {
    let still = |_: f64| [0.0; 25];
    let glove = VirtualGlove::new(Box::new(still), rig::glove::Config::at_baud(BAUD));
    let (device, _) = behind_pty(glove.clone());
    let port = Port::open(device.path(), BAUD).expect("opens");
    let mut scanner = Scanner::new(port, Config::default()).with_set_baud();
    let clock = Clock::start();
    let mut whole = |wanted: u16, limit: Duration| {
        let end = Instant::now() + limit;
        while Instant::now() < end {
            if scanner
                .poll(clock.now())
                .is_some_and(|frame| frame.good() == wanted)
            {
                return true;
            }
            std::thread::sleep(Duration::from_micros(300));
        }
        false
    };
    assert!(whole(0xFFFF, Duration::from_secs(20)), "up");
    glove.power(false, device.clock().now());
    assert!(!whole(0xFFFF, Duration::from_secs(1)), "without power");
    glove.power(true, device.clock().now());
    assert!(whole(0xFFFF, Duration::from_secs(20)), "back");
    assert!(scanner.counters().starts.iter().all(|starts| *starts == 2));
    assert!(scanner.link_counters().restarts >= 1);
}

#[test]
fn a_glove_left_at_another_speed_is_found_there_and_only_a_slower_one_is_switched() {
    for baud in [9_600, 230_400, 460_800] {
        let still = |_: f64| [0.0; 25];
        let glove = VirtualGlove::new(Box::new(still), rig::glove::Config::at_baud(baud));
        let (device, _) = behind_pty(glove.clone());
        let found = host::probe::open_glove(device.path(), &Interrupt::never().expect("a pipe"))
            .expect("found");
        assert_eq!(found.found, baud);
        assert_eq!(found.port.baud(), baud.max(BAUD));
        assert_eq!(rig::Device::baud(&glove), baud.max(BAUD));
    }
}
