use super::*;
use crate::{Device, MemoryWire};

/// Sends back what it gets.
#[derive(Default)]
struct Loopback(VecDeque<u8>);

impl Device for Loopback {
    fn receive(&mut self, bytes: &[u8], _: Instant) {
        self.0.extend(bytes);
    }
    fn transmit(&mut self, _: Instant, out: &mut [u8]) -> usize {
        let count = out.len().min(self.0.len());
        for (slot, byte) in out.iter_mut().zip(self.0.drain(..count)) {
            *slot = byte;
        }
        count
    }
    fn next_due(&self) -> Option<Instant> {
        None
    }
    fn baud(&self) -> u32 {
        460_800
    }
}

fn port(seed: u64, to_device: Faults, to_client: Faults) -> (Clock, Faulty<MemoryWire>) {
    let clock = Clock::new();
    let wire = MemoryWire::new(&clock, Loopback::default(), 460_800);
    let port = Faulty::new(wire, &clock, seed, to_device, to_client);
    (clock, port)
}

fn exchange(clock: &Clock, port: &mut Faulty<MemoryWire>, bytes: &[u8]) -> Vec<u8> {
    let mut back = Vec::new();
    let mut chunk = [0; 64];
    port.write(bytes).unwrap();
    let end = clock.now() + Duration::from_millis(200);
    while clock.now() < end {
        while port.read_ready().unwrap() {
            let count = port.read(&mut chunk).unwrap();
            back.extend_from_slice(&chunk[..count]);
        }
        clock.wait_until(end);
    }
    back
}

#[test]
fn without_faults_every_byte_comes_once_and_in_order() {
    let (clock, mut port) = port(1, Faults::default(), Faults::default());
    let sent: Vec<u8> = (0..=255).collect();
    assert_eq!(exchange(&clock, &mut port, &sent), sent);
    assert_eq!(port.control().counters(), Counters::default());
}

#[test]
fn each_fault_does_what_it_says_and_is_counted() {
    let sent = [0x55; 200];
    let with = |faults: Faults| {
        let (clock, mut port) = port(7, faults, Faults::default());
        let back = exchange(&clock, &mut port, &sent);
        (back, port.control().counters())
    };
    let (back, seen) = with(Faults {
        drop: 0.1,
        ..Faults::default()
    });
    assert!(seen.dropped > 5 && back.len() as u64 == 200 - seen.dropped);
    let (back, seen) = with(Faults {
        flip: 0.1,
        ..Faults::default()
    });
    let flipped = back
        .iter()
        .filter(|b| (**b ^ 0x55).count_ones() == 1)
        .count();
    assert!(seen.flipped > 5 && flipped as u64 == seen.flipped);
    let (back, seen) = with(Faults {
        duplicate: 0.1,
        ..Faults::default()
    });
    assert!(seen.duplicated > 5 && back.len() as u64 == 200 + seen.duplicated);
    let (back, seen) = with(Faults {
        delay: 0.1,
        ..Faults::default()
    });
    assert!(seen.delayed > 5 && back == sent, "late, and all there");
    let (back, seen) = with(Faults {
        cut_after: Some(120),
        ..Faults::default()
    });
    assert_eq!((back.len(), seen.cut), (120, 80));
}

#[test]
fn the_same_seed_gives_the_same_faults() {
    let faults = Faults {
        drop: 0.2,
        flip: 0.2,
        duplicate: 0.2,
        delay: 0.2,
        ..Faults::default()
    };
    let run = |seed| {
        let (clock, mut port) = port(seed, faults, faults);
        exchange(&clock, &mut port, &[9; 300])
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

#[test]
fn a_cut_can_be_repaired() {
    let (clock, mut port) = port(1, Faults::default(), Faults::default());
    port.control().cut(true);
    assert_eq!(exchange(&clock, &mut port, &[1, 2]), []);
    port.control().cut(false);
    assert_eq!(exchange(&clock, &mut port, &[3, 4]), [3, 4]);
}

#[test]
fn an_echoing_adapter_gives_back_what_was_written() {
    let (clock, mut port) = port(1, Faults::default(), Faults::default());
    port.control().echo(true);
    let mut back = exchange(&clock, &mut port, &[1, 2, 3]);
    assert_eq!(
        back.split_off(3),
        [1, 2, 3],
        "the device's own answer comes after"
    );
    assert_eq!(back, [1, 2, 3]);
}
