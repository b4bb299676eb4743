use super::*;
use crate::Duration;

/// Sends back each byte, one added, after a pause.
struct Echo {
    pause: Duration,
    waiting: VecDeque<(Instant, u8)>,
}

impl Echo {
    fn line(pause_us: u64, baud: u32) -> Line<Echo> {
        let pause = Duration::from_micros(pause_us);
        Line::new(
            Echo {
                pause,
                waiting: VecDeque::new(),
            },
            baud,
        )
    }
}

impl Device for Echo {
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        self.waiting
            .extend(bytes.iter().map(|b| (now + self.pause, b.wrapping_add(1))));
    }
    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        let due = self
            .waiting
            .iter()
            .take_while(|(t, _)| *t <= now)
            .count()
            .min(out.len());
        for (slot, (_, byte)) in out.iter_mut().zip(self.waiting.drain(..due)) {
            *slot = byte;
        }
        due
    }
    fn next_due(&self) -> Option<Instant> {
        self.waiting.front().map(|(t, _)| *t)
    }
    fn baud(&self) -> u32 {
        115_200
    }
}

fn at(us: u64) -> Instant {
    Instant::from_ticks(us)
}

#[test]
fn every_byte_takes_ten_bit_times_each_way() {
    let mut line = Echo::line(1_000, 115_200);
    assert_eq!(line.write(&[1, 2, 3], at(0)), 3);
    // 86.8 us to the device, 1,000 us in it, 86.8 us back.
    assert_eq!(line.available(at(1_173)), 0);
    assert_eq!(line.available(at(1_174)), 1);
    assert_eq!(line.available(at(1_348)), 3);
    let mut out = [0; 8];
    assert_eq!(line.read(&mut out, at(2_000)), 3);
    assert_eq!(&out[..3], &[2, 3, 4]);
    assert_eq!(line.traffic(), (3, 3));
}

#[test]
fn ten_thousand_characters_do_not_drift() {
    let mut line = Echo::line(0, 115_200);
    for _ in 0..3 {
        line.write(&[0; 3_000], at(0));
    }
    // The queue holds 4,096 and refuses the rest; 4,096 x 86.8055 us = 355.555 ms.
    let last = line.to_device.back().unwrap().arrival;
    assert!(last.abs_diff(355_555_555) < 10_000, "{last}");
}

#[test]
fn a_wrong_baud_gives_noise_both_ways() {
    let mut line = Echo::line(0, 9_600);
    line.write(&[7; 100], at(0));
    let mut out = [0; 512];
    let count = line.read(&mut out, at(1_000_000));
    assert!(count > 100, "echo and noise, got {count}");
    let right = out[..count].iter().filter(|b| **b == 8).count();
    assert!(right < count / 8, "{right} of {count} right by chance");
}

#[test]
fn what_waits_to_leave_when_the_client_changes_its_speed_leaves_at_the_new_one() {
    let mut line = Echo::line(0, 115_200);
    line.write(&[1, 2, 3, 4], at(0));
    // In the middle of the second character.
    line.run_until(at(130));
    line.set_baud(9_600, at(130));
    let mut out = [0; 16];
    let count = line.read(&mut out, at(100_000));
    // The first was right; its echo was under way. None of the others is what it was.
    let right = out[..count].iter().filter(|b| (2..=5).contains(*b)).count();
    assert_eq!(right, 0, "{:?}", &out[..count]);
    // Back at the right speed nothing is left of it.
    line.set_baud(115_200, at(100_000));
    line.write(&[7], at(100_000));
    assert_eq!(line.read(&mut out, at(101_000)), 1);
    assert_eq!(out[0], 8);
}

#[test]
fn a_cut_wire_lets_so_many_characters_pass_and_no_more() {
    for cut in 0..8 {
        let mut line = Echo::line(0, 115_200);
        line.cut_after(cut);
        line.write(&[1, 2, 3], at(0));
        let mut out = [0; 8];
        let answered = line.read(&mut out, at(10_000)) as u64;
        // Characters go out and come back in turns here.
        assert_eq!(answered, (cut / 2).min(3), "{cut}");
        assert_eq!(line.passed(), cut.min(6));
        assert_eq!(line.is_cut(), cut <= 6);
    }
}

#[test]
fn events_lie_in_the_future_and_end() {
    let mut line = Echo::line(500, 115_200);
    line.write(&[1, 2], at(0));
    let mut now = at(0);
    let mut events = 0;
    while let Some(next) = line.next_event(now) {
        assert!(next > now);
        now = next;
        events += 1;
        assert!(events < 20);
    }
    assert_eq!(line.available(now), 2);
}
